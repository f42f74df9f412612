"""Any controllers on any cases, judged alike: one table of metrics.

    from training.evaluate import evaluate
    table = evaluate(["pi", "pi_land"], "above_rated", seeds=(1, 2), jobs=2)

Every controller meets the same wind and waves: a (case, seed) is one realisation. A run that fails
is a row with its reason, and the others go on. With jobs > 1 a script needs the usual
`if __name__ == "__main__":` guard, since worker processes import it.
"""

import csv
import multiprocessing
import pickle
import re
import signal
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from math import degrees
from pathlib import Path

import pandas as pd

import fowt_env
from fowt_env.errors import ControllerError, InputError, SimulationStopped
from fowt_env.outputs import write_table
from fowt_env.warmup import kernels_compiled
from training.cases import Case, named_cases
from training.metrics import METRICS, metrics

__all__ = ["COLUMNS", "Case", "evaluate", "metrics", "named_cases", "summary"]

SHORTEST_WEATHER = 700.0  # s of wind and waves: shorter runs see the start of the same realisation
COLUMNS = ("controller", "case", "seed", "status", "reason", "stopped_[s]", "scored_[s]", *METRICS)


@dataclass(frozen=True)
class Run:
    """One controller on one realisation of one case."""

    label: str
    controller: object  # name or object, as simulate takes it
    case: Case
    seed: int
    duration: float
    skip: float
    options: dict  # further options of simulate
    frame_path: Path | None  # where the time series goes


def evaluate(
    controllers,
    cases="above_rated",
    duration=660.0,
    skip=60.0,
    seeds=(1,),
    jobs=1,
    progress=None,
    out=None,
    runs_folder=None,
    **options,
):
    """DataFrame with one row per controller, case and seed, and the columns COLUMNS.

    controllers   names (a sequence, or one string with commas), or {label: name or controller object}
    cases         Cases, or names of cases and suites (training.cases)
    duration      length of each run, s, of which the first `skip` seconds are not scored
    seeds         one realisation of wind and waves each, the same for all controllers
    jobs          worker processes
    progress      called as progress(done, total, row) after each run (row None: before the first)
    out           CSV file: a row is appended as soon as its run ends; sorted at the end
    runs_folder   folder for the time series, <controller>/<case>_seed<n>.parquet
    options       further options of simulate: dt, control_dt, output_dt, start
    Failed runs have status "failed", the reason, and NaN metrics.
    Raises: InputError for settings that no run could use.
    """
    runs = _plan(controllers, cases, duration, skip, seeds, runs_folder, options)
    if jobs < 1:
        raise InputError(f"jobs = {jobs}: must be at least 1")
    if progress is not None:
        progress(0, len(runs), None)
    rows = {}
    with _RowFile(out) as row_file:
        for index, row in _rows(runs, min(jobs, len(runs))):
            rows[index] = row
            row_file.append(row)
            if progress is not None:
                progress(len(rows), len(runs), row)
    table = pd.DataFrame([rows[index] for index in sorted(rows)], columns=list(COLUMNS))
    if out is not None:
        write_table(table, out)
    return table


def _plan(controllers, cases, duration, skip, seeds, runs_folder, options):
    """The Runs of an evaluation, case by case, so that an interrupted one compares what it has."""
    if isinstance(controllers, str):
        controllers = [name.strip() for name in controllers.split(",") if name.strip()]
    if not isinstance(controllers, dict):
        controllers = {name if isinstance(name, str) else type(name).__name__: name for name in controllers}
    if isinstance(cases, Case):
        cases = [cases]
    if isinstance(cases, str) or all(isinstance(case, str) for case in cases):
        cases = named_cases(cases)
    if not all(isinstance(case, Case) for case in cases):
        raise InputError("cases: must be names or Case objects, not a mixture with anything else")
    seeds = [int(seed) for seed in seeds]
    for what, given in (("controllers", controllers), ("cases", cases), ("seeds", seeds)):
        if not given:
            raise InputError(f"{what}: at least one is needed")
    if len(set(seeds)) < len(seeds) or len({case.name for case in cases}) < len(cases):
        raise InputError("seeds and names of cases must differ from each other")
    if not duration > skip >= 0.0:
        raise InputError(f"skip = {skip} s: must be at least 0 and below duration = {duration} s")
    return [
        Run(
            label,
            controller,
            case,
            seed,
            float(duration),
            float(skip),
            dict(options),
            None if runs_folder is None else run_file(runs_folder, label, case.name, seed),
        )
        for case in cases
        for seed in seeds
        for label, controller in controllers.items()
    ]


def run_file(folder, label, case, seed):
    """Path of a run's time series; characters that files cannot or should not bear become _."""
    safe = [re.sub(r"[^\w.-]", "_", text) for text in (label, case)]
    return Path(folder) / safe[0] / f"{safe[1]}_seed{seed}.parquet"


def _rows(runs, jobs):
    """Yield (index, row) of each run as it ends."""
    first = 0
    if jobs == 1 or not kernels_compiled():
        # one process fills the kernel cache, instead of every worker compiling the same
        first = len(runs) if jobs == 1 else 1
        for index, run in enumerate(runs[:first]):
            yield index, score(run)
    if first < len(runs):
        yield from _parallel_rows(runs, range(first, len(runs)), jobs)


def _parallel_rows(runs, indices, jobs):
    """Yield (index, row) from worker processes; they are stopped if the caller is interrupted."""
    try:
        pickle.dumps(runs)
    except Exception as error:
        raise InputError(
            f"jobs = {jobs}: a controller or case cannot be sent to a worker process ({error}); use jobs=1"
        ) from error
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")  # forking a process that runs numba threads is unsafe
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_leave_interrupts_to_the_parent)
    try:
        futures = {pool.submit(score, runs[index]): index for index in indices}
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    pool.shutdown()


def _leave_interrupts_to_the_parent():
    """Ctrl-C reaches every process of the terminal; the parent alone decides what is saved."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def score(run):
    """Row {column: value} of one run; a run that fails gives its reason instead of metrics."""
    row = dict.fromkeys(COLUMNS, float("nan"))
    row |= {"controller": run.label, "case": run.case.name, "seed": run.seed, "status": "ok", "reason": ""}
    row["scored_[s]"] = run.duration - run.skip
    case = run.case
    options = {"duration": max(SHORTEST_WEATHER, run.duration), **case.options}
    scene = fowt_env.build_scene(case.platform, wind=case.wind, sea=case.sea, seed=run.seed, **options)
    try:
        frame = fowt_env.simulate(scene, controller=run.controller, duration=run.duration, **run.options)
        row |= metrics(frame, run.skip, degrees(scene.turbine.rated_rotor_speed) / 6.0)
    except InputError:
        raise
    except Exception as error:  # whatever a user's controller raises costs its run, not the evaluation
        frame = getattr(error, "frame", None)
        stopped = getattr(error, "time", float("nan"))
        row |= {"status": "failed", "reason": _reason(error), "stopped_[s]": stopped}
    if run.frame_path is not None and frame is not None:
        write_table(frame, run.frame_path)
    return row


def _reason(error):
    """One line that says why a run failed."""
    if isinstance(error, SimulationStopped):
        return str(error.reason)
    if isinstance(error, ControllerError):
        return str(error)
    return f"{type(error).__name__}: {error}"


def _cell(value):
    """Text of a table entry: NaN is empty, floats have 10 digits."""
    if isinstance(value, float):
        return "" if value != value else f"{value:.10g}"
    return value


class _RowFile:
    """CSV file that grows by one complete line per finished run; does nothing without a path."""

    def __init__(self, path):
        self.path = None if path is None else Path(path)
        if self.path is not None and self.path.suffix.lower() != ".csv":
            raise InputError(f"evaluation table {str(path)!r}: must end with .csv")

    def __enter__(self):
        if self.path is not None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.file = self.path.open("w", newline="", encoding="utf-8")
            self.writer = csv.DictWriter(self.file, COLUMNS)
            self.writer.writeheader()
        return self

    def append(self, row):
        if self.path is not None:
            self.writer.writerow({name: _cell(value) for name, value in row.items()})
            self.file.flush()

    def __exit__(self, *exception):
        if self.path is not None:
            self.file.close()


def summary(table):
    """DataFrame by controller and case: runs, failures, and each metric's mean over the successful seeds."""
    good = table.copy()
    good.loc[good["status"] != "ok", list(METRICS)] = float("nan")
    groups = good.groupby(["controller", "case"], sort=False)
    counts = groups["status"].agg(runs="size", failed=lambda status: int((status != "ok").sum()))
    return counts.join(groups[list(METRICS)].mean()).reset_index()
