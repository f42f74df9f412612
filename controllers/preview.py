"""PI law with feedforward of the wind that is still on its way, as a lidar on the nacelle would see it.

The steady schedule beta_ss(V) says how far the blades have to turn for a change of wind: d beta = (d
beta_ss/dV) dV. The law adds to its integral what moves its own pitch by these increments, so anti-windup,
schedule and limits stay those of the PI law, and whatever beta_ss gets wrong the integral takes back. The
gain schedule multiplies the integral and falls as the blades turn: at rest beta = GK(beta) KI I, so
dI = d beta (1 + 2 beta/beta_K)/KI, theory.md (A7). The wind is the
rotor-averaged one, `preview_time` ahead of the rotor and without measuring error: an upper bound of what a
lidar can give. Two equal first-order low passes whose delay, with that of the blade-pitch actuator and half
a control period, adds up to the preview time, keep the blades from following every gust.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from math import exp

import numpy as np

from fowt_env.analysis.trim import trim, without_fluctuations
from fowt_env.control import check_control_dt
from fowt_env.controllers.pi import (
    PI,
    Memory,
    Parameter,
    PISettings,
    pi_target,
    schedule_pitch_of,
    speed_error,
    write_commands,
)
from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import TorqueCurve
from fowt_env.plant.measurement import Measure
from fowt_env.plant.state import State
from fowt_env.weather.preview import rotor_wind_series

SCHEDULE_SPEEDS = 15  # trims from rated to cut-out wind, square-root spaced: the schedule is steep at rated
BELOW_RATED = 0.5  # m/s below the published rated wind that the schedule starts


@dataclass(frozen=True)
class PreviewSettings:
    """How the preview is used. Raises: InputError naming the key, value and allowed range."""

    preview_time: float = 3.0  # s that the wind is known ahead
    gain: float = 1.0  # fraction of the steady schedule that is fed forward

    def __post_init__(self):
        check_number("preview_time", self.preview_time, 0.5, 60.0)
        check_number("gain", self.gain, 0.0, 2.0)


class PreviewParameter(IntEnum):
    """Entries of the law's parameter array beyond those of the PI law; the foreseen pitch follows SERIES."""

    STEP = Parameter.CURVE + len(TorqueCurve._fields)  # s between entries of the series
    LAST = STEP + 1  # index of its last entry
    SERIES = STEP + 2


class PreviewMemory(IntEnum):
    """Entries of the law's memory array beyond those it shares with the PI law."""

    FORESEEN = len(Memory)  # blade pitch of the schedule at the last call, rad


@kernel
def foreseen_pitch(time, parameters):
    """Filtered blade pitch of the steady schedule for the wind foreseen at a time (s), rad; ends are held."""
    last = int(parameters[PreviewParameter.LAST])
    place = max(time / parameters[PreviewParameter.STEP], 0.0)
    if place >= last:
        return parameters[PreviewParameter.SERIES + last]
    i = int(place)
    fraction = place - i
    first = PreviewParameter.SERIES + i
    return (1.0 - fraction) * parameters[first] + fraction * parameters[first + 1]


@control_kernel
def preview_law(parameters, memory, measurement, command):
    """One period: what the wind's change asks for goes into the integral, then the PI law."""
    p = parameters
    foreseen = foreseen_pitch(measurement[Measure.TIME], p)
    error = speed_error(p, memory, measurement[Measure.GENERATOR_SPEED])
    pitch = schedule_pitch_of(p, memory, measurement[Measure.BLADE_PITCH])
    slope = (1.0 + 2.0 * pitch / p[Parameter.SCHEDULE_PITCH]) / p[Parameter.INTEGRAL]  # dI/d beta
    memory[Memory.INTEGRAL] += slope * (foreseen - memory[PreviewMemory.FORESEEN])
    memory[PreviewMemory.FORESEEN] = foreseen
    write_commands(pitch, pi_target(pitch, error, p, memory), 0.0, p, memory, command)


class Preview(PI):
    """PI of a PISettings with the feedforward of a PreviewSettings; needs prepare(scene) before reset."""

    kernel = staticmethod(preview_law)
    information = (*PI.information, "time", "wind_preview", "plant_model")

    def __init__(self, settings, preview, control_dt, name="preview"):
        super().__init__(settings, control_dt, name)
        self.preview = preview
        self.control_dt = check_control_dt(control_dt)
        self.memory = np.zeros(len(Memory) + len(PreviewMemory))
        self.prepared = False

    def prepare(self, scene):
        """Look up the steady pitch of the coming wind, filter it, and keep it as a series.

        Raises: InputError for a scene without wind.
        """
        if scene.model.aero is None:
            raise InputError(f"controller {self.name!r}: needs a scene with wind to look ahead")
        time, speed, period = rotor_wind_series(scene)
        step = self.control_dt
        grid = step * np.arange(int(np.ceil(max(time[-1], scene.options["duration"]) / step)) + 1)
        seen = np.interp(grid + self.preview.preview_time, time, speed, period=period)
        pitch = self.preview.gain * np.interp(seen, *steady_pitch(scene))
        delay = self.preview.preview_time - scene.turbine.pitch_drive.time_constant - 0.5 * step
        if delay <= 0.0:
            raise InputError(
                f"preview_time = {self.preview.preview_time} s: must exceed the actuator's lag and half a"
                f" control period, {self.preview.preview_time - delay:g} s"
            )
        pitch = twice_low_passed(pitch, exp(-2.0 * step / delay))
        head = self.parameters[: PreviewParameter.STEP]
        self.parameters = np.concatenate([head, [step, len(pitch) - 1.0], pitch])
        self.prepared = True

    def reset(self, measurement):
        """Start as PI.reset, nothing foreseen yet. Raises: InputError where prepare() was not called."""
        if not self.prepared:
            raise InputError(f"controller {self.name!r}: call prepare(scene) before reset(measurement)")
        super().reset(measurement)
        self.memory[PreviewMemory.FORESEEN] = foreseen_pitch(float(measurement.time), self.parameters)


def steady_pitch(scene):
    """(wind m/s, blade pitch rad) of the steady schedule, platform fixed, from below rated to cut-out."""
    turbine = scene.turbine
    low, high = turbine.rated_wind_speed - BELOW_RATED, turbine.cut_out_wind_speed
    speeds = low + (high - low) * np.linspace(0.0, 1.0, SCHEDULE_SPEEDS) ** 2
    scenes = (replace(without_fluctuations(scene, speed), wind_speed=speed) for speed in speeds)
    steady = (trim(scene, platform="fixed") for scene in scenes)
    return speeds, np.array([point.state[State.BLADE_PITCH] for point in steady])


def twice_low_passed(value, decay):
    """(n,) the series after two first-order low passes that start settled at its first entry."""
    from scipy.signal import lfilter  # takes a third of a second to load, at every start otherwise

    for _ in range(2):
        value, _ = lfilter([1.0 - decay], [1.0, -decay], value, zi=[decay * value[0]])
    return value


def preview(turbine, control_dt):
    """OC3 gains with feedforward of the rotor-averaged wind 3 s ahead, known without error."""
    return Preview(PISettings.published(turbine), PreviewSettings(), control_dt)
