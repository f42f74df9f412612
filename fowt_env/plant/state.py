"""Defines the states of the plant, their order, and the records that loads exchange (SI, radians).

Frames (theory.md, section 1): inertial frame O at the still-water level, x downwind, y left when
looking downwind, z up; body frame P fixed in the platform, coinciding with O at rest.
"""

from enum import IntEnum
from math import cos, sin
from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel


class State(IntEnum):
    """Indexes the states in the flat (n_state,) float64 vector; further blocks begin at INTERNAL."""

    SURGE = 0  # position of the body origin in O, m
    SWAY = 1
    HEAVE = 2
    ROLL = 3  # 3-2-1 Euler angles (yaw first), rad
    PLATFORM_PITCH = 4
    YAW = 5
    AZIMUTH = 6  # rotor azimuth, rad
    VX = 7  # velocity of the body origin, body components, m/s
    VY = 8
    VZ = 9
    WX = 10  # platform angular velocity, body components, rad/s
    WY = 11
    WZ = 12
    ROTOR_SPEED = 13  # relative to the nacelle, rad/s
    BLADE_PITCH = 14  # collective or of the first blade, positive to feather, rad
    INTERNAL = 15  # first internal state, if the scene has any: see Block


N_RIGID = int(State.INTERNAL)


class Block(NamedTuple):
    """Describes a group of states: a row of the state table of a scene."""

    name: str
    offset: int  # index of the first state
    size: int
    kind: str  # "position", "velocity", or "internal": a state of a load or an actuator
    # treatment in a trim: "solved" for, "zero", "averaged" over, "settled": its rate is zero, "hanging": as
    # catenaries during the trim, then relaxed
    steady: str


RIGID_BLOCKS = (
    Block("platform_position", State.SURGE, 6, "position", "solved"),
    Block("azimuth", State.AZIMUTH, 1, "position", "averaged"),
    Block("platform_velocity", State.VX, 6, "velocity", "zero"),
    Block("rotor_speed", State.ROTOR_SPEED, 1, "velocity", "solved"),
    Block("blade_pitch", State.BLADE_PITCH, 1, "internal", "solved"),
)


FURTHER_BLOCKS = {  # (kind, steady) of blocks other than ("internal", "settled")
    "tower_deflection": ("position", "solved"),
    "tower_velocity": ("velocity", "zero"),
    "blade_deflection": ("position", "solved"),
    "blade_velocity": ("velocity", "zero"),
    "shaft_twist": ("position", "solved"),
    "shaft_twist_rate": ("velocity", "zero"),
    "other_blade_pitches": ("internal", "solved"),
    "pitch_rate": ("internal", "zero"),
    "followed_pitch": ("internal", "solved"),
    "generator_torque": ("internal", "solved"),
    "lines": ("internal", "hanging"),
}


def state_blocks(internal):
    """Return a tuple of all Blocks of a scene with these internal blocks {name: size}; size 0: omitted."""
    blocks, offset = list(RIGID_BLOCKS), N_RIGID
    for name, size in internal.items():
        if size:
            kind, steady = FURTHER_BLOCKS.get(name, ("internal", "settled"))
            blocks.append(Block(name, offset, size, kind, steady))
            offset += size
    return tuple(blocks)


MOTIONS = ("surge", "sway", "heave", "roll", "platform_pitch", "yaw")  # of the platform


class Command(IntEnum):
    """Indexes the commands in the flat (N_COMMANDS,) float64 vector.

    With individual pitch the vector has N_INDIVIDUAL_COMMANDS entries, from BLADE_PITCH on
    one for each blade.
    """

    GENERATOR_TORQUE = 0  # N m, high-speed shaft
    BLADE_PITCH = 1  # rad


N_COMMANDS = len(Command)
BLADES = 3  # of a rotor with individual pitch
N_INDIVIDUAL_COMMANDS = N_COMMANDS + BLADES - 1
N_BLADE_LOAD = 6  # entries of the load of a blade, aero.blade_shape.BladeLoad


class Wrench(NamedTuple):
    """Holds a force (N) and a moment about the body origin (N m), body components."""

    fx: float
    fy: float
    fz: float
    mx: float
    my: float
    mz: float


NO_LOAD = Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def cross(ax, ay, az, bx, by, bz):
    """Return the cross product a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def assign(values, array):
    """Copy a tuple of floats to an array; `array[:] = values` takes most of a second to compile."""
    for i in range(len(values)):
        array[i] = values[i]


@kernel
def add(a, b):
    """Return the sum of two wrenches."""
    return Wrench(a.fx + b.fx, a.fy + b.fy, a.fz + b.fz, a.mx + b.mx, a.my + b.my, a.mz + b.mz)


class Pose(NamedTuple):
    """Holds position, rotation and velocities of the platform, computed once per evaluation.

    x, y, z: body origin in O. r11..r33: rotation R, body to inertial components (Eq. 1).
    vx..vz, wx..wz: velocity and angular velocity, body components.
    """

    x: float
    y: float
    z: float
    r11: float
    r12: float
    r13: float
    r21: float
    r22: float
    r23: float
    r31: float
    r32: float
    r33: float
    vx: float
    vy: float
    vz: float
    wx: float
    wy: float
    wz: float


OUT_OF_PLANE = (State.SWAY, State.ROLL, State.YAW, State.VY, State.WX, State.WZ)


@kernel
def pose_in(x, plane):
    """Return the Pose of a state; plane not None: of a platform whose OUT_OF_PLANE states are zero."""
    if plane is None:
        return pose_of(x)
    return _pose_in_plane(x, sin(x[State.PLATFORM_PITCH]), cos(x[State.PLATFORM_PITCH]))


@kernel
def fill_sines(x, plane, sines):
    """Fill sines (6,) with sine and cosine of roll, platform pitch and yaw."""
    sines[0] = sines[4] = 0.0
    sines[1] = sines[5] = 1.0
    sines[2], sines[3] = sin(x[State.PLATFORM_PITCH]), cos(x[State.PLATFORM_PITCH])
    if plane is None:
        sines[0], sines[1] = sin(x[State.ROLL]), cos(x[State.ROLL])
        sines[4], sines[5] = sin(x[State.YAW]), cos(x[State.YAW])


@kernel
def pose_by_sines(x, sines, plane):
    """Return the Pose (pose_in) of a state from its sines and cosines (fill_sines)."""
    if plane is None:
        return _pose(x, sines[0], sines[1], sines[2], sines[3], sines[4], sines[5])
    return _pose_in_plane(x, sines[2], sines[3])


@kernel
def _pose_in_plane(x, s, c):
    """Return the Pose of a platform with planar motion by sine and cosine of its pitch."""
    vx, vz, wy = x[State.VX], x[State.VZ], x[State.WY]
    return Pose(
        x[State.SURGE], 0.0, x[State.HEAVE], c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c, vx, 0.0, vz, 0.0, wy, 0.0
    )


@kernel
def pose_of(x):
    """Return the Pose of a state vector; R = Rz(yaw) Ry(pitch) Rx(roll), theory.md Eq. (1)."""
    s1, c1 = sin(x[State.ROLL]), cos(x[State.ROLL])
    s2, c2 = sin(x[State.PLATFORM_PITCH]), cos(x[State.PLATFORM_PITCH])
    s3, c3 = sin(x[State.YAW]), cos(x[State.YAW])
    return _pose(x, s1, c1, s2, c2, s3, c3)


@kernel
def _pose(x, s1, c1, s2, c2, s3, c3):
    """Return the Pose of a state by sines and cosines of roll, platform pitch and yaw."""
    return Pose(
        x[State.SURGE],
        x[State.SWAY],
        x[State.HEAVE],
        c3 * c2,
        c3 * s2 * s1 - s3 * c1,
        c3 * s2 * c1 + s3 * s1,
        s3 * c2,
        s3 * s2 * s1 + c3 * c1,
        s3 * s2 * c1 - c3 * s1,
        -s2,
        c2 * s1,
        c2 * c1,
        x[State.VX],
        x[State.VY],
        x[State.VZ],
        x[State.WX],
        x[State.WY],
        x[State.WZ],
    )


@kernel
def to_body(pose, a, b, c):
    """Return the body components R^T (a, b, c) of an inertial vector."""
    return (
        pose.r11 * a + pose.r21 * b + pose.r31 * c,
        pose.r12 * a + pose.r22 * b + pose.r32 * c,
        pose.r13 * a + pose.r23 * b + pose.r33 * c,
    )


@kernel
def to_inertial(pose, a, b, c):
    """Return the inertial components R (a, b, c) of a body vector."""
    return (
        pose.r11 * a + pose.r12 * b + pose.r13 * c,
        pose.r21 * a + pose.r22 * b + pose.r23 * c,
        pose.r31 * a + pose.r32 * b + pose.r33 * c,
    )


STATES = (
    "surge", "sway", "heave", "roll", "platform_pitch", "yaw",
    "vx", "vy", "vz", "wx", "wy", "wz", "rotor_speed", "blade_pitch",
)  # fmt: skip
STATE_INDEX = tuple(State[name.upper()] for name in STATES)
