"""Selects runs of a design load table by controller and condition, and resamples their seeds."""

import numpy as np

from fowt_env.errors import InputError
from fowt_env.training.evaluation.bootstrap import RANDOM_SEED, interval
from fowt_env.training.evaluation.run_case import PARKED

RESAMPLES = 600  # of seeds: the ends of a 95 % interval then vary by some 4 % of its width


def controllers_of(runs):
    """Return the labels of the controllers of runs [(LoadCase, RunStatistics)], in their order.

    Runs of a parked turbine belong to every controller; alone, they are the only one.
    """
    labels = list(dict.fromkeys(case.controller for case, _ in runs))
    return [label for label in labels if label != PARKED] or labels


def runs_of(runs, controller):
    """Return the runs of one controller, and those of the parked turbine."""
    return [run for run in runs if run[0].controller in (controller, PARKED)]


def conditions_of(runs):
    """Return {(dlc, name): runs in order of their seeds} of the runs of one controller."""
    found = {}
    for run in sorted(runs, key=lambda run: run[0].seed):
        found.setdefault(run[0].condition, []).append(run)
    return found


def drawn_seeds(counts, resamples=RESAMPLES):
    """Return {n: (resamples, n) indices of n seeds drawn with replacement} of the numbers of seeds in counts.

    Conditions with as many seeds are resampled together, as they share the seeds' random phases; one seed
    alone is always drawn.
    """
    random = np.random.default_rng(RANDOM_SEED)
    return {n: random.integers(n, size=(resamples, n)) for n in sorted(set(counts))}


def bounds(estimate, resampled, n, positive=False):
    """Return (low, high), 95 %, of an estimate from its resamples (k,) of n seeds; NaN for too few seeds."""
    low, high = interval(np.array([estimate]), resampled[:, None], n, positive)
    return float(low[0]), float(high[0])


def columns_of(runs):
    """Return the channels that all runs have, in the order of the first. Raises: InputError without runs."""
    if not runs:
        raise InputError("load table: no run has statistics")
    common = set.intersection(*(set(each.channels) for _, each in runs))
    return [name for name in runs[0][1].channels if name in common]
