"""Draws learning curves of PPO with default settings on the ladder of tasks, by two implementations.

    python -m fowt_env.training.studies.learning_curves --out runs/curves --script examples/18_cleanrl_ppo.py

PPO("MlpPolicy", ...) of stable-baselines3, and the PPO of a script: a file with arguments(words) and
train(arguments, watch). At 0, 25, 50, 75 and 100 % of the decisions the deterministic policy runs the
validation episodes of the task (acceptance.py). The folder has validation.csv, to which every training adds
its rows (a repeated call makes only those that are missing), and curves.png.
"""

import runpy
from pathlib import Path
from typing import Annotated

import gymnasium
import numpy as np
import pandas as pd
import typer

from fowt_env.files.tables import write_table
from fowt_env.registration import LADDER, SOLVED
from fowt_env.training.studies.acceptance import Validations, learned, returns

SB3, SINGLE_FILE = "stable-baselines3", "CleanRL's settings"
KEYS = ["name", "implementation", "seed"]  # columns that tell trainings apart
ACROSS = 4  # panels of a row of the figure


def validated(name, implementation, seed, steps, script=None):
    """Train a seed of an implementation of PPO on a task; return the rows of its validations.

    script: path of the file of SINGLE_FILE.
    """
    validations = Validations(name, seed, steps)
    if implementation == SB3:
        learned(seed, name, steps, "ppo", validations)
    else:
        script = runpy.run_path(str(script))
        given = ("--env-id", name, "--seed", str(seed), "--total-timesteps", str(steps))
        made = []
        policy, _ = script["train"](
            script["arguments"](given),
            lambda done, policy: (made.append(done), validations.due(done, policy)),
        )
        validations.now(made[-1], policy)
    return [{"name": name, "implementation": implementation} | row for row in validations.rows]


def main(
    out: Annotated[Path, typer.Option(help="Folder of the results.")],
    names: Annotated[list[str] | None, typer.Argument(help="Names of environments; default: all.")] = None,
    steps: Annotated[int, typer.Option(help="Decisions of a training.")] = 50_000,
    seeds: Annotated[int, typer.Option(help="Number of seeds: 0, 1, ...")] = 1,
    script: Annotated[Path | None, typer.Option(help="File with a PPO of its own, also trained.")] = None,
):
    """Train what is missing in the folder, one after the other, and plot all of it."""
    import torch

    torch.set_num_threads(1)
    out.mkdir(parents=True, exist_ok=True)
    path = out / "validation.csv"
    table = pd.read_csv(path) if path.exists() else pd.DataFrame(columns=KEYS)
    made = set(table[KEYS].itertuples(index=False, name=None))
    for name in names or LADDER:
        for implementation in (SB3, SINGLE_FILE)[: 1 if script is None else 2]:
            for seed in range(seeds):
                if (name, implementation, seed) in made:
                    continue
                print(name, implementation, flush=True)
                rows = pd.DataFrame(validated(name, implementation, seed, steps, script))
                table = pd.concat([table, rows], ignore_index=True)
                write_table(table, path)
    plot(table, out / "curves.png")


def zero_action(name):
    """Return the reward of a decision of zero action on the validation episodes."""
    actions = gymnasium.make(name).action_space.shape
    return returns(name, lambda seen: np.zeros((len(seen), *actions))).mean()


def plot(table, path):
    """Plot a panel for each task: validation rewards over the decisions, zero action, and what is solved."""
    from fowt_env.visual.style import COLOURS, head_of, new_figure, save_figure, style_axes

    names = list(dict.fromkeys(table["name"]))
    rows = -(-len(names) // ACROSS)
    figure = new_figure(11.0, 0.4 + 2.6 * rows)
    for i, name in enumerate(names):
        axis = figure.add_subplot(rows, min(ACROSS, len(names)), i + 1)
        of_task = table[table["name"] == name]
        for colour, implementation in zip(COLOURS, (SB3, SINGLE_FILE), strict=False):
            found = of_task[of_task["implementation"] == implementation]
            for number, (_, each) in enumerate(found.groupby("seed")):
                label = None if number else implementation
                axis.plot(each["steps"] / 1e3, each["reward"], marker=".", color=colour, label=label)
        axis.axhline(zero_action(name), color="0.5", linestyle="--", label="zero action")
        if name in SOLVED:
            axis.axhline(SOLVED[name], color="0.5", linestyle=":", label="counted as solved")
        axis.set_title(name.partition("OC3Hywind")[2], fontsize=9)
        axis.set_xlabel("decisions (thousands)", fontsize=8)
        if i % ACROSS == 0:
            axis.set_ylabel("reward of a decision", fontsize=8)
        style_axes(axis)
    head_of(figure, figure.axes, (SB3, SINGLE_FILE, "zero action", "counted as solved"))
    save_figure(figure, path)


if __name__ == "__main__":
    typer.run(main)
