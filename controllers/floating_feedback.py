"""Defines the PI law with feedback of the platform's fore-aft motion to blade pitch and torque.

Blade-pitch control of the rotor speed reduces thrust as the relative wind rises, which removes aerodynamic
damping of the platform pitch. Feathering while the tower top moves downwind restores this damping at the
cost of rotor-speed deviations, which the torque channel can partly compensate. The signal passes a
first-order high pass, which removes mean motion, and two equal first-order low passes, which remove most of
the wave motion. The feedback fades in over the first degree (the region-3 pitch) of the PI law's target.
"""

from dataclasses import dataclass
from enum import IntEnum
from math import exp

from fowt_env.control import check_control_dt
from fowt_env.controllers.pi import (
    END,
    PI,
    Memory,
    Parameter,
    PISettings,
    curve_of,
    pi_target,
    schedule_gain,
    schedule_pitch_of,
    speed_error,
    write_commands,
)
from fowt_env.controllers.settings import Settings
from fowt_env.controllers.tuned import tuned_for
from fowt_env.descriptions.checks import check_number
from fowt_env.errors import unknown
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import clamp
from fowt_env.plant.measurement import Measure

SIGNALS = {"nacelle_velocity": Measure.NACELLE_VELOCITY, "platform_pitch_rate": Measure.PLATFORM_PITCH_RATE}


@dataclass(frozen=True)
class FeedbackSettings(Settings):
    """Holds the feedback settings. Raises: InputError naming the key, value and allowed range."""

    RANGES = {
        "pitch_gain": {},
        "torque_gain": {},
        "high_pass": {"low": 0.0, "allowed": ">= 0 rad/s and finite; 0: none"},
    }

    signal: str = "nacelle_velocity"
    pitch_gain: float = 0.01  # rad per m/s of nacelle velocity, or per rad/s of platform pitch rate
    torque_gain: float = 0.0  # N m on the high-speed shaft per unit of the signal
    high_pass: float = 0.02  # rad/s
    low_pass: float = 0.5  # rad/s, of each of the two poles; inf: none
    scheduled: bool = False  # multiply pitch_gain by the PI law's gain schedule

    def __post_init__(self):
        if self.signal not in SIGNALS:
            raise unknown("signal", self.signal, SIGNALS)
        super().__post_init__()
        allowed = f"above high_pass = {self.high_pass} rad/s; inf: none"
        check_number("low_pass", self.low_pass, self.high_pass, low_open=True, infinite=True, allowed=allowed)


class FeedbackParameter(IntEnum):
    """Enumerates the law's parameters that follow those of the PI law."""

    SIGNAL = END  # index of the fed-back entry of the measurement
    PITCH_GAIN = SIGNAL + 1
    TORQUE_GAIN = SIGNAL + 2
    HIGH_DECAY = SIGNAL + 3  # fraction of the slow part that remains after one period
    LOW_DECAY = SIGNAL + 4  # fraction of each low pass that remains after one period
    SCHEDULED = SIGNAL + 5  # 1: pitch_gain follows the gain schedule


class FeedbackMemory(IntEnum):
    """Enumerates the law's memory entries that follow those of the PI law."""

    SLOW = len(Memory)  # component removed by the high pass, in the unit of the signal
    LOW_ONE = len(Memory) + 1
    LOW_TWO = len(Memory) + 2


@kernel
def band_passed(signal, parameters, memory):
    """Return the signal after high pass and low passes, and advance these filters by one period."""
    decay = parameters[FeedbackParameter.HIGH_DECAY]
    slow = (1.0 - decay) * signal + decay * memory[FeedbackMemory.SLOW]
    memory[FeedbackMemory.SLOW] = slow
    decay = parameters[FeedbackParameter.LOW_DECAY]
    one = (1.0 - decay) * (signal - slow) + decay * memory[FeedbackMemory.LOW_ONE]
    two = (1.0 - decay) * one + decay * memory[FeedbackMemory.LOW_TWO]
    memory[FeedbackMemory.LOW_ONE] = one
    memory[FeedbackMemory.LOW_TWO] = two
    return two


@control_kernel
def feedback_law(parameters, memory, measurement, command):
    """Advance the PI law by one period, with feedback of band-passed motion to blade pitch and torque."""
    p = parameters
    error = speed_error(p, memory, measurement[Measure.GENERATOR_SPEED])
    pitch = schedule_pitch_of(p, memory, measurement[Measure.BLADE_PITCH])
    target = pi_target(pitch, error, p, memory)
    motion = band_passed(measurement[int(p[FeedbackParameter.SIGNAL])], p, memory)
    fraction = clamp(target / curve_of(p).region3_min_pitch, 0.0, 1.0)
    gain = fraction * p[FeedbackParameter.PITCH_GAIN]
    if p[FeedbackParameter.SCHEDULED] > 0.5:
        gain *= schedule_gain(pitch, p[Parameter.SCHEDULE_PITCH])
    extra_torque = fraction * p[FeedbackParameter.TORQUE_GAIN] * motion
    write_commands(pitch, target + gain * motion, extra_torque, p, memory, command)


class FloatingFeedback(PI):
    """Implements the PI law of a PISettings with the motion feedback of a FeedbackSettings."""

    kernel = staticmethod(feedback_law)

    def __init__(self, settings, feedback, control_dt, name="floating_feedback"):
        self.feedback, dt = feedback, check_control_dt(control_dt)
        self.inputs = (*PI.inputs, feedback.signal)
        decays = exp(-dt * feedback.high_pass), exp(-dt * feedback.low_pass)
        extra = (
            SIGNALS[feedback.signal], feedback.pitch_gain, feedback.torque_gain, *decays, feedback.scheduled,
        )  # fmt: skip
        super().__init__(settings, dt, name, len(FeedbackMemory), extra)

    def reset(self, measurement):
        """Start as PI.reset, with the present motion as mean motion, so that the initial feedback is zero."""
        super().reset(measurement)
        passing = self.feedback.high_pass == 0.0
        self.memory[FeedbackMemory.SLOW] = 0.0 if passing else getattr(measurement, self.feedback.signal)
        self.memory[FeedbackMemory.LOW_ONE] = self.memory[FeedbackMemory.LOW_TWO] = 0.0


def floating_feedback(turbine, control_dt):
    """Apply OC3 gains with nacelle-velocity feedback to blade pitch, which damps platform pitch."""
    settings = FeedbackSettings(**tuned_for("floating_feedback", turbine))
    return FloatingFeedback(PISettings.published(turbine), settings, control_dt)
