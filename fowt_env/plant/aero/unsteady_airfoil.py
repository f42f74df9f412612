"""Computes unsteady lift and drag of blade stations: the Beddoes-Leishman model with four states.

Model of Hansen, Gaunaa and Madsen (HGM, Risoe-R-1354), as UA_Mod 4 of AeroDyn: two lags of the angle of
attack behind the shed vorticity, a lag of the pressure and a lag of the separation point. Terms of the
rotation of the section about the blade axis are left out (theory.md, 5.1). Steady loads are those of the
polar.

The lags are shorter than a time step at outer stations, so each state is held at half a step before the
time of the rotor load: the load takes it half a step on, a step takes it a whole step on, each exactly for
an inflow that stays. This has second order in the step and no limit of stability.
"""

from math import atan2, cos, exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.blade_elements import BladeElements, element_of, lift_drag, segment_of
from fowt_env.plant.aero.blade_shape import effective_pitch
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class

PER_STATION = (
    4  # states: two lags of the angle of attack (rad), lagged angle of the pressure (rad), separation
)
SLOWEST, FASTEST = 0.001, 50.0  # s, limits of the time in which the flow passes half a chord
LEAST_SPEED, LOW_SPEED = 0.01, 1.0  # m/s, flow between which the unsteady part fades in
FADE = np.radians(5.0)  # below the cut-out angle, in which the unsteady part fades out
STEADY = 1e9  # s, step of the states with which all lags are at rest: quasi-steady airfoils
SMALL = np.radians(20.0)  # angle of attack within which the slope of the lift is sought
SMOOTH = np.radians(2.0)  # half width of the window that smooths slopes
LINEAR = 0.9  # fraction of the largest slope down to which lift is linear
MARGIN = 0.2  # at either end of the linear range, left out of the fit of the slope
NO_LIFT = 0.01  # largest lift of a cylinder


class AirfoilDynamics(NamedTuple):
    """Holds the constants of an airfoil's unsteady model (SI, rad)."""

    lift_slope: float  # 1/rad; 0: quasi-steady
    zero_lift: float
    A1: float = 0.3
    A2: float = 0.7
    b1: float = 0.14
    b2: float = 0.53
    T_p: float = 1.7  # of the pressure, in times that the flow takes for half a chord
    T_f0: float = 3.0  # of the separation point, the same
    drag: float = 0.0  # without lift
    cut_out: float = pi / 4.0


class UnsteadyAirfoils(NamedTuple):
    """Holds the unsteady airfoils of n stations; m foils, k polar segments."""

    first: int  # index of the first state
    dt: float  # s, time step of the states
    constants: np.ndarray  # (m, fields of AirfoilDynamics)
    # (k, 4) separation function at the start of each segment, lift of attached less that of separated flow,
    # and the slopes of both, 1/rad
    separation: np.ndarray


class AirfoilBlade(NamedTuple):
    """Holds what the unsteady airfoils of one blade need."""

    part: UnsteadyAirfoils
    number: int  # of the blade
    pitch: float  # rad
    shape: object  # blade_shape.BladeShape, BentShape or None
    elements: BladeElements
    x: np.ndarray  # state
    dx: np.ndarray  # rates of the state; only those of these states are written


# ------------------------------------------------------------------------------------- kernels


@kernel
def cosine_blend(x, low, high):
    """Return a blend from 0 at low to 1 at high, half a cosine in between."""
    if x <= low:
        return 0.0
    if x >= high:
        return 1.0
    return 0.5 * (1.0 - cos(pi * (x - low) / (high - low)))


@kernel
def separation_at(alpha, foil, part, polars):
    """Return (separation function, lift of attached less separated flow) at alpha (rad)."""
    i, x = segment_of(alpha, foil, polars)
    row = part.separation[i]
    return row[0] + x * row[2], row[1] + x * row[3]


@kernel
def unsteady_coefficients(alpha, speed, chord, foil, first, part, polars, x, dx):
    """Return (cl, cd) at an angle of attack (rad) and local speed (m/s); put rates of the states into dx.

    first: index of the first of the station's states.
    """
    lift, drag, _, _ = lift_drag(alpha, foil, polars)
    c = part.constants[foil]
    slope, A1, A2, b1, b2 = c[0], c[2], c[3], c[4], c[5]
    T_p, T_f0, least_drag, cut_out = c[6], c[7], c[8], c[9]
    if slope == 0.0:
        return lift, drag
    pace = 1.0 / min(max(0.5 * chord / max(speed, LEAST_SPEED), SLOWEST), FASTEST)
    weight = 1.0 - cosine_blend(abs(alpha), cut_out - FADE, cut_out)
    weight *= cosine_blend(speed, LEAST_SPEED, LOW_SPEED)
    steady, _ = separation_at(alpha, foil, part, polars)
    half = -0.5 * part.dt * pace
    f1, f2, f3, f4 = exp(half * b1), exp(half * b2), exp(half / T_p), exp(half / T_f0)
    z1, z2, z3, z4 = x[first], x[first + 1], x[first + 2], x[first + 3]
    effective = (1.0 - A1 - A2) * alpha
    effective += A1 * alpha + (z1 - A1 * alpha) * f1 + A2 * alpha + (z2 - A2 * alpha) * f2
    lagged = effective + (z3 - effective) * f3
    goal, _ = separation_at(lagged, foil, part, polars)
    separation = min(max(goal + (z4 - goal) * f4, 0.0), 1.0)

    share, rest = weight / part.dt, (1.0 - weight) / part.dt
    dx[first] = share * (A1 * alpha - z1) * (1.0 - f1 * f1) + rest * (A1 * alpha - z1)
    dx[first + 1] = share * (A2 * alpha - z2) * (1.0 - f2 * f2) + rest * (A2 * alpha - z2)
    dx[first + 2] = share * (effective - z3) * (1.0 - f3 * f3) + rest * (alpha - z3)
    dx[first + 3] = share * (goal - z4) * (1.0 - f4 * f4) + rest * (steady - z4)
    if weight == 0.0:
        return lift, drag
    cl, cd, _, _ = lift_drag(effective, foil, polars)
    static, between = separation_at(effective, foil, part, polars)
    cl += (separation - static) * between
    roots = sqrt(max(static, 0.0)) - sqrt(separation)
    cd += (alpha - effective) * cl + (cd - least_drag) * (0.5 * roots - 0.25 * (static - separation))
    return weight * cl + (1.0 - weight) * lift, weight * cd + (1.0 - weight) * drag


@kernel
def _line_load(v_normal, v_tangential, j, airfoils):
    """Return the line load (fn, ft) of station j over the air density in a local flow."""
    elements, part = airfoils.elements, airfoils.part
    square = v_normal * v_normal + v_tangential * v_tangential
    if square == 0.0:
        return 0.0, 0.0
    element = element_of(j, effective_pitch(j, airfoils.pitch, airfoils.shape), elements)
    speed = sqrt(square)
    s, c = v_normal / speed, v_tangential / speed
    alpha = atan2(s, c) - element.theta
    if alpha > pi:
        alpha -= 2.0 * pi
    elif alpha < -pi:
        alpha += 2.0 * pi
    first = part.first + PER_STATION * (elements.radius.shape[0] * airfoils.number + j)
    cl, cd = unsteady_coefficients(
        alpha, speed, elements.chord[j], element.foil, first, part, elements.polars, airfoils.x, airfoils.dx
    )
    size = 0.5 * elements.chord[j] * square
    return size * (cl * c + cd * s), size * (cl * s - cd * c)


@inlined_kernel
def unsteady_load(fn, ft, factor, v_normal, v_tangential, j, airfoils):
    """Return factor times the line load over the air density of station j; (fn, ft) without AirfoilBlade."""
    if airfoils is None:
        return fn, ft
    normal, tangential = _line_load(v_normal, v_tangential, j, airfoils)
    return factor * normal, factor * tangential


@inlined_kernel
def _steady(number, pitch, shape, elements, airfoils, x, dx):
    return None


@inlined_kernel
def _unsteady(number, pitch, shape, elements, airfoils, x, dx):
    return AirfoilBlade(airfoils, number, pitch, shape, elements, x, dx)


# (number, pitch, shape, elements, airfoils, x, dx) -> AirfoilBlade of a blade, None: quasi-steady
airfoil_blade = chosen_by_class("airfoils", {type(None): _steady, UnsteadyAirfoils: _unsteady})


@kernel
def step_airfoils(x, dt, airfoils, elements, rates, y):
    """Put the states of the airfoils after a step of dt from x into y, by their rates at its beginning."""
    if airfoils is None:
        return
    count = PER_STATION * elements.blades * elements.radius.shape[0]
    for i in range(airfoils.first, airfoils.first + count):
        y[i] = x[i] + dt * rates[i]


# ------------------------------------------------------------------------------------- building


def n_airfoil_states(elements):
    """Return the number of states of the unsteady airfoils of BladeElements."""
    if elements.airfoils is None:
        return 0
    return PER_STATION * elements.blades * len(elements.radius)


def _smoothed(x, values, width):
    """Return values (n,) at x averaged with a triweight window of a half width."""
    u = np.clip((x - x[:, None]) / width, -1.0, 1.0)
    window = (1.0 - u**2) ** 3
    return window @ values / window.sum(axis=1)


def linear_range(polar):
    """Return (lowest, highest) angle of attack (rad) of the linear normal force of a polar, as AeroDyn does.

    polar (m, 3): alpha (rad), cl, cd. None for a cylinder.
    """
    alpha, lift, drag = polar[:, 0], polar[:, 1], polar[:, 2]
    near = np.abs(alpha) <= SMALL
    if np.ptp(drag[near]) == 0.0 or lift[near].max() < NO_LIFT:
        return None
    least = np.flatnonzero(near)[np.argmin(drag[near])]
    normal = lift * np.cos(alpha) + (drag - drag[least]) * np.sin(alpha)
    middle = 0.5 * (alpha[1:] + alpha[:-1])
    slope = _smoothed(middle, np.diff(normal) / np.diff(alpha), SMOOTH)
    ends = []
    for step, last in (
        (1, np.flatnonzero(middle < SMALL)[-1] + 1),
        (-1, np.flatnonzero(middle > -SMALL)[0] - 1),
    ):
        last = min(max(last, 0), len(middle) - 1)
        largest, found = np.interp(alpha[least], middle, slope), least
        for i in range(min(least, len(middle) - 1), last + step, step):
            found = i
            if slope[i] > largest:
                largest = slope[i]
            elif slope[i] < LINEAR * largest:
                break
        ends.append(alpha[least] if found == least else middle[found - step])
    return ends[1], ends[0]


def airfoil_dynamics(polar, known=None):
    """Return the AirfoilDynamics of a polar (m, 3) in rad, with AeroDyn's defaults of what is not known.

    known: {field: value}. A cylinder has none: its lift slope is 0.
    """
    known = dict(known or {})
    ends = linear_range(polar)
    if ends is None:
        return AirfoilDynamics(**{"lift_slope": 0.0, "zero_lift": 0.0} | known)
    alpha, lift, drag = polar[:, 0], polar[:, 1], polar[:, 2]
    least = drag[np.abs(alpha) <= SMALL].min()
    margin = MARGIN * (ends[1] - ends[0])
    rows = (alpha >= ends[0] + margin) & (alpha <= ends[1] - margin)
    if rows.sum() < 2:
        rows = np.isin(np.arange(len(alpha)), np.argsort(np.abs(alpha - 0.5 * sum(ends)))[:2])
    columns = np.column_stack([alpha[rows], np.ones(rows.sum())])
    normal = lift[rows] * np.cos(alpha[rows]) + (drag[rows] - least) * np.sin(alpha[rows])
    (normal_slope, offset), (slope, _) = np.linalg.lstsq(
        columns, np.column_stack([normal, lift[rows]]), rcond=None
    )[0].T
    found = {"lift_slope": slope, "zero_lift": -offset / normal_slope, "drag": least}
    return AirfoilDynamics(**{key: float(value) for key, value in (found | known).items()})


def separation_function(polar, dynamics):
    """Return (separation function, lift of attached less separated flow), each (m,), as AeroDyn does."""
    alpha, lift = polar[:, 0], polar[:, 1]
    attached = dynamics.lift_slope * (alpha - dynamics.zero_lift)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(attached == 0.0, 1.0, np.maximum(lift / attached, 0.0))
        point = np.clip((2.0 * np.sqrt(ratio) - 1.0) ** 2, 0.0, 1.0)
        separated = np.where(point < 1.0, (lift - attached * point) / (1.0 - point), 0.5 * lift)
    low, high = linear_range(polar)
    below, above = alpha < low, alpha > high
    first = np.flatnonzero(below & (point == point[below].min()))[-1]
    last = np.flatnonzero(above & (point == point[above].min()))[0]
    for rows in (slice(None, first + 1), slice(last, None)):
        separated[rows] = lift[rows]
    between = attached - separated
    with np.errstate(divide="ignore", invalid="ignore"):
        point = np.where(between == 0.0, 1.0, np.clip((lift - separated) / between, 0.0, 1.0))
    return point, between


def _polar_of(foil, polars):
    """Return the polar (m, 3) of a foil: alpha (rad), cl, cd."""
    start = polars.cell[foil, 0]
    rows = polars.segment[start : start + np.flatnonzero(np.isinf(polars.segment[start:, 0]))[0]]
    last = rows[-1]
    return np.vstack([rows[:, :3], [pi, *(last[1:3] + (pi - last[0]) * last[3:])]])


def build_unsteady_airfoils(elements, first, dt):
    """Return the UnsteadyAirfoils of BladeElements with states from first on and the time step dt (s)."""
    polars = elements.polars
    constants, separation = [], np.zeros((len(polars.segment), 4))
    for foil in range(len(polars.cell)):
        polar, start = _polar_of(foil, polars), polars.cell[foil, 0]
        constants.append(airfoil_dynamics(polar))
        if constants[-1].lift_slope == 0.0:
            continue
        values = np.column_stack(separation_function(polar, constants[-1]))
        rows = slice(start, start + len(polar) - 1)
        separation[rows, :2] = values[:-1]
        separation[rows, 2:] = np.diff(values, axis=0) / np.diff(polar[:, 0])[:, None]
    return UnsteadyAirfoils(int(first), float(dt), np.array(constants, dtype=np.float64), separation)
