"""Computes full-field wind at a point of a box of frozen turbulence, convected by the mean wind."""

from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.prefetch import prefetch


class WindField(NamedTuple):
    """Holds a wind box: slices normal to the mean wind, evenly spaced in time, height and width."""

    velocity: np.ndarray  # (n_time, n_z, n_y, 3) float32 u, v, w, m/s
    rate: float  # slices per second
    shift: float  # s, added to the time
    slowness: float  # s/m, 1 over the convection speed of the box
    low_y: float  # m, lowest grid line
    low_z: float
    inverse_dy: float  # 1/m
    inverse_dz: float
    periodic: bool  # False: constant before the first and after the last slice


@kernel
def field_at(t, X, Y, Z, field):
    """Return the wind (u, v, w), m/s, inertial components, at the inertial point X, Y, Z (m), time t (s)."""
    velocity = field.velocity
    slices, n_z, n_y = velocity.shape[0], velocity.shape[1], velocity.shape[2]
    s = (t + field.shift - X * field.slowness) * field.rate
    if field.periodic:
        s = s % slices
    if not s > 0.0:  # also for NaN
        s = 0.0
    if field.periodic:
        i = min(int(s), slices - 1)
        after = (i + 1) % slices
    else:
        s = min(s, slices - 1.0)
        i = max(0, min(int(s), slices - 2))
        after = min(i + 1, slices - 1)
    late = s - i
    y = min(max((Y - field.low_y) * field.inverse_dy, 0.0), n_y - 1.0)
    z = min(max((Z - field.low_z) * field.inverse_dz, 0.0), n_z - 1.0)
    if not (y >= 0.0 and z >= 0.0):
        y = z = 0.0
    j, k = min(int(y), n_y - 2), min(int(z), n_z - 2)
    left, up = y - j, z - k
    ground = 1.0
    if Z < field.low_z:
        ground = max(Z, 0.0) / field.low_z
    a = (1.0 - up) * (1.0 - left) * ground
    b = (1.0 - up) * left * ground
    c = up * (1.0 - left) * ground
    d = up * left * ground
    u = v = w = 0.0
    for number in range(2):
        cut, fraction = (velocity[i], 1.0 - late) if number == 0 else (velocity[after], late)
        p, q, r, s = fraction * a, fraction * b, fraction * c, fraction * d
        u += p * cut[k, j, 0] + q * cut[k, j + 1, 0] + r * cut[k + 1, j, 0] + s * cut[k + 1, j + 1, 0]
        v += p * cut[k, j, 1] + q * cut[k, j + 1, 1] + r * cut[k + 1, j, 1] + s * cut[k + 1, j + 1, 1]
        w += p * cut[k, j, 2] + q * cut[k, j + 1, 2] + r * cut[k + 1, j, 2] + s * cut[k + 1, j + 1, 2]
    return u, v, w


class GridPlace(NamedTuple):
    """Holds a position in a wind box: grid steps from first slice, lowest row and rightmost column."""

    slice: float
    row: float
    column: float


@kernel
def _across(velocity, cut, row, column, component, p, q, r, d):
    """Return a wind component within a slice: the weighted sum (p, q, r, d) of the corners of a cell."""
    above, beside = row + np.uintp(1), column + np.uintp(1)
    return (
        p * velocity[cut, row, column, component]
        + q * velocity[cut, row, beside, component]
        + r * velocity[cut, above, column, component]
        + d * velocity[cut, above, beside, component]
    )


@inlined_kernel
def cell_wind(place, velocity):
    """Return the wind (u, v, w) of a box, m/s, at a GridPlace inside the grid."""
    s, y, z = place.slice, place.column, place.row
    # unsigned indices avoid the test for negative indices
    now, row, column = np.uintp(s), np.uintp(z), np.uintp(y)
    late, up, left = s - float(now), z - float(row), y - float(column)
    after = now + np.uintp(1)
    # in a long box the processor does not anticipate the read of the next slice
    prefetch(velocity, after + np.uintp(1), row, column)
    prefetch(velocity, after + np.uintp(1), row + np.uintp(1), column)
    p, q = (1.0 - up) * (1.0 - left), (1.0 - up) * left
    r, d = up * (1.0 - left), up * left
    rest = 1.0 - late
    u = rest * _across(velocity, now, row, column, 0, p, q, r, d)
    v = rest * _across(velocity, now, row, column, 1, p, q, r, d)
    w = rest * _across(velocity, now, row, column, 2, p, q, r, d)
    u += late * _across(velocity, after, row, column, 0, p, q, r, d)
    v += late * _across(velocity, after, row, column, 1, p, q, r, d)
    w += late * _across(velocity, after, row, column, 2, p, q, r, d)
    return u, v, w
