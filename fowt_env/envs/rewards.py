"""Defines the reward terms: bounded functions of measurements, weighted by the task.

reward = sum of weight * term. A new term needs a kernel, an entry in REWARD_TERMS and a line in fill_terms.
"""

import inspect
from collections.abc import Callable, Mapping
from enum import IntEnum
from math import exp, hypot, inf, isfinite, log, nan, pi
from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.checks import short
from fowt_env.errors import InputError, unknown
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.state import BLADES

AT_MARGIN = 0.1  # value of tolerance() one margin outside its bounds
STEEPNESS = -log(AT_MARGIN)
POWER_MARGIN = 0.2  # excess over rated power, fraction of rated, at which the power term is 0.1
SPEED_MARGIN = 0.2  # distance from the band, fraction of rated rotor speed, at which the speed term is 0.1
TILT_MARGIN = 5.0 * pi / 180.0  # rad, amplitude of platform pitch at which the motion term is 0.1
TOP_ACCELERATION = 3.3  # m/s2 of the tower top, the limit of the ATLAS Offshore contest (ARPA-E 2019)
TILT_PERIOD = 30.0  # s, about the platform-pitch period: converts pitch rate to amplitude


class Scales(NamedTuple):
    """Holds the turbine values that make reward terms dimensionless."""

    rated_power: float  # mechanical, at the generator, W
    rated_speed: float  # rotor, rad/s
    gear_ratio: float
    max_pitch_increment: float  # largest change of blade pitch in one control period, rad
    max_torque_increment: float  # largest change of torque in one control period, N m


class Reference(NamedTuple):
    """Holds the operating point of the episode's mean wind, in the order of the kernels' array."""

    platform_pitch: float  # rad
    rotor_speed: float  # rad/s
    shutdown: float = inf  # s, time of the stop signal
    generator_torque: float = 0.0  # N m; from here on for goals.py
    power: float = 0.0  # W
    usual_rotor_speed: float = 1.0  # goals.usual_deviations
    usual_platform_pitch: float = 1.0
    usual_pitch_travel: float = 1.0
    usual_shaft: float = 1.0
    usual_blade_root: float = 1.0


class RewardTerm(NamedTuple):
    """Holds range and meaning of a reward term, for tests and documentation."""

    low: float
    high: float
    meaning: str


REWARD_TERMS = {
    "power": RewardTerm(
        0.0, 1.0, "generator power over rated; falls above rated power, to 0.1 at 120 % of rated"
    ),
    "rotor_speed": RewardTerm(
        0.0,
        1.0,
        "1 between the rotor speed of the episode's operating point and rated (above rated wind: at rated),"
        " 0.1 at 20 % of rated outside this band",
    ),
    "platform_motion": RewardTerm(
        0.0,
        1.0,
        "1 with the platform pitch at rest at the operating point, 0.1 at an oscillation of 5 deg"
        " amplitude (from the angle and the rate over 2 pi/30 s)",
    ),
    "pitch_travel": RewardTerm(
        -1.0,
        0.0,
        "minus the blade-pitch travel over the largest that the rate limit allows; with individual pitch the"
        " mean over the blades",
    ),
    "torque_travel": RewardTerm(-1.0, 0.0, "minus the torque change over the largest within the rate limit"),
    "failure": RewardTerm(-1.0, 0.0, "-1 in the step that ends in failure, otherwise 0"),
    "power_shortfall": RewardTerm(-1.0, 0.0, "minus the missing fraction of rated power; 0 above rated"),
    "standstill": RewardTerm(-1.0, 0.0, "minus the absolute rotor speed over rated"),
    "platform_rate": RewardTerm(
        0.0,
        1.0,
        "1 with the platform pitch at rest at any angle, 0.1 at the rate of an oscillation with 5 deg"
        " amplitude and 30 s period",
    ),
    "tower_top": RewardTerm(
        -1.0, 0.0, "minus the square of the tower top's fore-aft acceleration over 3.3 m/s2"
    ),
}
TermIndex = IntEnum("TermIndex", [name.upper() for name in REWARD_TERMS], start=0)
N_TERMS = len(REWARD_TERMS)


@kernel
def tolerance(x, bounds, margin):
    """Return 1 inside bounds = (low, high); outside, a Gaussian that falls to 0.1 one margin away.

    margin 0: 0 outside. NaN gives 0. Bounds may be infinite.
    """
    if bounds[0] <= x <= bounds[1]:
        return 1.0
    if not margin > 0.0:
        return 0.0
    distance = (bounds[0] - x if x < bounds[0] else x - bounds[1]) / margin
    value = exp(-STEEPNESS * distance * distance)
    return value if isfinite(value) else 0.0


@kernel
def unit_fraction(value):
    """Return the value clipped to [0, 1]; NaN gives 1 (clamp would return NaN)."""
    return max(0.0, min(1.0, value))


@kernel
def power_term(speed, torque, scales):
    """Return the fraction of rated power, reduced above rated power."""
    power = scales.gear_ratio * speed * torque / scales.rated_power
    return unit_fraction(power) * tolerance(power, (0.0, 1.0), POWER_MARGIN)


@kernel
def power_shortfall_term(speed, torque, scales):
    """Return minus the missing fraction of rated power."""
    return unit_fraction(scales.gear_ratio * speed * torque / scales.rated_power) - 1.0


@kernel
def rotor_speed_term(speed, steady_speed, scales):
    """Return the tolerance of the rotor speed (rad/s) about the band from steady speed to rated."""
    low = min(steady_speed, scales.rated_speed) / scales.rated_speed
    return tolerance(speed / scales.rated_speed, (low, 1.0), SPEED_MARGIN)


@kernel
def platform_motion_term(platform_pitch, rate, steady_pitch):
    """Return the tolerance of the amplitude of platform pitch about its steady angle."""
    amplitude = hypot(platform_pitch - steady_pitch, rate * TILT_PERIOD / (2.0 * pi))
    return tolerance(amplitude, (0.0, 0.0), TILT_MARGIN)


@kernel
def standstill_term(speed, scales):
    """Return minus the absolute rotor speed over rated speed."""
    return 0.0 - unit_fraction(abs(speed) / scales.rated_speed)


@kernel
def tower_top_term(acceleration):
    """Return minus the square of the tower-top acceleration (m/s2) over its limit."""
    return 0.0 - unit_fraction((acceleration / TOP_ACCELERATION) ** 2)


@kernel
def travel_term(previous, after, max_increment):
    """Return minus the travel in one control period as a fraction of the largest possible travel."""
    return 0.0 - unit_fraction(abs(after - previous) / max_increment)


@kernel
def pitch_moved(previous, m):
    """Return the travel of the blade pitch, rad; with individual pitch the mean over the blades."""
    if m.shape[0] == N_MEASUREMENTS:
        return abs(m[Measure.BLADE_PITCH] - previous[Measure.BLADE_PITCH])
    total = 0.0
    for blade in range(BLADES):
        i = N_MEASUREMENTS + BladeMeasure.BLADE_PITCH_1 + blade
        total += abs(m[i] - previous[i])
    return total / BLADES


@kernel
def pitch_travel_term(previous, m, scales):
    """Return the travel_term of the blade pitch; with individual pitch the mean over the blades."""
    if m.shape[0] == N_MEASUREMENTS:
        return travel_term(previous[Measure.BLADE_PITCH], m[Measure.BLADE_PITCH], scales.max_pitch_increment)
    total = 0.0
    for blade in range(BLADES):
        i = N_MEASUREMENTS + BladeMeasure.BLADE_PITCH_1 + blade
        total += travel_term(previous[i], m[i], scales.max_pitch_increment)
    return total / BLADES


@kernel
def fill_terms(m, previous, reference, failed, scales, terms):
    """Fill terms (N_TERMS,) from the measurements m and previous, one control period apart."""
    speed = m[Measure.ROTOR_SPEED]
    torque = m[Measure.GENERATOR_TORQUE]
    terms[TermIndex.POWER] = power_term(speed, torque, scales)
    terms[TermIndex.ROTOR_SPEED] = rotor_speed_term(speed, reference[1], scales)
    terms[TermIndex.PLATFORM_MOTION] = platform_motion_term(
        m[Measure.PLATFORM_PITCH], m[Measure.PLATFORM_PITCH_RATE], reference[0]
    )
    terms[TermIndex.PITCH_TRAVEL] = pitch_travel_term(previous, m, scales)
    terms[TermIndex.TORQUE_TRAVEL] = travel_term(
        previous[Measure.GENERATOR_TORQUE], torque, scales.max_torque_increment
    )
    terms[TermIndex.FAILURE] = -1.0 if failed else 0.0
    terms[TermIndex.POWER_SHORTFALL] = power_shortfall_term(speed, torque, scales)
    terms[TermIndex.STANDSTILL] = standstill_term(speed, scales)
    terms[TermIndex.PLATFORM_RATE] = platform_motion_term(0.0, m[Measure.PLATFORM_PITCH_RATE], 0.0)
    terms[TermIndex.TOWER_TOP] = tower_top_term(m[Measure.NACELLE_ACCELERATION])


@kernel
def weighted_sum(weights, terms):
    """Return the sum of weight * term in the order of REWARD_TERMS."""
    total = 0.0
    for i in range(terms.shape[0]):
        total += weights[i] * terms[i]
    return total


def build_scales(turbine, control_dt):
    """Return the Scales of a descriptions.turbine.Turbine at a control period (s)."""
    law = turbine.torque_law
    return Scales(
        rated_power=float(law.rated_power),
        rated_speed=float(turbine.rated_rotor_speed),
        gear_ratio=float(turbine.drivetrain.gear_ratio),
        max_pitch_increment=float(turbine.pitch_drive.rate_limit * control_dt),
        max_torque_increment=float(law.max_torque_rate * control_dt),
    )


def check_weights(where, weights):
    """Return {term: float} of a mapping of weights. Raises: InputError for unknown terms, invalid numbers."""
    if not isinstance(weights, Mapping):
        raise InputError(f"{where} = {weights!r}: must be a dict of reward terms and their weights")
    checked = {}
    for name, weight in weights.items():
        if name not in REWARD_TERMS:
            raise unknown(f"reward term of {where}", name, REWARD_TERMS)
        number = isinstance(weight, int | float | np.number) and not isinstance(weight, bool)
        if not number or not isfinite(weight) or weight < 0.0:
            raise InputError(f"{where}: weight of {name} = {weight!r}: must be a finite number >= 0")
        checked[name] = float(weight)
    return checked


class OfInfo(NamedTuple):
    """Adapts a user-defined reward function (info) to (info, measurement)."""

    function: Callable

    def __call__(self, info, measurement):
        return self.function(info)


def check_own_reward(where, function):
    """Return a user-defined reward, a function (info) or (info, measurement), as (info, measurement).

    Raises: InputError for other signatures.
    """
    try:
        signature = inspect.signature(function)
    except ValueError:  # a builtin without a signature
        return function
    for arguments, result in (({}, None), function), (({},), OfInfo(function)):
        try:
            signature.bind(*arguments)
        except TypeError as error:
            reason = error
        else:
            return result
    raise InputError(f"{where} = {function!r}: must accept (info) or (info, measurement): {reason}")


def paid(function, info, measurement):
    """Return the finite number returned by a user-defined reward function. Raises: InputError otherwise."""
    value = function(info, measurement)
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = nan
    if not isfinite(number):
        at = f"{measurement.time:g} s"
        raise InputError(f"reward = {function!r}: returned {short(value)} at {at}: must be a finite number")
    return number


def weight_array(weights):
    """Return the weights (N_TERMS,) in the order of REWARD_TERMS; the default is 0."""
    return np.array([weights.get(name, 0.0) for name in REWARD_TERMS])
