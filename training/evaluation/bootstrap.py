"""Computes bootstrap intervals over a few weather seeds, and over training seeds crossed with them.

A seed generates the wind and waves of every case from the same random phases, so its cases are not
independent. Seeds are therefore resampled with all their cases (cluster bootstrap), and the training seeds of
an agent with all their runs.

Fewer than LEAST_SEEDS seeds have no interval: with two seeds Student's t would widen the normal interval 6.5
times, and the estimated deviation is very uncertain.

Means over the cases are lifetime means: cases are weighted by their fraction of the lifetime, and metrics
that are additive as a power (variances, damage) are averaged as this power.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

LEVEL = 0.95
LEAST_SEEDS = 4
RESAMPLES = 10_000
RANDOM_SEED = 20191
LEAST_P = 1e-6
P_STEPS = 40  # bisections of the logarithm of a p-value: accurate to 1e-10


def resample_weights(n, resamples=RESAMPLES, random_seed=RANDOM_SEED):
    """Return how often (resamples, n) each of n seeds is drawn in n draws with replacement."""
    draws = np.random.default_rng(random_seed).integers(n, size=(resamples, n))
    return np.stack([(draws == seed).sum(axis=1) for seed in range(n)], axis=1).astype(np.float64)


def interval(estimate, resampled, n, positive=False, level=LEVEL):
    """Return (low, high) of the estimate (metrics,) from its resamples (resamples, metrics).

    level: probability of the interval, the same on each side. NaN below LEAST_SEEDS.

    Percentile intervals are too narrow for small n: with 6 normal values their coverage is 84 %. Widening by
    the ratio of Student's to the normal interval increases the coverage to 94 % and preserves skewness.
    Hesterberg, The American Statistician 69(4), 2015, section 5.3, adjusts the percentiles' levels instead.

    positive: whether the estimate (each metric, or all) cannot be below zero. The interval is then computed
    for the logarithm, so above zero; if a resample is zero, e.g. of a count, the interval ends at zero.
    """
    if n < LEAST_SEEDS:
        return np.full_like(estimate, np.nan), np.full_like(estimate, np.nan)
    resampled = _known(resampled)
    least = np.fmin(estimate, np.nanmin(resampled, axis=0))
    log = positive & (least > 0.0)
    with np.errstate(all="ignore"):  # unused logarithms, and overflow of the ends
        centre = np.where(log, np.log(estimate), estimate)
        spread = _spread(centre, np.where(log, np.log(resampled), resampled), n, level)
        low, high = (np.where(log, np.exp(centre + side), centre + side) for side in spread)
    return np.where(positive & (least >= 0.0), np.maximum(low, 0.0), low), high


def _spread(estimate, resampled, n, level=LEVEL):
    """Return the distances (2, metrics) of the interval's ends from the estimate, for n seeds."""
    tails = [50.0 * (1.0 - level), 50.0 * (1.0 + level)]
    away = _known(resampled - estimate)
    percentile = np.nanpercentile if np.isnan(away).any() else np.percentile  # nanpercentile is slow
    return percentile(away, tails, axis=0) * _widening(n, 1.0 - level)


def _known(values):
    """Return the array with zeros in all-NaN columns (their estimate, and thus the result, is NaN)."""
    return np.where(np.isnan(values).all(axis=0), 0.0, values)


def case_means(values, weights):
    """Return weighted means (resamples, metrics) over the seeds of values (seeds, metrics); NaN: no value.

    A single value is the mean of every resample. A resample without a value is NaN.
    """
    there = np.isfinite(values)
    filled = np.where(there, values, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = (weights @ filled) / (weights @ there.astype(np.float64))
    single = there.sum(axis=0) == 1
    means[:, single] = filled[:, single].sum(axis=0)
    return means


def lifetime_means(values, weights, shares, exponents):
    """Return (sum over cases of share x mean over seeds of x^p)^(1/p) of x = values, (resamples, metrics).

    values (cases, seeds, metrics), NaN: no value; weights (resamples, seeds) of the seeds; shares (cases,):
    fractions of the lifetime; exponents p (metrics,). Shares are normalised over the cases with a value of
    the metric. NaN if no case with a nonzero share has a value.
    """
    share = np.where(np.isfinite(values).any(axis=1), np.asarray(shares)[:, None], 0.0)  # (cases, metrics)
    bent = exponents != 1.0
    total = np.zeros((len(weights), values.shape[-1]))
    with np.errstate(all="ignore"):
        share = share / share.sum(axis=0)  # NaN if no case has a value
        for part, each in zip(share, values**exponents, strict=True):
            means = case_means(each, weights)
            means *= part
            means[:, part == 0.0] = 0.0  # not NaN where the case has no value
            total += means
        total[:, bent] **= 1.0 / exponents[bent]
    return total


def _widening(n, alpha):
    """Return the widening factor of the 1 - alpha interval of n resampled values; array alpha in (0, 1]."""
    tail = np.minimum(0.5 * alpha, 0.5 - 1e-9)
    return np.sqrt(n / (n - 1.0)) * student.isf(tail, n - 1) / normal.isf(tail)


def p_values(deviations, distance):
    """Return two-sided p-values (metrics,): 1 minus the level of the interval that ends at the tested value.

    deviations  [(resampled minus estimate (resamples, metrics), n)] for each kind of seed; each side is
                combined by the root sum of squares, as for independent errors
    distance    (metrics,) from the estimate to the tested value, in the same scale (logarithms)
    Clipped at LEAST_P, below the resolution of resamples; NaN for a NaN distance, or without deviations.
    """
    distance = np.asarray(distance, dtype=np.float64)
    if not deviations:
        return np.full(distance.shape, np.nan)
    ordered = [(np.sort(_known(each), axis=0), n) for each, n in deviations]
    low, high = np.full(distance.shape, np.log(LEAST_P)), np.zeros(distance.shape)
    for _ in range(P_STEPS):
        middle = 0.5 * (low + high)
        alpha = np.exp(middle)
        tail = np.where(distance < 0.0, 0.5 * alpha, 1.0 - 0.5 * alpha)
        reach = [
            np.maximum(0.0, np.sign(distance) * _quantile(each, tail) * _widening(n, alpha))
            for each, n in ordered
        ]
        beyond = np.abs(distance) > np.hypot.reduce(reach)  # then p is smaller
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    p = np.where(distance == 0.0, 1.0, np.exp(high))
    return np.where(np.isfinite(distance), p, np.nan)


def _quantile(ordered, q):
    """Return the quantiles q (metrics,) of sorted columns, ignoring NaN at the end of a column."""
    last = np.isfinite(ordered).sum(axis=0) - 1
    position = np.maximum(last, 0) * q
    below = np.floor(position).astype(int)
    above = np.minimum(below + 1, np.maximum(last, 0))
    columns = np.arange(ordered.shape[1])
    return ordered[below, columns] + (position - below) * (ordered[above, columns] - ordered[below, columns])


def holm(p):
    """Return p-values (n,) adjusted for multiple tests (Holm, Scandinavian Journal of Statistics 6(2), 1979).

    The probability of any false rejection at level alpha is at most alpha. The k-th smallest of n p-values is
    multiplied by n + 1 - k, and the results are made monotonic; NaN: no test.
    """
    p = np.asarray(p, dtype=np.float64)
    adjusted = np.full(p.shape, np.nan)
    order = [index for index in np.argsort(p) if np.isfinite(p[index])]
    running = 0.0
    for rank, index in enumerate(order):
        running = max(running, min(1.0, (len(order) - rank) * p[index]))
        adjusted[index] = running
    return adjusted


@dataclass(frozen=True)
class Estimate:
    """Holds a ratio with its 95 % interval (NaN: no interval), and the deviations for its p-values."""

    value: float
    low: float = float("nan")
    high: float = float("nan")
    deviations: tuple = ()  # as in p_values
    log: bool = False  # whether the deviations are those of the logarithm

    def p_value(self, tested):
        """Return the two-sided p-value of the ratio being `tested`; NaN without an interval."""
        if not np.isfinite(self.low):
            return float("nan")
        value, reference = np.log([self.value, tested]) if self.log else (self.value, tested)
        return float(p_values(self.deviations, np.array([reference - value]))[0])


def crossed_ratio(own, base, shares, exponent=1.0, resamples=RESAMPLES, positive=False):
    """Return the Estimate of the ratio of lifetime means to a baseline's, averaged over training seeds.

    own (training seeds, cases, weather seeds), base (cases, weather seeds), NaN: no value; shares and
    exponent: as in lifetime_means; positive: as in `interval`. Each kind of seed is resampled separately, its
    interval is widened for few seeds, and each side of the two intervals is combined by the root sum of
    squares, as for independent errors. A kind with a single seed adds nothing: the interval holds for that
    seed. No interval if a kind has two or more, but fewer than LEAST_SEEDS, or if neither has two.
    """
    own = np.asarray(own, dtype=np.float64)
    there = np.isfinite(own) & np.isfinite(base)
    used = there.any(axis=(1, 2))
    if not used.any():
        return Estimate(float("nan"))
    mine, other = (np.where(there, values, np.nan) for values in (own, np.broadcast_to(base, own.shape)))

    def ratios(weights):  # (resamples, training seeds)
        means = [
            lifetime_means(np.moveaxis(values[used], 0, -1), weights, shares, np.full(used.sum(), exponent))
            for values in (mine, other)
        ]
        with np.errstate(all="ignore"):
            return np.where(means[1] != 0.0, means[0] / means[1], np.nan)

    single = ratios(np.ones((1, own.shape[2])))[0]
    value = float(single.mean())
    seeds, members = int(there.any(axis=(0, 1)).sum()), int(used.sum())
    if not np.isfinite(value) or max(seeds, members) < 2 or {seeds, members} & set(range(2, LEAST_SEEDS)):
        return Estimate(value)
    drawn = []
    if seeds > 1:
        drawn.append((ratios(resample_weights(own.shape[2], resamples, RANDOM_SEED + 2)).mean(axis=1), seeds))
    if members > 1:
        weights = resample_weights(members, resamples, RANDOM_SEED)
        drawn.append((weights @ single / members, members))
    log = positive and min(value, *(np.nanmin(each) for each, _ in drawn)) > 0.0
    centre = np.log(value) if log else value
    deviations = tuple(((np.log(each) if log else each)[:, None] - centre, n) for each, n in drawn)
    sides = [_spread(np.zeros(1), each, n) for each, n in deviations]
    low = centre - np.hypot.reduce([max(0.0, -side[0][0]) for side in sides])
    high = centre + np.hypot.reduce([max(0.0, side[1][0]) for side in sides])
    if log:
        with np.errstate(over="ignore"):
            low, high = np.exp(low), np.exp(high)
    elif positive and min(value, *(np.nanmin(each) for each, _ in drawn)) >= 0.0:
        low = max(0.0, low)
    return Estimate(value, float(low), float(high), deviations, log)
