"""DEMONSTRATION ONLY: defines Eq. (8) of the source paper as printed, whose gain grows with time.

The printed law has t (w_b - w_b0) instead of the integral of the speed error (theory.md, section 4). The
result is a proportional controller with the gain G (1 + t/tau_i): its speed offset decays as 1/t, it depends
on the choice of t = 0 and becomes unstable.
"""

from enum import IntEnum

from fowt_env.controllers.pi import (
    GainScheduled,
    Memory,
    Parameter,
    PISettings,
    schedule_gain,
    schedule_pitch_of,
    speed_error,
    start_commands,
    write_commands,
)
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.measurement import Measure


class LiteralMemory(IntEnum):
    """Enumerates the law's memory entries that follow those of the PI law (Memory, before INTEGRAL)."""

    START_TIME = Memory.INTEGRAL  # s
    START_PITCH = Memory.INTEGRAL + 1  # rad


@kernel
def literal_gain(time, parameters):
    """Return the gain G (1 + t/tau_i) of the printed law, rad per rad/s of rotor speed, without schedule."""
    return parameters[Parameter.PROPORTIONAL] + parameters[Parameter.INTEGRAL] * time


@control_kernel
def literal_law(parameters, memory, measurement, command):
    """Advance the printed law by one period with filter, schedule, limits and torque of the PI law."""
    error = speed_error(parameters, memory, measurement[Measure.GENERATOR_SPEED])
    pitch = schedule_pitch_of(parameters, memory, measurement[Measure.BLADE_PITCH])
    time = measurement[Measure.TIME] - memory[LiteralMemory.START_TIME]
    gain = schedule_gain(pitch, parameters[Parameter.SCHEDULE_PITCH]) * literal_gain(time, parameters)
    write_commands(pitch, memory[LiteralMemory.START_PITCH] + gain * error, 0.0, parameters, memory, command)


class Eq8Literal(GainScheduled):
    """Demonstrates the printed Eq. (8) with t = 0 at reset and the measured blade pitch at zero error.

    Without this pitch offset the printed law would have no operating point above rated.
    """

    kernel = staticmethod(literal_law)
    inputs = ("time", "generator_speed", "blade_pitch", "generator_torque")

    def __init__(self, settings, control_dt, name="eq8_literal"):
        super().__init__(settings, control_dt, name, LiteralMemory.START_PITCH + 1)

    def reset(self, measurement):
        """Set t = 0 of the printed law and start from the measured speed, blade pitch and torque."""
        p = self.parameters
        low, high = p[Parameter.PITCH_MINIMUM], p[Parameter.PITCH_MAXIMUM]
        pitch = float(min(max(measurement.blade_pitch, low), high))
        start_commands(self.memory, p, pitch, measurement)
        self.memory[LiteralMemory.START_TIME] = measurement.time
        self.memory[LiteralMemory.START_PITCH] = pitch


def eq8_literal(turbine, control_dt):
    """DEMONSTRATION ONLY: apply Eq. (8) as printed, with OC3 gains; its gain grows with time."""
    return Eq8Literal(PISettings.published(turbine), control_dt)
