"""Computes the wind drag of the tower (theory.md, Eq. 14)."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.wind import power_profile, profile_at, profile_spans, scaled_wind, wind_at
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import NO_LOAD, Wrench, to_inertial

POINTS = 6  # Gauss points: within 4e-6 of force and moment by 60 points, sheared wind, pitching tower


class TowerDrag(NamedTuple):
    """Holds n Gauss points over the height of the tower, with the drag factor of each."""

    z: np.ndarray  # (n,) m, body frame
    factor: np.ndarray  # (n,) kg/m: 1/2 air density * drag coefficient * diameter * quadrature weight


def build_tower_drag(tower, air_density, points=POINTS):
    """Return the TowerDrag of a tower description; the diameter is linear from base to top."""
    node, weight = np.polynomial.legendre.leggauss(points)
    height = tower.top_height - tower.base_height
    up = 0.5 * (node + 1.0)
    diameter = tower.base_diameter + up * (tower.top_diameter - tower.base_diameter)
    factor = 0.5 * air_density * tower.drag_coefficient * diameter * 0.5 * height * weight
    return TowerDrag(
        np.ascontiguousarray(tower.base_height + height * up, dtype=np.float64),
        np.ascontiguousarray(factor, dtype=np.float64),
    )


@kernel
def tower_load(t, pose, now, series, field, tower):
    """Return the drag Wrench of the relative wind normal to the tower's axis; theory.md, Eq. 14.

    No tower or no wind series: zero. In still air (a series of zero wind) drag always dissipates energy.
    """
    if tower is None:
        return NO_LOAD
    if series is None:
        return NO_LOAD
    low, high = pose.z + tower.z[0] * pose.r33, pose.z + tower.z[tower.z.shape[0] - 1] * pose.r33
    profiled = field is None and profile_spans(low, high)
    profile = power_profile(low, high, series) if profiled else power_profile(1.0, 1.0, series)
    fx = fy = mx = my = 0.0
    for i in range(tower.z.shape[0]):
        z = tower.z[i]
        X, Y, Z = pose.x + z * pose.r13, pose.y + z * pose.r23, pose.z + z * pose.r33
        if profiled:  # evaluating the power law at every point takes a tenth of a time step
            shear = profile.scale * profile_at(Z / profile.centre - 1.0, profile)
            u, v, w = scaled_wind(Y, Z, shear, now, series)
        else:
            u, v, w = wind_at(t, X, Y, Z, now, series, field)
        wx = pose.r11 * u + pose.r21 * v + pose.r31 * w - pose.vx - pose.wy * z
        wy = pose.r12 * u + pose.r22 * v + pose.r32 * w - pose.vy + pose.wx * z
        pressure = tower.factor[i] * sqrt(wx * wx + wy * wy)
        fx += pressure * wx
        fy += pressure * wy
        mx -= z * pressure * wy
        my += z * pressure * wx
    return Wrench(fx, fy, 0.0, mx, my, 0.0)


@kernel
def bent_tower_load(t, pose, x, now, series, field, tower, modes, modal):
    """Return the drag Wrench of a flexible tower, from position and velocity of its displaced points.

    modes: elastic.tower.TowerModes. The generalised forces on the deflections are added to modal (n,).
    """
    if tower is None:
        return NO_LOAD
    if series is None:
        return NO_LOAD
    n = len(modes.beam.count)
    first, rate = modes.first, modes.first + n
    fx = fy = mx = my = mz = 0.0
    for i in range(tower.z.shape[0]):
        z, shape = tower.z[i], modes.drag_shape[i]
        px = py = vx = vy = 0.0
        for j in range(0, n, 2):
            px += shape[j] * x[first + j]
            py += shape[j + 1] * x[first + j + 1]
            vx += shape[j] * x[rate + j]
            vy += shape[j + 1] * x[rate + j + 1]
        X, Y, Z = to_inertial(pose, px, py, z)
        u, v, w = wind_at(t, pose.x + X, pose.y + Y, pose.z + Z, now, series, field)
        wx = pose.r11 * u + pose.r21 * v + pose.r31 * w - pose.vx - pose.wy * z + pose.wz * py - vx
        wy = pose.r12 * u + pose.r22 * v + pose.r32 * w - pose.vy + pose.wx * z - pose.wz * px - vy
        pressure = tower.factor[i] * sqrt(wx * wx + wy * wy)
        along, side = pressure * wx, pressure * wy
        fx += along
        fy += side
        mx -= z * side
        my += z * along
        mz += px * side - py * along
        for j in range(0, n, 2):
            modal[j] += shape[j] * along
            modal[j + 1] += shape[j + 1] * side
    return Wrench(fx, fy, 0.0, mx, my, mz)
