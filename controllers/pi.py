"""Defines the baseline: torque law and gain-scheduled PI on rotor speed, Eq. (8), theory.md sections 3 and 4.

Above rated the torque (or optionally the power) is constant and blade pitch controls the rotor speed; below
rated the pitch is at its minimum and the torque follows its curve.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from math import exp, inf, isfinite

import numpy as np

from fowt_env.control import CompiledController, check_control_dt
from fowt_env.controllers.gains import gains_of_turbine, published_set, with_gains
from fowt_env.controllers.settings import NOT_NEGATIVE, POSITIVE, POSITIVE_OR_INF, Settings
from fowt_env.controllers.tuned import tuned
from fowt_env.descriptions.checks import check_number
from fowt_env.errors import unknown
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import TorqueCurve, build_torque_curve, clamp, generator_torque, rate_limit
from fowt_env.plant.measurement import Measure

SCHEDULE_ON = ("commanded", "measured")
BUMPLESS = 1e-9  # rad, largest step of the first command that counts as bumpless


class Parameter(IntEnum):
    """Enumerates the law's parameter array; the fields of TorqueCurve start at CURVE."""

    CONTROL_DT = 0  # s
    FILTER_DECAY = 1  # fraction of the filtered speed that remains after one period
    GEAR_RATIO = 2
    RATED_SPEED = 3  # w_b0, the set-point of the rotor speed, rad/s
    PROPORTIONAL = 4  # G, s
    INTEGRAL = 5  # G/tau_i
    SCHEDULE_PITCH = 6  # beta_K, rad; inf: no schedule
    SCHEDULE_MEASURED = 7  # 1: gains follow the measured blade pitch, 0: the last command
    PITCH_MINIMUM = 8  # rad
    PITCH_MAXIMUM = 9
    PITCH_RATE_LIMIT = 10  # rad/s
    TORQUE_RATE_LIMIT = 11  # N m/s
    CURVE = 12


END = Parameter.CURVE + len(TorqueCurve._fields)  # first parameter of laws that extend the PI law


class Memory(IntEnum):
    """Enumerates the entries of the law's memory array."""

    FILTERED_SPEED = 0  # generator speed, rad/s
    PITCH_COMMAND = 1  # rad
    TORQUE_COMMAND = 2  # N m
    INTEGRAL = 3  # I_e, rad


@dataclass(frozen=True)
class PISettings(Settings):
    """Holds the settings of the PI law. Raises: InputError naming the key, value and allowed range."""

    RANGES = {
        **dict.fromkeys(("KI", "rated_speed", "gear_ratio"), POSITIVE),
        **dict.fromkeys(("pitch_rate_limit", "torque_rate_limit"), POSITIVE),
        "KP": NOT_NEGATIVE,
        **dict.fromkeys(("speed_filter_corner", "gain_schedule_pitch"), POSITIVE_OR_INF),
    }

    KP: float  # on generator speed, s
    KI: float  # on generator speed, -
    rated_speed: float  # of the rotor, rad/s
    gear_ratio: float
    pitch_minimum: float  # rad
    pitch_maximum: float
    pitch_rate_limit: float  # of the command, rad/s
    torque_rate_limit: float  # N m/s
    curve: TorqueCurve
    speed_filter_corner: float = inf  # rad/s; inf: no filter
    gain_schedule_pitch: float = inf  # beta_K, rad; inf: no schedule
    schedule_on: str = "commanded"  # blade pitch that determines gain and torque region
    derived: str = ""  # gain set to be replaced by that of the platform in for_scene; "": none

    def __post_init__(self):
        super().__post_init__()
        low, high = self.pitch_minimum, self.pitch_maximum
        check_number("pitch_maximum", high, low, low_open=True, allowed=f"above pitch_minimum = {low}")
        lowest = -0.5 * self.gain_schedule_pitch  # there GK has doubled; it is singular at -beta_K
        check_number("pitch_minimum", low, lowest, allowed=f"finite and >= {lowest} rad")
        if self.schedule_on not in SCHEDULE_ON:
            raise unknown("schedule_on", self.schedule_on, SCHEDULE_ON)

    @classmethod
    def published(cls, turbine, gain_set="oc3", region3="constant_torque", scheduled=True, **changes):
        """Return settings of a descriptions.turbine.Turbine with a gain set, "oc3" ("floating") or "land".

        changes: fields of PISettings that replace the published values. Without published gains, those of
        controllers/gains.py are used, which for_scene adapts to the platform.
        """
        published, law, drive = gains_of_turbine(turbine, gain_set), turbine.torque_law, turbine.pitch_drive
        return cls(
            KP=published.KP,
            KI=published.KI,
            rated_speed=turbine.rated_rotor_speed,
            gear_ratio=turbine.drivetrain.gear_ratio,
            pitch_minimum=drive.minimum,
            pitch_maximum=drive.maximum,
            pitch_rate_limit=drive.rate_limit,
            torque_rate_limit=law.max_torque_rate,
            curve=build_torque_curve(law, region3),
            speed_filter_corner=law.speed_filter_corner,
            gain_schedule_pitch=published.gain_schedule_pitch if scheduled else inf,
            derived=gain_set if published_set(turbine, gain_set) is None else "",
        ).changed(**changes)

    def for_scene(self, scene):
        """Return settings with gains for a scene's platform, if none are published; otherwise self.

        Factors on the gains and on their schedule are preserved.
        """
        if not self.derived:
            return self
        default = gains_of_turbine(scene.turbine, self.derived)
        adapted = published_set(with_gains(scene), self.derived)
        keys = ("KP", "KI", "gain_schedule_pitch")
        changes = {key: getattr(self, key) * (getattr(adapted, key) / getattr(default, key)) for key in keys}
        return replace(self, derived="", **changes)

    def parameters(self, control_dt):
        """Return the parameter array (n,) of the law at a control period (s), in the order of Parameter."""
        values = {
            Parameter.CONTROL_DT: control_dt,
            Parameter.FILTER_DECAY: exp(-control_dt * self.speed_filter_corner),  # 0 without a filter
            Parameter.GEAR_RATIO: self.gear_ratio,
            Parameter.RATED_SPEED: self.rated_speed,
            Parameter.PROPORTIONAL: self.KP * self.gear_ratio,
            Parameter.INTEGRAL: self.KI * self.gear_ratio,
            Parameter.SCHEDULE_PITCH: self.gain_schedule_pitch,
            Parameter.SCHEDULE_MEASURED: float(self.schedule_on == "measured"),
            Parameter.PITCH_MINIMUM: self.pitch_minimum,
            Parameter.PITCH_MAXIMUM: self.pitch_maximum,
            Parameter.PITCH_RATE_LIMIT: self.pitch_rate_limit,
            Parameter.TORQUE_RATE_LIMIT: self.torque_rate_limit,
        }
        return np.array([*values.values(), *self.curve])


@kernel
def curve_at(p, i):
    """Return the TorqueCurve stored in a parameter array from entry i."""
    return TorqueCurve(
        p[i], p[i + 1], p[i + 2], p[i + 3], p[i + 4], p[i + 5],
        p[i + 6], p[i + 7], p[i + 8], p[i + 9], p[i + 10], p[i + 11],
    )  # fmt: skip


@kernel
def curve_of(parameters):
    """Return the TorqueCurve stored in the parameter array of the PI law."""
    return curve_at(parameters, Parameter.CURVE)


@kernel
def schedule_gain(blade_pitch, schedule_pitch):
    """Return GK(beta) = 1/(1 + beta/beta_K), theory.md Eq. (8); 1 for an infinite beta_K."""
    return 1.0 / (1.0 + blade_pitch / schedule_pitch)


@kernel
def schedule_pitch_of(parameters, memory, measured_pitch):
    """Return the blade pitch for gain schedule and torque region: the last command or the measurement."""
    if parameters[Parameter.SCHEDULE_MEASURED] > 0.5:
        low, high = parameters[Parameter.PITCH_MINIMUM], parameters[Parameter.PITCH_MAXIMUM]
        return clamp(measured_pitch, low, high)
    return memory[Memory.PITCH_COMMAND]


@kernel
def speed_error(parameters, memory, generator_speed):
    """Return the error e = w_f - w_b0 of the filtered rotor speed, rad/s, and advance the filter.

    The filter is a single pole with exact discretisation over the period (exponential smoothing).
    """
    decay = parameters[Parameter.FILTER_DECAY]
    speed = (1.0 - decay) * generator_speed + decay * memory[Memory.FILTERED_SPEED]
    memory[Memory.FILTERED_SPEED] = speed
    return speed / parameters[Parameter.GEAR_RATIO] - parameters[Parameter.RATED_SPEED]


@kernel
def write_commands(blade_pitch, target, extra_torque, parameters, memory, command):
    """Write the commands: torque of the curve and pitch target, within their value and rate limits.

    blade_pitch: determines the torque region; extra_torque (N m) is added to the curve.
    """
    dt = parameters[Parameter.CONTROL_DT]
    torque, pitch = memory[Memory.TORQUE_COMMAND], memory[Memory.PITCH_COMMAND]
    curve = curve_of(parameters)
    target_torque = generator_torque(memory[Memory.FILTERED_SPEED], blade_pitch, curve)
    if extra_torque != 0.0:
        target_torque = clamp(target_torque + extra_torque, 0.0, curve.maximum_torque)
    torque = rate_limit(torque, target_torque, dt * parameters[Parameter.TORQUE_RATE_LIMIT])
    target_pitch = clamp(target, parameters[Parameter.PITCH_MINIMUM], parameters[Parameter.PITCH_MAXIMUM])
    pitch = rate_limit(pitch, target_pitch, dt * parameters[Parameter.PITCH_RATE_LIMIT])
    memory[Memory.TORQUE_COMMAND] = command[0] = torque
    memory[Memory.PITCH_COMMAND] = command[1] = pitch


@kernel
def pi_target(pitch, error, parameters, memory):
    """Return the blade-pitch target of the PI law, rad, before limits, and advance the integral.

    pitch: input of the gain schedule. Anti-windup: the integral term GK (G/tau_i) I_e stays within the
    pitch limits.
    """
    gain = schedule_gain(pitch, parameters[Parameter.SCHEDULE_PITCH])
    slope = gain * parameters[Parameter.INTEGRAL]
    integral = clamp(
        memory[Memory.INTEGRAL] + error * parameters[Parameter.CONTROL_DT],
        parameters[Parameter.PITCH_MINIMUM] / slope,
        parameters[Parameter.PITCH_MAXIMUM] / slope,
    )
    memory[Memory.INTEGRAL] = integral
    return gain * parameters[Parameter.PROPORTIONAL] * error + slope * integral


@kernel
def pi_step(parameters, memory, generator_speed, measured_pitch, command):
    """Advance the sampled PI law, theory.md Eq. (8), by one period, with the torque law of section 3."""
    error = speed_error(parameters, memory, generator_speed)
    pitch = schedule_pitch_of(parameters, memory, measured_pitch)
    target = pi_target(pitch, error, parameters, memory)
    write_commands(pitch, target, 0.0, parameters, memory, command)


@control_kernel
def pi_law(parameters, memory, measurement, command):
    """Apply pi_step with the common arguments of control laws."""
    speed, pitch = measurement[Measure.GENERATOR_SPEED], measurement[Measure.BLADE_PITCH]
    pi_step(parameters, memory, speed, pitch, command)


class GainScheduled(CompiledController):
    """Implements laws with PISettings; prepare(scene) sets gains for the platform if none are published."""

    def __init__(self, settings, control_dt, name, n_memory, own=()):
        """Store settings and parameters; own: parameters of the law in addition to those of the PI law."""
        self.settings, self.law_dt = settings, check_control_dt(control_dt)
        super().__init__(name, np.append(settings.parameters(self.law_dt), own), n_memory)

    @property
    def information(self):
        """Return the inputs of the law, with "plant_model" if its gains are derived from the plant."""
        if self.settings.derived and "plant_model" not in self.inputs:
            return (*self.inputs, "plant_model")
        return self.inputs

    def prepare(self, scene):
        """Set the gains for the scene's platform if the turbine has no published gains."""
        if self.settings.derived:
            adapted = self.settings.for_scene(scene).parameters(self.law_dt)
            self.parameters[: len(adapted)] = adapted


class PI(GainScheduled):
    """Implements the PI law of theory.md Eq. (8) and the torque law, sampled every control_dt.

    bumpless, set by reset(): False if no integral within the anti-windup limits gives the measured blade
    pitch as first command; the command then departs from the measured pitch within the rate limit.
    """

    kernel = staticmethod(pi_law)
    inputs = ("generator_speed", "blade_pitch", "generator_torque")

    def __init__(self, settings, control_dt, name="pi", own_memory=0, own=()):
        super().__init__(settings, control_dt, name, len(Memory) + own_memory, own)
        self.bumpless = True

    def reset(self, measurement):
        """Initialise the law such that act() on the same measurement commands the measured blade pitch.

        The filter starts at the measured speed and the torque at the measured torque (on the curve if not
        measured); the integral balances the proportional term within the anti-windup limits. With the blade
        at a limit the integral term equals this limit, which avoids windup.
        """
        p = self.parameters
        low, high = p[Parameter.PITCH_MINIMUM], p[Parameter.PITCH_MAXIMUM]
        pitch = float(min(max(measurement.blade_pitch, low), high))
        gain = schedule_gain(pitch, p[Parameter.SCHEDULE_PITCH])
        error = measurement.generator_speed / p[Parameter.GEAR_RATIO] - p[Parameter.RATED_SPEED]
        proportional = gain * p[Parameter.PROPORTIONAL] * error
        term = pitch if pitch in (low, high) else min(max(pitch - proportional, low), high)
        first = min(max(proportional + term, low), high)
        self.bumpless = bool(abs(first - measurement.blade_pitch) <= BUMPLESS)
        # the first act() adds the present error before using the integral
        integral = term / (gain * p[Parameter.INTEGRAL]) - error * p[Parameter.CONTROL_DT]
        self.memory[Memory.INTEGRAL] = integral
        start_commands(self.memory, p, pitch, measurement)


def start_commands(memory, parameters, pitch, measurement):
    """Set the filter and the last commands in memory from a measurement."""
    speed, torque = measurement.generator_speed, measurement.generator_torque
    curve = curve_of(parameters)
    if not isfinite(torque):
        torque = generator_torque(float(speed), pitch, curve)
    memory[Memory.FILTERED_SPEED] = speed
    memory[Memory.PITCH_COMMAND] = pitch
    memory[Memory.TORQUE_COMMAND] = min(max(torque, 0.0), curve.maximum_torque)


def pi(turbine, control_dt):
    """Apply OC3 gains with their schedule, constant torque above rated: the default baseline."""
    return PI(PISettings.published(turbine), control_dt, "pi")


def pi_unscheduled(turbine, control_dt):
    """Apply OC3 gains without schedule (GK = 1 at every blade pitch), constant torque above rated."""
    return PI(PISettings.published(turbine, scheduled=False), control_dt, "pi_unscheduled")


def pi_land(turbine, control_dt):
    """Apply land-based gains with their schedule, constant torque above rated: for comparison only."""
    return PI(PISettings.published(turbine, "land"), control_dt, "pi_land")


def pi_land_power(turbine, control_dt):
    """Apply land-based gains with their schedule, constant power above rated, as published for land."""
    return PI(PISettings.published(turbine, "land", "constant_power"), control_dt, "pi_land_power")


def pi_tuned(turbine, control_dt):
    """Apply OC3 gains times factors tuned for least deviations at no more pitch travel than `pi`."""
    published = PISettings.published(turbine)
    changes = {name: getattr(published, name) * factor for name, factor in tuned("pi_tuned").items()}
    return PI(published.changed(**changes), control_dt, "pi_tuned")
