"""Models the default blade-pitch actuator: first-order, with rate and position limits (theory.md, section 3).

pitch_drive.py has the second-order drive, which a turbine file or an option may select.
"""

from math import exp
from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.drivetrain import clamp, rate_limit


class PitchActuator(NamedTuple):
    """Holds the parameters of a first-order blade-pitch actuator with rate and position limits."""

    time_constant: float  # s; 0: the command is followed at once
    rate_limit: float  # rad/s
    minimum: float  # rad
    maximum: float  # rad


def build_pitch_actuator(pitch_drive):
    """Return the PitchActuator of a descriptions.turbine.PitchDrive without inertia."""
    return PitchActuator(
        time_constant=float(pitch_drive.time_constant),
        rate_limit=float(pitch_drive.rate_limit),
        minimum=float(pitch_drive.minimum),
        maximum=float(pitch_drive.maximum),
    )


@kernel
def pitch_rate(blade_pitch, command, actuator):
    """Return the rate of the blade pitch, rad/s (theory.md Eq. (8)); 0 without lag, see followed_pitch."""
    if actuator.time_constant <= 0.0:
        return 0.0
    target = clamp(command, actuator.minimum, actuator.maximum)
    rate = (target - blade_pitch) / actuator.time_constant
    return clamp(rate, -actuator.rate_limit, actuator.rate_limit)


@kernel
def followed_pitch(blade_pitch, command, dt, actuator):
    """Return the blade pitch at the start of a step of dt, rad: an actuator without lag jumps.

    With lag: unchanged. Without: the command, within the position limits and the change that the rate
    limit allows in dt.
    """
    if actuator.time_constant > 0.0:
        return blade_pitch
    target = clamp(command, actuator.minimum, actuator.maximum)
    return rate_limit(blade_pitch, target, actuator.rate_limit * dt)


@kernel
def pitch_after(blade_pitch, command, dt, actuator):
    """Return the blade pitch after dt under a constant command: exact solution of lag and rate limit."""
    if actuator.time_constant <= 0.0:
        return blade_pitch
    lag, fastest = actuator.time_constant, actuator.rate_limit
    target = clamp(command, actuator.minimum, actuator.maximum)
    error = target - blade_pitch
    sign = 1.0 if error > 0.0 else -1.0
    size = abs(error)
    band = fastest * lag  # inside it the lag alone limits the rate
    if size > band:
        slewing = (size - band) / fastest
        if slewing >= dt:
            return blade_pitch + sign * fastest * dt
        return target - sign * band * exp(-(dt - slewing) / lag)
    return target - error * exp(-dt / lag)
