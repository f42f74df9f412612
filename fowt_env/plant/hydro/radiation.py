"""Computes the radiation memory of a floating body: the load by waves of its past motion (theory.md, 5.8).

    F(t) = -integral of K(tau) q'(t - tau), tau from 0 to infinity

about the body origin and in inertial axes, q' being R v and R w. Two forms: a sum of exponentials, with
states that are advanced exactly for velocities linear over a step; and the integral itself by the trapezoid
rule. The states are the last of the state vector and have no rates: integrators call functions of this file.
"""

from cmath import exp as complex_exp
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.compile.vector_sums import advance_pairs, lane_dot
from fowt_env.plant.state import Wrench, add, pose_in, to_body, to_inertial

MOTIONS = 6


class StateSpaceMemory(NamedTuple):
    """Holds K(s) = sum over poles of r / (s - p), with the conjugate of each; one set of poles per motion.

    The states of motion j begin at first + 2 begin[j]: real parts of the states of all poles, then
    imaginary parts.
    """

    first: int  # of the memory's states in the state vector
    begin: np.ndarray  # (7,) first pole of each motion, and the number of poles
    pole: np.ndarray  # (2, n) real and imaginary part, 1/s
    row: np.ndarray  # (7,) first entry of K of each force, and the number of entries
    column: np.ndarray  # (e,) motion of the velocity of each entry
    weight: np.ndarray  # (e, 2 m) 2 Re r and -2 Im r, in the order of the states of the column


class ConvolutionMemory(NamedTuple):
    """Holds K at multiples of the step, times the weights of the trapezoid rule."""

    dt: float  # s, of the step
    now: np.ndarray  # (6, 6) K(0)
    row: np.ndarray  # (e,) motion of the force of each entry of K
    column: np.ndarray  # (e,) motion of the velocity of each entry
    half: np.ndarray  # (e, n) weights of past velocities in the force half a step later, latest first
    whole: np.ndarray  # (e, n) the same a step later


# Rows of the data of StateSpaceMemory: factors of the state, and of the velocities at both ends of the step,
# real and imaginary, over a whole and over half a step; then the step and the velocities at its beginning.
WHOLE, HALF, STEP = 0, 6, 12
# Entries of the last row of the data of ConvolutionMemory; the other rows are past velocities: index of the
# latest, weight of the current velocity, sums over past velocities (6): now, half a step and a step later.
LATEST, WEIGHT, TAIL, TAIL_HALF, TAIL_WHOLE, N_HEAD = 0, 1, 2, 8, 14, 20


def memory_states(hydro):
    """Return the number of states of the radiation memory of a Hydro part or None."""
    memory = None if hydro is None else hydro.radiation
    return 2 * memory.pole.shape[1] if isinstance(memory, StateSpaceMemory) else 0


def memory_data(hydro):
    """Return a new data array of a run for the radiation memory of a Hydro part or None."""
    memory = None if hydro is None else hydro.radiation
    if isinstance(memory, StateSpaceMemory):
        return np.zeros((STEP + 1, max(memory.pole.shape[1], MOTIONS + 1)))
    if isinstance(memory, ConvolutionMemory):
        return np.zeros((MOTIONS + 1, max(2 * memory.whole.shape[1], N_HEAD)))
    return np.zeros((0, 0))


def whole_groups(count, lanes):
    """Return the smallest multiple of lanes that is not below a count."""
    return -(-count // lanes) * lanes


# ---------------------------------------------------------------- the load


@kernel
def _state_force(i, x, velocity, linear, memory, data):
    total = 0.0
    for e in range(memory.row[i], memory.row[i + 1]):
        j = memory.column[e]
        start = memory.first + 2 * memory.begin[j]
        total -= lane_dot(memory.weight[e], x[start:], 2 * (memory.begin[j + 1] - memory.begin[j]))
    return total


@kernel
def _past_force(i, x, velocity, linear, memory, data):
    head = data[MOTIONS]
    total = 0.0
    for j in range(3):
        total += memory.now[i, j] * linear[j] + memory.now[i, 3 + j] * velocity[j]
    return -(head[TAIL + i] + head[WEIGHT] * total)


_force = chosen_by_class("memory", {StateSpaceMemory: _state_force, ConvolutionMemory: _past_force})


@kernel
def add_radiation(pose, x, load, memory, data):
    """Return load plus the radiation load, body components about the body origin; memory None: unchanged."""
    if memory is None:
        return load
    u = to_inertial(pose, pose.vx, pose.vy, pose.vz)
    w = to_inertial(pose, pose.wx, pose.wy, pose.wz)
    fx, fy = _force(0, x, w, u, memory, data), _force(1, x, w, u, memory, data)
    fz, mx = _force(2, x, w, u, memory, data), _force(3, x, w, u, memory, data)
    my, mz = _force(4, x, w, u, memory, data), _force(5, x, w, u, memory, data)
    force, moment = to_body(pose, fx, fy, fz), to_body(pose, mx, my, mz)
    return add(load, Wrench(force[0], force[1], force[2], moment[0], moment[1], moment[2]))


# ---------------------------------------------------------------- states


@kernel
def _factors(p, dt, data, k, first):
    """Fill column k of data, from row `first` on, with e^h and the weights of both velocities over dt.

    h = p dt; over a step in which the velocity is linear, z is e^h z + dt (f1 - f2) v0 + dt f2 v1 with
    f1 = (e^h - 1)/h and f2 = (e^h - 1 - h)/h^2, by their series where h is small.
    """
    h = p * dt
    grown = complex_exp(h)
    if abs(h) < 0.5:
        one = two = term = complex(1.0, 0.0)
        two = two * 0.5
        for n in range(2, 18):
            term = term * h / n
            one = one + term
            two = two + term / (n + 1.0)
    else:
        one = (grown - 1.0) / h
        two = (grown - 1.0 - h) / (h * h)
    start = dt * (one - two)
    end = dt * two
    data[first, k], data[first + 1, k] = grown.real, grown.imag
    data[first + 2, k], data[first + 3, k] = start.real, start.imag
    data[first + 4, k], data[first + 5, k] = end.real, end.imag


@kernel
def _put_velocity(x, plane, row):
    """Fill row[1:7] with the inertial velocities of a state."""
    pose = pose_in(x, plane)
    row[1], row[2], row[3] = to_inertial(pose, pose.vx, pose.vy, pose.vz)
    row[4], row[5], row[6] = to_inertial(pose, pose.wx, pose.wy, pose.wz)


@kernel
def _advance_states(x, y, first, plane, memory, data):
    """Fill y with the memory's states, from those of x, over the step whose factors begin at row `first`."""
    pose = pose_in(y, plane)
    u = to_inertial(pose, pose.vx, pose.vy, pose.vz)
    w = to_inertial(pose, pose.wx, pose.wy, pose.wz)
    step = data[STEP]
    for j in range(MOTIONS):
        begin, count = memory.begin[j], memory.begin[j + 1] - memory.begin[j]
        start, new = memory.first + 2 * begin, (u[j] if j < 3 else w[j - 3])
        advance_pairs(x, y, data, first, start, begin, count, step[1 + j], new)
    return u, w


@kernel
def _begin_states(x, dt, halves, plane, memory, data):
    if data[STEP, 0] == dt:
        return
    for k in range(memory.pole.shape[1]):
        pole = complex(memory.pole[0, k], memory.pole[1, k])
        _factors(pole, dt, data, k, WHOLE)
        _factors(pole, 0.5 * dt, data, k, HALF)
    data[STEP, 0] = dt
    _put_velocity(x, plane, data[STEP])


@kernel
def _states_after(x, y, half, plane, memory, data):
    _advance_states(x, y, HALF if half else WHOLE, plane, memory, data)


@kernel
def _end_states(x, plane, memory, data):
    u, w = _advance_states(x, x, WHOLE, plane, memory, data)
    step = data[STEP]
    step[1], step[2], step[3] = u
    step[4], step[5], step[6] = w


# ---------------------------------------------------------------- past velocities


@kernel
def _begin_past(x, dt, halves, plane, memory, data):
    """Store the velocities of x, and sum over past velocities for the force half a step and a step later."""
    if abs(memory.dt - dt) > 1e-9 * dt:
        raise ValueError("the radiation convolution is for another time step: use Scene.with_step")
    head, size = data[MOTIONS], memory.whole.shape[1]
    pose = pose_in(x, plane)
    u = to_inertial(pose, pose.vx, pose.vy, pose.vz)
    w = to_inertial(pose, pose.wx, pose.wy, pose.wz)
    # ring buffer, latest first, stored twice, so that all velocities are contiguous from any index
    index = int(head[LATEST]) - 1
    if index < 0:
        index = size - 1
    weight = 0.5 if head[WEIGHT] == 0.0 else 1.0  # of the trapezoid rule, for the first velocity of a run
    for j in range(MOTIONS):
        value = weight * (u[j] if j < 3 else w[j - 3])
        data[j, index] = value
        data[j, index + size] = value
    head[LATEST] = index
    for i in range(MOTIONS):
        head[TAIL_HALF + i] = 0.0
        head[TAIL_WHOLE + i] = 0.0
    for e in range(memory.row.shape[0]):
        i, past = memory.row[e], data[memory.column[e], index:]
        if halves:
            head[TAIL_HALF + i] += lane_dot(memory.half[e], past, size)
        head[TAIL_WHOLE + i] += lane_dot(memory.whole[e], past, size)


@kernel
def _past_after(x, y, half, plane, memory, data):
    head = data[MOTIONS]
    start = TAIL_HALF if half else TAIL_WHOLE
    head[WEIGHT] = (0.25 if half else 0.5) * memory.dt
    for i in range(MOTIONS):
        head[TAIL + i] = head[start + i]


@kernel
def _end_past(x, plane, memory, data):
    _past_after(x, x, False, plane, memory, data)


# ---------------------------------------------------------------- interface of integrators


@kernel
def _before_states(x, memory):
    return memory.first


@kernel
def _every_state(x, memory):
    return x.shape[0]


_integrated = chosen_by_class("memory", {StateSpaceMemory: _before_states, ConvolutionMemory: _every_state})
_begin = chosen_by_class("memory", {StateSpaceMemory: _begin_states, ConvolutionMemory: _begin_past})
_after = chosen_by_class("memory", {StateSpaceMemory: _states_after, ConvolutionMemory: _past_after})
_end = chosen_by_class("memory", {StateSpaceMemory: _end_states, ConvolutionMemory: _end_past})


@kernel
def _integrated_with(x, memory):
    if memory is None:
        return x.shape[0]
    return _integrated(x, memory)


@inlined_kernel
def integrated_states(x, hydro):
    """Return the number of states that an integrator advances by their rates: all but radiation states."""
    if hydro is None:
        return x.shape[0]
    return _integrated_with(x, hydro.radiation)


@kernel
def _begin_with(x, dt, halves, plane, memory, data):
    if memory is None:
        return
    _begin(x, dt, halves, plane, memory, data)


@inlined_kernel
def begin_memory(x, dt, halves, plane, hydro, data):
    """Begin a radiation-memory step of dt from x; halves: whether memory_after is called at half a step."""
    if hydro is None:
        return
    _begin_with(x, dt, halves, plane, hydro.radiation, data)


@kernel
def _after_with(x, y, half, plane, memory, data):
    if memory is None:
        return
    _after(x, y, half, plane, memory, data)


@inlined_kernel
def memory_after(x, y, half, plane, hydro, data):
    """Fill y, of known velocities, with the radiation memory a step (half: half a step) after x."""
    if hydro is None:
        return
    _after_with(x, y, half, plane, hydro.radiation, data)


@kernel
def _end_with(x, plane, memory, data):
    if memory is None:
        return
    _end(x, plane, memory, data)


@inlined_kernel
def end_memory(x, plane, hydro, data):
    """Advance the radiation memory of x to the end of a step; all other states of x are already there."""
    if hydro is None:
        return
    _end_with(x, plane, hydro.radiation, data)


@kernel
def forget_memory(data):
    """Clear past velocities and their sums: the state was changed from outside."""
    for i in range(data.shape[0]):
        for k in range(data.shape[1]):
            data[i, k] = 0.0
