"""Computes positions, directions and loads of blades with cone, prebend and sweep.

Directions of a blade: x along the shaft, downwind; r outwards, in the plane through shaft and pitch axis; t
in the direction of rotation, r x t = x. The momentum balance of a station is that of blade_elements.py, for
the wind normal to the blade axis (turned by cone and slope in the plane of x and r) and along t, at the
distance from the shaft; loads are per length of the blade axis. The slope that sweep and blade pitch add in
the plane of r and t is left out, as in AeroDyn (BEM_Mod 1). Blade pitch turns prebend and sweep about the
pitch axis, so positions and slopes depend on it. The pitching moment (cm) acts about the blade axis.
"""

from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.state import Wrench


class BladeShape(NamedTuple):
    """Holds positions of a blade's n stations about the pitch axis at zero blade pitch; k polar segments."""

    prebend: np.ndarray  # (n,) m, downwind of the pitch axis
    sweep: np.ndarray  # (n,) m, against the direction of rotation
    distance: np.ndarray  # (n,) m, from the rotor centre along the pitch axis
    slope: np.ndarray  # (n,) sine of the angle between blade axis and pitch axis, of prebend
    arm_prebend: np.ndarray  # (n,) m, the same three for the point where the load of the station acts
    arm_sweep: np.ndarray
    arm_distance: np.ndarray
    chord: np.ndarray  # (n,) m
    moment: np.ndarray  # (k, 2) cm at the start of each segment of the polars and its slope, 1/rad
    cone_cosine: float
    cone_sine: float  # positive: blades lean upwind
    reach: float  # m, largest distance of a station from the rotor centre


class OnAxis(NamedTuple):
    """Holds the position of a station of a straight blade in the rotor plane."""

    r: float  # m, from the rotor centre


class Station(NamedTuple):
    """Holds position and direction of a curved blade's station at a blade pitch, in blade directions."""

    x: float  # m
    r: float
    t: float
    nx: float  # normal of the blade axis, downwind; the axis itself is (-nr, nx, 0)
    nr: float


class Plane(NamedTuple):
    """Holds a quantity linear in the position of a station: one plus x, r and t times these slopes."""

    one: float
    x: float
    r: float
    t: float


class Turn(NamedTuple):
    """Holds a blade pitch with its cosine and sine."""

    pitch: float  # rad
    cosine: float
    sine: float


class Lever(NamedTuple):
    """Holds moments per unit force of a station, for forces normal to the blade axis (n) and along t.

    Forces act at the point (x, r, t), not exactly at the station.
    """

    nx: float  # directions of the normal, as in Station
    nr: float
    turn: float  # m, moment about t by n: x nr - r nx
    t_nx: float  # m, moment about r by n
    t_nr: float  # m, moment about -x by n
    x: float  # m, moment about -r by the force along t
    r: float  # m, moment about x by the force along t


class BladeMotion(NamedTuple):
    """Holds the directions of a blade in inertial components and the motion in blade directions."""

    ey: float  # e_r = (0, ey, ez) in rotor axes, e_t = (0, -ez, ey)
    ez: float
    rx: float  # e_r in inertial components
    ry: float
    rz: float
    tx: float  # e_t
    ty: float
    tz: float
    vx: float  # of the hub, m/s
    vr: float
    vt: float
    wx: float  # angular velocity including rotor speed, rad/s
    wr: float
    wt: float


class StationLoad(NamedTuple):
    """Holds the load of a station before multiplication by the length that the station represents."""

    normal: float  # force normal to the blade axis, downwind
    tangential: float  # force in the direction of rotation
    moment: float  # pitching moment, nose up; used for curved blades only
    length: float  # factor on the three
    first_moment: float  # factor on the forces of a straight blade for their moments about the rotor centre
    outside: int  # 1 where a table does not contain the inflow, else 0
    rates: object  # station_response.WakeRates, or None for a response without wake states


class BladeLoad(NamedTuple):
    """Holds the load of one blade about the rotor centre, in blade directions."""

    fx: float
    fr: float
    ft: float
    mx: float
    mr: float
    mt: float


@kernel
def effective_pitch(j, blade_pitch, shape):
    """Return the rotation of the section of station j about the local blade axis by blade pitch, rad."""
    if shape is None:
        return blade_pitch
    s = shape.slope[j]
    return atan2(sin(blade_pitch), sqrt(1.0 - s * s) * cos(blade_pitch))


@kernel
def turn_of(blade_pitch):
    """Return the Turn of a blade pitch (rad)."""
    return Turn(blade_pitch, cos(blade_pitch), sin(blade_pitch))


# ----------------------------------------------------- variants for straight and curved blades


@inlined_kernel
def _station_on_axis(j, turn, radius, shape):
    return OnAxis(radius[j])


@inlined_kernel
def curved_station(j, turn, radius, shape):
    """Return the Station j of a curved blade."""
    out = turn.cosine * shape.prebend[j] + turn.sine * shape.sweep[j]
    z, s = shape.distance[j], shape.slope[j] * turn.cosine
    c = sqrt(1.0 - s * s)
    return Station(
        shape.cone_cosine * out - shape.cone_sine * z,
        shape.cone_cosine * z + shape.cone_sine * out,
        turn.sine * shape.prebend[j] - turn.cosine * shape.sweep[j],
        c * shape.cone_cosine + s * shape.cone_sine,
        c * shape.cone_sine - s * shape.cone_cosine,
    )


@inlined_kernel
def lever_of(j, turn, shape):
    """Return the Lever of station j of a curved blade."""
    at = curved_station(j, turn, None, shape)
    out = turn.cosine * shape.arm_prebend[j] + turn.sine * shape.arm_sweep[j]
    z = shape.arm_distance[j]
    x = shape.cone_cosine * out - shape.cone_sine * z
    r = shape.cone_cosine * z + shape.cone_sine * out
    t = turn.sine * shape.arm_prebend[j] - turn.cosine * shape.arm_sweep[j]
    return Lever(at.nx, at.nr, x * at.nr - r * at.nx, t * at.nx, t * at.nr, x, r)


@inlined_kernel
def _value_on_axis(plane, at):
    return plane.one + plane.r * at.r


@inlined_kernel
def _value_at_station(plane, at):
    return plane.one + plane.x * at.x + plane.r * at.r + plane.t * at.t


@inlined_kernel
def _along_shaft(along, out, at):
    return along


@inlined_kernel
def _along_normal(along, out, at):
    return at.nx * along + at.nr * out


@inlined_kernel
def _add_to_straight(load, part, j, turn, shape):
    length, first = part.length, part.first_moment
    fn, ft = part.normal, part.tangential
    return BladeLoad(
        load.fx + length * fn, 0.0, load.ft + length * ft, load.mx + first * ft, 0.0, load.mt - first * fn
    )


@inlined_kernel
def _add_to_curved(load, part, j, turn, shape):
    lever = lever_of(j, turn, shape)
    fn, ft, moment = part.length * part.normal, part.length * part.tangential, part.length * part.moment
    return BladeLoad(
        load.fx + fn * lever.nx,
        load.fr + fn * lever.nr,
        load.ft + ft,
        load.mx + lever.r * ft - lever.t_nr * fn - moment * lever.nr,
        load.mr + lever.t_nx * fn - lever.x * ft + moment * lever.nx,
        load.mt + lever.turn * fn,
    )


# (j, turn, radius, shape) -> position of station j: OnAxis or Station
station_at = chosen_by_class(
    "shape", {type(None): _station_on_axis, BladeShape: curved_station}, inlined=True
)
# (plane, at) -> value of a Plane at the position of a station
value_at = chosen_by_class("at", {OnAxis: _value_on_axis, Station: _value_at_station}, inlined=True)
# (along, out, at) -> component normal to the blade axis of a vector (along, out) in x and r
normal_part = chosen_by_class("at", {OnAxis: _along_shaft, Station: _along_normal}, inlined=True)
# (load, part, j, turn, shape) -> BladeLoad with the StationLoad of station j added
add_station = chosen_by_class(
    "shape", {type(None): _add_to_straight, BladeShape: _add_to_curved}, inlined=True
)


# ------------------------------------------------------------------------------------ whole blades


@kernel
def blade_motion(psi, rotor_speed, pose, hub):
    """Return the BladeMotion of the blade at azimuth psi (rad); pose and hub in rotor axes."""
    ey, ez = -sin(psi), cos(psi)
    return BladeMotion(
        ey,
        ez,
        pose.r12 * ey + pose.r13 * ez,
        pose.r22 * ey + pose.r23 * ez,
        pose.r32 * ey + pose.r33 * ez,
        pose.r13 * ey - pose.r12 * ez,
        pose.r23 * ey - pose.r22 * ez,
        pose.r33 * ey - pose.r32 * ez,
        hub.vx,
        hub.vy * ey + hub.vz * ez,
        hub.vz * ey - hub.vy * ez,
        rotor_speed + pose.wx,
        pose.wy * ey + pose.wz * ez,
        pose.wz * ey - pose.wy * ez,
    )


@kernel
def with_blade(total, load, blade):
    """Return total plus the BladeLoad of a blade: a Wrench about the rotor centre in rotor axes."""
    return Wrench(
        total.fx + load.fx,
        total.fy + load.fr * blade.ey - load.ft * blade.ez,
        total.fz + load.fr * blade.ez + load.ft * blade.ey,
        total.mx + load.mx,
        total.my + load.mr * blade.ey - load.mt * blade.ez,
        total.mz + load.mr * blade.ez + load.mt * blade.ey,
    )


def _ends(values, distance, low, high):
    """Extend station values (n,) to hub and tip by linear extrapolation from the two outermost stations."""
    first = values[0] + (low - distance[0]) * (values[1] - values[0]) / (distance[1] - distance[0])
    last = values[-1] + (high - distance[-1]) * (values[-1] - values[-2]) / (distance[-1] - distance[-2])
    return np.concatenate(([first], values, [last]))


class BladeLine(NamedTuple):
    """Describes the axis of a blade from hub to tip through n stations."""

    points: np.ndarray  # (n + 2, 3) m: prebend, sweep, distance along the pitch axis
    length: np.ndarray  # (n + 2,) m from the rotor centre along the pitch axis and then along the blade axis


def blade_line(blade, hub_radius, tip_radius):
    """Return the BladeLine of a descriptions.turbine.Blade."""
    distance = np.asarray(blade.radius, dtype=float)
    offsets = [
        np.zeros_like(distance) if values is None else np.asarray(values, dtype=float)
        for values in (blade.prebend, blade.sweep)
    ]
    points = np.column_stack(
        [_ends(values, distance, hub_radius, tip_radius) for values in (*offsets, distance)]
    )
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return BladeLine(points, hub_radius + np.concatenate(([0.0], np.cumsum(steps))))


def is_curved(turbine):
    """Return whether the blades of a turbine have cone, prebend or sweep."""
    offsets = (turbine.blade.prebend, turbine.blade.sweep)
    return turbine.rotor.cone != 0.0 or any(v is not None and np.any(np.asarray(v) != 0.0) for v in offsets)


def line_integrals(line, weights):
    """Integrate line loads (m, n + 2) along a BladeLine; return force (m,) and first moments (m, 3)."""
    steps = np.diff(line.length)[:, None]
    low, high = weights[:, :-1], weights[:, 1:]
    force = 0.5 * (low + high) @ steps[:, 0]
    first = (low @ (steps * (2.0 * line.points[:-1] + line.points[1:]))) / 6.0
    first += (high @ (steps * (line.points[:-1] + 2.0 * line.points[1:]))) / 6.0
    return force, first


def build_blade_shape(turbine, line, chosen, arm, moment):
    """Return the BladeShape of chosen stations of a BladeLine; arm (n, 3) and moment: see BladeShape."""
    inner = line.points[1:-1]
    slope = np.gradient(inner[:, 0], inner[:, 2], edge_order=2 if len(inner) > 2 else 1)
    points = inner[chosen]
    columns = (*points.T, np.sin(np.arctan(slope))[chosen], *arm.T, np.asarray(turbine.blade.chord)[chosen])
    return BladeShape(
        *(np.ascontiguousarray(column, dtype=np.float64) for column in columns),
        np.ascontiguousarray(moment, dtype=np.float64),
        float(np.cos(turbine.rotor.cone)),
        float(np.sin(turbine.rotor.cone)),
        float(np.linalg.norm(points, axis=1).max()),
    )
