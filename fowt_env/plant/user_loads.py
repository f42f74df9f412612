"""Evaluates user-defined loads in the plant: the inputs of their kernels, and the sum of their outputs.

A kernel is a first-class function of fixed signature: its address is data, so that a scene with user loads
is compiled once, for any loads, and comes from the cache of compiled kernels afterwards.
"""

from enum import IntEnum
from math import isfinite
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.load import wind_of
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.elastic.tower import add_modal, carried
from fowt_env.plant.hydro.load import surface_at_origin, water_at
from fowt_env.plant.state import State, Wrench, add, to_body, to_inertial

MOST_LOADS = 8


class Motion(IntEnum):
    """Enumerates the entries of the array `motion` that a load kernel reads (SI, radians).

    Position and rotation are in inertial axes. Velocities, wind and water are in the axes of the load:
    inertial axes, or body axes where the load was built with axes="body".
    """

    TIME = 0
    X = 1  # point of the load, inertial, m
    Y = 2
    Z = 3
    VX = 4  # velocity of the point, m/s
    VY = 5
    VZ = 6
    WX = 7  # angular velocity of the platform, rad/s
    WY = 8
    WZ = 9
    SURGE = 10  # body origin, inertial, m
    SWAY = 11
    HEAVE = 12
    ROLL = 13  # 3-2-1 Euler angles (yaw first), rad
    PLATFORM_PITCH = 14
    YAW = 15
    R11 = 16  # rotation from body to inertial axes, row by row
    R12 = 17
    R13 = 18
    R21 = 19
    R22 = 20
    R23 = 21
    R31 = 22
    R32 = 23
    R33 = 24
    ROTOR_SPEED = 25  # rad/s
    AZIMUTH = 26
    BLADE_PITCH = 27
    WIND_X = 28  # undisturbed wind at the point, m/s; zero without aerodynamics
    WIND_Y = 29
    WIND_Z = 30
    ELEVATION = 31  # surface at the inertial origin, m
    WATER_X = 32  # velocity of waves and current at the point, m/s; zero unless the load asks for water
    WATER_Y = 33
    WATER_Z = 34
    WATER_AX = 35  # acceleration of the waves at the point, m/s2
    WATER_AY = 36
    WATER_AZ = 37
    STATE = 38  # first state of the load, if any


class Force(IntEnum):
    """Enumerates the entries of the array `force` that a load kernel fills, in the axes of the load."""

    FX = 0  # N, at the point of the load
    FY = 1
    FZ = 2
    MX = 3  # N m, about the point
    MY = 4
    MZ = 5
    RATE = 6  # first rate of the states of the load, 1/s


N_MOTION = int(Motion.STATE)
N_FORCE = int(Force.RATE)


class UserLoads(NamedTuple):
    """Holds up to MOST_LOADS user loads, of which n are in use."""

    parameters: np.ndarray  # of all loads, concatenated
    first: np.ndarray  # (n + 1,) first parameter of each load, int64
    point: np.ndarray  # (n, 3) point of each load, body axes, m
    body_axes: np.ndarray  # (n,) bool: axes of velocities and of the force
    above: np.ndarray  # (n,) bool: acts above the tower base, which then carries it
    water: np.ndarray  # (n,) bool: needs the motion of the water
    first_state: np.ndarray  # (n + 1,) index in the state vector of the first state of each, int64
    most_states: int  # of one load
    kernel0: object  # first-class functions; a tuple of them makes numba warn at every use
    kernel1: object
    kernel2: object
    kernel3: object
    kernel4: object
    kernel5: object
    kernel6: object
    kernel7: object


def user_data_size(count, most_states=0):
    """Return the size of Data.user: six entries of each load, the first failed load, Motion and Force."""
    return 6 * count + 1 + N_MOTION + N_FORCE + 2 * most_states if count else 0


@inlined_kernel
def call_kernel(i, user, parameters, motion, force):
    """Call the kernel of load i, which fills force, moment and the rates of its states."""
    if i == 0:
        user.kernel0(parameters, motion, force)
    elif i == 1:
        user.kernel1(parameters, motion, force)
    elif i == 2:
        user.kernel2(parameters, motion, force)
    elif i == 3:
        user.kernel3(parameters, motion, force)
    elif i == 4:
        user.kernel4(parameters, motion, force)
    elif i == 5:
        user.kernel5(parameters, motion, force)
    elif i == 6:
        user.kernel6(parameters, motion, force)
    else:
        user.kernel7(parameters, motion, force)


@kernel
def fill_axes(pose, motion):
    """Fill motion with the rotation from the axes of a Pose to inertial axes."""
    motion[Motion.R11], motion[Motion.R12], motion[Motion.R13] = pose.r11, pose.r12, pose.r13
    motion[Motion.R21], motion[Motion.R22], motion[Motion.R23] = pose.r21, pose.r22, pose.r23
    motion[Motion.R31], motion[Motion.R32], motion[Motion.R33] = pose.r31, pose.r32, pose.r33


@kernel
def carrier(above, pose, nacelle, bend, motion):
    """Return the Pose under a load, and fill its axes: the nacelle's above the base of a flexible tower."""
    if bend is None:
        return pose
    at = nacelle if above else pose
    fill_axes(at, motion)
    return at


@kernel
def fill_common(t, pose, x, elevation, motion):
    """Fill the entries of motion that are common to all loads."""
    motion[Motion.TIME] = t
    motion[Motion.SURGE], motion[Motion.SWAY], motion[Motion.HEAVE] = pose.x, pose.y, pose.z
    motion[Motion.ROLL] = x[State.ROLL]
    motion[Motion.PLATFORM_PITCH] = x[State.PLATFORM_PITCH]
    motion[Motion.YAW] = x[State.YAW]
    fill_axes(pose, motion)
    motion[Motion.ROTOR_SPEED] = x[State.ROTOR_SPEED]
    motion[Motion.AZIMUTH] = x[State.AZIMUTH]
    motion[Motion.BLADE_PITCH] = x[State.BLADE_PITCH]
    motion[Motion.ELEVATION] = elevation


@kernel
def put(motion, start, pose, body_axes, a, b, c):
    """Store a vector with inertial components in three entries, in the axes of the load."""
    if body_axes:
        a, b, c = to_body(pose, a, b, c)
    motion[start] = a
    motion[start + 1] = b
    motion[start + 2] = c


@kernel
def fill_point(pose, px, py, pz, body_axes, motion):
    """Fill motion with position and velocity of a point (body axes), and the angular velocity."""
    a, b, c = to_inertial(pose, px, py, pz)
    motion[Motion.X], motion[Motion.Y], motion[Motion.Z] = pose.x + a, pose.y + b, pose.z + c
    u = pose.vx + pose.wy * pz - pose.wz * py
    v = pose.vy + pose.wz * px - pose.wx * pz
    w = pose.vz + pose.wx * py - pose.wy * px
    a, b, c = to_inertial(pose, u, v, w)
    put(motion, Motion.VX, pose, body_axes, a, b, c)
    a, b, c = to_inertial(pose, pose.wx, pose.wy, pose.wz)
    put(motion, Motion.WX, pose, body_axes, a, b, c)


@kernel
def fill_water(t, pose, hydro, needed, body_axes, motion):
    """Fill the motion of the water at the point, limited to the still-water level; zero if not needed."""
    u = v = w = du = dv = dw = 0.0
    if needed:
        z = min(motion[Motion.Z], 0.0)
        u, v, w, du, dv, dw = water_at(t, motion[Motion.X], motion[Motion.Y], z, hydro)
    put(motion, Motion.WATER_X, pose, body_axes, u, v, w)
    put(motion, Motion.WATER_AX, pose, body_axes, du, dv, dw)


@kernel
def body_wrench(pose, px, py, pz, body_axes, force):
    """Return the Wrench about the body origin, body axes, of a force and moment (6,) in axes of the load."""
    fx, fy, fz, mx, my, mz = force[0], force[1], force[2], force[3], force[4], force[5]
    if not body_axes:
        fx, fy, fz = to_body(pose, fx, fy, fz)
        mx, my, mz = to_body(pose, mx, my, mz)
    return Wrench(fx, fy, fz, mx + py * fz - pz * fy, my + pz * fx - px * fz, mz + px * fy - py * fx)


@kernel
def evaluate_user_loads(t, pose, nacelle, bend, x, aero, hydro, user, data, dx):
    """Fill data.user (user_data_size(n, most),): the wrench of each load, body axes about the body origin.

    Above the base of a flexible tower (bend: Bend, else None) loads act on the nacelle: their motion is that
    of the nacelle, and the wrench has the axes and the origin of the nacelle pose.

    Entry 6 n becomes the number, from 1, of the first load with an output that is not finite for finite
    input. Rates of the loads' states go into dx.
    """
    if user is None:
        return
    n, user_data = user.point.shape[0], data.user
    after = 6 * n + 1 + N_MOTION + user.most_states
    motion, force = user_data[6 * n + 1 : after], user_data[after:]
    fill_common(t, pose, x, surface_at_origin(t, hydro, data), motion)
    for i in range(n):
        px, py, pz = user.point[i, 0], user.point[i, 1], user.point[i, 2]
        axes = user.body_axes[i]
        at = carrier(user.above[i], pose, nacelle, bend, motion)
        fill_point(at, px, py, pz, axes, motion)
        u, v, w = wind_of(t, motion[Motion.X], motion[Motion.Y], motion[Motion.Z], aero)
        put(motion, Motion.WIND_X, at, axes, u, v, w)
        fill_water(t, at, hydro, user.water[i], axes, motion)
        first, states = user.first_state[i], user.first_state[i + 1] - user.first_state[i]
        for j in range(states):
            motion[Motion.STATE + j] = x[first + j]
        for j in range(force.shape[0]):
            force[j] = 0.0
        call_kernel(i, user, user.parameters[user.first[i] : user.first[i + 1]], motion, force)
        outputs = inputs = 0.0
        for j in range(N_FORCE + states):
            outputs += force[j]
        for j in range(N_MOTION + states):
            inputs += motion[j]
        if user_data[6 * n] == 0.0 and not isfinite(outputs) and isfinite(inputs):
            user_data[6 * n] = i + 1.0
        for j in range(states):
            dx[first + j] = force[Force.RATE + j]
        load = body_wrench(at, px, py, pz, axes, force)
        k = 6 * i
        user_data[k], user_data[k + 1], user_data[k + 2] = load.fx, load.fy, load.fz
        user_data[k + 3], user_data[k + 4], user_data[k + 5] = load.mx, load.my, load.mz


@kernel
def user_wrench(i, user_data):
    """Return the Wrench of load i from data.user, as stored by evaluate_user_loads."""
    k = 6 * i
    return Wrench(
        user_data[k], user_data[k + 1], user_data[k + 2],
        user_data[k + 3], user_data[k + 4], user_data[k + 5],
    )  # fmt: skip


@kernel
def borne_wrench(i, bend, user, data):
    """Return the Wrench of load i about the body origin, body axes, on nacelle or platform."""
    if bend is None:
        return user_wrench(i, data.user)
    load = user_wrench(i, data.user)
    return carried(load, bend) if user.above[i] else load


@kernel
def add_user_loads(load, above, bend, user, data):
    """Return the load plus the user loads above the tower base (above True), or the other user loads."""
    if user is None:
        return load
    for i in range(user.point.shape[0]):
        if user.above[i] == above:
            load = add(load, borne_wrench(i, bend, user, data))
    return load


@kernel
def add_modal_user_loads(bend, tower, user, data, modal):
    """Add to modal (n,) the generalised forces of the user loads on the nacelle."""
    if user is None:
        return
    for i in range(user.point.shape[0]):
        if user.above[i]:
            add_modal(user_wrench(i, data.user), bend, tower, data.rotor, modal)


@kernel
def record_user_loads(pose, bend, user, data, row):
    """Fill six channels of each user load: force and moment about the body origin, inertial axes."""
    if user is None:
        return
    for i in range(user.point.shape[0]):
        load = borne_wrench(i, bend, user, data)
        row[6 * i], row[6 * i + 1], row[6 * i + 2] = to_inertial(pose, load.fx, load.fy, load.fz)
        row[6 * i + 3], row[6 * i + 4], row[6 * i + 5] = to_inertial(pose, load.mx, load.my, load.mz)


@kernel
def user_channels(user):
    """Return the number of output channels of the user loads."""
    if user is None:
        return 0
    return 6 * user.point.shape[0]
