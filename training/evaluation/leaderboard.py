"""Controllers compared on equal seeds: means with intervals, paired differences, and a suite's score.

Seeds are resampled, with all their cases (bootstrap.py). A mean is that of the lifetime: each case counts by
its share of it, as the suite's site has its wind; without a site all count alike.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.display import html_table
from fowt_env.errors import unknown
from fowt_env.training.evaluation.bootstrap import (
    LEAST_SEEDS,
    LEVEL,
    RESAMPLES,
    interval,
    lifetime_means,
    p_values,
    resample_weights,
)
from fowt_env.training.evaluation.failures import failures_as_worst
from fowt_env.training.evaluation.faults import PARKED
from fowt_env.training.evaluation.metrics import METRICS, mean_exponent, never_negative
from fowt_env.training.evaluation.results_table import case_shares
from fowt_env.training.evaluation.run_case import OK, TRIPPED

BASELINES = ("gspi_oc3", "pi")  # the first of these that was evaluated, unless one is named
POSITIVE = np.array([never_negative(name) for name in METRICS])
SHOWN = {  # what a notebook shows of a leaderboard: {heading: metric}
    "rotor-speed std (rpm)": "RotSpeed_std_[rpm]",
    "platform-pitch std (deg)": "PtfmPitch_std_[deg]",
    "blade-pitch travel (deg/s)": "blade_pitch_travel_[deg/s]",
    "tower-base DEL (kN m)": "TwrBsMyt_DEL_[kN-m]",
}
MOST_OF_REFERENCE = 1e6  # larger differences, as multiples of the baseline's own value, get no percentage
EXPONENTS = np.array([mean_exponent(name) for name in METRICS])
METHOD = (
    "lifetime means: each case by its share of the lifetime, deviations by their squares, damage-equivalent"
    " loads by their S-N exponents; percentile bootstrap over seeds, each with all its cases, widened for n"
    " seeds by sqrt(n/(n-1)) and by Student's t with n-1 degrees of freedom over the normal; of the logarithm"
    f" where a figure cannot be negative; none below {LEAST_SEEDS} seeds; differences are paired by case and"
    " seed; a failed or tripped run has the worst figures of all controllers on its case"
)


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
    """Metrics of a table by controller, case and seed; NaN where a run was not made.

    Runs that failed or tripped have the worst of their case (failures.py). lost: those of them without a
    figure, since no controller has one.
    """

    def __init__(self, table):
        self.controllers = list(dict.fromkeys(table["controller"]))
        self.cases = list(dict.fromkeys(table["case"]))
        self.seeds = sorted(set(table["seed"]))
        self.runs = np.zeros((len(self.controllers), len(self.cases), len(self.seeds)), dtype=bool)
        self.failed, self.tripped = self.runs.copy(), self.runs.copy()
        self.values = np.full((*self.runs.shape, len(METRICS)), np.nan)
        self.shares = case_shares(table, self.cases)
        figures = failures_as_worst(table)[list(METRICS)].to_numpy(dtype=np.float64)
        places = [
            {name: number for number, name in enumerate(axis)}
            for axis in (self.controllers, self.cases, self.seeds)
        ]
        for number, key in enumerate(zip(table["controller"], table["case"], table["seed"], strict=True)):
            at = tuple(place[name] for place, name in zip(places, key, strict=True))
            status = table["status"].iloc[number]
            self.runs[at], self.tripped[at] = True, status == TRIPPED
            self.failed[at] = status not in (OK, TRIPPED)
            self.values[at] = figures[number]
        self.lost = (self.failed | self.tripped)[..., None] & ~np.isfinite(self.values)

    def parts(self, number, base, cases=slice(None)):
        """_Part of a controller (its number) over some cases, beside another (its number; None: none)."""
        at = number, cases
        other = np.full_like(self.values[at], np.nan) if base is None else self.values[base, cases]
        lost = self.lost[at] | (False if base is None else self.lost[base, cases])
        return _Part(
            self.values[at], other, self.runs[at], self.failed[at], self.tripped[at], lost, self.shares[cases]
        )


class _Part(NamedTuple):
    """What is known of a controller over some cases; arrays (cases, seeds[, metrics]), shares (cases,)."""

    values: np.ndarray
    base: np.ndarray
    runs: np.ndarray
    failed: np.ndarray
    tripped: np.ndarray
    lost: np.ndarray
    shares: np.ndarray

    @property
    def nothing(self):
        """(metrics,) whether a run with a share has failed without a figure: there is then no mean."""
        return self.lost[self.shares > 0.0].any(axis=(0, 1))


def _means(values, weights, shares, chosen=slice(None)):
    """lifetime_means of METRICS, or those chosen of them."""
    return lifetime_means(values[..., chosen], weights, shares, EXPONENTS[chosen])


def _figures(part, resampled):
    """(estimate, low, high), each (metrics,), of the lifetime means of a _Part."""
    estimate = _means(part.values, np.ones((1, part.values.shape[1])), part.shares)[0]
    estimate[part.nothing] = np.nan
    seeds = int(np.isfinite(part.values).any(axis=(0, 2)).sum())
    return estimate, *interval(estimate, resampled, seeds, POSITIVE)


def _differences(part, weights, own_resampled, tested):
    """Arrays (metrics,) of the paired difference of a _Part from its base: estimate, low, ... , p.

    own_resampled: resampled means of all its runs. tested: whether p is among them (NaN: too few seeds).
    """
    known = np.isfinite(part.values)
    there = known & np.isfinite(part.base)
    pair = [np.where(there, values, np.nan) for values in (part.values, part.base)]
    one = np.ones((1, weights.shape[1]))
    own, reference = (_means(values, one, part.shares)[0] for values in pair)
    gap = np.where(part.nothing, np.nan, own - reference)
    if not np.array_equal(there, known):  # else these are the means of the pairs
        own_resampled = _means(pair[0], weights, part.shares)
    resampled = own_resampled - _means(pair[1], weights, part.shares)
    seeds = int(there.any(axis=(0, 2)).sum())
    low, high = interval(gap, resampled, seeds)
    # a ratio to zero, or to what rounding left of zero, says nothing
    with np.errstate(all="ignore"):
        measured = np.abs(gap) < MOST_OF_REFERENCE * np.abs(reference)
        percent = 100.0 * np.divide(gap, np.abs(reference), out=np.full_like(gap, np.nan), where=measured)
    pairs = there.sum(axis=(0, 1)).astype(float)
    found = {"estimate": gap, "low": low, "high": high, "percent": percent, "pairs": pairs}
    if tested:
        enough = seeds >= LEAST_SEEDS
        found["p"] = p_values([(resampled - gap, seeds)] if enough else [], -gap)
    return found


def _seed_range(part):
    """(least, greatest), each (metrics,), over the seeds with every case of the lifetime mean."""
    used = np.isfinite(part.values).any(axis=(1, 2)) & (part.shares > 0.0)
    values = part.values[used]
    alone = np.eye(values.shape[1])
    means = np.where(np.isfinite(values).all(axis=0), _means(values, alone, part.shares[used]), np.nan)
    there = np.isfinite(means) & ~part.nothing
    ends = np.where(there, means, np.inf).min(axis=0), np.where(there, means, -np.inf).max(axis=0)
    return tuple(np.where(there.any(axis=0), end, np.nan) for end in ends)


def _named(estimate, low, high, **more):
    """{metric: {"mean", "low", "high", ...}} of arrays over METRICS."""
    columns = {"mean": estimate, "low": low, "high": high, **more}
    return {
        name: {key: float(column[i]) for key, column in columns.items()} for i, name in enumerate(METRICS)
    }


class Leaderboard(dict):
    """What leaderboard() returns: a plain mapping that a notebook shows as a table."""

    def _repr_html_(self):
        """Ranks, the means of SHOWN with paired differences from the baseline, and the score."""
        rows = []
        for entry in self["controllers"]:
            cells = []
            for metric in SHOWN.values():
                mean, difference = entry["metrics"][metric]["mean"], entry["difference"].get(metric, {})
                percent = difference.get("percent")
                cells.append("-" if mean is None or not np.isfinite(mean) else f"{mean:.3g}")
                if percent is not None and np.isfinite(percent) and entry["controller"] != self["baseline"]:
                    cells[-1] += f" ({percent:+.1f} %)"
            score = entry["score"] and entry["score"]["mean"]
            ended = f"{entry['runs'] - entry['failed'] - entry['tripped']} of {entry['runs']}"
            shown = "-" if score is None or not np.isfinite(score) else f"{score:.3f}"
            rows.append((entry["rank"], entry["controller"], ended, *cells, shown))
        title = f"Leaderboard, {len(self['cases'])} case(s), {len(self['seeds'])} seed(s)"
        if self["baseline"] is not None:
            title += f"; differences from {self['baseline']}"
        return html_table(title, ("rank", "controller", "runs ended well", *SHOWN, "score"), rows)


def leaderboard(table, baseline=None, score=None, cases=None, limits=None):
    """Mapping of plain values: how the controllers of an evaluation's table compare.

    baseline   controller of the paired differences; None: gspi_oc3, else pi, else the first, of those
               without failed runs
    score      training.evaluation.cases.Score of a suite, or None
    cases      names of the cases that count; None: all
    limits     training.evaluation.cases.Limits of a suite, or None
    Means are lifetime means (METHOD); the shares of the cases stand in the table's column weight_[-].
    Runs that failed or tripped have the worst figures of their case (failures.py).
    Keys: baseline (None: every controller has failed runs), interval (level, method, resamples,
    least_seeds), unchecked (metrics whose relative limits need a controller that was not run), cases, shares
    {case: share}, seeds, controllers: a list of mappings with rank, controller, runs, failed, tripped,
    metrics {metric: mean, low, high, seed_low, seed_high, worst}, difference {metric: mean, low, high,
    percent, pairs, p}, beyond (a text for each limit passed), score (mean, low, high, valid, why; None
    without one), cases {case: runs, failed, tripped, metrics, difference}. seed_low and
    seed_high are the range over the seeds of the lifetime mean, worst the greatest over all runs; percent the
    mean difference over the baseline's mean of the same runs, p its two-sided p-value (not case by case).
    The list is in the order of the ranks: those whose runs all ended well and within the limits, those
    beyond a limit, those with failed or tripped runs; within each by score, else as in the table.
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
    base = None if baseline is None else grid.controllers.index(baseline)
    entries = []
    for number, name in enumerate(grid.controllers):
        entry = {"controller": name, **_entry(grid.parts(number, base), weights, tested=True)}
        entry["beyond"] = [] if limits is None else _beyond(limits, grid, number)
        entry["score"] = None if score is None else _score(score, grid, number, weights, entry["beyond"])
        entry["cases"] = {
            case: _entry(grid.parts(number, base, slice(i, i + 1))._replace(shares=np.ones(1)), weights)
            for i, case in enumerate(grid.cases)
            if grid.runs[number, i].any()
        }
        entries.append(entry)
    entries.sort(key=_rank_key)
    return Leaderboard(
        baseline=baseline,
        interval={
            "level": LEVEL,
            "method": METHOD,
            "resamples": RESAMPLES,
            "least_seeds": LEAST_SEEDS,
        },
        unchecked=[] if limits is None or limits.baseline in grid.controllers else list(limits.relative),
        cases=grid.cases,
        shares=dict(zip(grid.cases, map(float, grid.shares), strict=True)),
        seeds=[int(seed) for seed in grid.seeds],
        controllers=[{"rank": rank} | entry for rank, entry in enumerate(entries, 1)],
    )


def _rank_key(entry):
    """What entries are ranked by: less is better."""
    score = entry["score"] and entry["score"]["mean"]
    known = score is not None and np.isfinite(score)
    return entry["failed"] + entry["tripped"] > 0, bool(entry["beyond"]), not known, score if known else 0.0


def _entry(part, weights, tested=False):
    """Figures of one controller over the cases of a _Part."""
    resampled = _means(part.values, weights, part.shares)
    estimate, low, high = _figures(part, resampled)
    least, greatest = _seed_range(part)
    filled = np.where(np.isfinite(part.values), part.values, -np.inf).max(axis=(0, 1))
    worst = np.where(np.isfinite(filled), filled, np.nan)
    return {
        "runs": int(part.runs.sum()),
        "failed": int(part.failed.sum()),
        "tripped": int(part.tripped.sum()),
        "metrics": _named(estimate, low, high, seed_low=least, seed_high=greatest, worst=worst),
        "difference": _named(**_differences(part, weights, resampled, tested)),
    }


def _beyond(limits, grid, number):
    """Texts "figure = value, allowed value" of the Limits that a controller passes.

    A figure that all runs lack is no part of the suite; one that some lack is not within its limit.
    """
    found = []
    one = np.ones((1, len(grid.seeds)))
    part = grid.parts(number, None)

    def check(name, value, limit, what=""):
        if not value <= limit:
            found.append(f"{name}{what} = {value:g}, allowed {limit:g}")

    for name, limit in limits.run.items():
        values = part.values[..., METRICS.index(name)][part.runs]
        if values.size:
            check(name, values.max(), limit)
    means = np.where(part.nothing, np.nan, _means(part.values, one, part.shares)[0])
    for name, limit in limits.lifetime.items():
        check(name, means[METRICS.index(name)], limit, " over the lifetime")
    if limits.baseline in grid.controllers:
        pair = grid.parts(number, grid.controllers.index(limits.baseline))
        there = np.isfinite(pair.values) & np.isfinite(pair.base)
        own, base = (
            _means(np.where(there, v, np.nan), one, pair.shares)[0] for v in (pair.values, pair.base)
        )
        with np.errstate(all="ignore"):
            ratios = np.where(pair.nothing, np.nan, own / base)
        for name, limit in limits.relative.items():
            check(name, ratios[METRICS.index(name)], limit, f" over {limits.baseline}")
    return found


def _score(score, grid, number, weights, beyond):
    """{"mean", "low", "high", "valid", "why"} of a controller by a Score; figures are None with a reason."""
    nothing = {"mean": None, "low": None, "high": None, "valid": False}
    if score.baseline not in grid.controllers:
        return nothing | {"why": f"needs the controller {score.baseline!r} in the evaluation"}
    place = grid.controllers.index(score.baseline)
    part = grid.parts(number, place)
    paired = np.isfinite(part.values) & np.isfinite(part.base)
    if not paired.any():
        return nothing | {"why": "no run in common with the baseline"}
    own, base = (np.where(paired, values, np.nan) for values in (part.values, part.base))

    named = list(dict.fromkeys([term.metric for term in score.term] + ([score.power] if score.power else [])))
    chosen = [METRICS.index(name) for name in named]

    def value(weights):
        ratios = _means(own, weights, part.shares, chosen) / _means(base, weights, part.shares, chosen)
        ratio = dict(zip(named, ratios.T, strict=True))
        total = sum(term.weight * ratio[term.metric] for term in score.term)
        total = total / sum(term.weight for term in score.term)
        return (total if score.power is None else total / ratio[score.power])[:, None]

    with np.errstate(all="ignore"):
        estimate = value(np.ones((1, len(grid.seeds))))[0]
        if part.nothing[chosen].any():
            estimate[:] = np.nan
        seeds = int(paired.any(axis=(0, 2)).sum())
        positive = all(never_negative(term.metric) for term in score.term)
        low, high = interval(estimate, value(weights), seeds, positive)
    why = [
        f"{count} {what} run{'' if count == 1 else 's'}{whose}"
        for at, whose in ((number, ""), (place, f" of {score.baseline!r}"))
        for what, count in (("failed", grid.failed[at].sum()), ("tripped", grid.tripped[at].sum()))
        if count and (whose == "" or at != number)
    ]
    why += beyond
    figures = {"mean": float(estimate[0]), "low": float(low[0]), "high": float(high[0])}
    return figures | {"valid": not why, "why": "; ".join(why)}
