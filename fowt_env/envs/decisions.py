"""Holds, smooths and limits the decisions of an agent, and builds features from a short history.

Two options keep the additions of any agent (residual mode) from shifting the baseline's operating point.
washout: a high-pass filter, which bounds the sum of the additions and removes a constant decision.
authority: the decisions are weighted by the recent standard deviation of the estimated wind, with weight 0
below a threshold, so that the baseline alone controls the operating point in steady wind.

Training environments and the exported policy use the same numpy code, so that an agent is scored with the
decisions and features of its training.
"""

from dataclasses import dataclass
from math import exp

import numpy as np

from fowt_env.descriptions.checks import check_number, check_whole_number, is_number
from fowt_env.envs.actions import ActionMode
from fowt_env.envs.observations import N_ACTIONS
from fowt_env.errors import InputError

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
    if mode != ActionMode.RESIDUAL:
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


MEAN, VARIANCE = 2 * N_ACTIONS, 2 * N_ACTIONS + 1  # columns in the memory of Decisions


def _fraction(step, time_constant):
    """Return the fraction of the input step that a first-order low pass follows in a time step (s)."""
    return 1.0 if time_constant == 0.0 else 1.0 - exp(-step / time_constant)


class Decisions:
    """Holds the observation history and computes the smoothed actions of n environments.

    observations (n, history + 1, channels) float32: observations at decision instants, newest first.
    action (n, 2): present actions, in [-1, 1].
    wind: result of wind_entry for the settings.
    """

    def __init__(self, n, channels, settings, control_dt, wind=None):
        self.settings = settings
        self.observations = np.zeros((n, settings.history + 1, channels), dtype=np.float32)
        self.action = np.zeros((n, N_ACTIONS))
        self.fraction = _fraction(control_dt, settings.smoothing)
        if (wind is None) != (settings.authority is None):
            raise ValueError("wind: must be the result of wind_entry for these settings")
        self.wind = wind
        self.shaped = settings.washout > 0.0 or wind is not None
        self.passing = _fraction(control_dt, settings.washout) if settings.washout else 0.0
        self.lasting = _fraction(control_dt * settings.hold, settings.authority_time)
        # columns, used with washout or authority: smoothed decision (2), low pass of the action (2), mean
        # and variance of the estimated wind
        self.memory = np.zeros((n, 2 * N_ACTIONS + 2))

    @property
    def size(self):
        """Return the number of features."""
        return self.observations.shape[1] * self.observations.shape[2]

    def restart(self, rows, observations, actions):
        """Reset the history of some rows to one observation and their actions to those in force."""
        self.observations[rows] = np.asarray(observations, dtype=np.float32)[..., None, :]
        self.action[rows] = actions
        self.memory[rows] = 0.0
        self.memory[rows, :N_ACTIONS] = actions
        if self.wind is not None:
            self.memory[rows, MEAN] = self._estimated_wind()[rows]

    def append(self, observations):
        """Append the observations (n, channels) of a new decision instant."""
        self.observations[:, 1:] = self.observations[:, :-1].copy()
        self.observations[:, 0] = observations
        if self.wind is not None:
            deviation = self._estimated_wind() - self.memory[:, MEAN]
            self.memory[:, MEAN] += self.lasting * deviation
            self.memory[:, VARIANCE] += self.lasting * (deviation**2 - self.memory[:, VARIANCE])

    def _estimated_wind(self):
        """Return the estimated wind (n,), m/s, of the newest observations."""
        index, scale, centre = self.wind
        return centre + scale * self.observations[:, 0, index].astype(np.float64)

    def authority(self):
        """Return the weights (n,) of the decisions, in [0, 1]."""
        if self.wind is None:
            return np.ones(len(self.action))
        low, high = self.settings.authority
        return np.clip((np.sqrt(self.memory[:, VARIANCE]) - low) / (high - low), 0.0, 1.0)

    def features(self):
        """Return features (n, size) float32: newest observation, then the change over each earlier interval.

        Changes represent the rates directly; with lagged observations scaled to unit variance, rates would
        be small differences of nearly equal numbers.
        """
        return features_of(self.observations)

    def last_features(self, row, observation):
        """Return the features (size,) of a row for a next observation, without storing the observation."""
        newest = np.asarray(observation, dtype=np.float32)[None]
        observations = np.concatenate([newest, self.observations[row, :-1]])
        return features_of(observations[None])[0]

    def smooth(self, decision):
        """Return the smoothed actions (n, 2) of the next control period."""
        if not self.shaped:
            self.action += self.fraction * (decision - self.action)
            return self.action
        smoothed, lasting = self.memory[:, :N_ACTIONS], self.memory[:, N_ACTIONS:MEAN]
        smoothed += self.fraction * (decision - smoothed)
        counted = self.authority()[:, None] * smoothed
        # filter the clipped action: the limit of the low pass then bounds the sum of all applied actions
        self.action[:] = np.clip(counted - lasting, -1.0, 1.0)
        lasting += self.passing * self.action
        return self.action


def features_of(observations):
    """Return features (n, features) of observations (n, instants, channels), see Decisions.features."""
    changes = observations[:, :-1] - observations[:, 1:]
    n = len(observations)
    return np.concatenate([observations[:, 0], changes.reshape(n, -1)], axis=1)
