"""Holds, smooths and limits the decisions of an agent, and builds features from a short history.

Two options keep the additions of any agent (residual mode) from shifting the baseline's operating point.
washout: a high-pass filter, which bounds the sum of the additions and removes a constant decision.
authority: the decisions are weighted by the recent standard deviation of the estimated wind, with weight 0
below a threshold, so that the baseline alone controls the operating point in steady wind.

Environments and the exported policy use the same kernels, so that an agent is scored with the decisions and
features of its training.
"""

from dataclasses import dataclass
from math import exp, inf, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.checks import check_number, check_whole_number, is_number
from fowt_env.envs.actions import ADDING
from fowt_env.envs.observations import N_ACTIONS
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.drivetrain import clamp

WIND_CHANNEL = "estimated_wind"  # its standard deviation determines authority


@dataclass(frozen=True)
class DecisionSettings:
    """Holds the settings of decisions. Raises: InputError naming the key, value and allowed range."""

    hold: int = 5  # control periods from one decision to the next
    smoothing: float = 0.5  # s, time constant of the low pass from decision to action; 0: none
    history: int = 8  # number of earlier decision instants among the inputs
    washout: float = 0.0  # s, time constant of the high pass of additions to a baseline; 0: none
    # m/s, standard deviations of the estimated wind below which decisions have weight 0 and above which
    # weight 1; None: always 1
    authority: tuple | None = None
    authority_time: float = 60.0  # s, averaging time of this standard deviation

    def __post_init__(self):
        for key, low, high in (("hold", 1, 100), ("history", 0, 200)):
            number = check_whole_number(f"decisions.{key}", getattr(self, key), low, high)
            object.__setattr__(self, key, number)
        for key, low, high in (("smoothing", 0.0, 60.0), ("washout", 0.0, 1e4), ("authority_time", 1.0, 1e4)):
            allowed = f"in [{low:g}, {high:g}] s"
            check_number(f"decisions.{key}", getattr(self, key), low, high, allowed=allowed)
        value = self.authority
        if value is None:
            return
        pair = isinstance(value, tuple | list) and len(value) == 2 and all(map(is_number, value))
        if not pair or not 0.0 <= value[0] < value[1] <= 100.0:
            raise InputError(
                f"decisions.authority = {value!r}: must be a pair (low, high) with 0 <= low < high <= 100 m/s"
            )
        object.__setattr__(self, "authority", (float(value[0]), float(value[1])))


def wind_entry(settings, mode, observed):
    """Return (index, m/s per unit, centre m/s) of the estimated wind in Entries, None if not needed.

    Raises: InputError if the DecisionSettings do not match the action mode or the channels.
    """
    if settings.washout == 0.0 and settings.authority is None:
        return None
    key = "washout" if settings.washout else "authority"
    if mode not in ADDING:
        value = getattr(settings, key)
        raise InputError(f"decisions.{key} = {value!r}: needs the action mode 'residual'")
    if settings.authority is None:
        return None
    for i, entry in enumerate(observed):
        if entry.name == WIND_CHANNEL:
            return i, entry.scale, entry.centre
    raise InputError(
        f"decisions.authority = {settings.authority!r}: needs the channel {WIND_CHANNEL!r} in the observation"
    )


class DecisionMap(NamedTuple):
    """Holds the constants of the compiled decisions."""

    hold: int  # control periods
    fraction: float  # of a step that the low pass follows in a control period
    shaped: bool  # whether washout or authority act
    passing: float  # of a step that the low pass of the washout follows in a control period
    lasting: float  # of a step that the mean of the estimated wind follows in a decision
    wind: int  # entry of the estimated wind in an observation; -1: authority is always 1
    wind_scale: float  # m/s per unit of this entry
    wind_centre: float  # m/s
    weak: float  # m/s, standard deviations between which authority rises from 0 to 1
    strong: float
    mean: np.ndarray  # (size,) of the features, subtracted
    scale: np.ndarray  # (size,) of the features, divided by
    bound: float  # of the features; inf: none


class DecisionData(NamedTuple):
    """Holds the variables of the decisions of one environment."""

    observations: np.ndarray  # (history + 1, channels) float32 at decision instants, newest first
    seen: np.ndarray  # (channels,) float32, present observation
    smoothed: np.ndarray  # (actions,) low pass of the decisions
    lasting: np.ndarray  # (actions,) low pass of the actions, which the washout subtracts
    wind: np.ndarray  # (2,) mean (m/s) and variance of the estimated wind
    decision: np.ndarray  # (actions,) in force
    terms: np.ndarray  # (terms,) scratch: sums of the reward terms over the decision


def build_decision_map(settings, control_dt, channels, wind=None, scaling=None):
    """Return the DecisionMap of DecisionSettings; wind: result of wind_entry.

    scaling: (mean, scale, bound) of the features, arrays (size,) and a number; None: unscaled.
    """
    if (wind is None) != (settings.authority is None):
        raise ValueError("wind: must be the result of wind_entry for these settings")
    index, wind_scale, centre = (-1, 1.0, 0.0) if wind is None else wind
    weak, strong = settings.authority or (0.0, 1.0)
    size = (settings.history + 1) * channels
    mean, scale, bound = (np.zeros(size), np.ones(size), inf) if scaling is None else scaling
    return DecisionMap(
        hold=settings.hold,
        fraction=_fraction(control_dt, settings.smoothing),
        shaped=settings.washout > 0.0 or wind is not None,
        passing=_fraction(control_dt, settings.washout) if settings.washout else 0.0,
        lasting=_fraction(control_dt * settings.hold, settings.authority_time),
        wind=int(index),
        wind_scale=float(wind_scale),
        wind_centre=float(centre),
        weak=float(weak),
        strong=float(strong),
        mean=np.asarray(mean, dtype=np.float64),
        scale=np.asarray(scale, dtype=np.float64),
        bound=float(bound),
    )


def decision_data(history, channels, actions, terms=0):
    """Return DecisionData of zeros."""
    return DecisionData(
        np.zeros((history + 1, channels), dtype=np.float32),
        np.zeros(channels, dtype=np.float32),
        np.zeros(actions),
        np.zeros(actions),
        np.zeros(2),
        np.zeros(actions),
        np.zeros(terms),
    )


def _fraction(step, time_constant):
    """Return the fraction of the input step that a first-order low pass follows in a time step (s)."""
    return 1.0 if time_constant == 0.0 else 1.0 - exp(-step / time_constant)


@kernel
def estimated_wind(data, decisions):
    """Return the estimated wind, m/s, of the present observation."""
    return decisions.wind_centre + decisions.wind_scale * np.float64(data.seen[decisions.wind])


@kernel
def start_decisions(action, decisions, data):
    """Fill the history with the present observation, and start the filters from the action in force."""
    for i in range(data.observations.shape[0]):
        for k in range(data.seen.shape[0]):
            data.observations[i, k] = data.seen[k]
    for i in range(action.shape[0]):
        data.smoothed[i] = action[i]
        data.lasting[i] = 0.0
    data.wind[0] = estimated_wind(data, decisions) if decisions.wind >= 0 else 0.0
    data.wind[1] = 0.0


@kernel
def shift_history(decisions, data):
    """Append the present observation, at a new decision instant."""
    for i in range(data.observations.shape[0] - 1, 0, -1):
        for k in range(data.seen.shape[0]):
            data.observations[i, k] = data.observations[i - 1, k]
    for k in range(data.seen.shape[0]):
        data.observations[0, k] = data.seen[k]
    if decisions.wind >= 0:
        deviation = estimated_wind(data, decisions) - data.wind[0]
        data.wind[0] += decisions.lasting * deviation
        data.wind[1] += decisions.lasting * (deviation * deviation - data.wind[1])


@kernel
def authority_of(decisions, data):
    """Return the weight of the decisions, in [0, 1]."""
    if decisions.wind < 0:
        return 1.0
    return clamp((sqrt(data.wind[1]) - decisions.weak) / (decisions.strong - decisions.weak), 0.0, 1.0)


@kernel
def smooth_decision(decision, decisions, data, action):
    """Fill the action (actions,) of the next control period from the decision in force."""
    counted = authority_of(decisions, data)
    for i in range(action.shape[0]):
        data.smoothed[i] += decisions.fraction * (decision[i] - data.smoothed[i])
        if decisions.shaped:
            # filter the clipped action: the limit of the low pass then bounds the sum of all applied actions
            action[i] = clamp(counted * data.smoothed[i] - data.lasting[i], -1.0, 1.0)
            data.lasting[i] += decisions.passing * action[i]
        else:
            action[i] = data.smoothed[i]


@kernel
def fill_features(decisions, data, features):
    """Fill features (size,) float32: newest observation, then the change over each earlier interval.

    Changes represent the rates directly; with lagged observations scaled to unit variance, rates would
    be small differences of nearly equal numbers.
    """
    channels, bound = data.seen.shape[0], decisions.bound
    for i in range(data.observations.shape[0]):
        for k in range(channels):
            value = (
                data.observations[i, k] if i == 0 else data.observations[i - 1, k] - data.observations[i, k]
            )
            entry = i * channels + k
            scaled = (np.float64(value) - decisions.mean[entry]) / decisions.scale[entry]
            features[entry] = np.float32(clamp(scaled, -bound, bound))


class Decisions:
    """Computes the smoothed actions and the features of one agent outside an environment.

    As the environments do, by the same kernels. wind: result of wind_entry for the settings. constants, data:
    the DecisionMap and DecisionData.
    """

    def __init__(self, channels, settings, control_dt, wind=None):
        self.settings = settings
        self.size = (settings.history + 1) * channels
        self.constants = build_decision_map(settings, control_dt, channels, wind)
        self.data = decision_data(settings.history, channels, N_ACTIONS)
        self._action, self._features = np.zeros(N_ACTIONS), np.zeros(self.size, dtype=np.float32)

    def restart(self, observation, action):
        """Fill the history with one observation and start from the action in force."""
        self.data.seen[:] = observation
        start_decisions(np.asarray(action, dtype=np.float64), self.constants, self.data)

    def append(self, observation):
        """Append the observation of a new decision instant."""
        self.data.seen[:] = observation
        shift_history(self.constants, self.data)

    def features(self):
        """Return the features (size,) float32."""
        fill_features(self.constants, self.data, self._features)
        return self._features.copy()

    def smooth(self, decision):
        """Return the smoothed action (2,) of the next control period."""
        smooth_decision(np.asarray(decision, dtype=np.float64), self.constants, self.data, self._action)
        return self._action.copy()
