"""Computes the fraction of the performance limit of linear control that a controller reaches, per wind speed.

    fowt dev scores bound results/rl --group agents=policy:ppo_lqr,policy:runs/mine/best.npz --plot front.png

The limit depends on the controller's information and actuators (training/design/linear_bound.py): preview
of the wind, five sensors or fewer, torque and blade pitch or blade pitch alone. It applies to linear feedback
at the blade-pitch travel and power deviation of gspi_oc3; a controller with more of either is marked.
"""

import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.control import make
from fowt_env.controllers import DESIGN, POLICY
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.training.design.linear_bound import (
    BOUND,
    KNOWN,
    LIDAR,
    PITCH_ONLY,
    RATIOS,
    fraction_of_bound,
    ratio_table,
)
from fowt_env.training.evaluation.results_table import KEY
from fowt_env.training.reports.scores import frame_markdown, grouped

BASELINE = "gspi_oc3"  # the limit holds at its pitch travel and power deviation
WIND = "wind_[m/s]"
MORE = 1.02  # ratio of travel or power deviation to gspi_oc3 above which the limit does not apply
TORQUE_TRAVEL = "torque_travel_[kN-m/s]"
MOVED = 1.5  # ratio of torque travel to that of gspi_oc3 above which a controller uses the torque
FREE = {"time", "generator_torque", "generator_speed", "plant_model"}  # inputs available to every limit


def read_bound(path=None):
    """Return the table of performance limits written by fowt design bound; None: the packaged table."""
    file = BOUND if path is None else Path(path)
    if not file.is_file():
        raise InputError(
            f"performance limit {str(file)!r}: no such file; create it with fowt design bound --out"
        )
    return pd.read_csv(file)


def limit_for(information, uses_torque, bound, preview_times=()):
    """Return the name of the limit in a bound_table that applies to a controller, or None.

    information    inputs of the controller: Measurement fields and PRIVILEGED_INPUTS (fowt_env.control)
    uses_torque    whether it uses the generator torque above rated wind
    preview_times  preview times of the wind, s; () with "wind_preview": the longest of the table
    Preview is assumed exact. The next longer preview time of the table is used, with the same sensors or else
    with all states measured (limits differ by less than 1 %). None applies to a lidar.
    """
    used, limits = set(information) - FREE, list(bound["information"].unique())
    if "lidar" in used:
        name = LIDAR if uses_torque else LIDAR + PITCH_ONLY
        return name if name in limits else None
    ahead = "wind_preview" in used
    name, end = known_by(used)[0], "" if uses_torque else PITCH_ONLY
    if not ahead:
        return name + end if name + end in limits else None
    times = {}
    for kind in ("full", name):
        matches = (re.fullmatch(rf"{kind}_preview_([\d.]+){end}", limit) for limit in limits)
        times |= {float(match[1]): match[0] for match in matches if match}
    horizon = max(preview_times, default=max(times, default=0.0))
    return next((times[time] for time in sorted(times) if time >= horizon), None)


def known_by(information):
    """Return the item of KNOWN with the fewest sensors that include the inputs of a controller.

    Preview and lidar are not counted.
    """
    used = set(information) - FREE - {"lidar", "wind_preview"}
    if "wind_preview" in information:
        used -= {"wind_speed"}  # the preview begins with the present wind
    fitting = [name for name, (_, sensors) in KNOWN.items() if sensors is None or used <= set(sensors)]
    return fitting[-1], KNOWN[fitting[-1]]


def bound_fractions(table, bound, groups=None, agents=None, information=None):
    """Return a DataFrame with the fraction of the limit reached per agent or group, training seed and wind.

    table: of an evaluation with gspi_oc3, cases named kind_WIND; groups, agents: as in scores.grouped.
    information: {label: (inputs, preview_times)}; other controllers declare them, or are assumed to have full
    information. Columns: agent, seed_of (label of the training seed; "" for the means over the seeds), ratios
    of linear_bound.RATIOS (mean over the weather seeds on which both succeeded), limit (name of limit_for),
    of_limit_[-] (NaN: no better than gspi_oc3, or not at a wind of the limit), within (no more travel and
    power deviation than gspi_oc3's). A group has the limit of its first member.
    Raises: InputError without gspi_oc3, without cases at winds of the limit, or if no run succeeded.
    """
    chosen = grouped(table, [BASELINE], groups, agents)
    winds = set(bound[WIND])
    good = table[(table["status"] == "ok") & table["case"].map(_wind).isin(winds)]
    base = good[good["controller"] == BASELINE]
    if base.empty:
        raise InputError("results: no run of gspi_oc3 at a wind of the limit succeeded (cases kind_WIND)")
    kinds = {case.rpartition("_")[0] for case in base["case"]}
    if len(kinds) > 1:
        raise InputError(f"results: cases of several kinds ({', '.join(sorted(kinds))}): select one kind")
    rows = []
    for name, labels in chosen.items():
        used, times = (information or {}).get(labels[0]) or declared(labels[0])
        limit = limit_for(used, moves_torque(good, base, labels), bound, times)
        parts = [_ratios(good[good["controller"] == label], base, label) for label in labels]
        parts = [part for part in parts if len(part)]
        if not parts:
            raise InputError(f"{name}: no run at a wind of the limit succeeded")
        whole = pd.concat(parts).groupby(WIND, as_index=False)[list(RATIOS)].mean().assign(seed_of="")
        for part in [*(parts if len(labels) > 1 else []), whole]:
            ratios = part[[WIND, "speed_ratio_[-]", "pitch_ratio_[-]"]].to_numpy()
            reached = [np.nan if limit is None else fraction_of_bound(bound, *each, limit) for each in ratios]
            rows.append(part.assign(agent=name, limit=limit or "none", **{"of_limit_[-]": reached}))
    result = pd.concat(rows, ignore_index=True)
    result["within"] = (result["travel_ratio_[-]"] <= MORE) & (result["power_ratio_[-]"] <= MORE)
    return result[["agent", "seed_of", WIND, *RATIOS, "limit", "of_limit_[-]", "within"]]


def declared(label):
    """Return (inputs, preview_times) that a controller declares, by its label in a table.

    The user's code is not run, and a label may name a file that no longer exists: such a controller is
    assumed to have full information without preview.
    """
    if ":" not in label or label.startswith((POLICY, DESIGN)):
        with suppress(InputError):
            controller = make(label, read_turbine("nrel5mw"), 0.1)
            return tuple(controller.information), tuple(getattr(controller, "preview_times", ()))
    return ("surge",), ()


def moves_torque(good, base, labels):
    """Return whether the torque travel is more than MOVED times that of gspi_oc3 on the same runs."""
    runs = good[good["controller"].isin(labels)].merge(base[[*KEY[1:], TORQUE_TRAVEL]], on=KEY[1:])
    travels = runs[[f"{TORQUE_TRAVEL}_x", f"{TORQUE_TRAVEL}_y"]].mean()
    return bool(travels.iloc[0] > MOVED * travels.iloc[1])


def _wind(case):
    """Return the wind speed at the end of a case's name, or NaN."""
    try:
        return float(case.rpartition("_")[2])
    except ValueError:
        return float("nan")


def _ratios(runs, base, label):
    """Return the ratio_table of one label over gspi_oc3 on their common runs."""
    shared = runs.merge(base[KEY[1:]], on=KEY[1:])[KEY[1:]]
    if shared.empty:
        return pd.DataFrame()
    pair = pd.concat([frame.merge(shared, on=KEY[1:]) for frame in (base, runs)])
    ratios = ratio_table(pair.rename(columns={"controller": "variant"}))
    return ratios.drop(columns="variant").assign(seed_of=label)


def bound_markdown(fractions):
    """Return the markdown table of bound_fractions: agents by winds.

    [0.9]: more travel or power deviation than gspi_oc3; (0.8 to 0.9): range over the training seeds of a
    group; "worse": no better than gspi_oc3 in either deviation; "-": no limit for its information.
    """
    rows, column = {}, "of_limit_[-]"
    for name, here in fractions.groupby("agent", sort=False):
        cells = rows[f"`{name}`"] = {"limit": here["limit"].iloc[0]}
        for wind in sorted(fractions[WIND].unique()):
            at = here[here[WIND] == wind].set_index("seed_of")
            text, seeds = "-", at[column].drop("", errors="ignore")
            if "" in at.index and cells["limit"] != "none":
                fraction = at.loc["", column]
                text = f"{fraction:.2f}" if np.isfinite(fraction) else "worse"
                text += f" ({seeds.min():.2f} to {seeds.max():.2f})" if seeds.notna().any() else ""
                text = text if at.loc["", "within"] else f"[{text}]"
            cells[f"{wind:g} m/s"] = text
    wide = pd.DataFrame.from_dict(rows, orient="index")
    wide.index.name = "fraction of the performance limit"
    return frame_markdown(wide)
