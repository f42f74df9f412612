"""How much of the performance limit of linear control a controller reaches, per wind speed.

    fowt scores bound results/rl --group agents=policy:ppo_lqr,policy:ppo_lqr_seed1 --plot front.png

The limit (design/linear_bound.py) holds for linear feedback at the blade-pitch travel and power deviation
of gspi_oc3: a controller that spends more of either is not held by it, and is marked.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.errors import InputError
from fowt_env.training.design.linear_bound import BOUND, RATIOS, fraction_of_bound, ratio_table
from fowt_env.training.evaluation.results_table import KEY
from fowt_env.training.reports.scores import frame_markdown, grouped

BASELINE = "gspi_oc3"  # whose travel and power the limit keeps
WIND = "wind_[m/s]"
MORE = 1.02  # ratios of travel and power deviation above this are more than those of gspi_oc3


def read_bound(path=None):
    """bound_table of a file that fowt design bound wrote; None: the one of this package."""
    file = BOUND if path is None else Path(path)
    if not file.is_file():
        raise InputError(
            f"performance limit {str(file)!r}: there is no such file; make it with fowt design bound --out"
        )
    return pd.read_csv(file)


def bound_fractions(table, bound, groups=None, agents=None):
    """DataFrame: per agent or group, each of its training seeds and wind: fraction of the limit reached.

    table: of an evaluation with gspi_oc3, cases named kind_WIND; groups, agents as
    scores.grouped takes them. Columns: agent, seed_of (label of the training seed; "" for the
    agent as a whole, whose ratios are the means over its seeds), wind, ratios of linear_bound.RATIOS (mean
    over the weather seeds on which both succeeded), of_bound_[-], of_measured_[-] (NaN: no better than
    gspi_oc3, or none of the limit's winds), within (no more travel and power deviation than gspi_oc3's).
    Raises: InputError without gspi_oc3, without cases at winds of the limit, or where no run succeeded.
    """
    chosen = grouped(table, [BASELINE], groups, agents)
    winds = set(bound[WIND])
    good = table[(table["status"] == "ok") & table["case"].map(_wind).isin(winds)]
    base = good[good["controller"] == BASELINE]
    if base.empty:
        raise InputError("results: no run of gspi_oc3 at a wind of the limit succeeded (cases kind_WIND)")
    kinds = {case.rpartition("_")[0] for case in base["case"]}
    if len(kinds) > 1:
        raise InputError(f"results: cases of several kinds ({', '.join(sorted(kinds))}): choose one's cases")
    rows = []
    for name, labels in chosen.items():
        parts = [_ratios(good[good["controller"] == label], base, bound, label) for label in labels]
        parts = [part for part in parts if len(part)]
        if not parts:
            raise InputError(f"{name}: no run at a wind of the limit succeeded")
        if len(labels) > 1:
            rows += [part.assign(agent=name) for part in parts]
        whole = pd.concat(parts).groupby(WIND, as_index=False)[list(RATIOS)].mean()
        whole = _with_fractions(whole, bound)
        rows.append(whole.assign(agent=name, seed_of=""))
    found = pd.concat(rows, ignore_index=True)
    found["within"] = (found["travel_ratio_[-]"] <= MORE) & (found["power_ratio_[-]"] <= MORE)
    first = ["agent", "seed_of", WIND]
    return found[[*first, *found.columns.drop(first)]]


def _wind(case):
    """Wind speed at the end of a case's name, or NaN."""
    try:
        return float(case.rpartition("_")[2])
    except ValueError:
        return float("nan")


def _ratios(own, base, bound, label):
    """ratio_table of one label over gspi_oc3 on the runs that both have."""
    shared = own.merge(base[KEY[1:]], on=KEY[1:])[KEY[1:]]
    if shared.empty:
        return pd.DataFrame()
    pair = pd.concat([frame.merge(shared, on=KEY[1:]) for frame in (base, own)])
    return _with_fractions(ratio_table(pair.rename(columns={"controller": "variant"})), bound).assign(
        seed_of=label
    )


def _with_fractions(ratios, bound):
    """The ratios with their fractions of the limit, and of that for measured channels."""
    result = ratios.drop(columns="variant", errors="ignore").copy()
    for information, column in (("full", "of_bound_[-]"), ("measured", "of_measured_[-]")):
        result[column] = [
            fraction_of_bound(bound, wind, speed, lean, information)
            for wind, speed, lean in result[[WIND, "speed_ratio_[-]", "pitch_ratio_[-]"]].to_numpy()
        ]
    return result


def bound_markdown(fractions, column="of_bound_[-]"):
    """Markdown text of bound_fractions: agents by winds; in brackets where travel or power deviation is more.

    A group has the range over its training seeds behind the fraction of its mean ratios; "worse" is a
    controller that is no better than gspi_oc3 in either deviation.
    """
    rows = {}
    winds = sorted(fractions[WIND].unique())
    for name, here in fractions.groupby("agent", sort=False):
        cells = {}
        for wind in winds:
            at = here[here[WIND] == wind]
            cells[f"{wind:g} m/s"] = _cell(at[at["seed_of"] == ""], at[at["seed_of"] != ""], column)
        rows[f"`{name}`"] = cells
    wide = pd.DataFrame.from_dict(rows, orient="index")
    full = column == "of_bound_[-]"
    wide.index.name = "fraction of the performance limit" if full else "fraction, measured channels"
    return frame_markdown(wide)


def _cell(whole, seeds, column):
    """Text of one agent at one wind."""
    if whole.empty:
        return "-"
    fraction, within = whole[column].iloc[0], whole["within"].iloc[0]
    text = "worse" if not np.isfinite(fraction) else f"{fraction:.2f}"
    if len(seeds) and np.isfinite(seeds[column]).any():
        text += f" ({seeds[column].min():.2f} to {seeds[column].max():.2f})"
    return text if within else f"[{text}]"
