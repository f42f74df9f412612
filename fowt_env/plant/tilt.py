"""Transforms between body axes and rotor axes: the body axes rotated about y by the shaft tilt.

The shaft points downwind along s = (cos tilt, 0, -sin tilt): its upwind end is the higher one. A rotor whose
shaft lies along x has the tilt None, without any rotation.
"""

from math import cos, sin
from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import Pose, Wrench


class Tilt(NamedTuple):
    """Holds the direction of a tilted shaft."""

    cosine: float
    sine: float


def build_tilt(angle):
    """Return the Tilt of a shaft_tilt (rad), None for zero."""
    return None if angle == 0.0 else Tilt(cos(angle), sin(angle))


@kernel
def rotor_pose(pose, tilt):
    """Return the Pose in rotor axes, whose x axis is the shaft: same origin and motion."""
    if tilt is None:
        return pose
    c, s = tilt.cosine, tilt.sine
    return Pose(
        pose.x,
        pose.y,
        pose.z,
        c * pose.r11 - s * pose.r13,
        pose.r12,
        s * pose.r11 + c * pose.r13,
        c * pose.r21 - s * pose.r23,
        pose.r22,
        s * pose.r21 + c * pose.r23,
        c * pose.r31 - s * pose.r33,
        pose.r32,
        s * pose.r31 + c * pose.r33,
        c * pose.vx - s * pose.vz,
        pose.vy,
        s * pose.vx + c * pose.vz,
        c * pose.wx - s * pose.wz,
        pose.wy,
        s * pose.wx + c * pose.wz,
    )


@kernel
def to_body_axes(wrench, tilt):
    """Return a wrench in rotor axes transformed to body axes."""
    if tilt is None:
        return wrench
    c, s = tilt.cosine, tilt.sine
    return Wrench(
        c * wrench.fx + s * wrench.fz,
        wrench.fy,
        c * wrench.fz - s * wrench.fx,
        c * wrench.mx + s * wrench.mz,
        wrench.my,
        c * wrench.mz - s * wrench.mx,
    )


@kernel
def along_shaft(x, z, tilt):
    """Return the component along the shaft of a vector with the body components x and z."""
    if tilt is None:
        return x
    return tilt.cosine * x - tilt.sine * z


@kernel
def in_rotor_axes(x, z, tilt):
    """Return the (x, z) components in rotor axes of a vector with these body components."""
    if tilt is None:
        return x, z
    return tilt.cosine * x - tilt.sine * z, tilt.sine * x + tilt.cosine * z


@kernel
def across_shaft(size, tilt):
    """Return the downward component, against the body's z axis, of a vector of this size along the shaft."""
    if tilt is None:
        return 0.0
    return tilt.sine * size


def rotor_axes(x, z, angle):
    """Return (x, z) of a point or vector in rotor axes, from body components; angle: shaft_tilt, rad."""
    if angle == 0.0:
        return x, z
    return cos(angle) * x - sin(angle) * z, sin(angle) * x + cos(angle) * z
