"""Sixteen environments, each in its own weather, stepped by one compiled call."""

from time import perf_counter

import gymnasium
import numpy as np

N = 16
STEPS = 500
envs = gymnasium.make_vec("fowt_env:fowt_env/OC3Hywind-v2", num_envs=N, task="above_rated")
observations, infos = envs.reset(seed=1)  # seeds 1, 2, ... N
print("wind speeds:", np.round(infos["wind_speed"], 1))

actions = np.tile(np.array([0.8, 0.0], dtype=np.float32), (N, 1))  # an agent's place
envs.step(actions)  # compiles, the first time
start = perf_counter()
total = np.zeros(N)
for _ in range(STEPS):
    observations, rewards, terminations, truncations, infos = envs.step(actions)
    total += rewards
seconds = perf_counter() - start
print(f"{N * STEPS / seconds:.0f} environment steps a second, mean reward {total.mean() / STEPS:.3f}")
