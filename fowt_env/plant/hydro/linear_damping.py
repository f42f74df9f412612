"""Applies the additional linear damping and yaw spring of the platform definition, theory.md 5.6."""

from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import NO_LOAD, State, Wrench


class LinearDamping(NamedTuple):
    """Holds linear damping on the platform velocity (body axes), and the yaw spring of delta lines."""

    surge: float  # N s/m
    sway: float
    heave: float
    roll: float  # N m s/rad
    platform_pitch: float
    yaw: float
    yaw_stiffness: float  # N m/rad


def build_damping(hydro):
    """Return the LinearDamping of a descriptions.platform.HydroCoefficients; None if all are zero."""
    values = (*hydro.linear_damping, hydro.yaw_stiffness)
    if not any(values):
        return None
    return LinearDamping(*(float(v) for v in values))


@kernel
def damping_load(pose, x, damping):
    """Return the damping load -diag(B) (v, w) with the yaw-spring moment, body components."""
    if damping is None:
        return NO_LOAD
    return Wrench(
        -damping.surge * pose.vx,
        -damping.sway * pose.vy,
        -damping.heave * pose.vz,
        -damping.roll * pose.wx,
        -damping.platform_pitch * pose.wy,
        -damping.yaw * pose.wz - damping.yaw_stiffness * x[State.YAW],
    )
