"""Wave force on a potential-flow body, first and second order (theory.md, 5.9).

Linear theory knows the body in its undisplaced place and pose alone, so the forces are functions of time, in
inertial axes about the body origin. First-order forces are a sum over the wave components, or the same sum
tabulated over time; second-order forces are tabulated always. A table holds the coefficients of a cubic
B-spline: four rows, of eight numbers each, make a value.
"""

from math import cos, floor, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.hydro.waves import elevation, ramp_factor
from fowt_env.plant.state import Wrench, add, to_body

COLUMNS = 8  # of a table: six of the force, the elevation at the origin, and one that fills a cache line
ELEVATION = 6


class ExactExcitation(NamedTuple):
    """First-order force by the plain sum: Re(force exp(i (omega t - phase)))."""

    omega: np.ndarray  # (n,) rad/s
    phase: np.ndarray  # (n,) e, rad
    force: np.ndarray  # (n, 12) of each component's amplitude, N and N m: six real parts, six imaginary ones
    ramp: float  # s over which the waves are raised from rest


class TimeTable(NamedTuple):
    """Coefficients of cubic B-splines over evenly spaced times from 0 to span."""

    value: np.ndarray  # (rows + 3, COLUMNS): of times -step, 0, ... span + step
    rate: float  # rows per second
    span: float  # s
    periodic: bool  # repeats after its span


class ExcitationSeries(NamedTuple):
    """First-order force and the elevation at the origin from a table, and the sum for times beyond it."""

    table: TimeTable
    exact: ExactExcitation


class SecondOrder(NamedTuple):
    """Difference-frequency force from a table; the mean force for times beyond it."""

    table: TimeTable
    mean: np.ndarray  # (6,) N and N m
    ramp: float  # s


class Excitation(NamedTuple):
    """Force of the waves on a potential-flow body."""

    first: object  # ExactExcitation or ExcitationSeries
    second: object  # SecondOrder or None


@kernel
def place_in(t, table):
    """(row, fraction) of a time in a table; row -1: beyond it."""
    if table.periodic:
        t -= table.span * floor(t / table.span)
    elif t < 0.0 or t > table.span:
        return -1, 0.0
    at = t * table.rate
    row = min(int(at), table.value.shape[0] - 4)
    return row, at - row


@kernel
def spline_weights(u):
    """Weights of the four coefficients about a place at this fraction (0 to 1) between two rows."""
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
    """Value of one column."""
    return (
        w[0] * value[row, column]
        + w[1] * value[row + 1, column]
        + w[2] * value[row + 2, column]
        + w[3] * value[row + 3, column]
    )


@kernel
def _tabulated(value, row, fraction, scale):
    """Wrench of a table's first six columns, times scale."""
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
def exact_force(t, first):
    """Wrench of an ExactExcitation, inertial axes."""
    force = first.force
    fx = fy = fz = mx = my = mz = 0.0
    for j in range(first.omega.shape[0]):
        angle = first.omega[j] * t - first.phase[j]
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
def series_force(t, first):
    """Wrench of an ExcitationSeries, inertial axes."""
    row, fraction = place_in(t, first.table)
    if row < 0:
        return exact_force(t, first.exact)
    return _tabulated(first.table.value, row, fraction, ramp_factor(t, first.exact.ramp))


# (t, first) -> Wrench, inertial axes
first_order_force = chosen_by_class("first", {ExactExcitation: exact_force, ExcitationSeries: series_force})


@kernel
def add_second_order(t, force, second):
    """The force with that of SecondOrder; as it is without. The ramp is squared, as amplitudes are."""
    if second is None:
        return force
    f = ramp_factor(t, second.ramp)
    f *= f
    row, fraction = place_in(t, second.table)
    if row < 0:
        mean = second.mean
        return add(
            force, Wrench(f * mean[0], f * mean[1], f * mean[2], f * mean[3], f * mean[4], f * mean[5])
        )
    return add(force, _tabulated(second.table.value, row, fraction, f))


@kernel
def add_excitation(t, pose, load, part):
    """The load (body axes) with the force of the waves; as it is without the part."""
    if part is None:
        return load
    force = add_second_order(t, first_order_force(t, part.first), part.second)
    fx, fy, fz = to_body(pose, force.fx, force.fy, force.fz)
    mx, my, mz = to_body(pose, force.mx, force.my, force.mz)
    return add(load, Wrench(fx, fy, fz, mx, my, mz))


@kernel
def _summed_elevation(t, waves, first):
    return elevation(t, 0.0, 0.0, waves)


@kernel
def _tabulated_elevation(t, waves, first):
    row, fraction = place_in(t, first.table)
    if row < 0:
        return elevation(t, 0.0, 0.0, waves)
    value = _entry(first.table.value, row, ELEVATION, spline_weights(fraction))
    return value * ramp_factor(t, first.exact.ramp)


_elevation = chosen_by_class(
    "first", {ExactExcitation: _summed_elevation, ExcitationSeries: _tabulated_elevation}
)


@kernel
def elevation_beside(t, waves, part):
    """Elevation at the origin, m: from the table of an Excitation that has one, else by the sum."""
    if part is None:
        return elevation(t, 0.0, 0.0, waves)
    return _elevation(t, waves, part.first)
