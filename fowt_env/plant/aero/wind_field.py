"""Full-field wind at a point: a box of frozen turbulence that the mean wind carries past the turbine."""

from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.prefetch import prefetch


class WindField(NamedTuple):
    """A box of wind: slices normal to the mean wind, evenly spaced in time, height and across."""

    velocity: np.ndarray  # (n_time, n_z, n_y, 3) float32 u, v, w, m/s
    rate: float  # slices per second
    shift: float  # s, added to the time
    slowness: float  # s/m, 1 over the speed at which the box travels
    low_y: float  # m, lowest grid line
    low_z: float
    inverse_dy: float  # 1/m
    inverse_dz: float
    periodic: bool  # False: the first and last slices hold


@kernel
def field_at(t, X, Y, Z, field):
    """Return (u, v, w) m/s, inertial components, at the inertial point X, Y, Z (m) and time t (s)."""
    velocity = field.velocity
    slices, n_z, n_y = velocity.shape[0], velocity.shape[1], velocity.shape[2]
    s = (t + field.shift - X * field.slowness) * field.rate
    if field.periodic:
        s = s % slices
    if not s > 0.0:  # also where s is not a number
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
    """Place on the grid of a box, in grid steps from its first slice, lowest row and rightmost column."""

    slice: float
    row: float
    column: float


@kernel
def _across(velocity, cut, row, column, component, p, q, r, d):
    """Return a component of the wind within a slice, from the corners of a cell with their weights."""
    above, beside = row + np.uintp(1), column + np.uintp(1)
    return (
        p * velocity[cut, row, column, component]
        + q * velocity[cut, row, beside, component]
        + r * velocity[cut, above, column, component]
        + d * velocity[cut, above, beside, component]
    )


@inlined_kernel
def cell_wind(place, velocity):
    """Return (u, v, w) of a box at a GridPlace within its grid, m/s."""
    s, y, z = place.slice, place.column, place.row
    # indices without sign are not tested for counting from the end
    now, row, column = np.uintp(s), np.uintp(z), np.uintp(y)
    late, up, left = s - float(now), z - float(row), y - float(column)
    after = now + np.uintp(1)
    # in a long box every new slice lies in memory that the processor does not expect to be read
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
