"""Computes bending moments of blade roots, hub and yaw bearing with individual pitch.

The moments are defined as in ElastoDyn: loads of the outer part on the inner one by aerodynamics, weight and
inertia (theory.md, 6.6). Blades are rigid, with their mass straight along the pitch axis. Kernels take pose
and rates of the nacelle-fixed frame (nacelle_pose and nacelle_rates in elastic/tower.py).
"""

from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.blade_shape import BladeLoad
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.dynamics import stored
from fowt_env.plant.elastic.blades import COS_PITCH, SIN_PITCH
from fowt_env.plant.elastic.outputs import BentRotor, bearing_moment, bent_rotor
from fowt_env.plant.elastic.structure import Structure
from fowt_env.plant.elastic.tower import kept_bend
from fowt_env.plant.measurement import N_BLADE_MEASUREMENTS, BladeMeasure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import BLADES, State, pose_by_sines
from fowt_env.plant.tilt import across_shaft, along_shaft, in_rotor_axes, rotor_pose

N_BLADE_CHANNELS = 2 + 2 * BLADES + 2 + 3  # of channels.BLADE_CHANNELS: pitches, roots, hub, yaw bearing


class BladeMasses(NamedTuple):
    """Holds masses and distances that the moments need in addition to channels.Layout."""

    hub_radius: float  # m, from the rotor centre to a blade root along the pitch axis
    first_moment: float  # kg m, of a blade about its root, along the pitch axis
    shifted_moment: float  # kg m2, integral of distance from the root times that from the rotor centre
    cm_offset: float  # m, of the rotor's centre of mass along the shaft, downwind of the rotor centre
    inertia_diameter: float  # kg m2, of the rotor about a diameter through its centre of mass
    upper_matrix: np.ndarray  # (6, 6) mass matrix of nacelle and rotor


class HubMotion(NamedTuple):
    """Holds the motion of the hub in rotor axes, which do not rotate with the rotor."""

    gx: float  # m/s2, weight per mass less the acceleration of the rotor centre
    gy: float
    gz: float
    wx: float  # rad/s, of the nacelle
    wy: float
    wz: float
    ax: float  # rad/s2
    ay: float
    az: float
    speed: float  # rad/s, of the rotor relative to the nacelle
    rate: float  # rad/s2


class RootMoments(NamedTuple):
    """Holds the bending moments of a blade root, N m."""

    in_plane: float  # by forces in the rotor plane: about the normal of the coned blade, downwind
    out_of_plane: float  # by forces along that normal: against the direction of rotation


class BladeMoments(NamedTuple):
    """Holds the bending moments of the roots of three blades, of the hub and of the yaw bearing, N m."""

    first: RootMoments
    second: RootMoments
    third: RootMoments
    hub_tilt: float  # at the rotor centre, about y and z of the rotor axes
    hub_yaw: float
    bearing_roll: float  # at the tower top, axes of the nacelle frame
    bearing_tilt: float
    bearing_yaw: float


@kernel
def hub_motion(pose, rates, speed, rate, gravity, layout):
    """Return the HubMotion of a rotor with this speed and rate; pose and rates of the nacelle frame."""
    turned = rotor_pose(pose, layout.tilt)
    vx, vz = in_rotor_axes(rates.vx, rates.vz, layout.tilt)
    ax, az = in_rotor_axes(rates.wx, rates.wz, layout.tilt)
    ay = rates.wy
    px, py, pz = layout.shaft_hub[0], layout.shaft_hub[1], layout.shaft_hub[2]
    wx, wy, wz = turned.wx, turned.wy, turned.wz
    ux = turned.vx + wy * pz - wz * py
    uy = turned.vy + wz * px - wx * pz
    uz = turned.vz + wx * py - wy * px
    return HubMotion(
        -gravity * turned.r31 - (vx + ay * pz - az * py + wy * uz - wz * uy),
        -gravity * turned.r32 - (rates.vy + az * px - ax * pz + wz * ux - wx * uz),
        -gravity * turned.r33 - (vz + ax * py - ay * px + wx * uy - wy * ux),
        wx,
        wy,
        wz,
        ax,
        ay,
        az,
        speed,
        rate,
    )


@kernel
def blade_load(blade, blades):
    """Return the BladeLoad of a blade from Data.blades."""
    row = blades[blade]
    return BladeLoad(row[0], row[1], row[2], row[3], row[4], row[5])


@kernel
def root_moments(psi, load, hub, masses, layout):
    """Return the RootMoments of the blade at the azimuth psi under a BladeLoad.

    Weight and inertia: the integral of s a x (g - acceleration) over the blade's mass, a the direction of
    the pitch axis, s the distance from the root.
    """
    c, s = layout.reach, layout.lean
    ey, ez = -sin(psi), cos(psi)
    wx, wr, wt = hub.wx + hub.speed, hub.wy * ey + hub.wz * ez, hub.wz * ey - hub.wy * ez
    ay, az = hub.ay + hub.speed * hub.wz, hub.az - hub.speed * hub.wy
    ax, ar, at = hub.ax + hub.rate, ay * ey + az * ez, az * ey - ay * ez
    along = c * wr - s * wx  # of the angular velocity, on the pitch axis (-s, c, 0)
    # less s times the component on the pitch axis, which has no moment
    turning_x = along * wx - c * at
    turning_r = along * wr - s * at
    turning_t = along * wt + c * ax + s * ar
    first, second = masses.first_moment, masses.shifted_moment
    force_x = first * hub.gx - second * turning_x
    force_r = first * (hub.gy * ey + hub.gz * ez) - second * turning_r
    force_t = first * (hub.gz * ey - hub.gy * ez) - second * turning_t
    radius = masses.hub_radius
    return RootMoments(
        force_t + c * load.mx + s * load.mr - radius * load.ft,
        c * force_x + s * force_r - load.mt - radius * (c * load.fx + s * load.fr),
    )


@kernel
def hub_moments(azimuth, hub, masses, layout, blades):
    """Return the (tilting, yawing) moment of the rotor on its shaft at the rotor centre: rotor axes y, z."""
    my = mz = 0.0
    for blade in range(BLADES):
        psi = azimuth + 2.0 * pi * blade / BLADES
        ey, ez = -sin(psi), cos(psi)
        load = blade_load(blade, blades)
        my += load.mr * ey - load.mt * ez
        mz += load.mr * ez + load.mt * ey
    offset, across = masses.cm_offset, masses.inertia_diameter
    # weight less inertia of the centre of mass, which lies on the shaft
    fy = layout.rotor_mass * (hub.gy - offset * (hub.az + hub.wx * hub.wy))
    fz = layout.rotor_mass * (hub.gz + offset * (hub.ay - hub.wx * hub.wz))
    spin = layout.rotor_inertia * (hub.wx + hub.speed)
    my -= offset * fz + across * hub.ay + hub.wz * spin - hub.wx * across * hub.wz
    mz += offset * fy - across * hub.az - hub.wx * across * hub.wy + hub.wy * spin
    return my, mz


@kernel
def bearing_moments(pose, rates, speed, rate, rotor, masses, body, layout):
    """Return the (roll, tilting, yawing) moment of nacelle and rotor on the tower top, nacelle-frame axes.

    rotor: aerodynamic Wrench on the rotor about the frame's origin; speed, rate: of the rotor.
    """
    m, a = masses.upper_matrix, rates
    c = momentum_rate(pose, speed, m, body.coupling, body.tilt)
    mass, sx, sy, sz = m[0, 0], m[1, 5], -m[0, 5], m[0, 4]
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    g, spun = body.gravity, body.coupling * rate
    fx = rotor.fx - mass * (g * nx + a.vx) - sz * a.wy + sy * a.wz - c.fx
    fy = rotor.fy - mass * (g * ny + a.vy) - sx * a.wz + sz * a.wx - c.fy
    mx = rotor.mx + g * (sz * ny - sy * nz) - along_shaft(spun, 0.0, body.tilt) - c.mx
    my = rotor.my - g * (sz * nx - sx * nz) - c.my
    mz = rotor.mz - g * (sx * ny - sy * nx) + across_shaft(spun, body.tilt) - c.mz
    mx -= m[3, 0] * a.vx + m[3, 1] * a.vy + m[3, 2] * a.vz + m[3, 3] * a.wx + m[3, 4] * a.wy + m[3, 5] * a.wz
    my -= m[4, 0] * a.vx + m[4, 1] * a.vy + m[4, 2] * a.vz + m[4, 3] * a.wx + m[4, 4] * a.wy + m[4, 5] * a.wz
    mz -= m[5, 0] * a.vx + m[5, 1] * a.vy + m[5, 2] * a.vz + m[5, 3] * a.wx + m[5, 4] * a.wy + m[5, 5] * a.wz
    height = layout.tower_top[2]
    return mx + height * fy, my - height * fx, mz


@inlined_kernel
def _of_bending(pose, rates, x, dx, rotor, model, data):
    """Return the BladeMoments of a BentRotor; pose and rates of the nacelle frame are not needed."""
    wrench, height, hub = stored(data.cache, LoadCache.ROTOR), model.layout.tower_top[2], rotor.hub
    mx, my, mz = bearing_moment(kept_bend(model.tower, data.rotor), wrench, data.rotor, height)
    return BladeMoments(
        _coned_root(rotor.first, data.rotor.turns[0]),
        _coned_root(rotor.second, data.rotor.turns[1]),
        _coned_root(rotor.third, data.rotor.turns[2]),
        hub.my, hub.mz, mx, my, mz,
    )  # fmt: skip


@inlined_kernel
def _coned_root(load, turn):
    """Return the RootMoments of a SectionLoad of the root of a blade, coned axes; turn: of its turns."""
    c, s = turn[COS_PITCH], turn[SIN_PITCH]
    return RootMoments(c * load.mx + s * load.my, c * load.my - s * load.mx)


@inlined_kernel
def _bearing_of_rigid(pose, rates, x, speed, rate, wrench, model, structure, data):
    masses = model.layout.blade_masses
    return bearing_moments(pose, rates, speed, rate, wrench, masses, model.rigid_body, model.layout)


@inlined_kernel
def _bearing_of_elastic(pose, rates, x, speed, rate, wrench, model, structure, data):
    return bearing_moment(kept_bend(model.tower, data.rotor), wrench, data.rotor, model.layout.tower_top[2])


# -> moment (3) of nacelle and rotor on the tower top, see bearing_moments
_bearing = chosen_by_class("structure", {type(None): _bearing_of_rigid, Structure: _bearing_of_elastic})


@inlined_kernel
def _of_rigid(pose, rates, x, dx, rotor, model, data):
    """Return the BladeMoments of rigid blades."""
    layout, body, loads = model.layout, model.rigid_body, data.blades
    masses = layout.blade_masses
    speed, rate = x[State.ROTOR_SPEED], dx[State.ROTOR_SPEED]
    hub = hub_motion(pose, rates, speed, rate, body.gravity, layout)
    azimuth, third = x[State.AZIMUTH], 2.0 * pi / BLADES
    tilt, yaw = hub_moments(azimuth, hub, masses, layout, loads)
    wrench = stored(data.cache, LoadCache.ROTOR)
    mx, my, mz = _bearing(pose, rates, x, speed, rate, wrench, model, model.structure, data)
    return BladeMoments(
        root_moments(azimuth, blade_load(0, loads), hub, masses, layout),
        root_moments(azimuth + third, blade_load(1, loads), hub, masses, layout),
        root_moments(azimuth + 2.0 * third, blade_load(2, loads), hub, masses, layout),
        tilt,
        yaw,
        mx,
        my,
        mz,
    )


# (pose, rates, x, dx, rotor, model, data) -> BladeMoments at a state with its last loads; pose and rates of
# the nacelle frame; rotor: BentRotor, or None
blade_moments = chosen_by_class("rotor", {type(None): _of_rigid, BentRotor: _of_bending})


@kernel
def record_blades(pose, rates, x, dx, rotor, pitches, model, data, row):
    """Fill the last entries of an output row with channels.BLADE_CHANNELS; nothing with one pitch for all.

    pose, rates: of the nacelle frame; rotor: BentRotor, or None with rigid blades.
    """
    if pitches is None:
        return
    moments = blade_moments(pose, rates, x, dx, rotor, model, data)
    out = row[row.shape[0] - N_BLADE_CHANNELS :]
    out[0], out[1] = pitch_of(1, x, pitches), pitch_of(2, x, pitches)
    out[2], out[3], out[4] = moments.first.in_plane, moments.second.in_plane, moments.third.in_plane
    out[5], out[6] = moments.first.out_of_plane, moments.second.out_of_plane
    out[7], out[8], out[9] = moments.third.out_of_plane, moments.hub_tilt, moments.hub_yaw
    out[10], out[11], out[12] = moments.bearing_roll, moments.bearing_tilt, moments.bearing_yaw


@kernel
def measure_blades(pose, rates, x, dx, pitches, model, data, m):
    """Fill the last entries of a measurement with a BladeMeasurement; nothing with one pitch for all.

    pose, rates: of the nacelle frame.
    """
    if pitches is None:
        return
    platform = pose_by_sines(x, data.cache[LoadCache.SINES :], model.rigid_body.plane)
    rotor = bent_rotor(
        platform, kept_bend(model.tower, data.rotor), x, dx, model.rigid_body, model.structure,
        model.tower, model.blades, data.blades, data.rotor,
    )  # fmt: skip
    moments = blade_moments(pose, rates, x, dx, rotor, model, data)
    out = m[m.shape[0] - N_BLADE_MEASUREMENTS :]
    out[BladeMeasure.AZIMUTH] = x[State.AZIMUTH] % (2.0 * pi)
    for blade in range(BLADES):
        out[BladeMeasure.BLADE_PITCH_1 + blade] = pitch_of(blade, x, pitches)
    out[BladeMeasure.ROOT_OUT_OF_PLANE_1] = moments.first.out_of_plane
    out[BladeMeasure.ROOT_OUT_OF_PLANE_2] = moments.second.out_of_plane
    out[BladeMeasure.ROOT_OUT_OF_PLANE_3] = moments.third.out_of_plane
    out[BladeMeasure.ROOT_IN_PLANE_1] = moments.first.in_plane
    out[BladeMeasure.ROOT_IN_PLANE_2] = moments.second.in_plane
    out[BladeMeasure.ROOT_IN_PLANE_3] = moments.third.in_plane
    out[BladeMeasure.HUB_TILT_MOMENT], out[BladeMeasure.HUB_YAW_MOMENT] = moments.hub_tilt, moments.hub_yaw
    out[BladeMeasure.YAW_BEARING_TILT_MOMENT] = moments.bearing_tilt
    out[BladeMeasure.YAW_BEARING_YAW_MOMENT] = moments.bearing_yaw
