"""Exported networks that were never trained answer as stable-baselines3 does; no kernel is needed."""

import re

import gymnasium
import numpy as np
import pytest

pytest.importorskip("sb3_contrib", reason="the extra `train` is not installed")

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from fowt_env.controllers.policy.controller import read_policy
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError
from fowt_env.training.rl.export import export_policy

pytestmark = pytest.mark.installation


class Shape(gymnasium.Env):
    """The spaces of an environment that nobody steps."""

    def __init__(self, width):
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (width,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)


@pytest.mark.parametrize(("algorithm", "norm_obs"), [(PPO, True), (PPO, False), (SAC, True)])
def test_an_exported_network_answers_as_stable_baselines3_does_before_any_training(
    algorithm, norm_obs, tmp_path
):
    single = FowtEnv("steady", decisions={"hold": 2, "history": 2})
    width = single.observation_space.shape[0]
    normalised = VecNormalize(DummyVecEnv([lambda: Shape(width)]), norm_obs=norm_obs)
    rng = np.random.default_rng(3)
    if norm_obs:  # without, as on the ladder of tasks, there are no statistics
        normalised.obs_rms.update(2.0 + 3.0 * rng.normal(size=(500, width)))
    model = algorithm("MlpPolicy", normalised, seed=5, device="cpu")
    with torch.no_grad():  # PPO starts with answers near zero
        for parameter in model.policy.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
    path = export_policy(model, single, tmp_path / "policy.npz", {}, normalised)
    features = (2.0 + 6.0 * rng.normal(size=(300, width))).astype(np.float32)
    expected, _ = model.predict(normalised.normalize_obs(features), deterministic=True)
    answers = read_policy(path)[1](features)
    assert expected.min() < -0.9 and expected.max() > 0.9
    assert np.abs(answers - expected).max() < 1e-5


@pytest.mark.parametrize("settings, width, message", [
    ({}, None, "the environment has no decisions: must have decisions, and a mode of direct, "),
    ({"decisions": {"hold": 2}}, 5, "the model reads observations of shape (5,), the environment has"),
])  # fmt: skip
def test_what_a_policy_file_cannot_hold_is_refused(settings, width, message, tmp_path):
    single = FowtEnv("steady", **settings)
    model = PPO("MlpPolicy", Shape(width or single.observation_space.shape[0]), device="cpu")
    with pytest.raises(InputError, match=re.escape(message)):
        export_policy(model, single, tmp_path / "policy.npz", {})
    assert not (tmp_path / "policy.npz").exists()
