"""Sweeps over blades and stations for all rotor models except the coefficient table.

For each station the position (blade_shape.py), the relative wind and the response (station_response.py) are
evaluated, and the load is added to that of the blade. The wind of a blade has one of three forms: sampled at
every station; sheared series, linear in position times a power law; wind box, one cell lookup per station.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.bent_blade import LANES, N_SUM, BentShape, StationModes
from fowt_env.plant.aero.blade_elements import smoothstep
from fowt_env.plant.aero.blade_shape import (
    BladeLoad,
    BladeMotion,
    BladeShape,
    Plane,
    Turn,
    add_station,
    blade_motion,
    put_station,
    relative_normal_part,
    relative_tangential_part,
    station_at,
    value_at,
    with_blade,
)
from fowt_env.plant.aero.station_response import put_rates, station_load
from fowt_env.plant.aero.tower_influence import TowerInfluence, beside_tower
from fowt_env.plant.aero.wind import (
    Profile,
    WindNow,
    WindSeries,
    power_profile,
    profile_at,
    profile_spans,
    wind_at,
)
from fowt_env.plant.aero.wind_field import GridPlace, cell_wind
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.state import BLADES, N_BLADE_LOAD, NO_LOAD, Pose, State, Wrench

SLOW_ROTOR, FAST_ROTOR = 1.0, 2.0  # tip-speed ratios between which the induction fades in


class RotorLoad(NamedTuple):
    """Holds the aerodynamic load of the rotor."""

    wrench: Wrench  # about the body origin, body components; contains the torque
    thrust: float  # N, along the shaft, downwind
    torque: float  # N m, about the shaft


class HubFlow(NamedTuple):
    """Holds hub position in O, hub velocity and wind relative to the hub, both in body components."""

    X: float
    Y: float
    Z: float
    vx: float
    vy: float
    vz: float
    wx: float
    wy: float
    wz: float
    speed: float  # of the relative wind, m/s


class BladeForce(NamedTuple):
    """Holds the load summed over the stations of a blade."""

    load: BladeLoad
    outside: int  # stations outside a table: the load is valid only if 0


class RotorFlow(NamedTuple):
    """Holds wind and motion of a rotor at an instant."""

    t: float  # s
    pose: Pose  # in rotor axes
    hub: HubFlow
    now: WindNow
    series: WindSeries
    field: object  # wind_field.WindField or None
    tower: object  # tower_influence.TowerInfluence or None


class Blade(NamedTuple):
    """Holds number, motion, pitch and response model of a blade at an instant."""

    number: int  # 0, 1, ...
    motion: BladeMotion
    turn: Turn
    shape: object  # BladeShape or BentShape, or None: straight in the rotor plane
    response: object  # of station_response.py
    near: object  # RotorFlow if the tower disturbs the wind, else None


class SampledWind(NamedTuple):
    """Defines the wind of a blade by samples at the position of every station."""

    flow: RotorFlow
    motion: BladeMotion


class ShearedWind(NamedTuple):
    """Defines the wind relative to a blade in a series by Planes and factors on the Profile.

    Components in blade directions; tangential is positive against the motion, as v_tangential.
    """

    height: Plane  # over that of the profile's centre, minus 1
    along: Plane
    out: Plane
    tangential: Plane
    scaled_along: float
    scaled_out: float
    scaled_tangential: float
    profile: Profile


class BoxWind(NamedTuple):
    """Defines the wind of a blade in a wind box by the grid positions of the stations."""

    slice: Plane
    column: Plane
    row: Plane
    pose: Pose  # in rotor axes
    motion: BladeMotion
    velocity: np.ndarray  # of the WindField


NO_ROTOR_LOAD = RotorLoad(NO_LOAD, 0.0, 0.0)
NO_FORCE = BladeForce(BladeLoad(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0)
UNKNOWN_FORCE = BladeForce(BladeLoad(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1)


@kernel
def hub_flow(t, pose, now, series, field, overhang, hub_height):
    """Return the HubFlow at the rotor centre (-overhang, 0, hub_height)."""
    X = pose.x - overhang * pose.r11 + hub_height * pose.r13
    Y = pose.y - overhang * pose.r21 + hub_height * pose.r23
    Z = pose.z - overhang * pose.r31 + hub_height * pose.r33
    vx = pose.vx + pose.wy * hub_height
    vy = pose.vy - pose.wx * hub_height - pose.wz * overhang
    vz = pose.vz + pose.wy * overhang
    u, v, w = wind_at(t, X, Y, Z, now, series, field)
    wx = pose.r11 * u + pose.r21 * v + pose.r31 * w - vx
    wy = pose.r12 * u + pose.r22 * v + pose.r32 * w - vy
    wz = pose.r13 * u + pose.r23 * v + pose.r33 * w - vz
    return HubFlow(X, Y, Z, vx, vy, vz, wx, wy, wz, sqrt(wx * wx + wy * wy + wz * wz))


@inlined_kernel
def rotor_flow(t, pose, now, series, field, elements):
    """Return the RotorFlow at time t; pose in rotor axes (tilt.py), wind as in wind.wind_at."""
    hub = hub_flow(t, pose, now, series, field, elements.overhang, elements.hub_height)
    return RotorFlow(t, pose, hub, now, series, field, elements.tower)


@inlined_kernel
def _undisturbed(flow, tower):
    return None


@inlined_kernel
def _disturbed(flow, tower):
    return flow


# (flow, tower) -> the RotorFlow where the tower disturbs the wind, else None
near_tower = chosen_by_class("tower", {type(None): _undisturbed, TowerInfluence: _disturbed})


@kernel
def faded_induction(rotor_speed, wind_speed, elements):
    """Return the fraction of induction in a relative wind (m/s): 0 when parked, 1 above FAST_ROTOR."""
    return smoothstep(rotor_speed * elements.tip_radius, SLOW_ROTOR * wind_speed, FAST_ROTOR * wind_speed)


@inlined_kernel
def motion_of(number, x, elements, flow):
    """Return the BladeMotion of a blade (0, 1, ...)."""
    psi = x[State.AZIMUTH] + 2.0 * pi * number / elements.blades
    return blade_motion(psi, x[State.ROTOR_SPEED], flow.pose, flow.hub)


@kernel
def rotor_reach(tip_radius, shape):
    """Return the largest distance of a station from the rotor centre, m."""
    if shape is None:
        return tip_radius
    return shape.reach


@kernel
def is_sheared(hub, reach, field):
    """Return whether a Profile describes the wind of the whole rotor: no box, rotor clear of the sea."""
    if field is not None:
        return False
    return profile_spans(hub.Z - reach, hub.Z + reach)


# ------------------------------------------------------------------------------ wind of a blade


@inlined_kernel
def sheared_wind(flow, motion, profile):
    """Return the ShearedWind of a blade."""
    pose, hub, now, series = flow.pose, flow.hub, flow.now, flow.series
    height, left, length = hub.Z - series.reference_height, hub.Y, series.reference_length
    vertical, horizontal = now.vertical_shear, now.horizontal_shear
    one = (vertical * height + horizontal * left) / length
    x = (vertical * pose.r31 + horizontal * pose.r21) / length
    r = (vertical * motion.rz + horizontal * motion.ry) / length
    t = (vertical * motion.tz + horizontal * motion.ty) / length
    m, centre, scale = motion, profile.centre, profile.scale
    return ShearedWind(
        Plane(hub.Z / centre - 1.0, pose.r31 / centre, m.rz / centre, m.tz / centre),
        Plane(
            pose.r11 * one + pose.r31 * now.w - m.vx, pose.r11 * x, pose.r11 * r + m.wt, pose.r11 * t - m.wr
        ),
        Plane(m.rx * one + m.rz * now.w - m.vr, m.rx * x - m.wt, m.rx * r, m.rx * t + m.wx),
        Plane(m.vt - m.tx * one - m.tz * now.w, -m.tx * x - m.wr, m.wx - m.tx * r, -m.tx * t),
        scale * (pose.r11 * now.u + pose.r21 * now.v),
        scale * (m.rx * now.u + m.ry * now.v),
        -scale * (m.tx * now.u + m.ty * now.v),
        profile,
    )


@kernel
def rotor_depth(pose, reach, shape):
    """Return the largest distance of a station from the rotor centre along the mean wind, m."""
    if shape is None:
        return reach * sqrt(pose.r12 * pose.r12 + pose.r13 * pose.r13)
    return reach


@kernel
def is_boxed(flow, reach, shape, field):
    """Return whether the grid of a wind box contains the whole rotor; field None: False."""
    if field is None:
        return False
    size, hub = field.velocity.shape, flow.hub
    late = rotor_depth(flow.pose, reach, shape) * field.slowness * field.rate
    position = (flow.t + field.shift - hub.X * field.slowness) * field.rate
    if field.periodic:
        position = position % size[0]
    y, z = (hub.Y - field.low_y) * field.inverse_dy, (hub.Z - field.low_z) * field.inverse_dz
    dy, dz = reach * field.inverse_dy, reach * field.inverse_dz
    timely = late <= position < size[0] - 1.0 - late
    return timely and dy <= y < size[2] - 1.0 - dy and dz <= z < size[1] - 1.0 - dz


@inlined_kernel
def box_wind(flow, motion, field):
    """Return the BoxWind of a blade in a WindField."""
    pose, hub = flow.pose, flow.hub
    pace, slices = field.slowness * field.rate, field.velocity.shape[0]
    position = (flow.t + field.shift - hub.X * field.slowness) * field.rate
    if field.periodic:
        position = position % slices
    dy, dz = field.inverse_dy, field.inverse_dz
    return BoxWind(
        Plane(position, -pose.r11 * pace, -motion.rx * field.slowness * field.rate, -motion.tx * pace),
        Plane((hub.Y - field.low_y) * dy, pose.r21 * dy, motion.ry * dy, motion.ty * dy),
        Plane((hub.Z - field.low_z) * dz, pose.r31 * dz, motion.rz * dz, motion.tz * dz),
        pose,
        motion,
        field.velocity,
    )


@inlined_kernel
def _relative(u, v, w, at, pose, motion):
    """Return the relative wind (v_normal, v_tangential), m/s, of a station in the inertial wind (u, v, w)."""
    m = motion
    along = value_at(Plane(pose.r11 * u + pose.r21 * v + pose.r31 * w - m.vx, 0.0, m.wt, -m.wr), at)
    out = value_at(Plane(m.rx * u + m.ry * v + m.rz * w - m.vr, -m.wt, 0.0, m.wx), at)
    moving = value_at(Plane(m.vt, -m.wr, m.wx, 0.0), at)
    against = moving - (m.tx * u + m.ty * v + m.tz * w)
    return relative_normal_part(along, out, at), relative_tangential_part(against, at)


@inlined_kernel
def _sampled(wind, at):
    flow, motion = wind.flow, wind.motion
    pose, hub = flow.pose, flow.hub
    u, v, w = wind_at(
        flow.t,
        value_at(Plane(hub.X, pose.r11, motion.rx, motion.tx), at),
        value_at(Plane(hub.Y, pose.r21, motion.ry, motion.ty), at),
        value_at(Plane(hub.Z, pose.r31, motion.rz, motion.tz), at),
        flow.now,
        flow.series,
        flow.field,
    )
    return _relative(u, v, w, at, pose, motion)


@inlined_kernel
def _sheared(wind, at):
    shear = profile_at(value_at(wind.height, at), wind.profile)
    along = value_at(wind.along, at) + wind.scaled_along * shear
    out = value_at(wind.out, at) + wind.scaled_out * shear
    tangential = value_at(wind.tangential, at) + wind.scaled_tangential * shear
    return relative_normal_part(along, out, at), relative_tangential_part(tangential, at)


@inlined_kernel
def _boxed(wind, at):
    position = GridPlace(value_at(wind.slice, at), value_at(wind.row, at), value_at(wind.column, at))
    u, v, w = cell_wind(position, wind.velocity)
    return _relative(u, v, w, at, wind.pose, wind.motion)


# (wind, at) -> (v_normal, v_tangential)
relative_wind = chosen_by_class("wind", {SampledWind: _sampled, ShearedWind: _sheared, BoxWind: _boxed})


# --------------------------------------------------------------------------------- the sweep


@inlined_kernel
def _station(j, wind, blade, radius):
    """Return the StationLoad of station j of a Blade."""
    at = station_at(j, blade.turn, radius, blade.shape)
    v_normal, v_tangential = relative_wind(wind, at)
    v_normal, v_tangential = beside_tower(v_normal, v_tangential, at, blade.motion, blade.near)
    return station_load(blade.response, v_normal, v_tangential, j)


@inlined_kernel
def _with_station(force, part, j, blade):
    """Return a BladeForce plus the StationLoad of station j."""
    return BladeForce(add_station(force.load, part, j, blade.turn, blade.shape), force.outside + part.outside)


@inlined_kernel
def _put(part, j, blade):
    """Put the rates of the wake states and the load of station j into arrays, where a blade has them."""
    put_rates(part.rates, blade.response)
    put_station(part, j, blade.shape)


@inlined_kernel
def swept(wind, blade, radius):
    """Return the BladeForce of a Blade, summed over the stations.

    wind    SampledWind, ShearedWind or BoxWind
    radius  (n,) m, of the stations
    """
    force = NO_FORCE
    for j in range(radius.shape[0]):
        part = _station(j, wind, blade, radius)
        force = _with_station(force, part, j, blade)
        _put(part, j, blade)
    return force


@inlined_kernel
def swept_together(winds, blades, radius):
    """Return the BladeForce of each of three Blades.

    Evaluating a station for all three blades at a time uses the processor better than blade by blade. Terms
    common to all blades are computed once if nothing is written in between: rates are therefore written last.
    """
    a = b = c = NO_FORCE
    for j in range(radius.shape[0]):
        p = _station(j, winds[0], blades[0], radius)
        q = _station(j, winds[1], blades[1], radius)
        r = _station(j, winds[2], blades[2], radius)
        a = _with_station(a, p, j, blades[0])
        b = _with_station(b, q, j, blades[1])
        c = _with_station(c, r, j, blades[2])
        _put(p, j, blades[0])
        _put(q, j, blades[1])
        _put(r, j, blades[2])
    return a, b, c


@inlined_kernel
def sheared_winds(p, q, r, flow, reach):
    """Return the ShearedWind of each of three Blades; reach: rotor_reach."""
    profile = power_profile(flow.hub.Z - reach, flow.hub.Z + reach, flow.series)
    return (
        sheared_wind(flow, p.motion, profile),
        sheared_wind(flow, q.motion, profile),
        sheared_wind(flow, r.motion, profile),
    )


@inlined_kernel
def sheared_forces(p, q, r, flow, reach, radius):
    """Return the BladeForce of each of three Blades in a sheared wind; reach: rotor_reach."""
    return swept_together(sheared_winds(p, q, r, flow, reach), (p, q, r), radius)


@kernel
def store_blade_load(number, load, factor, pitches, blades):
    """Put factor times the BladeLoad of a blade into blades; no-op with one pitch for all blades."""
    if pitches is None:
        return
    row = blades[number]
    row[0], row[1], row[2] = factor * load.fx, factor * load.fr, factor * load.ft
    row[3], row[4], row[5] = factor * load.mx, factor * load.mr, factor * load.mt


@inlined_kernel
def _nothing_to_scale(factor, shape):
    return


@inlined_kernel
def _scale_stations(factor, shape):
    for i in range(shape.loads.shape[0]):
        shape.loads[i] *= factor


_scale_loads = chosen_by_class(
    "shape", {type(None): _nothing_to_scale, BladeShape: _nothing_to_scale, BentShape: _scale_stations}
)


@kernel
def _at_rest(number, x, shape, modes, blades):
    return shape


@inlined_kernel
def _bent_by_modes(number, x, shape, modes, blades):
    n = len(modes.count)
    q = modes.first + n * number
    v = q + BLADES * n
    row = blades[number, N_BLADE_LOAD:]
    m = row.shape[0] - n * modes.size
    k = modes.size + LANES * N_SUM
    return BentShape(shape, modes, x[q : q + n], x[v : v + n], row[:k], row[k:m], row[m:])


# (number, x, shape, modes, blades) -> shape of a blade (0, 1, ...) in a state
shape_of = chosen_by_class("modes", {type(None): _at_rest, StationModes: _bent_by_modes})


@inlined_kernel
def add_blade(total, blade, load, factor, pitches, blades):
    """Return total plus a BladeLoad, about the rotor centre; put factor times the load into blades."""
    store_blade_load(blade.number, load, factor, pitches, blades)
    _scale_loads(factor, blade.shape)
    return with_blade(total, load, blade.motion)


@kernel
def rotor_axes_load(about_centre, factor, rotor):
    """Return the RotorLoad of a Wrench about the rotor centre times a factor, in rotor axes."""
    fx, fy, fz = factor * about_centre.fx, factor * about_centre.fy, factor * about_centre.fz
    torque, height, overhang = factor * about_centre.mx, rotor.hub_height, rotor.overhang
    return RotorLoad(
        Wrench(
            fx,
            fy,
            fz,
            torque - height * fy,
            factor * about_centre.my + height * fx + overhang * fz,
            factor * about_centre.mz - overhang * fy,
        ),
        fx,
        torque,
    )


@kernel
def stations_outside(forces):
    """Return the number of stations of three BladeForces that lie outside a table."""
    return forces[0].outside + forces[1].outside + forces[2].outside


@inlined_kernel
def load_of_three(p, q, r, forces, elements, pitches, blades):
    """Return the RotorLoad of three Blades from their BladeForces over the air density."""
    density = elements.air_density
    total = add_blade(NO_LOAD, p, forces[0].load, density, pitches, blades)
    total = add_blade(total, q, forces[1].load, density, pitches, blades)
    total = add_blade(total, r, forces[2].load, density, pitches, blades)
    return rotor_axes_load(total, density, elements)
