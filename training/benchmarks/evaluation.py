"""Measures the cost of an evaluation: processor time of a ten-minute case per stage, and of a Ray task."""

import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.engines import outcomes
from fowt_env.training.evaluation.evaluate import planned, score, stored
from fowt_env.training.evaluation.results import read_row

STAGES = ("whole run", "without its file", "reading its row")


def evaluation_cost(count=21, suite="above_rated", controller="pi"):
    """Return a DataFrame of the stages in one process: ms per run, core seconds per 1,000 runs, MB per run.

    count: timed runs, after one run per case for compilation. Raises: InputError for count < 1.
    """
    check_whole_number("count", count, 1)
    chosen = read_suite(suite)
    seeds, spent = range(1, 2 + count // len(chosen.cases)), dict.fromkeys(STAGES, 0.0)

    def timed(stage, call, argument):
        start = time.process_time()
        call(argument)
        spent[stage] += time.process_time() - start

    with tempfile.TemporaryDirectory() as folder:
        runs = planned(controller, chosen, seeds=seeds, runs_folder=folder)
        for run in runs[:: len(seeds)]:
            stored(run, score(run))
        runs = runs[:count]
        for run in runs:
            timed("whole run", lambda run: stored(run, score(run)), run)
            timed("reading its row", read_row, run.frame_path)
        size = np.mean([Path(run.frame_path).stat().st_size for run in runs]) / 1e6
        for run in planned(controller, chosen, seeds=seeds)[:count]:
            timed("without its file", score, run)
    cost = [1e3 * spent[stage] / len(runs) for stage in STAGES]
    columns = {"stage": STAGES, "ms per run": cost, "core seconds per 1,000 runs": cost}
    return pd.DataFrame(columns | {"MB per run": [size, 0.0, size]})


def ray_cost(count=200, controller="pi", suite="above_rated"):
    """Return a DataFrame (what, wall ms per task) of a local Ray worker. Raises: InputError without Ray."""
    chosen = read_suite(suite)
    with tempfile.TemporaryDirectory() as folder:
        _, content = score(planned(controller, chosen, seeds=(1,), runs_folder=folder)[0])
    rows = []
    full = f"a task that returns {len(content) / 1e6:.1f} MB"
    for what, size in (("an empty task", 0), (full, len(content))):
        times = [time.perf_counter()]
        for _ in outcomes(bytes, [size] * count, jobs=1, engine="ray"):
            times.append(time.perf_counter())
        # the first results include the start of the cluster
        settled = times[len(times) // 4 :]
        rows.append({"what": what, "ms per task": 1e3 * (settled[-1] - settled[0]) / (len(settled) - 1)})
    return pd.DataFrame(rows)
