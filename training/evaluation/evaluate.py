"""Any controllers on any cases, measured alike: one table of metrics.

    from fowt_env.training.evaluation.evaluate import evaluate
    table = evaluate(["pi", "pi_land"], "above_rated", seeds=(1, 2), jobs=2)

Every controller meets the same wind and waves: a (case, seed) is one realisation. A run that fails
is a row with its reason, and the others go on. With jobs > 1 a script needs the usual
`if __name__ == "__main__":` guard, since worker processes import it.
"""

import csv
import io
import socket
import warnings
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq

import fowt_env
from fowt_env.controllers import make
from fowt_env.descriptions.checks import check_number, check_whole_number, plain_number
from fowt_env.errors import InputError, PlantWarning, level_outside
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.cases import Case, Suite, check_sensors, described, named_cases
from fowt_env.training.evaluation.engines import outcomes
from fowt_env.training.evaluation.failures import KINDS, known_figures, lost_counts, with_lost_power
from fowt_env.training.evaluation.faults import PARKED
from fowt_env.training.evaluation.guard import attempt
from fowt_env.training.evaluation.metrics import METRICS, metrics
from fowt_env.training.evaluation.provenance import controller_code, version_gap, versions
from fowt_env.training.evaluation.results import check_name, open_results, parquet_of, run_file, write_run
from fowt_env.training.evaluation.results_table import KEY
from fowt_env.training.evaluation.run_case import (
    COLUMNS,
    CONTROL_DT,
    REFERENCE,
    SHORTEST_CASE_WEATHER,
    Run,
    lost_row,
    scored,
)

__all__ = [
    "COLUMNS", "SHORTEST_CASE_WEATHER", "Case", "evaluate", "metrics", "named_cases", "run_file", "summary",
]  # fmt: skip

DURATION, SKIP, SEEDS = 660.0, 60.0, (1,)  # where neither the caller nor a suite says otherwise
LARGEST_RUN_SEED = 2**63 - 1  # of a column of whole numbers
# s of wall clock: a run of eleven minutes takes 0.05 s with compiled laws and some minutes with slow Python
TIME_LIMIT = 3600.0


def evaluate(
    controllers,
    cases="above_rated",
    duration=None,
    skip=None,
    seeds=None,
    jobs=1,
    progress=None,
    out=None,
    runs_folder=None,
    folder=None,
    engine="processes",
    address=None,
    time_limit=TIME_LIMIT,
    sensors=None,
    retry_failed=False,
    reference=True,
    **options,
):
    """DataFrame with one row per controller, case and seed, and the columns COLUMNS.

    controllers   names (a sequence, or one string with commas), or {label: name or controller object}
    cases         a Suite (training.evaluation.cases.read_suite), Cases, or names of cases and suites
    duration      length of each run, s, of which the first `skip` seconds are not scored. None: those of the
                  case, else of the Suite, else 660 and 60
    seeds         one realisation of wind and waves each, the same for all controllers. None: as above, else 1
    jobs          worker processes
    progress      called as progress(done, total, row) after each run (row None: before the first)
    out           CSV file: a row is appended as soon as its run ends; sorted at the end
    runs_folder   folder for the time series, <controller>/<case>_seed<n>.parquet
    folder        results folder (results.py) instead of out and runs_folder: what is done in it is not
                  done again, and the table is that of the whole folder
    engine        "processes" or "ray" (address: of a running cluster)
    time_limit    seconds of wall clock after which a run fails; None: none. With jobs = 1 it is heard in the
                  main thread alone, and not by C code that never returns; with more, the worker is ended
    sensors       name of the sensor chain of all cases, "exact" for none; None: each case's own
    retry_failed  whether failed runs of a results folder are done again, also with changed code
    reference     whose runs are the reference of scores and limits: the name of a controller, True for that
                  of the Suite (none without a score or relative limits), False for none. They are done as
                  rows of the name "reference", without trip and protection, so that they have figures
    options       further options of simulate: dt, control_dt, output_dt, start, preview
    A run that the protection ended (the case's trip) has status "tripped", the reason, and metrics of what it
    was; one with less than half of the energy of the reference "lost power" (failures.with_lost_power).
    Failed runs have status "failed", the reason, and NaN metrics; so have those of a controller that cannot
    be prepared, as where its library is missing, that calls sys.exit, or whose worker process dies three
    times.
    Column events: rare numerical events of the run and how often each came; warning: of commands that can
    hardly be in N m and rad, which is also given (PlantWarning) once per controller. A parked turbine has no
    controller: such a case is run once, under the name "parked".
    Raises: InputError for settings that no run could use.
    """
    if folder is not None:
        if out is not None or runs_folder is not None:
            raise InputError("folder: holds the table and the runs, so out and runs_folder must be None")
        runs_folder = Path(folder) / "runs"
    controllers = _labelled(controllers)
    suite = cases if isinstance(cases, Suite) else None
    if reference is True:
        reference = suite.reference if suite is not None else None
    if reference:
        controllers = {REFERENCE: reference, **controllers}  # first, so that an interrupted one has it
    given = (duration, skip, seeds, runs_folder, time_limit)
    runs = _plan(controllers, _sensed(_case_list(cases), sensors), suite, *given, options)
    _check_controllers(controllers, runs)
    if folder is not None:
        again = {run.key for run in runs} if retry_failed else ()
        with open_results(folder, _settings(controllers, runs, suite, options), COLUMNS, again) as results:
            pending = [run for run in runs if run.key not in results.rows]
            _go(pending, len(runs), jobs, progress, engine, address, results.add)
            table = results.table()
        _warn(table, controllers)
        return table
    with _RowFile(out) as row_file:
        rows = _go(runs, len(runs), jobs, progress, engine, address, row_file.append)
    table = pd.DataFrame([rows[run.key] for run in runs], columns=list(COLUMNS))
    table = with_lost_power(table, {run.case.name for run in runs if run.case.fault is not None})
    _warn(table, controllers)
    if out is not None:
        write_table(table, out)
    return table


def _warn(table, controllers):
    """Warn (PlantWarning) once of each of the controllers whose runs were warned of."""
    warned = table[(table["warning"] != "") & table["controller"].isin(list(controllers))]
    for text in warned.groupby("controller", sort=False)["warning"].first():
        warnings.warn(text, PlantWarning, stacklevel=level_outside())


def planned(
    controllers, cases, duration=None, skip=None, seeds=None, runs_folder=None, sensors=None, **options
):
    """List of the Runs that evaluate would make of these arguments, for score."""
    suite = cases if isinstance(cases, Suite) else None
    given = (duration, skip, seeds, runs_folder, TIME_LIMIT)
    return _plan(_labelled(controllers), _sensed(_case_list(cases), sensors), suite, *given, options)


def _go(runs, total, jobs, progress, engine, address, keep):
    """{run key: row} of the runs; keep(row) and progress are called as each ends."""
    report = progress or (lambda done, total, row: None)
    before = total - len(runs)
    report(before, total, None)
    rows = {}
    collect = engine == "ray"  # workers may be on machines that do not share this one's disk
    here = versions()
    function, lost = (partial(score_and_send, here=here), _lost_and_sent) if collect else (score, _lost)
    limit = runs[0].time_limit if runs else None
    with closing(outcomes(function, runs, jobs, engine, address, limit, lost)) as ended:
        for index, outcome in ended:
            row, content = outcome if collect else (outcome, None)
            if content is not None:
                with replacing(runs[index].frame_path) as temporary:
                    temporary.write_bytes(content)
            rows[runs[index].key] = row
            keep(row)
            report(before + len(rows), total, row)
    return rows


def _labelled(controllers):
    """{label: controller} of what evaluate takes."""
    if isinstance(controllers, str):
        controllers = [name.strip() for name in controllers.split(",") if name.strip()]
    if not isinstance(controllers, dict):
        labelled = {}
        for given in controllers:
            name = given if isinstance(given, str) else getattr(given, "__name__", type(given).__name__)
            if name in labelled and not isinstance(given, str):
                raise InputError(f"controllers: two have the name {name!r}: give {{name: controller}}")
            labelled[name] = given
        controllers = labelled
    for label in controllers:
        check_name("controllers: the name", label)
    for taken, what in ((PARKED, "turbines without one"), (REFERENCE, "the suite's reference")):
        if taken in controllers:
            raise InputError(f"controllers: the name {taken!r} is that of {what}")
    return controllers


def _case_list(cases):
    """List of Cases of what evaluate takes."""
    if isinstance(cases, Suite):
        return list(cases.cases)
    if isinstance(cases, Case):
        return [cases]
    if isinstance(cases, str) or all(isinstance(case, str) for case in cases):
        return named_cases(cases)
    if not all(isinstance(case, Case) for case in cases):
        raise InputError("cases: must be names or Case objects, not a mixture with anything else")
    return list(cases)


def _sensed(cases, sensors):
    """The Cases, with other sensors where they are named. Raises: InputError."""
    return cases if sensors is None else [replace(case, sensors=check_sensors(sensors)) for case in cases]


def _plan(controllers, cases, suite, duration, skip, seeds, runs_folder, time_limit, options):
    """The Runs of an evaluation, case by case, so that an interrupted one compares what it has."""
    if seeds is not None:
        seeds = [_seed(seed) for seed in seeds]
    if time_limit is not None:
        allowed = "a positive number of seconds, or None"
        time_limit = check_number("time_limit", time_limit, 0.0, low_open=True, allowed=allowed)
    if runs_folder is not None:
        runs_folder = Path(runs_folder).absolute()  # of here, wherever a controller or a worker goes
    for what, given in (
        ("controllers", controllers),
        ("cases", cases),
        ("seeds", (1,) if seeds is None else seeds),
    ):
        if not given:
            raise InputError(f"{what}: at least one is needed")
    if len(set(seeds or ())) < len(seeds or ()) or len({case.name for case in cases}) < len(cases):
        raise InputError("seeds and names of cases must differ from each other")
    runs, places, weights = [], {}, (suite and suite.weights) or {}
    for case in cases:
        check_name("cases: the name", case.name)
        length = float(_first(duration, case.duration, suite and suite.duration, DURATION))
        start = float(_first(skip, case.skip, suite and suite.skip, SKIP))
        if not length > start >= 0.0:
            raise InputError(f"skip = {start} s: must be at least 0 and below duration = {length} s")
        if case.fault is not None and not case.fault.time < length:
            raise InputError(
                f"duration = {length:g} s: the fault of case {case.name!r} comes at {case.fault.time:g} s"
            )
        # nothing is random in a case with its own single seed: more would be the same run again
        chosen = case.seeds if case.seeds is not None and len(case.seeds) == 1 else None
        for seed in _first(chosen, seeds, case.seeds, suite and suite.seeds, SEEDS):
            for label, controller in ({PARKED: None} if case.parked else controllers).items():
                path = None if runs_folder is None else run_file(runs_folder, label, case.name, seed)
                weight = weights.get(case.name, float("nan"))
                given = (label, controller, case, seed, length, start, dict(options), path, time_limit)
                run = Run(*given, weight)
                other = places.setdefault(str(path).casefold(), run)
                if path is not None and other is not run:
                    raise InputError(
                        f"controller {other.label!r} in case {other.case.name!r} and controller {label!r} in"
                        f" case {case.name!r} would have one file, {path.name!r}: give one another name"
                    )
                runs.append(run)
    return runs


def _seed(value):
    """A seed as an int; a float that is whole counts as one. Raises: InputError."""
    value = plain_number(value)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return check_whole_number("seeds", value, 0, LARGEST_RUN_SEED)


def _first(*values):
    """The first value that is not None."""
    return next(value for value in values if value is not None)


def _check_controllers(controllers, runs):
    """Raises: InputError for a controller that cannot be made, before anything runs."""
    turbine = fowt_env.build_scene(runs[0].case.platform).turbine
    control_dt = runs[0].options.get("control_dt", CONTROL_DT)
    for controller in controllers.values():
        _, error = attempt(lambda given=controller: make(given, turbine, control_dt), runs[0].time_limit)
        if isinstance(error, InputError):
            raise error
        # any other is a bug of the user's: its runs fail with the reason, the others go on


def _settings(controllers, runs, suite, options):
    """What a results folder has to know about an evaluation."""
    cases, labels = {}, {}
    for run in runs:
        cases[run.case.name] = described(run.case) | {"duration": run.duration, "skip": run.skip}
        labels[run.label] = None
    about = None
    if suite is not None:
        keys = ("name", "version", "description", "source", "wind", "left_out")
        about = {key: getattr(suite, key) for key in keys}
        for key in ("score", "site", "limits"):
            part = getattr(suite, key)
            about[key] = None if part is None else part.model_dump()
        about["weights"] = dict(suite.weights)
        if suite.drawn is not None:
            about["drawn"] = dict(suite.drawn)
    return {
        "suite": about,
        "options": options,
        "cases": cases,
        "seeds": sorted({run.seed for run in runs}),
        "controllers": {
            label: {"name": PARKED, "code": ""} if label == PARKED else controller_code(controllers[label])
            for label in labels
        },
    }


def score(run):
    """Row {column: value} of one run; a run that fails gives its reason instead of metrics."""
    row, frame = scored(run)
    if run.frame_path is not None:
        write_run(frame, row, run.frame_path)
    return row


def score_and_send(run, here=None):
    """(row, content of the run's file or None): score for a worker on another machine.

    here: versions of the machine that collects the runs, or None.
    Raises: InputError where this machine has others, which would not give the same bits.
    """
    if here is not None and (gap := version_gap(here, versions())):
        raise InputError(f"engine = 'ray': {gap[0]} here and {gap[1]} at the worker {socket.gethostname()}")
    return _sent(run, *scored(run))


def _lost(run, reason):
    """Row of a run whose worker ended, with its file."""
    row = lost_row(run, reason)
    if run.frame_path is not None:
        write_run(None, row, run.frame_path)
    return row


def _lost_and_sent(run, reason):
    """What score_and_send would return of a run whose worker ended."""
    return _sent(run, lost_row(run, reason), None)


def _sent(run, row, frame):
    """(row, content of the run's file or None)."""
    if run.frame_path is None:
        return row, None
    content = io.BytesIO()
    pq.write_table(parquet_of(frame, row), content)
    return row, content.getvalue()


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


def mean_ratios(table, over, columns):
    """DataFrame by controller: mean over the runs of each column over what controller `over` has in the same.

    NaN where a run of either was lost.
    """
    values = known_figures(table, columns).set_index(KEY)[list(columns)].sort_index()
    base, names = values.loc[over], dict.fromkeys(table["controller"])
    return pd.DataFrame({name: (values.loc[name] / base).mean(skipna=False) for name in names}).T


def summary(table):
    """DataFrame by controller and case: runs, lost ones by kind, metrics' means over the seeds.

    Means are over the runs that ended well, NaN where there is none.
    """
    groups = known_figures(table[table["controller"] != REFERENCE]).groupby(
        ["controller", "case"], sort=False
    )
    lost = {name: lambda statuses, name=name: lost_counts(statuses)[name] for name in KINDS}
    counts = groups["status"].agg(runs="size", **lost)
    return counts.join(groups[list(METRICS)].mean()).reset_index()
