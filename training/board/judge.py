"""Judging: every submission run anew on the board's suites, every figure computed from the time series.

Submissions bring no results. Controllers of Python files run in processes of their own
(training.board.isolated);
the organiser's secret seeds are in none of the files that the page is made of, but for their number and
the hash
of their file, with which the organiser can prove later which they were.
"""

import hashlib
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.control import make
from fowt_env.errors import InputError
from fowt_env.files.tables import read_table
from fowt_env.scene.build import build_scene
from fowt_env.training.board.folder import Board, read_seeds
from fowt_env.training.board.submission import PYTHON_FILE
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.evaluation.results import run_file
from fowt_env.training.evaluation.results_table import KEY
from fowt_env.training.evaluation.run_case import run_metrics
from fowt_env.weather.wind_field import is_field

RELATIVE = 1e-9  # to which figures computed anew agree with those of the rows


@dataclass
class Judged:
    """What was run: a table of results for each suite, of public and of secret seeds."""

    board: Board
    submissions: list
    public: dict[str, pd.DataFrame]  # suite -> table of evaluate, whose figures are those of the series
    secret: dict[str, pd.DataFrame] = field(default_factory=dict)
    seeds_hash: str = ""  # of the file of secret seeds
    when: str = ""


def judge(board, jobs=1, secret=None, private=None, trust_code=False, progress=None):
    """Judged of all submissions of a Board.

    secret    file of the organiser's seeds, whose runs are kept in the folder `private`
    progress  called as progress(done, total, text)
    Raises: InputError where a Python file is among the submissions and trust_code is not set, where seeds
    are given without a folder for their runs, or where figures differ from those of the series.
    """
    submissions = board.submissions()
    if not submissions:
        raise InputError(f"board {str(board.folder)!r}: has no submissions: fowt leaderboard add FOLDER")
    code = [each.name for each in submissions if each.kind == PYTHON_FILE]
    if code and not trust_code:
        raise InputError(
            f"submissions {', '.join(code)}: hold Python code of their authors, which judging runs: read it,"
            " then give --trust-code (each runs in a process of its own, with this user's rights)"
        )
    if (secret is None) != (private is None):
        raise InputError("secret seeds: need a folder for their runs (--private), which is not the board's")
    if private is not None and Path(private).resolve().is_relative_to(board.folder.resolve()):
        raise InputError(f"private = {str(private)!r}: must lie outside of the board's folder")
    made = Judged(board, submissions, {}, when=time.strftime("%Y-%m-%d"))
    rounds = [(board.settings.seeds, board.folder / "runs", made.public)]
    if secret is not None:
        rounds.append((read_seeds(secret), Path(private), made.secret))
        made.seeds_hash = hashlib.sha256(Path(secret).read_bytes()).hexdigest()
    for seeds, folder, tables in rounds:
        for regime in board.settings.regime:
            for suite in regime.suites:
                tables[suite] = _suite_table(board, submissions, suite, seeds, folder, jobs, progress)
    return made


def _suite_table(board, submissions, name, seeds, folder, jobs, progress):
    """Table of a suite: all submissions, each with its kind of preview."""
    suite = board.suite(name)
    parts = []
    for preview in sorted({each.card.preview for each in submissions}):
        controllers = {
            each.name: each.controller(board.limits) for each in submissions if each.card.preview == preview
        }
        place = Path(folder) / f"{name}-v{suite.version}-{preview}"

        def say(done, total, _, what=f"{name}, {preview}"):
            if progress is not None:
                progress(done, total, f"{what}: {done} of {total} runs")

        options = {} if preview == "exact" else {"preview": preview}
        table = evaluate(controllers, suite, seeds=seeds, jobs=jobs, folder=place, progress=say, **options)
        table = table[table["controller"].isin(controllers)]
        check_figures(table, place, suite)
        parts.append(table)
    return pd.concat(parts, ignore_index=True)


def check_figures(table, folder, suite):
    """Raises: InputError where figures of a table are not those of the time series of its runs."""
    cases = {case.name: case for case in suite.cases}
    scenes = {}  # what the metrics take of one, turbine and mean wind, is the same for all runs of a case
    for place in np.flatnonzero(table["status"] != "failed"):
        row = table.iloc[place]
        case = cases[row["case"]]
        if case.name not in scenes:
            wind = None if is_field(case.wind) else case.wind  # a box takes minutes and rests nowhere
            scenes[case.name] = build_scene(case.platform, wind=wind, sea=case.sea, **case.options)
        frame = read_table(run_file(Path(folder) / "runs", *row[list(KEY)]))
        skip = suite.skip if case.skip is None else case.skip
        figures = run_metrics(frame, case, scenes[case.name], skip)
        for metric in METRICS:
            old, new = float(row[metric]), float(figures[metric])
            if not np.isclose(old, new, rtol=RELATIVE, atol=1e-12, equal_nan=True):
                raise InputError(
                    f"results {str(folder)!r}: {metric} of {', '.join(map(str, row[list(KEY)]))} is"
                    f" {old:.10g} in the table and {new:.10g} from its series: remove the folder and judge"
                    " again"
                )


def inputs_of(submission, turbine):
    """What a submission is given: its declared inputs, or those of the built-in controller or policy."""
    if submission.kind == PYTHON_FILE:
        return tuple(submission.card.information)
    return tuple(make(submission.controller(None), turbine, 0.1).information)


def package_version():
    """What the runs were made with."""
    return f"fowt_env {fowt_env.__version__}"
