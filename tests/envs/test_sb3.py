"""The stable-baselines3 adapter: the same episodes as its own vector environment of single ones."""

import warnings

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from episodes import QUICK, same
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from fowt_env.envs import FowtEnv
from fowt_env.training.rl.sb3_env import FowtSB3VecEnv


def test_it_is_sb3_s_dummy_environment_bit_for_bit_through_failures_and_time_limits():
    settings = QUICK | {"duration": 8.0, "wind": 18.0}
    fast = FowtSB3VecEnv(2, step_info=True, threads=1, **settings)
    plain = DummyVecEnv([lambda: FowtEnv(**settings)] * 2)
    for env in (fast, plain):
        env.seed(4)
    assert np.array_equal(fast.reset(), plain.reset())
    assert same(dict(enumerate(fast.reset_infos)), dict(enumerate(plain.reset_infos)))
    rng = np.random.default_rng(0)
    truncated, failed = 0, 0
    for _ in range(170):
        actions = rng.uniform(-1.0, 1.0, (2, 2)).astype(np.float32)
        actions[0] = -1.0  # no torque, blades flat
        got, expected = fast.step(actions), plain.step(actions)
        for a, b in zip(got[:3], expected[:3], strict=True):
            assert a.dtype == b.dtype and np.array_equal(a, b)
        for info, other, done in zip(got[3], expected[3], got[2], strict=True):
            assert same(info, other)
            truncated += done and info["TimeLimit.truncated"]
            failed += done and not info["TimeLimit.truncated"]
        assert same(dict(enumerate(fast.reset_infos)), dict(enumerate(plain.reset_infos)))
    assert truncated >= 2 and failed >= 1


def test_ppo_learns_through_monitor_and_normalisation():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = VecNormalize(VecMonitor(FowtSB3VecEnv(4, threads=1, duration=3.0, **QUICK)))
        model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=2, device="cpu", seed=1)
        model.learn(512)
    lengths = [episode["l"] for episode in model.ep_info_buffer]
    assert len(lengths) >= 16 and max(lengths) == 30


def test_attributes_and_methods_reach_the_chosen_environments():
    env = FowtSB3VecEnv(2, threads=1, **QUICK)
    env.reset()
    assert env.get_attr("action_mode") == ["direct", "direct"]
    assert len(env.env_method("measurement", indices=1)) == 1
    assert env.env_is_wrapped(VecMonitor) == [False, False]
    env.set_options({"wind": 20.0})
    env.reset()
    assert [info["wind_speed"] for info in env.reset_infos] == [20.0, 20.0]
    env.close()
