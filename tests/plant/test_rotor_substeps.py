"""The rotor's load within a step, in a box of wind: what it must not change, and what it is for."""

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.errors import InputError
from fowt_env.plant.integrators import build_integrator, rotor_samples
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rotor_substeps import BASHFORTH, build_substeps, sample_rotor
from fowt_env.plant.state import State
from fowt_env.training.validation.openfast_cases import box_wind
from fowt_env.training.validation.signal_errors import normalised_rms

SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}
COLUMNS = (
    "PtfmSurge_[m]", "PtfmSway_[m]", "PtfmHeave_[m]", "PtfmRoll_[deg]", "PtfmPitch_[deg]", "PtfmYaw_[deg]",
    "RotSpeed_[rpm]", "FAIRTEN1_[kN]",
)  # fmt: skip


def impulse(load, samples):
    """What the weights add to the impulse of a load(time) over the step from 0 to 1."""
    gusts = build_substeps(samples)
    latest = (samples - 1) / samples
    return sum(w * load(latest - k / samples) for k, w in enumerate(gusts.weight))


@pytest.mark.parametrize("samples", [2, 3, 7])
@pytest.mark.parametrize("power", [0, 1, 2, 3])
def test_a_load_that_one_step_follows_exactly_is_left_alone(samples, power):
    assert impulse(lambda t: t**power, samples) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("samples", [2, 3, 7])
def test_the_weights_turn_one_step_into_short_ones(samples):
    """A load that is anything: the sum over the short steps one by one, less the long step."""

    def load(t):
        return np.sin(9.0 * t) + np.exp(t)

    short = sum(
        b * load((part - back) / samples) / samples
        for part in range(samples)
        for back, b in enumerate(BASHFORTH)
    )
    long = sum(b * load(-back) for back, b in enumerate(BASHFORTH))
    assert impulse(load, samples) == pytest.approx(short - long, abs=1e-12)


def test_only_adams_bashforth_in_a_box_samples_the_rotor_more_than_once():
    box = box_wind()
    for wind, options, samples in (
        (box, {"fidelity": "standard"}, 3),
        (box, {"fidelity": "standard", "rotor_samples": 2}, 2),
        (box, {"fidelity": "standard", "rotor_samples": 1}, 0),
        (box, {"fidelity": "standard", "integrator": "rk4"}, 0),
        (box, {"fidelity": "fast"}, 0),  # the box averaged over the rotor is a series
        (18.0, {"fidelity": "standard"}, 0),
        (18.0, {"fidelity": "standard", "rotor_samples": 4}, 4),
    ):
        scene = build_scene(wind=wind, duration=100.0, **{"fidelity": "reference"} | options)
        assert rotor_samples(scene.model.integrator) == samples
        assert scene.data().samples.shape == (4 * samples, 7)
    assert build_integrator("abm4", 1).substeps is None and rotor_samples(None) == 0


def test_between_two_steps_a_constant_acceleration_is_followed_exactly():
    scene = build_scene(wind=18.0, fidelity="standard", rotor_samples=4)
    data, dt, last = scene.data(), 0.1, 0.075  # of the samples within a step
    rng = np.random.default_rng(2)
    x, speed, acceleration = (0.01 * rng.normal(size=scene.n_state) for _ in range(3))
    data.history[0], data.history[1] = speed, speed - dt * acceleration
    for steps, bend in ((1.0, acceleration), (0.0, 0.0)):  # the first step knows of no other
        data.cache[LoadCache.STEPS] = steps
        sample_rotor(
            0.0, x, np.zeros(scene.n_commands), dt, scene.model, scene.model.integrator.substeps, data
        )
        moved = x + last * speed + 0.5 * last**2 * bend
        assert data.stages[2][: State.BLADE_PITCH] == pytest.approx(moved[: State.BLADE_PITCH], rel=1e-12)


def test_samples_of_another_integrator_are_refused():
    with pytest.raises(InputError, match="rotor_samples = 3: only integrator = 'ab4'.*not 'heun'"):
        build_scene(wind=9.0, integrator="heun", rotor_samples=3, fidelity="reference")


@pytest.mark.nightly
def test_a_step_of_standard_in_a_box_errs_by_less_than_a_thousandth_and_a_sixth_of_one_sample():
    """Against Runge-Kutta steps an eighth as long; rms over standard deviation, the worst channel."""
    frames = {}
    for name, dt, options in (
        ("exact", 0.0125, {"integrator": "rk4"}),
        ("one", 0.1, {"rotor_samples": 1}),
        ("three", 0.1, {}),
    ):
        options |= {"duration": 300.0, "wave_components": 60, "fidelity": "standard"}
        scene = build_scene(wind=box_wind(), sea=SEA, seed=1, **{"fidelity": "reference"} | options)
        frames[name] = simulate(scene, "pi", duration=300.0, dt=dt)
    errors = {
        name: max(normalised_rms(frames[name][c], frames["exact"][c]) for c in COLUMNS)
        for name in ("one", "three")
    }
    assert errors["three"] < 1e-3 and errors["three"] < errors["one"] / 6.0, errors
