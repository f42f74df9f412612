"""Computes one Newton step of the optimal control problem: prediction, sensitivities, quadratic program.

Moves are u = -K x + c with corrections c that are constant over blocks. With the LQ gain K, c = 0 is the plan
without active limits, without a preview and with linear rotor loads (Rossiter, Kouvaritakis and Rice,
Automatica 34, 1998). Rotor loads come from the table; their difference from the linear model is an additional
input. One step is computed per period, from the previous plan (real-time iteration: Diehl, Bock and
Schloeder, SIAM J. Control Optim. 43, 2005).
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fowt_env.controllers.lqr.design import N_FEEDBACK
from fowt_env.controllers.mpc.model import COMMAND, FILTER, LEAN_RATE, N_COST, SPEED, SURGE_RATE, TORQUE, WIND
from fowt_env.controllers.mpc.rotor_table import rotor_loads
from fowt_env.plant.compile.decorators import entry, kernel

BLADE = SPEED + 1
FIRST_BLOCKS = 4  # number of blocks of one period; later blocks grow
GROWTH = 1.5  # ratio of the lengths of successive blocks
RATED_BLOCKS = 4  # number of blocks with rate limits at their start
LIMITED = (TORQUE, COMMAND, SPEED)  # states with limits at the end of each block, as has the power
BLOCK_ROWS = len(LIMITED) + 1


class Limit(IntEnum):
    """Enumerates the array of limits; each kind has a low and a high limit."""

    TORQUE_RATE = 0  # rated torques/s
    PITCH_RATE = 2  # rad/s
    TORQUE = 4  # rated torques, less the trim
    PITCH = 6  # rad, less the trim
    SPEED = 8  # rad/s, less the trim
    POWER = 10  # of generator torque and rotor speed, rated torques times rad/s


class Grid(NamedTuple):
    """Holds the blocks of the horizon."""

    block_of: np.ndarray  # (steps,) block of each period
    ends: np.ndarray  # (blocks,) periods at the end of each


class Work(NamedTuple):
    """Holds the arrays of a step: trajectory, slopes, program min z'Hz/2 + g'z, low <= C z <= high."""

    states: np.ndarray  # (steps + 1, n)
    slopes: np.ndarray  # (steps + 1, n, moves)
    H: np.ndarray
    g: np.ndarray
    C: np.ndarray
    low: np.ndarray
    high: np.ndarray
    loads: np.ndarray  # (8,) this and the following: scratch
    excess: np.ndarray  # (2,)
    gain: np.ndarray  # (2, 3)
    by_load: np.ndarray  # (2, moves)
    row: np.ndarray  # (moves,)
    closed: np.ndarray  # (n, n) A - B K
    factors: np.ndarray  # (moves, moves) of H


def grid_of(settings, period):
    """Return the Grid of an MPCSettings."""
    total, lengths, length = round(settings.horizon / period), [], 1.0
    while sum(lengths) < total:
        if len(lengths) >= FIRST_BLOCKS:
            length *= GROWTH
        lengths.append(min(round(length), total - sum(lengths)))
    return Grid(np.repeat(np.arange(len(lengths)), lengths), np.cumsum(lengths))


def work_of(grid):
    """Return the Work arrays for a Grid."""
    steps, moves = len(grid.block_of), 2 * len(grid.ends)
    rows = 2 * RATED_BLOCKS + BLOCK_ROWS * len(grid.ends)
    shapes = (
        (steps + 1, N_FEEDBACK), (steps + 1, N_FEEDBACK, moves), (moves, moves), moves, (rows, moves), rows,
        rows, 8, 2, (2, 3), (2, moves), moves, (N_FEEDBACK, N_FEEDBACK), (moves, moves),
    )  # fmt: skip
    return Work(*map(np.zeros, shapes))


@kernel
def _extra_loads(model, wind, table, x, loads, excess, gain):
    """Fill excess (2,), table loads minus linear loads, and gain (2, 3), slopes of excess.

    Slopes are over wind at the rotor, rotor speed and blade pitch.
    """
    base = model.loads
    change = (
        x[WIND] + model.motion[0] * x[SURGE_RATE] + model.motion[1] * x[LEAN_RATE],
        x[SPEED],
        x[BLADE],
    )
    rotor_loads(wind + change[0], model.trim[SPEED] + change[1], model.trim[BLADE] + change[2], table, loads)
    for load in range(2):
        excess[load] = loads[4 * load] - base[4 * load]
        for j in range(3):
            excess[load] -= base[4 * load + 1 + j] * change[j]
            gain[load, j] = loads[4 * load + 1 + j] - base[4 * load + 1 + j]


@kernel
def _foresee(model, feedback, wind, table, nonlinear, ahead, grid, moves, work):
    """Predict the states under the moves from the first state, with their slopes over the moves.

    ahead: (n, 2) states of the wind filter at the first n periods, minus the operating wind.
    """
    n, width = N_FEEDBACK, len(moves)
    x, s, closed = work.states, work.slopes, work.closed
    for i in range(n):
        for j in range(n):
            closed[i, j] = model.A[i, j] - model.B[i, 0] * feedback[0, j] - model.B[i, 1] * feedback[1, j]
    excess, gain, by_load = work.excess, work.gain, work.by_load
    excess[:] = 0.0
    s[0] = 0.0
    for k in range(len(grid.block_of)):
        if k < len(ahead):
            x[k, FILTER], x[k, WIND] = ahead[k, 0], ahead[k, 1]
        first = 2 * grid.block_of[k]
        used = first + 2
        if nonlinear:
            _extra_loads(model, wind, table, x[k], work.loads, excess, gain)
            for load in range(2):
                for c in range(used):
                    moved = model.motion[0] * s[k, SURGE_RATE, c] + model.motion[1] * s[k, LEAN_RATE, c]
                    by_load[load, c] = gain[load, 0] * moved
                    by_load[load, c] += gain[load, 1] * s[k, SPEED, c] + gain[load, 2] * s[k, BLADE, c]
        for i in range(n):
            total = model.G[i, 0] * excess[0] + model.G[i, 1] * excess[1]
            total += model.B[i, 0] * moves[first] + model.B[i, 1] * moves[first + 1]
            for c in range(width):
                s[k + 1, i, c] = 0.0
            for j in range(n):
                factor = closed[i, j]
                total += factor * x[k, j]
                for c in range(used):
                    s[k + 1, i, c] += factor * s[k, j, c]
            if nonlinear:
                for c in range(used):
                    s[k + 1, i, c] += model.G[i, 0] * by_load[0, c] + model.G[i, 1] * by_load[1, c]
            x[k + 1, i] = total
            s[k + 1, i, first] += model.B[i, 0]
            s[k + 1, i, first + 1] += model.B[i, 1]


@kernel
def _condense(model, references, end, grid, moves, work, gain):
    """Fill H and g from the squared deviations from references and the cost to go about the state `end`."""
    n, width = N_FEEDBACK, len(moves)
    h, g, x, s = work.H, work.g, work.states, work.slopes
    y = work.row
    h[:] = 0.0
    g[:] = 0.0
    for k in range(len(grid.block_of)):
        first = 2 * grid.block_of[k]
        used = first + 2
        for q in range(N_COST):
            rate = q - (N_COST - 2)  # 0 and 1: torque and pitch command
            if k == 0 and rate < 0:
                continue  # the first state is constant
            value = -references[q]
            for c in range(used):
                y[c] = 0.0
            for j in range(n):
                factor = model.rows[q, j] if rate < 0 else -gain[rate, j]
                if factor != 0.0:
                    value += factor * x[k, j]
                    for c in range(used):
                        y[c] += factor * s[k, j, c]
            if rate >= 0:
                value += moves[first + rate]
                y[first + rate] += 1.0
            weight = model.weights[q]
            for a in range(used):
                scaled = weight * y[a]
                g[a] += value * scaled
                for b in range(a + 1):
                    h[a, b] += scaled * y[b]
    last = len(grid.block_of)
    for i in range(n):  # the cost to go: row i of P times the last slopes
        value = 0.0
        for c in range(width):
            y[c] = 0.0
        for j in range(n):
            factor = model.P[i, j]
            value += factor * (x[last, j] - end[j])
            for c in range(width):
                y[c] += factor * s[last, j, c]
        for a in range(width):
            g[a] += s[last, i, a] * value
            for b in range(a + 1):
                h[a, b] += s[last, i, a] * y[b]
    for a in range(width):
        for b in range(a):
            h[b, a] = h[a, b]


@kernel
def _limit(limits, units, trim, grid, moves, work, gain):
    """Fill C, low and high: permitted change of each limited quantity from the plan, in its unit.

    The power is linearised about the predicted torque and rotor speed.
    """
    n, width = N_FEEDBACK, len(moves)
    row = 0
    for block in range(RATED_BLOCKS):
        k = grid.ends[block - 1] if block > 0 else 0
        for rate in range(2):
            unit = units[rate]
            value = moves[2 * block + rate]
            for c in range(width):
                work.C[row, c] = 0.0
            work.C[row, 2 * block + rate] = 1.0 / unit
            for j in range(n):
                value -= gain[rate, j] * work.states[k, j]
                for c in range(width):
                    work.C[row, c] -= gain[rate, j] * work.slopes[k, j, c] / unit
            work.low[row] = (limits[2 * rate] - value) / unit
            work.high[row] = (limits[2 * rate + 1] - value) / unit
            row += 1
    for block in range(len(grid.ends)):
        k = grid.ends[block]
        for j in range(len(LIMITED)):
            state, unit = LIMITED[j], units[2 + j]
            for c in range(width):
                work.C[row, c] = work.slopes[k, state, c] / unit
            work.low[row] = (limits[4 + 2 * j] - work.states[k, state]) / unit
            work.high[row] = (limits[5 + 2 * j] - work.states[k, state]) / unit
            row += 1
        torque, speed = trim[TORQUE] + work.states[k, TORQUE], trim[SPEED] + work.states[k, SPEED]
        unit = units[2 + len(LIMITED)]
        for c in range(width):
            change = speed * work.slopes[k, TORQUE, c] + torque * work.slopes[k, SPEED, c]
            work.C[row, c] = change / unit
        work.low[row] = (limits[Limit.POWER] - torque * speed) / unit
        work.high[row] = (limits[Limit.POWER + 1] - torque * speed) / unit
        row += 1


@kernel
def _minimise(h, g, factors, step):
    """Fill step with the minimum of step'H step/2 + g'step, H positive definite, by H = L D L'.

    numpy.linalg.solve would take a third of the time in which this module compiles.
    """
    size = len(step)
    for i in range(size):
        for j in range(i):
            total = h[i, j]
            for k in range(j):
                total -= factors[i, k] * factors[j, k]
            factors[i, j] = total  # L D
        pivot, total = h[i, i], -g[i]
        for j in range(i):
            scaled = factors[i, j] / factors[j, j]
            pivot -= scaled * factors[i, j]
            factors[i, j] = scaled  # L
            total -= scaled * step[j]
        factors[i, i] = pivot
        step[i] = total
    for i in range(size - 1, -1, -1):
        step[i] /= factors[i, i]
        for k in range(i + 1, size):
            step[i] -= factors[k, i] * step[k]


@entry
def newton_step(
    model, gain, wind, table, nonlinear, references, end, ahead, limits, units, grid, moves, work, step
):
    """Fill work about the plan `moves`, and step (moves,) with the optimal change without limits.

    Returns whether this step satisfies all limits. The present state is work.states[0], the feedback -gain x.
    """
    _foresee(model, gain, wind, table, nonlinear, ahead, grid, moves, work)
    _condense(model, references, end, grid, moves, work, gain)
    _limit(limits, units, model.trim, grid, moves, work, gain)
    _minimise(work.H, work.g, work.factors, step)
    kept = True
    for row in range(len(work.low)):
        value = 0.0
        for c in range(len(step)):
            value += work.C[row, c] * step[c]
        kept = kept and work.low[row] <= value <= work.high[row]
    return kept


@entry
def shifted(moves, grid, later):
    """Fill `later` with the plan of moves shifted by one period."""
    steps = len(grid.block_of)
    later[:] = 0.0
    for k in range(steps):
        block, source = grid.block_of[k], grid.block_of[min(k + 1, steps - 1)]
        length = grid.ends[block] - (grid.ends[block - 1] if block > 0 else 0)
        later[2 * block] += moves[2 * source] / length
        later[2 * block + 1] += moves[2 * source + 1] / length
