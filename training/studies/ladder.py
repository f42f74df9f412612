"""Tabulates what controllers earn on the ladder of tasks: `python -m fowt_env.training.studies.ladder`.

Rewards of a decision, means over the validation episodes of acceptance.py: of zero action, and of controllers
in the place of the agent, with the sensors, faults, plants and random seeds that the agent meets.
"""

from functools import partial
from typing import Annotated

import gymnasium
import numpy as np
import typer

import fowt_env  # noqa: F401 # registers the environments
from fowt_env.envs import FowtEnv
from fowt_env.files.markdown import markdown_table
from fowt_env.registration import LADDER
from fowt_env.training.rl.randomisation import drawn_plants
from fowt_env.training.studies.acceptance import episodes, returns

LAWS = ("pi", "lqr", "mpc")
AGENT = ("action_mode", "decisions", "normalise", "residual_torque", "residual_pitch")


def earned(name, law):
    """Return the mean reward of a control period of a controller on the validation episodes of a task."""
    settings = {key: value for key, value in LADDER[name].items() if key not in AGENT}
    settings |= {"action_mode": "residual", "baseline": law}
    if LADDER[name]["action_mode"] == "individual_residual":
        settings["pitch"] = "individual"
    weathers = episodes(name)
    if "Unknown" in name:  # a plant for each episode, as in a batch
        envs = [FowtEnv(**settings, **plant) for plant in drawn_plants(len(weathers), 0)]
    else:
        envs = [FowtEnv(**settings)] * len(weathers)
    totals = []
    for seed, (env, options) in enumerate(zip(envs, weathers, strict=True)):
        env.reset(seed=seed, options=options)
        total, ended = 0.0, False
        while not ended:
            _, reward, terminated, truncated, _ = env.step((0.0, 0.0))
            total += reward
            ended = terminated or truncated
        totals.append(total * env.control_dt / env.task.duration)  # an early end forfeits the rest
    return float(np.mean(totals))


def main(
    names: Annotated[list[str] | None, typer.Argument(help="Names of environments; default: all.")] = None,
    laws: Annotated[str, typer.Option(help="Controllers, comma-separated.")] = ",".join(LAWS),
):
    """Print the table."""
    rows = []
    for name in names or LADDER:
        actions = gymnasium.make(name).action_space.shape
        zero = returns(name, lambda seen, actions=actions: np.zeros((len(seen), *actions))).mean()
        values = (zero, *map(partial(earned, name), laws.split(",")))
        rows.append((f"`{name.partition('/')[2]}`", *(f"{value:.3f}" for value in values)))
        print(rows[-1], flush=True)
    print(
        markdown_table(("task", "zero action", *(f"`{law}`" for law in laws.split(","))), rows, aligned=True)
    )


if __name__ == "__main__":
    typer.run(main)
