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

from fowt_env.plant.aero.bent_blade import (
    ACROSS,
    ALONG,
    ARM_R,
    ARM_X,
    MOMENT,
    NORMAL,
    NR,
    NX,
    T_NR,
    T_NX,
    TANGENTIAL,
    TURN,
    V_NORMAL,
    V_T,
    BentShape,
    R,
    StationModes,
    T,
    X,
    constants,
    loaded_at,
    modal_size,
    place_all,
    placed,
)
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


class BentStation(NamedTuple):
    """Holds position, direction and velocity by bending of a station of a bent blade, in blade directions."""

    x: float  # m
    r: float
    t: float
    nx: float  # normal of the blade axis, as in Station
    nr: float
    v_normal: float  # m/s
    vt: float


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
def _pitch_on_axis(j, blade_pitch, shape):
    return blade_pitch


@kernel
def _pitch_of_curved(j, blade_pitch, shape):
    s = shape.slope[j]
    return atan2(sin(blade_pitch), sqrt(1.0 - s * s) * cos(blade_pitch))


@kernel
def _pitch_of_bent(j, blade_pitch, shape):
    return atan2(placed(j, ACROSS, shape), placed(j, ALONG, shape))


@kernel
def turn_of(blade_pitch):
    """Return the Turn of a blade pitch (rad)."""
    return Turn(blade_pitch, cos(blade_pitch), sin(blade_pitch))


@kernel
def turn_like(turn, blade_pitch):
    """Return the Turn of a blade pitch (rad), which may be that of another Turn."""
    return turn if blade_pitch == turn.pitch else turn_of(blade_pitch)


# ----------------------------------------------- variants for straight, curved and bent blades


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
def _bent_station(j, turn, radius, shape):
    return BentStation(
        placed(j, X, shape), placed(j, R, shape), placed(j, T, shape), placed(j, NX, shape),
        placed(j, NR, shape), placed(j, V_NORMAL, shape), placed(j, V_T, shape),
    )  # fmt: skip


@inlined_kernel
def bent_lever(j, shape):
    """Return the Lever of station j of a blade that bends."""
    return Lever(
        placed(j, NX, shape), placed(j, NR, shape), placed(j, TURN, shape), placed(j, T_NX, shape),
        placed(j, T_NR, shape), placed(j, ARM_X, shape), placed(j, ARM_R, shape),
    )  # fmt: skip


@inlined_kernel
def _already_placed(turn, shape):
    return


@inlined_kernel
def _place_bent(turn, shape):
    modes, rest = shape.modes, shape.rest
    place_all(
        turn, modes.table, modes.count, modes.size, modes.lanes, shape.places, shape.modal, shape.q, shape.v,
        rest.cone_cosine, rest.cone_sine,
    )  # fmt: skip


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
def _against_motion(tangential, at):
    return tangential


@inlined_kernel
def _against_bending(tangential, at):
    return tangential + at.vt


@inlined_kernel
def _along_shaft(along, out, at):
    return along


@inlined_kernel
def _along_normal(along, out, at):
    return at.nx * along + at.nr * out


@inlined_kernel
def _along_bent_normal(along, out, at):
    return at.nx * along + at.nr * out - at.v_normal


@inlined_kernel
def _add_to_straight(load, part, j, turn, shape):
    length, first = part.length, part.first_moment
    fn, ft = part.normal, part.tangential
    return BladeLoad(
        load.fx + length * fn, 0.0, load.ft + length * ft, load.mx + first * ft, 0.0, load.mt - first * fn
    )


@inlined_kernel
def _add_to_curved(load, part, j, turn, shape):
    return add_by_lever(load, part, lever_of(j, turn, shape))


@inlined_kernel
def _add_to_bent(load, part, j, turn, shape):
    return add_by_lever(load, part, bent_lever(j, shape))


@inlined_kernel
def add_by_lever(load, part, lever):
    """Return the BladeLoad of a curved blade plus a StationLoad with its Lever."""
    fn, ft, moment = part.length * part.normal, part.length * part.tangential, part.length * part.moment
    return BladeLoad(
        load.fx + fn * lever.nx,
        load.fr + fn * lever.nr,
        load.ft + ft,
        load.mx + lever.r * ft - lever.t_nr * fn - moment * lever.nr,
        load.mr + lever.t_nx * fn - lever.x * ft + moment * lever.nx,
        load.mt + lever.turn * fn,
    )


@inlined_kernel
def _keep_nothing(part, j, shape):
    return


@inlined_kernel
def _keep_station(part, j, shape):
    shape.loads[loaded_at(j, NORMAL)] = part.length * part.normal
    shape.loads[loaded_at(j, TANGENTIAL)] = part.length * part.tangential
    shape.loads[loaded_at(j, MOMENT)] = part.length * part.moment


# (j, blade_pitch, shape) -> rotation of the section of station j about the local blade axis by pitch, rad
effective_pitch = chosen_by_class(
    "shape", {type(None): _pitch_on_axis, BladeShape: _pitch_of_curved, BentShape: _pitch_of_bent}
)
# (turn, shape): positions of all stations of a blade that bends at a Turn, which the functions below read
place_stations = chosen_by_class(
    "shape", {type(None): _already_placed, BladeShape: _already_placed, BentShape: _place_bent}
)
# (j, turn, radius, shape) -> position of station j: OnAxis, Station or BentStation
station_at = chosen_by_class(
    "shape", {type(None): _station_on_axis, BladeShape: curved_station, BentShape: _bent_station}
)
# (part, j, shape): StationLoad of a blade that bends into its loads: normal, tangential, pitching moment
put_station = chosen_by_class(
    "shape", {type(None): _keep_nothing, BladeShape: _keep_nothing, BentShape: _keep_station}
)
# (plane, at) -> value of a Plane at the position of a station
value_at = chosen_by_class(
    "at", {OnAxis: _value_on_axis, Station: _value_at_station, BentStation: _value_at_station}
)
# (along, out, at) -> component normal to the blade axis of a vector (along, out) in x and r
normal_part = chosen_by_class(
    "at", {OnAxis: _along_shaft, Station: _along_normal, BentStation: _along_normal}
)
# the same of a relative wind, with that of bending
relative_normal_part = chosen_by_class(
    "at", {OnAxis: _along_shaft, Station: _along_normal, BentStation: _along_bent_normal}
)
# (tangential, at) -> relative wind against the motion, the same
relative_tangential_part = chosen_by_class(
    "at", {OnAxis: _against_motion, Station: _against_motion, BentStation: _against_bending}
)
# (load, part, j, turn, shape) -> BladeLoad with the StationLoad of station j added
add_station = chosen_by_class(
    "shape", {type(None): _add_to_straight, BladeShape: _add_to_curved, BentShape: _add_to_bent}
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


def line_integrals(length, columns, weights):
    """Integrate line loads (m, n + 2) along a blade; return force (m,) and moments (m, k) over columns.

    length (n + 2,): of the points of a BladeLine; columns (n + 2, k): arms, linear between the points.
    """
    steps = np.diff(length)[:, None]
    low, high = weights[:, :-1], weights[:, 1:]
    force = 0.5 * (low + high) @ steps[:, 0]
    first = (low @ (steps * (2.0 * columns[:-1] + columns[1:]))) / 6.0
    first += (high @ (steps * (columns[:-1] + 2.0 * columns[1:]))) / 6.0
    return force, first


class Bending(NamedTuple):
    """Holds shapes of bending modes along a blade (scene.beam.Shapes): of motions, and of loads."""

    here: NamedTuple  # Shapes at the points of the blade's line
    loaded: BladeLine  # points of a quadrature over the line, for loads
    weight: np.ndarray  # (k,) m, of the points
    carried: NamedTuple  # Shapes at the points, of the nodes that carry the loads


def modal_integrals(line, bending, weights):
    """Integrate line loads (m, n + 2) along a blade over modal_columns; return (m, k). bending: Bending."""
    at, columns = bending.loaded.length, modal_columns(bending.loaded, bending.carried)
    return np.array([bending.weight * np.interp(at, line.length, row) for row in weights]) @ columns


def modal_columns(line, shapes):
    """Return (n + 2, k) shapes of bending modes at the points of a BladeLine: columns of modes_of_columns.

    shapes: scene.beam.Shapes at the points.
    """
    prebend, sweep = line.points[:, 0], line.points[:, 1]
    axial = shapes.slope[:, 0] * prebend + shapes.slope[:, 1] * sweep
    shortening = shapes.S.reshape(-1, len(line.points))
    return np.vstack([shapes.U[:, 0], shapes.U[:, 1], axial, shortening]).T


def _parts_of_columns(columns, count):
    """Return (x, y, axial, shortening) of modal_columns."""
    parts = np.split(columns, [count, 2 * count, 3 * count], axis=1)
    return *parts[:3], parts[3].reshape(-1, count, count)


def build_station_modes(line, shapes, chosen, arms, shape):
    """Return the StationModes of chosen stations of a BladeLine and their BladeShape.

    arms: modal_columns where loads act.
    """
    count = len(shapes.U)
    here = _parts_of_columns(modal_columns(line, shapes)[1:-1][chosen], count)
    slopes = (shapes.slope[:, k, 1:-1][:, chosen].T for k in range(2))
    x, y, axial, shortening = here
    parts = (x, y, *slopes, axial, shortening, *_parts_of_columns(arms, count))
    parts = (np.ascontiguousarray(part, dtype=np.float64) for part in parts)
    modes = StationModes(0, (0,) * count, *parts, np.zeros(0), modal_size(len(x)))
    return modes._replace(table=constants(shape, modes))


def arms_of(modes):
    """Return the (m, k) modal_columns where the loads of StationModes act."""
    m, n = modes.load_x.shape
    return np.hstack([modes.load_x, modes.load_y, modes.load_axial, modes.load_shortening.reshape(m, n * n)])


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
