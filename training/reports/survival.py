"""Which controllers survive which faults: tables of an evaluation of the suite faults."""

import re

import numpy as np
import pandas as pd

from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.run_case import FAILED
from fowt_env.training.reports.scores import frame_markdown, kind_of

FIGURES = {  # what is shown: column of the survival table, digits
    "largest rotor speed (% of rated)": ("rotor_speed", 0),
    "largest platform pitch (deg)": ("platform_pitch", 1),
    "largest tower-base moment (MN m)": ("tower_base", 0),
    "largest fairlead tension (kN)": ("tension", 0),
    "longest time to standstill (s)": ("standstill", 0),
}
NEVER = "-"  # of a time that some run does not have
TRIP = re.compile(r"^(.*) trip at ")


def survival(table, limits=None):
    """DataFrame by kind of case and controller: runs, those survived, trips, and the largest figures.

    table    of read_results
    limits   {metric: greatest value} that a run must keep to survive; None: those of the suite faults
    A run has survived that neither failed (capsize, numerical blow-up, a controller's error) nor passed a
    limit; a trip is no failure. Platform pitch and moment: the larger of both directions. standstill: NaN
    where a run that is stopped does not come to rest.
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
    """The larger size of a channel's least and greatest value."""
    return np.maximum(table[name.format("max")].abs(), table[name.format("min")].abs())


def _trip(reason):
    """Name of the trip that a run's reason tells of; "" for none."""
    found = TRIP.match(reason)
    return found.group(1) if found else ""


def _counted(trips):
    """Text of which trips there were, and how often."""
    counts = trips[trips != ""].value_counts()
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def survival_markdown(found):
    """Markdown text of survival: who survives what, the figures, and the trips."""
    kinds, names = (list(dict.fromkeys(found[key])) for key in ("kind", "controller"))
    shares = [f"{kept} of {runs}" for kept, runs in zip(found["survived"], found["runs"], strict=True)]
    parts = [_wide(found.assign(text=shares), "survived", kinds, names)]
    for title, (column, digits) in FIGURES.items():
        texts = [NEVER if np.isnan(value) else f"{value:.{digits}f}" for value in found[column]]
        shown = found.assign(text=texts)
        stopped = [kind for kind in kinds if (shown["text"][shown["kind"] == kind] != NEVER).any()]
        parts.append(_wide(shown, title, stopped, names))
    tripped = found.assign(text=found["trips"].replace("", "none"))
    parts.append(_wide(tripped, "trips", kinds, names))
    return "\n".join(parts)


def _wide(found, title, kinds, names):
    wide = found.pivot(index="kind", columns="controller", values="text").loc[kinds, names]
    wide.index.name = title
    wide.columns = [f"`{name}`" for name in names]
    return frame_markdown(wide)
