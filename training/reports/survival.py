"""Tables of the faults that each controller survives, from an evaluation of the suite faults."""

import re

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
TRIP = re.compile(r"^(.*) trip at ")


def survival(table, limits=None):
    """Return a DataFrame by kind of case and controller: runs, survived runs, trips, largest motions, loads.

    table    of read_results
    limits   {metric: greatest value} of a survived run; None: those of the suite faults
    A run survived if it neither failed (capsize, numerical blow-up, a controller's error) nor exceeded a
    limit; a trip is no failure. Platform pitch and moment: the larger of both directions. standstill: NaN
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
            "trip": [_trip(text) for text in table["reason"].fillna("")],
            "rotor_speed": 100.0 + table["overspeed_[%]"],
            "platform_pitch": _size(table, "PtfmPitch_{}_[deg]"),
            "tower_base": 1e-3 * _size(table, "TwrBsMyt_{}_[kN-m]"),
            "tension": table["FAIRTEN_max_[kN]"],
            "standstill": table["standstill_time_[s]"],
        }
    )
    figures = [name for name, _ in FIGURES.values()]
    rows = []
    for (kind, controller), here in runs.groupby(["kind", "controller"], sort=False):
        row = {"kind": kind, "controller": controller, "runs": len(here)}
        row |= {"survived": int(here["survived"].sum()), "trips": _counted(here["trip"])}
        rows.append(row | {name: here[name].max(skipna=name != "standstill") for name in figures})
    return pd.DataFrame(rows)


def _size(table, name):
    """Return the larger magnitude of a channel's least and greatest value."""
    return np.maximum(table[name.format("max")].abs(), table[name.format("min")].abs())


def _trip(reason):
    """Return the name of the trip in a run's reason; "" for none."""
    found = TRIP.match(reason)
    return found.group(1) if found else ""


def _counted(trips):
    """Return a text of the trips and their counts."""
    counts = trips[trips != ""].value_counts()
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def survival_markdown(found):
    """Return markdown tables of `survival`: survived runs, motions and loads, trips."""
    kinds, names = (list(dict.fromkeys(found[key])) for key in ("kind", "controller"))
    shares = [f"{kept} of {runs}" for kept, runs in zip(found["survived"], found["runs"], strict=True)]
    parts = [wide_markdown(found.assign(text=shares), "survived", "kind", kinds, "controller", names)]
    for title, (column, digits) in FIGURES.items():
        texts = [NEVER if np.isnan(value) else f"{value:.{digits}f}" for value in found[column]]
        shown = found.assign(text=texts)
        stopped = [kind for kind in kinds if (shown["text"][shown["kind"] == kind] != NEVER).any()]
        parts.append(wide_markdown(shown, title, "kind", stopped, "controller", names))
    tripped = found.assign(text=found["trips"].replace("", "none"))
    parts.append(wide_markdown(tripped, "trips", "kind", kinds, "controller", names))
    return "\n".join(parts)
