"""Any controllers on any cases, judged alike: one table of metrics.

    from training.evaluate import evaluate
    table = evaluate(["pi", "pi_land"], "above_rated", seeds=(1, 2), jobs=2)

Every controller meets the same wind and waves: a (case, seed) is one realisation. A run that fails
is a row with its reason, and the others go on. With jobs > 1 a script needs the usual
`if __name__ == "__main__":` guard, since worker processes import it.
"""

import csv
import io
from dataclasses import dataclass
from math import degrees
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq

import fowt_env
from controllers import make
from fowt_env.errors import ControllerError, ControllerInputError, InputError, SimulationStopped
from fowt_env.outputs import replacing, write_table
from fowt_env.weather.wind_field import is_field
from training.cases import Case, Suite, described, named_cases
from training.engines import outcomes
from training.faults import faulted, idling
from training.metrics import METRICS, metrics
from training.results import controller_code, open_results, parquet_of, run_file, write_run
from training.shifts import Unaware, shifted_parts
from training.wind_boxes import cached_box

__all__ = ["COLUMNS", "Case", "evaluate", "metrics", "named_cases", "run_file", "summary"]

DURATION, SKIP, SEEDS = 660.0, 60.0, (1,)  # where neither the caller nor a suite says otherwise
PARKED = "parked"  # what stands for the controller of a parked turbine
CONTROL_DT = 0.1  # s, simulate's own

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

    @property
    def key(self):
        """What tells runs of one evaluation apart."""
        return self.label, self.case.name, self.seed


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
    **options,
):
    """DataFrame with one row per controller, case and seed, and the columns COLUMNS.

    controllers   names (a sequence, or one string with commas), or {label: name or controller object}
    cases         a Suite (training.cases.read_suite), Cases, or names of cases and suites
    duration      length of each run, s, of which the first `skip` seconds are not scored. None: those of the
                  case, else of the Suite, else 660 and 60
    seeds         one realisation of wind and waves each, the same for all controllers. None: as above, else 1
    jobs          worker processes
    progress      called as progress(done, total, row) after each run (row None: before the first)
    out           CSV file: a row is appended as soon as its run ends; sorted at the end
    runs_folder   folder for the time series, <controller>/<case>_seed<n>.parquet
    folder        results folder (training.results) instead of out and runs_folder: what is done in it is not
                  done again, and the table is that of the whole folder
    engine        "processes" or "ray" (address: of a running cluster)
    options       further options of simulate: dt, control_dt, output_dt, start
    Failed runs have status "failed", the reason, and NaN metrics; so have those of a controller that cannot
    be prepared, as where its library is missing. A parked turbine has no controller: such a
    case is run once, under the name "parked".
    Raises: InputError for settings that no run could use.
    """
    if folder is not None:
        if out is not None or runs_folder is not None:
            raise InputError("folder: holds the table and the runs, so out and runs_folder must be None")
        runs_folder = Path(folder) / "runs"
    controllers = _labelled(controllers)
    suite = cases if isinstance(cases, Suite) else None
    runs = _plan(controllers, _case_list(cases), suite, duration, skip, seeds, runs_folder, options)
    _check_controllers(controllers, runs)
    if folder is not None:
        with open_results(folder, _settings(controllers, runs, suite, options), COLUMNS) as results:
            pending = [run for run in runs if run.key not in results.rows]
            _go(pending, len(runs), jobs, progress, engine, address, results.add)
            return results.table()
    with _RowFile(out) as row_file:
        rows = _go(runs, len(runs), jobs, progress, engine, address, row_file.append)
    table = pd.DataFrame([rows[run.key] for run in runs], columns=list(COLUMNS))
    if out is not None:
        write_table(table, out)
    return table


def planned(controllers, cases, duration=None, skip=None, seeds=None, runs_folder=None, **options):
    """List of the Runs that evaluate would make of these arguments, for score."""
    suite = cases if isinstance(cases, Suite) else None
    return _plan(
        _labelled(controllers), _case_list(cases), suite, duration, skip, seeds, runs_folder, options
    )


def _go(runs, total, jobs, progress, engine, address, keep):
    """{run key: row} of the runs; keep(row) and progress are called as each ends."""
    report = progress or (lambda done, total, row: None)
    before = total - len(runs)
    report(before, total, None)
    rows = {}
    collect = engine == "ray"  # workers may be on machines that do not share this one's disk
    for index, outcome in outcomes(score_and_send if collect else score, runs, jobs, engine, address):
        if collect:
            row, content = outcome
            if content is not None:
                with replacing(runs[index].frame_path) as temporary:
                    temporary.write_bytes(content)
        else:
            row = outcome
        rows[runs[index].key] = row
        keep(row)
        report(before + len(rows), total, row)
    return rows


def _labelled(controllers):
    """{label: controller} of what evaluate takes."""
    if isinstance(controllers, str):
        controllers = [name.strip() for name in controllers.split(",") if name.strip()]
    if not isinstance(controllers, dict):
        controllers = {name if isinstance(name, str) else type(name).__name__: name for name in controllers}
    if PARKED in controllers:
        raise InputError(f"controllers: the name {PARKED!r} is that of turbines without one")
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


def _plan(controllers, cases, suite, duration, skip, seeds, runs_folder, options):
    """The Runs of an evaluation, case by case, so that an interrupted one compares what it has."""
    if seeds is not None:
        seeds = [int(seed) for seed in seeds]
    for what, given in (
        ("controllers", controllers),
        ("cases", cases),
        ("seeds", (1,) if seeds is None else seeds),
    ):
        if not given:
            raise InputError(f"{what}: at least one is needed")
    if len(set(seeds or ())) < len(seeds or ()) or len({case.name for case in cases}) < len(cases):
        raise InputError("seeds and names of cases must differ from each other")
    runs = []
    for case in cases:
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
                runs.append(Run(label, controller, case, seed, length, start, dict(options), path))
    return runs


def _first(*values):
    """The first value that is not None."""
    return next(value for value in values if value is not None)


def _check_controllers(controllers, runs):
    """Raises: InputError for a controller that cannot be made, before anything runs."""
    turbine = fowt_env.build_scene(runs[0].case.platform).turbine
    for controller in controllers.values():
        if isinstance(controller, str):
            try:
                make(controller, turbine, runs[0].options.get("control_dt", CONTROL_DT))
            except InputError:
                raise
            except Exception:  # a bug of the user's: its runs fail with the reason, the others go on
                continue


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
        about["score"] = None if suite.score is None else suite.score.model_dump()
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
    row, frame = _scored(run)
    if run.frame_path is not None:
        write_run(frame, row, run.frame_path)
    return row


def score_and_send(run):
    """(row, content of the run's file or None): score for a worker on another machine."""
    row, frame = _scored(run)
    if run.frame_path is None:
        return row, None
    content = io.BytesIO()
    pq.write_table(parquet_of(frame, row), content)
    return row, content.getvalue()


def _scored(run):
    """(row, time series or None) of one run."""
    row = dict.fromkeys(COLUMNS, float("nan"))
    row |= {"controller": run.label, "case": run.case.name, "seed": run.seed, "status": "ok", "reason": ""}
    row["scored_[s]"] = run.duration - run.skip
    case = run.case
    options = {"duration": max(SHORTEST_WEATHER, run.duration), **case.options}
    wind = case.wind
    if is_field(wind):
        wind = cached_box(wind, case.platform, run.seed, options)
    known = scene = fowt_env.build_scene(case.platform, wind=wind, sea=case.sea, seed=run.seed, **options)
    if case.shift is not None and case.shift.factors:
        parts = shifted_parts(case.shift, case.platform)
        scene = fowt_env.build_scene(wind=wind, sea=case.sea, seed=run.seed, **options | parts)
    turbine = scene.turbine
    try:
        controller = _controller(run, known)
        frame = fowt_env.simulate(
            scene, controller=controller, duration=run.duration, initial=case.initial,
            stop_overspeed=case.fault is None, grid_loss=_grid_loss(case), **run.options,
        )  # fmt: skip
        row |= metrics(
            frame, run.skip, degrees(turbine.rated_rotor_speed) / 6.0, degrees(turbine.pitch_drive.rate_limit)
        )
    except Exception as error:  # whatever a controller raises costs its run, not the evaluation
        if isinstance(error, InputError) and not isinstance(error, ControllerInputError):
            raise  # the run's settings, which no controller could use
        frame = getattr(error, "frame", None)
        stopped = getattr(error, "time", float("nan"))
        row |= {"status": "failed", "reason": _reason(error), "stopped_[s]": stopped}
    return row, frame


def _controller(run, known):
    """What simulate is given as controller: the run's own, with its fault, or a parked turbine's.

    known: the scene that the controller is told of.
    """
    case = run.case
    if case.parked:
        return idling(known.turbine) if known.wind_speed else None
    if case.fault is None and case.shift is None:
        return run.controller
    control_dt = run.options.get("control_dt", CONTROL_DT)
    controller = make(run.controller, known.turbine, control_dt)
    if case.shift is not None:
        controller = Unaware(controller, known, case.shift, run.seed)
    return faulted(controller, case.fault, known.turbine, control_dt)


def _grid_loss(case):
    """Time (s) from which the case's generator is off the grid; None: never. A parked turbine's always is."""
    if case.parked:
        return 0.0
    return None if case.fault is None else case.fault.grid_loss


def _reason(error):
    """One line that says why a run failed."""
    if isinstance(error, SimulationStopped):
        return str(error.reason)
    if isinstance(error, ControllerError | ControllerInputError):
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
