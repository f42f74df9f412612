"""The Kalman filter of lqr beside python-control's, and designs on plants with internal states."""

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from fowt_env import build_scene, linearize, simulate
from fowt_env.controllers import make
from fowt_env.controllers.lqr.design import (
    MOMENT,
    N_PLANT,
    PLANT,
    SENSORS,
    WIND,
    design_model,
    estimator_gain,
    scene_at,
)
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import named_cases
from fowt_env.training.evaluation.metrics import metrics


@pytest.mark.parametrize("wind", [12, 18])
def test_the_filter_is_that_of_python_control(wind):
    """Variances of sensors and plant written out; the moment in 10 MN m, for states of one order."""
    control = pytest.importorskip("control")
    model, dt = design_model(build_scene("oc3_hywind", wind=18.0, fidelity="reference"), wind), 0.1
    scale = np.ones(len(model.A))
    scale[MOMENT] = 1e7
    a, c = model.A / scale[:, None] * scale, model.C * scale
    intensity = model.G @ model.G.T
    intensity[range(N_PLANT), range(N_PLANT)] += [1e-6, 1e-8, 1e-4, 1e-8, 9e-6, 1e-6]
    intensity[MOMENT, MOMENT] += 4e10
    intensity = intensity / np.outer(scale, scale)
    over_period = quad_vec(lambda s: expm(a * s) @ intensity @ expm(a.T * s), 0.0, dt)[0]
    sensors = np.diag([9e-6, 2.5e-5, 1e-6, 4e-8, 9e-4])
    # the gain of the prediction: that of the correction, then a period on
    gain, _, _ = control.dlqe(expm(a * dt), np.eye(len(a)), c, over_period, sensors)
    found = expm(a * dt) @ (estimator_gain(model, dt) / scale[:, None])
    assert found == pytest.approx(gain, rel=1e-4, abs=1e-6 * np.abs(gain).max())


@pytest.mark.nightly
def test_the_design_has_what_a_tower_that_bends_passes_on():
    """Platform pitch and rotor speed that a lasting wind asks for: those of the whole linear model.

    Within 2 %: the design has no heave. Cut off, the tower would keep the thrust to itself.
    """
    scene = build_scene("iea15_volturnus_s", wind=18.0, fidelity="fast", tower="modes")
    design, whole = design_model(scene, 18.0), linearize(scene_at(scene, 18.0))
    found = -design.C[:, :N_PLANT] @ np.linalg.solve(
        design.A[:N_PLANT, :N_PLANT], design.A[:N_PLANT, WIND + 1]
    )
    wanted = whole.response(1e-5, ("wind_speed",))[0, :, 0].real
    assert PLANT.index("platform_pitch") == 1
    for name in ("rotor_speed", "platform_pitch"):
        assert found[SENSORS.index(name)] == pytest.approx(wanted[whole.output_index(name)], rel=0.02)


def test_a_turbine_whose_winds_have_no_sea_at_the_site_is_named():
    with pytest.raises(
        InputError, match=r"no design of lqr.*turbine 'liu_1_50' in wind of 1 m/s.*gulf_of_maine_normal"
    ):
        make("lqr", read_turbine("liu_1_50"), 0.1).prepare(
            build_scene("liu_1_50", wind=2.0, fidelity="reference")
        )


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["lqr", "mpc"])
def test_on_a_tower_that_bends_the_laws_do_as_on_a_rigid_one(name):
    if name == "mpc":
        pytest.importorskip("osqp", reason='OSQP is not installed: pip install "fowt-env[mpc]"')
    (case,) = named_cases("ntm_14")
    found = {}
    for tower in ("rigid", "modes"):
        scene = build_scene(
            case.platform, wind=case.wind, sea=case.sea, seed=1003, duration=660.0, fidelity="standard",
            tower=tower,
        )  # fmt: skip
        found[tower] = metrics(simulate(scene, name, duration=660.0, sensors="standard"), 60.0)
    for metric in ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]"):
        assert found["modes"][metric] == pytest.approx(found["rigid"][metric], rel=0.03), metric
