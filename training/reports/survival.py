"""Tabulates the faults that each controller survives, from an evaluation of the suite faults."""

import numpy as np
import pandas as pd

from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.run_case import FAILED
from fowt_env.training.reports.scores import kind_of, wide_markdown

FIGURES = {  # heading: column of the survival table, digits
    "largest rotor speed (% of rated)": ("rotor_speed", 0),
    "largest platform pitch (deg)": ("platform_pitch", 1),
    "largest tower-base moment (MN m)": ("tower_base", 0),
    "largest fairlead tension (kN)": ("tension", 0),
    "longest time to standstill (s)": ("standstill", 0),
}
NEVER = "-"  # a run did not come to rest


def survival(table, limits=None):
    """Return a DataFrame with runs, survived runs, trips, largest motions and loads per kind and controller.

    table    as of read_results
    limits   {metric: maximum value} of a survived run; None: those of the suite faults
    A run survives if it neither fails (capsize, numerical divergence, controller error) nor exceeds a
    limit; a trip is not a failure. Platform pitch and moment: the larger of both directions. standstill: NaN
    if a stopped run does not come to rest.
    """
    limits = read_suite("faults").limits.run if limits is None else limits
    kept = table["status"] != FAILED
    for metric, limit in limits.items():
        kept = kept & (table[metric] <= limit)
    runs = pd.DataFrame(
        {
            "kind": table["case"].map(kind_of),
            "controller": table["controller"],
            "survived": kept,
            "trip": table["reason"].fillna("").str.extract("^(.*) trip at ", expand=False),
            "rotor_speed": 100.0 + table["overspeed_[%]"],
            "platform_pitch": _size(table, "PtfmPitch_{}_[deg]"),
            "tower_base": 1e-3 * _size(table, "TwrBsMyt_{}_[kN-m]"),
            "tension": table["FAIRTEN_max_[kN]"],
            "standstill": table["standstill_time_[s]"],
        }
    )
    rows = []
    for (kind, controller), here in runs.groupby(["kind", "controller"], sort=False):
        trips = ", ".join(f"{count} {name}" for name, count in here["trip"].value_counts().items())
        row = {"kind": kind, "controller": controller, "runs": len(here)}
        row |= {"survived": int(here["survived"].sum()), "trips": trips}
        rows.append(row | {n: here[n].max(skipna=n != "standstill") for n, _ in FIGURES.values()})
    return pd.DataFrame(rows)


def _size(table, name):
    """Return the larger magnitude of a channel's minimum and maximum."""
    return np.maximum(table[name.format("max")].abs(), table[name.format("min")].abs())


def survival_markdown(found):
    """Return markdown tables of `survival`: survived runs, motions and loads, trips."""

    def part(title, texts, rows=None):
        return wide_markdown(found, texts, title, "kind", "controller", rows)

    counts = [f"{kept} of {runs}" for kept, runs in zip(found["survived"], found["runs"], strict=True)]
    parts = [part("survived", counts)]
    for title, (column, digits) in FIGURES.items():
        texts = [NEVER if np.isnan(value) else f"{value:.{digits}f}" for value in found[column]]
        parts.append(part(title, texts, found["kind"][found[column].notna()].unique()))
    return "\n".join([*parts, part("trips", found["trips"].replace("", "none"))])
