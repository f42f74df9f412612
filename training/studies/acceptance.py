"""Trains an algorithm with its default settings on a task of the ladder, several seeds side by side.

    python -m fowt_env.training.studies.acceptance --out runs/acceptance

Each seed is PPO("MlpPolicy", gymnasium.make(NAME), seed=seed).learn(STEPS) in a process of its own. At 0,
25, 50, 75 and 100 % of the steps the deterministic policy runs the validation episodes of the task; that of
the end then runs the suite above_rated, unless with --no-scored. The folder has curve_SEED.csv (returns of
the training episodes), validation.csv, scores.csv, policy_SEED.npz, curve.png and verdict.json. The
acceptance is met with a validation reward above that of zero action in every seed, and a score below 0.9 in
all but one at most.
"""

import json
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import numpy as np
import pandas as pd
import typer

import fowt_env  # noqa: F401 # registers the environments
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import write_table
from fowt_env.registration import LADDER, STEPS
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard import leaderboard
from fowt_env.training.evaluation.seeds import PURPOSES, seeds_for

EASY = "fowt_env/OC3HywindEasy-v0"
WINDS = {  # m/s, of the validation episodes of a task
    "above_rated": (12.0, 13.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0),
    "full_range": (5.0, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0, 24.0),
}
FIRST_SEED = 200  # index of the validation seed of the first episode
PARTS = 4  # a validation after each of these parts of a training
SCORE = 0.9  # to be reached on the suite


def returns(name, policy):
    """Return the mean rewards of a decision (episodes,) in validation episodes of an environment.

    policy: function of observations (n, size) that returns actions (n, actions). After an early end decisions
    count 0.
    """
    options = episodes(name)
    env: Any = gymnasium.make_vec(name, len(options), autoreset_mode="Disabled", threads=1)
    observations, _ = env.reset(seed=0, options=options)
    total, running = np.zeros(len(options)), np.ones(len(options), dtype=bool)
    while running.any():
        observations, rewards, terminated, truncated, _ = env.step(policy(observations))
        total += np.where(running, rewards, 0.0)
        running &= ~(terminated | truncated)
        again = terminated | truncated
        if again.any() and running.any():  # what ended goes on with an episode that does not count
            observations, _ = env.reset(options={"reset_mask": again})
    return total / STEPS


def episodes(name):
    """Return the options of reset of an environment's validation episodes, one for each of its WINDS."""
    winds = WINDS[LADDER[name]["task"]]
    seeds = seeds_for("validation", FIRST_SEED, len(winds))
    return [
        {
            "wind": {"kind": "ntm", "speed": wind, "class": "B", "sigma": "drawn"},
            "weather_seed": seed,
            "offsets": {},
        }
        for wind, seed in zip(winds, seeds, strict=True)
    ]


class Validations:
    """Validates the policy of a training before its first decision, after each part of it and at its end.

    rows: dicts of seed, steps, reward and seconds.
    """

    def __init__(self, name, seed, steps):
        self.name, self.seed, self.steps = name, seed, steps
        self.rows, self.began = [], time.perf_counter()

    def due(self, done, policy):
        """Validate a policy if a part has ended after `done` decisions."""
        if len(self.rows) < PARTS and done >= len(self.rows) * self.steps / PARTS:
            self.now(done, policy)

    def now(self, done, policy):
        """Validate a policy: a function of observations (n, size) that returns actions."""
        reward = returns(self.name, policy).mean()
        seconds = time.perf_counter() - self.began
        self.rows.append({"seed": self.seed, "steps": done, "reward": reward, "seconds": seconds})
        print(f"seed {self.seed}: {done} steps, {reward:.4f} a decision", flush=True)


def learned(seed, name, steps, algo, validations):
    """Train an algorithm of stable-baselines3 with default settings; return (model, its Monitor)."""
    import torch
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.monitor import Monitor

    from fowt_env.training.rl.train import make_algorithm

    torch.set_num_threads(1)
    env = Monitor(gymnasium.make(name))
    model = make_algorithm(algo)("MlpPolicy", env, seed=seed, device="cpu")

    def policy(seen):
        return model.predict(seen, deterministic=True)[0]

    class Validate(BaseCallback):
        """Validates before the first decision and after each part of the training but the last."""

        def _on_step(self):
            return True

        def _on_rollout_start(self):
            validations.due(self.num_timesteps, policy)

    model.learn(steps, callback=Validate())
    validations.now(model.num_timesteps, policy)
    return model, env


def trained(seed, name, steps, folder, algo="ppo"):
    """Train one seed; write its curve and policy and return the rows of its validations."""
    from fowt_env.training.rl.export import export_policy

    validations = Validations(name, seed, steps)
    model, env = learned(seed, name, steps, algo, validations)
    lengths = env.get_episode_lengths()
    curve = {"steps": np.cumsum(lengths), "return": env.get_episode_rewards(), "length": lengths}
    write_table(pd.DataFrame(curve), folder / f"curve_{seed}.csv")
    about = {"algo": algo, "name": name, "seed": seed, "steps": model.num_timesteps}
    export_policy(model, env.unwrapped, folder / f"policy_{seed}.npz", about)
    return validations.rows


def scores(controllers, purpose, count, jobs):
    """Return {controller: score on the suite above_rated}, with `count` seeds of a purpose for each case.

    purpose None: the seeds of the suite. A controller with lost runs has the score that counts them.
    """
    suite = read_suite("above_rated")
    if purpose is not None:
        suite = replace(suite, seeds=seeds_for(purpose, FIRST_SEED + 100, count))
    table = evaluate(controllers, suite, jobs=jobs)
    board = leaderboard(table, baseline=None, score=suite.score)
    return {entry["controller"]: (entry["score"]["mean"], entry["lost"]) for entry in board["controllers"]}


def main(
    out: Annotated[Path, typer.Option(help="Folder of the results.")],
    name: Annotated[str, typer.Option(help="Name of the environment.")] = EASY,
    steps: Annotated[int, typer.Option(help="Decisions of a training.")] = 100_000,
    seeds: Annotated[int, typer.Option(help="Number of seeds: 0, 1, ...")] = 5,
    algo: Annotated[str, typer.Option(help="ppo, sac or tqc of stable-baselines3.")] = "ppo",
    jobs: Annotated[int, typer.Option(help="Processes side by side.")] = 5,
    purpose: Annotated[
        str, typer.Option(help=f"Seeds of the suite: {', '.join(PURPOSES)} or suite.")
    ] = "suite",
    scored: Annotated[bool, typer.Option(help="Whether the policies run the suite at the end.")] = True,
):
    """Train several seeds side by side, validate and score them."""
    out.mkdir(parents=True, exist_ok=True)
    zero = returns(name, lambda seen: np.zeros((len(seen), *gymnasium.make(name).action_space.shape))).mean()
    print(f"zero action: {zero:.4f} a decision", flush=True)
    env = gymnasium.make(name)  # compiles once what every process loads
    env.reset(seed=0)
    env.step(env.action_space.sample())
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        each = list(pool.map(partial(trained, name=name, steps=steps, folder=out, algo=algo), range(seeds)))
    table = pd.DataFrame([row for rows in each for row in rows])
    write_table(table, out / "validation.csv")
    plot(table, zero, name, out / "curve.png")
    last = table.groupby("seed")["reward"].last()
    above = int((last > zero).sum())
    verdict = {
        "zero": float(zero),
        "rewards": last.tolist(),
        "above_zero": f"{above} of {seeds}",
        "seconds": float(table["seconds"].max()),
    }
    if scored:
        policies = {f"seed {seed}": f"policy:{out / f'policy_{seed}.npz'}" for seed in range(seeds)}
        chosen = None if purpose == "suite" else purpose
        found = scores(policies | {"gspi_oc3": "gspi_oc3", "pi": "pi"}, chosen, 2, jobs)
        write_table(
            pd.DataFrame([{"controller": k, "score": s, "lost": n} for k, (s, n) in found.items()]),
            out / "scores.csv",
        )
        below = sum(found[label][0] < SCORE for label in policies)
        verdict |= {
            "scores": {label: found[label][0] for label in policies},
            "below_0.9": f"{below} of {seeds}",
            "met": above == seeds and below >= seeds - 1,
        }
    with replacing(out / "verdict.json") as path:
        path.write_text(json.dumps(verdict, indent=1), encoding="utf-8")
    print(json.dumps(verdict, indent=1))


def plot(table, zero, name, path):
    """Plot the validation reward of each seed over the steps, with that of zero action."""
    from fowt_env.visual.style import COLOURS, new_figure, save_figure, style_axes

    figure = new_figure(6.0, 3.5)
    axis = figure.subplots()
    for i, (seed, rows) in enumerate(table.groupby("seed")):
        colour = COLOURS[i % len(COLOURS)]
        axis.plot(rows["steps"] / 1e3, rows["reward"], marker=".", color=colour, label=f"seed {seed}")
    axis.axhline(zero, color="0.5", linestyle="--", label="zero action")
    axis.set_xlabel("decisions (thousands)")
    axis.set_ylabel(f"reward of a decision\n{name.partition('/')[2]}")
    axis.legend(fontsize=7)
    style_axes(axis)
    save_figure(figure, path)


if __name__ == "__main__":
    typer.run(main)
