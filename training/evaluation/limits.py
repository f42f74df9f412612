"""Decides the limits of a suite: each is held, not decided or exceeded, from an interval over the seeds.

A limit is exceeded if the estimate is beyond it, so that neither few seeds nor scattered loads protect from
it, and held only if the one-sided 95 % bound of the estimate is within it, too. Between them, and within a
limit without an interval, it is not decided. A limit for each run is decided by the runs themselves.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.training.evaluation.bootstrap import LEVEL, interval, lifetime_means
from fowt_env.training.evaluation.metric_names import short_name
from fowt_env.training.evaluation.metrics import EXPONENTS, METRICS, better, never_negative

HELD, UNDECIDED, EXCEEDED = "held", "not decided", "exceeded"
TWO_SIDED = 2.0 * LEVEL - 1.0  # level of the interval whose ends are the one-sided bounds
LIFETIME = " over the lifetime"  # of a limited mean


class Decision(NamedTuple):
    """Holds the decision on one limit of one controller, in one case or over the lifetime."""

    metric: str
    what: str  # of the metric that is limited, such as " over gspi_oc3"
    case: str  # "" for the lifetime and for any run
    value: float
    low: float  # one-sided bounds of the value; NaN: none
    high: float
    least: float
    most: float

    @property
    def state(self):
        """Return HELD, UNDECIDED or EXCEEDED."""
        if not self.least <= self.value <= self.most:  # also a value that is missing
            return EXCEEDED
        above = self.least == -np.inf or self.low >= self.least
        below = self.most == np.inf or self.high <= self.most
        return HELD if above and below else UNDECIDED

    @property
    def excess(self):
        """Return how far the value is beyond the limit, as a fraction of it (in its unit if it is zero)."""
        beyond, limit = max((self.value - self.most, self.most), (self.least - self.value, self.least))
        return max(0.0, beyond) / (abs(limit) or 1.0) if np.isfinite(limit) else 0.0


def allowed_range(metric, bound):
    """Return (least, most) of a limit: two numbers, or one in the metric's better direction."""
    if len(bound) == 2:
        return tuple(bound)
    return (bound[0], np.inf) if better(metric) > 0 else (-np.inf, bound[0])


def decide(limits, part, weights):
    """Return the list of Decisions on the Limits of a suite (cases.py) for the _Part of a controller.

    weights (resamples, seeds): of bootstrap.resample_weights. Lost runs are not counted. A limit relative to
    the reference is not checked where the reference lacks the metric; a metric that a run lacks and the
    reference has exceeds the limit.
    """
    found = []
    for name, most in limits.run.items():
        values = part.values[..., METRICS.index(name)][part.runs & ~part.lost]
        if values.size:
            most_of_all = float(values.max())
            found.append(Decision(name, "", "", *[most_of_all] * 3, -np.inf, most))
    over = f" over {limits.baseline}"
    whole = [(name, LIFETIME, (-np.inf, most), _mean) for name, most in limits.lifetime.items()]
    whole += [(name, over, (-np.inf, most), _ratio) for name, most in limits.relative.items()]
    each = [(name, "", (-np.inf, most), _mean) for name, most in limits.case.items()]
    each += [(name, over, allowed_range(name, bound), _ratio) for name, bound in limits.case_relative.items()]
    for name, point in limits.set_point.items():
        what = f", % of {point.rated:g} further from it than {limits.baseline}"
        each.append((name, what, (-np.inf, 100.0 * point.within), _distance(point.rated)))
    places = [("", part, whole), *((case, part.case(i), each) for i, case in enumerate(part.cases) if each)]
    for case, here, rules in places:
        for rule in () if here.nothing else rules:
            found += _decision(here, case, weights, *rule)
    return found


def _mean(own, base):
    """Return the mean itself."""
    return own


def _ratio(own, base):
    """Return the ratio to the reference's mean."""
    return own / base


def _distance(rated):
    """Return the function that gives how much further than the reference's a mean is from `rated`, in %."""
    return lambda own, base: 100.0 * (np.abs(own / rated - 1.0) - np.abs(base / rated - 1.0))


def _decision(part, case, weights, name, what, allowed, of):
    """Return [Decision] on one limit of a mean over the cases of a _Part; [] if it cannot be checked."""
    column = slice(METRICS.index(name), METRICS.index(name) + 1)
    own, base = part.values[..., column], part.reference[..., column]
    counted = part.runs[..., None] & (True if of is _mean else np.isfinite(base))
    if not (counted & ~part.lost[..., None]).any():
        return []
    lacking = (counted & ~part.lost[..., None] & ~np.isfinite(own)).any()
    own, base = (np.where(counted & np.isfinite(own), values, np.nan) for values in (own, base))

    def value(weights):
        return of(*(lifetime_means(each, weights, part.shares, EXPONENTS[column]) for each in (own, base)))

    with np.errstate(all="ignore"):
        estimate = np.full(1, np.nan) if lacking else value(np.ones((1, weights.shape[1])))[0]
        seeds = int(np.isfinite(own).any(axis=(0, 2)).sum())
        positive = of is _ratio or (of is _mean and never_negative(name))
        low, high = interval(estimate, value(weights), seeds, positive, TWO_SIDED)
    ends = (float(each[0]) for each in (estimate, low, high))
    return [Decision(name, what, case, *ends, *allowed)]


def limit_texts(decisions, state):
    """Return the limits in one state, a text each: "shaft-torque DEL over pi = 1.3 in u_16, allowed 1.25"."""
    texts = {}
    for each in decisions:
        if each.state == state:
            ends = f" [{each.low:.4g}, {each.high:.4g}]" if each.low < each.high else ""
            where = f" in {each.case}" if each.case else ""
            texts.setdefault((each.metric, each.what, _allowed(each)), []).append(
                f"{each.value:.4g}{ends}{where}"
            )
    return [
        f"{limited(metric, what)} = {', '.join(values)}, allowed {allowed}"
        for (metric, what, allowed), values in texts.items()
    ]


def limited(metric, what):
    """Return what a limit is on, such as "pitch travel over gspi_oc3"; a mean itself has its unit."""
    unit = metric.partition("_[")[2].removesuffix("]")
    return f"{short_name(metric)}{f' ({unit})' if what in ('', LIFETIME) else ''}{what}"


def _allowed(decision):
    """Return the allowed range as text."""
    if decision.least == -np.inf:
        return f"{decision.most:g}"
    least = f"{decision.least:g}"
    return f"at least {least}" if decision.most == np.inf else f"{least} to {decision.most:g}"
