"""Defines the vector environment for stable-baselines3, stepped by one compiled call.

from stable_baselines3 import PPO
from fowt_env.training.rl.sb3_env import FowtSB3VecEnv
model = PPO("MlpPolicy", FowtSB3VecEnv(16, task="above_rated", fidelity="standard")).learn(100_000)
"""

import numpy as np

from fowt_env.envs import FowtVectorEnv
from fowt_env.envs.vector_env import of_one

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError("stable-baselines3 is not installed: pip install 'fowt-env[train]'") from error


class FowtSB3VecEnv(VecEnv):
    """Adapts FowtVectorEnv to stable-baselines3's VecEnv; ended environments restart at once.

    num_envs, settings: see FowtVectorEnv, whose autoreset_mode is "SameStep" here. step_info: whether every
    step has the info of FowtEnv (reward terms, time, saturated actions); False: only the last step of an
    episode, which is faster.

    In the last step of an episode infos[i]["terminal_observation"] is the last observation and
    infos[i]["TimeLimit.truncated"] is True if the episode ended by its time limit and not by failure.
    """

    def __init__(self, num_envs=1, step_info=False, **settings):
        self.env = FowtVectorEnv(num_envs, autoreset_mode="SameStep", **settings)
        self.step_info = step_info
        self._actions = None
        super().__init__(num_envs, self.env.single_observation_space, self.env.single_action_space)

    def reset(self):
        """Return observations (num_envs, n) of new episodes; seeds and options are used once."""
        observations, infos = self.env.reset(seed=self._seeds, options=list(self._options))
        self.reset_infos = [of_one(infos, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions):
        """Store the actions for step_wait."""
        self._actions = actions

    def step_wait(self):
        """Return (observations, rewards, dones, infos) after one control period."""
        observations, rewards, terminations, truncations, vector_infos = self.env.step(self._actions)
        dones = terminations | truncations
        if self.step_info:
            infos = [of_one(vector_infos, i) for i in range(self.num_envs)]
        else:
            infos = [{} for _ in range(self.num_envs)]
        for info in infos:
            info["TimeLimit.truncated"] = False
        for i in np.flatnonzero(dones):
            self.reset_infos[i] = of_one(vector_infos, i, but=("final_obs", "final_info"))
            infos[i] = of_one(vector_infos["final_info"], i)
            infos[i]["terminal_observation"] = vector_infos["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(truncations[i])
        return observations, rewards.astype(np.float32), dones, infos

    def get_state(self):
        """Return the picklable state of the episodes."""
        return self.env.get_state()

    def set_state(self, state):
        """Restore a state of get_state; return the observations at that state."""
        self.env.set_state(list(state))
        return self.env.observations

    @property
    def terms(self):
        """Return {term: mean over the environments} of the reward of the last step, before weighting."""
        return dict(zip(self.env.envs[0].term_keys, self.env.terms.mean(axis=0).tolist(), strict=True))

    def close(self):
        """Close all environments."""
        self.env.close()

    def get_attr(self, attr_name, indices=None):
        """Return the attribute's value in each of the chosen environments."""
        return [self.env.envs[i].get_wrapper_attr(attr_name) for i in self._get_indices(indices)]

    def set_attr(self, attr_name, value, indices=None):
        """Set an attribute of the chosen environments."""
        for i in self._get_indices(indices):
            setattr(self.env.envs[i], attr_name, value)

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        """Call a method of each of the chosen environments; return the list of results."""
        chosen = self._get_indices(indices)
        return list(self.env.call(method_name, *method_args, indices=chosen, **method_kwargs))

    def env_is_wrapped(self, wrapper_class, indices=None):
        """Return False for each of the chosen environments: they are never wrapped."""
        return [False for _ in self._get_indices(indices)]
