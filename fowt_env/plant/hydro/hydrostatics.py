"""Computes the buoyancy of the hull up to the still-water plane, theory.md Eq. (15).

The buoyancy has a closed form while the plane cuts only the upper cylinder; otherwise circular slices are
integrated numerically, and counted (Counter.HYDROSTATIC_FALLBACK) for the report of a run.
"""

from math import acos, pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.events import Counter
from fowt_env.plant.state import NO_LOAD, Wrench

SLICE_NODES = 24  # Gauss points per section in the partly wet zone; 1e-4 of the volume at 60 deg


class BuoyantHull(NamedTuple):
    """Holds the outer shape of the hull and the constants of its closed-form buoyancy."""

    specific_weight: float  # rho g, N/m3
    radius: float  # of the water-piercing cylinder, m
    z_join: float  # lower end of the cylinder, body z
    z_top: float
    volume_below: float  # V below z_join, m3
    moment_below: float  # integral of z over V, m4
    z: np.ndarray  # (n,) section boundaries, keel first
    section_radius: np.ndarray  # (n,)
    gauss_x: np.ndarray  # (SLICE_NODES,) on [-1, 1]
    gauss_w: np.ndarray


def build_hull(hull, water_density, gravity):
    """Return the BuoyantHull of a descriptions.platform.Hull."""
    z = np.ascontiguousarray(hull.z, dtype=np.float64)
    radius = np.ascontiguousarray(hull.diameter, dtype=np.float64) / 2.0
    volume = moment = 0.0
    for lower, upper, a, b in zip(z[:-2], z[1:-1], radius[:-2], radius[1:-1], strict=True):
        part, first = _frustum(lower, upper, a, b)
        volume += part
        moment += first
    x, w = np.polynomial.legendre.leggauss(SLICE_NODES)
    return BuoyantHull(
        float(water_density * gravity),
        float(radius[-1]),
        float(z[-2]),
        float(z[-1]),
        float(volume),
        float(moment),
        z,
        radius,
        np.ascontiguousarray(x),
        np.ascontiguousarray(w),
    )


def _frustum(lower, upper, a, b):
    """Return volume and first moment about z = 0 of a frustum, radius a at the lower, b at the upper end."""
    height = upper - lower
    volume = pi * height * (a * a + a * b + b * b) / 3.0
    centroid = height * (a * a + 2.0 * a * b + 3.0 * b * b) / (4.0 * (a * a + a * b + b * b))
    return volume, volume * (lower + centroid)


@kernel
def submerged(pose, hull, counters):
    """Return (V, Qx, Qy, Qz): submerged volume and its first moment in body axes, still-water plane Z = 0."""
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    horizontal = sqrt(nx * nx + ny * ny)
    if nz > 1e-3:
        zw = -pose.z / nz
        reach = hull.radius * horizontal / nz
        if zw - reach > hull.z_join and zw + reach < hull.z_top:
            area = pi * hull.radius**2
            inertia = pi * hull.radius**4 / 4.0
            tilt2 = (horizontal / nz) ** 2
            volume = hull.volume_below + area * (zw - hull.z_join)
            qz = hull.moment_below + 0.5 * area * (zw * zw - hull.z_join**2) + 0.5 * inertia * tilt2
            return volume, -inertia * nx / nz, -inertia * ny / nz, qz
    counters[Counter.HYDROSTATIC_FALLBACK] += 1.0
    return sliced(pose, hull)


@kernel
def sliced(pose, hull):
    """Return the submerged (V, Qx, Qy, Qz) by circular slices normal to the axis, any attitude and draft."""
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    horizontal = sqrt(nx * nx + ny * ny)
    volume = 0.0
    q_side = 0.0  # first moment along the horizontal projection of the vertical
    qz = 0.0
    for i in range(hull.z.shape[0] - 1):
        z0, z1 = hull.z[i], hull.z[i + 1]
        a0, a1 = hull.section_radius[i], hull.section_radius[i + 1]
        widest = max(a0, a1)
        # heights between which the surface cuts slices; each piece is smooth, so that a Gauss rule
        # converges fast
        if abs(nz) > 1e-12:
            mid = -pose.z / nz
            reach = widest * horizontal / abs(nz)
            low = min(max(mid - reach, z0), z1)
            high = min(max(mid + reach, z0), z1)
        else:
            low, high = z0, z1
        for piece in range(3):
            if piece == 0:
                lower, upper = z0, low
            elif piece == 1:
                lower, upper = low, high
            else:
                lower, upper = high, z1
            half = 0.5 * (upper - lower)
            if half <= 0.0:
                continue
            for k in range(hull.gauss_x.shape[0]):
                z = lower + half * (1.0 + hull.gauss_x[k])
                weight = half * hull.gauss_w[k]
                a = a0 + (a1 - a0) * (z - z0) / (z1 - z0)
                limit = -(pose.z + nz * z)  # wet where nx x + ny y < limit
                if limit >= horizontal * a:
                    area, side = pi * a * a, 0.0
                elif limit <= -horizontal * a:
                    area, side = 0.0, 0.0
                else:
                    s = limit / horizontal
                    root = sqrt(max(a * a - s * s, 0.0))
                    area = a * a * (pi - acos(min(max(s / a, -1.0), 1.0))) + s * root
                    side = -2.0 / 3.0 * root**3
                volume += weight * area
                q_side += weight * side
                qz += weight * area * z
    if horizontal > 0.0:
        return volume, q_side * nx / horizontal, q_side * ny / horizontal, qz
    return volume, 0.0, 0.0, qz


@kernel
def hydrostatic_load(pose, hull, counters):
    """Return the buoyancy F = rho g V n, M = rho g Q x n with n the vertical in body axes."""
    if hull is None:
        return NO_LOAD
    volume, qx, qy, qz = submerged(pose, hull, counters)
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    c = hull.specific_weight
    return Wrench(
        c * volume * nx,
        c * volume * ny,
        c * volume * nz,
        c * (qy * nz - qz * ny),
        c * (qz * nx - qx * nz),
        c * (qx * ny - qy * nx),
    )
