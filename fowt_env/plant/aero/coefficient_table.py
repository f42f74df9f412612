"""Computes rotor loads from one table of blade element momentum, expanded about uniform axial flow.

To first order in variations over the disk the sum over three or more blades does not depend on the azimuth:
in-plane force and moment have one coefficient each per gradient of the axial wind (shear, platform pitch and
yaw rate) and per cross wind (misalignment, platform pitch, motion of the hub). Thrust and torque change to
second order in both. All are integrals of derivatives of the line load, over inflow angle and blade pitch.

Neglected: fluctuations with the azimuth, and the change of the cross wind over the disk. Full-field wind is
averaged over the rotor first (in scene/build.py).
"""

from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.plant.aero.blade_elements import (
    blade_section,
    element_of,
    elements_key,
    pitching_moment,
    smoothstep,
)
from fowt_env.plant.aero.blade_shape import (
    BladeShape,
    Lever,
    Station,
    curved_station,
    effective_pitch,
    lever_of,
    turn_of,
)
from fowt_env.plant.aero.blade_sweep import FAST_ROTOR, NO_ROTOR_LOAD, SLOW_ROTOR, hub_flow, rotor_axes_load
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.events import Counter
from fowt_env.plant.state import State, Wrench

# Angle theta = atan2(speed * tip radius, axial wind): 0 parked, 90 deg no wind, 180 deg parked in reversed
# wind, negative: rotating backwards. Steps are small where loads curve: (start, step) in deg. Tip-speed
# ratios 3 to 20 are 71 to 87 deg; around 90 deg the wake state changes within a degree.
THETA_STEPS = ((-180.0, 3.0), (0.0, 1.0), (40.0, 0.5), (66.0, 0.1), (89.9, 0.02), (90.1, 0.5), (110.0, 2.0))
PITCH_STEPS = ((-10.0, 1.0), (-4.0, 0.25), (26.0, 1.0), (40.0, 2.5))  # deg, blade pitch
THETA_END, PITCH_END = 180.0, 100.0
# Largest change of the axial wind from hub to tip, over the speed at the tip, in the expansion; steeper
# gradients are limited to this one, 8 m/s at rated speed. A platform yaw rate of 20 deg/s would give 22 m/s,
# where the second-order torque would exceed the mean torque and drive the rotor.
STEEPEST = 0.1
CELLS = 1024  # of the look-up tables of intervals of theta and blade pitch

# rad, change of a station's inflow direction for finite differences. Gusts change it by about this much per
# revolution; with sqrt(3/4) of their amplitude a central difference gives their mean effect to the next order
# too. The largest error of a run at 18 m/s is 0.018 to 0.021 with 0.017, 0.009 to 0.016 with 0.03.
TURN = 0.03
MEAN_SQUARE = 0.6  # of radius over tip radius, at which wind curvature acts on the torque
HIGHER_SQUARE = 0.7  # the same for the highest orders of the power law, which are small


class Coefficients(NamedTuple):
    """Holds loads over the air density and powers of the tip radius R and s = sqrt(V^2 + (speed R)^2).

    Values are integrals of the expressions below: n, t normal and tangential line load, subscripts their
    derivatives with the inflow, B blades, lengths over R. Terms of leaning blades: see _fill.
    """

    thrust: float  # B n, on s^2 R^2
    torque: float  # B r t, on s^2 R^3
    thrust_bend: float  # B (r^2 - MEAN_SQUARE) n_n, on s R^2
    torque_bend: float  # B r (r^2 - MEAN_SQUARE) t_n, on s R^3
    moment_gradient: float  # B/2 r^2 n_n, on s R^3
    moment_cross: float  # B/2 r n_t, on s R^3
    force_gradient: float  # B/2 r t_n, on s R^2
    force_cross: float  # B/2 t_t, on s R^2
    thrust_nn: float  # B/4 r^2 n_nn, on R^2
    thrust_nt: float  # B/2 r n_nt
    thrust_tt: float  # B/4 n_tt; of leaning blades n_tt + nr^2 n_nn
    torque_nn: float  # B/4 r^3 t_nn, on R^3
    torque_nt: float  # B/2 r^2 t_nt
    torque_tt: float  # B/4 r t_tt, likewise
    moment_cubic: float  # B/2 r^4 n_n, on s R^3
    force_cubic: float  # B/2 r^3 t_n, on s R^2
    moment_bend_gradient: float  # B/4 r^4 n_nn, on R^3
    moment_bend_cross: float  # B/4 r^3 n_nt
    force_bend_gradient: float  # B/4 r^3 t_nn, on R^2
    force_bend_cross: float  # B/4 r^2 t_nt


class Leaning(NamedTuple):
    """Holds the terms of cone and prebend: cross wind and forces along the radius, moments about the radius.

    Values are integrals of the expressions below: nx, nr, turn, t_nx, x of a station's Lever
    (blade_shape.py), t its position across the radius, m the pitching moment, Q the moment about the shaft.
    """

    moment_lean: float  # -B/2 turn nr n_n, on s R^2: cross wind acts on leaning blades like a gradient
    force_lean: float  # B/2 nr t_n, on s R
    out_gradient: float  # B/2 nx (nr r n_n + t t_n), on s R^2
    out_cross: float  # B/2 nr n_t
    out_lean: float  # B/2 nr nr n_n
    roll_gradient: float  # B/2 nx (r (t_nx n_n - x t_n + nx m_n) + t turn n_n), on s R^3
    roll_cross: float  # B/2 (t_nx n_t - x t_t + nx m_t)
    roll_lean: float  # B/2 nr (t_nx n_n - x t_n + nx m_n)
    thrust_spread: float  # B nr r nx n_n, on s R^2: diverging cross wind
    torque_spread: float  # B nr r Q_n, on s R^3
    thrust_both: float  # B/2 nx (nr nx r n_nn - nx t n_nt), on R^2: gradient along the cross wind
    torque_both: float  # B/2 (nr nx r Q_nn - nx t Q_nt), on R^3


class TableAxis(NamedTuple):
    """Holds the points of one table variable, and a look-up table of intervals."""

    point: np.ndarray  # (n,) increasing
    cell: np.ndarray  # (CELLS,) int64, first interval that reaches into this cell
    scale: float  # cells per unit


class CoefficientTable(NamedTuple):
    """Holds the coefficients of the rotor over inflow angle (n,) and blade pitch (m,), rad."""

    theta: TableAxis
    blade_pitch: TableAxis
    load: np.ndarray  # (n, m, len(Coefficients._fields)), in order of the fields
    lean: object  # (n, m, len(Leaning._fields)), likewise; None: straight blades in the rotor plane
    tip_radius: float
    overhang: float  # in rotor axes, as the hub height (tilt.py)
    hub_height: float
    density: float  # of the air, kg/m3


class TableCell(NamedTuple):
    """Holds a cell of a CoefficientTable and the interpolation weights of the corners."""

    i: int  # of the inflow angle
    k: int  # of the blade pitch
    w00: float
    w01: float
    w10: float
    w11: float


class DiskInflow(NamedTuple):
    """Holds the wind relative to the moving rotor about the hub, body components, m/s; radii over the tip's.

    On a ring of radius r, in the direction e = (y, z) at the angle psi from z, the axial wind is
    axial + bend (r^2 - MEAN_SQUARE + r^2 cos(2 psi)) + r (gradient + r^2 cubic) . e
    """

    axial: float
    turning: float  # mean of the cross wind's circulation, against the rotor's motion, at the tip
    bend: float
    gradient_y: float
    gradient_z: float
    cubic_y: float
    cubic_z: float
    cross_y: float
    cross_z: float
    spread: float  # mean outward flow of the cross wind at the tip


def _axis(steps, end):
    """Return the TableAxis from the list of (start, step), with the last point at end (deg); rad."""
    edges = [start for start, _ in steps] + [end]
    parts = [
        np.linspace(low, high, max(1, round((high - low) / step)), endpoint=False)
        for (low, step), high in zip(steps, edges[1:], strict=True)
    ]
    point = np.radians(np.concatenate([*parts, [end]]))
    scale = CELLS / (point[-1] - point[0])
    start = point[0] + np.arange(CELLS) / scale - 1e-9  # rounding must not move a cell past a point
    cell = np.clip(np.searchsorted(point, start, side="right") - 1, 0, len(point) - 2)
    return TableAxis(point, cell.astype(np.int64), float(scale))


@kernel
def _loads_at(v_normal, v_tangential, j, blade_pitch, induction, rotor):
    """Return the line loads (fn, ft, pitching moment) of station j."""
    section = blade_section(v_normal, v_tangential, blade_pitch, j, induction, rotor)
    element = element_of(j, blade_pitch, rotor)
    moment = pitching_moment(
        v_normal + section.induced_normal, v_tangential + section.induced_tangential, j, element, rotor.shape,
        rotor.polars,
    )  # fmt: skip
    return section.fn, section.ft, moment


@kernel
def _slopes(less, middle, more, co, si, size):
    """Return derivatives of a load with v_normal and v_tangential, the second ones times squared speed."""
    first = 0.5 * (more - less) / TURN
    second = (more - 2.0 * middle + less) / (TURN * TURN)
    normal, tangential = (2.0 * co * middle - si * first) / size, (2.0 * si * middle + co * first) / size
    nn = 2.0 * (middle - co * si * first) + si * si * second
    nt = (co * co - si * si) * first - co * si * second
    tt = 2.0 * (middle + co * si * first) + co * co * second
    return normal, tangential, nn, nt, tt


@kernel
def _straight_geometry(j, turn, rotor, shape):
    arm = rotor.moment_weight[j] / rotor.weight[j]
    return Station(0.0, rotor.radius[j], 0.0, 1.0, 0.0), Lever(1.0, 0.0, -arm, 0.0, 0.0, 0.0, arm)


@kernel
def _curved_geometry(j, turn, rotor, shape):
    return curved_station(j, turn, rotor.radius, shape), lever_of(j, turn, shape)


# (j, turn, rotor, shape) -> (Station, Lever) of station j
_station_geometry = chosen_by_class("shape", {type(None): _straight_geometry, BladeShape: _curved_geometry})


@entry
def _fill(theta, blade_pitch, load, lean, rotor, shape):
    """Add the coefficients of a rotor in air of density 1 to load and lean, by blade element momentum.

    The load of a station is the square of the inflow speed times a function of the inflow direction, so
    three directions give the first and second derivatives.
    """
    big = rotor.tip_radius
    for i in range(theta.shape[0]):
        wind, tip_speed = cos(theta[i]), sin(theta[i])
        induction = smoothstep(tip_speed, SLOW_ROTOR * abs(wind), FAST_ROTOR * abs(wind))
        for k in range(blade_pitch.shape[0]):
            turned = turn_of(blade_pitch[k])
            for j in range(rotor.radius.shape[0]):
                at, lever = _station_geometry(j, turned, rotor, shape)
                pitch = effective_pitch(j, blade_pitch[k], shape)
                r, nx, nr = at.r / big, at.nx, at.nr
                arm, turn, t_nr = lever.r / big, -lever.turn / big, lever.t_nr / big
                v_normal, v_tangential = nx * wind + nr * tip_speed * at.t / big, tip_speed * r
                square = v_normal * v_normal + v_tangential * v_tangential
                size, angle = sqrt(square), atan2(v_tangential, v_normal)
                n, t, m = _loads_at(v_normal, v_tangential, j, pitch, induction, rotor)
                low_n, low_t, low_m = _loads_at(
                    size * cos(angle - TURN), size * sin(angle - TURN), j, pitch, induction, rotor
                )
                top_n, top_t, top_m = _loads_at(
                    size * cos(angle + TURN), size * sin(angle + TURN), j, pitch, induction, rotor
                )
                co, si = v_normal / size, v_tangential / size
                of_n = _slopes(low_n, n, top_n, co, si, size)
                of_t = _slopes(low_t, t, top_t, co, si, size)
                of_m = _slopes(low_m / big, m / big, top_m / big, co, si, size)
                n_n, n_t, n_nn, n_nt, n_tt = of_n
                t_n, t_t, t_nn, t_nt, t_tt = of_t
                weight = rotor.blades * rotor.weight[j] / (big * big)
                half, quarter = 0.5 * weight, 0.25 * weight / square
                q = nx * r  # of a gradient in v_normal, along the radius
                bend = nx * (r * r - MEAN_SQUARE)
                add_row(
                    load[i, k],
                    Coefficients(
                        thrust=weight * nx * n,
                        torque=weight * (arm * t - t_nr * n - nr * m / big),
                        thrust_bend=weight * bend * nx * n_n,
                        torque_bend=weight * bend * (arm * t_n - t_nr * n_n - nr * of_m[0]),
                        moment_gradient=half * turn * q * n_n,
                        moment_cross=half * turn * n_t,
                        force_gradient=half * q * t_n,
                        force_cross=half * t_t,
                        thrust_nn=quarter * nx * q * q * n_nn,
                        thrust_nt=2.0 * quarter * nx * q * n_nt,
                        thrust_tt=quarter * nx * (n_tt + nr * nr * n_nn),
                        torque_nn=quarter * arm * q * q * t_nn,
                        torque_nt=2.0 * quarter * arm * q * t_nt,
                        torque_tt=quarter * arm * (t_tt + nr * nr * t_nn),
                        moment_cubic=half * turn * q * r * r * n_n,
                        force_cubic=half * q * r * r * t_n,
                        moment_bend_gradient=quarter * turn * nx * q * r * r * n_nn,
                        moment_bend_cross=quarter * turn * nx * r * r * n_nt,
                        force_bend_gradient=quarter * nx * q * r * r * t_nn,
                        force_bend_cross=quarter * nx * r * r * t_nt,
                    ),
                )
                _fill_lean(at, lever, of_n, of_t, of_m, half, quarter, big, lean[i, k], shape)


@kernel
def add_row(row, values):
    """Add the values of a tuple of numbers to a row."""
    for i in range(len(values)):
        row[i] += values[i]


@kernel
def _fill_lean(at, lever, of_n, of_t, of_m, half, quarter, big, d, shape):
    """Add a curved blade's station to d, a row of Leaning; of_n, of_t, of_m: _slopes of the loads."""
    if shape is None:
        return
    n_n, n_t, n_nn, n_nt, _ = of_n
    t_n, t_t, t_nn, t_nt, _ = of_t
    r, nx, nr = at.r / big, at.nx, at.nr
    arm, turn, x = lever.r / big, -lever.turn / big, lever.x / big
    t_nx, t_nr = lever.t_nx / big, lever.t_nr / big
    q, aside = nx * r, nx * at.t / big  # of a gradient in v_normal: along the radius, and across it
    about_n, about_t = t_nx * n_n - x * t_n + nx * of_m[0], t_nx * n_t - x * t_t + nx * of_m[1]
    add_row(
        d,
        Leaning(
            moment_lean=half * turn * nr * n_n,
            force_lean=half * nr * t_n,
            out_gradient=half * (nr * q * n_n + aside * t_n),
            out_cross=half * nr * n_t,
            out_lean=half * nr * nr * n_n,
            roll_gradient=half * (q * about_n - aside * turn * n_n),
            roll_cross=half * about_t,
            roll_lean=half * nr * about_n,
            thrust_spread=2.0 * half * nr * r * nx * n_n,
            torque_spread=2.0 * half * nr * r * (arm * t_n - t_nr * n_n - nr * of_m[0]),
            thrust_both=2.0 * quarter * nx * (nr * q * n_nn - aside * n_nt),
            torque_both=2.0 * quarter * arm * (nr * q * t_nn - aside * t_nt),
        ),
    )


_tables = Cache(8)  # one per set of blade elements: building takes about two seconds


def build_coefficient_table(rotor):
    """Return the CoefficientTable of a BladeElements; equal elements share one cached table."""
    return _tables.get(elements_key(rotor), lambda: _filled_table(rotor))


def _filled_loads(theta, blade_pitch, rotor):
    """Return the arrays (load, lean) of a CoefficientTable at points of theta and blade_pitch (rad)."""
    load = np.zeros((len(theta), len(blade_pitch), len(Coefficients._fields)))
    lean = np.zeros((*load.shape[:2], 0 if rotor.shape is None else len(Leaning._fields)))
    _fill(theta, blade_pitch, load, lean, rotor._replace(air_density=1.0), rotor.shape)
    return load, None if rotor.shape is None else lean


def _filled_table(rotor):
    """Compute the CoefficientTable of BladeElements."""
    theta, blade_pitch = _axis(THETA_STEPS, THETA_END), _axis(PITCH_STEPS, PITCH_END)
    load, lean = _filled_loads(theta.point, blade_pitch.point, rotor)
    return CoefficientTable(
        theta,
        blade_pitch,
        load,
        lean,
        float(rotor.tip_radius),
        float(rotor.overhang),
        float(rotor.hub_height),
        float(rotor.air_density),
    )


@kernel
def _interval(x, axis):
    """Return the interval (i, weight) of x between points i and i + 1; outside, the nearest end point."""
    point = axis.point
    last = point.shape[0] - 1
    if not x > point[0]:
        return 0, 0.0
    if x >= point[last]:
        return last - 1, 1.0
    i = axis.cell[min(int((x - point[0]) * axis.scale), CELLS - 1)]
    while x >= point[i + 1]:
        i += 1
    return i, (x - point[i]) / (point[i + 1] - point[i])


@inlined_kernel
def _cell(wind, tip_speed, blade_pitch, table):
    """Return the TableCell of an axial wind and a tip speed (m/s) at a blade pitch (rad)."""
    i, p = _interval(atan2(tip_speed, wind), table.theta)
    k, b = _interval(blade_pitch, table.blade_pitch)
    # unsigned indices avoid the test for negative indices
    return TableCell(np.uintp(i), np.uintp(k), (1.0 - p) * (1.0 - b), (1.0 - p) * b, p * (1.0 - b), p * b)


@inlined_kernel
def _value(column, cell, values):
    """Interpolate a column of values (n, m, columns) bilinearly in a TableCell."""
    i, k = cell.i, cell.k
    after, above = i + np.uintp(1), k + np.uintp(1)
    return (
        cell.w00 * values[i, k, column]
        + cell.w01 * values[i, above, column]
        + cell.w10 * values[after, k, column]
        + cell.w11 * values[after, above, column]
    )


@kernel
def _coefficients(cell, c):
    """Return the Coefficients interpolated in a TableCell of CoefficientTable.load."""
    return Coefficients(
        _value(0, cell, c), _value(1, cell, c), _value(2, cell, c), _value(3, cell, c),
        _value(4, cell, c), _value(5, cell, c), _value(6, cell, c), _value(7, cell, c),
        _value(8, cell, c), _value(9, cell, c), _value(10, cell, c), _value(11, cell, c),
        _value(12, cell, c), _value(13, cell, c), _value(14, cell, c), _value(15, cell, c),
        _value(16, cell, c), _value(17, cell, c), _value(18, cell, c), _value(19, cell, c),
    )  # fmt: skip


@kernel
def _leaning(cell, c):
    """Return the Leaning interpolated in a TableCell of CoefficientTable.lean."""
    return Leaning(
        _value(0, cell, c), _value(1, cell, c), _value(2, cell, c), _value(3, cell, c),
        _value(4, cell, c), _value(5, cell, c), _value(6, cell, c), _value(7, cell, c),
        _value(8, cell, c), _value(9, cell, c), _value(10, cell, c), _value(11, cell, c),
    )  # fmt: skip


@kernel
def _inflow(pose, now, series, table):
    """Return the DiskInflow of the rotor in a wind series.

    A power law (1 + z)^a = 1 + a z + a (a - 1)/2 z^2 + ... has, on a ring of z = r cos(psi), even powers that
    give a mean and a second harmonic, and odd ones that give a first harmonic.
    """
    hub = hub_flow(0.0, pose, now, series, None, table.overhang, table.hub_height)
    a, radius, length = series.shear_exponent, table.tip_radius, series.reference_length
    linear = (now.vertical_shear * (hub.Z - series.reference_height) + now.horizontal_shear * hub.Y) / length
    # parts of the wind at the hub that the power law scales
    axial = hub.wx + hub.vx - pose.r31 * now.w - pose.r11 * linear
    cross_y = hub.wy + hub.vy - pose.r32 * now.w - pose.r12 * linear
    cross_z = hub.wz + hub.vz - pose.r33 * now.w - pose.r13 * linear
    size = radius / max(hub.Z, radius)
    square = size * size
    rest = HIGHER_SQUARE * square
    even = 1.0 + (a - 2.0) * (a - 3.0) / 16.0 * rest * (1.0 + (a - 4.0) * (a - 5.0) / 36.0 * rest)
    odd = 1.0 + (a - 3.0) * (a - 4.0) / 24.0 * rest
    bend = 0.25 * a * (a - 1.0) * square * even * axial
    cubic = 0.125 * a * (a - 1.0) * (a - 2.0) * size * square * odd * axial
    vertical, left = radius / length * now.vertical_shear, radius / length * now.horizontal_shear
    up, side = a * size * axial + pose.r11 * vertical, pose.r11 * left
    y_up, z_up = a * size * cross_y + pose.r12 * vertical, a * size * cross_z + pose.r13 * vertical
    curl = pose.r33 * y_up + pose.r23 * pose.r12 * left - pose.r32 * z_up - pose.r22 * pose.r13 * left
    divergence = pose.r32 * y_up + pose.r22 * pose.r12 * left + pose.r33 * z_up + pose.r23 * pose.r13 * left
    return DiskInflow(
        hub.wx + MEAN_SQUARE * bend,
        0.5 * curl,
        bend,
        pose.r32 * up + pose.r22 * side + radius * pose.wz,
        pose.r33 * up + pose.r23 * side - radius * pose.wy,
        pose.r32 * cubic,
        pose.r33 * cubic,
        hub.wy,
        hub.wz,
        0.5 * divergence,
    )


@kernel
def _add_lean(plain, flow, cell, s, gy, gz, table, lean):
    """Return plain plus the loads by cone and prebend: a Wrench about the rotor centre."""
    if lean is None:
        return plain
    at = _leaning(cell, lean)
    cy, cz = flow.cross_y, flow.cross_z
    area = table.density * table.tip_radius * table.tip_radius
    volume, along = area * table.tip_radius, gy * cy + gz * cz
    force, moment = s * area, s * volume
    return Wrench(
        plain.fx + force * flow.spread * at.thrust_spread + area * along * at.thrust_both,
        plain.fy + force * (gy * at.out_gradient - cz * at.out_cross + cy * at.out_lean - cz * at.force_lean),
        plain.fz + force * (gz * at.out_gradient + cy * at.out_cross + cz * at.out_lean + cy * at.force_lean),
        plain.mx + moment * flow.spread * at.torque_spread + volume * along * at.torque_both,
        plain.my
        + moment * (gy * at.roll_gradient - cz * at.roll_cross + cy * at.roll_lean + cz * at.moment_lean),
        plain.mz
        + moment * (gz * at.roll_gradient + cy * at.roll_cross + cz * at.roll_lean - cy * at.moment_lean),
    )


@kernel
def coefficient_table_load(pose, x, now, series, table, counters):
    """Return the RotorLoad of the state x, averaged over a rotor revolution.

    No table or no wind series: zero.
    now, series  wind (wind.py), evaluated at the position of the moving rotor
    counters     counters[Counter.ROTOR_TABLE_CLAMPED] is incremented where the wind is steeper than STEEPEST
    """
    if table is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    flow = _inflow(pose, now, series, table)
    tip_speed = (x[State.ROTOR_SPEED] + pose.wx) * table.tip_radius + flow.turning
    cell = _cell(flow.axial, tip_speed, x[State.BLADE_PITCH], table)
    at = _coefficients(cell, table.load)
    s = sqrt(flow.axial * flow.axial + tip_speed * tip_speed)
    gy, gz, qy, qz, bend = flow.gradient_y, flow.gradient_z, flow.cubic_y, flow.cubic_z, flow.bend
    cy, cz = flow.cross_y, flow.cross_z
    steepest = sqrt((gy + qy) * (gy + qy) + (gz + qz) * (gz + qz))
    if steepest > STEEPEST * s:
        if now.u != 0.0:  # in still air the load is negligible
            counters[Counter.ROTOR_TABLE_CLAMPED] += 1.0
        reduction = STEEPEST * s / steepest
        gy, gz, qy, qz = reduction * gy, reduction * gz, reduction * qy, reduction * qz
    my, mz = gy + HIGHER_SQUARE * qy, gz + HIGHER_SQUARE * qz
    nn, nt, tt = my * my + mz * mz, mz * cy - my * cz, cy * cy + cz * cz
    force = table.density * table.tip_radius * table.tip_radius
    moment = force * table.tip_radius
    thrust = s * (s * at.thrust + bend * at.thrust_bend)
    thrust = force * (thrust + nn * at.thrust_nn + nt * at.thrust_nt + tt * at.thrust_tt)
    torque = s * (s * at.torque + bend * at.torque_bend)
    torque = moment * (torque + nn * at.torque_nn + nt * at.torque_nt + tt * at.torque_tt)
    # the first harmonic of the blade force along the shaft gives a moment, in the plane a force; the second
    # harmonic of the inflow mirrors the first
    y = s * (gy * at.moment_gradient + qy * at.moment_cubic - cz * at.moment_cross)
    y -= bend * (my * at.moment_bend_gradient - cz * at.moment_bend_cross)
    z = s * (gz * at.moment_gradient + qz * at.moment_cubic + cy * at.moment_cross)
    z += bend * (mz * at.moment_bend_gradient + cy * at.moment_bend_cross)
    tilt_y, tilt_z = moment * z, -moment * y
    y = s * (gy * at.force_gradient + qy * at.force_cubic - cz * at.force_cross)
    y -= bend * (my * at.force_bend_gradient - cz * at.force_bend_cross)
    z = s * (gz * at.force_gradient + qz * at.force_cubic + cy * at.force_cross)
    z += bend * (mz * at.force_bend_gradient + cy * at.force_bend_cross)
    plain = Wrench(thrust, -force * z, force * y, torque, tilt_y, tilt_z)
    return rotor_axes_load(_add_lean(plain, flow, cell, s, my, mz, table, table.lean), 1.0, table)


def performance(rotor, tip_speed_ratio, blade_pitch):
    """Return the coefficients of power, thrust and torque (cp, ct, cq) in axial wind, each (n, m).

    rotor: BladeElements; tip_speed_ratio (n,); blade_pitch (m,) rad. Usual definitions: over rho V^2/2 times
    rotor area (and radius).
    """
    ratio = np.ascontiguousarray(tip_speed_ratio, dtype=np.float64)
    blade_pitch = np.ascontiguousarray(blade_pitch, dtype=np.float64)
    load, _ = _filled_loads(np.arctan(ratio), blade_pitch, rotor)
    # table entries are over rho R^2 (and R) and the combined speed s^2 of wind and tip
    scale = 2.0 / np.pi * (1.0 + ratio[:, None] ** 2)
    torque = scale * load[:, :, 1]
    return ratio[:, None] * torque, scale * load[:, :, 0], torque
