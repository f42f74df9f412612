"""Comparison of controllers on equal seeds: means with intervals, paired differences, and a suite's score.

Seeds are resampled with all their cases (bootstrap.py). Means are over the lifetime: cases are weighted by
the wind climate of the suite's site, or equally without a site.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

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
from fowt_env.training.evaluation.failures import BASELINES, PENALTY, known_figures, lost_counts, penalties
from fowt_env.training.evaluation.metrics import METRICS, mean_exponent, never_negative
from fowt_env.training.evaluation.results_table import KEY, case_shares
from fowt_env.training.evaluation.run_case import OK, PARKED, REFERENCE, TRIPPED

POSITIVE = np.array([never_negative(name) for name in METRICS])
SHOWN = {  # columns of a leaderboard in a notebook: {heading: metric}
    "rotor-speed std (rpm)": "RotSpeed_std_[rpm]",
    "platform-pitch std (deg)": "PtfmPitch_std_[deg]",
    "blade-pitch travel (deg/s)": "blade_pitch_travel_[deg/s]",
    "tower-base DEL (kN m)": "TwrBsMyt_DEL_[kN-m]",
}
MOST_OF_BASELINE = 1e6  # a difference above this multiple of the baseline's value gets no percentage
EXPONENTS = np.array([mean_exponent(name) for name in METRICS])
METHOD = (
    "lifetime means: each case by its share of the lifetime, deviations by their squares, damage-equivalent"
    " loads by their S-N exponents; percentile bootstrap over seeds, each with all its cases, widened for n"
    " seeds by sqrt(n/(n-1)) and by Student's t with n-1 degrees of freedom over the normal; of the logarithm"
    f" where a figure cannot be negative; none below {LEAST_SEEDS} seeds; differences are paired by case and"
    " seed; runs that failed, tripped or lost power have no figures, and count in a score"
    f" {PENALTY:g} times the reference's, which is the suite's baseline without protection"
)


def default_baseline(controllers, baseline=None, failed=()):
    """Return the name of the baseline, or None if there is none.

    It is the named one; else the first of BASELINES, or of all, that is not in `failed` (with failed runs).
    Raises: InputError if it was not evaluated.
    """
    if baseline is not None:
        if baseline not in controllers:
            raise unknown("baseline among the evaluated controllers", baseline, controllers)
        return baseline
    able = [name for name in controllers if name not in failed]
    return next((name for name in BASELINES if name in able), next(iter(able), None))


class _Part(NamedTuple):
    """The runs of a controller over some cases; arrays (cases, seeds[, metrics]), shares (cases,).

    values and base are NaN for a lost or missing run. The results of a controller depend on its runs, the
    reference's and the baseline's, on its cases and seeds, and on no other controller of the table.
    """

    cases: list
    values: np.ndarray
    base: np.ndarray
    reference: np.ndarray
    runs: np.ndarray
    statuses: np.ndarray
    shares: np.ndarray

    def case(self, number):
        """Return the _Part of one of its cases."""
        return _Part(*(each[number : number + 1] for each in self[:-1]), np.ones(1))

    @property
    def lost(self):
        """Whether each run (cases, seeds) exists and was lost."""
        return self.runs & (self.statuses != OK)

    @property
    def nothing(self):
        """Whether all runs of a case with a share were lost, so that there is no lifetime mean."""
        whole = self.runs.any(axis=1) & ~(self.runs & ~self.lost).any(axis=1)
        return bool((whole & (self.shares > 0.0)).any())


def _part(table, name, base):
    """Return the _Part of a controller of a table by KEY, with the runs of a baseline (None: none)."""
    own = table.loc[[name]]
    cases = list(dict.fromkeys(own.index.get_level_values("case")))
    seeds = sorted(set(own.index.get_level_values("seed")))
    shape = len(cases), len(seeds)

    def of(who, columns):
        keys = pd.MultiIndex.from_product([[who], cases, seeds])
        return table[columns].reindex(keys).to_numpy().reshape(*shape, -1)

    statuses = of(name, ["status"])[..., 0]
    runs = ~pd.isna(statuses)
    statuses = np.where(runs, statuses, OK)
    # in rows, on whose order in memory the last bit of a weighted sum depends
    arrays = (
        np.ascontiguousarray(of(who or "", list(METRICS)), dtype=np.float64)
        for who in (name, base, REFERENCE)
    )
    return _Part(cases, *arrays, runs, statuses, case_shares(own.reset_index(), cases))


def _means(values, weights, shares, chosen=slice(None)):
    """Return lifetime_means of METRICS, or of some of them."""
    return lifetime_means(values[..., chosen], weights, shares, EXPONENTS[chosen])


def _differences(part, weights, own_resampled, tested):
    """Return {"estimate", "low", "high", "percent", "pairs", "p"} of a _Part less its base, each (metrics,).

    own_resampled: resampled means of all its runs. tested: whether to add p (NaN with too few seeds or with
    lost runs, since the others are a biased sample).
    """
    known = np.isfinite(part.values)
    there = known & np.isfinite(part.base)
    pair = [np.where(there, values, np.nan) for values in (part.values, part.base)]
    one = np.ones((1, weights.shape[1]))
    own, theirs = (_means(values, one, part.shares)[0] for values in pair)
    gap = np.where(part.nothing, np.nan, own - theirs)
    if not np.array_equal(there, known):  # else these are the means of the pairs
        own_resampled = _means(pair[0], weights, part.shares)
    resampled = own_resampled - _means(pair[1], weights, part.shares)
    seeds = int(there.any(axis=(0, 2)).sum())
    low, high = interval(gap, resampled, seeds)
    # no ratio to zero or to a rounding error
    with np.errstate(all="ignore"):
        measured = np.abs(gap) < MOST_OF_BASELINE * np.abs(theirs)
        percent = 100.0 * np.divide(gap, np.abs(theirs), out=np.full_like(gap, np.nan), where=measured)
    pairs = there.sum(axis=(0, 1)).astype(float)
    found = {"estimate": gap, "low": low, "high": high, "percent": percent, "pairs": pairs}
    if tested:
        enough = seeds >= LEAST_SEEDS and not part.lost.any()
        found["p"] = p_values([(resampled - gap, seeds)] if enough else [], -gap)
    return found


def _seed_range(part):
    """Return (least, greatest), each (metrics,), over the seeds with every case of the lifetime mean."""
    used = np.isfinite(part.values).any(axis=(1, 2)) & (part.shares > 0.0)
    values = part.values[used]
    alone = np.eye(values.shape[1])
    means = np.where(np.isfinite(values).all(axis=0), _means(values, alone, part.shares[used]), np.nan)
    there = np.isfinite(means) & (not part.nothing)
    ends = np.where(there, means, np.inf).min(axis=0), np.where(there, means, -np.inf).max(axis=0)
    return tuple(np.where(there.any(axis=0), end, np.nan) for end in ends)


def _named(estimate, low, high, **more):
    """Return {metric: {"mean", "low", "high", ...}} of arrays over METRICS."""
    columns = {"mean": estimate, "low": low, "high": high, **more}
    return {
        name: {key: float(column[i]) for key, column in columns.items()} for i, name in enumerate(METRICS)
    }


class Leaderboard(dict):
    """The mapping of leaderboard(), which a notebook shows as a table."""

    def _repr_html_(self):
        """Return HTML of ranks, means of SHOWN with paired differences from the baseline, and scores."""
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
            ended = f"{entry['runs'] - entry['lost']} of {entry['runs']}"
            shown = "-" if score is None or not np.isfinite(score) else f"{score:.3f}"
            rank = [] if entry["rank"] is None else [entry["rank"]]
            rows.append((*rank, entry["controller"], ended, *cells, shown))
        title = f"Leaderboard, {len(self['cases'])} case(s), {len(self['seeds'])} seed(s)"
        if self["baseline"] is not None:
            title += f"; differences from {self['baseline']}"
        first = ("rank",) if any(entry["rank"] is not None for entry in self["controllers"]) else ()
        return html_table(title, (*first, "controller", "runs ended well", *SHOWN, "score"), rows)


def leaderboard(table, baseline=None, score=None, cases=None, limits=None):
    """Return a mapping of plain values that compares the controllers of an evaluation's table.

    baseline   controller of the paired differences; None: gspi_oc3, else pi, else the first, of those
               without failed runs
    score      training.evaluation.cases.Score of a suite, or None
    cases      names of the cases to use; None: all
    limits     training.evaluation.cases.Limits of a suite, or None
    Means are lifetime means (METHOD) with the shares of the column weight_[-]. Lost runs (failures.py) have
    no metrics, but count in the score.
    Keys: baseline (None: each has runs that failed or lost power), interval (level, method, resamples,
    least_seeds), penalty (of a lost run, times the reference's metrics), unchecked (metrics whose relative
    limits lack the runs of a reference), cases, shares {case: share}, seeds, controllers: a list of mappings
    with rank (None without a score), controller, runs, lost, failed, tripped, lost_power, metrics {metric:
    mean, low, high, seed_low, seed_high, worst}, difference {metric: mean, low, high, percent, pairs, p},
    beyond (a text per exceeded limit), score (mean, low, high, valid, why; None without one), cases {case:
    runs, ..., metrics, difference}. seed_low and seed_high: range of the lifetime mean over the seeds; worst:
    greatest over all runs; percent: mean difference over the baseline's mean of the same runs; p: its
    two-sided p-value (not case by case, nor with lost runs).
    The list is in the order of the ranks: first those with all runs within the limits, then those above a
    limit, then those with lost runs; within each by score, else as in the table.
    Raises: InputError for a baseline that was not evaluated.
    """
    if cases is not None:
        table = table[table["case"].isin(cases)]
    own = table[table["controller"] != REFERENCE]
    names = list(dict.fromkeys(own["controller"]))
    unusable = own[~own["status"].isin((OK, TRIPPED))]
    able = [name for name in names if name != PARKED] or names
    baseline = default_baseline(able, baseline, set(unusable["controller"]))
    runs = known_figures(table).set_index(KEY)
    drawn = {}  # weights of resamples, by number of seeds
    entries = []
    for name in names:
        part = _part(runs, name, baseline)
        count = part.values.shape[1]
        if count not in drawn:
            drawn[count] = resample_weights(count)
        weights = drawn[count]
        entry = {"controller": name, **_entry(part, weights, tested=True)}
        entry["beyond"] = [] if limits is None else _beyond(limits, part)
        entry["score"] = None if score is None else _score(score, part, weights, entry["beyond"])
        entry["cases"] = {case: _entry(part.case(i), weights) for i, case in enumerate(part.cases)}
        entries.append(entry)
    entries.sort(key=_rank_key)
    ranked = any(_known_score(entry) for entry in entries)
    cases = list(dict.fromkeys(own["case"]))
    return Leaderboard(
        baseline=baseline,
        interval={"level": LEVEL, "method": METHOD, "resamples": RESAMPLES, "least_seeds": LEAST_SEEDS},
        penalty=PENALTY,
        unchecked=[] if limits is None or len(own) < len(table) else list(limits.relative),
        cases=cases,
        shares=dict(zip(cases, map(float, case_shares(own, cases)), strict=True)),
        seeds=sorted({int(seed) for seed in own["seed"]}),
        controllers=[{"rank": rank if ranked else None} | entry for rank, entry in enumerate(entries, 1)],
    )


def _known_score(entry):
    """Return whether an entry has a score."""
    score = entry["score"]
    return score is not None and score["mean"] is not None and bool(np.isfinite(score["mean"]))


def _rank_key(entry):
    """Return the sort key of the ranks; less is better."""
    known = _known_score(entry)
    return entry["lost"] > 0, bool(entry["beyond"]), not known, entry["score"]["mean"] if known else 0.0


def _entry(part, weights, tested=False):
    """Return runs, metrics and differences of one controller over the cases of a _Part."""
    resampled = _means(part.values, weights, part.shares)
    estimate = _means(part.values, np.ones((1, part.values.shape[1])), part.shares)[0]
    estimate[:] = np.nan if part.nothing else estimate
    seeds = int(np.isfinite(part.values).any(axis=(0, 2)).sum())
    low, high = interval(estimate, resampled, seeds, POSITIVE)
    least, greatest = _seed_range(part)
    filled = np.where(np.isfinite(part.values), part.values, -np.inf).max(axis=(0, 1))
    worst = np.where(np.isfinite(filled), filled, np.nan)
    return {
        "runs": int(part.runs.sum()),
        "lost": int(part.lost.sum()),
        **lost_counts(part.statuses[part.runs]),
        "metrics": _named(estimate, low, high, seed_low=least, seed_high=greatest, worst=worst),
        "difference": _named(**_differences(part, weights, resampled, tested)),
    }


def _beyond(limits, part):
    """Return texts "metric = value, allowed value" of the exceeded Limits of runs that were not lost.

    A metric that all runs lack is not checked; one that some lack exceeds its limit.
    """
    found, one = [], np.ones((1, part.values.shape[1]))

    def check(name, value, limit, what=""):
        if not value <= limit:
            found.append(f"{name}{what} = {value:g}, allowed {limit:g}")

    for name, limit in limits.run.items():
        values = part.values[..., METRICS.index(name)][part.runs & ~part.lost]
        if values.size:
            check(name, values.max(), limit)
    if part.nothing:
        return found
    means = _means(part.values, one, part.shares)[0]
    for name, limit in limits.lifetime.items():
        check(name, means[METRICS.index(name)], limit, " over the lifetime")
    there = np.isfinite(part.values) & np.isfinite(part.reference)
    if there.any():
        pair = (np.where(there, values, np.nan) for values in (part.values, part.reference))
        own, base = (_means(values, one, part.shares)[0] for values in pair)
        with np.errstate(all="ignore"):
            ratios = own / base
        for name, limit in limits.relative.items():
            check(name, ratios[METRICS.index(name)], limit, f" over {limits.baseline}")
    return found


def _score(score, part, weights, beyond):
    """Return {"mean", "low", "high", "valid", "why"} of a controller by a Score; None with a reason.

    A lost run, and a metric that a run lacks and the reference has, count as penalties of the reference's
    metrics. A case and seed without a metric of the reference is left out.
    """
    named = list(dict.fromkeys([term.metric for term in score.term] + ([score.power] if score.power else [])))
    chosen = [METRICS.index(name) for name in named]
    base = np.where(part.runs[..., None], part.reference[..., chosen], np.nan)
    own = part.values[..., chosen]
    directions = [1 if name == score.power else -1 for name in named]
    own = np.where(np.isfinite(own), own, penalties(base, directions))
    paired = np.isfinite(own) & np.isfinite(base)
    if not paired.any():
        why = f"no run of the reference, which is {score.baseline!r} without protection"
        return {"mean": None, "low": None, "high": None, "valid": False, "why": why}
    own, base = (np.where(paired, values, np.nan) for values in (own, base))
    exponents = EXPONENTS[chosen]

    def value(weights):
        means = (lifetime_means(values, weights, part.shares, exponents) for values in (own, base))
        ratio = dict(zip(named, np.divide(*means).T, strict=True))
        total = sum(term.weight * ratio[term.metric] for term in score.term)
        total = total / sum(term.weight for term in score.term)
        return (total if score.power is None else total / ratio[score.power])[:, None]

    with np.errstate(all="ignore"):
        estimate = value(np.ones((1, weights.shape[1])))[0]
        seeds = int(paired.any(axis=(0, 2)).sum())
        positive = all(never_negative(term.metric) for term in score.term)
        low, high = interval(estimate, value(weights), seeds, positive)
    why = [
        f"{count} run{'' if count == 1 else 's'} {what.replace('_', ' ')}"
        for what, count in lost_counts(part.statuses[part.runs]).items()
        if count
    ] + beyond
    figures = {"mean": float(estimate[0]), "low": float(low[0]), "high": float(high[0])}
    return figures | {"valid": not why, "why": "; ".join(why)}
