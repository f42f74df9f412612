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
from fowt_env.training.evaluation.limits import EXCEEDED, HELD, UNDECIDED, decide, limit_texts
from fowt_env.training.evaluation.metrics import EXPONENTS, METRICS, never_negative
from fowt_env.training.evaluation.results_table import KEY, case_shares
from fowt_env.training.evaluation.run_case import OK, PARKED, REFERENCE, TRIPPED

BY = ("lifetime", "winds", "worse")  # of a Score, in the order of the figures of _score
POSITIVE = np.array([never_negative(name) for name in METRICS])
SHOWN = {  # columns of a leaderboard in a notebook: {heading: metric}
    "rotor-speed std (rpm)": "RotSpeed_std_[rpm]",
    "platform-pitch std (deg)": "PtfmPitch_std_[deg]",
    "blade-pitch travel (deg/s)": "blade_pitch_travel_[deg/s]",
    "power std (kW)": "GenPwr_std_[kW]",
    "torque travel (kN m/s)": "torque_travel_[kN-m/s]",
    "shaft DEL (kN m)": "RotTorq_DEL_[kN-m]",
    "tower-base DEL (kN m)": "TwrBsMyt_DEL_[kN-m]",
}
SCORES = {"score, lifetime": "lifetime", "score, winds": "winds"}  # of an entry's score: {heading: key}
MOST_OF_BASELINE = 1e6  # differences above this multiple of the baseline's value have no percentage
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
        """Return HTML of ranks, means of SHOWN with paired differences from the baseline, scores, limits."""
        rows = []
        for entry in self["controllers"]:
            cells = []
            for metric in SHOWN.values():
                mean, difference = entry["metrics"][metric]["mean"], entry["difference"].get(metric, {})
                percent = difference.get("percent")
                cells.append("-" if mean is None or not np.isfinite(mean) else f"{mean:.3g}")
                if percent is not None and np.isfinite(percent) and entry["controller"] != self["baseline"]:
                    cells[-1] += f" ({percent:+.1f} %)"
            cells += [score_text(entry["score"], key) for key in SCORES.values()]
            ended = f"{entry['runs'] - entry['lost']} of {entry['runs']}"
            rank = [] if entry["rank"] is None else [entry["rank"]]
            rows.append((*rank, entry["controller"], ended, *cells, limits_text(entry)))
        title = f"Leaderboard, {len(self['cases'])} case(s), {len(self['seeds'])} seed(s)"
        if self["baseline"] is not None:
            title += f"; differences from {self['baseline']}"
        first = ("rank",) if any(entry["rank"] is not None for entry in self["controllers"]) else ()
        headings = (*first, "controller", "runs ended well", *SHOWN, *SCORES, "limits")
        return html_table(title, headings, rows)


def score_text(score, key):
    """Return one of SCORES as "0.743 [0.721, 0.758]", in brackets if it is not valid."""
    figure = score and score[key]
    if not figure or figure["mean"] is None or not np.isfinite(figure["mean"]):
        return "-"
    text = f"{figure['mean']:.3f}"
    if figure["low"] == figure["low"]:
        text += f" [{figure['low']:.3f}, {figure['high']:.3f}]"
    return text if score["valid"] else f"({text})"


def limits_text(entry):
    """Return the state of the limits of an entry: "held", "1 exceeded, 2 not decided", "-" without limits."""
    if entry["held"] is None:
        return "-"
    states = [each["state"] for each in entry["limits"]]
    counts = {state: states.count(state) for state in (EXCEEDED, UNDECIDED)}
    return ", ".join(f"{count} {state}" for state, count in counts.items() if count) or HELD


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
    beyond and undecided (a text per limit that is exceeded, or not decided by its interval: limits.py), held
    (whether every limit is held; None without limits), limits (a mapping per limit and case, with its
    state), score (mean, low, high of the ranked score, valid, why, lifetime and winds {mean, low, high}; or
    None), cases {case: runs, ..., metrics, difference}. seed_low and seed_high: range of the lifetime mean
    over the seeds; worst: maximum over all runs; percent: mean difference relative to the baseline's mean of
    the same runs; p: its two-sided p-value (not per case, nor with lost runs).
    The list is sorted by rank: controllers that exceed no limit, then those that do, then those with lost
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
        decisions = [] if limits is None else decide(limits, part, weights)
        entry["beyond"] = limit_texts(decisions, EXCEEDED)
        known = [each for each in decisions if np.isfinite(each.high)]
        entry["undecided"] = limit_texts(known, UNDECIDED)
        entry["held"] = all(each.state == HELD for each in decisions) if decisions else None
        entry["limits"] = [each._asdict() | {"state": each.state} for each in decisions]
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
        unchecked=[] if limits is None or len(evaluated) < len(table) else limits.relative_metrics,
        cases=cases,
        shares=dict(zip(cases, map(float, case_shares(evaluated, cases)), strict=True)),
        seeds=sorted({int(seed) for seed in evaluated["seed"]}),
        controllers=[{"rank": rank if ranked else None} | entry for rank, entry in enumerate(entries, 1)],
    )


def decisions(table, name, limits):
    """Return the Decisions (limits.py) on the Limits of a suite for a controller of a table, no intervals."""
    part = _part(known_figures(table).set_index(KEY), name, None)
    return decide(limits, part, np.ones((1, part.values.shape[1])))


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


def _score(score, part, weights, beyond):
    """Return {"mean", "low", "high", "valid", "why", "lifetime", "winds"} of a controller by a Score.

    lifetime, winds: {"mean", "low", "high"} of the score of lifetime means and of the mean of the scores of
    single cases; mean, low, high: of the one that ranks (Score.by); None if undefined. Lost runs, and metrics
    missing in a run but not in the reference, count as `penalties` of the reference's metrics. Cases and
    seeds in which the reference lacks a metric are omitted.
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
        nothing = {"mean": None, "low": None, "high": None}
        return nothing | {"valid": False, "why": why, "lifetime": nothing, "winds": nothing}
    scored, base = (np.where(paired, values, np.nan) for values in (scored, base))
    exponents = EXPONENTS[chosen]

    def total(weights, cases, shares):  # (resamples,)
        means = (lifetime_means(values[cases], weights, shares, exponents) for values in (scored, base))
        ratio = dict(zip(named, np.divide(*means).T, strict=True))
        total = sum(term.weight * ratio[term.metric] for term in score.term)
        total = total / sum(term.weight for term in score.term)
        return total if score.power is None else total / ratio[score.power]

    used = np.flatnonzero(paired.any(axis=(1, 2)))

    def value(weights):  # (resamples, 3): over the lifetime, mean of the cases, and the worse of them
        lifetime = total(weights, slice(None), part.shares)
        each = [total(weights, slice(case, case + 1), np.ones(1)) for case in used]
        winds = np.mean(each, axis=0)
        return np.stack([lifetime, winds, np.fmax(lifetime, winds)], axis=1)

    with np.errstate(all="ignore"):
        estimate = value(np.ones((1, weights.shape[1])))[0]
        seeds = int(paired.any(axis=(0, 2)).sum())
        positive = all(never_negative(term.metric) for term in score.term)
        ends = interval(estimate, value(weights), seeds, positive)
    figures = [
        dict(zip(("mean", "low", "high"), map(float, three), strict=True))
        for three in zip(estimate, *ends, strict=True)
    ]
    why = [
        f"{count} run{'' if count == 1 else 's'} {what.replace('_', ' ')}"
        for what, count in lost_counts(part.statuses[part.runs]).items()
        if count
    ] + beyond
    about = {"valid": not why, "why": "; ".join(why), "lifetime": figures[0], "winds": figures[1]}
    return figures[BY.index(score.by)] | about
