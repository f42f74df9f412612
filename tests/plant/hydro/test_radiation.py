"""Radiation memory: exact states, convolution by past velocities, and their part in every integrator."""

from dataclasses import replace

import numpy as np
import pytest
from naive.radiation import convolution, convolution_half, state_matrices, states_after
from plant_helpers import random_state
from potential_body import made_up_body

from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.hydro.load import Hydro
from fowt_env.plant.hydro.radiation import (
    add_radiation,
    begin_memory,
    end_memory,
    forget_memory,
    integrated_states,
    memory_after,
    memory_data,
    memory_states,
)
from fowt_env.plant.state import NO_LOAD, State, pose_of
from fowt_env.scene.radiation_fit import (
    RadiationFit,
    build_convolution,
    build_state_space,
    retardation_kernel,
)

RNG = np.random.default_rng(4)
VELOCITY = slice(State.VX, State.WZ + 1)
DT = 0.1


def hydro(memory):
    return Hydro(**dict.fromkeys(Hydro._fields) | {"depth": 200.0, "radiation": memory})


def made_up_fit():
    """Surge and pitch coupled by common poles, heave and yaw alone: no fit of anything."""
    pole = {0: 3, 4: 3, 2: 5, 5: 2}
    poles = {j: -RNG.uniform(0.1, 0.6, n) + 1j * RNG.uniform(0.2, 2.0, n) for j, n in pole.items()}
    poles[4] = poles[0]
    size = {0: 1e6, 2: 2e6, 4: 1e9, 5: 2e9}
    residues = {}
    for i, j in ((0, 0), (0, 4), (4, 4), (2, 2), (5, 5)):
        value = (RNG.normal(size=pole[j]) + 1j * RNG.normal(size=pole[j])) * np.sqrt(size[i] * size[j])
        residues[i, j] = residues[j, i] = value
    return RadiationFit(poles, residues, {})


STATES = build_state_space(made_up_fit(), 15)
BODY = made_up_body()
COUPLED = np.zeros((40, 6, 6))
COUPLED[:, 0, 4] = COUPLED[:, 4, 0] = 5e5 * BODY.omega**2 / (1.0 + BODY.omega**2) ** 3


@pytest.fixture(scope="module")
def past():
    return build_convolution(replace(BODY, damping=BODY.damping + COUPLED), DT)


@entry
def load_of(x, memory, data, out):
    load = add_radiation(pose_of(x), x, NO_LOAD, memory, data)
    out[0], out[1], out[2] = load.fx, load.fy, load.fz
    out[3], out[4], out[5] = load.mx, load.my, load.mz


@entry
def step(x, y, end, dt, halves, half, water, data):
    """A step of the memory from x, with that at a stage y; end: the state at its end but for the memory."""
    begin_memory(x, dt, halves, None, water, data)
    memory_after(x, y, half, None, water, data)
    n = integrated_states(x, water)
    for i in range(n):
        x[i] = end[i]
    end_memory(x, None, water, data)


@entry
def stage(x, y, dt, water, data):
    """A step of the memory begun from x, with that at a stage y half a step on."""
    begin_memory(x, dt, True, None, water, data)
    memory_after(x, y, True, None, water, data)


def turned(x):
    """Block rotation (6, 6) of a state's attitude."""
    p = pose_of(x)
    return np.kron(np.eye(2), [[p.r11, p.r12, p.r13], [p.r21, p.r22, p.r23], [p.r31, p.r32, p.r33]])


def inertial(x):
    return turned(x) @ x[VELOCITY]


def moving(n):
    return random_state(RNG, n, tilt=0.3, speed=1.0, turning=0.1)


def test_a_scene_without_memory_has_no_states_of_it_and_no_load():
    for water in (None, hydro(None)):
        assert memory_states(water) == 0 and memory_data(water).size == 0
    out, x = np.ones(6), moving(15)
    load_of(x, None, np.zeros((0, 0)), out)
    assert (out == 0.0).all()


def test_the_load_of_the_states_is_that_of_their_matrices_turned_into_body_axes():
    x = moving(15 + memory_states(hydro(STATES)))
    x[15:] = RNG.normal(size=x.size - 15)
    out = np.zeros(6)
    load_of(x, STATES, memory_data(hydro(STATES)), out)
    assert out == pytest.approx(-turned(x).T @ state_matrices(STATES)[2] @ x[15:], rel=1e-12)


@pytest.mark.parametrize("dt", [DT, 0.7, 1e-3])
def test_states_are_exact_while_velocities_are_linear_over_a_step(dt):
    water = hydro(STATES)
    n, data = 15 + memory_states(water), memory_data(water)
    x = moving(n)
    x[15:] = RNG.normal(size=n - 15)
    for _ in range(3):
        y, end, old = moving(n), moving(n), x.copy()
        step(x, y, end, dt, True, True, water, data)
        half = states_after(STATES, old[15:], inertial(old), inertial(y), 0.5 * dt)
        whole = states_after(STATES, old[15:], inertial(old), inertial(end), dt)
        assert y[15:] == pytest.approx(half, rel=1e-10, abs=1e-12)
        assert x[15:] == pytest.approx(whole, rel=1e-10, abs=1e-12)


def test_another_step_is_taken_with_its_own_factors():
    water = hydro(STATES)
    n, data = 15 + memory_states(water), memory_data(water)
    x = moving(n)
    for dt in (0.1, 0.05):
        old, end = x.copy(), moving(n)
        step(x, moving(n), end, dt, False, False, water, data)
        expected = states_after(STATES, old[15:], inertial(old), inertial(end), dt)
        assert x[15:] == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_a_constant_velocity_brings_the_states_to_the_static_value_of_k():
    """z = -v/p, so F = -K(0) v; of one pole pair, 2 Re(r/(s - p)) at s = 0."""
    water = hydro(STATES)
    n, data = 15 + memory_states(water), memory_data(water)
    x = np.zeros(n)
    x[State.VZ] = 2.0
    end = x.copy()
    for _ in range(3000):
        step(x, end.copy(), end, DT, False, False, water, data)
    out = np.zeros(6)
    load_of(x, STATES, data, out)
    a, b, c = state_matrices(STATES)
    used = np.abs(b).sum(axis=1) + np.abs(a).sum(axis=1) > 0.0
    gain = c[:, used] @ np.linalg.solve(a[np.ix_(used, used)], b[used])
    assert out[2] == pytest.approx((gain @ x[VELOCITY])[2], rel=1e-9)


def kernel_of(past, half):
    """K at steps of DT (half: DT/2), from the weights of the part."""
    n = past.whole.shape[1]
    k = np.zeros((2 * n + 1, 6, 6))
    k[0] = past.now
    for e, (i, j) in enumerate(zip(past.row, past.column, strict=True)):
        k[1::2, i, j] = past.half[e] / DT
        k[1, i, j] /= 0.75
        k[2::2, i, j] = past.whole[e] / DT
    return k if half else k[::2]


def test_the_convolution_is_the_trapezoid_sum_over_all_past_velocities(past):
    water, data = hydro(past), memory_data(hydro(past))
    x, out, known = moving(15), np.zeros(6), []
    full, twice = kernel_of(past, False), kernel_of(past, True)
    for number in range(700):  # more than the 600 that are kept
        known.append(inertial(x))
        y, end = moving(15), moving(15)
        if number in (1, 5, 640):
            begun = data.copy()
            stage(x, y, DT, water, begun)
            load_of(y, past, begun, out)
            expected = turned(y).T @ convolution_half(twice, DT, known[-601:], inertial(y))
            assert out == pytest.approx(expected, rel=1e-9, abs=1e-6 * np.abs(expected).max())
        step(x, y, end, DT, True, False, water, data)
        if number in (0, 1, 5, 300, 699):
            load_of(x, past, data, out)
            seen = [*known, inertial(x)]
            expected = turned(x).T @ convolution(full, DT, seen)
            assert out == pytest.approx(expected, rel=1e-9, abs=1e-6 * np.abs(expected).max())


def test_the_kernel_of_the_convolution_is_that_of_the_coefficients(past):
    time = 0.5 * DT * np.arange(80)
    expected = retardation_kernel(BODY, time)[:, 2, 2]
    assert kernel_of(past, True)[:80, 2, 2] == pytest.approx(expected, rel=1e-12)
    k = kernel_of(past, False)
    assert k[:40, 2, 2] == pytest.approx(expected[::2], rel=1e-12)
    assert np.abs(k[600:]).max() == 0.0


def test_what_is_forgotten_has_no_load(past):
    for memory in (past, STATES):
        water, data = hydro(memory), memory_data(hydro(memory))
        x = moving(15 + memory_states(water))
        step(x, x.copy(), x.copy(), DT, False, False, water, data)
        forget_memory(data)
        assert (data == 0.0).all()
    out = np.ones(6)
    load_of(moving(15), past, memory_data(hydro(past)), out)
    assert (out == 0.0).all()


def test_a_convolution_refuses_steps_that_it_is_not_made_for(past):
    water, data = hydro(past), memory_data(hydro(past))
    x = moving(15)
    with pytest.raises(ValueError, match="for another time step: use Scene.with_step"):
        step(x, x.copy(), x.copy(), 0.05, False, False, water, data)
