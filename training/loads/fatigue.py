"""Computes lifetime fatigue of load channels: equivalent loads, Markov matrices, damage by an S-N curve.

Each run stands for hours_per_year of its LoadCase, so a lifetime has years * hours_per_year / (hours of the
run) repetitions of its rainflow cycles (Palmgren-Miner).
"""

from dataclasses import dataclass
from math import log10, nan

import numpy as np

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError
from fowt_env.training.loads.records import HOUR
from fowt_env.training.loads.selection import (
    bounds,
    columns_of,
    conditions_of,
    controllers_of,
    drawn_seeds,
    runs_of,
)
from fowt_env.training.loads.statistics import EXPONENTS

YEARS = 25.0
REFERENCE_CYCLES = 1e7


@dataclass(frozen=True)
class LifetimeLoad:
    """Holds a lifetime damage-equivalent load range of a channel, its 95 % interval over the seeds, and its
    ratio to the baseline controller's, paired in the seeds, with interval.
    """

    column: str
    controller: str
    exponent: int
    value: float
    low: float = nan
    high: float = nan
    ratio: float = nan
    ratio_low: float = nan
    ratio_high: float = nan
    share: tuple = ()  # ((dlc, share of the damage), ...), largest first


def fatigue_runs(runs):
    """Return the runs [(LoadCase, RunStatistics)] that count in the lifetime's fatigue."""
    return [run for run in runs if run[0].hours_per_year > 0.0 and run[0].analysis != "ultimate"]


def repetitions(case, statistics, years):
    """Return how often a run occurs in a lifetime."""
    return years * case.hours_per_year * HOUR / statistics.duration


def _contributions(runs, column, index, years):
    """Return {number of seeds: (seeds,) lifetime sums of count times range^m}, and {dlc: sum}."""
    totals, shares = {}, {}
    for members in conditions_of(runs).values():
        own = np.array([
            repetitions(case, each, years) * each.cycles[column].sums[index] for case, each in members
        ])  # fmt: skip
        totals[len(own)] = totals.get(len(own), 0.0) + own
        dlc = members[0][0].dlc
        shares[dlc] = shares.get(dlc, 0.0) + float(own.sum())
    return totals, shares


def lifetime_table(runs, exponents=(3, 4, 10), years=YEARS, reference_cycles=REFERENCE_CYCLES, baseline=None):
    """Return [LifetimeLoad] of every force and moment, exponent and controller of runs.

    value: range of the channel's unit that, repeated reference_cycles times, has the damage of the lifetime:
    (sum n S^m / reference_cycles)^(1/m). No mean-load correction, see `damage`.
    Raises: InputError for an exponent that runs have no sums of.
    """
    for exponent in exponents:
        if exponent not in EXPONENTS:
            raise InputError(f"exponent m = {exponent!r}: must be one of {', '.join(map(str, EXPONENTS))}")
    check_number("years", years, 0.0, low_open=True)
    check_number("reference_cycles", reference_cycles, 0.0, low_open=True)
    labels = controllers_of(runs)
    baseline = labels[0] if baseline is None else baseline
    own = {label: fatigue_runs(runs_of(runs, label)) for label in labels}
    own = {label: part for label, part in own.items() if part}
    used = [run for part in own.values() for run in part]
    if not used:
        return []
    columns = [name for name in columns_of(used) if all(name in each.cycles for _, each in used)]
    table = []
    for column in columns:
        for exponent in exponents:
            found = {}
            for label in own:
                totals, shares = _contributions(own[label], column, EXPONENTS.index(exponent), years)
                draws = drawn_seeds(totals)
                estimate = sum(float(each.sum()) for each in totals.values())
                drawn = sum(each[draws[n]].sum(axis=1) for n, each in totals.items())
                found[label] = (estimate, drawn, max(totals), shares)
            table += _with_ratios(found, column, exponent, reference_cycles, baseline)
    return table


def _with_ratios(found, column, exponent, reference_cycles, baseline):
    """Return the LifetimeLoads of all controllers of a channel and exponent."""
    rows, power = [], 1.0 / exponent
    for label, (total, drawn, seeds, shares) in found.items():
        value = (total / reference_cycles) ** power
        low, high = bounds(value, (drawn / reference_cycles) ** power, seeds, positive=True)
        ratio = (nan, nan, nan)
        if label != baseline and baseline in found and found[baseline][0] > 0.0:
            other, drawn_other = found[baseline][:2]
            ratio = ((total / other) ** power,)
            ratio += bounds(ratio[0], (drawn / drawn_other) ** power, seeds, positive=True)
        parts = sorted(shares.items(), key=lambda item: -item[1])
        parts = tuple((dlc, part / total) for dlc, part in parts) if total > 0.0 else ()
        rows.append(LifetimeLoad(column, label, exponent, value, low, high, *ratio, parts))
    return rows


@dataclass(frozen=True)
class Markov:
    """Holds a lifetime rainflow matrix: number of cycles by range and mean; bins have equal widths."""

    cycles: np.ndarray  # (ranges, means)
    range_edges: np.ndarray  # (ranges + 1,), unit of the channel
    mean_edges: np.ndarray  # (means + 1,)


def markov_matrix(runs, column, years=YEARS):
    """Return the Markov matrix of a channel over the lifetime of one controller's runs.

    Widths of the bins are those of the coarsest run: bins of others are joined, as their edges coincide.
    Raises: InputError without fatigue runs that have cycles of the channel.
    """
    used = [
        (each.cycles[column], repetitions(case, each, years))
        for case, each in fatigue_runs(runs)
        if column in each.cycles and len(each.cycles[column].cells)
    ]
    if not used:
        raise InputError(f"channel {column!r}: no fatigue run has its rainflow matrix")
    width, mean_width = (max(getattr(c, name) for c, _ in used) for name in ("width", "mean_width"))
    joined = []
    for cycles, weight in used:
        i = cycles.cells[:, 0] // round(width / cycles.width)
        j = cycles.cells[:, 1] // round(mean_width / cycles.mean_width)
        joined.append((i, j, 0.5 * weight * cycles.cells[:, 2]))
    i, j, n = map(np.concatenate, zip(*joined, strict=True))
    lowest = j.min()
    matrix = np.zeros((i.max() + 1, j.max() - lowest + 1))
    np.add.at(matrix, (i, j - lowest), n)
    return Markov(
        matrix, width * np.arange(matrix.shape[0] + 1), mean_width * (lowest + np.arange(matrix.shape[1] + 1))
    )


@dataclass(frozen=True)
class SNCurve:
    """Defines a bilinear S-N curve: log10 N = log10_a - m log10 S, with m2 below the knee at N cycles.

    S: stress range, MPa. m2 = None: one slope. Curves of DNV-RP-C203 have this form.
    """

    m: float
    log10_a: float
    m2: float | None = None
    knee: float = 1e7  # cycles

    def cycles(self, stress):
        """Return the number of cycles to failure of stress ranges (n,) > 0, MPa."""
        with np.errstate(divide="ignore"):
            log_stress = np.log10(stress)
        log_n = self.log10_a - self.m * log_stress
        if self.m2 is not None:
            corner = (self.log10_a - log10(self.knee)) / self.m  # of the stress at the knee
            log_n = np.where(log_stress < corner, log10(self.knee) - self.m2 * (log_stress - corner), log_n)
        return 10.0**log_n


def goodman(ranges, means, ultimate):
    """Return the load ranges with zero mean of the same damage: range / (1 - |mean| / ultimate).

    As in MLife (Hayman 2012, NREL) for zero fixed mean. Raises: InputError for a mean beyond the ultimate
    load.
    """
    if np.any(np.abs(means) >= ultimate):
        raise InputError(
            f"Goodman correction: the mean load {np.abs(means).max():.6g} is not below the ultimate load"
            f" {ultimate:g}"
        )
    return ranges / (1.0 - np.abs(means) / ultimate)


def damage(runs, column, curve, stress_per_load, ultimate=None, years=YEARS):
    """Return the Palmgren-Miner damage of a channel over the lifetime of one controller's runs; 1: failure.

    curve            SNCurve
    stress_per_load  MPa per unit of the channel
    ultimate         load (unit of the channel) of the Goodman correction; None: no correction
    Computed from the Markov matrix with the middle of its bins, times the ratio of the exact sum of range^m
    to that of the matrix where the runs have the curve's exponent m, which removes most of the binning error.
    """
    matrix = markov_matrix(runs, column, years)
    ranges = 0.5 * (matrix.range_edges[1:] + matrix.range_edges[:-1])[:, None]
    means = 0.5 * (matrix.mean_edges[1:] + matrix.mean_edges[:-1])[None, :]
    ranges, means = np.broadcast_arrays(ranges, means)
    filled = matrix.cycles > 0.0
    ranges, means, cycles = ranges[filled], means[filled], matrix.cycles[filled]
    effective = ranges if ultimate is None else goodman(ranges, means, ultimate)
    total = float(np.sum(cycles / curve.cycles(stress_per_load * effective)))
    if curve.m in EXPONENTS:
        index = EXPONENTS.index(int(curve.m))
        exact = sum(
            repetitions(case, each, years) * each.cycles[column].sums[index]
            for case, each in fatigue_runs(runs)
            if column in each.cycles
        )
        total *= exact / float(np.sum(cycles * ranges**curve.m))
    return total
