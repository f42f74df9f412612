"""Solves blade element momentum at one station: loads and induced flow from the inflow (theory.md, 5.1).

At very high tip-speed ratios (above about 20: spinning in little or no wind) the published equations have
their root on a pole, where drag without flow through the disk gives infinite swirl, and the load vanishes.
Here the residual is one continuous function of the inflow angle f from -pi/2 to pi/2:

* the swirl is convected by a flow of at least LEAST_FLOW, which is below all operating states;
* f < 0 (propeller brake): the thrust is the larger of Buhl's curve continued beyond a = 1 and the
  momentum value 4 F a (a - 1), so that the root passes through f = 0 without a jump.

Degenerate inflows: zero inflow, zero load; in-plane inflow from behind (v_tangential <= 0), no induction,
which fades in between two small ratios v_tangential/|v_normal|; reversed (v_normal < 0), the mirrored
problem; no root (not observed with finite polars), no induction at that station, which is counted. The
pitching moment (cm) is included for curved blades only (blade_shape.py): on straight blades it is negligible.
"""

from math import acos, atan2, cos, exp, floor, nan, pi, sin, sqrt
from typing import NamedTuple

import numba
import numpy as np

from fowt_env.caches import Cache
from fowt_env.errors import InputError
from fowt_env.plant.aero.blade_shape import (
    blade_line,
    build_blade_shape,
    build_station_modes,
    is_curved,
    line_integrals,
    modal_integrals,
)
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.tilt import rotor_axes

TOLERANCE = 1e-8  # of the residual before the last Newton step; after that step, about its square
LAST_STEP = 1e-6  # largest last step over Momentum.scale: the second-order error of loads is then 1e-12
SMALLEST_ANGLE = 1e-6  # rad; end of a bracket, the residual may be singular at 0
LARGEST_ANGLE = 1.8  # rad; roots above pi/2 (flow turned by the swirl) only where v_normal > 50 v_tangential
LEAST_FLOW = 0.01  # least normal flow, as a fraction of the local speed, that carries the swirl away
MAX_NEWTON = 24  # safeguarded Newton steps; usually 2 or 3 are taken
MAX_BISECTIONS = 180  # a third of them halve the bracket: to pi/2^60, below rounding of the smallest angle
SLOW_SECTION, FAST_SECTION = 0.01, 0.02  # v_tangential/|v_normal| between which induction fades in
LARGEST_SPEED = 1e6  # m/s; above (or NaN) the section returns nan instead of an invalid index
LIFT_SLOPE = 6.0  # 1/rad, for the first guess only
HALF_PI = 0.5 * pi
PRANDTL = 4.0 / pi**2
GUESSES = 129  # points of the table of first guesses in each direction
GUESS_PITCH = (-0.2, 1.7)  # rad, blade pitch spanned by that table
NO_LOSS = 37.0  # exponent above which exp(-x) is below rounding
CELLS = 720  # of the look-up table of polar segments, each half a degree


class Polars(NamedTuple):
    """Holds polars of m foils as segments between published points, and a look-up table of segments."""

    cell: np.ndarray  # (m, CELLS) int64, first segment that reaches into this half degree
    segment: np.ndarray  # (k, 5) start of the segment (rad), cl, cd there, slopes of cl and cd


class BladeElements(NamedTuple):
    """Holds the constant inputs of blade element momentum for a turbine; n stations, m foils."""

    blades: int
    hub_radius: float  # m
    tip_radius: float  # m
    overhang: float  # m, hub upwind of the tower axis, in rotor axes (tilt.py)
    hub_height: float  # m, in rotor axes
    air_density: float  # kg/m3
    radius: np.ndarray  # (n,) m, distance from the shaft
    chord: np.ndarray  # (n,) m
    twist: np.ndarray  # (n,) rad
    solidity: np.ndarray  # (n,) blades * chord / (2 pi radius)
    tip_exponent: np.ndarray  # (n,) Prandtl: blades (tip - radius) / (2 radius), lengths along the blade
    hub_exponent: np.ndarray  # (n,) blades (radius - hub) / (2 hub), the same
    zero_lift: np.ndarray  # (n,) rad, for the first guess only
    weight: np.ndarray  # (n,) m, integral of the station's hat function
    moment_weight: np.ndarray  # (n,) m2, integral of radius times the hat function
    foil: np.ndarray  # (n,) int64, row of polars.cell
    polars: Polars
    shape: object  # blade_shape.BladeShape, or None: straight blades in the rotor plane
    guess: np.ndarray  # (n, GUESSES, GUESSES) float32 rad, initial inflow angles; see first_guess
    modes: object = None  # bent_blade.StationModes, or None: blades that do not bend
    airfoils: object = None  # unsteady_airfoil.UnsteadyAirfoils, or None: quasi-steady
    tower: object = None  # tower_influence.TowerInfluence on the wind of the blades, or None


class Element(NamedTuple):
    """Holds the inputs of the momentum balance of one station at one blade pitch, except the inflow."""

    theta: float  # twist + blade pitch, rad
    solidity: float
    tip_exponent: float
    hub_exponent: float
    zero_lift: float
    half_density_chord: float  # kg/m2
    foil: int


class Section(NamedTuple):
    """Holds the solution of the momentum balance of one blade station."""

    phi: float  # inflow angle of the momentum balance, rad
    a: float  # axial induction of the momentum balance; 0 where v_normal is 0
    ap: float  # tangential induction
    cn: float  # coefficients of the loads below, normal to and in the rotor plane
    ct: float
    fn: float  # N/m, downwind
    ft: float  # N/m, in the direction of rotation
    induced_normal: float  # m/s, added to v_normal by the wake (-a v_normal)
    induced_tangential: float  # m/s, added to v_tangential (a' v_tangential)
    residual: float  # of theory.md, 5.1, before the last Newton step; at phi it is smaller
    solved: bool  # False: no bracket, no induction


class Momentum(NamedTuple):
    """Holds the terms of the momentum balance at one inflow angle f (symbols of theory.md, 5.1)."""

    s: float  # sin f
    c: float  # cos f
    cn: float
    ct: float
    qs: float  # sin f / (1 - a)
    swirl: float  # cos f (1 - k')
    weight: float  # of the residual in value: abs(sin f), or 1 in the empirical state
    scale: float  # range of f over which the terms change
    value: float  # weight times the residual times v_tangential
    slope: float  # derivative of value with f
    dcn: float  # derivatives with f
    dct: float
    dqs: float
    dswirl: float


@kernel
def element_of(j, blade_pitch, rotor):
    """Return the Element of station j."""
    return Element(
        rotor.twist[j] + blade_pitch,
        rotor.solidity[j],
        rotor.tip_exponent[j],
        rotor.hub_exponent[j],
        rotor.zero_lift[j],
        0.5 * rotor.air_density * rotor.chord[j],
        rotor.foil[j],
    )


@inlined_kernel
def segment_of(alpha, foil, polars):
    """Return (row of polars.segment, alpha minus its start) of a foil at alpha (rad, wrapped to +-pi)."""
    if alpha > pi or alpha < -pi:
        alpha -= 2.0 * pi * floor((alpha + pi) / (2.0 * pi))
    cell = int((alpha + pi) * (CELLS / (2.0 * pi)))
    i = polars.cell[foil, max(0, min(cell, CELLS - 1))]
    segment = polars.segment
    while alpha >= segment[i + 1, 0]:  # ends at the latest at the last row of a polar, infinity
        i += 1
    return i, alpha - segment[i, 0]


@kernel
def lift_drag(alpha, foil, polars):
    """Return (cl, cd, dcl/dalpha, dcd/dalpha) of a foil at alpha (rad, wrapped to +-pi).

    Linear between the published points, which are not evenly spaced: a look-up table gives the first
    segment of each half degree, at most a few before the right one.
    """
    i, x = segment_of(alpha, foil, polars)
    segment = polars.segment
    return (
        segment[i, 1] + x * segment[i, 3],
        segment[i, 2] + x * segment[i, 4],
        segment[i, 3],
        segment[i, 4],
    )


@kernel
def _loss(exponent, h, dh):
    """Return acos(exp(-exponent/h)), pi/2 times Prandtl's factor, and its derivative with the inflow angle.

    h, dh: absolute value of the sine of the inflow angle, and its derivative.
    """
    if exponent > NO_LOSS * h:
        return HALF_PI, 0.0
    x = exponent / h
    e = exp(-x)
    if e < 0.02:  # the series of acos, exact to rounding here, at a third of the cost
        e2 = e * e
        arc = HALF_PI - e * (1.0 + e2 * (1.0 / 6.0 + e2 * (3.0 / 40.0 + e2 * (15.0 / 336.0))))
    else:
        arc = acos(e)
    return arc, -e * x * dh / (h * sqrt(1.0 - e * e))


@kernel
def _momentum(f, side, v_normal, v_tangential, element, polars):
    """Return the Momentum terms of one station at -pi/2 <= f < pi, v_normal >= 0.

    side -1 is the mirrored problem of reversed flow: the foil turned upside down. Buhl's
    a = (g1 -+ sqrt(g2))/g3 is, without its singularity at g3 = 0,
    1/(1 - a) = 5/3 - F +- sqrt(2 F k - F (4/3 - F)), upper sign for f > 0.
    """
    s, c = sin(f), cos(f)
    sign = -1.0 if s < 0.0 else 1.0
    h, dh = max(sign * s, 1e-12), sign * c  # never 0: bisection may reach f = 0
    lift, drag, lift_slope, drag_slope = lift_drag(side * f - element.theta, element.foil, polars)
    lift, drag_slope = side * lift, side * drag_slope
    cn, ct = lift * c + drag * s, lift * s - drag * c
    dcn, dct = lift_slope * c + drag_slope * s - ct, lift_slope * s - drag_slope * c + cn
    tip, dtip = _loss(element.tip_exponent, h, dh)
    hub, dhub = _loss(element.hub_exponent, h, dh)
    loss, dloss = PRANDTL * tip * hub, PRANDTL * (tip * dhub + dtip * hub)
    m = 0.25 * element.solidity / loss
    dm = -m * dloss / loss

    flow, dflow = (h, dh) if h > LEAST_FLOW else (LEAST_FLOW, 0.0)
    swirl = c - m * ct / flow
    dswirl = -s - (dm * ct + m * dct - m * ct * dflow / flow) / flow

    factor = loss * (4.0 / 3.0 - loss)
    square = 0.5 * element.solidity * cn - factor * s * s
    root = sqrt(max(square, 0.0))
    empirical = s * (5.0 / 3.0 - loss) + root
    if s > 0.0:
        wake_is_ordered = m * cn <= 2.0 / 3.0 * s * s
    else:
        wake_is_ordered = not (square > 0.0 and empirical * h < s * h + m * cn)
    if wake_is_ordered:  # 1/(1-a) = 1 + k, and 1 - k for f < 0; times h, which makes it smooth at 0
        balance, dbalance = s * h + m * cn, 2.0 * c * h + dm * cn + m * dcn
        qs = balance / h
        return Momentum(
            s,
            c,
            cn,
            ct,
            qs,
            swirl,
            h,
            h,
            v_tangential * balance - v_normal * h * swirl,
            v_tangential * dbalance - v_normal * (dh * swirl + h * dswirl),
            dcn,
            dct,
            (dbalance - dh * qs) / h,
            dswirl,
        )
    dsquare = 0.5 * element.solidity * dcn - 2.0 * factor * s * c - (4.0 / 3.0 - 2.0 * loss) * dloss * s * s
    dqs = c * (5.0 / 3.0 - loss) - s * dloss + 0.5 * dsquare / root
    return Momentum(
        s,
        c,
        cn,
        ct,
        empirical,
        swirl,
        1.0,
        flow,
        v_tangential * empirical - v_normal * swirl,
        v_tangential * dqs - v_normal * dswirl,
        dcn,
        dct,
        dqs,
        dswirl,
    )


@kernel
def _shifted(at, step):
    """Return the Momentum terms after a small step of f, to first order."""
    return Momentum(
        at.s + step * at.c,
        at.c - step * at.s,
        at.cn + step * at.dcn,
        at.ct + step * at.dct,
        at.qs + step * at.dqs,
        at.swirl + step * at.dswirl,
        at.weight,
        at.scale,
        at.value,
        at.slope,
        at.dcn,
        at.dct,
        at.dqs,
        at.dswirl,
    )


@kernel
def bem_residual(phi, v_normal, v_tangential, blade_pitch, station, rotor):
    """Return the residual sin f/(1-a) - (V_x/V_y) cos f (1-k') of a station at inflow angle phi = f.

    v_tangential > 0. For v_normal < 0: the mirrored problem, with f = -phi and the foil upside down.
    """
    side = -1.0 if v_normal < 0.0 else 1.0
    element = element_of(station, blade_pitch, rotor)
    at = _momentum(side * phi, side, side * v_normal, v_tangential, element, rotor.polars)
    return at.qs - side * v_normal / v_tangential * at.swirl


@kernel
def _bracketed(low, high, side, v_normal, v_tangential, element, polars):
    """Return (found, f): root of the residual in [low, high] by bisection with secant steps (Illinois)."""
    at = _momentum(low, side, v_normal, v_tangential, element, polars)
    r_low = v_tangential * at.qs - v_normal * at.swirl
    at = _momentum(high, side, v_normal, v_tangential, element, polars)
    r_high = v_tangential * at.qs - v_normal * at.swirl
    if r_low == 0.0:
        return True, low
    if not r_low * r_high <= 0.0:
        return False, low
    f = low
    for i in range(MAX_BISECTIONS):
        f = 0.5 * (low + high)
        if i % 3 != 0:  # every third step halves the bracket
            f = min(max((low * r_high - high * r_low) / (r_high - r_low), low), high)
        at = _momentum(f, side, v_normal, v_tangential, element, polars)
        r = v_tangential * at.qs - v_normal * at.swirl
        if abs(r) <= 1e-13 * v_tangential or high - low <= 1e-16 * abs(f):
            break
        if (r > 0.0) == (r_high > 0.0):
            high, r_high, r_low = f, r, 0.5 * r_low
        else:
            low, r_low, r_high = f, r, 0.5 * r_high
    return True, f


@kernel
def _solve_bracketed(side, v_normal, v_tangential, element, polars):
    """Search the root of the residual by brackets, wind turbine states first; return (found, f)."""
    low = SMALLEST_ANGLE
    found, f = _bracketed(low, LARGEST_ANGLE, side, v_normal, v_tangential, element, polars)
    if not found:
        found, f = _bracketed(-HALF_PI, low, side, v_normal, v_tangential, element, polars)
    return found, f


@kernel
def _rough_guess(v_normal, v_tangential, side, element):
    """Return a first guess of the inflow angle f > 0: linear lift, no drag, no losses, small angles."""
    x = v_normal / v_tangential
    pull = 0.25 * element.solidity * LIFT_SLOPE
    b = x - pull
    f = 0.5 * (b + sqrt(b * b + 4.0 * pull * max(side * (element.theta + element.zero_lift), 0.0)))
    return max(min(f, x / (1.0 + 0.5 * x)), 1e-3)


@kernel
def first_guess(v_normal, v_tangential, blade_pitch, j, rotor):
    """Return the initial inflow angle of Newton's method, bilinear in a table over inflow and blade pitch.

    The guess affects the number of steps and, where the balance has several roots (deep stall), the selected
    root. It depends on the present inflow of the station only, not on the past. Zero outside the table:
    reversed flow, no induction, NaN.
    """
    if not (v_normal >= 0.0 and v_tangential > 0.0):
        return 0.0
    p = v_normal / (v_normal + v_tangential) * (GUESSES - 1)
    b = (blade_pitch - GUESS_PITCH[0]) * ((GUESSES - 1) / (GUESS_PITCH[1] - GUESS_PITCH[0]))
    b = min(max(b, 0.0), GUESSES - 1.0)
    i, k = max(0, min(int(b), GUESSES - 2)), max(0, min(int(p), GUESSES - 2))
    b, p = b - i, p - k
    table = rotor.guess
    low = (1.0 - p) * float(table[j, i, k]) + p * float(table[j, i, k + 1])
    high = (1.0 - p) * float(table[j, i + 1, k]) + p * float(table[j, i + 1, k + 1])
    return (1.0 - b) * low + b * high


@kernel
def _solve(guess, side, v_normal, v_tangential, element, polars):
    """Solve the momentum balance of one station, v_normal >= 0, v_tangential > 0: (found, f, Momentum at f).

    Newton's method inside [-pi/2, LARGEST_ANGLE], where the residual changes from negative to positive;
    without convergence, bisection bracket by bracket.
    """
    scale = 1.0 / (v_normal + v_tangential)
    v_normal, v_tangential = scale * v_normal, scale * v_tangential
    low, high = -HALF_PI, LARGEST_ANGLE
    f = guess
    if f == 0.0:
        f = _rough_guess(v_normal, v_tangential, side, element)
    goal = TOLERANCE * v_tangential
    for _ in range(MAX_NEWTON):
        at = _momentum(f, side, v_normal, v_tangential, element, polars)
        step = -at.value / at.slope
        if abs(at.value) <= goal * at.weight and at.slope > 0.0 and abs(step) <= LAST_STEP * at.scale:
            return True, f + step, _shifted(at, step)
        if at.value > 0.0:
            high = f
        else:
            low = f
        f += step
        if not (at.slope > 0.0 and low < f < high):
            f = 0.5 * (low + high)
    found, f = _solve_bracketed(side, v_normal, v_tangential, element, polars)
    at = _momentum(f, side, v_normal, v_tangential, element, polars)
    return found and abs(at.value) <= goal * at.weight, f, at  # no root where the residual jumps


@kernel
def smoothstep(x, low, high):
    """Return a smooth step: 0 below low, 1 above high, cubic in between."""
    if x >= high:
        return 1.0
    if x <= low:
        return 0.0
    x = (x - low) / (high - low)
    return x * x * (3.0 - 2.0 * x)


@kernel
def airload(v_normal, v_tangential, element, polars):
    """Return (cn, ct, squared speed): load coefficients of a station in a local flow, without induction."""
    square = v_normal * v_normal + v_tangential * v_tangential
    if square == 0.0:
        return 0.0, 0.0, 0.0
    speed = sqrt(square)
    s, c = v_normal / speed, v_tangential / speed
    lift, drag, _, _ = lift_drag(atan2(s, c) - element.theta, element.foil, polars)
    return lift * c + drag * s, lift * s - drag * c, square


@kernel
def pitching_moment(v_normal, v_tangential, j, element, shape, polars):
    """Return the pitching moment per length of station j in a local flow, N m/m, nose up."""
    if shape is None:
        return 0.0
    square = v_normal * v_normal + v_tangential * v_tangential
    if square == 0.0:
        return 0.0
    i, x = segment_of(atan2(v_normal, v_tangential) - element.theta, element.foil, polars)
    return (
        element.half_density_chord * shape.chord[j] * square * (shape.moment[i, 0] + x * shape.moment[i, 1])
    )


@kernel
def blade_section(v_normal, v_tangential, blade_pitch, station, induction, rotor):
    """Return the Section of one station: its loads and induced flow.

    v_normal, v_tangential  relative wind along the shaft (downwind) and against the motion, m/s
    induction               1: momentum balance, 0: none (parked rotor), between: faded
    """
    guess = first_guess(v_normal, v_tangential, blade_pitch, station, rotor)
    element = element_of(station, blade_pitch, rotor)
    return solve_section(v_normal, v_tangential, induction, guess, element, rotor.polars)


@kernel
def solve_section(v_normal, v_tangential, induction, guess, element, polars):
    """Return the Section of one element; arguments as in blade_section."""
    theta = element.theta
    if not (abs(v_normal) < LARGEST_SPEED and abs(v_tangential) < LARGEST_SPEED and abs(theta) < 100.0):
        return Section(nan, nan, nan, nan, nan, nan, nan, nan, nan, nan, True)
    half = element.half_density_chord
    side = -1.0 if v_normal < 0.0 else 1.0
    part = 0.0
    if induction > 0.0 and v_tangential > 0.0:
        axial = abs(v_normal)
        part = induction * smoothstep(v_tangential, SLOW_SECTION * axial, FAST_SECTION * axial)
    solved = True
    if part > 0.0:
        solved, f, at = _solve(guess, side, abs(v_normal), v_tangential, element, polars)
        if solved:
            # both formulas give the local speed at the root; the better conditioned one is used
            if abs(v_normal) < v_tangential:
                speed = v_tangential / at.swirl
            else:
                speed = abs(v_normal) / at.qs
            w_normal, w_tangential = side * speed * at.s, speed * at.c
            a = 1.0 - w_normal / v_normal if v_normal != 0.0 else 0.0
            ap = w_tangential / v_tangential - 1.0
            cn, ct, square = side * at.cn, at.ct, speed * speed
            induced_normal = part * (w_normal - v_normal)
            induced_tangential = part * (w_tangential - v_tangential)
            if part < 1.0:
                cn, ct, square = airload(
                    v_normal + induced_normal, v_tangential + induced_tangential, element, polars
                )
            return Section(
                side * f,
                a,
                ap,
                cn,
                ct,
                half * square * cn,
                half * square * ct,
                induced_normal,
                induced_tangential,
                at.value * (abs(v_normal) + v_tangential) / (at.weight * v_tangential),
                True,
            )
    cn, ct, square = airload(v_normal, v_tangential, element, polars)
    phi = atan2(v_normal, v_tangential)
    return Section(phi, 0.0, 0.0, cn, ct, half * square * cn, half * square * ct, 0.0, 0.0, 0.0, solved)


@entry
def _fill_guesses(rotor):
    """Fill rotor.guess with the inflow angles that solve the momentum balance at the table points."""
    for j in range(rotor.radius.shape[0]):
        for i in range(GUESSES):
            fraction = i / (GUESSES - 1.0)
            blade_pitch = GUESS_PITCH[0] + fraction * (GUESS_PITCH[1] - GUESS_PITCH[0])
            element = element_of(j, blade_pitch, rotor)
            for k in range(GUESSES):
                p = min(max(k / (GUESSES - 1.0), 1e-4), 1.0 - 1e-4)
                found, f, _ = _solve(0.0, 1.0, p, 1.0 - p, element, rotor.polars)
                rotor.guess[j, i, k] = f if found else 0.0


_guesses = Cache(32)  # one table per blade: filling one takes a fifth of a second


def elements_key(elements):
    """Return a hashable key of the aerodynamics of BladeElements."""
    parts = (*elements[: elements._fields.index("polars")], *elements.polars, *(elements.shape or ()))
    return tuple(part.tobytes() if isinstance(part, np.ndarray) else part for part in parts)


def _guess_table(elements):
    """Return the guess table of BladeElements; with the JIT off zeros, which select the rough guess."""
    if numba.config.DISABLE_JIT:
        return elements.guess
    key = elements_key(elements._replace(air_density=0.0))
    return _guesses.get(key, lambda: _filled_guess(elements))


def _filled_guess(elements):
    _fill_guesses(elements)
    return elements.guess


def _hat_weights(radius, hub_radius, tip_radius):
    """Return integrals (n,) of each station's hat function, m, and of radius times hat function, m2.

    The line load is linear between stations and zero at the hub and the tip.
    """
    nodes = np.concatenate(([hub_radius], radius, [tip_radius]))
    left, middle, right = nodes[:-2], nodes[1:-1], nodes[2:]
    area = 0.5 * (right - left)
    return area, area * (left + middle + right) / 3.0


def station_weights(length, chosen):
    """Return the line load at all points of a blade for a unit load at each chosen station, (chosen, n + 2).

    length (n + 2,): of hub, stations and tip along the blade. The line load is linear between the chosen
    stations and zero at hub and tip.
    """
    nodes = np.concatenate(([length[0]], length[1:-1][chosen], [length[-1]]))
    unit = np.eye(len(nodes))[1:-1]
    return np.array([np.interp(length, nodes, row) for row in unit])


def _cm_segments(polar):
    """Return cm at the start of each segment of a polar and its slope, (m+1, 2)."""
    step, moment = np.diff(polar[:, 0]), polar[:, 3]
    return np.column_stack([moment, np.append(np.diff(moment) / step, 0.0)])


def _polar_segments(polar):
    """Return the segments of a polar (m+1, 5) and the first segment of each half degree (CELLS,)."""
    alpha, lift, drag = polar[:, 0], polar[:, 1], polar[:, 2]
    step = np.diff(alpha)
    segments = np.zeros((len(step) + 1, 5))
    segments[:-1, 0], segments[:-1, 1], segments[:-1, 2] = alpha[:-1], lift[:-1], drag[:-1]
    segments[:-1, 3], segments[:-1, 4] = np.diff(lift) / step, np.diff(drag) / step
    segments[-1, 0] = np.inf
    edges = np.linspace(-pi, pi, CELLS + 1)[:-1] - 1e-9  # rounding must not move a cell past a point
    first = np.clip(np.searchsorted(alpha, edges, side="right") - 1, 0, len(step) - 1)
    return segments, first


def _zero_lift(polar):
    """Return minus the zero-lift angle by the lift at -2 and 6 deg, rad; for the first guess only."""
    low, high = np.interp(np.radians([-2.0, 6.0]), polar[:, 0], polar[:, 1])
    rise = (high - low) / np.radians(8.0)
    return high / rise - np.radians(6.0) if rise > 1.0 else 0.0


def build_blade_elements(turbine, air_density, stations=None, shaped=False, fit=None, bending=None):
    """Return the BladeElements of a turbine description; stations: indices of a subset, default all.

    shaped: with a BladeShape even for straight blades in the rotor plane.
    fit: for curved blades, a function that replaces the factors (force, first) of a station_choice.Fit.
    bending: blade_shape.Bending on the blade_line, or None: rigid blades.

    Raises: InputError if a station lies outside the blade or a polar does not span -180 to 180 deg.
    """
    rotor, blade = turbine.rotor, turbine.blade
    chosen = np.arange(len(blade.radius)) if stations is None else np.unique(np.asarray(stations, dtype=int))
    if len(chosen) == 0 or chosen[0] < 0 or chosen[-1] >= len(blade.radius):
        raise InputError(f"stations = {stations}: need indices in [0, {len(blade.radius) - 1}]")
    radius, chord = np.asarray(blade.radius)[chosen], np.asarray(blade.chord)[chosen]
    if not rotor.hub_radius < radius[0] <= radius[-1] < rotor.tip_radius:
        raise InputError(
            f"blade.radius from {radius[0]} to {radius[-1]}: must lie inside hub_radius = {rotor.hub_radius} "
            f"and tip_radius = {rotor.tip_radius} m"
        )
    names = sorted({blade.airfoil[i] for i in chosen})
    segments, cells, moments, start = [], [], [], 0
    for name in names:
        polar = np.asarray(blade.polars[name], dtype=float)
        if not np.all(np.isfinite(polar)):
            raise InputError(f"polar {name}: all values must be finite numbers")
        if abs(polar[0, 0] + pi) > 1e-6 or abs(polar[-1, 0] - pi) > 1e-6 or np.any(np.diff(polar[:, 0]) <= 0):
            raise InputError(f"polar {name}: alpha must increase from -180 to 180 deg")
        part, first = _polar_segments(polar)
        segments.append(part)
        cells.append(first + start)
        moments.append(_cm_segments(polar))
        start += len(part)
    area, moment = _hat_weights(radius, rotor.hub_radius, rotor.tip_radius)
    blades, shape, modes = rotor.blades, None, None
    along, end, apart = radius, rotor.tip_radius, radius  # lengths along the blade, distance from the shaft
    if shaped or bending is not None or is_curved(turbine):
        line = blade_line(blade, rotor.hub_radius, rotor.tip_radius)
        weights = station_weights(line.length, chosen)
        area, first = line_integrals(line.length, line.points, weights)
        if bending is not None:
            first = np.hstack([first, modal_integrals(line, bending, weights)])
        if fit is not None:
            area, first = fit(area, first)
        arms = first / area[:, None]
        shape = build_blade_shape(turbine, line, chosen, arms[:, :3], np.concatenate(moments))
        if bending is not None:
            modes = build_station_modes(line, bending.here, chosen, arms[:, 3:], shape)
        along, end = line.length[1:-1][chosen], line.length[-1]
        apart = np.hypot(shape.cone_cosine * radius + shape.cone_sine * shape.prebend, shape.sweep)
        moment = area * shape.arm_distance
    hub_x, hub_z = rotor_axes(-rotor.overhang, rotor.hub_height, rotor.shaft_tilt)
    arrays = (
        apart,
        chord,
        np.asarray(blade.twist)[chosen],
        blades * chord / (2.0 * pi * apart),
        0.5 * blades * (end - along) / along,
        0.5 * blades * (along - rotor.hub_radius) / rotor.hub_radius,
        np.array([_zero_lift(np.asarray(blade.polars[blade.airfoil[i]])) for i in chosen]),
        area,
        moment,
    )
    elements = BladeElements(
        int(blades),
        float(rotor.hub_radius),
        float(rotor.tip_radius),
        float(-hub_x),
        float(hub_z),
        float(air_density),
        *(np.ascontiguousarray(a, dtype=np.float64) for a in arrays),
        np.array([names.index(blade.airfoil[i]) for i in chosen], dtype=np.int64),
        Polars(
            np.ascontiguousarray(cells, dtype=np.int64),
            np.ascontiguousarray(np.concatenate(segments), dtype=np.float64),
        ),
        shape,
        np.zeros((len(radius), GUESSES, GUESSES), dtype=np.float32),
        modes,
    )
    return elements._replace(guess=_guess_table(elements))
