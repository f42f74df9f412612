"""Trains several agents side by side, seeds and combinations of settings, in processes or on Ray.

    from fowt_env.training.rl.side_by_side import members, train_all
    train_all(members("ppo", "above_rated", [0, 1, 2], 600_000, folder="runs/three"), jobs=3)

Each is a Training in a folder of its own. A repeated call continues what was interrupted, from its newest
checkpoint, and keeps what has ended. On a cluster the folder must be one that all machines share.
"""

import itertools
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from fowt_env.errors import InputError
from fowt_env.files.tables import read_table, write_table
from fowt_env.training.evaluation.engines import check_engine, outcomes
from fowt_env.training.rl.settings import read_settings
from fowt_env.training.rl.train import Training, resolve

TABLE = "trainings.csv"  # in the folder of all


class Member(NamedTuple):
    """Holds one training: its folder, resolved settings and the swept ones of them."""

    folder: str
    settings: dict[str, Any]
    swept: dict[str, Any]


def members(algo, task, seeds, steps, changes=None, sweep=None, folder="runs"):
    """Return a Member for each seed and each combination of swept settings.

    changes, sweep: {dotted key: value} as of train.resolve, {dotted key: list of values}; folder: of all.
    Raises: InputError for no seed, a seed or value given twice, a sweep that is not a list, and those of
    resolve.
    """
    sweep = sweep or {}
    for what, values in (("seeds", seeds), *(((f"sweep {key}"), values) for key, values in sweep.items())):
        if not isinstance(values, list | tuple) or not values:
            raise InputError(f"{what} = {values!r}: must be a list of at least one value")
        texts = [str(value) for value in values]
        if len(set(texts)) < len(texts):
            raise InputError(f"{what} = {values!r}: has a value twice")
    found = []
    for values in itertools.product(*sweep.values()):
        swept = dict(zip(sweep, values, strict=True))
        for seed in seeds:
            texts = [f"{key.rpartition('.')[2]}={value}".replace("/", "_") for key, value in swept.items()]
            name = "_".join([*texts, f"seed_{seed}"]).replace(" ", "")
            settings = resolve(algo, task, seed, steps, (changes or {}) | swept)
            found.append(Member(str(Path(folder) / name), settings, swept))
    if len({member.folder for member in found}) < len(found):
        raise InputError("sweep: two settings have the same last word, so that their folders would be one")
    return found


def train_one(member):
    """Train a Member, or continue it; return its row of train_all.

    Raises: InputError if its folder has a run of other settings; KeyboardInterrupt if it was stopped.
    """
    folder = Path(member.folder)
    begun = (folder / "settings.yml").exists()
    if begun and read_settings(folder / "settings.yml") != member.settings:
        raise InputError(f"{folder}: has a run of other settings: needs another folder")
    if not _ended(folder, member.settings["steps"]):
        if not Training(None if begun else member.settings, folder, resume=begun).run():
            raise KeyboardInterrupt  # its checkpoint is written; the other trainings are not begun
    validations = read_table(folder / "validation.csv")
    best = validations.loc[validations["score"].idxmin()]
    own = {"folder": folder.name, "seed": member.settings["seed"]} | member.swept
    return own | {"last": int(validations["decisions"].iloc[-1])} | best.to_dict()


def _ended(folder, steps):
    """Return whether the run in a folder has ended: its last validation and its last policy are there."""
    paths = (folder / "validation.csv", folder / "last.npz")
    return all(path.exists() for path in paths) and read_table(paths[0])["decisions"].iloc[-1] >= steps


def train_all(chosen, jobs=1, engine="processes", address=None, report=None):
    """Train all Members; return a table with a row for each, by score, and write it as TABLE.

    A row has the swept settings, the decisions of the last validation ("last") and the validation of the best
    policy. jobs, engine, address: as of evaluate; report(done, total): called after each.
    Raises: InputError of train_one, for an unknown engine and where Ray does not start.
    """
    check_engine(jobs, engine, address)
    rows, path = {}, Path(chosen[0].folder).parent / TABLE
    for index, row in outcomes(train_one, chosen, jobs, engine, address):
        rows[index] = row
        table = pd.DataFrame([rows[i] for i in sorted(rows)]).sort_values("score", ignore_index=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_table(table, path)
        if report is not None:
            report(len(rows), len(chosen))
    return table
