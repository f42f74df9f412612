"""Assembles the tables of a design load table from its finished runs, and writes them as CSV.

results = load_tables(cases, finished)      ultimate and fatigue loads, constraints, 50-year values
write_csv(folder, results)
"""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from fowt_env.descriptions.channel_meanings import channel_meaning
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.carried import missing_part
from fowt_env.training.evaluation.metrics import TIME
from fowt_env.training.loads.extrapolation import conditions_of_runs, extrapolate, form_load
from fowt_env.training.loads.extremes import EXTRAPOLATED, SIDES, extreme_table, flag_table
from fowt_env.training.loads.fatigue import REFERENCE_CYCLES, YEARS, lifetime_table
from fowt_env.training.loads.selection import columns_of, controllers_of, runs_of
from fowt_env.training.loads.statistics import LINES, RESULTANTS, groups_of

# channels whose loads a rigid part or a quasi-static line lacks dynamics of: beginning of the name, and the
# metric of training.evaluation.carried with the same part
FAMILIES = (
    ("RotTorq", "RotTorq_DEL_[kN-m]"),
    ("TwrBs", "TwrBsMyt_DEL_[kN-m]"),
    ("YawBr", "YawBrMyp_DEL_[kN-m]"),
    ("LSS", "LSSTipMys_DEL_[kN-m]"),
    ("Root", "RootMyc_DEL_[kN-m]"),
    ("Spn", "RootMyc_DEL_[kN-m]"),
    *((name, "FAIRTEN_DEL_[kN]") for name in LINES),
)
WORDS = {
    "shaft": "rigid shaft",
    "tower": "rigid tower",
    "blades": "rigid blades",
    "mooring": "quasi-static lines",
}
SEVERE = "1.6"  # number of the load case of production in the severe sea
DRIVING = 10  # runs that are exported for a check in OpenFAST


@dataclass(frozen=True)
class LoadTables:
    """Holds the results of a design load table.

    cases: all LoadCases; runs: [(LoadCase, RunStatistics)] of those that have statistics; lost: [(LoadCase,
    FinishedRun or None)] without; ended: [(LoadCase, FinishedRun)] that the protection ended early.
    extrapolations: {(controller, column, side): Extrapolation}; forms: {(controller, column, side): (load,
    wind m/s, Hs m)} of 50 years by inverse FORM, {} without runs in the severe sea.
    """

    cases: list
    runs: list
    lost: list
    ended: list
    controllers: tuple
    baseline: str
    extremes: list
    lifetime: list
    flags: list
    extrapolations: dict
    forms: dict
    years: float
    reference_cycles: float


def joined(cases, finished):
    """Return (runs, lost, ended) as in LoadTables of LoadCases and {key: FinishedRun}.

    Hours of runs without statistics are spread over the other seeds of their condition, so that the lifetime
    keeps its length; a condition without any finished seed is lost with its hours.
    """
    runs, lost, ended = [], [], []
    for case in cases:
        run = finished.get(case.key)
        if run is None or run.statistics is None:
            lost.append((case, run))
            continue
        runs.append((case, run.statistics))
        if run.status != "ok":
            ended.append((case, run))
    planned = Counter((case.controller, *case.condition) for case in cases)
    there = Counter((case.controller, *case.condition) for case, _ in runs)
    return (
        [
            (replace(case, hours_per_year=case.hours_per_year * planned[key] / there[key]), each)
            for case, each in runs
            for key in [(case.controller, *case.condition)]
        ],
        lost,
        ended,
    )


def load_tables(
    cases,
    finished,
    *,
    baseline=None,
    years=YEARS,
    reference_cycles=REFERENCE_CYCLES,
    exponents=(3, 4, 10),
    climate=None,
    limits=None,
    progress=None,
):
    """Return the LoadTables of LoadCases and {key: FinishedRun}.

    baseline: controller that others are compared with, None: the first. years: lifetime of the fatigue loads.
    climate: site.Climate, for loads by inverse FORM; None: without these.
    limits: {constraint: limit or None} in place of those with which the runs were made.
    progress: called as progress(done, total, text).
    Raises: InputError if no run has statistics, or for an unknown exponent.
    """
    say = progress or (lambda done, total, text: None)
    runs, lost, ended = joined(cases, finished)
    runs = [(case, with_limits(each, limits or {})) for case, each in runs]
    columns = [name for name in columns_of([(c, s) for c, s in runs]) if name != TIME]
    labels = controllers_of(runs)
    baseline = labels[0] if baseline is None else baseline
    # the loads of a stop are no peaks of production
    whole, _, _ = joined(cases, {key: run for key, run in finished.items() if run.status == "ok"})
    production = [run for run in whole if run[0].characteristic == EXTRAPOLATED]
    peaked = [name for name in columns if production and all(name in each.peaks for _, each in production)]
    severe = [run for run in runs if run[0].dlc == SEVERE]
    extrapolations, forms = {}, {}
    for number, column in enumerate(peaked):
        say(number, len(peaked), f"extrapolating {column}")
        for label in labels:
            own = runs_of(production, label)
            if not sum(case.hours_per_year for case, _ in own):
                continue
            for side in SIDES:
                conditions = conditions_of_runs(own, column, side)
                extrapolations[label, column, side] = extrapolate(conditions, side, climate=climate)
                if climate is not None and severe:
                    in_seas = own + runs_of(severe, label)
                    forms[label, column, side] = form_load(in_seas, column, side, climate)
    say(0, 1, "tabulating extremes and fatigue")
    return LoadTables(
        list(cases), runs, lost, ended, tuple(labels), baseline,
        extreme_table(runs, columns, baseline, extrapolations),
        lifetime_table(runs, exponents, years, reference_cycles, baseline),
        flag_table(runs), extrapolations, forms, years, reference_cycles,
    )  # fmt: skip


def with_limits(statistics, limits):
    """Return RunStatistics whose Flags have other limits: {constraint: limit or None}."""
    flags = tuple(flag._replace(limit=limits.get(flag.name, flag.limit)) for flag in statistics.flags)
    return replace(statistics, flags=flags)


def family_of(column):
    """Return the group of a column of a load ("tower base"), "" for none; of a direction: its moment's."""
    name = column.partition("_[")[0].partition("/")[0]
    return next(
        (group for group, members in groups_of([name, *_components(name)]).items() if name in members), ""
    )


def _components(name):
    """Return the components of a resultant, which its group is looked up by."""
    return RESULTANTS[name][1:] if name in RESULTANTS else ()


def meaning_of(column):
    """Return a column in words."""
    name = column.partition("_[")[0]
    if name in RESULTANTS:
        x, y = RESULTANTS[name][1:]
        return f"resultant of {x} and {y}"
    return channel_meaning(name)


def absent_part(column, case):
    """Return what the plant of a Case lacks for a load ("rigid blades"), "" if it carries the load."""
    name = column.partition("_[")[0]
    metric = next((metric for start, metric in FAMILIES if name.startswith(start)), None)
    missing = None if metric is None else missing_part(metric, case)
    return "" if missing is None else WORDS[missing[0]]


def driving_runs(results, count=DRIVING):
    """Return the LoadCases of the runs that drive most forces and moments, most first.

    Directions are left out, as they follow their two channels.
    """
    wins = Counter()
    for row in results.extremes:
        if "@" not in row.column and family_of(row.column) and "_[kN" in row.column:
            wins[row.controller, row.name, row.seed] += 1
    known = {}
    for case, _ in results.runs:
        for label in results.controllers:
            if case.controller in (label, "parked"):
                known.setdefault((label, case.name, case.seed), case)
    found = {}
    for key, _ in wins.most_common():
        found.setdefault(known[key].key, known[key])  # a parked run may drive rows of several controllers
    return list(found.values())[:count]


def write_csv(folder, results):
    """Write ultimate, fatigue, constraints, extrapolation and runs (.csv) to a folder; return the paths."""
    folder = Path(folder)
    frames = {
        "ultimate": _ultimate(results),
        "fatigue": pd.DataFrame(
            [
                {
                    "channel": row.column, "controller": row.controller, "m": row.exponent,
                    "lifetime_DEL": row.value, "low": row.low, "high": row.high, "ratio": row.ratio,
                    "ratio_low": row.ratio_low, "ratio_high": row.ratio_high,
                    "shares": "; ".join(f"DLC {dlc} {100.0 * part:.1f} %" for dlc, part in row.share),
                }
                for row in results.lifetime
            ]
        ),
        "constraints": pd.DataFrame(
            [
                {
                    "constraint": flag.name, "controller": label, "value": flag.value, "unit": flag.unit,
                    "limit": flag.limit, "exceeded": flag.exceeded, "dlc": case.dlc, "case": case.name,
                    "seed": case.seed, "time_s": flag.time,
                }
                for label, flag, case in results.flags
            ]
        ),
        "extrapolation": pd.DataFrame(
            [
                {
                    "channel": column, "side": side, "controller": label, "years": each.years,
                    "value": each.value, "low": each.low, "high": each.high, "block_maxima": each.block,
                    "largest_simulated": each.largest, "governing": each.governing,
                    **dict(zip(("inverse_form", "form_wind_m_s", "form_Hs_m"),
                               results.forms.get((label, column, side), ()), strict=False)),
                }
                for (label, column, side), each in results.extrapolations.items()
            ]
        ),
        "runs": pd.DataFrame(
            [
                {
                    "dlc": case.dlc, "case": case.name, "controller": case.controller, "seed": case.seed,
                    "analysis": case.analysis, "class": case.safety, "factor": case.factor,
                    "hours_per_year": case.hours_per_year, "wind_m_s": case.wind_speed, "Hs_m": case.Hs,
                    "Tp_s": case.Tp, "yaw_error_deg": case.yaw_error, "misalignment_deg": case.misalignment,
                }
                for case in results.cases
            ]
        ),
    }  # fmt: skip
    return [write_table(frame, folder / f"{name}.csv") for name, frame in frames.items()]


def _ultimate(results):
    """Return the DataFrame of the design extremes, with simultaneous values as text."""
    cases = {case.name: case for case, _ in results.runs}
    return pd.DataFrame(
        [
            {
                "channel": row.column, "side": row.side, "controller": row.controller,
                "design_load": row.factored, "low": row.low, "high": row.high,
                "characteristic_load": row.value, "rule": row.characteristic, "factor": row.factor,
                "largest": row.largest, "dlc": row.dlc, "case": row.name, "seed": row.seed,
                "time_s": row.time, "difference": row.difference, "difference_low": row.difference_low,
                "difference_high": row.difference_high,
                "not_for_design": absent_part(row.column, cases[row.name].case),
                "simultaneous": "; ".join(f"{name} {value:.6g}" for name, value in row.at.items()),
            }
            for row in results.extremes
        ]
    )  # fmt: skip
