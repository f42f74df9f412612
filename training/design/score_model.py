"""Computes a suite's score of one run and its quadratic model over the output rows of the run.

The score of a run is the mean of the ratios of its metrics to those of the reference, over the ratio of its
energy. The model has a gradient g_k and a curvature h_k of each channel at each row k,

score(y + dy) ~ score(y) + sum_k (g_k dy_k + h_k dy_k^2 / 2),

with curvatures of quadratic bounds, whose minimisation cannot overshoot (majorisation and minimisation:
Hunter and Lange, The American Statistician 58, 30-37, 2004):

- standard deviation s of n rows: g = (y - mean)/(n s), h = 1/(n s);
- travel, the sum of |d|/T over the increments d of the rows: g = d/(a T), h = 1/(a T), a = max(|d|, least),
  least a fraction LEAST of the mean |d|;
- damage-equivalent load L of cycles with ranges r: g = count r^(m-1) L^(1-m)/T at the upper end of a cycle,
  the negative at the lower end, h = 2 (m - 1) g/r. The end of a cycle is the soft maximum of the rows around
  the turning point: a change of this row alone would only make its neighbour the turning point.

Limits are quadratic penalties of the relative excess.
"""

import re
from typing import NamedTuple

import numpy as np
import rainflow

from fowt_env.errors import InputError
from fowt_env.training.evaluation.limits import allowed_range
from fowt_env.training.evaluation.metrics import damage_equivalent_load, mean_exponent, never_negative, travel

TRAVELS = {"blade_pitch_travel_[deg/s]": "BldPitch1_[deg]", "torque_travel_[kN-m/s]": "GenTq_[kN-m]"}
CAPPED = "GenPwr_capped_mean_[kW]"
KINDS = ("std", "mean", "max", "DEL")
LEAST = 0.1  # of the mean increment, below which an increment has the curvature of this one
SOFT = 0.05  # of the standard deviation of a load, scale of the soft maximum around a turning point
PENALTY = 1000.0  # of the squared relative excess over a limit
PRICE = 0.03  # of a limited travel over its limit: within it, steps would otherwise be free


class Model(NamedTuple):
    """Holds gradient and curvature (rows, channels) of rows, and (rows - 1, channels) of their increments."""

    rows: np.ndarray
    row_curvature: np.ndarray
    steps: np.ndarray
    step_curvature: np.ndarray


class RunScore:
    """Computes the score of a run by a Score, with penalties for Limits (training.evaluation.cases).

    reference    {metric: value} of the reference on the same weather
    columns      names of the columns of a run; metrics of limits without a column are omitted
    rated_power  kW, above which power is not counted
    limits       list of Limits; each applies to the run alone, relative ones to the reference
    Attribute columns: the columns (c,) used; rows passed to the methods are (rows, c) in this order.
    Raises: InputError for terms of the score without a column, or of a kind without a model.
    """

    def __init__(self, score, reference, columns, rated_power, limits=()):
        self.rated_power, self.power = rated_power, score.power
        total = sum(term.weight for term in score.term)
        self.terms = {term.metric: term.weight / total / reference[term.metric] for term in score.term}
        self.base_power = reference[score.power] if score.power else 1.0
        if score.power not in (None, CAPPED):
            raise InputError(f"score.power = {score.power!r}: must be {CAPPED!r}")
        for metric in self.terms:
            if not _channels(metric, columns):
                raise InputError(f"score term {metric!r}: the run has no such channel")
        found = [each for part in limits for each in _bounds(part, reference)]
        self.bounds = [each for each in found if _channels(each[0], columns)]
        self.prices = {name: PRICE / most for name, _, most in self.bounds if name in TRAVELS}
        self.prices = {name: price for name, price in self.prices.items() if name not in self.terms}
        used = [*self.terms, *(metric for metric, *_ in self.bounds), *([score.power] if score.power else [])]
        self.columns = list(dict.fromkeys(name for metric in used for name in _channels(metric, columns)))

    def metric(self, name, time, rows):
        """Return the value of a metric from rows (n, c)."""
        values = rows[:, self._places(name)]
        kind = _kind(name)
        if kind == "travel":
            return float(travel(time, values[:, 0]))
        if kind == "capped":
            return float(np.mean(np.minimum(values[:, 0], self.rated_power)))
        if kind == "DEL":
            return max(self._loads(name, time, values))
        return float({"std": np.std, "mean": np.mean, "max": np.max}[kind](values[:, 0]))

    def score(self, time, rows):
        """Return the score of the run without penalties."""
        power = self._power(time, rows)
        total = sum(scale * self.metric(name, time, rows) for name, scale in self.terms.items())
        return total / power if power > 0.0 else np.inf

    def excess(self, time, rows):
        """Return {metric: relative excess over its limit} of the limits that are exceeded."""
        found = {name: _beyond(self.metric(name, time, rows), *ends)[0] for name, *ends in self.bounds}
        return {name: value for name, value in found.items() if value > 0.0}

    def total(self, time, rows):
        """Return the score plus the penalties."""
        total = self.score(time, rows) + sum(self._penalty(each, time, rows) for each in self.bounds)
        return total + sum(price * self.metric(name, time, rows) for name, price in self.prices.items())

    def model(self, time, rows):
        """Return the Model of total at rows (n, c)."""
        n, c = rows.shape
        made = Model(*(np.zeros((m, c)) for m in (n, n, n - 1, n - 1)))
        power, score = self._power(time, rows), self.score(time, rows)
        for name, scale in self.terms.items():
            self._add(made, name, time, rows, scale / power, 0.0)
        if self.power is not None:
            self._add(made, self.power, time, rows, -score / (power * self.base_power), 0.0)
        for name, price in self.prices.items():
            self._add(made, name, time, rows, price, 0.0)
        for name, least, most in self.bounds:
            if _kind(name) == "max":
                place, limit = self._places(name)[0], most
                over = np.maximum(rows[:, place] / limit - 1.0, 0.0)
                made.rows[:, place] += 2.0 * PENALTY * over / (limit * n)
                made.row_curvature[:, place] += 2.0 * PENALTY * (over > 0.0) / (limit**2 * n)
                continue
            excess, slope = _beyond(self.metric(name, time, rows), least, most)
            if excess > 0.0:
                self._add(made, name, time, rows, 2.0 * PENALTY * excess * slope, 2.0 * PENALTY * slope**2)
        return made

    def _power(self, time, rows):
        return self.metric(self.power, time, rows) / self.base_power if self.power else 1.0

    def _places(self, name):
        return [self.columns.index(each) for each in _channels(name, self.columns)]

    def _loads(self, name, time, values):
        exponent, length = mean_exponent(name), time[-1] - time[0]
        return [damage_equivalent_load(column, length, exponent) for column in values.T]

    def _penalty(self, bound, time, rows):
        name, least, most = bound
        if _kind(name) == "max":
            over = np.maximum(rows[:, self._places(name)[0]] / most - 1.0, 0.0)
            return PENALTY * float(np.mean(over**2))
        return PENALTY * _beyond(self.metric(name, time, rows), least, most)[0] ** 2

    def _add(self, made, name, time, rows, factor, square):
        """Add the model of factor M + square (M - M0)^2/2 of a metric M, M0 its value, to a Model."""
        places, kind = self._places(name), _kind(name)
        values = rows[:, places]
        if kind == "DEL":
            worst = int(np.argmax(self._loads(name, time, values)))
            places, values = places[worst : worst + 1], values[:, worst : worst + 1]
        y, place, length = values[:, 0], places[0], time[-1] - time[0]
        if kind == "travel":
            step = np.diff(y)
            size = np.maximum(np.abs(step), LEAST * np.mean(np.abs(step)) + 1e-12)
            gradient, curvature = step / (size * length), 1.0 / (size * length)
            into, into_curvature = made.steps, made.step_curvature
        else:
            gradient, curvature = _rows_model(kind, y, length, name, self.rated_power)
            into, into_curvature = made.rows, made.row_curvature
        into[:, place] += factor * gradient
        # the square of a sum of g dy is at most the sum of |g| times the sum of |g| dy^2
        into_curvature[:, place] += max(factor, 0.0) * curvature
        into_curvature[:, place] += square * np.abs(gradient) * np.abs(gradient).sum()


def _rows_model(kind, y, length, name, rated_power):
    """Return (gradient, curvature) (n,) of a metric of the rows y (n,) of one channel."""
    n = y.size
    if kind == "mean":
        return np.full(n, 1.0 / n), np.zeros(n)
    if kind == "capped":
        return (y < rated_power) / n, np.zeros(n)
    if kind == "std":
        deviation = max(float(np.std(y)), 1e-12)
        return (y - y.mean()) / (n * deviation), np.full(n, 1.0 / (n * deviation))
    return _fatigue_model(y, length, mean_exponent(name))


def _fatigue_model(y, length, exponent):
    """Return (gradient, curvature) (n,) of the damage-equivalent load of y (n,)."""
    load = damage_equivalent_load(y, length, exponent)
    gradient, curvature = np.zeros(y.size), np.zeros(y.size)
    if not load > 0.0:
        return gradient, curvature
    at, bend = np.zeros(y.size), np.zeros(y.size)
    for size, _, count, start, end in rainflow.extract_cycles(y):
        slope = count * size ** (exponent - 1.0) * load ** (1.0 - exponent) / length
        upper, lower = (start, end) if y[start] > y[end] else (end, start)
        at[upper] += slope
        at[lower] -= slope
        bend[[upper, lower]] += 2.0 * (exponent - 1.0) * slope / size
    turns = np.flatnonzero(bend)
    soft = SOFT * float(np.std(y))
    for before, turn, after in zip(np.r_[-1, turns[:-1]], turns, np.r_[turns[1:], y.size], strict=True):
        near = slice(before + 1, after)
        share = np.exp(-np.abs(y[near] - y[turn]) / soft)
        share /= share.sum()
        gradient[near] += share * at[turn]
        curvature[near] += share * bend[turn]
    return gradient, curvature


def _kind(metric):
    """Return the kind of a metric: one of KINDS, "travel" or "capped". Raises: InputError for others."""
    if metric in TRAVELS:
        return "travel"
    if metric == CAPPED:
        return "capped"
    match = re.fullmatch(r"\w+_(\w+)_\[.*\]", metric)
    if match is None or match[1] not in KINDS:
        raise InputError(f"metric {metric!r}: has no model; must be a travel or of {', '.join(KINDS)}")
    return match[1]


def _channels(metric, columns):
    """Return the columns of a metric among those of a run; [] if it has none, or no model."""
    try:
        kind = _kind(metric)
    except InputError:
        return []
    if kind == "travel":
        return [TRAVELS[metric]] if TRAVELS[metric] in columns else []
    if kind == "capped":
        return [name for name in columns if name == "GenPwr_[kW]"]
    name, unit = re.fullmatch(r"(\w+)_\w+_\[(.*)\]", metric).groups()
    pattern = rf"{name}\d*_\[{re.escape(unit)}\]" if kind == "DEL" else rf"{name}_\[{re.escape(unit)}\]"
    return [column for column in columns if re.fullmatch(pattern, column)]


def _bounds(limits, reference):
    """Return [(metric, least, most)] of Limits for one run."""
    found = [(name, -np.inf, most) for name, most in (limits.run | limits.lifetime | limits.case).items()]
    found += [(name, -np.inf, most * reference[name]) for name, most in limits.relative.items()]
    for name, bound in limits.case_relative.items():
        least, most = allowed_range(name, bound)
        found.append((name, least * reference[name], most * reference[name]))
    for name, point in limits.set_point.items():
        near = abs(reference[name] - point.rated) + point.within * point.rated
        found.append((name, point.rated - near, point.rated + near))
    return [each for each in found if never_negative(each[0]) or "_[" in each[0]]


def _beyond(value, least, most):
    """Return (relative excess over a range, its derivative by the value); (0, 0) within the range."""
    if value > most:
        return value / most - 1.0, 1.0 / most
    if value < least:
        return 1.0 - value / least, -1.0 / least
    return 0.0, 0.0
