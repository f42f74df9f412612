"""The controller of the OpenFAST runs that this project is validated against: the OC3-Hywind DISCON law.

Source: DISCON_OC3Hywind.f90 (old-NWTC/FAST 0badc8d0; same parameters as OpenFAST/r-test's), which
Bladed-style controllers call with the measured generator speed and blade pitch. It differs from pi.py in
four ways, each deliberate there and kept here:

- at the start the integral alone holds the blade pitch, whatever the speed error, and the torque starts on
  the curve;
- the rate limit of the blade pitch counts from the measured pitch, not from the last command;
- every call advances by its own elapsed time, of which the first has none;
- what one call commands takes effect a sample later (OpenFAST hands it over at the next step).
"""

from enum import IntEnum

import numpy as np

from fowt_env.controllers.pi import GainScheduled, Parameter, PISettings, curve_of, schedule_gain
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import clamp, generator_torque, rate_limit
from fowt_env.plant.measurement import Measure


class Memory(IntEnum):
    """Entries of the law's memory array."""

    FILTERED_SPEED = 0  # GenSpeedF, generator speed, rad/s
    INTEGRAL = 1  # IntSpdErr, rad on the high-speed shaft
    TORQUE = 2  # LastGenTrq, N m: commanded by the last call
    PITCH = 3  # PitCom, rad: commanded by the last call
    CALLS = 4  # 0 before the first call


@kernel
def discon_step(parameters, memory, measurement, command):
    """One call of the law: the last call's commands to the plant, this call's ones into memory."""
    p = parameters
    first = memory[Memory.CALLS] == 0.0
    dt = 0.0 if first else p[Parameter.CONTROL_DT]
    decay = 1.0 if first else p[Parameter.FILTER_DECAY]
    last_torque, last_pitch = memory[Memory.TORQUE], memory[Memory.PITCH]
    measured_pitch = measurement[Measure.BLADE_PITCH]
    speed = (1.0 - decay) * measurement[Measure.GENERATOR_SPEED] + decay * memory[Memory.FILTERED_SPEED]

    torque = generator_torque(speed, last_pitch, curve_of(p))
    if not first:
        step = dt * p[Parameter.TORQUE_RATE_LIMIT]
        torque = rate_limit(last_torque, torque, step)

    gain = schedule_gain(last_pitch, p[Parameter.SCHEDULE_PITCH])
    ratio = p[Parameter.GEAR_RATIO]
    slope = gain * p[Parameter.INTEGRAL] / ratio
    low, high = p[Parameter.PITCH_MINIMUM], p[Parameter.PITCH_MAXIMUM]
    error = speed - ratio * p[Parameter.RATED_SPEED]
    integral = clamp(memory[Memory.INTEGRAL] + error * dt, low / slope, high / slope)
    target = clamp(gain * p[Parameter.PROPORTIONAL] / ratio * error + slope * integral, low, high)
    step = dt * p[Parameter.PITCH_RATE_LIMIT]
    pitch = clamp(rate_limit(measured_pitch, target, step), low, high)

    memory[Memory.FILTERED_SPEED] = speed
    memory[Memory.INTEGRAL] = integral
    memory[Memory.TORQUE] = torque
    memory[Memory.PITCH] = pitch
    memory[Memory.CALLS] += 1.0
    command[0] = torque if first else last_torque
    command[1] = last_pitch


@control_kernel
def discon_law(parameters, memory, measurement, command):
    """Compiled form of discon_step, one type for all control laws."""
    discon_step(parameters, memory, measurement, command)


class Discon(GainScheduled):
    """OC3-Hywind DISCON law as OpenFAST calls it, every control_dt."""

    kernel = staticmethod(discon_law)
    inputs = ("generator_speed", "blade_pitch")

    def __init__(self, settings, control_dt, name="openfast_oc3"):
        super().__init__(settings, control_dt, name, len(Memory))

    def reset(self, measurement):
        """Start at the measured speed and blade pitch, the integral holding that pitch at no speed error."""
        p = self.parameters
        pitch = measurement.blade_pitch
        slope = schedule_gain(pitch, p[Parameter.SCHEDULE_PITCH]) * p[Parameter.INTEGRAL]
        self.memory[:] = np.array(
            [measurement.generator_speed, p[Parameter.GEAR_RATIO] * pitch / slope, 0.0, pitch, 0.0]
        )


def openfast_oc3(turbine, control_dt):
    """The OC3-Hywind controller of the OpenFAST reference runs, one-sample delay included."""
    return Discon(PISettings.published(turbine), control_dt)
