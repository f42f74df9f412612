"""Defines the vector environment for TorchRL, stepped by one compiled call.

from torchrl.collectors import SyncDataCollector
from fowt_env.training.rl.torchrl_env import FowtTorchRLEnv
env = FowtTorchRLEnv("fowt_env/OC3HywindEasy-v0", 64)
"""

from typing import Any

import gymnasium
import numpy as np

import fowt_env  # noqa: F401 # registers the environments
from fowt_env.errors import InputError

try:
    import torch
    from tensordict import TensorDict
    from torchrl.data import Binary, Bounded, Composite, Unbounded
    from torchrl.envs import EnvBase
except ImportError as error:
    raise ImportError("TorchRL is not installed: pip install 'fowt-env[torchrl]'") from error

ENDS = ("done", "terminated", "truncated")


class FowtTorchRLEnv(EnvBase):
    """Adapts a registered environment to TorchRL's EnvBase with batch size (num_envs,): no copies, no loop.

    name: of a registered environment; settings: those of gymnasium.make_vec(name, ...); device: of all
    tensors. Keys: observation (num_envs, n) float32, action (num_envs, actions) in [-1, 1], reward
    (num_envs, 1); done is terminated (failure) or truncated (end of the duration). reset() with "_reset"
    restarts the marked environments alone, as collectors do. set_seed(s) gives the environments the seeds
    s, s + 1, ... at the next reset.

    Raises: InputError for a name without a vector environment.
    """

    def __init__(self, name: str, num_envs: int = 1, device: Any = "cpu", **settings: Any) -> None:
        spec = gymnasium.spec(name)
        if spec.vector_entry_point is None:
            raise InputError(f"name = {name!r}: has no vector environment")
        self.vector_env = gymnasium.make_vec(
            name, num_envs, "vector_entry_point", autoreset_mode="Disabled", **settings
        )
        super().__init__(device=device, batch_size=[num_envs])
        single = self.vector_env.single_observation_space
        shape, actions = (num_envs, *single.shape), self.vector_env.action_space.shape
        low, high = (torch.as_tensor(np.tile(end, (num_envs, 1))) for end in (single.low, single.high))
        batch = (num_envs,)
        self.observation_spec = Composite(
            observation=Bounded(low, high, shape, self.device, torch.float32), shape=batch
        )
        self.action_spec = Bounded(-1.0, 1.0, actions, self.device, torch.float32)
        self.reward_spec = Unbounded((num_envs, 1), self.device, torch.float32)
        self.done_spec = Composite(
            {key: Binary(1, (num_envs, 1), self.device, torch.bool) for key in ENDS}, shape=batch
        )
        self._seed_of_reset: int | None = None

    def _reset(self, tensordict=None, **kwargs):
        """Start new episodes in all environments, or in those that "_reset" marks."""
        options, mask = None, None if tensordict is None else tensordict.get("_reset", None)
        if mask is not None:
            options = {"reset_mask": mask.reshape(-1).cpu().numpy()}
        observations, _ = self.vector_env.reset(seed=self._seed_of_reset, options=options)
        self._seed_of_reset = None
        ended = np.zeros(self.batch_size, dtype=bool)
        return self._packed(observations, ended, ended)

    def _step(self, tensordict):
        """Advance all environments by one decision."""
        actions = tensordict["action"].detach().cpu().numpy()
        observations, rewards, terminated, truncated, _ = self.vector_env.step(actions)
        result = self._packed(observations, terminated, truncated)
        result["reward"] = self._tensor(rewards, torch.float32)
        return result

    def _packed(self, observations, terminated, truncated):
        """Return the TensorDict of observations and ends."""
        ends = zip(ENDS, (terminated | truncated, terminated, truncated), strict=True)
        values = {key: self._tensor(value, torch.bool) for key, value in ends}
        observations = torch.as_tensor(observations, device=self.device)
        return TensorDict(
            {"observation": observations, **values}, batch_size=self.batch_size, device=self.device
        )

    def _tensor(self, values, dtype):
        """Return an array (num_envs,) as a tensor (num_envs, 1)."""
        return torch.as_tensor(values, device=self.device).to(dtype).unsqueeze(-1)

    def _set_seed(self, seed):
        """Store the seed of the next reset."""
        self._seed_of_reset = seed

    def close(self, **kwargs):
        """Close the environments."""
        self.vector_env.close()
        return super().close(**kwargs)
