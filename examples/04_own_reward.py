"""Rewards: other weights of the built-in terms, and a reward of your own from any output channel."""

import gymnasium
import numpy as np


class TowerReward(gymnasium.RewardWrapper):
    """Pays what the built-in reward pays, less the fore-aft moment at the tower base in units of 100 MN m."""

    def reward(self, reward):
        moment = self.unwrapped.channels()["TwrBsMyt"]  # kN m
        return reward - (abs(moment) / 1e5) ** 2


def score(env, steps=200):
    """Mean reward of a fixed action, as a stand-in for an agent."""
    env.reset(seed=1)
    total = 0.0
    for _ in range(steps):
        _, reward, terminated, truncated, info = env.step(np.array([0.8, 0.0], dtype=np.float32))
        total += reward
        if terminated or truncated:
            env.reset()
    return total / steps, info


NAME = "fowt_env:fowt_env/OC3Hywind-v2"  # with the module that registers it
mean, info = score(gymnasium.make(NAME, task="above_rated"))
print(f"built-in weights      {mean:.3f}")
for key, value in info.items():
    if key.startswith("reward/"):
        print(f"    {key:24} {value:.3f}  (last step, before its weight)")

mean, _ = score(gymnasium.make(NAME, task="above_rated", reward={"platform_motion": 2.0, "power": 0.5}))
print(f"other weights         {mean:.3f}")

mean, _ = score(TowerReward(gymnasium.make(NAME, task="above_rated")))
print(f"with the tower moment {mean:.3f}")
