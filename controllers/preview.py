"""Defines the PI law with feedforward of the previewed wind.

The steady schedule beta_ss(V) determines the pitch change d beta = (d beta_ss/dV) dV. The law increases its
integral by dI = d beta (1 + 2 beta/beta_K)/KI, theory.md (A7), so that anti-windup, schedule and limits are
those of the PI law and the integral corrects errors of beta_ss. The wind is the rotor-averaged preview at
`preview_time`. Two equal first-order low passes, whose delay with that of the blade-pitch actuator and half a
control period equals the preview time, smooth the gusts.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from math import exp

import numpy as np

from fowt_env.analysis.trim import trim, without_fluctuations
from fowt_env.control import wind_ahead
from fowt_env.controllers.pi import (
    END,
    PI,
    Memory,
    Parameter,
    PISettings,
    pi_target,
    schedule_pitch_of,
    speed_error,
    write_commands,
)
from fowt_env.controllers.settings import Settings
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.plant.state import State

SCHEDULE_SPEEDS = 15  # trims from rated to cut-out wind, square-root spaced: the schedule is steep at rated
BELOW_RATED = 0.5  # m/s, start of the schedule below the published rated wind


@dataclass(frozen=True)
class PreviewSettings(Settings):
    """Defines the use of the preview. Raises: InputError naming the key, value and allowed range."""

    RANGES = {"preview_time": {"low": 0.5, "high": 60.0}, "gain": {"low": 0.0, "high": 2.0}}

    preview_time: float = 3.0  # s, look-ahead time of the wind
    gain: float = 1.0  # fraction of the steady schedule that is fed forward


class PreviewParameter(IntEnum):
    """Enumerates the law's parameters that follow those of the PI law."""

    GAIN = END
    DECAY = GAIN + 1  # fraction of each low pass that remains after one period
    WIND = GAIN + 2  # SCHEDULE_SPEEDS winds of the steady schedule, m/s
    PITCH = WIND + SCHEDULE_SPEEDS  # blade pitch of the schedule at these winds, rad


class PreviewMemory(IntEnum):
    """Enumerates the law's memory entries that follow those of the PI law."""

    LOW_ONE = len(Memory)  # blade pitch of the schedule for the wind ahead after one low pass, rad
    LOW_TWO = len(Memory) + 1  # the same after both low passes


@kernel
def scheduled_pitch(wind, parameters):
    """Return GAIN times the steady blade pitch (rad) at a wind (m/s), constant outside the schedule."""
    first, last = PreviewParameter.WIND, PreviewParameter.PITCH - 1
    gain, pitch = parameters[PreviewParameter.GAIN], PreviewParameter.PITCH - PreviewParameter.WIND
    if wind <= parameters[first]:
        return gain * parameters[first + pitch]
    if wind >= parameters[last]:
        return gain * parameters[last + pitch]
    i = first
    while parameters[i + 1] <= wind:
        i += 1
    fraction = (wind - parameters[i]) / (parameters[i + 1] - parameters[i])
    return gain * ((1.0 - fraction) * parameters[i + pitch] + fraction * parameters[i + 1 + pitch])


@kernel
def foreseen_change(wind, parameters, memory):
    """Return the change (rad) of the filtered blade pitch for the wind ahead; advance the filter."""
    decay = parameters[PreviewParameter.DECAY]
    one = (1.0 - decay) * scheduled_pitch(wind, parameters) + decay * memory[PreviewMemory.LOW_ONE]
    two = (1.0 - decay) * one + decay * memory[PreviewMemory.LOW_TWO]
    change = two - memory[PreviewMemory.LOW_TWO]
    memory[PreviewMemory.LOW_ONE] = one
    memory[PreviewMemory.LOW_TWO] = two
    return change


@control_kernel
def preview_law(parameters, memory, measurement, command):
    """Add the feedforward of the wind's change to the integral and advance the PI law by one period."""
    p = parameters
    change = foreseen_change(measurement[N_MEASUREMENTS], p, memory)
    error = speed_error(p, memory, measurement[Measure.GENERATOR_SPEED])
    pitch = schedule_pitch_of(p, memory, measurement[Measure.BLADE_PITCH])
    slope = (1.0 + 2.0 * pitch / p[Parameter.SCHEDULE_PITCH]) / p[Parameter.INTEGRAL]  # dI/d beta
    memory[Memory.INTEGRAL] += slope * change
    write_commands(pitch, pi_target(pitch, error, p, memory), 0.0, p, memory, command)


class Preview(PI):
    """Implements the PI law with wind feedforward of a PreviewSettings; call prepare(scene) before reset."""

    kernel = staticmethod(preview_law)
    inputs = (*PI.inputs, "wind_preview", "plant_model")

    def __init__(self, settings, preview, control_dt, name="preview"):
        super().__init__(settings, control_dt, name, len(PreviewMemory), np.zeros(2 + 2 * SCHEDULE_SPEEDS))
        self.preview = preview
        self.preview_times = (float(preview.preview_time),)
        self.prepared = False

    def prepare(self, scene):
        """Compute the steady blade pitch of the scene's plant over wind speed.

        Raises: InputError for a scene without wind, and if the preview is shorter than the actuator lag.
        """
        if scene.model.aero is None:
            raise InputError(f"controller {self.name!r}: needs a scene with wind to look ahead")
        super().prepare(scene)
        step = self.law_dt
        delay = self.preview.preview_time - scene.turbine.pitch_drive.lag - 0.5 * step
        if delay <= 0.0:
            raise InputError(
                f"preview_time = {self.preview.preview_time} s: must exceed the actuator's lag and half a"
                f" control period, {self.preview.preview_time - delay:g} s"
            )
        p = self.parameters
        p[PreviewParameter.GAIN] = self.preview.gain
        p[PreviewParameter.DECAY] = exp(-2.0 * step / delay)
        p[PreviewParameter.WIND : PreviewParameter.PITCH], p[PreviewParameter.PITCH :] = steady_pitch(scene)
        self.prepared = True

    def reset(self, measurement):
        """Start as PI.reset, the filter steady at the wind ahead. Raises: InputError without prepare()."""
        if not self.prepared:
            raise InputError(f"controller {self.name!r}: call prepare(scene) before reset(measurement)")
        super().reset(measurement)
        ahead = wind_ahead(measurement)
        if len(ahead) != 1:
            raise InputError(
                f"controller {self.name!r}: the measurement has {len(ahead)} winds ahead: must be 1, at"
                f" {self.preview_times[0]:g} s"
            )
        start = scheduled_pitch(ahead[0], self.parameters)
        self.memory[PreviewMemory.LOW_ONE] = self.memory[PreviewMemory.LOW_TWO] = start


def steady_pitch(scene):
    """Return (wind m/s, pitch rad) of the steady schedule, platform fixed, from below rated to cut-out."""
    turbine = scene.turbine
    low, high = turbine.rated_wind_speed - BELOW_RATED, turbine.cut_out_wind_speed
    speeds = low + (high - low) * np.linspace(0.0, 1.0, SCHEDULE_SPEEDS) ** 2
    scenes = (replace(without_fluctuations(scene, speed), wind_speed=speed) for speed in speeds)
    steady = (trim(scene, platform="fixed") for scene in scenes)
    return speeds, np.array([point.state[State.BLADE_PITCH] for point in steady])


def preview(turbine, control_dt):
    """Apply OC3 gains with feedforward of the rotor-averaged wind 3 s ahead."""
    return Preview(PISettings.published(turbine), PreviewSettings(), control_dt)
