"""Defines the OC3-Hywind DISCON law of the OpenFAST reference runs of the validation.

Source: DISCON_OC3Hywind.f90 (old-NWTC/FAST 0badc8d0; same parameters as OpenFAST/r-test's), called through
the Bladed interface with the measured generator speed and blade pitch. It differs from pi.py in four ways:

- at the start the integral balances the measured blade pitch for any speed error, and the torque is on the
  curve;
- the blade-pitch rate is limited relative to the measured pitch, not to the last command;
- every call advances by the elapsed time, the first call by zero;
- a command takes effect one sample later (OpenFAST applies commands at the next step).
"""

from enum import IntEnum

from fowt_env.controllers.pi import GainScheduled, Parameter, PISettings, curve_of, schedule_gain
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.drivetrain import clamp, generator_torque, rate_limit
from fowt_env.plant.measurement import Measure


class Memory(IntEnum):
    """Enumerates the entries of the law's memory array."""

    FILTERED_SPEED = 0  # GenSpeedF, generator speed, rad/s
    INTEGRAL = 1  # IntSpdErr, rad on the high-speed shaft
    TORQUE = 2  # LastGenTrq, N m: commanded by the last call
    PITCH = 3  # PitCom, rad: commanded by the last call
    CALLS = 4  # 0 before the first call


@control_kernel
def discon_law(p, memory, measurement, command):
    """Command the result of the last call and store the result of this call in memory."""
    first = memory[Memory.CALLS] == 0.0
    dt = 0.0 if first else p[Parameter.CONTROL_DT]
    decay = 1.0 if first else p[Parameter.FILTER_DECAY]
    last_torque, last_pitch = memory[Memory.TORQUE], memory[Memory.PITCH]
    measured_pitch = measurement[Measure.BLADE_PITCH]
    speed = (1.0 - decay) * measurement[Measure.GENERATOR_SPEED] + decay * memory[Memory.FILTERED_SPEED]

    torque = generator_torque(speed, last_pitch, curve_of(p))
    if not first:
        torque = rate_limit(last_torque, torque, dt * p[Parameter.TORQUE_RATE_LIMIT])

    gain = schedule_gain(last_pitch, p[Parameter.SCHEDULE_PITCH])
    ratio = p[Parameter.GEAR_RATIO]
    slope = gain * p[Parameter.INTEGRAL] / ratio
    low, high = p[Parameter.PITCH_MINIMUM], p[Parameter.PITCH_MAXIMUM]
    error = speed - ratio * p[Parameter.RATED_SPEED]
    integral = clamp(memory[Memory.INTEGRAL] + error * dt, low / slope, high / slope)
    target = clamp(gain * p[Parameter.PROPORTIONAL] / ratio * error + slope * integral, low, high)
    pitch = clamp(rate_limit(measured_pitch, target, dt * p[Parameter.PITCH_RATE_LIMIT]), low, high)

    memory[Memory.FILTERED_SPEED] = speed
    memory[Memory.INTEGRAL] = integral
    memory[Memory.TORQUE] = torque
    memory[Memory.PITCH] = pitch
    memory[Memory.CALLS] += 1.0
    command[0] = torque if first else last_torque
    command[1] = last_pitch


class Discon(GainScheduled):
    """Implements the OC3-Hywind DISCON law as called by OpenFAST, every control_dt."""

    kernel = staticmethod(discon_law)
    inputs = ("generator_speed", "blade_pitch")

    def __init__(self, settings, control_dt, name="openfast_oc3"):
        super().__init__(settings, control_dt, name, len(Memory))

    def reset(self, measurement):
        """Start at measured speed and blade pitch, with the integral of this pitch at zero speed error."""
        p = self.parameters
        pitch = measurement.blade_pitch
        slope = schedule_gain(pitch, p[Parameter.SCHEDULE_PITCH]) * p[Parameter.INTEGRAL]
        integral = p[Parameter.GEAR_RATIO] * pitch / slope
        self.memory[:] = (measurement.generator_speed, integral, 0.0, pitch, 0.0)


def openfast_oc3(turbine, control_dt):
    """Apply the OC3-Hywind controller of the OpenFAST reference runs, with its one-sample delay."""
    return Discon(PISettings.published(turbine), control_dt)
