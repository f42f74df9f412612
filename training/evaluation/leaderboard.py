"""Compares controllers on equal seeds: means with intervals, paired differences, and a suite's score.

Seeds are resampled with all their cases (bootstrap.py). Means are lifetime means: cases are weighted by the
wind climate of the suite's site, or equally without a site.
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
MOST_OF_BASELINE = 1e6  # differences above this multiple of the baseline's value have no percentage
EXPONENTS = np.array([mean_exponent(name) for name in METRICS])
METHOD = (
    "lifetime means: cases weighted by fraction of the lifetime, deviations averaged as squares, damage-"
    "equivalent loads by S-N exponents; percentile bootstrap over seeds, each with all its cases, widened for"
    " n seeds by sqrt(n/(n-1)) and by the ratio of Student's t with n-1 degrees of freedom to the normal; of"
    f" the logarithm for metrics that cannot be negative; none below {LEAST_SEEDS} seeds; differences paired"
    " by case and seed; runs that failed, tripped or lost power have no metrics, and count in a score as"
    f" {PENALTY:g} times the metrics of the reference, which is the suite's baseline without protection"
)


def default_baseline(controllers, baseline=None, failed=()):
    """Return the name of the baseline, or None without a usable controller.

    Default: the first of BASELINES, else of all controllers, that is not in `failed` (with failed runs).
    Raises: InputError if the named baseline was not evaluated.
    """
    if baseline is not None:
        if baseline not in controllers:
            raise unknown("baseline among the evaluated controllers", baseline, controllers)
        return baseline
    able = [name for name in controllers if name not in failed]
    return next((name for name in BASELINES if name in able), next(iter(able), None))


class _Part(NamedTuple):
    """Holds the runs of a controller over some cases; arrays (cases, seeds[, metrics]), shares (cases,).

    values and base are NaN for a lost or missing run. The results of a controller depend on its cases and
    seeds, on its runs and those of the reference and the baseline, and on no other controller of the table.
    """

    cases: list
    values: np.ndarray
    base: np.ndarray
    reference: np.ndarray
    runs: np.ndarray
    statuses: np.ndarray
    shares: np.ndarray

    def case(self, number):
        """Return the _Part of a single case."""
        return _Part(*(each[number : number + 1] for each in self[:-1]), np.ones(1))

    @property
    def lost(self):
        """Return whether each run (cases, seeds) exists and was lost."""
        return self.runs & (self.statuses != OK)

    @property
    def nothing(self):
        """Return whether a case with a nonzero share has only lost runs, so that no lifetime mean exists."""
        whole = self.runs.any(axis=1) & ~(self.runs & ~self.lost).any(axis=1)
        return bool((whole & (self.shares > 0.0)).any())


def _part(table, name, base):
    """Return the _Part of a controller from a table indexed by KEY; base: name of the baseline or None."""
    rows = table.loc[[name]]
    cases = list(dict.fromkeys(rows.index.get_level_values("case")))
    seeds = sorted(set(rows.index.get_level_values("seed")))
    shape = len(cases), len(seeds)

    def of(who, columns):
        keys = pd.MultiIndex.from_product([[who], cases, seeds])
        return table[columns].reindex(keys).to_numpy().reshape(*shape, -1)

    statuses = of(name, ["status"])[..., 0]
    runs = ~pd.isna(statuses)
    statuses = np.where(runs, statuses, OK)
    # row-major: the last bit of a weighted sum depends on the memory order
    arrays = (
        np.ascontiguousarray(of(who or "", list(METRICS)), dtype=np.float64)
        for who in (name, base, REFERENCE)
    )
    return _Part(cases, *arrays, runs, statuses, case_shares(rows.reset_index(), cases))


def _means(values, weights, shares, chosen=slice(None)):
    """Return lifetime_means of METRICS, or of a selection of them."""
    return lifetime_means(values[..., chosen], weights, shares, EXPONENTS[chosen])


def _differences(part, weights, own_resampled, tested):
    """Return {"estimate", "low", "high", "percent", "pairs", "p"} of a _Part minus its base, each (metrics,).

    own_resampled: resampled means of all runs. tested: whether to add p (NaN with too few seeds or with lost
    runs, since the remaining runs are a biased sample).
    """
    known = np.isfinite(part.values)
    there = known & np.isfinite(part.base)
    pair = [np.where(there, values, np.nan) for values in (part.values, part.base)]
    one = np.ones((1, weights.shape[1]))
    means, base_means = (_means(values, one, part.shares)[0] for values in pair)
    gap = np.where(part.nothing, np.nan, means - base_means)
    if not np.array_equal(there, known):  # otherwise all runs are paired
        own_resampled = _means(pair[0], weights, part.shares)
    resampled = own_resampled - _means(pair[1], weights, part.shares)
    seeds = int(there.any(axis=(0, 2)).sum())
    low, high = interval(gap, resampled, seeds)
    # no ratio to zero or to a rounding error of zero
    with np.errstate(all="ignore"):
        measured = np.abs(gap) < MOST_OF_BASELINE * np.abs(base_means)
        percent = 100.0 * np.divide(gap, np.abs(base_means), out=np.full_like(gap, np.nan), where=measured)
    pairs = there.sum(axis=(0, 1)).astype(float)
    result = {"estimate": gap, "low": low, "high": high, "percent": percent, "pairs": pairs}
    if tested:
        enough = seeds >= LEAST_SEEDS and not part.lost.any()
        result["p"] = p_values([(resampled - gap, seeds)] if enough else [], -gap)
    return result


def _seed_range(part):
    """Return (minimum, maximum), each (metrics,), over the seeds with all cases of the lifetime mean."""
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
    """Holds the mapping of leaderboard(), displayed as a table in notebooks."""

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

    baseline   controller of the paired differences; None: gspi_oc3, else pi, else the first without failed
               runs
    score      training.evaluation.cases.Score of a suite, or None
    cases      names of the cases to use; None: all
    limits     training.evaluation.cases.Limits of a suite, or None
    Means are lifetime means (METHOD), weighted by the column weight_[-]. Lost runs (failures.py) have no
    metrics, but count in the score.
    Keys: baseline (None: all have runs that failed or lost power), interval (level, method, resamples,
    least_seeds), penalty (of a lost run, times the reference's metrics), unchecked (metrics with relative
    limits, without reference runs), cases, shares {case: share}, seeds, controllers: a list of mappings
    with rank (None without a score), controller, runs, lost, failed, tripped, lost_power, metrics {metric:
    mean, low, high, seed_low, seed_high, worst}, difference {metric: mean, low, high, percent, pairs, p},
    beyond (a text per exceeded limit), score (mean, low, high, valid, why; or None), cases {case:
    runs, ..., metrics, difference}. seed_low and seed_high: range of the lifetime mean over the seeds; worst:
    maximum over all runs; percent: mean difference relative to the baseline's mean of the same runs; p: its
    two-sided p-value (not per case, nor with lost runs).
    The list is sorted by rank: controllers within all limits, then those above a limit, then those with lost
    runs; within each group by score, else as in the table.
    Raises: InputError for a baseline that was not evaluated.
    """
    if cases is not None:
        table = table[table["case"].isin(cases)]
    evaluated = table[table["controller"] != REFERENCE]
    names = list(dict.fromkeys(evaluated["controller"]))
    unusable = evaluated[~evaluated["status"].isin((OK, TRIPPED))]
    able = [name for name in names if name != PARKED] or names
    baseline = default_baseline(able, baseline, set(unusable["controller"]))
    runs = known_figures(table).set_index(KEY)
    drawn = {}  # {number of seeds: weights of resamples}
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
    cases = list(dict.fromkeys(evaluated["case"]))
    return Leaderboard(
        baseline=baseline,
        interval={"level": LEVEL, "method": METHOD, "resamples": RESAMPLES, "least_seeds": LEAST_SEEDS},
        penalty=PENALTY,
        unchecked=[] if limits is None or len(evaluated) < len(table) else list(limits.relative),
        cases=cases,
        shares=dict(zip(cases, map(float, case_shares(evaluated, cases)), strict=True)),
        seeds=sorted({int(seed) for seed in evaluated["seed"]}),
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
    """Return run counts, metrics and differences of a controller over the cases of a _Part."""
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
    """Return the exceeded Limits of runs that were not lost, as "metric = value, allowed value".

    A metric missing in all runs is not checked; a metric missing in some runs exceeds its limit.
    """
    exceeded, one = [], np.ones((1, part.values.shape[1]))

    def check(name, value, limit, what=""):
        if not value <= limit:
            exceeded.append(f"{name}{what} = {value:g}, allowed {limit:g}")

    for name, limit in limits.run.items():
        values = part.values[..., METRICS.index(name)][part.runs & ~part.lost]
        if values.size:
            check(name, values.max(), limit)
    if part.nothing:
        return exceeded
    means = _means(part.values, one, part.shares)[0]
    for name, limit in limits.lifetime.items():
        check(name, means[METRICS.index(name)], limit, " over the lifetime")
    there = np.isfinite(part.values) & np.isfinite(part.reference)
    if there.any():
        pair = (np.where(there, values, np.nan) for values in (part.values, part.reference))
        means, base = (_means(values, one, part.shares)[0] for values in pair)
        with np.errstate(all="ignore"):
            ratios = means / base
        for name, limit in limits.relative.items():
            check(name, ratios[METRICS.index(name)], limit, f" over {limits.baseline}")
    return exceeded


def _score(score, part, weights, beyond):
    """Return {"mean", "low", "high", "valid", "why"} of a controller by a Score; numbers None if undefined.

    Lost runs, and metrics missing in a run but not in the reference, count as `penalties` of the reference's
    metrics. Cases and seeds in which the reference lacks a metric are omitted.
    """
    named = list(dict.fromkeys([term.metric for term in score.term] + ([score.power] if score.power else [])))
    chosen = [METRICS.index(name) for name in named]
    base = np.where(part.runs[..., None], part.reference[..., chosen], np.nan)
    scored = part.values[..., chosen]
    directions = [1 if name == score.power else -1 for name in named]
    scored = np.where(np.isfinite(scored), scored, penalties(base, directions))
    paired = np.isfinite(scored) & np.isfinite(base)
    if not paired.any():
        why = f"no run of the reference, which is {score.baseline!r} without protection"
        return {"mean": None, "low": None, "high": None, "valid": False, "why": why}
    scored, base = (np.where(paired, values, np.nan) for values in (scored, base))
    exponents = EXPONENTS[chosen]

    def value(weights):
        means = (lifetime_means(values, weights, part.shares, exponents) for values in (scored, base))
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
    result = {"mean": float(estimate[0]), "low": float(low[0]), "high": float(high[0])}
    return result | {"valid": not why, "why": "; ".join(why)}
