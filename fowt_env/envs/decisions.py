"""Decisions of an agent: kept for some control periods, smoothed, and made from a short history.

What an agent adds to a baseline (residual mode) can be made to leave the baseline's operating point alone,
whatever the agent has learned. washout: a high pass, so that what is added sums to no more than a bounded
amount and a constant decision comes to nothing. authority: the decisions count in proportion to how much
the estimated wind has moved lately, and not at all below a floor, so that the baseline alone decides what
happens about the operating point in steady wind.

The same few lines of numpy serve the training environments and the exported policy, so that an agent is
scored on what it learned from.
"""

from dataclasses import dataclass
from math import exp

import numpy as np

from fowt_env.descriptions.checks import check_number, check_whole_number, is_number
from fowt_env.envs.actions import ActionMode
from fowt_env.envs.observations import N_ACTIONS
from fowt_env.errors import InputError

WIND_CHANNEL = "estimated_wind"  # whose movement gives authority


@dataclass(frozen=True)
class DecisionSettings:
    """How decisions are made. Raises: InputError naming the key, value and allowed range."""

    hold: int = 5  # control periods from one decision to the next
    smoothing: float = 0.5  # s, time constant of the low pass from decision to action; 0: none
    history: int = 8  # earlier decision instants that are inputs beside the present one
    washout: float = 0.0  # s, time constant of the high pass of what is added to a baseline; 0: none
    # m/s, standard deviation of the estimated wind below which a decision counts nothing, and from which on
    # it counts in full; None: always in full
    authority: tuple | None = None
    authority_time: float = 60.0  # s, over which that standard deviation is taken

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
    """(index, m/s per unit, centre m/s) of the estimated wind among observed Entries; None: not needed.

    Raises: InputError where the DecisionSettings do not go with the action mode or the channels.
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
        f"decisions.authority = {settings.authority!r}: needs the channel {WIND_CHANNEL!r} among the observed"
    )


MEAN, VARIANCE = 2 * N_ACTIONS, 2 * N_ACTIONS + 1  # places in the memory of Decisions


def _fraction(step, time_constant):
    """Share of the way to its input that a first-order low pass goes in a step (s)."""
    return 1.0 if time_constant == 0.0 else 1.0 - exp(-step / time_constant)


class Decisions:
    """History and smoothed actions of n environments.

    observations (n, history + 1, channels) float32: observations at decision instants, newest first.
    action (n, 2): in force, in [-1, 1].
    wind: what wind_entry returns.
    """

    def __init__(self, n, channels, settings, control_dt, wind=None):
        self.settings = settings
        self.observations = np.zeros((n, settings.history + 1, channels), dtype=np.float32)
        self.action = np.zeros((n, N_ACTIONS))
        self.fraction = _fraction(control_dt, settings.smoothing)
        if (wind is None) != (settings.authority is None):
            raise ValueError("wind: what wind_entry returns for these settings")
        self.wind = wind
        self.shaped = settings.washout > 0.0 or wind is not None
        self.passing = _fraction(control_dt, settings.washout) if settings.washout else 0.0
        self.lasting = _fraction(control_dt * settings.hold, settings.authority_time)
        # of each row, where anything is shaped: smoothed decision (2), low pass of the action (2), mean and
        # variance of the estimated wind
        self.memory = np.zeros((n, 2 * N_ACTIONS + 2))

    @property
    def size(self):
        """Number of features."""
        return self.observations.shape[1] * self.observations.shape[2]

    def restart(self, rows, observations, actions):
        """Forget the past of some rows: all history is the observation, the action is the one in force."""
        self.observations[rows] = np.asarray(observations, dtype=np.float32)[..., None, :]
        self.action[rows] = actions
        self.memory[rows] = 0.0
        self.memory[rows, :N_ACTIONS] = actions
        if self.wind is not None:
            self.memory[rows, MEAN] = self._estimated_wind()[rows]

    def append(self, observations):
        """Take the observations (n, channels) of a new decision instant."""
        self.observations[:, 1:] = self.observations[:, :-1].copy()
        self.observations[:, 0] = observations
        if self.wind is not None:
            deviation = self._estimated_wind() - self.memory[:, MEAN]
            self.memory[:, MEAN] += self.lasting * deviation
            self.memory[:, VARIANCE] += self.lasting * (deviation**2 - self.memory[:, VARIANCE])

    def _estimated_wind(self):
        """(n,) m/s, of the newest observations."""
        index, scale, centre = self.wind
        return centre + scale * self.observations[:, 0, index].astype(np.float64)

    def authority(self):
        """(n,) fraction in [0, 1] by which decisions count."""
        if self.wind is None:
            return np.ones(len(self.action))
        low, high = self.settings.authority
        return np.clip((np.sqrt(self.memory[:, VARIANCE]) - low) / (high - low), 0.0, 1.0)

    def features(self):
        """(n, size) float32: the newest observation, then its change over each earlier interval.

        Changes, as they carry the rates that plain lags would hide in differences of nearly equal numbers
        once everything is scaled to unit variance.
        """
        return features_of(self.observations)

    def last_features(self, row, observation):
        """(size,) features of a row if the observation came next; nothing is remembered."""
        newest = np.asarray(observation, dtype=np.float32)[None]
        observations = np.concatenate([newest, self.observations[row, :-1]])
        return features_of(observations[None])[0]

    def smooth(self, decision):
        """(n, 2) action of the next control period, towards the decision."""
        if not self.shaped:
            self.action += self.fraction * (decision - self.action)
            return self.action
        smoothed, lasting = self.memory[:, :N_ACTIONS], self.memory[:, N_ACTIONS:MEAN]
        smoothed += self.fraction * (decision - smoothed)
        counted = self.authority()[:, None] * smoothed
        # the low pass is of what is applied, so that its limit bounds the sum of all that is ever applied
        self.action[:] = np.clip(counted - lasting, -1.0, 1.0)
        lasting += self.passing * self.action
        return self.action


def features_of(observations):
    """(n, features) of observations (n, instants, channels), see Decisions.features."""
    changes = observations[:, :-1] - observations[:, 1:]
    n = len(observations)
    return np.concatenate([observations[:, 0], changes.reshape(n, -1)], axis=1)
