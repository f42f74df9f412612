"""The environment of TorchRL: its checker, and the same episodes as the batch that it wraps."""

import importlib
import sys

import gymnasium
import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("torchrl")

from torchrl.envs.utils import check_env_specs  # noqa: E402

from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.rl import torchrl_env  # noqa: E402

pytestmark = pytest.mark.slow  # the import of TorchRL takes seconds
NAME = "fowt_env/OC3HywindEasy-v0"


@pytest.fixture(scope="module")
def env():
    return torchrl_env.FowtTorchRLEnv(NAME, 3, duration=5.0, threads=1)


def test_torchrl_s_checker_accepts_it(env):
    check_env_specs(env)


def test_a_rollout_is_that_of_the_batch_and_goes_on_with_new_episodes(env):
    env.set_seed(4)
    steps = env.rollout(14, break_when_any_done=False)
    batch = gymnasium.make_vec(NAME, 3, autoreset_mode="Disabled", duration=5.0, threads=1)
    observations, _ = batch.reset(seed=4)
    for k in range(14):
        assert np.array_equal(steps["observation"][:, k].numpy(), observations)
        observations, rewards, terminated, truncated, _ = batch.step(steps["action"][:, k].numpy())
        after = steps["next"][:, k]
        assert np.array_equal(after["observation"].numpy(), observations)
        assert np.array_equal(after["reward"].numpy()[:, 0], rewards.astype(np.float32))
        assert np.array_equal(after["truncated"].numpy()[:, 0], truncated) and not terminated.any()
        assert np.array_equal(after["done"].numpy(), after["truncated"].numpy())
        if truncated.any():  # after five seconds
            assert k == 9 and truncated.all()
            observations, _ = batch.reset(options={"reset_mask": truncated})


def test_only_the_marked_environments_restart(env):
    env.set_seed(1)
    first = env.step(env.rand_action(env.reset()))["next"]
    marked = first.clone().set("_reset", torch.tensor([[True], [False], [False]]))
    again = env.reset(marked)
    assert torch.equal(again["observation"][1:], first["observation"][1:])
    assert not torch.equal(again["observation"][0], first["observation"][0])


def test_a_failure_is_terminated():
    env = torchrl_env.FowtTorchRLEnv("fowt_env/OC3Hywind-v2", 1, threads=1)
    done = env.rollout(200, policy=lambda _: torch.full((1, 2), -1.0))["next"][0, -1]
    assert done["terminated"].item() and done["done"].item() and not done["truncated"].item()


def test_a_name_without_a_batch_and_a_missing_library_are_named(monkeypatch):
    with pytest.raises(InputError, match="Objectives-v0'.*no vector environment"):
        torchrl_env.FowtTorchRLEnv("fowt_env/OC3HywindObjectives-v0")
    monkeypatch.setitem(sys.modules, "torchrl.envs", None)
    monkeypatch.delitem(sys.modules, "fowt_env.training.rl.torchrl_env")
    with pytest.raises(ImportError, match=r"pip install 'fowt-env\[torchrl\]'"):
        importlib.import_module("fowt_env.training.rl.torchrl_env")
