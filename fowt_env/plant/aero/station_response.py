"""Computes the load of one blade station in a relative wind, for each rotor model that sweeps over stations.

A response is a NamedTuple with the data of a model for one blade. `station_load` selects the kernel by the
class of the response:

* Solved: blade element momentum, with the optional models of the wake (bem_rotor.py);
* Tabled: the table of quasi-steady loads (section_table.py);
* TabledOrSolved: as Tabled, with blade element momentum for inflows outside the table;
* Induced: the tables of induced velocity and of load (section_inflow.py), for a skewed wake;
* Lagging: as Induced, with the states of dynamic inflow.
"""

from math import pi
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.bent_blade import CHANGE, BentShape, placed
from fowt_env.plant.aero.blade_elements import (
    LARGEST_SPEED,
    BladeElements,
    airload,
    blade_section,
    element_of,
    first_guess,
    pitching_moment,
    solve_section,
)
from fowt_env.plant.aero.blade_shape import (
    BladeMotion,
    BladeShape,
    StationLoad,
    Turn,
    effective_pitch,
)
from fowt_env.plant.aero.unsteady_airfoil import unsteady_load
from fowt_env.plant.aero.wake import (
    PER_ELEMENT,
    Skew,
    filtered_induction,
    pace,
    skew_factor,
    skewed_induction,
)
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.events import Counter

# Directions: v_normal/(v_normal + |v_tangential|) in AHEAD cells, from the rotor plane to the shaft (where
# this has a kink), then in BEHIND cells to an in-plane inflow from behind (blade roots in cross wind).
# Halving the cells of both variables divides the error by three, at four times the memory.
AHEAD, BEHIND = 512, 64
# further load cells before the first: in a lull the lagging induced velocity may reverse the flow
REVERSED = 64


DENSE_START, DENSE_END, DENSE_ROWS = -5.0, 30.0, 140  # deg, blade pitches in operation
COARSE_END, COARSE_ROWS = 90.0, 60  # deg, up to feather


class Solved(NamedTuple):
    """Computes the response of a blade by blade element momentum."""

    number: int  # of the blade
    turn: Turn
    motion: BladeMotion
    shape: object  # BladeShape, BentShape or None
    induction: float  # 1: momentum balance, 0: none (parked rotor), between: faded
    wind_speed: float  # m/s, relative to the hub
    skewed: Skew
    skew: object  # wake.SkewedWake or None
    wake: object  # wake.DynamicInflow or None
    airfoils: object  # unsteady_airfoil.AirfoilBlade or None
    x: np.ndarray  # state
    dx: np.ndarray  # rates of the state; only those of wake states are written
    counters: np.ndarray
    elements: BladeElements


class Rows(NamedTuple):
    """Holds two neighbouring rows of a table over blade pitch and the position in between."""

    low: np.ndarray  # (n, directions, components) float32
    high: np.ndarray
    fraction: float


class PitchedRows(NamedTuple):
    """Holds a table over blade pitch of a blade that bends: bending changes the pitch of each section."""

    table: np.ndarray  # (blade pitches, n, directions, components) float32
    turn: Turn


class Tabled(NamedTuple):
    """Computes the response of a blade from the table of quasi-steady loads over the air density."""

    rows: object  # Rows, or PitchedRows of a blade that bends
    arm: np.ndarray  # (n,) m, see section_table.SectionTable
    shape: object  # BladeShape, BentShape or None


class TabledOrSolved(NamedTuple):
    """Computes the response as Tabled, by blade element momentum for inflows outside the table."""

    tabled: Tabled
    turn: Turn
    elements: BladeElements
    counters: np.ndarray


class WakeRate(NamedTuple):
    """Holds the rates of the filters of dynamic inflow, 1/s."""

    slow: float  # 1/tau_1 without induction
    most: float  # upper limit for both filters


class WakeRates(NamedTuple):
    """Holds the rates of the four wake states of a station, m/s2."""

    first: int  # index of the first of the states
    normal_0: float
    normal_1: float
    tangential_0: float
    tangential_1: float


class Induced(NamedTuple):
    """Computes the response of a blade from the tables of induced velocity and load over the air density."""

    induced: object  # Rows or PitchedRows of the quasi-steady induced velocity
    load: object  # of the load
    arm: np.ndarray  # (n,) m
    shape: object  # BladeShape, BentShape or None
    skew: object  # wake.BladeSkew or None
    airfoils: object  # unsteady_airfoil.AirfoilBlade or None
    weight: np.ndarray  # (n,) m, of the stations


class Lagging(NamedTuple):
    """Computes the response of a blade from the tables of dynamic inflow, loads over the air density."""

    first: int  # index in the state of the blade's first wake state
    induced: object  # Rows or PitchedRows of the quasi-steady induced velocity
    load: object  # of the load
    rate: WakeRate
    ratio: np.ndarray  # (n,) tau_1 over tau_2
    arm: np.ndarray  # (n,) m
    shape: object  # BladeShape, BentShape or None
    skew: object  # wake.BladeSkew or None
    airfoils: object  # unsteady_airfoil.AirfoilBlade or None
    weight: np.ndarray  # (n,) m, of the stations
    x: np.ndarray  # state
    dx: np.ndarray  # rates of the state; only those of wake states are written


class Cell(NamedTuple):
    """Holds the table cell of an inflow direction and the fractional position in the cell."""

    k: int
    part: float


# ------------------------------------------------------------------------- blade element momentum


@inlined_kernel
def _solved_load(response, v_normal, v_tangential, j):
    """Return the StationLoad of station j, N/m."""
    elements = response.elements
    turned = effective_pitch(j, response.turn.pitch, response.shape)
    element = element_of(j, turned, elements)
    guess = first_guess(v_normal, v_tangential, turned, j, elements)
    section = solve_section(v_normal, v_tangential, response.induction, guess, element, elements.polars)
    if not section.solved:
        response.counters[Counter.BEM_FALLBACK] += 1.0
    normal, tangential = _induced(section, v_normal, j, response, response.skew, response.wake)
    v_normal, v_tangential = v_normal + normal, v_tangential + tangential
    fn, ft = _induced_load(section, v_normal, v_tangential, element, elements, response.skew, response.wake)
    fn, ft = unsteady_load(fn, ft, elements.air_density, v_normal, v_tangential, j, response.airfoils)
    moment = pitching_moment(v_normal, v_tangential, j, element, elements.shape, elements.polars)
    return StationLoad(fn, ft, moment, elements.weight[j], elements.moment_weight[j], 0, None)


@inlined_kernel
def _induced(section, v_normal, j, response, skew, wake):
    """Return the (normal, tangential) induced velocity of a station with the optional wake models, m/s."""
    elements, motion = response.elements, response.motion
    normal, tangential = filtered_induction(
        section, v_normal, response.number, j, response.wind_speed, wake, response.x, response.dx,
        elements.radius, elements.tip_radius,
    )  # fmt: skip
    span = elements.radius[j] / elements.tip_radius
    normal *= skew_factor(normal, v_normal, motion.ey, motion.ez, span, response.skewed, skew)
    return normal, tangential


@kernel
def _induced_load(section, v_normal, v_tangential, element, elements, skew, wake):
    """Return the line loads (fn, ft), N/m, in this local flow; without wake models those of the section."""
    if wake is None and skew is None:
        return section.fn, section.ft
    cn, ct, square = airload(v_normal, v_tangential, element, elements.polars)
    return element.half_density_chord * square * cn, element.half_density_chord * square * ct


# -------------------------------------------------------------------------------------- tables


@inlined_kernel
def cell_of(v_normal, v_tangential, total, first):
    """Return the Cell of a direction in a table; first: index of the direction in the rotor plane.

    total: |v_normal| + |v_tangential|. All inputs are safe, also NaN.
    """
    return cell_at(direction_of(v_normal, v_tangential, total, first), first)


@inlined_kernel
def direction_of(v_normal, v_tangential, total, first):
    """Return the position in a table of a direction, in cells; arguments as in cell_of."""
    ahead = AHEAD * v_normal
    position = (ahead if v_tangential >= 0.0 else AHEAD * total - BEHIND * v_tangential) / total + first
    return position if position > 0.0 else 0.0  # also for NaN


@inlined_kernel
def cell_at(position, first):
    """Return the Cell of a position of direction_of."""
    k = min(int(position), first + AHEAD + BEHIND - 1)
    return Cell(np.uintp(k), position - k)  # unsigned indices avoid the test for negative indices


@kernel
def pitch_row(blade_pitch):
    """Return the fractional row index of a blade pitch (rad) in the table; -1 outside."""
    degrees = blade_pitch * (180.0 / pi)
    if DENSE_START <= degrees < DENSE_END:
        return (degrees - DENSE_START) * (DENSE_ROWS / (DENSE_END - DENSE_START))
    if DENSE_END <= degrees < COARSE_END:
        return DENSE_ROWS + (degrees - DENSE_END) * (COARSE_ROWS / (COARSE_END - DENSE_END))
    return -1.0


@inlined_kernel
def _straight_rows(turn, table, shape):
    row = pitch_row(turn.pitch)
    i = int(row)
    return Rows(table[i], table[i + 1], row - i)


@inlined_kernel
def _bent_rows(turn, table, shape):
    return PitchedRows(table, turn)


@inlined_kernel
def _same_rows(j, rows, shape):
    return rows


@inlined_kernel
def _rows_at_station(j, rows, shape):
    """Return the Rows at the pitch that gives a section without bending the effective pitch of station j."""
    turn, table, change = rows.turn, rows.table, placed(j, CHANGE, shape)
    return rows_between(row_within(turn.pitch + change), table)


@inlined_kernel
def row_within(pitch):
    """Return the fractional row index of a pitch (rad) in the table, of its nearest end outside."""
    low, high = DENSE_START * pi / 180.0, COARSE_END * pi / 180.0 - 1e-9
    return pitch_row(min(max(pitch, low), high))


@inlined_kernel
def rows_between(row, table):
    """Return the Rows at a fractional row index."""
    i = int(row) if row > 0.0 else 0
    return Rows(table[np.uintp(i)], table[np.uintp(i + 1)], row - i)


# (turn, table, shape) -> Rows of a table that enclose a blade pitch within it, or PitchedRows
rows_of = chosen_by_class(
    "shape", {type(None): _straight_rows, BladeShape: _straight_rows, BentShape: _bent_rows}
)
# (j, rows, shape) -> Rows of station j
_station_rows = chosen_by_class(
    "shape", {type(None): _same_rows, BladeShape: _same_rows, BentShape: _rows_at_station}
)


@inlined_kernel
def looked_up(cell, j, component, rows):
    """Return a table component of station j in a Cell, bilinear in rows and directions."""
    k, low, high, fraction = cell.k, rows.low, rows.high, rows.fraction
    after = k + np.uintp(1)
    here = (1.0 - fraction) * float(low[j, k, component]) + fraction * float(high[j, k, component])
    there = (1.0 - fraction) * float(low[j, after, component]) + fraction * float(high[j, after, component])
    return here + cell.part * (there - here)


@inlined_kernel
def _tabled_moment(cell, j, rows, shape):
    """Return the pitching moment from a table; zero for straight blades, whose tables have no moment."""
    if shape is None:
        return 0.0
    return looked_up(cell, j, 2, rows)


@inlined_kernel
def _tabled_load(response, v_normal, v_tangential, j):
    """Return the StationLoad of station j over the air density."""
    total = abs(v_normal) + abs(v_tangential)
    cell, square = cell_of(v_normal, v_tangential, total, 0), total * total
    outside = 0 if v_normal > 0.0 and total < LARGEST_SPEED else 1
    rows = _station_rows(j, response.rows, response.shape)
    return StationLoad(
        square * looked_up(cell, j, 0, rows),
        square * looked_up(cell, j, 1, rows),
        square * _tabled_moment(cell, j, rows, response.shape),
        1.0,
        response.arm[j],
        outside,
        None,
    )


@inlined_kernel
def _tabled_or_solved_load(response, v_normal, v_tangential, j):
    """Return the StationLoad of station j over the air density."""
    tabled = _tabled_load(response.tabled, v_normal, v_tangential, j)
    if tabled.outside == 0:
        return tabled
    return _exact_load(response, v_normal, v_tangential, j)


@kernel
def _exact_load(response, v_normal, v_tangential, j):
    """Return the StationLoad of station j over the air density, by blade element momentum."""
    elements, arm = response.elements, response.tabled.arm
    turned = effective_pitch(j, response.turn.pitch, response.tabled.shape)
    section = blade_section(v_normal, v_tangential, turned, j, 1.0, elements)
    if not section.solved:
        response.counters[Counter.BEM_FALLBACK] += 1.0
    moment = pitching_moment(
        v_normal + section.induced_normal, v_tangential + section.induced_tangential, j,
        element_of(j, turned, elements), elements.shape, elements.polars,
    )  # fmt: skip
    # zero density gives zero load here too: the sums are multiplied by the density afterwards
    weight = elements.weight[j] / elements.air_density if elements.air_density > 0.0 else 0.0
    return StationLoad(weight * section.fn, weight * section.ft, weight * moment, 1.0, arm[j], 0, None)


@inlined_kernel
def _steady_induction(response, v_normal, v_tangential, j):
    """Return the quasi-steady induced velocity (normal, tangential) of station j, m/s."""
    total = abs(v_normal) + abs(v_tangential)
    cell = cell_of(v_normal, v_tangential, total, 0)
    rows = _station_rows(j, response.induced, response.shape)
    return total * looked_up(cell, j, 0, rows), total * looked_up(cell, j, 1, rows)


@inlined_kernel
def _local_load(response, v_normal, v_tangential, normal, tangential, rates, j):
    """Return the StationLoad of station j over the air density with this induced velocity and WakeRates."""
    total = abs(v_normal) + abs(v_tangential)
    through = v_normal + skewed_induction(normal, v_normal, j, response.skew)
    along = v_tangential + tangential
    known = through > 0.0 or REVERSED * v_tangential >= -AHEAD * through
    outside = 0 if v_normal > 0.0 and total < LARGEST_SPEED and known else 1
    local = abs(through) + abs(along)
    cell, square = cell_of(through, along, local, REVERSED), local * local
    rows = _station_rows(j, response.load, response.shape)
    fn, ft = square * looked_up(cell, j, 0, rows), square * looked_up(cell, j, 1, rows)
    fn, ft = unsteady_load(fn, ft, response.weight[j], through, along, j, response.airfoils)
    moment = square * _tabled_moment(cell, j, rows, response.shape)
    return StationLoad(fn, ft, moment, 1.0, response.arm[j], outside, rates)


@inlined_kernel
def _induced_table_load(response, v_normal, v_tangential, j):
    """Return the StationLoad of station j over the air density."""
    normal, tangential = _steady_induction(response, v_normal, v_tangential, j)
    return _local_load(response, v_normal, v_tangential, normal, tangential, None, j)


@inlined_kernel
def _lagging_load(response, v_normal, v_tangential, j):
    """Return the StationLoad of station j over the air density, with WakeRates.

    The filter is that of wake.filtered_induction.
    """
    x, rate = response.x, response.rate
    steady_normal, steady_tangential = _steady_induction(response, v_normal, v_tangential, j)
    slow = pace(-steady_normal / v_normal) * rate.slow
    fast = min(slow * response.ratio[j], rate.most)
    slow = min(slow, rate.most)
    i = response.first + PER_ELEMENT * j
    a, b, c, d = np.uintp(i), np.uintp(i + 1), np.uintp(i + 2), np.uintp(i + 3)
    first_normal, normal, first_tangential, tangential = x[a], x[b], x[c], x[d]
    rates = WakeRates(
        i,
        (0.4 * steady_normal - first_normal) * slow,
        (first_normal + 0.6 * steady_normal - normal) * fast,
        (0.4 * steady_tangential - first_tangential) * slow,
        (first_tangential + 0.6 * steady_tangential - tangential) * fast,
    )
    return _local_load(response, v_normal, v_tangential, normal, tangential, rates, j)


@inlined_kernel
def put_rates(rates, response):
    """Put the WakeRates of a station into dx; no-op for None."""
    if rates is None:
        return
    i, dx = rates.first, response.dx
    dx[np.uintp(i)], dx[np.uintp(i + 1)] = rates.normal_0, rates.normal_1
    dx[np.uintp(i + 2)], dx[np.uintp(i + 3)] = rates.tangential_0, rates.tangential_1


# (response, v_normal, v_tangential, j) -> StationLoad of station j in this relative wind, m/s
station_load = chosen_by_class(
    "response",
    {
        Solved: _solved_load,
        Tabled: _tabled_load,
        TabledOrSolved: _tabled_or_solved_load,
        Induced: _induced_table_load,
        Lagging: _lagging_load,
    },
)
