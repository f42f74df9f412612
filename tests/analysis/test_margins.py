"""Margins of closed loops: closed forms, python-control, and what an LQR guarantees."""

from dataclasses import replace
from math import atan2, degrees, inf, pi, sqrt

import numpy as np
import pytest

import fowt_env
from fowt_env.analysis.margins import LinearLaw, least_size, margins
from fowt_env.controllers.design.closed_loop import closed_loop_matrix
from fowt_env.controllers.pi import PISettings
from fowt_env.errors import InputError

INPUTS = ("generator_torque", "blade_pitch_command")


@pytest.fixture(scope="module")
def model():
    return fowt_env.linearize(fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard"))


def single(model, a, b, c):
    """A LinearModel of a loop known by hand: A, b of the blade pitch, c of the generator speed."""
    n = len(a)
    names = tuple(f"x{i}" for i in range(n))
    b = np.column_stack([np.zeros(n), b, np.zeros(n)])
    return replace(
        model, A=np.array(a, float), B=b, C=np.array([c], float), D=np.zeros((1, 3)), states=names,
        outputs=("generator_speed",),
    )  # fmt: skip


def test_a_triple_lag_has_the_margins_of_its_closed_form(model):
    """L = 4/(s + 1)^3 is -1/2 at sqrt(3) rad/s, and on the unit circle at sqrt(4^(2/3) - 1)."""
    a = [[-1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, -1.0]]
    found = margins(single(model, a, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), [[-4.0]], outputs="generator_speed")
    loop = found.loops["blade_pitch_command"]
    crossing = sqrt(4.0 ** (2.0 / 3.0) - 1.0)
    phase = 180.0 - 3.0 * degrees(atan2(crossing, 1.0))
    assert found.stable and loop.gain == pytest.approx(2.0, rel=1e-9)
    assert loop.gain_frequency == pytest.approx(sqrt(3.0), rel=1e-8)
    assert loop.phase == pytest.approx(phase, rel=1e-8) and loop.phase_frequency == pytest.approx(crossing)
    assert loop.delay == pytest.approx(phase * pi / 180.0 / crossing, rel=1e-8)
    w = np.linspace(0.5, 3.0, 400001)
    assert loop.modulus == pytest.approx(np.abs(1.0 + 4.0 / (1j * w + 1.0) ** 3).min(), rel=1e-8)
    assert found.modulus == pytest.approx(loop.modulus) and loop.gain_reduction == 0.0
    assert not margins(
        single(model, a, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), [[-9.0]], outputs="generator_speed"
    ).stable


def test_an_unstable_plant_has_a_gain_reduction(model):
    """L = k/(s - 1): stable above k = 1, so that k = 4 may fall to a quarter."""
    loop = margins(single(model, [[1.0]], [1.0], [1.0]), [[-4.0]], outputs="generator_speed")
    # the crossing is at zero frequency, below the search: the Nyquist curve begins at -4
    assert loop.stable and loop.phase == pytest.approx(degrees(atan2(sqrt(15.0), 1.0)), rel=1e-8)
    # modulus of 1 + 4/(jw - 1) = (jw + 3)/(jw - 1) is least for large w: 1
    assert loop.modulus == pytest.approx(1.0, abs=1e-4) and loop.gain == inf


@pytest.mark.nightly
def test_margins_of_the_pitch_loop_are_those_of_python_control(model):
    control = pytest.importorskip("control")
    settings = PISettings.published(model.scene.turbine)
    gains = (settings.KP, settings.KI)
    found = margins(model, gains)
    plant = model.to_statespace(inputs="blade_pitch_command", outputs="generator_speed")
    w = np.unique(np.r_[np.logspace(-3, 2, 20000), np.linspace(0.15, 0.3, 20000)])
    law = gains[0] + gains[1] / (1j * w)
    # its conversion of 14 states to polynomials is ill-conditioned: take its frequency response
    data = control.frd(-law * control.frequency_response(plant, w).complex.ravel(), w)
    gain, phase, modulus, _, where, _ = control.stability_margins(data)
    loop = found.loops["blade_pitch_command"]
    assert loop.gain == gain == inf
    assert loop.phase == pytest.approx(phase, rel=1e-6)
    assert loop.phase_frequency == pytest.approx(where, rel=1e-6)
    assert loop.modulus == pytest.approx(modulus, rel=1e-6)
    disk = control.disk_margins(control.ss(plant) * control.tf([-gains[0], -gains[1]], [1.0, 0.0]), w)
    assert found.disk == pytest.approx(disk[0], rel=1e-4)
    assert found.disk_phase == pytest.approx(disk[2], rel=1e-4)
    assert found.disk_gain[1] == pytest.approx(10.0 ** (disk[1] / 20.0), rel=1e-4)


def test_small_lags_and_gains_at_the_margins_end_stability(model):
    settings = PISettings.published(model.scene.turbine)
    found = margins(model, (settings.KP, settings.KI))
    delay = found.loops["blade_pitch_command"].delay
    for factor, stable in ((0.98, True), (1.02, False)):
        lag = factor * delay
        # second-order Pade approximation of the delay, before the PI law
        a = [[-6.0 / lag, -12.0 / lag**2, 0.0], [1.0, 0.0, 0.0], [-12.0 / lag, 0.0, 0.0]]
        gains = np.array([[settings.KP, settings.KI]])
        law = LinearLaw(
            np.array(a), np.array([[1.0], [0.0], [1.0]]),
            gains @ np.array([[-12.0 / lag, 0.0, 0.0], [0.0, 0.0, 1.0]]), gains[:, :1],
            ("generator_speed",), ("blade_pitch_command",),
        )  # fmt: skip
        assert margins(model, law).stable is stable


def test_an_lqr_has_a_sensitivity_of_at_most_one(model):
    """Kalman's inequality, whatever the weights and units; each input has 60 deg and any higher gain."""
    control = pytest.importorskip("control")
    plant = model.to_statespace(waves=False, inputs=INPUTS)
    q = np.diag([1.0 if name in ("rotor_speed", "wy") else 1e-6 for name in model.states])
    gain = control.lqr(plant, q, np.diag([1.0 / 2000.0**2, 1.0 / 0.05**2]))[0]
    found = margins(model, -np.asarray(gain))
    assert found.stable and found.sensitivity_peak < 1.0 + 1e-6
    assert found.phase >= 60.0 and found.gain == inf
    assert set(found.loops) == set(INPUTS)


def test_least_size_is_the_least_over_scalings():
    rng = np.random.default_rng(3)
    matrices = rng.normal(size=(4, 2, 2)) + 1j * rng.normal(size=(4, 2, 2))
    scales = np.logspace(-3, 3, 4001)
    for matrix, found in zip(matrices, least_size(matrices), strict=True):
        sizes = [np.linalg.norm(matrix * [[1.0, d], [1.0 / d, 1.0]], 2) for d in scales]
        assert found <= min(sizes) and found == pytest.approx(min(sizes), rel=1e-4)  # as fine as the scales


def test_stability_is_that_of_the_assembled_closed_loop():
    """PI gains of the wind's schedule on the plant whose law is assembled elsewhere."""
    scene = fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard")
    model = fowt_env.linearize(scene)
    for scale, expected in ((1.0, True), (-1.0, False)):
        settings = PISettings.published(scene.turbine)
        assert (np.linalg.eigvals(closed_loop_matrix(model, settings)[0]).real.max() < 0.0) is np.True_
        assert margins(model, (0.4 * scale * settings.KP, 0.4 * scale * settings.KI)).stable is expected


@pytest.mark.parametrize(
    ("controller", "options", "message"),
    [
        ((1.0, 0.1), {"outputs": "speed"}, "unknown output"),
        ((1.0, 0.1), {"inputs": "wind_speed"}, "unknown input"),
        ([[1.0, 2.0]], {"outputs": "rotor_speed"}, "is 1 x 2: must be 1 x 1, from rotor_speed"),
        ("pi", {}, "must be a control.StateSpace"),
    ],
)
def test_what_cannot_be_used_is_refused(model, controller, options, message):
    with pytest.raises(InputError, match=message):
        margins(model, controller, **options)


def test_a_statespace_is_wired_by_its_labels(model):
    control = pytest.importorskip("control")
    settings = PISettings.published(model.scene.turbine)
    labels = {"inputs": ["generator_speed"], "outputs": ["blade_pitch_command"]}
    law = control.ss([[0.0]], [[1.0]], [[settings.KI]], [[settings.KP]], **labels)
    assert margins(model, law) == margins(model, (settings.KP, settings.KI))
    with pytest.raises(InputError, match="discrete time"):
        margins(model, control.c2d(law, 0.1))
