"""Computes the wave force on a potential-flow body in a sea from its coefficients.

The complex excitation of each component is interpolated linearly in frequency and heading, as in HydroDyn.
"""

import warnings
from math import pi

import numpy as np

from fowt_env.errors import InputError, PlantWarning, level_outside
from fowt_env.plant.compile.vector_sums import SUM_LANES
from fowt_env.plant.hydro.excitation import (
    ALONG_X,
    ALONG_Y,
    COLUMNS,
    ELEVATION,
    N_WAVE,
    RATE,
    TURN,
    ExactExcitation,
    Excitation,
    ExcitationSeries,
    FastExcitation,
)
from fowt_env.plant.hydro.wave_bands import aligned, padded
from fowt_env.weather.harmonics import constant_table, table_of
from fowt_env.weather.second_order import build_second_order

QUIET, MOST = 1e-3, 0.5  # fraction of a sea's energy outside the table that is ignored, and that is rejected
SAME_HEADING = 1e-4  # rad, tolerance for equal headings: the precision of the files
OUT_OF_PLANE = (1, 3, 5)  # sway, roll, yaw


def build_excitation(body, waves, *, duration, fast, planar, position=None, second_order=None, cutoff=None):
    """Return the excitation of a PotentialFlow in Waves; None without either.

    duration      s that the table of a non-periodic sea has to cover
    fast          first order from a table; else by the sum over components
    planar        whether sway, roll and yaw are zeroed
    position      FilteredPosition at which the waves meet the body; None: undisplaced
    second_order  None, "none" or one of second_order.METHODS; cutoff: rad/s, of the differences, or None

    Raises: InputError for a sea outside the body's headings or frequencies. Warns: PlantWarning if some of
    the energy lies outside the frequencies.
    """
    if body is None or waves is None:
        return None
    check_frequencies(body, waves)
    force = excitation_at(body, waves.omega, np.arctan2(waves.sin_heading, waves.cos_heading))
    force *= waves.amplitude[:, None]
    if planar:
        force[:, OUT_OF_PLANE] = 0.0
    first = ExactExcitation(
        waves.omega,
        waves.phase,
        waves.wave_number * waves.cos_heading,
        waves.wave_number * waves.sin_heading,
        np.ascontiguousarray(np.concatenate([force.real, force.imag], axis=1)),
        float(waves.ramp),
    )
    if fast and position is None:
        first = ExcitationSeries(_first_order_table(waves, force, duration), first)
    elif fast:
        first = _fast_sum(first, waves.amplitude)
    second = build_second_order(body, waves, second_order, duration=duration, cutoff=cutoff)
    if second is not None and planar:
        second.table.value[:, OUT_OF_PLANE] = 0.0
        second.mean[list(OUT_OF_PLANE)] = 0.0
    return Excitation(first, second, position)


def _first_order_table(waves, force, duration):
    """Return the TimeTable of the force (n, 6) and the elevation."""
    coefficient = np.zeros((waves.omega.size, COLUMNS - 1), dtype=complex)
    coefficient[:, :6], coefficient[:, ELEVATION] = force, waves.amplitude
    coefficient *= np.exp(-1j * waves.phase)[:, None]
    return table_of(waves.omega, coefficient, duration)


def _fast_sum(exact, amplitude):
    """Return the FastExcitation of an ExactExcitation, whose phase has the opposite sign, in SIMD lanes."""
    size = -(-amplitude.size // SUM_LANES) * SUM_LANES
    wave = np.zeros((N_WAVE, size))
    for row, values in ((RATE, exact.omega), (TURN, exact.phase % (2.0 * pi)), (ALONG_X, exact.along_x),
                        (ALONG_Y, exact.along_y)):  # fmt: skip
        wave[row, : amplitude.size] = values / (2.0 * pi)
    force = np.zeros((12, size))
    force[:, : amplitude.size] = exact.force.T
    return FastExcitation(aligned(wave), aligned(force), aligned(padded(amplitude, size)), exact.ramp)


def still_excitation(part):
    """Return an Excitation of the same types with zero force; None for None."""
    if part is None:
        return None
    one, none = np.ones(1), np.zeros(1)
    first = ExactExcitation(one, none, none, none, np.zeros((1, 12)), 0.0)
    flat = constant_table(np.zeros(COLUMNS))
    if isinstance(part.first, ExcitationSeries):
        first = ExcitationSeries(flat, first)
    elif isinstance(part.first, FastExcitation):
        first = _fast_sum(first, none)
    second = None if part.second is None else part.second._replace(table=flat, mean=np.zeros(6), ramp=0.0)
    return Excitation(first, second, part.position)


def excitation_at(body, omega, heading):
    """Return the complex force (n, 6) per metre of amplitude, N/m and N m/m, of waves of omega (n,) rad/s.

    heading: rad, a number or (n,). Below the table's frequencies the force tends to the hydrostatic limit of
    long waves, above them the force is zero. Raises: InputError for a heading outside the table.
    """
    omega = np.asarray(omega, dtype=float)
    nodes = np.concatenate([[0.0], body.excitation_omega])
    limit = np.zeros((1, body.heading.size, 6), dtype=complex)
    limit[0, :, 2:5] = body.stiffness[2:5, 2]
    table = np.concatenate([limit, body.excitation])
    left, right, fraction = _headings(body, np.broadcast_to(np.asarray(heading, dtype=float), omega.shape))
    row = np.clip(np.searchsorted(nodes, omega, side="right") - 1, 0, nodes.size - 2)
    above = (omega - nodes[row]) / (nodes[row + 1] - nodes[row])
    # rounding of a frequency at the table's end must not zero the force
    beyond = above > 1.0 + 1e-6 * nodes[row + 1] / (nodes[row + 1] - nodes[row])
    above = np.minimum(above, 1.0)
    fraction, above = fraction[:, None], above[:, None]
    lower = (1.0 - fraction) * table[row, left] + fraction * table[row, right]
    upper = (1.0 - fraction) * table[row + 1, left] + fraction * table[row + 1, right]
    return np.where(beyond[:, None], 0.0, (1.0 - above) * lower + above * upper)


def _headings(body, heading):
    """Return (left, right, fraction): the columns that enclose headings (n,), and the weight of the right."""
    table = body.heading
    turned = table[0] + np.mod(heading - table[0] + SAME_HEADING, 2.0 * pi) - SAME_HEADING
    gap = float(np.diff(table).max()) if table.size > 1 else 0.0
    closing = table[0] + 2.0 * pi - table[-1]
    around = table.size > 1 and closing <= gap * (1.0 + 1e-6) + SAME_HEADING
    beyond = turned > table[-1] + SAME_HEADING
    if beyond.any() and not around:
        low, high = np.degrees(table[[0, -1]])
        raise InputError(
            f"sea: heading {np.degrees(heading[np.argmax(beyond)]):g} deg lies outside the excitation table"
            f" of {_name(body)}, which has {low:g} to {high:g} deg"
        )
    if table.size == 1:
        none = np.zeros(heading.shape, dtype=int)
        return none, none, np.zeros(heading.shape)
    left = np.clip(np.searchsorted(table, turned, side="right") - 1, 0, table.size - 1)
    right = np.where(left == table.size - 1, 0, left + 1)
    width = np.where(left == table.size - 1, closing, np.take(table, right) - table[left])
    fraction = np.where(width > SAME_HEADING, (turned - table[left]) / np.maximum(width, SAME_HEADING), 0.0)
    return left, right, np.clip(fraction, 0.0, 1.0)


def check_frequencies(body, waves):
    """Check the energy outside the table's frequencies. Raises: InputError above MOST; warns above QUIET."""
    energy = waves.amplitude**2
    total = float(energy.sum())
    if total == 0.0:
        return
    low, high = body.excitation_omega[[0, -1]]
    below = float(energy[waves.omega < low * (1.0 - 1e-6)].sum()) / total
    above = float(energy[waves.omega > high * (1.0 + 1e-6)].sum()) / total
    if below + above <= QUIET:
        return
    message = (
        f"sea: {100.0 * (below + above):.3g} % of its energy lies outside the excitation table of"
        f" {_name(body)}, which has {low:.4g} to {high:.4g} rad/s"
    )
    if below + above > MOST:
        raise InputError(message)
    warnings.warn(
        f"{message}: interpolated to the long-wave limit below ({100.0 * below:.3g} %), without force above"
        f" ({100.0 * above:.3g} %)",
        PlantWarning,
        stacklevel=level_outside(),
    )


def _name(body):
    return body.source or "the potential-flow body"
