"""Computes the buoyancy of straight cylinders and cones of any direction, to still water (theory.md, 5.10).

A fully submerged or dry member, and a cylinder cut by the water on its side alone, have closed forms. Other
cuts are integrated by circular slices across the axis, with a separate Gauss rule where the water cuts them.
"""

from math import acos, pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import Wrench

SLICE_NODES = 24  # 1e-6 of the volume of the cut part

# columns of MemberBodies.table: start and axis in body axes, length, radius at start and end
LENGTH, RADIUS = 6, 7
N_BODY = 9


class MemberBodies(NamedTuple):
    """Holds the members with individual buoyancy, outside any potential-flow body."""

    table: np.ndarray  # (n, N_BODY)
    specific_weight: float  # rho g, N/m3
    gauss_x: np.ndarray  # (SLICE_NODES,) on [0, 1]
    gauss_w: np.ndarray


class Displaced(NamedTuple):
    """Holds a displaced volume (m3) and its first moments (m4): along the axis from start, across upwards."""

    volume: float
    along: float
    across: float


def build_member_bodies(members, density, gravity):
    """Return the MemberBodies of the Member records outside a potential-flow body; None without any."""
    rows = []
    for member in members:
        if not member.potential_flow:
            start, end = np.array(member.start), np.array(member.end)
            length = float(np.linalg.norm(end - start))
            radii = [0.5 * diameter for diameter in member.diameter]
            rows.append(np.concatenate([start, (end - start) / length, [length], radii]))
    if not rows:
        return None
    x, w = np.polynomial.legendre.leggauss(SLICE_NODES)
    return MemberBodies(np.array(rows), float(density * gravity), 0.5 * (1.0 + x), 0.5 * w)


@kernel
def add_member_buoyancy(pose, load, members):
    """Return load plus the buoyancy of Members; None: unchanged."""
    if members is None:
        return load
    return _add_buoyancy(pose, load, members.bodies)


@kernel
def _add_buoyancy(pose, load, bodies):
    """Return load plus the buoyancy F = rho g V n, M = rho g Q x n, n being the vertical in body axes."""
    if bodies is None:
        return load
    volume, qx, qy, qz = displaced(pose, bodies)
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    c = bodies.specific_weight
    return Wrench(
        load.fx + c * volume * nx,
        load.fy + c * volume * ny,
        load.fz + c * volume * nz,
        load.mx + c * (qy * nz - qz * ny),
        load.my + c * (qz * nx - qx * nz),
        load.mz + c * (qx * ny - qy * nx),
    )


@kernel
def displaced(pose, bodies):
    """Return (V, Qx, Qy, Qz): volume below still water of all bodies and its first moment in body axes."""
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    volume = qx = qy = qz = 0.0
    for i in range(bodies.table.shape[0]):
        row = bodies.table[i]
        rise = nx * row[3] + ny * row[4] + nz * row[5]  # of the axis, per metre
        lean = sqrt(max(1.0 - rise * rise, 0.0))
        height = pose.z + nx * row[0] + ny * row[1] + nz * row[2]
        part = wet_cone(height, rise, lean, row[LENGTH], row[RADIUS], row[RADIUS + 1], bodies)
        volume += part.volume
        qx += part.volume * row[0] + part.along * row[3]
        qy += part.volume * row[1] + part.along * row[4]
        qz += part.volume * row[2] + part.along * row[5]
        if part.across != 0.0:  # in the direction across the axis that rises most
            scale = part.across / lean
            qx += scale * (nx - rise * row[3])
            qy += scale * (ny - rise * row[4])
            qz += scale * (nz - rise * row[5])
    return volume, qx, qy, qz


@kernel
def wet_cone(height, rise, lean, length, a, b, bodies):
    """Return the Displaced volume of a cone below still water, of radius a at its start and b at its end.

    height: of the start above still water, m; rise, lean: vertical and horizontal part of the axis.
    """
    top = height + rise * length
    if height + lean * a <= 0.0 and top + lean * b <= 0.0:
        square = a * a + a * b + b * b
        volume = pi * length * square / 3.0
        return Displaced(volume, 0.25 * volume * length * (square + a * b + 2.0 * b * b) / square, 0.0)
    if height - lean * a >= 0.0 and top - lean * b >= 0.0:
        return Displaced(0.0, 0.0, 0.0)
    steep = abs(rise)
    if a == b and steep > 1e-3:
        cut, tilt = -height / rise, lean / steep
        if cut - tilt * a >= 0.0 and cut + tilt * a <= length:
            area, inertia = pi * a * a, 0.25 * pi * a**4
            half = 0.5 * inertia * tilt * tilt
            if rise > 0.0:
                return Displaced(area * cut, 0.5 * area * cut * cut + half, -inertia * tilt)
            return Displaced(
                area * (length - cut), 0.5 * area * (length * length - cut * cut) - half, -inertia * tilt
            )
    return _sliced(height, rise, lean, length, a, b, bodies)


@kernel
def _sliced(height, rise, lean, length, a, b, bodies):
    """Return the Displaced volume of wet_cone by circular slices across the axis."""
    slope = (b - a) / length
    # positions where the lowest and the highest point of a slice meet the water: slices between are cut
    first = _crossing(height - lean * a, rise - lean * slope, length)
    second = _crossing(height + lean * a, rise + lean * slope, length)
    low, high = min(first, second), max(first, second)
    volume = along = across = 0.0
    for piece in range(3):
        lower = 0.0 if piece == 0 else (low if piece == 1 else high)
        upper = low if piece == 0 else (high if piece == 1 else length)
        width = upper - lower
        if width <= 0.0:
            continue
        for k in range(bodies.gauss_x.shape[0]):
            s = lower + width * bodies.gauss_x[k]
            weight = width * bodies.gauss_w[k]
            radius = a + slope * s
            limit = -(height + rise * s)  # wet where lean times the distance across is below this
            if limit >= lean * radius:
                area, side = pi * radius * radius, 0.0
            elif limit <= -lean * radius:
                area, side = 0.0, 0.0
            else:
                c = limit / lean
                root = sqrt(max(radius * radius - c * c, 0.0))
                area = radius * radius * (pi - acos(min(max(c / radius, -1.0), 1.0))) + c * root
                side = -2.0 / 3.0 * root**3
            volume += weight * area
            along += weight * area * s
            across += weight * side
    return Displaced(volume, along, across)


@kernel
def _crossing(value, slope, length):
    """Return the position s on the axis where value + slope s is zero, limited to [0, length]."""
    if slope == 0.0:
        return 0.0
    return min(max(-value / slope, 0.0), length)
