"""Decisions of an agent: held for some control periods, smoothed, and made from a short history.

The same few lines of numpy serve the training environments and the exported policy, so that an agent is
scored on what it learned from.
"""

from dataclasses import dataclass
from math import exp, isfinite

import numpy as np

from fowt_env.envs.observations import N_ACTIONS
from fowt_env.errors import InputError


@dataclass(frozen=True)
class DecisionSettings:
    """How decisions are made. Raises: InputError naming the key, value and allowed range."""

    hold: int = 5  # control periods from one decision to the next
    smoothing: float = 0.5  # s, time constant of the low pass from decision to action; 0: none
    history: int = 8  # earlier decision instants that are inputs beside the present one

    def __post_init__(self):
        for key, low, high in (("hold", 1, 100), ("history", 0, 200)):
            value = getattr(self, key)
            if type(value) is not int or not low <= value <= high:
                raise InputError(f"decisions.{key} = {value!r}: must be a whole number from {low} to {high}")
        value = self.smoothing
        number = isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
        if not number or not 0.0 <= value <= 60.0:
            raise InputError(f"decisions.smoothing = {value!r}: must be in [0, 60] s")


class Decisions:
    """History and smoothed actions of n environments.

    observations (n, history + 1, channels) float32: observations at decision instants, newest first.
    action (n, 2): in force, in [-1, 1].
    """

    def __init__(self, n, channels, settings, control_dt):
        self.settings = settings
        self.observations = np.zeros((n, settings.history + 1, channels), dtype=np.float32)
        self.action = np.zeros((n, N_ACTIONS))
        self.fraction = 1.0 if settings.smoothing == 0.0 else 1.0 - exp(-control_dt / settings.smoothing)

    @property
    def size(self):
        """Number of features."""
        return self.observations.shape[1] * self.observations.shape[2]

    def restart(self, rows, observations, actions):
        """Forget the past of some rows: all history is the observation, the action is the one in force."""
        self.observations[rows] = np.asarray(observations, dtype=np.float32)[..., None, :]
        self.action[rows] = actions

    def append(self, observations):
        """Take the observations (n, channels) of a new decision instant."""
        self.observations[:, 1:] = self.observations[:, :-1].copy()
        self.observations[:, 0] = observations

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
        self.action += self.fraction * (decision - self.action)
        return self.action


def features_of(observations):
    """(n, features) of observations (n, instants, channels), see Decisions.features."""
    changes = observations[:, :-1] - observations[:, 1:]
    n = len(observations)
    return np.concatenate([observations[:, 0], changes.reshape(n, -1)], axis=1)
