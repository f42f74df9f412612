"""Computes second-order wave forces on a potential-flow body from its quadratic transfer functions.

The double sum (A42) of theory.md, with Q interpolated bilinearly, is evaluated as the quadratic form (A43) of
sums A_p(t), which needs a transform per frequency of the file instead of a loop over pairs of components.
Sum frequencies have the same form without conjugates.
"""

import warnings
from collections.abc import Callable
from math import ceil, pi
from typing import NamedTuple

import numpy as np
from scipy.fft import fft, ifft, irfft, next_fast_len, rfft
from scipy.ndimage import spline_filter1d

from fowt_env.errors import InputError, PlantWarning, level_outside
from fowt_env.plant.hydro.excitation import SecondOrder
from fowt_env.weather.harmonics import (
    MARGIN,
    MOST_ROWS,
    constant_table,
    direct_sum,
    harmonics_of,
    pack_table,
    response_of_spline,
    step_for,
    table_of,
)

METHODS = ("mean_drift", "newman", "full", "full_sum")
QUIET = 1e-2  # fraction of the sea's energy outside the QTF's frequencies that is ignored
SAME_HEADING = 1e-4  # rad
EDGE = 24  # extra rows at both ends of a fitted spline: the influence of an end falls by 3.7 per row
SAMPLES = 12  # per shortest difference period of a sea whose frequencies are not evenly spaced


def build_second_order(body, waves, method, *, duration, cutoff=None):
    """Return the SecondOrder of a PotentialFlow with a QTF in Waves, by one of METHODS (else None or "none").

    mean_drift  the mean force only
    newman      Newman's approximation from the diagonal of the QTF: |sum a_i sqrt(Q_ii) exp(i w_i t)|^2 over
                positive Q_ii, less the same sum over negative Q_ii
    full        all pairs of frequencies
    full_sum    the same, and the forces of sum frequencies
    cutoff      rad/s: forces at higher difference frequencies are omitted; None: no cutoff

    Raises: InputError for a sea whose headings or pairs of frequencies the QTF lacks.
    """
    if method in (None, "none"):
        return None
    qtf = body.difference_qtf
    ramp = float(waves.ramp)
    used = _inside(qtf, waves)
    if not waves.amplitude[used].any():
        return SecondOrder(constant_table(np.zeros(6)), np.zeros(6), ramp)
    wave = waves.amplitude[used] * np.exp(-1j * waves.phase[used])
    omega = waves.omega[used]
    groups = _heading_groups(qtf, np.arctan2(waves.sin_heading, waves.cos_heading)[used])
    sums = _of_sums(body.sum_qtf, waves) if method == "full_sum" else None
    mean = _mean(qtf, omega, wave, groups)
    if method == "mean_drift":
        return SecondOrder(constant_table(mean), mean, ramp)
    form = (_newman if method == "newman" else _full)(qtf, omega, wave, groups)
    harmonics = harmonics_of(omega)
    if harmonics is None or (sums is not None and sums.harmonics is None):
        return SecondOrder(_uneven_table(omega, form, duration, cutoff, sums), mean, ramp)
    if sums is not None:
        return SecondOrder(_joined_table(harmonics, form, cutoff, sums, duration), mean, ramp)
    return SecondOrder(_even_table(harmonics, form, cutoff), mean, ramp)


class _Sums(NamedTuple):
    """Holds the sum-frequency force of a sea."""

    omega: np.ndarray  # (n,) of the components that the QTF covers
    harmonics: object  # Harmonics of omega, or None
    form: object  # _Form, whose force is complex


def _of_sums(qtf, waves):
    """Return the _Sums of a sea with the QTF of sum frequencies; None if it covers no waves."""
    used = _inside(qtf, waves)
    if not waves.amplitude[used].any():
        return None
    omega, wave = waves.omega[used], waves.amplitude[used] * np.exp(-1j * waves.phase[used])
    groups = _heading_groups(qtf, np.arctan2(waves.sin_heading, waves.cos_heading)[used])
    return _Sums(omega, harmonics_of(omega), _full(qtf, omega, wave, groups))


def _inside(qtf, waves):
    """Return a mask (n,) of the components that the QTF covers. Warns: PlantWarning above QUIET outside."""
    low, high = qtf.omega[0] * (1.0 - 1e-6), qtf.omega[-1] * (1.0 + 1e-6)
    used = (waves.omega >= low) & (waves.omega <= high)
    energy = waves.amplitude**2
    left_out = float(energy[~used].sum()) / max(float(energy.sum()), 1e-300)
    if left_out > QUIET:
        warnings.warn(
            f"sea: {100.0 * left_out:.3g} % of its energy lies outside the {_name(qtf)} QTF, which"
            f" has {qtf.omega[0]:.4g} to {qtf.omega[-1]:.4g} rad/s, and causes no second-order force",
            PlantWarning,
            stacklevel=level_outside(),
        )
    return used


def _heading_groups(qtf, heading):
    """Return [(components, {other group: (row of the QTF, exchanged)})] for each heading of the sea."""
    values = []
    for angle in heading:
        if not any(_same(angle, other) for other in values):
            values.append(angle)
    groups = []
    for angle in values:
        pairs = {other: _pair(qtf, angle, second) for other, second in enumerate(values)}
        groups.append((np.flatnonzero([_same(angle, one) for one in heading]), pairs))
    return groups


def _pair(qtf, first, second):
    """Return (row of the QTF, whether the row has the two waves exchanged) for a pair of headings."""
    for exchanged, requested in ((False, (first, second)), (True, (second, first))):
        for row, pair in enumerate(qtf.heading):
            if all(map(_same, requested, pair)):
                return row, exchanged
    available = ", ".join(f"({one:g}, {other:g})" for one, other in np.degrees(qtf.heading)[:12])
    raise InputError(
        f"sea: the {_name(qtf)} QTF has no pair of headings ({np.degrees(first):.4g},"
        f" {np.degrees(second):.4g}) deg; it has {available} deg"
    )


def _name(qtf):
    return f"{'sum' if qtf.of_sums else 'difference'}-frequency"


def _same(a, b):
    return abs((a - b + pi) % (2.0 * pi) - pi) < SAME_HEADING


def _table(qtf, row, exchanged):
    """Return Q (k, k, 6) of a pair of headings; missing values are those of the exchanged pair."""
    value = qtf.value[row]
    if exchanged:
        return qtf.mirrored(value)
    one, other = qtf.heading[row]
    if _same(one, other):
        return np.where(np.isnan(value), qtf.mirrored(value), value)
    return value


def _hats(qtf, omega):
    """Return (low, weight): index of the QTF frequency below each omega (n,), and the next one's weight."""
    if qtf.omega.size == 1:
        return np.zeros(omega.size, dtype=int), np.zeros(omega.size)
    low = np.clip(np.searchsorted(qtf.omega, omega, side="right") - 1, 0, qtf.omega.size - 2)
    weight = (omega - qtf.omega[low]) / (qtf.omega[low + 1] - qtf.omega[low])
    return low, np.clip(weight, 0.0, 1.0)


def _diagonal(qtf, omega, row):
    """Return the real Q(w, w) (n, 6) of a heading; without off-diagonal values linear along the diagonal."""
    table = _table(qtf, row, False)
    low, weight = _hats(qtf, omega)
    high, weight = np.minimum(low + 1, qtf.omega.size - 1), weight[:, None]
    lower, upper = table[low, low].real, table[high, high].real
    cross = table[high, low].real
    cross = np.where(np.isnan(cross), 0.5 * (lower + upper), cross)
    value = (1.0 - weight) ** 2 * lower + 2.0 * weight * (1.0 - weight) * cross + weight**2 * upper
    if np.isnan(value).any():
        raise InputError("the difference-frequency QTF lacks pairs of equal frequencies that the sea needs")
    return value


def _mean(qtf, omega, wave, groups):
    """Return the mean force (6,): the sum over each component paired with itself."""
    total = np.zeros(6)
    for number, (members, pairs) in enumerate(groups):
        total += np.abs(wave[members]) ** 2 @ _diagonal(qtf, omega[members], pairs[number][0])
    return total


class _Form(NamedTuple):
    """Holds a quadratic form: the sums of components A_p(t) and the force as a function of these sums."""

    coefficient: np.ndarray  # (n, m) of the components
    force: Callable  # (rows, m) complex sums -> (rows, 6)


def _newman(qtf, omega, wave, groups):
    """Return the _Form of Newman's approximation: |positive|^2 - |negative|^2 of each force and heading."""
    columns = np.zeros((omega.size, 2, 6, len(groups)), dtype=complex)
    for number, (members, pairs) in enumerate(groups):
        diagonal = _diagonal(qtf, omega[members], pairs[number][0])
        columns[members, 0, :, number] = wave[members, None] * np.sqrt(np.maximum(diagonal, 0.0))
        columns[members, 1, :, number] = wave[members, None] * np.sqrt(np.maximum(-diagonal, 0.0))
    shape = columns.shape[1:]

    def force(sums):
        power = (np.abs(sums.reshape(-1, *shape)) ** 2).sum(axis=-1)
        return power[:, 0] - power[:, 1]

    return _Form(columns.reshape(omega.size, -1), force)


def _full(qtf, omega, wave, groups):
    """Return the _Form of the full QTF: hat functions of the QTF frequencies for each heading."""
    low, weight = _hats(qtf, omega)
    high = np.minimum(low + 1, qtf.omega.size - 1)
    nodes = np.unique(np.concatenate([low, high[weight > 0.0]]))
    size = nodes.size
    columns = np.zeros((omega.size, len(groups) * size), dtype=complex)
    matrix = np.zeros((6, columns.shape[1], columns.shape[1]), dtype=complex)
    for number, (members, pairs) in enumerate(groups):
        at = number * size + np.searchsorted(nodes, low[members])
        np.add.at(columns, (members, at), wave[members] * (1.0 - weight[members]))
        upper = members[weight[members] > 0.0]
        at = number * size + np.searchsorted(nodes, high[upper])
        np.add.at(columns, (upper, at), wave[upper] * weight[upper])
        for other, (row, exchanged) in pairs.items():
            block = _table(qtf, row, exchanged)[np.ix_(nodes, nodes)].transpose(2, 0, 1)
            position = slice(number * size, (number + 1) * size), slice(other * size, (other + 1) * size)
            matrix[:, *position] = block
    if np.isnan(matrix).any():
        raise InputError(
            f"the {_name(qtf)} QTF lacks pairs of frequencies that the sea needs"
            f" (between {qtf.omega[nodes[0]]:.4g} and {qtf.omega[nodes[-1]]:.4g} rad/s)"
        )
    if qtf.of_sums:

        def of_sums(sums):
            return np.column_stack([np.einsum("kp,kp->k", sums @ one, sums) for one in matrix])

        return _Form(columns, of_sums)
    # only the Hermitian part of the matrix contributes to the real part of the form
    matrix = 0.5 * (matrix + np.conj(matrix.transpose(0, 2, 1)))

    def force(sums):
        return np.column_stack([np.einsum("kp,kp->k", sums @ one, np.conj(sums)).real for one in matrix])

    return _Form(columns, force)


def _even_changes(harmonics, form, cutoff):
    """Return (omega (k,), one-sided coefficients (k, 6)) of the difference-frequency force of Harmonics."""
    highest = int(harmonics.index.max())
    size = next_fast_len(2 * highest + 2)
    spectrum = np.zeros((size, form.coefficient.shape[1]), dtype=complex)
    np.add.at(spectrum, harmonics.index, form.coefficient)
    force = form.force(ifft(spectrum, axis=0, norm="forward", overwrite_x=True))
    change = rfft(force, axis=0, norm="forward")[: highest + 1]
    omega = harmonics.spacing * np.arange(highest + 1)
    if cutoff is not None:
        change[omega > cutoff * (1.0 + 1e-9)] = 0.0
    return omega, change


def _joined_table(harmonics, form, cutoff, sums, duration):
    """Return the TimeTable of the difference- and sum-frequency forces of a sea of Harmonics."""
    omega, change = _even_changes(harmonics, form, cutoff)
    change[1:] *= 2.0
    grid = sums.harmonics
    highest = int(grid.index.max())
    size = next_fast_len(2 * highest + 1)
    spectrum = np.zeros((size, sums.form.coefficient.shape[1]), dtype=complex)
    np.add.at(spectrum, grid.index, sums.form.coefficient)
    # the squares of the envelopes, whose carrier has twice the lowest frequency
    force = sums.form.force(ifft(spectrum, axis=0, norm="forward", overwrite_x=True))
    double = fft(force, axis=0, norm="forward")[: 2 * highest + 1]
    frequency = 2.0 * grid.start + grid.spacing * np.arange(2 * highest + 1)
    return table_of(np.concatenate([omega, frequency]), np.concatenate([change, double]), duration)


def _even_table(harmonics, form, cutoff):
    """Return the TimeTable of a sea of Harmonics, which repeats with the period of the differences."""
    omega, change = _even_changes(harmonics, form, cutoff)
    highest = omega.size - 1
    rows = max(8, next_fast_len(2 * highest + 2))
    if highest > 0 and np.abs(change[1:]).any():
        rows = next_fast_len(max(rows, ceil(harmonics.period / step_for(omega[1:], change[1:]))), real=True)
    rows = min(rows, MOST_ROWS)
    step = harmonics.period / rows
    change = change / response_of_spline(omega, step)[:, None]
    values = irfft(change, n=rows, axis=0, norm="forward")
    return pack_table(values[np.arange(-1, rows + 2) % rows], step, harmonics.period, True)


def _uneven_table(omega, form, duration, cutoff, sums=None):
    """Return the TimeTable of a sea whose frequencies are not evenly spaced, over the duration."""
    spread = float(np.ptp(omega))
    if cutoff is not None and cutoff < spread:
        raise InputError(
            f"second_order_cutoff = {cutoff:g} rad/s: needs a sea of evenly spaced frequencies, from a"
            " spectrum or from harmonics of one period"
        )
    highest = spread if sums is None else max(spread, 2.0 * float(sums.omega.max()))
    step = 2.0 * pi / (SAMPLES * highest)
    rows = min(ceil((duration + MARGIN) / step), MOST_ROWS)

    def force(omega, form):
        # rows from -step, and EDGE more on both sides, where the spline fit still depends on the ends
        turned = form.coefficient * np.exp(-1j * omega * EDGE * step)[:, None]
        return form.force(direct_sum(omega, turned, step, rows + 3 + 2 * EDGE)).real

    total = force(omega, form) + (0.0 if sums is None else force(sums.omega, sums.form))
    values = spline_filter1d(total, order=3, axis=0, mode="mirror")
    return pack_table(values[EDGE : EDGE + rows + 3], step, rows * step, False)
