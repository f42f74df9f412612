"""The stored trajectory of each registered environment, and the command that makes it anew.

`python tests/golden.py NAME...` (in the folder of the checkout) rewrites the files of these names in
tests/reference/golden. Do that only together with a new version of a name, see CONTRIBUTING.md.
"""

import sys
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd

from fowt_env.envs.env import REWARD_KEYS
from fowt_env.files.atomic import replacing

FOLDER = Path(__file__).parent / "reference" / "golden"
ENVIRONMENTS = ("fowt_env/OC3Hywind-v1", "fowt_env/OC3Hywind-v2")
TASKS = ("above_rated", "full_range", "steady")  # every task that a name stands for
LADDER = ("fowt_env/OC3HywindEasy-v0",)
CASES = [(name, task) for name in ENVIRONMENTS for task in TASKS] + [(name, "above_rated") for name in LADDER]
SEED = 7
STEPS = 100  # control periods; the first rows show the start, the last the physics added up
EVERY = 10  # rows are stored at step 0, 10, 20, ...


def path_of(name, task):
    """CSV file of an environment and task."""
    return FOLDER / f"{name.split('/')[-1]}_{task}.csv"


def actions():
    """(STEPS, 2) fixed actions within [-1, 1]: slow sweeps with a ripple, no random generator involved."""
    k = np.arange(STEPS)
    torque = 0.6 + 0.3 * np.sin(0.11 * k)
    blade_pitch = -0.1 + 0.3 * np.sin(0.07 * k) + 0.05 * np.cos(1.3 * k)
    return np.stack([torque, blade_pitch], axis=1)


def trajectory(name, task, **options):
    """DataFrame of step, reward, the terms that are paid for and the observation, every EVERY steps."""
    env = gymnasium.make(name, task=task, **options)
    observation, info = env.reset(seed=SEED)
    keys, weights = env.unwrapped.term_keys, env.unwrapped.task.weights
    if keys is REWARD_KEYS:
        keys = [key for key in keys if weights.get(key.removeprefix("reward/"), 0.0) > 0.0]
    paid = list(keys)
    rows = [_row(0, 0.0, observation, info, paid)]
    for step, action in enumerate(actions(), 1):
        observation, reward, terminated, truncated, info = env.step(action)
        assert not (terminated or truncated), f"{name} {task}: the episode ended at step {step}"
        if step % EVERY == 0:
            rows.append(_row(step, reward, observation, info, paid))
    return pd.DataFrame(rows)


def _row(step, reward, observation, info, paid):
    terms = {key: float(info.get(key, 0.0)) for key in paid}  # reset pays nothing
    seen = {f"observation_{i}": float(value) for i, value in enumerate(observation)}
    return {"step": step, "reward": float(reward), **terms, **seen}


def write(names):
    """Paths of the files of names, written anew."""
    paths = []
    for name, task in (case for case in CASES if case[0] in names):
        path = path_of(name, task)
        with replacing(path) as temporary:
            trajectory(name, task).to_csv(temporary, index=False, float_format="%.9g")
        paths.append(path)
    return paths


if __name__ == "__main__":
    for written in write(sys.argv[1:]):
        print(written)
