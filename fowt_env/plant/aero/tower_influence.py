"""Computes the wind that the tower disturbs at blade stations: potential flow and tower shadow.

A cylinder in the wind normal to the tower axis slows the flow in front of it and turns it aside (potential
flow, also with the correction of Bak et al. for drag), and leaves a wake behind it (shadow of Powles, or of
Eames). The models, their limits and the taper at both ends are those of AeroDyn (theory.md, 5.1). The tower
is straight: its axis is that of the nacelle frame (tower/modes.py).
"""

from math import cos, exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.blade_shape import Plane, normal_part, value_at
from fowt_env.plant.aero.wind import interval_at, wind_at
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.tilt import rotor_axes

POTENTIAL = (False, "potential", "bak")  # models of the flow around the tower, by the number in a part
SHADOW = (False, "powles", "eames")  # models of the wake behind it
BAK_OFFSET = 0.1  # tower radii, by which the cylinder of Bak's model lies upwind
LARGEST_DEFICIT = 0.5  # of the shadow, as a fraction of the wind
NEAREST, FARTHEST = 0.01, 20.0  # tower diameters from the surface between which the wind is disturbed


class TowerInfluence(NamedTuple):
    """Holds k sections of the tower and the models of its influence on the wind."""

    height: np.ndarray  # (k,) m, along the tower axis from still water at rest
    diameter: np.ndarray  # (k,) m
    drag: np.ndarray  # (k,) drag coefficient
    intensity: np.ndarray  # (k,) turbulence intensity in the wake, of Eames' model
    potential: int  # index in POTENTIAL
    shadow: int  # index in SHADOW
    axis_x: float  # direction of the tower axis in rotor axes
    axis_z: float
    hub_x: float  # m, rotor centre in rotor axes
    hub_z: float


class Place(NamedTuple):
    """Locates a point by the tower: foot on its axis, and the vector from there across the axis."""

    foot: float  # m, height of the foot along the axis
    across_x: float  # m, normal to the axis in the plane of axis and shaft
    across_y: float  # m, to the left
    beyond: float  # m, along the axis beyond the end of the tower, with sign


def build_tower_influence(sections, potential, shadow, rotor):
    """Return the TowerInfluence of tower sections at a descriptions.turbine.Rotor; None without a model.

    sections: heights, diameters, drag coefficients and turbulence intensities, each (k,).
    """
    if not (potential or shadow):
        return None
    axis = rotor_axes(0.0, 1.0, rotor.shaft_tilt)
    hub = rotor_axes(-rotor.overhang, rotor.hub_height, rotor.shaft_tilt)
    columns = (np.ascontiguousarray(column, dtype=np.float64) for column in sections)
    models = POTENTIAL.index(potential), SHADOW.index(shadow)
    return TowerInfluence(*columns, *models, *map(float, axis), *map(float, hub))


@kernel
def disturbance(x, y, drag, intensity, part):
    """Return the disturbance (downwind, to the left) over the wind at a point x downwind of the axis.

    x, y: in tower radii. part: TowerInfluence.
    """
    u = v = 0.0
    if part.potential > 0:
        at = x + BAK_OFFSET if part.potential == 2 else x
        square = at * at + y * y
        u, v = (y * y - at * at) / (square * square), -2.0 * at * y / (square * square)
        if part.potential == 2:
            source = drag / (2.0 * pi * square)
            u, v = u + source * at, v + source * y
    deficit = 0.0
    if part.shadow == 1 and x > 0.0:
        width = sqrt(sqrt(x * x + y * y))
        if abs(y) < width:
            c = cos(0.5 * pi * y / width)
            deficit = drag / width * c * c
    elif part.shadow == 2 and x > 0.0:
        width = intensity * x
        deficit = drag / (width * sqrt(2.0 * pi)) * exp(-0.5 * y * y / (width * width))
    return u - min(deficit, LARGEST_DEFICIT), v


@inlined_kernel
def place_of(at, motion, part):
    """Return the Place of a station at in blade directions."""
    x = part.hub_x + value_at(Plane(0.0, 1.0, 0.0, 0.0), at)
    y = value_at(Plane(0.0, 0.0, motion.ey, -motion.ez), at)
    z = part.hub_z + value_at(Plane(0.0, 0.0, motion.ez, motion.ey), at)
    along = part.axis_x * x + part.axis_z * z
    foot = min(max(along, part.height[0]), part.height[part.height.shape[0] - 1])
    return Place(foot, part.axis_z * x - part.axis_x * z, y, along - foot)


@kernel
def _across(place, flow, part):
    """Return the wind relative to the tower at the foot of a Place, across the axis, m/s."""
    pose, x, z = flow.pose, place.foot * part.axis_x, place.foot * part.axis_z
    u, v, w = wind_at(
        flow.t, pose.x + pose.r11 * x + pose.r13 * z, pose.y + pose.r21 * x + pose.r23 * z,
        pose.z + pose.r31 * x + pose.r33 * z, flow.now, flow.series, flow.field,
    )  # fmt: skip
    wx = pose.r11 * u + pose.r21 * v + pose.r31 * w - pose.vx - pose.wy * z
    wy = pose.r12 * u + pose.r22 * v + pose.r32 * w - pose.vy - pose.wz * x + pose.wx * z
    wz = pose.r13 * u + pose.r23 * v + pose.r33 * w - pose.vz + pose.wy * x
    return part.axis_z * wx - part.axis_x * wz, wy


@kernel
def disturbed_across(place, flow, part):
    """Return the disturbance of the wind at a Place, m/s, in the directions of across_x and across_y."""
    i = interval_at(part.height, place.foot)
    share = (place.foot - part.height[i]) / (part.height[i + 1] - part.height[i])
    diameter = (1.0 - share) * part.diameter[i] + share * part.diameter[i + 1]
    drag = (1.0 - share) * part.drag[i] + share * part.drag[i + 1]
    intensity = (1.0 - share) * part.intensity[i] + share * part.intensity[i + 1]
    beyond, radius = 2.0 / diameter * place.beyond, 0.5 * diameter
    square = place.across_x * place.across_x + place.across_y * place.across_y
    clear = sqrt(square + place.beyond * place.beyond) - radius
    if not (abs(beyond) < 1.0 and NEAREST * diameter < clear <= FARTHEST * diameter):
        return 0.0, 0.0
    wx, wy = _across(place, flow, part)
    speed = sqrt(wx * wx + wy * wy)
    if speed == 0.0:
        return 0.0, 0.0
    ex, ey = wx / speed, wy / speed
    scale = radius * cos(0.5 * pi * beyond)
    x = (place.across_x * ex + place.across_y * ey) / scale
    y = (place.across_y * ex - place.across_x * ey) / scale
    u, v = disturbance(x, y, drag, intensity, part)
    return speed * (u * ex - v * ey), speed * (u * ey + v * ex)


@inlined_kernel
def beside_tower(v_normal, v_tangential, at, motion, flow):
    """Return the relative wind (v_normal, v_tangential), m/s, of a station with the tower's disturbance.

    flow: blade_sweep.RotorFlow, or None without an influence of the tower.
    """
    if flow is None:
        return v_normal, v_tangential
    part = flow.tower
    dx, dy = disturbed_across(place_of(at, motion, part), flow, part)
    along, side, up = part.axis_z * dx, dy, -part.axis_x * dx
    out = motion.ey * side + motion.ez * up
    return (
        v_normal + normal_part(along, out, at),
        v_tangential - (motion.ey * up - motion.ez * side),
    )
