"""Defines the environment with a vector of rewards, for multi-objective learning."""

from typing import Any

import gymnasium
import numpy as np

from fowt_env.envs.env import FowtEnv
from fowt_env.envs.goals import GOALS, N_GOALS, REWARD, WEIGHTS
from fowt_env.errors import InputError


class FowtObjectivesEnv(FowtEnv):
    """Returns the goals of the reward "score" as a vector, in the API of MO-Gymnasium.

    The reward of a step is a float32 array in the order of fowt_env.envs.goals.GOALS, each in [0, 1], without
    the weights; reward_space is its Box, and weights those of the scalar reward. Settings: see FowtEnv.
    """

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        if settings.setdefault("reward", REWARD) != REWARD:
            raise InputError(f"reward = {settings['reward']!r}: must be {REWARD!r} for a vector of rewards")
        super().__init__(*arguments, **settings)
        self.reward_space = gymnasium.spaces.Box(0.0, 1.0, (N_GOALS,), np.float32)
        self.reward_dim = N_GOALS
        self.weights = dict(zip(GOALS, WEIGHTS.tolist(), strict=True))

    def step(self, action: Any) -> tuple[np.ndarray, Any, bool, bool, dict[str, Any]]:
        """Advance one step; return (observation, goals (n,), terminated, truncated, info)."""
        observation, _, terminated, truncated, info = super().step(action)
        goals = [info[f"reward/{name}"] for name in GOALS]
        return observation, np.array(goals, dtype=np.float32), terminated, truncated, info
