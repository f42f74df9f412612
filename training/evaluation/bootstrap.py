"""Bootstrap intervals over a few weather seeds, and over training seeds crossed with them.

The unit of chance is the seed: one seed draws the wind and waves of every case from the same random
phases, so its cases are not independent of each other. Seeds are resampled with all their cases (cluster
bootstrap), and so are the training seeds of an agent with all their runs.

Fewer than LEAST_SEEDS seeds have no interval: Student's t makes one of two seeds 6.5 times as wide as the
normal one, beyond anything that a figure can be, and of their deviation next to nothing is known.
"""

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

LEVEL = 0.95
LEAST_SEEDS = 4
RESAMPLES = 10_000
RANDOM_SEED = 20191


def resample_weights(n, resamples=RESAMPLES, random_seed=RANDOM_SEED):
    """(resamples, n) counts of how often each of n seeds is drawn, n draws with replacement."""
    draws = np.random.default_rng(random_seed).integers(n, size=(resamples, n))
    return np.stack([(draws == seed).sum(axis=1) for seed in range(n)], axis=1).astype(np.float64)


def interval(estimate, resampled, n, positive=False):
    """(low, high) of the estimate (metrics,) from resampled ones (resamples, metrics); NaN below LEAST_SEEDS.

    Percentiles of n resampled values are too narrow for small n: of 6 normal ones they hold the truth in
    84 % of trials. Widening them as Student's interval is wider than the normal one makes it 94 %, and
    keeps their skewness. Hesterberg, The American Statistician 69(4), 2015, section 5.3, does the same
    with the percentiles' levels.

    positive: whether the estimate (each of them, or all) is of a figure that cannot be below zero. Its
    interval is that of its logarithm, so that it never reaches zero; where a resample is zero, as of a count,
    it ends there.
    """
    if n < LEAST_SEEDS:
        return np.full_like(estimate, np.nan), np.full_like(estimate, np.nan)
    resampled = _known(resampled)
    least = np.fmin(estimate, np.nanmin(resampled, axis=0))
    log = positive & (least > 0.0)
    with np.errstate(all="ignore"):  # logarithms that are not used, and ends beyond the largest float
        centre = np.where(log, np.log(estimate), estimate)
        spread = _spread(centre, np.where(log, np.log(resampled), resampled), n)
        low, high = (np.where(log, np.exp(centre + side), centre + side) for side in spread)
    return np.where(positive & (least >= 0.0), np.maximum(low, 0.0), low), high


def _spread(estimate, resampled, n):
    """(2, metrics): how far the ends of the interval are from the estimate, for n seeds."""
    tails = [50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)]
    upper = 0.5 * (1.0 + LEVEL)
    widening = np.sqrt(n / (n - 1.0)) * student.ppf(upper, n - 1) / normal.ppf(upper)
    return np.nanpercentile(resampled - estimate, tails, axis=0) * widening


def _known(values):
    """The array with zeros in columns that are NaN throughout: their estimate is NaN, so their result is."""
    return np.where(np.isnan(values).all(axis=0), 0.0, values)


def interquartile_mean(values, weights=None):
    """Mean of the middle half of values (n,); with weights (..., n) one mean for each row of them.

    Where a quartile falls inside a value (n no multiple of 4, or weights), that value counts in part.
    """
    values = np.asarray(values, dtype=np.float64)
    weights = np.ones(values.shape) if weights is None else weights
    order = np.argsort(values)
    upper = np.cumsum(weights[..., order], axis=-1)
    lower = np.concatenate([np.zeros_like(upper[..., :1]), upper[..., :-1]], axis=-1)
    total = upper[..., -1:]
    kept = np.clip(np.minimum(upper, 0.75 * total) - np.maximum(lower, 0.25 * total), 0.0, None)
    with np.errstate(invalid="ignore"):
        return kept @ values[order] / (0.5 * total[..., 0])


def crossed_estimate(values, resamples=RESAMPLES, positive=False):
    """(estimate, low, high): interquartile mean of values (training seeds, cases, weather seeds), NaN: none.

    Each kind of seed is resampled by itself, the interval is widened for how few there are (interval), and
    the two combine as independent errors do, each side by the root of its squares. A kind with a single
    seed adds nothing: the interval is then for that one alone. No interval (NaN) where a kind has two or
    more, but fewer than LEAST_SEEDS, or where neither has two.
    positive: whether no value can be below zero, as ratios of positive figures; as interval takes it.
    """
    values = np.asarray(values, dtype=np.float64)
    there = np.isfinite(values)
    nothing = float("nan"), float("nan")
    if not there.any():
        return float("nan"), *nothing
    known = values[there]
    estimate = interquartile_mean(known)
    log = positive and known.min() > 0.0
    centre = np.log(estimate) if log else estimate
    down, up = [], []
    for axis in (0, 2):
        n = int(there.any(axis=tuple({0, 1, 2} - {axis})).sum())
        if n == 1:
            continue
        if n < LEAST_SEEDS:
            return float(estimate), *nothing
        drawn = resample_weights(values.shape[axis], resamples, RANDOM_SEED + axis)
        means = interquartile_mean(known, drawn[:, np.nonzero(there)[axis]])
        below, above = _spread(centre, np.log(means) if log else means, n)
        down.append(max(0.0, -below))
        up.append(max(0.0, above))
    if not down:
        return float(estimate), *nothing
    low, high = centre - np.hypot.reduce(down), centre + np.hypot.reduce(up)
    if log:
        with np.errstate(over="ignore"):
            low, high = np.exp(low), np.exp(high)
    elif positive and known.min() == 0.0:
        low = max(0.0, low)
    return float(estimate), float(low), float(high)
