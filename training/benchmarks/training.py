"""Measures the speed of PPO on vector environments: time fractions of physics, torch and Python."""

import time

import numpy as np
import pandas as pd
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from fowt_env.envs import FowtEnv
from fowt_env.envs.decisions import DecisionSettings
from fowt_env.training.rl.train import environment_settings, resolve

EPISODE = 600.0  # s


def watch(spent, owner, name, label):
    """Wrap owner.name to add its time, s, to spent[label], without that of nested wrapped calls."""
    call = getattr(owner, name)

    def timed(*args, **kwargs):
        begin, before = time.perf_counter(), sum(spent.values())
        result = call(*args, **kwargs)
        within = sum(spent.values()) - before
        spent[label] = spent.get(label, 0.0) + time.perf_counter() - begin - within
        return result

    setattr(owner, name, timed)


def nothing_env(env):
    """Return a VecEnv with env's spaces that returns constant arrays at no cost, to time PPO alone."""
    from stable_baselines3.common.vec_env import VecEnvWrapper

    rng = np.random.default_rng(0)
    n = env.num_envs
    observations = rng.normal(size=(n, *env.observation_space.shape)).astype(np.float32)
    result = observations, np.zeros(n, dtype=np.float32), np.zeros(n, dtype=bool), [{} for _ in range(n)]

    class Nothing(VecEnvWrapper):
        def reset(self):
            return observations

        def step_async(self, actions):
            pass

        def step_wait(self):
            return result

    return Nothing(env)


def sync_env(n, settings):
    """Return a FowtSB3VecEnv on Gymnasium's SyncVectorEnv of n single environments."""
    from fowt_env.training.rl.sb3_env import FowtSB3VecEnv

    class SyncSB3VecEnv(FowtSB3VecEnv):
        def reset(self):
            return self.env.reset(seed=self._seeds)[0]

    env = SyncSB3VecEnv(n, threads=1, **settings)
    first = env.env.envs[0]
    env.env = SyncVectorEnv([first.twin] * n, autoreset_mode=AutoresetMode.SAME_STEP)
    return env


def subject(kind, n, settings, decisions):
    """Return (VecEnv, control periods per step, FowtVectorEnv inside or None) of a named kind."""
    from stable_baselines3.common.vec_env import SubprocVecEnv

    from fowt_env.training.rl.sb3_env import FowtSB3VecEnv

    if kind == "SubprocVecEnv":
        first = FowtEnv(**settings)
        first.reset(seed=0)
        first.step(np.zeros(2))  # compile before processes start
        return SubprocVecEnv([first.twin] * n, start_method="fork"), 1, None
    if kind == "SyncVectorEnv":
        return sync_env(n, settings), 1, None
    hold = 1
    if kind.endswith("decisions"):
        settings, hold = settings | {"decisions": decisions}, decisions.hold
    env = native = FowtSB3VecEnv(n, threads=1, **settings)
    return (nothing_env(env), hold, None) if kind.startswith("torch alone") else (env, hold, native.env)


VECTOR_ENVS = (
    "SubprocVecEnv", "SyncVectorEnv", "native", "torch alone", "native, decisions", "torch alone, decisions",
)  # fmt: skip


def measured(kind, n, steps, settings, decisions, algorithm):
    """Return the row of the table for PPO on one kind of vector environment."""
    from stable_baselines3 import PPO

    env, hold, native = subject(kind, n, settings, decisions)
    model = PPO("MlpPolicy", env, seed=0, device="cpu", **algorithm)
    rollout = algorithm["n_steps"] * n
    model.learn(rollout)  # compile and allocate
    spent, rounds = {}, max(1, round(steps / rollout))
    if native is not None:
        watch(spent, native, "_act", "physics")
    watch(spent, model, "train", "torch")
    watch(spent, model.policy, "forward", "torch")
    begin = time.perf_counter()
    model.learn(rounds * rollout, reset_num_timesteps=False)
    wall = time.perf_counter() - begin
    env.close()
    physics, torch = (spent.get(label, np.nan) / wall for label in ("physics", "torch"))
    speed = rounds * rollout / wall
    return {
        "kind": kind, "envs": n, "steps_per_s": speed, "env_steps_per_s": speed * hold,
        "physics_share": physics, "torch_share": torch, "python_share": 1.0 - physics - torch,
        "minutes_for_10M_env_steps": 1e7 / (speed * hold) / 60.0,
    }  # fmt: skip


def benchmark_training(n=64, steps=50_000, kinds=VECTOR_ENVS, progress=None):
    """Return a DataFrame of PPO speeds per kind of vector environment, shipped settings, one torch thread.

    An env step is one control period of the task above_rated in residual mode; a step is a transition seen by
    PPO: a control period or a decision. physics: the compiled call; torch: PPO's update and forward passes of
    the rollout; Python: the rest. The slow kinds run a tenth of the steps.
    """
    import torch

    torch.set_num_threads(1)
    resolved = resolve("ppo", "above_rated", 0, 1)
    settings = environment_settings(resolved) | {"duration": EPISODE}
    decisions = DecisionSettings(**resolved["decisions"])
    chosen = resolved["algorithm"]
    algorithm = {key: chosen[key] for key in ("n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda")}
    algorithm["policy_kwargs"] = {"net_arch": chosen["policy_kwargs"]["net_arch"]}
    rows = []
    for kind in kinds:
        if progress is not None:
            progress(len(rows), len(kinds), kind)
        few = steps // 10 if kind in ("SubprocVecEnv", "SyncVectorEnv") else steps
        rows.append(measured(kind, n, few, settings, decisions, algorithm))
    return pd.DataFrame(rows)
