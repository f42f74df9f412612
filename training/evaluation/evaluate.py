"""Evaluates controllers on load cases and returns one table of metrics.

    from fowt_env.training.evaluation.evaluate import evaluate
    table = evaluate(["pi", "pi_land"], "above_rated", seeds=(1, 2), jobs=2)

All controllers run in the same wind and waves: a (case, seed) is one realisation. A failed run has a row with
the reason and does not affect other runs. With jobs > 1 a script needs the usual `if __name__ == "__main__":`
guard, since worker processes import the script.
"""

import socket
import warnings
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd

from fowt_env.controllers import controller_names, make
from fowt_env.descriptions.checks import check_number, check_whole_number, plain_number
from fowt_env.descriptions.platform import turbine_of
from fowt_env.errors import InputError, PlantWarning, level_outside
from fowt_env.files.tables import table_path, write_table
from fowt_env.training.evaluation.cases import Case, Suite, check_sensors, described, named_cases
from fowt_env.training.evaluation.engines import check_engine, outcomes
from fowt_env.training.evaluation.failures import KINDS, known_figures, lost_counts, with_lost_power
from fowt_env.training.evaluation.guard import attempt
from fowt_env.training.evaluation.metrics import EXPONENTS, METRICS, metrics
from fowt_env.training.evaluation.provenance import controller_code, version_gap, versions
from fowt_env.training.evaluation.results import check_name, open_results, run_content, run_file, write_run
from fowt_env.training.evaluation.results_table import KEY
from fowt_env.training.evaluation.run_case import (
    COLUMNS,
    CONTROL_DT,
    PARKED,
    REFERENCE,
    SHORTEST_CASE_WEATHER,
    Run,
    lost_row,
    scored,
)

__all__ = [
    "COLUMNS", "SHORTEST_CASE_WEATHER", "Case", "evaluate", "metrics", "named_cases", "run_file", "summary",
]  # fmt: skip

# cases without a suite file, with default run settings
AD_HOC = Suite("", 0, "", "", "", seeds=(1,), duration=660.0, skip=60.0, cases=())
LARGEST_RUN_SEED = 2**63 - 1  # largest value of an integer column
# s of wall clock: 11 minutes of simulation take 0.05 s with compiled controllers, minutes with slow Python
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
    """Return a DataFrame with one row per controller, case and seed, and the columns COLUMNS.

    controllers   names (a sequence, or one string with commas), or {label: name or controller object}
    cases         a Suite (training.evaluation.cases.read_suite), Cases, or names of cases and suites
    duration      length of each run, s; skip: time at the start that is not scored, s. None: values of the
                  case, else of the Suite, else 660 and 60
    seeds         one realisation of wind and waves each, the same for all controllers. None: as above, else 1
    jobs          worker processes
    progress      called as progress(done, total, row) after each run (row None: before the first)
    out           CSV file: a row is appended when its run ends; sorted at the end
    runs_folder   folder for the time series, <controller>/<case>_seed<n>.parquet
    folder        results folder (results.py) instead of out and runs_folder: finished runs are not repeated,
                  and the returned table is that of the whole folder
    engine        "processes" or "ray" (address: of a running cluster)
    time_limit    wall clock (s) after which a run fails; None: no limit. With jobs = 1 it applies in the main
                  thread only, and not to C code that never returns; with more jobs, the worker is ended
    sensors       name of the sensor chain of all cases, "exact": no sensor errors; None: as in each case
    retry_failed  whether to repeat failed runs of a results folder, also with changed code
    reference     controller whose runs are the reference of scores and limits: a name, True for the Suite's
                  reference (if it has a score or relative limits), False for no reference. Its rows are named
                  "reference"; these runs have no trip and no protection, so that metrics always exist
    options       further options of simulate: dt, control_dt, output_dt, start, preview
    Status of a row: "tripped" if the protection ended the run (metrics until then), "lost power" with less
    than half of the reference's energy (failures.with_lost_power), "failed" with a reason and NaN metrics,
    also for a controller that cannot be prepared, calls sys.exit, or whose worker process dies three times.
    Column events: rare numerical events and their counts; warning: commands that are probably not in N m and
    rad, also issued as a PlantWarning once per controller. A case with a parked turbine has no controller and
    is run once, under the name "parked".
    Raises: InputError for unusable settings.
    """
    check_engine(jobs, engine, address)
    if folder is not None:
        if out is not None or runs_folder is not None:
            raise InputError("folder: contains both table and runs, so out and runs_folder must be None")
        runs_folder = Path(folder) / "runs"
    suite = _suite(cases, sensors)
    controllers = _labelled(controllers)
    if reference := suite.reference if reference is True else reference:
        controllers = {REFERENCE: reference, **controllers}  # first: an interrupted evaluation needs it
    runs = _plan(controllers, suite, duration, skip, seeds, runs_folder, time_limit, options)
    _check_controllers(controllers, runs)
    report = progress or (lambda done, total, row: None)
    if folder is not None:
        again = {run.key for run in runs} if retry_failed else ()
        with open_results(folder, _settings(controllers, runs, suite, options), COLUMNS, again) as results:
            pending = [run for run in runs if run.key not in results.rows]
            _go(pending, len(runs), jobs, report, engine, address, results.add)
            table = results.table()
    else:
        rows = _go(runs, len(runs), jobs, report, engine, address, _appending(out))
        table = pd.DataFrame([rows[run.key] for run in runs], columns=list(COLUMNS))
        table = with_lost_power(table, {run.case.name for run in runs if run.case.fault is not None})
        if out is not None:
            write_table(table, out)
    warned = table[(table["warning"] != "") & table["controller"].isin(list(controllers))]
    for text in warned.groupby("controller", sort=False)["warning"].first():
        warnings.warn(text, PlantWarning, stacklevel=level_outside())
    return table


def planned(
    controllers, cases, duration=None, skip=None, seeds=None, runs_folder=None, sensors=None, **options
):
    """Return the list of Runs of an evaluation with the arguments of evaluate, for `score`."""
    suite = _suite(cases, sensors)
    return _plan(_labelled(controllers), suite, duration, skip, seeds, runs_folder, TIME_LIMIT, options)


def _go(runs, total, jobs, report, engine, address, keep):
    """Execute the runs and return {run key: row}; keep(row) and report are called after each run."""
    before, rows = total - len(runs), {}
    report(before, total, None)
    function = partial(score, here=versions()) if engine == "ray" else score
    limit = runs[0].time_limit if runs else None
    with closing(outcomes(function, runs, jobs, engine, address, limit, _lost)) as ended:
        for index, outcome in ended:
            row = rows[runs[index].key] = stored(runs[index], outcome)
            keep(row)
            report(before + len(rows), total, row)
    return rows


def score(run, here=None):
    """Execute a run and return (row {column: value}, content of the run's file or None), also if it fails.

    here: package versions of the machine that collects the rows, if the run is executed on another machine.
    Raises: InputError if package versions that affect results differ between the machines.
    """
    if here is not None and (gap := version_gap(here, versions())):
        raise InputError(f"engine = 'ray': {gap[0]} here and {gap[1]} at the worker {socket.gethostname()}")
    row, frame = scored(run)
    return row, None if run.frame_path is None else run_content(frame, row)


def _lost(run, reason):
    """Return the outcome, as from `score`, of a run whose worker process ended."""
    row = lost_row(run, reason)
    return row, None if run.frame_path is None else run_content(None, row)


def stored(run, outcome):
    """Write the run's file atomically and return the row of an outcome of `score`."""
    row, content = outcome
    if content is not None:
        write_run(content, run.frame_path)
    return row


def _labelled(controllers):
    """Return {label: controller} of the argument of evaluate."""
    if isinstance(controllers, str):
        controllers = controller_names(controllers)
    if not isinstance(controllers, dict):
        labelled = {}
        for each in controllers:
            name = each if isinstance(each, str) else getattr(each, "__name__", type(each).__name__)
            if name in labelled and not isinstance(each, str):
                raise InputError(f"controllers: two have the name {name!r}: pass {{name: controller}}")
            labelled[name] = each
        controllers = labelled
    for label in controllers:
        check_name("controllers: the name", label)
    for taken, what in ((PARKED, "parked turbines"), (REFERENCE, "the suite's reference")):
        if taken in controllers:
            raise InputError(f"controllers: the name {taken!r} is reserved for {what}")
    return controllers


def _suite(cases, sensors):
    """Return the Suite for arguments of evaluate, with AD_HOC settings for cases without a suite."""
    if isinstance(cases, Case):
        cases = [cases]
    if isinstance(cases, Suite):
        suite = cases
    elif isinstance(cases, str) or all(isinstance(case, str) for case in cases):
        suite = replace(AD_HOC, cases=tuple(named_cases(cases)))
    elif all(isinstance(case, Case) for case in cases):
        suite = replace(AD_HOC, cases=tuple(cases))
    else:
        raise InputError("cases: must be names or Case objects, not a mixture with anything else")
    if sensors is None:
        return suite
    sensors = check_sensors(sensors)
    return replace(suite, cases=tuple(replace(case, sensors=sensors) for case in suite.cases))


def _plan(controllers, suite, duration, skip, seeds, runs_folder, time_limit, options):
    """Return the Runs of an evaluation, case by case, so that runs are comparable after an interruption."""
    if seeds is not None:
        seeds = [_seed(seed) for seed in seeds]
    if time_limit is not None:
        allowed = "a positive number of seconds, or None"
        time_limit = check_number("time_limit", time_limit, 0.0, low_open=True, allowed=allowed)
    for what, values in {"controllers": controllers, "cases": suite.cases, "seeds": seeds}.items():
        if values is not None and not values:
            raise InputError(f"{what}: at least one is needed")
    for values in (seeds or (), [case.name for case in suite.cases]):
        if len(set(values)) < len(values):
            raise InputError("seeds and names of cases must differ from each other")
    runs, files = [], {}
    for case in suite.cases:
        check_name("cases: the name", case.name)
        length = float(_first(duration, case.duration, suite.duration))
        start = float(_first(skip, case.skip, suite.skip))
        if not length > start >= 0.0:
            raise InputError(f"skip = {start} s: must be at least 0 and below duration = {length} s")
        if case.fault is not None and not case.fault.time < length:
            raise InputError(
                f"duration = {length:g} s: the fault of case {case.name!r} occurs at {case.fault.time:g} s"
            )
        # a case with a single seed is deterministic: further seeds would repeat the run
        fixed = case.seeds if case.seeds is not None and len(case.seeds) == 1 else None
        weight = suite.weights.get(case.name, float("nan"))
        for seed in _first(fixed, seeds, case.seeds, suite.seeds):
            for label, controller in ({PARKED: None} if case.parked else controllers).items():
                path = None
                if runs_folder is not None:
                    # a controller or worker may change the working folder
                    path = run_file(Path(runs_folder).absolute(), label, case.name, seed)
                    name, other = files.setdefault(str(path).casefold(), (label, case.name))
                    if (name, other) != (label, case.name):
                        raise InputError(
                            f"controller {name!r} in case {other!r} and controller {label!r} in case"
                            f" {case.name!r} would share the file {path.name!r}: rename one"
                        )
                settings = (label, controller, case, seed, length, start, dict(options), path, time_limit)
                runs.append(Run(*settings, weight))
    return runs


def _seed(value):
    """Return a seed as an int, also from an integral float. Raises: InputError."""
    value = plain_number(value)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return check_whole_number("seeds", value, 0, LARGEST_RUN_SEED)


def _first(*values):
    """Return the first value that is not None."""
    return next(value for value in values if value is not None)


def _check_controllers(controllers, runs):
    """Create each controller once before any run. Raises: InputError if a controller cannot be created."""
    turbine = turbine_of(runs[0].case.platform)
    control_dt = runs[0].options.get("control_dt", CONTROL_DT)
    for controller in controllers.values():
        _, error = attempt(lambda each=controller: make(each, turbine, control_dt), runs[0].time_limit)
        if isinstance(error, InputError):
            raise error
        # any other error is a bug of the controller: its runs fail with the reason


def _settings(controllers, runs, suite, options):
    """Return the settings of an evaluation for its results folder."""
    about = None
    if suite.name:
        keys = ("name", "version", "description", "source", "wind", "left_out")
        about = {key: getattr(suite, key) for key in keys}
        for key in ("score", "site", "limits"):
            part = getattr(suite, key)
            about[key] = None if part is None else part.model_dump()
        about["weights"] = dict(suite.weights)
        about |= {} if suite.drawn is None else {"drawn": dict(suite.drawn)}
    used = dict.fromkeys(run.label for run in runs)
    return {
        "suite": about,
        "options": options,
        "cases": {
            run.case.name: described(run.case) | {"duration": run.duration, "skip": run.skip} for run in runs
        },
        "seeds": sorted({run.seed for run in runs}),
        "controllers": {
            label: {"name": PARKED, "code": ""} if label == PARKED else controller_code(controllers[label])
            for label in used
        },
    }


def _appending(path):
    """Return append(row), which adds a line to a new CSV file (path None: does nothing)."""
    if path is None:
        return lambda row: None
    path = table_path(path, (".csv",), "evaluation table").absolute()
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(columns=list(COLUMNS)).to_csv(path, index=False)
    return lambda row: pd.DataFrame([row], columns=list(COLUMNS)).to_csv(
        path, mode="a", header=False, index=False, float_format="%.10g"
    )


def mean_ratios(table, over, columns):
    """Return a DataFrame by controller: the mean over the runs of each column's ratio to controller `over`.

    NaN if a run of either controller was lost.
    """
    values = known_figures(table, columns).set_index(KEY)[list(columns)].sort_index()
    base, names = values.loc[over], dict.fromkeys(table["controller"])
    return pd.DataFrame({name: (values.loc[name] / base).mean(skipna=False) for name in names}).T


def summary(table):
    """Return a DataFrame by controller and case: runs, lost runs by kind, means of the metrics over seeds.

    Means are over the runs that were not lost, with the exponents of metrics.mean_exponent as in a
    leaderboard; NaN if all were lost.
    """
    known, names = known_figures(table[table["controller"] != REFERENCE]), list(METRICS)
    groups = known.assign(**known[names] ** EXPONENTS).groupby(["controller", "case"], sort=False)
    lost = {name: lambda statuses, name=name: lost_counts(statuses)[name] for name in KINDS}
    counts = groups["status"].agg(runs="size", **lost)
    return counts.join(groups[names].mean() ** (1.0 / EXPONENTS)).reset_index()
