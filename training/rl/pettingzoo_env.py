"""Defines the three blades as agents of PettingZoo's parallel API, with a common reward.

from fowt_env.training.rl.pettingzoo_env import FowtBladesEnv
env = FowtBladesEnv()
observations, infos = env.reset(seed=0)
"""

from math import cos, pi, sin
from typing import Any

import gymnasium
import numpy as np

import fowt_env  # noqa: F401 # registers the environments
from fowt_env.errors import InputError

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise ImportError("PettingZoo is not installed: pip install 'fowt-env[pettingzoo]'") from error

NAME = "fowt_env/OC3HywindIndividualPitch-v0"
AGENTS = ("blade_1", "blade_2", "blade_3")
MODE = "individual_residual"
TURNED = ("sin_azimuth", "cos_azimuth")


class FowtBladesEnv(ParallelEnv):
    """Gives each blade of an environment with the action mode individual_residual to an agent.

    name: of the registered environment; settings: those of gymnasium.make(name, ...). The action of an agent
    (1,) in [-1, 1] is an addition to the pitch of its blade; the baseline commands the torque alone. Each
    agent observes what the environment observes, with its own blade in the place of blade 1, the blades that
    follow in the places of 2 and 3, and its own azimuth: agents may share a policy. The reward of the
    environment is that of every agent; all end together.

    Raises: InputError for another action mode and for actions that do not name every blade.
    """

    metadata = {"name": "fowt_blades_v0", "render_modes": []}

    def __init__(self, name: str = NAME, **settings: Any) -> None:
        self.env: Any = gymnasium.make(name, **settings)
        single = self.env.unwrapped
        if single.action_mode != MODE:
            raise InputError(f"action_mode = {single.action_mode!r}: must be {MODE!r} for agents of blades")
        self.possible_agents, self.agents = list(AGENTS), []
        self.render_mode = None
        space, names = self.env.observation_space, [entry.name for entry in single.observed]
        blocks = space.shape[0] // len(names)  # the newest observation, and changes before it
        self._turns = [np.kron(np.eye(blocks), turn(names, blade)) for blade in range(len(AGENTS))]
        self._low, self._high = space.low, space.high
        self.observation_spaces = dict.fromkeys(AGENTS, space)
        self.action_spaces = {agent: gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32) for agent in AGENTS}

    def observation_space(self, agent: str) -> gymnasium.spaces.Space:
        """Return the observation space of an agent, the same for all."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Space:
        """Return the action space (1,) of an agent."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Start an episode; return ({agent: observation}, {agent: info}). options: those of FowtEnv.reset."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.agents = list(AGENTS)
        return self._seen(observation), {agent: dict(info) for agent in AGENTS}

    def step(self, actions: dict[str, Any]) -> tuple[dict, dict, dict, dict, dict]:
        """Advance one decision under {agent: action (1,)}; return dicts by agent, as PettingZoo does."""
        if set(actions) != set(self.agents):
            raise InputError(f"actions of {', '.join(actions)}: must be of {', '.join(self.agents)}")
        additions = [float(np.asarray(actions[agent]).reshape(())) for agent in AGENTS]
        observation, reward, terminated, truncated, info = self.env.step((0.0, *additions))
        results = (reward, terminated, truncated)
        rewards, terminations, truncations = (dict.fromkeys(AGENTS, value) for value in results)
        if terminated or truncated:
            self.agents = []
        infos = {agent: dict(info) for agent in AGENTS}
        return self._seen(observation), rewards, terminations, truncations, infos

    def _seen(self, observation):
        """Return {agent: observation} with the blades in the order of each agent."""
        turned = (matrix @ observation for matrix in self._turns)
        seen = (np.clip(one, self._low, self._high).astype(np.float32) for one in turned)
        return dict(zip(AGENTS, seen, strict=True))

    def close(self) -> None:
        """Close the environment."""
        self.env.close()


def turn(names, blade):
    """Return the matrix (n, n) that turns an observation of entries `names` to the place of a blade, 0 to 2.

    Entries of single blades are renumbered, with the blade itself as the first, as are the previous actions
    of blades; sine and cosine of the azimuth become those of the blade.
    """
    matrix = np.eye(len(names))
    for row, name in enumerate(names):
        stem, _, number = name.rpartition("_")
        if number.isdigit() and number != "0":  # the action 0 is the torque
            source = f"{stem}_{(int(number) - 1 + blade) % len(AGENTS) + 1}"
            matrix[row] = 0.0
            matrix[row, names.index(source)] = 1.0
    if set(TURNED) <= set(names):
        at = [names.index(name) for name in TURNED]
        angle = 2.0 * pi * blade / len(AGENTS)
        matrix[np.ix_(at, at)] = [[cos(angle), sin(angle)], [-sin(angle), cos(angle)]]
    return matrix
