"""Computes the wave force on a potential-flow body, first and second order (theory.md, 5.9).

Linear theory assumes the undisplaced pose, so the forces are functions of time, in inertial axes about the
body origin: the first order summed over components or tabulated over time, the second always tabulated, as
coefficients of cubic B-splines. For waves at the slowly varying position of the body, phases are taken at a
low-passed surge and sway, two states.
"""

from math import cos, floor, pi, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.compile.vector_sums import lane_dot
from fowt_env.plant.hydro.wave_bands import aligned, phasors
from fowt_env.plant.hydro.waves import elevation, ramp_factor
from fowt_env.plant.state import State, Wrench, add, to_body

COLUMNS = 8  # of a table: six of the force, the elevation at the origin, and one to fill a cache line
ELEVATION = 6
# rows of a FastExcitation's components, phases in turns; the first three are scratch of phasors
DISTANCE, RATE, TURN, ALONG_X, ALONG_Y, N_WAVE = range(6)
N_SCRATCH = 5  # rows: those three, cosine and sine


class ExactExcitation(NamedTuple):
    """Holds the first-order force by a sum of Re(force exp(i (omega t - phase - k (x cos b + y sin b))))."""

    omega: np.ndarray  # (n,) rad/s
    phase: np.ndarray  # (n,) e, rad
    along_x: np.ndarray  # (n,) k cos b, 1/m
    along_y: np.ndarray  # (n,) k sin b
    force: np.ndarray  # (n, 12) of each component's amplitude, N and N m: six real parts, six imaginary ones
    ramp: float  # s over which the waves are raised from rest


class TimeTable(NamedTuple):
    """Holds coefficients of cubic B-splines over evenly spaced times from 0 to span."""

    value: np.ndarray  # (rows + 3, COLUMNS): of times -step, 0, ... span + step
    rate: float  # rows per second
    span: float  # s
    periodic: bool  # repeats after its span


class ExcitationSeries(NamedTuple):
    """Holds first-order force and elevation at the origin as a table, and the sum for times outside."""

    table: TimeTable
    exact: ExactExcitation


class FastExcitation(NamedTuple):
    """Holds the first-order force by the sum at a position, with vectorised phases of all components."""

    wave: np.ndarray  # (N_WAVE, n) rows DISTANCE (zeros) to ALONG_Y; n padded with zeros to whole lanes
    force: np.ndarray  # (12, n) of each component's amplitude, on cosine (6) and sine (6)
    amplitude: np.ndarray  # (n,)
    ramp: float


class FilteredPosition(NamedTuple):
    """Holds the low-passed surge and sway (first order) at which the waves act on the body."""

    first: int  # index of the two states in the state vector
    rate: float  # 1/s, of the filter


class SecondOrder(NamedTuple):
    """Holds the difference-frequency force as a table, and the mean force for times outside."""

    table: TimeTable
    mean: np.ndarray  # (6,) N and N m
    ramp: float  # s


class Excitation(NamedTuple):
    """Holds the wave force on a potential-flow body."""

    first: object  # ExactExcitation, ExcitationSeries or, with a position, FastExcitation
    second: object  # SecondOrder or None; at the undisplaced position
    position: object  # FilteredPosition, or None: undisplaced


def build_filtered_position(first, cutoff):
    """Return a FilteredPosition whose states begin at `first`, with a cutoff frequency in Hz."""
    return FilteredPosition(int(first), float(2.0 * pi * cutoff))


def position_states(hydro):
    """Return the number of states of the filtered position of a Hydro part or None."""
    part = None if hydro is None else hydro.excitation
    return 0 if part is None or part.position is None else 2


def excitation_scratch(hydro):
    """Return a new scratch array for the FastExcitation of a Hydro part; empty without FastExcitation."""
    part = None if hydro is None else hydro.excitation
    first = None if part is None else part.first
    return aligned(np.zeros((N_SCRATCH, first.amplitude.size if isinstance(first, FastExcitation) else 0)))


@kernel
def row_at(t, table):
    """Return (row, fraction) of a time in a table; row -1: outside the table."""
    if table.periodic:
        t -= table.span * floor(t / table.span)
    elif t < 0.0 or t > table.span:
        return -1, 0.0
    at = t * table.rate
    row = min(int(at), table.value.shape[0] - 4)
    return row, at - row


@kernel
def spline_weights(u):
    """Return the B-spline weights of the four coefficients about a fraction (0 to 1) between two rows."""
    v = 1.0 - u
    cube, other = u * u * u, v * v * v
    return (
        other / 6.0,
        (4.0 - 6.0 * u * u + 3.0 * cube) / 6.0,
        (4.0 - 6.0 * v * v + 3.0 * other) / 6.0,
        cube / 6.0,
    )


@kernel
def _entry(value, row, column, w):
    """Return the spline value of one column."""
    return (
        w[0] * value[row, column]
        + w[1] * value[row + 1, column]
        + w[2] * value[row + 2, column]
        + w[3] * value[row + 3, column]
    )


@kernel
def _tabulated(value, row, fraction, scale):
    """Return the Wrench of a table's first six columns, times scale."""
    w = spline_weights(fraction)
    return Wrench(
        scale * _entry(value, row, 0, w),
        scale * _entry(value, row, 1, w),
        scale * _entry(value, row, 2, w),
        scale * _entry(value, row, 3, w),
        scale * _entry(value, row, 4, w),
        scale * _entry(value, row, 5, w),
    )


@kernel
def exact_force(t, x, y, first, scratch):
    """Return the Wrench of an ExactExcitation at an inertial position, inertial axes."""
    force = first.force
    fx = fy = fz = mx = my = mz = 0.0
    for j in range(first.omega.shape[0]):
        angle = first.omega[j] * t - first.phase[j] - (x * first.along_x[j] + y * first.along_y[j])
        c, s = cos(angle), sin(angle)
        fx += force[j, 0] * c - force[j, 6] * s
        fy += force[j, 1] * c - force[j, 7] * s
        fz += force[j, 2] * c - force[j, 8] * s
        mx += force[j, 3] * c - force[j, 9] * s
        my += force[j, 4] * c - force[j, 10] * s
        mz += force[j, 5] * c - force[j, 11] * s
    f = ramp_factor(t, first.ramp)
    return Wrench(f * fx, f * fy, f * fz, f * mx, f * my, f * mz)


@kernel
def series_force(t, x, y, first, scratch):
    """Return the Wrench of an ExcitationSeries, inertial axes; the position is ignored."""
    row, fraction = row_at(t, first.table)
    if row < 0:
        return exact_force(t, 0.0, 0.0, first.exact, scratch)
    return _tabulated(first.table.value, row, fraction, ramp_factor(t, first.exact.ramp))


@kernel
def _fill_phasors(t, x, y, wave, scratch):
    """Fill the last two rows of scratch with cosine and sine of the components' phases at a position."""
    for j in range(wave.shape[1]):
        scratch[DISTANCE, j] = x * wave[ALONG_X, j] + y * wave[ALONG_Y, j]
        scratch[RATE, j] = wave[RATE, j]
        scratch[TURN, j] = wave[TURN, j]
    phasors(t, 1.0, scratch, scratch[3], scratch[4])


@kernel
def fast_force(t, x, y, first, scratch):
    """Return the Wrench of a FastExcitation at an inertial position, inertial axes."""
    _fill_phasors(t, x, y, first.wave, scratch)
    c, s, force, n = scratch[3], scratch[4], first.force, first.amplitude.shape[0]
    f = ramp_factor(t, first.ramp)
    return Wrench(
        f * (lane_dot(force[0], c, n) + lane_dot(force[6], s, n)),
        f * (lane_dot(force[1], c, n) + lane_dot(force[7], s, n)),
        f * (lane_dot(force[2], c, n) + lane_dot(force[8], s, n)),
        f * (lane_dot(force[3], c, n) + lane_dot(force[9], s, n)),
        f * (lane_dot(force[4], c, n) + lane_dot(force[10], s, n)),
        f * (lane_dot(force[5], c, n) + lane_dot(force[11], s, n)),
    )


# (t, x, y, first, scratch) -> Wrench, inertial axes
first_order_force = chosen_by_class(
    "first",
    {ExactExcitation: exact_force, ExcitationSeries: series_force, FastExcitation: fast_force},
)


@kernel
def meeting_point(x, position):
    """Return the inertial position (x, y) at which the waves act on the body."""
    if position is None:
        return 0.0, 0.0
    return x[position.first], x[position.first + 1]


@kernel
def position_rates(x, part, dx):
    """Fill dx with the rates of the filtered position of an Excitation or None."""
    if part is None:
        return
    _filter_rates(x, part.position, dx)


@kernel
def _filter_rates(x, position, dx):
    if position is None:
        return
    dx[position.first] = position.rate * (x[State.SURGE] - x[position.first])
    dx[position.first + 1] = position.rate * (x[State.SWAY] - x[position.first + 1])


@kernel
def add_second_order(t, force, second):
    """Return force plus the SecondOrder force; None: unchanged. The ramp is squared, as amplitudes are."""
    if second is None:
        return force
    f = ramp_factor(t, second.ramp)
    f *= f
    row, fraction = row_at(t, second.table)
    if row < 0:
        mean = second.mean
        return add(
            force, Wrench(f * mean[0], f * mean[1], f * mean[2], f * mean[3], f * mean[4], f * mean[5])
        )
    return add(force, _tabulated(second.table.value, row, fraction, f))


@kernel
def add_excitation(t, pose, x, load, part, scratch):
    """Return load (body axes) plus the wave excitation; part None: unchanged."""
    if part is None:
        return load
    at_x, at_y = meeting_point(x, part.position)
    force = add_second_order(t, first_order_force(t, at_x, at_y, part.first, scratch), part.second)
    fx, fy, fz = to_body(pose, force.fx, force.fy, force.fz)
    mx, my, mz = to_body(pose, force.mx, force.my, force.mz)
    return add(load, Wrench(fx, fy, fz, mx, my, mz))


@kernel
def _summed_elevation(t, waves, first, scratch):
    return elevation(t, 0.0, 0.0, waves)


@kernel
def _tabulated_elevation(t, waves, first, scratch):
    row, fraction = row_at(t, first.table)
    if row < 0:
        return elevation(t, 0.0, 0.0, waves)
    value = _entry(first.table.value, row, ELEVATION, spline_weights(fraction))
    return value * ramp_factor(t, first.exact.ramp)


@kernel
def _fast_elevation(t, waves, first, scratch):
    _fill_phasors(t, 0.0, 0.0, first.wave, scratch)
    return ramp_factor(t, first.ramp) * lane_dot(first.amplitude, scratch[3], first.amplitude.shape[0])


_elevation = chosen_by_class(
    "first",
    {
        ExactExcitation: _summed_elevation,
        ExcitationSeries: _tabulated_elevation,
        FastExcitation: _fast_elevation,
    },
)


@kernel
def elevation_beside(t, waves, part, scratch):
    """Return the elevation at the origin, m: from an Excitation, else by the plain sum."""
    if part is None:
        return elevation(t, 0.0, 0.0, waves)
    return _elevation(t, waves, part.first, scratch)
