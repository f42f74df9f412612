"""Tabulates the design extremes of load channels over the ultimate load cases, per controller.

A characteristic load follows from the realisations of a condition by the rule of its design load case (the
largest, the mean, or the mean of the upper half of the seeds' extremes). The design load is the largest of
characteristic load times partial factor over all conditions.
"""

from dataclasses import dataclass, field, replace
from math import nan

import numpy as np

from fowt_env.training.loads.selection import (
    bounds,
    columns_of,
    conditions_of,
    controllers_of,
    drawn_seeds,
    runs_of,
)

SIDES = ("max", "min")
EXTRAPOLATED = "extrapolated"  # characteristic that needs training.loads.extrapolation


@dataclass(frozen=True)
class Extreme:
    """Holds the design extreme of one channel and side of a controller, and the run that is closest to it.

    value: characteristic load, factored: times the partial factor; largest: of a single run, without factor.
    at: simultaneous values {column: value} of the driving run, without factor. low, high: 95 % interval of
    the factored value over the seeds. difference: of the factored value from the baseline controller's, with
    its interval, paired in the seeds.
    """

    column: str
    side: str
    controller: str
    value: float
    factored: float
    factor: float
    dlc: str
    name: str
    seed: int
    time: float  # s
    largest: float
    characteristic: str
    at: dict = field(default_factory=dict)
    low: float = nan
    high: float = nan
    difference: float = nan
    difference_low: float = nan
    difference_high: float = nan


def characteristic(values, rule):
    """Return the characteristic value over the last axis of extremes (..., seeds), where more is worse.

    rule: "largest"; "mean"; "upper_half": mean of the larger half, the middle one of an odd number included.
    """
    if rule == "largest":
        return values.max(axis=-1)
    if rule == "mean":
        return values.mean(axis=-1)
    if rule == "upper_half":
        return np.sort(values, axis=-1)[..., values.shape[-1] // 2 :].mean(axis=-1)
    raise ValueError(rule)


def extreme_table(runs, columns=None, baseline=None, extrapolated=None):
    """Return [Extreme] of every channel, side and controller of runs [(LoadCase, RunStatistics)].

    columns       those that are tabulated; None: all that the runs have, except the time
    baseline      controller that others are compared with; None: the first
    extrapolated  {(controller, column, side): Extrapolation}: the characteristic load of conditions whose
                  rule is "extrapolated", which have none without it
    Channels without a run of analysis "ultimate" or "both" are left out.
    """
    ultimate = [run for run in runs if run[0].analysis in ("ultimate", "both")]
    if not ultimate:
        return []
    columns = columns_of(ultimate)[1:] if columns is None else columns
    labels = controllers_of(ultimate)
    baseline = labels[0] if baseline is None else baseline
    conditions = {label: conditions_of(runs_of(ultimate, label)) for label in labels}
    table = []
    for column in columns:
        for side in SIDES:
            sign = 1.0 if side == "max" else -1.0
            found = {
                label: _driving(conditions[label], column, side, sign, label, extrapolated or {})
                for label in labels
            }
            drawn = {label: each[1] for label, each in found.items() if each is not None}
            for label, each in found.items():
                if each is not None:
                    table.append(_with_intervals(each[0], sign, drawn, found, label, baseline, conditions))
    return table


def _driving(conditions, column, side, sign, label, extrapolated):
    """Return (Extreme of one controller, resampled design loads (k,) times sign), or None without a value."""
    loads = []  # factored characteristic times sign, its condition, rule, extremes of the seeds
    for key, members in conditions.items():
        case = members[0][0]
        values = sign * np.array([each.value(column, side) for _, each in members])
        if not np.isfinite(values).all():
            continue
        rule = case.characteristic
        if rule == EXTRAPOLATED:
            known = extrapolated.get((label, column, side))
            if known is None or known.governing != case.name:
                continue
            load = sign * known.value
        else:
            load = characteristic(values, rule)
        loads.append((_factored(load, factor_of(case, column)), key, rule, values, load))
    if not loads:
        return None
    design, key, rule, values, load = max(loads, key=lambda entry: entry[0])
    # of the seeds, the run whose extreme is closest to the characteristic load
    index = int(np.argmin(np.abs(values - load)))
    case, own = conditions[key][index]
    extreme = Extreme(
        column, side, label, sign * load, sign * design, factor_of(case, column),
        case.dlc, case.name, case.seed,
        own.value(column, f"time_{side}"), sign * values.max(), rule, own.at.get(column, {}).get(side, {}),
    )  # fmt: skip
    factors = {key: factor_of(members[0][0], column) for key, members in conditions.items()}
    return extreme, _resampled(loads, factors, sign, extrapolated.get((label, column, side)))


def factor_of(case, column):
    """Return the partial factor of a channel in a LoadCase: that for loads of forces and moments, else 1."""
    return case.factor if column.endswith(("_[kN]", "_[kN-m]", "_[N]", "_[N-m]")) else 1.0


def _factored(load, factor):
    """Return a load times its partial factor; a load of the other sign, which is favourable, is divided."""
    return load * factor if load > 0.0 else load / factor


def _resampled(loads, factors, sign, extrapolation):
    """Return the design loads (k,) of resampled seeds; conditions that cannot govern in any are left out."""
    least = max(
        _factored(values.min(), factors[key])
        for _, key, rule, values, _ in loads
        if rule != EXTRAPOLATED or len(loads) == 1
    )
    draws = drawn_seeds([len(values) for *_, values, _ in loads])
    result = None
    for _, key, rule, values, _ in loads:
        factor = factors[key]
        if rule == EXTRAPOLATED:
            load = sign * extrapolation.drawn
        elif _factored(values.max(), factor) < least:
            continue
        else:
            load = characteristic(values[draws[len(values)]], rule)
        own = np.where(load > 0.0, load * factor, load / factor)
        result = own if result is None else np.maximum(result, own)
    return result


def _with_intervals(extreme, sign, drawn, found, label, baseline, conditions):
    """Return the Extreme with the interval of its value and of its difference from the baseline's."""
    seeds = max(len(members) for members in conditions[label].values())
    low, high = sorted(bounds(extreme.factored, sign * drawn[label], seeds))
    extreme = replace(extreme, low=low, high=high)
    if label == baseline or found.get(baseline) is None:
        return extreme
    difference = extreme.factored - found[baseline][0].factored
    low, high = bounds(difference, sign * (drawn[label] - drawn[baseline]), seeds)
    return replace(extreme, difference=difference, difference_low=low, difference_high=high)


def flag_table(runs):
    """Return [(controller, Flag, LoadCase)] of the worst value of each constraint over all runs."""
    rows = []
    for label in controllers_of(runs):
        worst = {}
        for case, each in runs_of(runs, label):
            for flag in each.flags:
                old = worst.get(flag.name)
                if old is None or flag.worse_than(old[0]):
                    worst[flag.name] = (flag, case)
        rows += [(label, flag, case) for flag, case in worst.values()]
    return rows


def beyond_counts(runs):
    """Return {(controller, constraint): number of runs in which it is exceeded}."""
    return {
        (label, name): sum(
            any(flag.name == name and flag.exceeded for flag in each.flags)
            for _, each in runs_of(runs, label)
        )
        for label in controllers_of(runs)
        for name in dict.fromkeys(flag.name for _, each in runs_of(runs, label) for flag in each.flags)
    }
