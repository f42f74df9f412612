"""Evaluates every submission on the board's suites, and checks all metrics against the time series.

A run is stored under a key of everything that affects it, so that runs of a changed submission, card or limit
are never shown. Submitted code runs in separate processes (training.board.isolated). The page shows only the
number of secret seeds and the hash of their file, so that the seeds can be verified later.
"""

import hashlib
import json
import os
import secrets
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

from fowt_env.control import EXACT, known_scene, make
from fowt_env.errors import InputError, muted, unknown
from fowt_env.files.tables import read_table
from fowt_env.scene.build import build_scene
from fowt_env.training.board.folder import Board, read_seeds
from fowt_env.training.board.isolated import digest_of, warmed_up
from fowt_env.training.board.submission import CODE, LIBRARY
from fowt_env.training.evaluation.cases import described
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.guard import printable
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.evaluation.provenance import controller_code, plant_code
from fowt_env.training.evaluation.results import run_file
from fowt_env.training.evaluation.results_table import KEY
from fowt_env.training.evaluation.run_case import CONTROL_DT, REFERENCE, SHORTEST_CASE_WEATHER, run_metrics
from fowt_env.training.evaluation.seeds import reseeded, with_drawn_seeds
from fowt_env.training.evaluation.wind_boxes import cached_box
from fowt_env.weather.wind_field import is_field

RELATIVE = 1e-9  # tolerance between metrics of the rows and metrics recomputed from the time series
CALLS = "slowest_calls.csv"  # in a results folder: name, key, s of each isolated run


@dataclass
class Judged:
    """Holds the results of a board: a table per suite for public and for secret seeds."""

    board: Board
    submissions: list
    public: dict[str, pd.DataFrame] = field(default_factory=dict)  # suite -> table of evaluate
    secret: dict[str, pd.DataFrame] = field(default_factory=dict)
    seeds_hash: str = ""  # SHA-256 of the file of secret seeds
    drawn: str = ""  # hash from which the public seeds were drawn; "": listed seeds
    when: str = ""
    left_out: dict[str, str] = field(default_factory=dict)  # {submission, or "submission, suite": why}
    slowest: dict[tuple[str, str], float] = field(default_factory=dict)  # {(suite, name): s of a call}

    @property
    def shown(self) -> list:
        """Return the submissions that were run on at least one suite."""
        names = {name for table in self.public.values() for name in table["controller"]}
        return [each for each in self.submissions if each.name in names]


def judge(
    board, jobs=1, secret=None, private=None, trust_code=False, progress=None, draw_seeds=None, within=()
):
    """Run all usable submissions of a Board on its suites, and return the Judged.

    secret      file of the organiser's seeds ("-": standard input); private: folder for their runs
    progress    called as progress(done, total, text)
    draw_seeds  hash from which as many public seeds are drawn as the board lists; None: listed seeds
    within      command (words) that starts Python files, e.g. in a container
    Raises: InputError for Python files without trust_code, for secret seeds without a folder for their runs,
    or if the baseline is missing or cannot be run.
    """
    submissions, left_out = board.read()
    baseline, names = board.settings.baseline, [each.name for each in submissions]
    if not submissions:
        raise InputError(f"board {str(board.folder)!r}: has no submissions: fowt dev leaderboard add FOLDER")
    if baseline not in names:
        why = f" ({left_out[baseline]})" if baseline in left_out else ""
        raise InputError(f"{unknown('baseline among the submissions', baseline, names)}{why}")
    code = [each.name for each in submissions if each.kind in CODE]
    if code and not trust_code:
        raise InputError(
            f"submissions {', '.join(code)}: contain code, which will be executed: review it, then use"
            " --trust-code (each runs in a separate process with this user's rights)"
        )
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if code and jobs > processors:
        raise InputError(
            f"jobs = {jobs}: calls of submitted code are limited in wall-clock time, and this machine has"
            f" {processors} processors: use at most that many"
        )
    if (secret is None) != (private is None):
        raise InputError("secret seeds: need a folder for their runs (--private) outside the board's folder")
    if private is not None and Path(private).resolve().is_relative_to(board.folder.resolve()):
        raise InputError(f"private = {str(private)!r}: must be outside the board's folder")
    made = Judged(board, submissions, when=time.strftime("%Y-%m-%d"), left_out=left_out)
    suites = [board.suite(name) for regime in board.settings.regime for name in regime.suites]
    suites = [replace(suite, seeds=tuple(board.settings.seeds)) for suite in suites]
    public = suites
    if draw_seeds is not None:
        public = [with_drawn_seeds(suite, draw_seeds) for suite in suites]
        made.drawn = public[0].drawn["hash"]
    rounds = [(public, board.folder / "runs", made.public)]
    if secret is not None:
        seeds, made.seeds_hash = read_seeds(secret)
        rounds.append(([_unordered(suite, seeds) for suite in suites], Path(private), made.secret))
    factories = _factories(submissions, board.limits, tuple(within), suites)
    for judged, folder, tables in rounds:
        for suite in judged:
            tables[suite.name] = _suite_table(made, factories, suite, folder, jobs, progress)
    for each in submissions:
        if digest_of(each.folder) != each.digest:
            raise InputError(f"submission {each.name!r}: its files changed during the evaluation")
    return made


def _unordered(suite, seeds):
    """Return a Suite with secret seeds and cases in random order."""
    suite, shuffled = reseeded(suite, seeds), secrets.SystemRandom().sample
    order = {"seeds": seeds, "cases": suite.cases}
    return replace(suite, **{key: tuple(shuffled(part, len(part))) for key, part in order.items()})


def _factories(submissions, limits, within, suites):
    """Return {name: controller for evaluate}; controllers of Python files have their kernels precompiled."""
    result = {each.name: each.controller(limits) for each in submissions}
    for each in submissions:
        if each.kind in CODE:
            factory = result[each.name] = replace(result[each.name], within=within)
            if each.kind == LIBRARY:  # compiles nothing
                continue
            cases = _kinds(suites) if "plant_model" in factory.information else _kinds(suites)[:1]
            key = json.dumps([plant_code(), [described(case) for case, _ in cases]])
            result[each.name] = warmed_up(factory, lambda cases=cases: (_quiet(*case) for case in cases), key)
    return result


def _kinds(suites):
    """Return [(Case, seed)] of suites, one per kind of scene for which a controller is prepared."""
    cases = {}
    for suite in suites:
        for case in suite.cases:
            weather = case.wind is None, is_field(case.wind), case.sea is None
            kind = json.dumps([described(case)[key] for key in ("platform", "options")] + [weather],
                              sort_keys=True)  # fmt: skip
            if not case.parked:
                cases.setdefault(kind, (case, suite.seeds[0]))
    return list(cases.values())


def _quiet(case, seed):
    """Return the nominal scene of a Case for `prepare`, without the weather of a run."""
    options = {"duration": SHORTEST_CASE_WEATHER, **case.options}
    wind = cached_box(case.wind, case.platform, seed, options) if is_field(case.wind) else case.wind
    asking = SimpleNamespace(name="board", information=("plant_model",))
    with muted():
        return known_scene(build_scene(case.platform, wind=wind, sea=case.sea, **options), asking)


def _suite_table(made, factories, suite, folder, jobs, progress):
    """Return the table of a suite with all submissions that can be run, each with its kind of preview."""
    parts = []
    drawn = "" if suite.drawn is None else f"-{suite.drawn['hash'][:12]}"
    for preview in sorted({each.card.preview for each in made.submissions}):
        target = Path(folder) / f"{suite.name}-v{suite.version}-{preview}{drawn}"
        target.mkdir(parents=True, exist_ok=True)
        labelled, names = {}, {}
        for each in made.submissions:
            if each.card.preview == preview:
                controller = factories[each.name]
                if each.kind in CODE:
                    controller = replace(controller, log=str(target.absolute() / CALLS))
                label = f"{each.name}.{_key(each, controller)}"
                labelled[label], names[label] = controller, each.name

        def report(done, total, _, what=f"{suite.name}, {preview}"):
            if progress is not None:
                progress(done, total, f"{what}: {done} of {total} runs")

        options = {} if preview == EXACT else {"preview": preview}
        table, refused = _run(labelled, suite, target, jobs=jobs, progress=report, **options)
        for label, why in refused.items():
            name = names[label]
            if name == made.board.settings.baseline:
                raise InputError(why)
            made.left_out[f"{name}, {suite.name}"] = why
        if table is not None:
            shown = table["controller"].map(names | {REFERENCE: REFERENCE})
            parts.append(table.assign(controller=shown))
            if (target / CALLS).is_file():
                calls = pd.read_csv(target / CALLS, header=None).groupby(1)[2].max()
                for label, controller in labelled.items():
                    if (key := getattr(controller, "content_key", None)) in calls:
                        here = suite.name, names[label]
                        made.slowest[here] = max(made.slowest.get(here, 0.0), calls[key])
    return pd.concat(parts, ignore_index=True).drop_duplicates(KEY)  # one reference per kind of preview


def _key(submission, controller):
    """Return the hash of all that affects the runs of a submission except suite, seeds and plant."""
    parts = [submission.digest, controller_code(controller)["code"]]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def _run(labelled, suite, target, **options):
    """Evaluate {label: controller} and return (table or None, {label: why the controller cannot be run})."""
    try:
        table = evaluate(labelled, suite, folder=target, **options)
        seeds = {*suite.seeds, *(seed for case in suite.cases for seed in case.seeds or ())}
        table = table[table["controller"].isin([*labelled, REFERENCE]) & table["seed"].isin(seeds)]
        check_figures(table, target, suite)
        return table, {}
    except InputError as error:
        if len(labelled) == 1:
            return None, dict.fromkeys(labelled, printable(str(error)))
    parts, refused = [], {}
    for label, controller in labelled.items():  # one by one, to exclude those that cannot be run
        table, why = _run({label: controller}, suite, target, **options)
        parts += [] if table is None else [table]
        refused |= why
    return (pd.concat(parts, ignore_index=True) if parts else None), refused


def check_figures(table, folder, suite):
    """Compare the metrics of a table with those of its time series. Raises: InputError if they differ."""
    cases = {case.name: case for case in suite.cases}
    scenes = {}  # {case: scene}: metrics need only turbine and mean wind
    for index in np.flatnonzero(table["status"] != "failed"):
        row = table.iloc[index]
        case = cases[row["case"]]
        if case.name not in scenes:
            wind = None if is_field(case.wind) else case.wind  # a box takes minutes to generate and is unused
            scenes[case.name] = build_scene(case.platform, wind=wind, sea=case.sea, **case.options)
        frame = read_table(run_file(Path(folder) / "runs", *row[list(KEY)]))
        skip = suite.skip if case.skip is None else case.skip
        values = run_metrics(frame, case, scenes[case.name], skip)
        old, new = row[list(METRICS)].to_numpy(np.float64), np.array([values[name] for name in METRICS])
        far = ~np.isclose(old, new, rtol=RELATIVE, atol=1e-12, equal_nan=True)
        if far.any():
            i = int(far.argmax())
            raise InputError(
                f"results {str(folder)!r}: {METRICS[i]} of {', '.join(map(str, row[list(KEY)]))} is"
                f" {old[i]:.10g} in the table and {new[i]:.10g} from the time series: remove the folder and"
                " run again"
            )


def inputs_of(submission, turbine):
    """Return the inputs of a submission, as declared in the card or by the built-in controller or policy."""
    if submission.kind in CODE:
        return tuple(submission.controller(None).information)
    return tuple(make(submission.controller(None), turbine, CONTROL_DT).information)
