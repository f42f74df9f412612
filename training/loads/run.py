"""Runs the matrix of a design load table, which can be interrupted and resumed, and reads its finished runs.

    manifest.json                            settings: versions, sources, site, cases, controllers
    runs/<controller>/<name>_seed<n>.zip     one finished run (records.py)
    boxes/                                   boxes of wind of the runs that are left, then removed

Runs in the same box of wind follow each other, and processes on one machine share its file. Time series are
reduced to statistics where they are made.
"""

import fcntl
import hashlib
import json
import os
import shutil
import time
from collections import Counter
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import fowt_env
from fowt_env.controllers import make
from fowt_env.descriptions.files import parse_json
from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.errors import InputError
from fowt_env.files.atomic import remove_leftovers
from fowt_env.training.evaluation import provenance
from fowt_env.training.evaluation.cases import described
from fowt_env.training.evaluation.engines import outcomes
from fowt_env.training.evaluation.guard import attempt
from fowt_env.training.evaluation.locks import locked
from fowt_env.training.evaluation.results import check_name, finite, write_json
from fowt_env.training.evaluation.run_case import CONTROL_DT, FAILED, PARKED, REFERENCE, Run, scored
from fowt_env.training.evaluation.wind_boxes import box_path, cached_box, new_box
from fowt_env.training.loads.records import FinishedRun, read_run, run_content, run_path, write_run
from fowt_env.training.loads.statistics import run_statistics
from fowt_env.weather.wind_field import WindBox, is_field

FORMAT = 1  # of the folder
TIME_LIMIT = 3600.0  # s of wall clock of a run
SAMPLE = 300.0  # s, length of a run by which the speed is measured
BOX_SAMPLE = 600.0  # s, of a box by which the time to make one is measured


@dataclass(frozen=True)
class Task:
    """Defines one run for a worker process."""

    case: Any  # records.LoadCase
    controller: object  # name or object; None for a parked turbine
    boxes: Path | None  # folder of the boxes of wind; None: kept by no one
    time_limit: float | None


def simulated(task, here=None):
    """Return (FinishedRun, content of its file) of a Task.

    here: package versions of the machine that collects the runs, if this is another one.
    Raises: InputError for settings that no controller could use, and for other versions there.
    """
    if here is not None and (gap := provenance.version_gap(here, provenance.versions())):
        raise InputError(f"engine = 'ray': {gap[0]} here and {gap[1]} at the worker")
    began = time.monotonic()
    load = task.case
    run = Run(
        load.controller, task.controller, with_box(load, task.boxes), load.seed, load.duration, load.skip,
        {}, None, task.time_limit,
    )  # fmt: skip
    row, _ = scored(
        run, lambda frame, case, nominal, skip: {"statistics": run_statistics(frame, nominal, skip)}
    )
    keys = ("status", "reason", "events", "warning")
    finished = FinishedRun(
        *load.key, *(row[key] for key in keys[:2]), row.get("stopped_[s]", float("nan")),
        *(row[key] for key in keys[2:]), time.monotonic() - began, row.get("statistics"),
    )  # fmt: skip
    return finished, run_content(finished)


def _weather(load):
    """Return the options of build_scene of a LoadCase, with the length of its random weather."""
    return {"duration": load.duration, **load.case.options}


def with_box(load, folder):
    """Return the Case of a LoadCase with its box of wind, made once by all processes that share a folder."""
    case = load.case
    options = _weather(load)
    case = replace(case, options=options)
    if not is_field(case.wind) or isinstance(case.wind, WindBox):
        return case
    arguments = case.wind, case.platform, load.seed, options
    if folder is None:
        box = _kept_box(*arguments)
    else:
        with _one_at_a_time(folder):  # a box takes memory and seconds while it is made
            box = cached_box(*arguments, folder=folder)
    return replace(case, wind=box)


_last = {}  # {arguments: box} of the latest box of this process


def _kept_box(spec, platform, seed, options):
    """Return a generated box of wind, the latest one from memory."""
    key = json.dumps([spec, str(platform), seed, options], sort_keys=True, default=repr)
    if key not in _last:
        _last.clear()
        _last[key] = new_box(spec, platform, seed, options)
    return _last[key]


@contextmanager
def _one_at_a_time(folder):
    """Let one process at a time use the folder of the boxes."""
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def lost(task, reason):
    """Return the outcome, as from `simulated`, of a run whose worker process ended."""
    finished = FinishedRun(*task.case.key, FAILED, reason)
    return finished, run_content(finished)


def run_matrix(
    matrix,
    controllers,
    folder,
    *,
    about=None,
    jobs=1,
    engine="processes",
    address=None,
    time_limit=TIME_LIMIT,
    retry_failed=False,
    progress=None,
):
    """Run what is not finished of a Matrix in a folder, and return Counter of the statuses of its runs.

    controllers   {label: name or object} with the labels of the matrix
    about         what else is to stand in the manifest, as plain values: the site
    jobs, engine, address   as in training.evaluation.evaluate
    time_limit    s of wall clock after which a run fails; None: no limit
    retry_failed  whether failed runs are repeated
    progress      called as progress(done, total, FinishedRun or None, s left or None)
    Raises: InputError for a folder of other settings or in use, and for a controller that cannot be created.
    """
    folder = Path(folder).absolute()  # a controller may change the working folder
    report = progress or (lambda done, total, finished, left: None)
    runs = matrix.runs
    check_controllers(controllers, matrix)
    with locked(folder, f"load table {str(folder)!r}", "another process is writing to it"):
        done = _prepared(folder, matrix, controllers, about or {}, retry_failed)
        boxes = folder / "boxes" if engine == "processes" else None
        tasks, places = _ordered(
            [
                Task(load, None if key[0] == PARKED else controllers[key[0]], boxes, time_limit)
                for key, load in runs.items()
                if key not in done
            ]
        )
        needed = Counter(places)
        statuses, before, began = Counter(done.values()), len(done), time.monotonic()
        report(before, len(runs), None, None)
        function = partial(simulated, here=provenance.versions()) if engine == "ray" else simulated
        try:
            with closing(outcomes(function, tasks, jobs, engine, address, time_limit, lost)) as ended:
                for count, (index, (finished, content)) in enumerate(ended, 1):
                    write_run(content, run_path(folder, finished.key))
                    statuses[finished.status] += 1
                    box = places[index]
                    needed[box] -= 1
                    if box is not None and not needed[box]:
                        box.unlink(missing_ok=True)
                    left = (time.monotonic() - began) / count * (len(tasks) - count)
                    report(before + count, len(runs), finished, left)
        finally:
            shutil.rmtree(folder / "boxes", ignore_errors=True)  # of this program, made again when needed
    return statuses


def _box_of(task):
    """Return the path of the box of wind of a Task; None without one."""
    load = task.case
    if task.boxes is None or not is_field(load.case.wind):
        return None
    return box_path(load.case.wind, load.case.platform, load.seed, _weather(load), task.boxes)


def _ordered(tasks):
    """Return (Tasks, their boxes), with those in the same turbulence, or wind and seed, after each other."""
    first, keys, places = {}, [], list(map(_box_of, tasks))
    for number, (task, box) in enumerate(zip(tasks, places, strict=True)):
        keys.append(box or (str(task.case.case.wind), task.case.seed))
        first.setdefault(keys[-1], number)
    order = sorted(range(len(tasks)), key=lambda number: first[keys[number]])
    return [tasks[number] for number in order], [places[number] for number in order]


def check_controllers(controllers, matrix):
    """Create each controller of a Matrix once. Raises: InputError for one that cannot be created."""
    for label in controllers:
        check_name("controllers: the name", label)
        if label in (PARKED, REFERENCE):
            raise InputError(f"controllers: the name {label!r} is reserved")
    if not matrix.cases:
        raise InputError("dlc: no run is left: all chosen load cases are left out")
    turbine = turbine_of(read_platform(matrix.cases[0].case.platform))
    for controller in controllers.values():
        _, error = attempt(lambda each=controller: make(each, turbine, CONTROL_DT), TIME_LIMIT)
        if isinstance(error, InputError):
            raise error


def _prepared(folder, matrix, controllers, about, retry_failed):
    """Return {key: status} of the finished runs, after a check of the folder's settings.

    Raises: InputError for a folder of other settings.
    """
    for each in (folder, *folder.glob("runs/*/")):
        remove_leftovers(each)
    settings = _settings(matrix, controllers, about)
    path = folder / "manifest.json"
    old = _read_manifest(path) if path.exists() else None
    files = {run_path(folder, key): key for key in matrix.runs}
    if old is None and any(folder.glob("runs/*/*.zip")):
        raise _refused(folder, "contains runs but no manifest.json")
    if old is not None:
        _compare(folder, old, settings)
        settings |= {key: old[key] | settings[key] for key in ("cases", "controllers")}
    done = {}
    for file, key in files.items():
        if file.exists():
            finished = read_run(file)
            if finished.key != key:
                raise InputError(
                    f"{str(file)!r} contains the run {', '.join(map(str, finished.key))}: remove it"
                )
            if not (retry_failed and finished.status == FAILED):
                done[key] = finished.status
    write_json(settings, path)
    return done


def _settings(matrix, controllers, about):
    """Return the content of manifest.json."""
    runs = matrix.runs.values()
    platform = runs and next(iter(runs)).case.platform
    cases = {
        load.name: described(load.case) | {"duration": load.duration, "skip": load.skip} for load in runs
    }
    used = {load.controller for load in runs}
    codes = {label: provenance.controller_code(each) for label, each in controllers.items() if label in used}
    settings = {
        "format": FORMAT,
        "fowt_env": fowt_env.__version__,
        "code": provenance.plant_code(Path(__file__)),
        "versions": provenance.versions(),
        "platform": _digest(platform),
        "about": about,
        "cases": cases,
        "controllers": codes,
    }
    return json.loads(json.dumps(finite(settings)))


def _digest(platform):
    """Return the hash of the values of a platform and its turbine."""
    description = read_platform(platform)
    values = [each.model_dump(mode="python") for each in (description, turbine_of(description))]

    def plain(value):
        return value.tolist() if isinstance(value, np.ndarray | np.generic) else repr(value)

    text = json.dumps(values, default=plain, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _read_manifest(path):
    try:
        old = parse_json(path.read_text(encoding="utf-8"))
    except ValueError:
        old = None
    if not isinstance(old, dict) or old.get("format") != FORMAT:
        raise _refused(path.parent, f"has a manifest.json that is not of a load table of format {FORMAT}")
    tables = ("versions", "about", "cases", "controllers")
    texts = ("fowt_env", "code", "platform")
    if not all(isinstance(old.get(key), dict) for key in tables) or not all(
        isinstance(old.get(key), str) for key in texts
    ):
        raise _refused(path.parent, f"has a manifest.json without {', '.join((*tables, *texts))}")
    return old


def _compare(folder, old, new):
    """Compare the settings of a folder with those of this table. Raises: InputError if they do not match."""
    for key, what in (("fowt_env", "fowt_env"), ("code", "sources"), ("platform", "platform file")):
        if old[key] != new[key]:
            raise _refused(folder, f"was made with another version of the {what}" if key != "fowt_env" else
                           f"was made by fowt_env {old[key]}, not {new[key]}")  # fmt: skip
    if gap := provenance.version_gap(old["versions"], new["versions"]):
        raise _refused(folder, f"was made with {gap[0]}, not {gap[1]}")
    for name, case in new["cases"].items():
        before = old["cases"].get(name, case)
        for key in sorted({*before, *case}):
            if before.get(key) != case.get(key):
                raise _refused(
                    folder,
                    f"was made with another case {name!r}: {key} = {before.get(key)}, now {case.get(key)}",
                )
    for label, code in new["controllers"].items():
        if old["controllers"].get(label, code) != code:
            runs = run_path(folder, (label, "x", 0)).parent
            raise InputError(
                f"load table {str(folder)!r}: controller {label!r} or its code has changed since its runs"
                f" there; remove {str(runs)!r} to run them again, or choose another folder"
            )


def _refused(folder, why):
    return InputError(f"load table {str(folder)!r} {why}: choose another folder (--out), or remove this one")


def finished_runs(matrix, folder):
    """Yield (LoadCase, FinishedRun) of the load cases of a Matrix whose run is in the folder, in order.

    Cases that share a run have the same FinishedRun. One run is in memory at a time, and its neighbour.
    """
    key, finished = None, None
    for case in matrix.cases:
        if case.key != key:
            path = run_path(folder, case.key)
            key, finished = case.key, read_run(path) if path.exists() else None
        if finished is not None:
            yield case, finished


def expected_seconds(matrix, controllers, jobs=1):
    """Return (s of wall clock of a Matrix, {label: simulated s per s}, s per box of wind), measured.

    A run of SAMPLE s of each controller and of the parked turbine is timed, with its statistics, after a
    first run that loads or compiles the kernels; and a box of wind of BOX_SAMPLE s, from which the time of
    the others follows in proportion to their points.
    Raises: InputError with the reason if a timed run fails, since the runs of its controller would, too.
    """
    runs = list(matrix.runs.values())
    rates, total = {}, 0.0
    for label in dict.fromkeys(load.controller for load in runs):
        mine = [load for load in runs if load.controller == label]
        sample = max(mine, key=lambda load: load.duration)
        seconds = _timed(sample, controllers.get(label))
        rates[label] = SAMPLE / seconds
        total += sum(load.duration for load in mine) / rates[label]
    boxes = {(str(load.case.wind), load.seed): load for load in runs if is_field(load.case.wind)}
    per_box = 0.0
    if boxes:
        example = next(iter(boxes.values()))
        began = time.perf_counter()
        options = _weather(example) | {"duration": BOX_SAMPLE}
        box = new_box(example.case.wind, example.case.platform, example.seed, options)
        per_point = (time.perf_counter() - began) / box.velocity.size
        points = [
            load.duration / load.case.wind["dt"] * load.case.wind["points"] ** 2 * 3
            for load in boxes.values()
        ]
        per_box = per_point * float(np.mean(points)) * np.sqrt(2.0)  # lengths are powers of two
        total += per_box * len(boxes)
    return total / jobs, rates, per_box


def _timed(load, controller):
    """Return the s that a run of SAMPLE s of a LoadCase takes, once its kernels are loaded.

    Raises: InputError if the run fails.
    """
    fault = load.case.fault
    early = None if fault is None else fault.model_copy(update={"time": 0.5 * SAMPLE})
    short = replace(load, case=replace(load.case, fault=early), duration=SAMPLE, skip=0.1 * SAMPLE)
    task = Task(replace(short, case=with_box(short, None)), controller, None, TIME_LIMIT)
    for _ in range(2):
        began = time.perf_counter()
        finished, _ = simulated(task)
        seconds = time.perf_counter() - began
        if finished.status == FAILED:
            raise InputError(
                f"controllers: {load.controller!r} failed in a run of {SAMPLE:g} s of {load.name!r}, by which"
                f" the time is measured: {finished.reason}"
            )
    return seconds
