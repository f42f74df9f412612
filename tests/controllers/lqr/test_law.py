"""lqr on a training seed beside the baseline, and what it refuses."""

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.caches import clear_caches
from fowt_env.controllers.lqr.design import LQGSettings, design_models
from fowt_env.controllers.lqr.law import LQR, POWER_LIMIT
from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import named_cases
from fowt_env.training.evaluation.metrics import metrics


def test_lqr_betters_the_baseline_at_no_more_pitch_travel_on_a_training_seed():
    (case,) = named_cases("ntm_16")
    scene = build_scene(case.platform, wind=case.wind, sea=case.sea, seed=1003, **case.options)
    ours, theirs = (metrics(simulate(scene, name, duration=660.0), 60.0) for name in ("lqr", "gspi_oc3"))
    for name in ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]"):
        assert ours[name] < 0.9 * theirs[name]
    assert ours["blade_pitch_travel_[deg/s]"] <= 1.02 * theirs["blade_pitch_travel_[deg/s]"]


@pytest.mark.parametrize("wind", [8.0, 14.0, 24.0])
def test_lqr_stays_at_the_steady_state(wind):
    frame = simulate(build_scene("oc3_hywind", wind=wind, fidelity="standard"), "lqr", duration=120.0)
    assert frame["RotSpeed_[rpm]"].std() < 0.05
    assert frame["PtfmPitch_[deg]"].std() < 0.1


@pytest.mark.parametrize("law", ["lqr", "mpc"])
def test_a_slow_rotor_with_pitched_blades_comes_up_to_speed(law):
    scene = build_scene("oc3_hywind", wind=18.0, fidelity="standard")
    frame = simulate(scene, law, duration=60.0, initial={"RotSpeed": 6.0})
    assert frame["RotSpeed_[rpm]"].max() < 1.05 * 12.1


def test_power_is_limited_in_an_extreme_gust():
    """Torque falls while the rotor turns faster than at the limit of power; its speed is an estimate."""
    gust = {"kind": "eog", "speed": 24.0, "start": 60.0, "class": "A"}
    frame = simulate(build_scene("oc3_hywind", wind=gust, fidelity="standard"), "lqr", duration=120.0)
    assert frame["RotSpeed_[rpm]"].max() / 12.1 > POWER_LIMIT + 0.02
    assert frame["GenPwr_[kW]"].max() < 1.01 * POWER_LIMIT * 5000.0


def test_bad_settings_are_named(turbine):
    with pytest.raises(InputError, match="torque_rate = -1.0: must be finite and positive"):
        LQGSettings(torque_rate=-1.0)
    with pytest.raises(InputError, match="torque_rate"):
        LQGSettings().changed(torqe_rate=1.0)
    with pytest.raises(InputError, match="prepare"):
        LQR(turbine, 0.1).reset(None)


def test_the_design_for_a_scene_does_not_depend_on_which_weather_came_first():
    still = build_scene("oc3_hywind", wind=12.0, fidelity="fast")
    sea = {"kind": "regular", "H": 6.0, "T": 10.0}
    waves = build_scene("oc3_hywind", wind=14.0, sea=sea, fidelity="fast")
    clear_caches()
    alone = design_models(waves)
    clear_caches()
    design_models(still)
    for one, other in zip(alone, design_models(waves), strict=True):
        assert all(np.array_equal(value, getattr(other, name)) for name, value in vars(one).items())
