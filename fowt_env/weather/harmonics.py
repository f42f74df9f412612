"""Sums complex exponentials over evenly spaced times, and fits cubic B-splines to the sums."""

from math import ceil, pi
from typing import NamedTuple

import numpy as np
from scipy.fft import ifft, next_fast_len

from fowt_env.plant.hydro.excitation import COLUMNS, TimeTable

EVEN = 1e-6  # of a spacing: tolerance of a harmonic's frequency, a phase of 6e-6 rad after one period
SPLINE_ERROR = 1.3e-3  # of an interpolated exponential, times (omega step)^4: rms over times and phases
TOLERANCE = 5e-6  # rms error of a table over its standard deviation
ROUNDED = 1e-4  # of a gap: tolerance of a multiple, for rounded values of files
MOST_HARMONICS = 20_000  # from the lowest to the highest frequency, or twice their number if more
LONG_PERIOD = 3600.0  # s, above which a table covers the duration instead of a period
LONGEST = 1.2  # omega times step of the highest frequency
MARGIN = 5.0  # s of table after the requested time
MOST_ROWS = 2_000_000  # 128 MB
BLOCK_NUMBERS = 4_000_000  # maximum of complex numbers in a block of a direct sum: 64 MB


class Harmonics(NamedTuple):
    """Defines evenly spaced frequencies start + index * spacing, rad/s."""

    start: float
    spacing: float
    index: np.ndarray  # (n,) whole numbers from 0

    @property
    def period(self):
        """Return the time (s) after which the differences of the frequencies repeat."""
        return 2.0 * pi / self.spacing

    @property
    def periodic(self):
        """Return whether the frequencies themselves are multiples of the spacing."""
        ratio = self.start / self.spacing
        return abs(ratio - round(ratio)) < EVEN


def harmonics_of(omega):
    """Return the Harmonics of frequencies (n,) rad/s in any order; None if these are not evenly spaced."""
    start = float(omega.min())
    gaps = np.diff(np.unique(omega))
    spacing = _common_part(gaps[gaps > EVEN * start], start)
    if float(omega.max()) - start > max(MOST_HARMONICS, 2 * omega.size) * spacing:
        return None
    index = np.round((omega - start) / spacing)
    if index.any():  # a fit over all frequencies averages the rounding that a single gap carries
        spacing = float((omega - start) @ index / (index @ index))
    if np.abs((omega - start) / spacing - index).max() > EVEN:
        return None
    return Harmonics(start, spacing, index.astype(int))


def _common_part(gaps, without):
    """Return the common divisor of gaps (n,) by Euclid's algorithm with tolerance; `without` if n is 0."""
    if gaps.size == 0:
        return without
    common = float(gaps.min())
    least = 0.01 * common / gaps.size
    for gap in gaps:
        one, rest = common, abs(gap - common * round(gap / common))
        while rest > ROUNDED * one and rest > least:
            one, rest = rest, abs(one - rest * round(one / rest))
        common = one
    return common


def step_for(omega, coefficient):
    """Return the step (s) that keeps the rms error of a cubic spline of sums of (n, m) exponentials at
    TOLERANCE of each column's standard deviation."""
    step = LONGEST / omega.max()
    power = np.abs(coefficient) ** 2
    total = power.sum(axis=0)
    for column in np.flatnonzero(total > 0.0):
        curved = np.sqrt(omega**8 @ power[:, column] / total[column])
        if curved > 0.0:
            step = min(step, (TOLERANCE / (SPLINE_ERROR * curved)) ** 0.25)
    return step


def table_of(omega, coefficient, duration):
    """Return the TimeTable of Re(sum of coefficient (n, m) exp(i omega t)), m up to COLUMNS.

    The table covers one period and repeats if the frequencies are multiples of one; else it covers the
    duration (s) or, for evenly spaced frequencies, the period of the differences if not much longer.
    """
    step = step_for(omega, coefficient)
    harmonics = harmonics_of(omega)
    if harmonics is None or harmonics.period > max(2.0 * duration, LONG_PERIOD):
        rows = min(ceil((duration + MARGIN) / step), MOST_ROWS)
        values = direct_sum(omega, _prefiltered(omega, coefficient, step), step, rows + 3).real
        return pack_table(values, step, rows * step, False)
    within = next_fast_len(max(8, ceil(harmonics.period / step)))
    step = harmonics.period / within
    periodic = harmonics.periodic and within <= MOST_ROWS
    length = max(harmonics.period, duration) if not periodic else harmonics.period
    rows = within if periodic else min(ceil((length + MARGIN) / step), MOST_ROWS)
    spectrum = np.zeros((within, coefficient.shape[1]), dtype=complex)
    np.add.at(spectrum, harmonics.index, _prefiltered(omega, coefficient, step))
    envelope = ifft(spectrum, axis=0, norm="forward", overwrite_x=True)
    at = np.arange(-1, rows + 2)
    turn = np.exp(1j * harmonics.start * step * at)
    values = (envelope[at % within] * turn[:, None]).real
    return pack_table(values, step, harmonics.period if periodic else rows * step, periodic)


def pack_table(values, step, span, periodic):
    """Return the TimeTable of B-spline coefficients (rows + 3, m) at times -step, 0, ..."""
    table = np.zeros((values.shape[0], COLUMNS))
    table[:, : values.shape[1]] = values
    return TimeTable(table, float(1.0 / step), float(span), bool(periodic))


def constant_table(value):
    """Return a TimeTable of constant values (m,)."""
    return pack_table(np.tile(value, (11, 1)), 1.0, 8.0, True)


def response_of_spline(omega, step):
    """Return the frequency response of a cubic B-spline whose coefficients are samples of exponentials."""
    return (4.0 + 2.0 * np.cos(omega * step)) / 6.0


def _prefiltered(omega, coefficient, step):
    return coefficient / response_of_spline(omega, step)[:, None]


def direct_sum(omega, coefficient, step, rows):
    """Return (rows, m) complex sums of coefficient (n, m) exp(i omega t) at t = -step, 0, step, ...

    exp(i omega (t1 + t2)) is a product, so a block of times needs only two short tables of exponentials.
    """
    n, m = coefficient.shape
    block = max(1, min(ceil(rows**0.5), BLOCK_NUMBERS // (n * m)))
    coarse = np.arange(0, rows, block)
    fine = np.exp(1j * np.outer(omega, np.arange(block) * step))
    inner = (fine[:, :, None] * coefficient[:, None, :]).reshape(n, -1)
    result = np.empty((coarse.size * block, m), dtype=complex)
    at_once = max(1, BLOCK_NUMBERS // max(n, block * m))
    for first in range(0, coarse.size, at_once):
        start = (coarse[first : first + at_once] - 1) * step
        outer = np.exp(1j * np.outer(start, omega))
        result[first * block : (first + start.size) * block] = (outer @ inner).reshape(-1, m)
    return result[:rows]
