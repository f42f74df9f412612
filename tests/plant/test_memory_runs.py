"""Runs with radiation memory: decays against OpenFAST, both forms against each other, and integrators."""

from functools import cache

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.analysis.linear_model import linearize, natural_periods
from fowt_env.descriptions.platform import read_platform
from fowt_env.envs.snapshot import CARRIED
from fowt_env.plant.advance import advance
from fowt_env.plant.state import STATES, State, pose_of
from fowt_env.scene.radiation_fit import fit_radiation
from fowt_env.training.validation.openfast_cases import reference

MOTIONS = {  # motion: (channel of the reference, entry of the state, offset, the channel's unit)
    "surge": ("PtfmSurge_[m]", State.SURGE, 10.0, 1.0),
    "heave": ("PtfmHeave_[m]", State.HEAVE, 3.0, 1.0),
    "pitch": ("PtfmPitch_[deg]", State.PLATFORM_PITCH, 5.0, np.pi / 180.0),
    "yaw": ("PtfmYaw_[deg]", State.YAW, 8.0, np.pi / 180.0),
}

CONVOLUTION = pytest.param("convolution", marks=pytest.mark.nightly)


@pytest.fixture(scope="module")
def platform():
    found = read_platform("iea15_volturnus_s")
    # as in MAP's file
    lines = tuple(line.model_copy(update={"seabed_friction": 1.0}) for line in found.lines)
    return found.model_copy(update={"lines": lines})


@pytest.fixture(scope="module")
def decays(platform):
    """Function of a form of the memory and a motion: its channel every second, here and in OpenFAST."""

    @cache
    def both(form, name):
        scene = build_scene(platform, fidelity="standard", radiation=form)
        steps, (channel, entry, offset, unit) = round(1.0 / scene.dt), MOTIONS[name]
        run = reference(f"decay_{name}", place="iea15_volturnus_s")
        every = round(1.0 / run["Time_[s]"][1])
        theirs = run[channel].to_numpy()[: 300 * every + 1 : every]
        handle, x, rows = scene.handle(), np.zeros(scene.n_state), [offset]
        x[entry] = offset * unit
        for second in range(theirs.size - 1):
            assert advance(handle, x, np.zeros(2), second * steps, steps, scene.dt) == 0
            rows.append(x[entry] / unit)
        return np.array(rows), theirs

    return both


def miss(one, other):
    return np.sqrt(((one - other) ** 2).mean()) / other.std()


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("form", ["state_space", CONVOLUTION])
def test_free_decays_are_openfasts(decays, form, name):
    """HydroDyn's convolution of the same coefficients over 60 s; measured 0.2 to 1.0 % of the record."""
    assert miss(*decays(form, name)) < 0.015


@pytest.mark.nightly
@pytest.mark.parametrize("name", MOTIONS)
def test_the_state_space_decays_as_the_convolution_does(decays, name):
    assert miss(decays("state_space", name)[0], decays("convolution", name)[0]) < 0.01


@pytest.mark.nightly
def test_natural_periods_are_openfasts(platform):
    """Of its decays: 134.0, 20.45, 28.2 and 88.3 s, amplitudes of metres included."""
    periods = natural_periods(build_scene(platform, fidelity="standard"))
    measured = {"surge": 134.0, "heave": 20.45, "platform_pitch": 28.2, "yaw": 88.3}
    for name, period in measured.items():
        assert periods[name] == pytest.approx(period, rel=0.01), name


def test_linear_models_have_the_memory_of_the_fit_in_the_attitude_of_the_trim(platform):
    """Without its states (Schur complement), the acceleration is that of -R^T K(i w) R on the velocities."""
    scene = build_scene(platform, fidelity="standard")
    model = linearize(scene)
    assert model.states[:14] == STATES and model.states[14] == "radiation_1"
    assert model.x0.size == len(model.states) == model.A.shape[0] == model.B.shape[0] == model.E.shape[0]
    assert model.C.shape == (len(model.outputs), len(model.states))
    omega = 0.6
    n, own = len(STATES), model.A[14:, 14:]
    moved = np.linalg.solve(1j * omega * np.eye(own.shape[0]) - own, model.A[14:, :14])
    p = pose_of(model.point.state)
    turn = np.kron(np.eye(2), [[p.r11, p.r12, p.r13], [p.r21, p.r22, p.r23], [p.r31, p.r32, p.r33]])
    k = fit_radiation(platform.potential_flow).response(np.array([omega]))[0]
    force = np.zeros((6, n), dtype=complex)
    force[:, [STATES.index(name) for name in ("vx", "vy", "vz", "wx", "wy", "wz")]] = -turn.T @ k @ turn
    expected = model.E[:14] @ force
    assert model.A[:14, 14:] @ moved == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    read = model.F @ force
    assert model.C[:, 14:] @ moved == pytest.approx(read, abs=1e-9 * np.abs(read).max())


def test_modes_are_those_of_the_platform_alone(platform):
    model = linearize(build_scene(platform, fidelity="standard"))
    names = [mode.name for mode in model.modes()]
    assert sorted(names) == ["heave", "platform_pitch", "roll", "surge", "sway", "yaw"]
    assert max(abs(mode.damping_ratio) for mode in model.modes()) < 1e-3  # waves of 20 s and more are small


def last_state(platform, integrator, dt, seconds=20.0):
    options = {"integrator": integrator, "radiation": "state_space", "fidelity": "reference"}
    scene = build_scene(platform, **options).with_step(dt)
    x, u = np.zeros(scene.n_state), np.zeros(2)
    x[State.HEAVE], x[State.PLATFORM_PITCH] = 3.0, 0.1
    assert advance(scene.handle(), x, u, 0, round(seconds / dt), dt) == 0
    return x


@pytest.mark.nightly
@pytest.mark.parametrize("integrator", ["rk4", "ab4", "heun", "abm4"])
def test_integrators_converge_with_memory_to_second_order_or_better(platform, integrator):
    """The memory is exact for linear velocities: its error goes with the square of the step."""
    finest = last_state(platform, "rk4", 0.0025)
    misses = [np.abs(last_state(platform, integrator, dt) - finest)[:6].max() for dt in (0.1, 0.05)]
    assert misses[0] > 3.3 * misses[1] and misses[1] < 2e-4


@pytest.mark.parametrize("form", ["state_space", CONVOLUTION])
def test_a_snapshot_carries_the_memory(platform, form):
    scene = build_scene(platform, fidelity="standard", radiation=form)
    x, u, data = np.zeros(scene.n_state), np.zeros(2), scene.data()
    x[State.HEAVE], x[State.YAW] = 3.0, 0.1
    advance(scene.handle(data), x, u, 0, 60, scene.dt)
    y, copy = x.copy(), scene.data()
    for name in CARRIED["data"]:
        getattr(copy, name)[:] = getattr(data, name)
    for state, arrays in ((x, data), (y, copy)):
        advance(scene.handle(arrays), state, u, 60, 60, scene.dt)
    assert np.array_equal(x, y)
