"""Controllers compared on equal seeds: means with intervals, paired differences, and a suite's score.

Seeds are resampled, with all their cases (bootstrap.py), and each case counts alike in a mean over
cases.
"""

import numpy as np

from fowt_env.errors import unknown
from fowt_env.training.evaluation.bootstrap import LEAST_SEEDS, LEVEL, RESAMPLES, interval, resample_weights
from fowt_env.training.evaluation.faults import PARKED
from fowt_env.training.evaluation.metrics import METRICS, never_negative

BASELINES = ("gspi_oc3", "pi")  # the first of these that was evaluated, unless one is named
POSITIVE = np.array([never_negative(name) for name in METRICS])
MOST_OF_REFERENCE = 1e6  # larger differences, as multiples of the baseline's own value, get no percentage
METHOD = (
    "percentile bootstrap over seeds, each with all its cases, widened for n seeds by sqrt(n/(n-1)) and by"
    " Student's t with n-1 degrees of freedom over the normal; of the logarithm where a figure cannot be"
    f" negative; none below {LEAST_SEEDS} seeds; every case counts alike; differences are paired by case and"
    " seed, and there is none of a controller with failed runs"
)


def case_means(values, weights):
    """(resamples, metrics) weighted means over the seeds of values (seeds, metrics); NaN is no value.

    With a single value there is nothing to resample: it is the mean of every resample. A resample that has
    drawn no value is NaN.
    """
    there = np.isfinite(values)
    filled = np.where(there, values, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = (weights @ filled) / (weights @ there.astype(np.float64))
    single = there.sum(axis=0) == 1
    means[:, single] = filled[:, single].sum(axis=0)
    return means


def default_baseline(controllers, baseline=None, failed=()):
    """Name of the controller that others are compared with; None: there is none.

    It is the one that is named; else the first of BASELINES, or of all, that is not in `failed` (those with
    failed runs).
    Raises: InputError if it was not evaluated.
    """
    if baseline is not None:
        if baseline not in controllers:
            raise unknown("baseline among the evaluated controllers", baseline, controllers)
        return baseline
    able = [name for name in controllers if name not in failed]
    return next((name for name in BASELINES if name in able), next(iter(able), None))


class _Grid:
    """Metrics of a table by controller, case and seed; NaN where a run failed or was not made."""

    def __init__(self, table):
        self.controllers = list(dict.fromkeys(table["controller"]))
        self.cases = list(dict.fromkeys(table["case"]))
        self.seeds = sorted(set(table["seed"]))
        self.runs = np.zeros((len(self.controllers), len(self.cases), len(self.seeds)), dtype=bool)
        self.failed = self.runs.copy()
        self.values = np.full((*self.runs.shape, len(METRICS)), np.nan)
        figures = table[list(METRICS)].to_numpy(dtype=np.float64)
        places = [
            {name: number for number, name in enumerate(axis)}
            for axis in (self.controllers, self.cases, self.seeds)
        ]
        for number, key in enumerate(zip(table["controller"], table["case"], table["seed"], strict=True)):
            at = tuple(place[name] for place, name in zip(places, key, strict=True))
            self.runs[at] = True
            self.failed[at] = table["status"].iloc[number] != "ok"
            if not self.failed[at]:
                self.values[at] = figures[number]


def _figures(values, weights, positive=False):
    """(estimate, low, high), each (metrics,), of the mean of values (cases, seeds, metrics).

    positive: which of them cannot be below zero (bootstrap.interval).
    """
    used = np.isfinite(values).any(axis=(1, 2))
    if not used.any():
        empty = np.full(values.shape[-1], np.nan)
        return empty, empty, empty
    one = np.ones((1, values.shape[1]))
    with np.errstate(invalid="ignore"):
        estimate = np.mean([case_means(case, one)[0] for case in values[used]], axis=0)
        resampled = np.mean([case_means(case, weights) for case in values[used]], axis=0)
    seeds = int(np.isfinite(values).any(axis=(0, 2)).sum())
    return estimate, *interval(estimate, resampled, seeds, positive)


def _seed_range(values):
    """(least, greatest), each (metrics,), over the seeds of the mean over cases; of seeds with every case."""
    used = np.isfinite(values).any(axis=(1, 2))
    means = values[used].mean(axis=0) if used.any() else np.full(values.shape[1:], np.nan)
    there = np.isfinite(means)
    ends = np.where(there, means, np.inf).min(axis=0), np.where(there, means, -np.inf).max(axis=0)
    return tuple(np.where(there.any(axis=0), end, np.nan) for end in ends)


def _named(estimate, low, high, **more):
    """{metric: {"mean", "low", "high", ...}} of arrays over METRICS."""
    columns = {"mean": estimate, "low": low, "high": high, **more}
    return {
        name: {key: float(column[i]) for key, column in columns.items()} for i, name in enumerate(METRICS)
    }


def leaderboard(table, baseline=None, score=None, cases=None):
    """Mapping of plain values: how the controllers of an evaluation's table compare.

    baseline   controller of the paired differences; None: gspi_oc3, else pi, else the first, of those
               without failed runs
    score      training.evaluation.cases.Score of a suite, or None
    cases      names of the cases that count; None: all
    Keys: baseline (None: every controller has failed runs), interval (level, method, resamples,
    least_seeds), cases, seeds, controllers: a list of mappings with controller, runs, failed, metrics
    {metric: mean, low, high, seed_low, seed_high, worst}, difference {metric: mean, low, high, percent,
    pairs}, score (mean, low, high, valid, why; None without one), cases {case: runs, failed, metrics,
    difference}. seed_low and seed_high are the range over the seeds of the mean over cases, worst the
    greatest over all runs; percent the mean difference over the baseline's mean of the same runs.
    Controllers with failed runs stand last and have no difference (NaN), whatever the cases: who fails in
    bad weather has good means.
    Raises: InputError for a baseline that was not evaluated.
    """
    if cases is not None:
        table = table[table["case"].isin(cases)]
    grid = _Grid(table)
    lost = [name for name, failed in zip(grid.controllers, grid.failed, strict=True) if failed.any()]
    baseline = default_baseline(
        [name for name in grid.controllers if name != PARKED] or grid.controllers, baseline, lost
    )
    weights = resample_weights(max(1, len(grid.seeds)))
    nothing = np.full(grid.values.shape[1:], np.nan)
    base = nothing if baseline is None else grid.values[grid.controllers.index(baseline)]
    entries = []
    for number, name in enumerate(grid.controllers):
        values, runs, failed = grid.values[number], grid.runs[number], grid.failed[number]
        other = nothing if failed.any() else base
        entry = {"controller": name, **_entry(values, other, runs, failed, weights)}
        entry["score"] = None if score is None else _score(score, grid, number, weights)
        entry["cases"] = {
            case: _entry(values[i : i + 1], other[i : i + 1], runs[i : i + 1], failed[i : i + 1], weights)
            for i, case in enumerate(grid.cases)
            if runs[i].any()
        }
        entries.append(entry)
    entries.sort(key=lambda entry: entry["failed"] > 0)
    return {
        "baseline": baseline,
        "interval": {
            "level": LEVEL,
            "method": METHOD,
            "resamples": RESAMPLES,
            "least_seeds": LEAST_SEEDS,
        },
        "cases": grid.cases,
        "seeds": [int(seed) for seed in grid.seeds],
        "controllers": entries,
    }


def _entry(values, base, runs, failed, weights):
    """Figures of one controller over some cases; arrays (cases, seeds[, metrics])."""
    estimate, low, high = _figures(values, weights, POSITIVE)
    least, greatest = _seed_range(values)
    with np.errstate(all="ignore"):
        filled = np.where(np.isfinite(values), values, -np.inf).max(axis=(0, 1))
    worst = np.where(np.isfinite(filled), filled, np.nan)
    pairs = np.isfinite(values - base)
    gap, gap_low, gap_high = _figures(values - base, weights)
    # the baseline over the same runs, so that a failed run does not shift it
    reference = _figures(np.where(pairs, base, np.nan), np.ones((1, weights.shape[1])))[0]
    # a ratio to zero, or to what rounding left of zero, says nothing
    measured = np.abs(gap) < MOST_OF_REFERENCE * np.abs(reference)
    percent = 100.0 * np.divide(gap, np.abs(reference), out=np.full_like(gap, np.nan), where=measured)
    return {
        "runs": int(runs.sum()),
        "failed": int(failed.sum()),
        "metrics": _named(estimate, low, high, seed_low=least, seed_high=greatest, worst=worst),
        "difference": _named(
            gap, gap_low, gap_high, percent=percent, pairs=pairs.sum(axis=(0, 1)).astype(float)
        ),
    }


def _score(score, grid, number, weights):
    """{"mean", "low", "high", "valid", "why"} of a controller by a Score; figures are None with a reason."""
    nothing = {"mean": None, "low": None, "high": None, "valid": False}
    if score.baseline not in grid.controllers:
        return nothing | {"why": f"needs the controller {score.baseline!r} in the evaluation"}
    place = grid.controllers.index(score.baseline)
    for failed, whose in ((grid.failed[number], ""), (grid.failed[place], f" of {score.baseline!r}")):
        if failed.any():
            count = int(failed.sum())
            return nothing | {"why": f"{count} failed run{'' if count == 1 else 's'}{whose}"}
    paired = np.isfinite(grid.values[number] - grid.values[place])
    own, base = (np.where(paired, grid.values[i], np.nan) for i in (number, place))
    shared = paired.any(axis=(1, 2))
    if not shared.any():
        return nothing | {"why": "no run in common with the baseline"}

    def value(weights):
        ratios = np.array(
            [case_means(a, weights) / case_means(b, weights) for a, b in zip(own, base, strict=True)]
        )
        ratio = {name: ratios[shared, :, i].mean(axis=0) for i, name in enumerate(METRICS)}
        total = sum(term.weight * ratio[term.metric] for term in score.term)
        total = total / sum(term.weight for term in score.term)
        return (total if score.power is None else total / ratio[score.power])[:, None]

    with np.errstate(all="ignore"):
        estimate = value(np.ones((1, len(grid.seeds))))[0]
        seeds = int(paired.any(axis=(0, 2)).sum())
        positive = all(never_negative(term.metric) for term in score.term)
        low, high = interval(estimate, value(weights), seeds, positive)
    why = []
    for name, limit in score.limits.items():
        worst = grid.values[number, ..., METRICS.index(name)][grid.runs[number]].max()
        if not worst <= limit:  # a run without the figure is not within its limit
            why.append(f"{name} = {worst:g}, allowed {limit:g}")
    figures = {"mean": float(estimate[0]), "low": float(low[0]), "high": float(high[0])}
    return figures | {"valid": not why, "why": "; ".join(why)}
