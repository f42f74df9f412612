"""Extrapolates loads of normal operation to a value that is exceeded in an hour once in 50 years (DLC 1.1).

Peaks over threshold: in each condition k (a wind bin with its sea), which takes the fraction p_k of the time,
peaks exceed a threshold u_k at a rate, and above it they are distributed as the tail of a Weibull
distribution about the mean b_k of the load,

    P(peak > x | peak > u) = exp(((u - b) / a)^c - ((x - b) / a)^c),

with c = 2 for peaks of a Gaussian process (Rayleigh) and c = 1 for exponential ones: the family that IEC
61400-1 and Moriarty, Holley and Butterfield (NREL/TP-500-34421, 2004) fit to peaks, and of the tails of mean
upcrossing rates of Naess and Gaidai (Journal of Engineering Mechanics 134(8), 2008). Peaks come in clusters,
as in gusts; the extremal index theta_k is the fraction that begins one. The fraction of hours with a larger
load is

    exceeded(x) = sum over k of p_k (1 - exp(-theta_k rate_k P_k(peak > x))),

and the value of N years solves exceeded(x) = 1 h / N years. a and c are maximum likelihood estimates, theta
is that from the largest values of the runs, of which each has an exponent whose distribution is exponential
with mean 1. c and theta vary slowly over the wind speed: they are those of the likelihood of conditions
within POOL, weighted by their distance (local likelihood), since six hours alone do not define them. A Gumbel
distribution of the runs' largest values is the check.

Load cases have a few classes of Hs in each wind. Rarer, higher seas belong to none of them: with the climate
of the site the long-term rate is integrated over all Hs of a wind (the full long-term method of Naess and
Moan, Stochastic Dynamics of Marine Structures, 2013, chapter 12), with the scale of the tail

    a^2 = alpha + beta Hs^2,  beta >= 0,

as wind and waves add their variances; alpha and beta are least squares over the classes. The exponent, the
rate of peaks and the threshold in scales are means of the classes, the mean load is interpolated.

For the sea, `environmental_contour` and `inverse_form` search the states of the same return period
(Winterstein et al., ICOSSAR 1993).
"""

from dataclasses import dataclass, field
from math import inf, log, nan, pi, sqrt

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError
from fowt_env.training.evaluation.bootstrap import RANDOM_SEED, interval
from fowt_env.training.loads.records import HOUR
from fowt_env.training.loads.selection import RESAMPLES, conditions_of
from fowt_env.training.loads.site import YEAR

YEARS = 50.0  # return period
POOL = 6.0  # m/s: conditions of which a wind speed further away has no part in the exponent c
SHAPES = np.exp(np.linspace(log(0.4), log(5.0), 81))  # values of c that are searched
STEPS = 14  # of regula falsi
EXCEEDED = np.logspace(0.0, -9.0, 28)  # probabilities between which Hs has one value in the long-term rate
EULER = 0.5772156649015329


@dataclass(frozen=True)
class Condition:
    """Holds what a load does in one condition of normal operation, for one channel and side, more is worse.

    share: fraction of the time; peaks: (n,) independent peaks of each run; counts: number of all peaks of
    each run, of which `peaks` are the largest; largest and hours: (runs,) largest value and length of each
    run; mean: of the load.
    """

    name: str
    share: float
    peaks: tuple
    counts: tuple
    largest: np.ndarray
    hours: np.ndarray
    mean: float
    wind_speed: float = nan  # m/s
    Hs: float = nan  # m
    family: tuple = ()


@dataclass(frozen=True)
class Extrapolation:
    """Holds a long-term load of a channel and side: value, 95 % interval, check by block maxima, curve.

    largest: of all runs. curve: (n, 2) load and number of hours per year in which it is exceeded. fits: per
    condition (name, wind speed, threshold, clusters per hour, scale a, exponent c). governing: name of the
    condition with the largest part of the exceedances. drawn: (RESAMPLES,) values of resampled seeds. Values
    have the sign of the channel.
    """

    value: float
    low: float
    high: float
    block: float
    largest: float
    curve: np.ndarray
    fits: tuple
    governing: str
    years: float
    drawn: np.ndarray = field(repr=False)


def conditions_of_runs(runs, column, side, shares=None):
    """Return [Condition] of the runs [(LoadCase, RunStatistics)] of one controller.

    shares: {(dlc, name): fraction of the time}; None: from hours_per_year of the runs. Conditions without
    share are left out. Raises: InputError if none is left.
    """
    sign = 1.0 if side == "max" else -1.0
    found, together = [], conditions_of(runs)
    families = _families({key: members[0][0] for key, members in together.items()})
    for key, members in together.items():
        hours = sum(case.hours_per_year for case, _ in members)
        share = hours / YEAR if shares is None else shares.get(key, 0.0)
        if share <= 0.0 or any(column not in each.peaks for _, each in members):
            continue
        peaks = [each.peaks[column][side] for _, each in members]
        speed = members[0][0].wind_speed
        found.append(
            Condition(
                key[1], share, tuple(sign * value for value, _ in peaks), tuple(count for _, count in peaks),
                np.array([sign * each.value(column, side) for _, each in members]),
                np.array([each.duration / HOUR for _, each in members]),
                sign * float(np.mean([each.value(column, "mean") for _, each in members])),
                nan if speed is None else float(speed), float(members[0][0].Hs), families[key],
            )
        )  # fmt: skip
    if not found:
        raise InputError(
            f"extrapolation of {column}: no condition of the runs has both a share of the time and peaks of"
            " this channel"
        )
    return found


def _families(cases):
    """Return {key: family} of {key: LoadCase}: of one wind, directions and order of the Tp at an Hs.

    () for a case without a wind.
    """
    groups = {key: (each.wind_speed, each.yaw_error, each.misalignment) for key, each in cases.items()}
    periods = {}
    for key, each in cases.items():
        periods.setdefault((groups[key], each.Hs), set()).add(each.Tp)
    return {
        key: ()
        if each.wind_speed is None
        else (*groups[key], sorted(periods[groups[key], each.Hs]).index(each.Tp))
        for key, each in cases.items()
    }


# --------------------------------------------------------------------------- peaks over threshold


def _threshold(condition):
    """Return the least level above which the peaks of every run of a condition are complete; inf: no peak.

    That is the smallest peak, or of runs with more peaks than are stored the largest of their smallest ones.
    """
    runs = [
        (peaks, count) for peaks, count in zip(condition.peaks, condition.counts, strict=True) if len(peaks)
    ]
    cut = [float(peaks.min()) for peaks, count in runs if count > len(peaks)]
    return max(cut) if cut else min((float(peaks.min()) for peaks, _ in runs), default=inf)


class _Tail:
    """Holds the peaks of a condition above its threshold, and their likelihood in k samples of the runs."""

    def __init__(self, condition, draws):
        """Take the peaks; draws (k, runs): how often each run occurs."""
        self.mean, self.level = condition.mean, _threshold(condition)
        above = [peaks[peaks >= self.level] for peaks in condition.peaks]
        self.used = self.level < inf and self.level > self.mean
        if not self.used:
            above, self.level = [np.empty(0) for _ in above], self.mean + 1.0
        run = np.repeat(np.arange(len(above)), [len(part) for part in above])
        # heights over the mean, in heights of the threshold: the Weibull tail has then the threshold 1
        self.height = (np.concatenate(above) - self.mean) / (self.level - self.mean)
        self.weights = draws[:, run].astype(np.float64)
        self.count = self.weights.sum(axis=1)
        self.rate = self.count / (draws @ condition.hours)  # per hour

        # mean of height^c - 1 for each c: at the best a it is (a / threshold)^c
        powers = self.height[:, None] ** SHAPES - 1.0
        self.spreads = np.maximum(self.weights @ powers / np.maximum(self.count, 1.0)[:, None], 1e-12)

    def likelihood(self):
        """Return the logarithm of the likelihood (k, SHAPES), at the best a for each exponent."""
        logs = (self.weights @ np.log(self.height))[:, None]
        return self.count[:, None] * np.log(SHAPES / self.spreads) + (SHAPES - 1.0) * logs

    def spread(self, shape):
        """Return (a / threshold)^c (k,) for exponents c (k,); its logarithm is linear between SHAPES."""
        at = np.clip(np.log(shape / SHAPES[0]) / log(SHAPES[1] / SHAPES[0]), 0.0, len(SHAPES) - 1.001)
        left, rows = at.astype(int), np.arange(len(at))
        logs = np.log(self.spreads)
        return np.exp(logs[rows, left] + (at - left) * (logs[rows, left + 1] - logs[rows, left]))


def _best_shape(likelihood):
    """Return the exponents (k,) of the largest likelihood (k, SHAPES), by a parabola through three values."""
    rows = np.arange(len(likelihood))
    middle = np.clip(likelihood.argmax(axis=1), 1, len(SHAPES) - 2)
    before, at, after = (likelihood[rows, middle + step] for step in (-1, 0, 1))
    bend = before - 2.0 * at + after
    step = np.where(bend < 0.0, 0.5 * (before - after) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return SHAPES[middle] * (SHAPES[1] / SHAPES[0]) ** np.clip(step, -1.0, 1.0)


def _pooling(conditions):
    """Return the weights (conditions, conditions) of the likelihoods in each condition's exponent."""
    wind = np.array([condition.wind_speed for condition in conditions])
    distance = np.abs(wind[:, None] - wind[None, :])
    return np.where(np.isfinite(distance), np.maximum(1.0 - distance / POOL, 0.0), 1.0)


class _Classes:
    """Holds the tails of single conditions.

    owners: number of the condition of each part. parts(load) (k, conditions): fraction of all hours in which
    loads (k,) are exceeded in each condition.
    """

    def __init__(self, share, mean, level, rate, spread, shape):
        self.owners = np.arange(len(share))
        self._share, self.level = share, level
        self._of = rate, mean, level - mean, spread, shape

    def expected(self, load, at=slice(None)):
        """Return exceedances in an hour of conditions `at`: (k, conditions), or (k, n) in one of n loads."""
        rate, mean, reach, spread, shape = (each[..., at] for each in self._of)
        height = np.maximum((load - mean) / reach, 1.0)
        return rate * np.exp(-(height**shape - 1.0) / spread)

    def parts(self, load):
        return self._share * -np.expm1(-self.expected(load[:, None]))


class _Seas:
    """Holds the tails of a family of conditions as functions of Hs over all seas of its wind, as _Classes."""

    def __init__(self, at, conditions, mean, reach, rate, scale, shape, climate):
        """Take the conditions at the numbers `at`; mean, reach (conditions,), others (k, conditions)."""
        at = at[np.argsort([conditions[number].Hs for number in at])]
        Hs = np.array([conditions[number].Hs for number in at])
        below = 1.0 - EXCEEDED
        likely = np.diff(np.append(below, 1.0))
        # geometric middle of the exceedance of each class
        middle = 1.0 - np.sqrt(EXCEEDED * np.append(EXCEEDED[1:], 0.1 * EXCEEDED[-1]))
        heights = climate.height_at(middle, conditions[at[0]].wind_speed)
        self.owners = at[np.abs(heights[:, None] - Hs).argmin(axis=1)]
        square, away = scale[:, at] ** 2, Hs**2 - np.mean(Hs**2)
        slope = np.maximum(square @ away, 0.0) / max(away @ away, 1e-300)
        least = np.maximum(square.mean(axis=1) - slope * np.mean(Hs**2), 0.0)
        self._scale = np.sqrt(least[:, None] + slope[:, None] * heights**2)
        self._shape = shape[:, at].mean(axis=1)[:, None]
        self._least = (reach[at] / scale[:, at]).mean(axis=1)[:, None]  # threshold, in scales
        self._mean = np.interp(heights, Hs, mean[at])
        self._share = sum(conditions[number].share for number in at) * likely
        self._rate = rate[:, at].mean(axis=1)[:, None]

    def parts(self, load):
        height = np.maximum((load[:, None] - self._mean) / self._scale, self._least)
        expected = self._rate * np.exp(self._least**self._shape - height**self._shape)
        return self._share * -np.expm1(-expected)


def _members(conditions, used, climate):
    """Return arrays of the numbers of conditions whose tails are functions of Hs; None: of single conditions.

    used: whether each condition has peaks.
    """
    if climate is None or not all(condition.family for condition in conditions):
        return None
    families = {}
    for number, condition in enumerate(conditions):
        if used[number]:
            families.setdefault(condition.family, []).append(number)
    return [np.array(numbers) for numbers in families.values()]


def _separate(conditions, draws, pooling, tails):
    """Return the extremal index (k, conditions): the fraction of peaks that begin a cluster.

    If clusters are independent, the number of peaks expected beyond the largest value of a run, times the
    index, is exponential with mean 1: the index is the inverse of the mean over the runs, weighted as the
    exponents, and at most 1.
    """
    events, expected = [], []
    for number, condition in enumerate(conditions):
        weights = draws[len(condition.peaks)]
        above = condition.largest > tails.level[number]
        events.append(weights @ above.astype(np.float64))
        beyond = tails.expected(condition.largest, [number]) * condition.hours
        expected.append((weights * beyond).sum(axis=1))
    events, expected = (pooling @ np.array(each) for each in (events, expected))
    return np.minimum(events / np.maximum(expected, 1e-300), 1.0).T


def _long_term(conditions, draws, years, climate=None):
    """Return (values (k,), fits, tails) of the load of a return period, for k samples.

    tails: list of _Classes and _Seas, whose parts add up to the fraction of hours with an exceedance.
    """
    tails = [_Tail(condition, draws[len(condition.peaks)]) for condition in conditions]
    pooling = _pooling(conditions)
    likelihood = np.tensordot(pooling, np.array([tail.likelihood() for tail in tails]), 1)
    shape = np.array([_best_shape(each) for each in likelihood]).T  # (k, conditions)
    spread = np.array([tail.spread(c) for tail, c in zip(tails, shape.T, strict=True)]).T
    rate = np.array([tail.rate if tail.used else 0.0 * tail.rate for tail in tails]).T
    share = np.array([condition.share for condition in conditions])
    mean, level = (np.array([getattr(tail, name) for tail in tails]) for name in ("mean", "level"))
    scale = (level - mean) * spread ** (1.0 / shape)
    rate = rate * _separate(conditions, draws, pooling, _Classes(share, mean, level, rate, spread, shape))
    fits = (level, rate, scale, shape)
    members = _members(conditions, [tail.used for tail in tails], climate)
    if members is None:
        found = [_Classes(share, mean, level, rate, spread, shape)]
    else:
        found = [_Seas(at, conditions, mean, level - mean, rate, scale, shape, climate) for at in members]

    def total(load):
        return sum((each.parts(load).sum(axis=1) for each in found), np.zeros(len(load)))

    target = 1.0 / (years * YEAR)
    low = np.full(len(rate), min(level))
    if not (total(low) > target).all():
        return np.full(len(rate), nan), fits, found
    reach = np.max(level) - np.min(level) + np.max(level - mean)
    high = low + reach
    while (beyond := total(high) > target).any():
        high = np.where(beyond, high + (high - low), high)
    return _root(lambda load: np.log(np.maximum(total(load), 1e-300) / target), low, high), fits, found


def _root(excess, low, high):
    """Return the zeros (k,) of a falling function between low and high (k,): regula falsi, Illinois."""
    above, below = excess(low), excess(high)
    last = np.zeros(len(low), dtype=bool), np.zeros(len(low), dtype=bool)
    for _ in range(STEPS):
        middle = (low * below - high * above) / (below - above)
        value = excess(middle)
        left, right = value > 0.0, value <= 0.0
        # an end that stays for the second time counts half
        above = np.where(left, value, np.where(last[1], 0.5 * above, above))
        below = np.where(right, value, np.where(last[0], 0.5 * below, below))
        low, high, last = np.where(left, middle, low), np.where(right, middle, high), (left, right)
    return np.where(np.abs(above) < np.abs(below), low, high)


def extrapolate(conditions, side="max", years=YEARS, climate=None):
    """Return the Extrapolation of the Conditions of a channel and side; NaN for a load without peaks.

    climate: site.Climate with the distribution of Hs in a wind; None: the seas of the conditions alone.
    The interval is a bootstrap over the runs of each condition (seeds), with the same draws for conditions of
    equally many runs, widened for few seeds as in training.evaluation.bootstrap; none for fewer than four.
    Raises: InputError for a return period that is not positive.
    """
    check_number("years", years, 0.0, low_open=True)
    sign = 1.0 if side == "max" else -1.0
    random = np.random.default_rng(RANDOM_SEED)
    counts = sorted({len(condition.peaks) for condition in conditions})
    draws = {n: random.multinomial(n, np.full(n, 1.0 / n), size=RESAMPLES) for n in counts}
    (value,), fits, tails = _long_term(conditions, {n: np.ones((1, n)) for n in counts}, years, climate)
    drawn = _long_term(conditions, draws, years, climate)[0]
    owners = np.concatenate([each.owners for each in tails]) if tails else []

    def parts(load):
        return np.concatenate([each.parts(np.array([load]))[0] for each in tails])

    low, high = interval(np.array([value]), drawn[:, None], counts[-1])
    largest = max(float(condition.largest.max()) for condition in conditions)
    governing = ""
    if np.isfinite(value):
        governing = conditions[int(owners[np.argmax(parts(value))])].name
    level, rate, scale, shape = fits
    rows = zip(conditions, sign * level, rate[0], scale[0], shape[0], strict=True)
    curve = _curve(value, largest, parts)
    curve[:, 0] *= sign
    return Extrapolation(
        sign * float(value), *sorted((sign * float(low[0]), sign * float(high[0]))),
        sign * block_maxima(conditions, years), sign * largest, curve,
        tuple((c.name, c.wind_speed, *map(float, numbers)) for c, *numbers in rows),
        governing, float(years), sign * drawn,
    )  # fmt: skip


def _curve(value, largest, parts):
    """Return (n, 2) loads and hours per year that exceed them, from 1e4 per year to beyond the value."""
    if not np.isfinite(value):
        return np.empty((0, 2))
    span = max(abs(value - largest), 0.1 * abs(value), 1e-12)
    loads = np.linspace(min(value, largest) - 3.0 * span, max(value, largest) + 0.5 * span, 80)
    rates = np.array([float(parts(load).sum()) for load in loads]) * YEAR
    kept = (rates > 1e-4) & (rates < 1e4)
    return np.stack([loads[kept], rates[kept]], axis=1)


def gumbel_fit(values):
    """Return (mode, scale) of a Gumbel distribution by L-moments of at least two values."""
    ordered, n = np.sort(values), len(values)
    spread = np.sum((2.0 * np.arange(n) / (n - 1) - 1.0) * ordered) / n
    scale = max(float(spread) / log(2.0), 1e-300)
    return float(ordered.mean()) - EULER * scale, scale


def block_maxima(conditions, years=YEARS):
    """Return the load of a return period from the largest values of the runs: Gumbel by L-moments.

    The rate of exceedance per hour is the share-weighted sum of 1 - F(x)^(1 h / length of the run).
    NaN if a condition has fewer than two runs, or the conditions are rarer than the return period.
    """
    fits = []
    for condition in conditions:
        if len(condition.largest) < 2:
            return nan
        mode, scale = gumbel_fit(condition.largest)
        # of one hour: F^(1/h) is a Gumbel distribution again
        fits.append((condition.share, mode - scale * log(condition.hours.mean()), scale))
    share, mode, scale = np.array(fits).T
    target = 1.0 / (years * YEAR)
    if share.sum() <= target:
        return nan

    def excess(load):
        below = np.exp(np.minimum(-(load - mode) / scale, 700.0))
        return log(np.sum(share * -np.expm1(-below)) / target)

    low, high = float(mode.max()), float(np.max(mode + 60.0 * scale))
    while excess(low) < 0.0:
        low -= float(scale.max())
    return brentq(excess, low, high)


# --------------------------------------------------------------------------- inverse FORM


def reliability_index(years=YEARS, hours=1.0):
    """Return beta, the standard normal quantile that a state of some hours exceeds once in some years."""
    return float(norm.isf(hours / (years * YEAR)))


def sphere(dimensions, count):
    """Return (count, dimensions) points spread evenly over the unit sphere: a circle, or Fibonacci's spiral.

    Raises: InputError for another number of dimensions than 2 or 3.
    """
    if dimensions == 2:
        angle = 2.0 * pi * np.arange(count) / count
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if dimensions != 3:
        raise InputError(f"dimensions = {dimensions!r}: must be 2 or 3")
    height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    angle = pi * (3.0 - sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def environmental_contour(states, years=YEARS, hours=1.0, dimensions=2, count=90):
    """Return (count, variables) states of weather on the contour of a return period (inverse FORM).

    states: function of (n, dimensions) standard normal variables that returns (n, variables), the Rosenblatt
    transformation of the joint distribution: wind, Hs given the wind, Tp given both.
    """
    return np.asarray(states(reliability_index(years, hours) * sphere(dimensions, count)))


def inverse_form(response, states, years=YEARS, hours=1.0, dimensions=3, count=400):
    """Return (largest response, its state (variables,), its standard normal point (dimensions,)).

    response: function of states (n, variables) that returns the load (n,) of each, such as the median or
    another quantile of the largest value in the state's hours. The largest over the sphere of radius beta is
    searched on a grid and then by steps along the sphere that are halved where none is larger.
    """
    beta = reliability_index(years, hours)
    points = sphere(dimensions, count)
    values = np.asarray(response(np.asarray(states(beta * points))), dtype=np.float64)
    best, point, step = float(values.max()), points[int(values.argmax())], 2.0 / sqrt(count)
    directions = np.concatenate([np.eye(dimensions), -np.eye(dimensions)])
    while step > 1e-7:
        trial = point + step * directions
        trial /= np.linalg.norm(trial, axis=1, keepdims=True)
        values = np.asarray(response(np.asarray(states(beta * trial))), dtype=np.float64)
        if values.max() > best:
            best, point = float(values.max()), trial[int(values.argmax())]
        else:
            step *= 0.5
    return best, np.asarray(states(beta * point[None, :]))[0], beta * point


def states_of(climate):
    """Return the Rosenblatt transformation of a Climate: (n, 2) or (n, 3) normal variables to wind, Hs, Tp.

    With two variables Tp is the median of Hs and wind.
    """

    def states(normal):
        below = norm.cdf(normal)
        wind = climate.wind_at(below[:, 0])
        Hs = climate.height_at(below[:, 1], wind)
        Tp = climate.period_at(below[:, 2] if below.shape[1] > 2 else 0.5, Hs, wind)
        return np.stack([wind, Hs, Tp], axis=1)

    return states


def form_load(runs, column, side, climate, years=YEARS):
    """Return (load, wind, Hs) of a return period by inverse FORM over wind, Hs and the largest load in a run.

    runs: of production in normal turbulence, with several Hs in each wind, the severe sea among them: the
    largest load of a run is a Gumbel variable whose mode and scale are interpolated in Hs and wind, and
    continued beyond the largest Hs. (nan, nan, nan) with fewer than two winds.
    """
    sign = 1.0 if side == "max" else -1.0
    points = {}
    for case, each in runs:
        if case.wind_speed is not None:
            seas = points.setdefault(case.wind_speed, {})
            seas.setdefault(case.Hs, []).append(sign * each.value(column, side))
    tables = {
        wind: np.array([(Hs, *gumbel_fit(seas[Hs])) for Hs in sorted(seas) if len(seas[Hs]) > 1])
        for wind, seas in points.items()
    }
    winds = np.array(sorted(wind for wind, table in tables.items() if len(table)))
    if len(winds) < 2:
        return nan, nan, nan
    tables = [tables[wind] for wind in winds]

    def at_wind(number, Hs):  # (2, n) mode and scale in one wind
        table = tables[number]
        if len(table) == 1:
            return np.repeat(table[0, 1:, None], len(Hs), axis=1)
        left = np.clip(np.searchsorted(table[:, 0], Hs) - 1, 0, len(table) - 2)
        part = np.maximum(Hs - table[left, 0], 0.0) / (table[left + 1, 0] - table[left, 0])
        return (table[left, 1:] + part[:, None] * (table[left + 1, 1:] - table[left, 1:])).T

    def response(state):
        wind, Hs, below = state.T
        left = np.clip(np.searchsorted(winds, wind) - 1, 0, len(winds) - 2)
        part = np.clip((wind - winds[left]) / (winds[left + 1] - winds[left]), 0.0, 1.0)
        values = np.array([at_wind(number, Hs) for number in range(len(winds))])  # (winds, 2, n)
        columns = np.arange(len(wind))
        mode, scale = (1.0 - part) * values[left, :, columns].T + part * values[left + 1, :, columns].T
        load = mode - np.maximum(scale, 0.0) * np.log(-np.log(np.clip(below, 1e-300, 1.0 - 1e-16)))
        # outside the bins the turbine does not produce
        half = 0.5 * (winds[1] - winds[0])
        return np.where((wind < winds[0] - half) | (wind > winds[-1] + half), -inf, load)

    weather = states_of(climate)

    def states(normal):
        state = weather(normal[:, :2])
        return np.column_stack([state[:, :2], norm.cdf(normal[:, 2])])

    hours = float(np.mean([each.duration for _, each in runs])) / HOUR
    load, state, _ = inverse_form(response, states, years, hours)
    return sign * load, float(state[0]), float(state[1])
