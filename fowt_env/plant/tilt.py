"""The tilted shaft: rotor axes, which are the body axes turned about y, and what a tilt adds elsewhere.

The shaft points downwind along s = (cos tilt, 0, -sin tilt): its upwind end is the higher one. A rotor whose
shaft lies along x has the tilt None, and then nothing is turned.
"""

from math import cos, sin
from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import Pose, Wrench


class Tilt(NamedTuple):
    """Direction of the shaft."""

    cosine: float
    sine: float


def build_tilt(angle):
    """Tilt of a shaft_tilt (rad), None for zero."""
    return None if angle == 0.0 else Tilt(cos(angle), sin(angle))


@kernel
def rotor_pose(pose, tilt):
    """The Pose in rotor axes: the same origin and motion, for a body whose x axis is the shaft."""
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
    """The wrench, given in rotor axes, in body axes."""
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
    """Component along the shaft of a vector with the body components x and z."""
    if tilt is None:
        return x
    return tilt.cosine * x - tilt.sine * z


@kernel
def in_rotor_axes(x, z, tilt):
    """(x, z) components in rotor axes of a vector with these body components."""
    if tilt is None:
        return x, z
    return tilt.cosine * x - tilt.sine * z, tilt.sine * x + tilt.cosine * z


@kernel
def across_shaft(size, tilt):
    """How far a vector of this size along the shaft points down, against the body's z axis."""
    if tilt is None:
        return 0.0
    return tilt.sine * size


def rotor_axes(x, z, angle):
    """(x, z) of a point or vector, in rotor axes, from body components; angle: shaft_tilt, rad."""
    if angle == 0.0:
        return x, z
    return cos(angle) * x - sin(angle) * z, sin(angle) * x + cos(angle) * z
