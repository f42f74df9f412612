"""Copies the best policy of a training run to controllers/policy/agents, as .npz and card.

python -m fowt_env.training.studies.publish_agent runs/above_rated_ppo_1 ppo_lqr --machine "two cores"
"""

import json
import shutil
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer
import yaml

from fowt_env.controllers import information
from fowt_env.controllers.policy.controller import AGENTS, read_policy
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.training.rl.settings import REFERENCE
from fowt_env.training.rl.train import resolve

LARGEST_FILE = 200_000  # bytes, limit of a policy in the repository


def changes_of(here, there, prefix=""):
    """Return {dotted key: value} of nested settings in `here` that `there` lacks or has otherwise."""
    changes = {}
    for key, value in here.items():
        if isinstance(value, dict) and isinstance(there.get(key), dict):
            changes |= changes_of(value, there[key], f"{prefix}{key}.")
        elif key not in there or there[key] != value:
            changes[prefix + key] = value
    return changes


def training_command(settings):
    """Return the command line that repeats a run, with changes from the current YAML of the algorithm."""
    now = resolve(settings["algo"], settings["name"], settings["seed"], settings["steps"])
    changes = changes_of(settings, now)
    return (
        f"fowt train --algo {settings['algo']} --task {settings['name']} --seed {settings['seed']}"
        f" --steps {settings['steps']}"
    ) + "".join(f" --set '{key}={json.dumps(value)}'" for key, value in changes.items())


def publish(folder, name, machine):
    """Write policy and card of the best validation of a run and return their paths. Raises: InputError."""
    folder = Path(folder)
    policy, table = folder / "best.npz", folder / "validation.csv"
    if not policy.is_file() or not table.is_file():
        raise InputError(f"{folder}: has no best.npz and validation.csv of a run")
    if policy.stat().st_size > LARGEST_FILE:
        raise InputError(f"{policy}: {policy.stat().st_size} bytes; at most {LARGEST_FILE} are allowed")
    settings = yaml.safe_load((folder / "settings.yml").read_text(encoding="utf-8"))
    rows = pd.read_csv(table)
    about = read_policy(policy)[0]["about"]
    best = rows.loc[rows["score"].idxmin()]
    versions = json.loads((folder / "versions.json").read_text(encoding="utf-8"))
    known = information(f"policy:{policy}")
    reference = settings["validation"].get("reference", REFERENCE)
    lines = [
        f"command = {json.dumps(training_command(settings))}",
        f"seed = {settings['seed']}",
        f"decisions = {about['steps']}  # of the policy that was kept",
        f"decisions_trained = {int(rows['decisions'].iloc[-1])}",
        f"wall_time = {float(rows['seconds'].iloc[-1]):.0f}  # s, of the run up to its last validation",
        f"machine = {json.dumps(machine)}",
        f"information = {json.dumps(list(known))}",
        f"history = {settings['decisions']['history']}  # earlier decision instants it remembers",
        "",
        f"[validation]  # ratios to {reference}, means over the validation episodes",
        *(f"{key} = {float(best[key]):.4f}" for key in rows.columns if key not in ("decisions", "seconds")),
        "",
        "[versions]",
        *(f"{json.dumps(key)} = {json.dumps(str(value))}" for key, value in versions.items()),
    ]
    target, card = AGENTS / f"{name}.npz", AGENTS / f"{name}.toml"
    with replacing(target) as temporary:
        shutil.copyfile(policy, temporary)
    with replacing(card) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return target, card


def main(folder: str, name: str, machine: Annotated[str, typer.Option(help="Kind of machine of the run.")]):
    """Copy the best policy of a training run, with its card, to the shipped agents."""
    for path in publish(folder, name, machine):
        print(path)


if __name__ == "__main__":
    typer.run(main)
