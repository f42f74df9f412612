"""Rotor loads with dynamic inflow from tables per blade station, as section_table.py has those without.

The loads there contain the induced velocity of the momentum balance. With dynamic inflow that velocity has
states, so what is tabulated is split in two: the quasi-steady induced velocity of a station over the
direction of the wind that it meets, which the filter of wake.py follows, and its load over the direction of
the flow that is left with the filtered velocity, without any balance. Directions, rows and limits of both
tables are those of section_table.py. States, and the loads beyond the tables, are those of rotor_load.
"""

from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.plant.aero.bem_rotor import (
    FAST_ROTOR,
    NO_ROTOR_LOAD,
    SLOW_ROTOR,
    hub_flow,
    rotor_axes_load,
    rotor_load,
    store_blade_load,
)
from fowt_env.plant.aero.blade_elements import (
    LARGEST_SPEED,
    BladeElements,
    airload,
    blade_section,
    element_of,
    elements_key,
    pitching_moment,
    smoothstep,
)
from fowt_env.plant.aero.blade_shape import (
    BladeLoad,
    BladeShape,
    blade_wind,
    effective_pitch,
    lever_of,
    station_at,
    station_inflow,
    with_blade,
    with_station,
)
from fowt_env.plant.aero.section_table import (
    AHEAD,
    BEHIND,
    LARGEST_RATIO,
    LEAST_NORMAL,
    NO_CURVED_FORCE,
    CurvedForce,
    _all_rows,
    _at,
    _blade,
    _blade_row,
    _pitch_row,
    _profile,
    _shear,
    _sheared_flow,
    table_pitches,
)
from fowt_env.plant.aero.wake import PER_ELEMENT, DynamicInflow, pace, time_constants
from fowt_env.plant.aero.wind import LOWEST_HEIGHT, wind_at
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.state import NO_LOAD, State

# further cells of the loads before the first: a wake that lags a lull may blow back through the rotor plane
REVERSED = 64


class DynamicSections(NamedTuple):
    """Induced velocity and load of the n stations of a blade over blade pitch and flow direction."""

    induced: np.ndarray  # (blade pitches, n, directions, 2) float32, normal and tangential; see _fill
    load: np.ndarray  # (blade pitches, n, directions, 2, or 3 of curved blades) float32; see _fill
    arm: np.ndarray  # (n,) m, radius at which the station's part of a straight blade's force acts
    ratio: np.ndarray  # (n,) tau_1 over tau_2
    elements: BladeElements  # of the exact solution
    wake: DynamicInflow


class Rows(NamedTuple):
    """The two rows of the tables about a blade pitch, and its place between them."""

    low_induced: np.ndarray  # (n, directions, 2)
    high_induced: np.ndarray
    low_load: np.ndarray  # (n, directions, 2 or 3)
    high_load: np.ndarray
    fraction: float


class Direction(NamedTuple):
    """Direction (0, ey, ez) of a blade in rotor axes."""

    ey: float
    ez: float


class Cell(NamedTuple):
    """The cell of a direction, its weights in the low and the high row, and whether the table has it."""

    k: int
    a: float
    b: float
    c: float
    d: float
    inside: bool


class Flow(NamedTuple):
    """Flow at a station with its wake, m/s, and whether the tables know the wind that made it."""

    normal: float
    tangential: float
    inside: bool


@entry
def _fill(induced, load, blade_pitch, elements, shape):
    """Put into induced the quasi-steady induced velocities over the inflow's v_normal + |v_tangential|.

    Into load go each station's part of the blade's force, normal and tangential, and, where there is room,
    its pitching moment, over the air density and the square of |v_normal| + |v_tangential| of the flow that
    has its induced velocity already.
    """
    for i in range(load.shape[0]):
        for j in range(load.shape[1]):
            weight = elements.weight[j] / elements.air_density
            turned = effective_pitch(j, blade_pitch[i], shape)
            element = element_of(j, turned, elements)
            for k in range(load.shape[2]):
                place = k - REVERSED
                v_normal = place / AHEAD if place <= AHEAD else 1.0 - (place - AHEAD) / BEHIND
                v_tangential = 1.0 - abs(v_normal)
                if place > AHEAD:
                    v_tangential = -v_tangential
                cn, ct, square = airload(v_normal, v_tangential, element, elements.polars)
                load[i, j, k, 0] = weight * element.half_density_chord * square * cn
                load[i, j, k, 1] = weight * element.half_density_chord * square * ct
                _fill_moment(load[i, j, k], weight, v_normal, v_tangential, j, element, elements, shape)
                if place >= 0:
                    v_normal = max(v_normal, LEAST_NORMAL)
                    section = blade_section(v_normal, v_tangential, turned, j, 1.0, elements)
                    induced[i, j, place, 0] = section.induced_normal
                    induced[i, j, place, 1] = section.induced_tangential


@kernel
def _fill_moment(load, weight, v_normal, v_tangential, j, element, elements, shape):
    """Put the pitching moment into load[2]; nothing of straight blades."""
    if shape is None:
        return
    load[2] = weight * pitching_moment(v_normal, v_tangential, j, element, shape, elements.polars)


_tables = Cache(8)  # two per blade, 37 MB together: building takes about a second


def build_dynamic_sections(elements, wake):
    """DynamicSections of a BladeElements and a DynamicInflow; the same blade shares its tables in any air.

    19 stations: 37 MB, 1 s compiled; without the compiler many minutes (use rotor_load there).
    """
    unit = elements._replace(air_density=1.0)
    induced, load = _tables.get(elements_key(unit), lambda: _filled_tables(unit))
    arm = np.ascontiguousarray(elements.moment_weight / elements.weight, dtype=np.float64)
    lags = np.array([time_constants(0.0, 1.0, r, elements.tip_radius, wake) for r in elements.radius])
    return DynamicSections(induced, load, arm, lags[:, 0] / lags[:, 1], elements, wake)


def _filled_tables(elements):
    """(induced, load) of DynamicSections."""
    blade_pitch = table_pitches()
    stations, directions = (len(blade_pitch), len(elements.radius)), AHEAD + BEHIND + 1
    induced = np.zeros((*stations, directions, 2), dtype=np.float32)
    parts = 2 if elements.shape is None else 3
    load = np.zeros((*stations, REVERSED + directions, parts), dtype=np.float32)
    _fill(induced, load, blade_pitch, elements, elements.shape)
    return induced, load


@inlined_kernel
def _rows(row, rotor):
    """Rows of a place among the rows of the tables."""
    i = int(row)
    return Rows(rotor.induced[i], rotor.induced[i + 1], rotor.load[i], rotor.load[i + 1], row - i)


@inlined_kernel
def _cell(v_normal, v_tangential, scale, total, first, fraction):
    """Cell of a direction in a table whose direction within the rotor plane is at first.

    scale: of the weights; total: |v_normal| + |v_tangential|. Any input is safe.
    """
    ahead = AHEAD * v_normal
    place = (ahead if v_tangential >= 0.0 else AHEAD * total - BEHIND * v_tangential) / total + first
    inside = place >= 0.0 and (v_normal > 0.0 or v_tangential > 0.0)
    place = place if place > 0.0 else 0.0  # not a number too
    k = min(int(place), first + AHEAD + BEHIND - 1)
    part = place - k
    return Cell(
        k,
        scale * (1.0 - fraction) * (1.0 - part),
        scale * (1.0 - fraction) * part,
        scale * fraction * (1.0 - part),
        scale * fraction * part,
        inside,
    )


@inlined_kernel
def _looked_up(cell, j, part, low, high):
    """A part of what the table has at a Cell of station j."""
    k = cell.k
    return (
        cell.a * low[j, k, part]
        + cell.b * low[j, k + 1, part]
        + cell.c * high[j, k, part]
        + cell.d * high[j, k + 1, part]
    )


@inlined_kernel
def _flow(v_normal, v_tangential, i, j, rows, rate, x, dx, rotor):
    """Flow at station j in this wind with the wake states from i on, whose rates go into dx.

    rate: 1/tau_1 without induction, 1/s. The filter is that of wake.filtered_induction.
    """
    total = abs(v_normal) + abs(v_tangential)
    cell = _cell(v_normal, v_tangential, total, total, 0, rows.fraction)
    steady_normal = _looked_up(cell, j, 0, rows.low_induced, rows.high_induced)
    steady_tangential = _looked_up(cell, j, 1, rows.low_induced, rows.high_induced)
    slow = rate * pace(-steady_normal / v_normal)
    fast = slow * rotor.ratio[j]
    normal, tangential = x[i + 1], x[i + 3]
    dx[i] = (0.4 * steady_normal - x[i]) * slow
    dx[i + 1] = (x[i] + 0.6 * steady_normal - normal) * fast
    dx[i + 2] = (0.4 * steady_tangential - x[i + 2]) * slow
    dx[i + 3] = (x[i + 2] + 0.6 * steady_tangential - tangential) * fast
    return Flow(v_normal + normal, v_tangential + tangential, v_normal > 0.0 and total < LARGEST_SPEED)


@inlined_kernel
def _load_cell(flow, rows):
    """Cell of a Flow in the table of loads."""
    total = abs(flow.normal) + abs(flow.tangential)
    return _cell(flow.normal, flow.tangential, total * total, total, REVERSED, rows.fraction)


@inlined_kernel
def _with_straight(force, v_normal, v_tangential, i, j, rows, rate, x, dx, rotor):
    """The CurvedForce of a straight blade with station j in this wind, wake states from i on."""
    flow = _flow(v_normal, v_tangential, i, j, rows, rate, x, dx, rotor)
    cell = _load_cell(flow, rows)
    fn = _looked_up(cell, j, 0, rows.low_load, rows.high_load)
    ft = _looked_up(cell, j, 1, rows.low_load, rows.high_load)
    load, arm = force.load, rotor.arm[j]
    return CurvedForce(
        BladeLoad(load.fx + fn, 0.0, load.ft + ft, load.mx + arm * ft, 0.0, load.mt - arm * fn),
        force.outside + (0 if flow.inside and cell.inside else 1),
    )


@inlined_kernel
def _with_curved(force, v_normal, v_tangential, i, j, lever, rows, rate, x, dx, rotor):
    """As _with_straight of a curved blade."""
    flow = _flow(v_normal, v_tangential, i, j, rows, rate, x, dx, rotor)
    cell = _load_cell(flow, rows)
    fn = _looked_up(cell, j, 0, rows.low_load, rows.high_load)
    ft = _looked_up(cell, j, 1, rows.low_load, rows.high_load)
    moment = _looked_up(cell, j, 2, rows.low_load, rows.high_load)
    load = with_station(force.load, fn, ft, moment, lever)
    return CurvedForce(load, force.outside + (0 if flow.inside and cell.inside else 1))


@kernel
def _straight_sheared(
    start, psi, pose, hub, now, series, profile, blade_pitch, rows, rate, x, dx, rotor, shape
):
    """CurvedForce of a straight blade in a sheared wind: v = v0 + v1 radius + v2 profile."""
    blade, radii = _blade(psi, x[State.ROTOR_SPEED], pose, hub), rotor.elements.radius
    height, left = hub.Z - series.reference_height, hub.Y
    linear = (now.vertical_shear * height + now.horizontal_shear * left) / series.reference_length
    slope = (now.vertical_shear * blade.rz + now.horizontal_shear * blade.ry) / series.reference_length
    n0 = pose.r11 * linear + pose.r31 * now.w - hub.vx
    n1 = pose.r11 * slope - blade.normal_rate
    n2 = profile.scale * (pose.r11 * now.u + pose.r21 * now.v)
    t0 = blade.tangential - blade.tx * linear - blade.tz * now.w
    t1 = blade.spin - blade.tx * slope
    t2 = -profile.scale * (blade.tx * now.u + blade.ty * now.v)
    z0, z1 = hub.Z / profile.centre - 1.0, blade.rz / profile.centre
    force = NO_CURVED_FORCE
    for j in range(radii.shape[0]):
        radius = radii[j]
        shear = _shear(z0 + z1 * radius, profile)
        v_normal, v_tangential = n0 + n1 * radius + n2 * shear, t0 + t1 * radius + t2 * shear
        i = start + PER_ELEMENT * j
        force = _with_straight(force, v_normal, v_tangential, i, j, rows, rate, x, dx, rotor)
    return force


@kernel
def _curved_sheared(
    start, psi, pose, hub, now, series, profile, blade_pitch, rows, rate, x, dx, rotor, shape
):
    """CurvedForce of a curved blade in a sheared wind."""
    blade = blade_wind(-sin(psi), cos(psi), x[State.ROTOR_SPEED], pose, hub)
    wind = _sheared_flow(pose, hub, blade, now, series, profile)
    cosine, sine = cos(blade_pitch), sin(blade_pitch)
    force = NO_CURVED_FORCE
    for j in range(shape.distance.shape[0]):
        at, lever = station_at(j, cosine, sine, shape), lever_of(j, cosine, sine, shape)
        shear = _shear(_at(wind.height, at), profile)
        along = _at(wind.flow_x, at) + shear * wind.scaled_x
        out = _at(wind.flow_r, at) + shear * wind.scaled_r
        v_normal = at.nx * along + at.nr * out
        v_tangential = -_at(wind.flow_t, at) - shear * wind.scaled_t
        i = start + PER_ELEMENT * j
        force = _with_curved(force, v_normal, v_tangential, i, j, lever, rows, rate, x, dx, rotor)
    return force


@kernel
def _straight_sampled(
    start, psi, t, pose, hub, now, series, field, blade_pitch, rows, rate, x, dx, rotor, shape
):
    """CurvedForce of a straight blade, the wind sampled station by station."""
    blade, radii = _blade(psi, x[State.ROTOR_SPEED], pose, hub), rotor.elements.radius
    force = NO_CURVED_FORCE
    for j in range(radii.shape[0]):
        radius = radii[j]
        u, v, w = wind_at(
            t,
            hub.X + radius * blade.rx,
            hub.Y + radius * blade.ry,
            hub.Z + radius * blade.rz,
            now,
            series,
            field,
        )
        v_normal = pose.r11 * u + pose.r21 * v + pose.r31 * w - hub.vx - radius * blade.normal_rate
        v_tangential = blade.tangential + radius * blade.spin - (blade.tx * u + blade.ty * v + blade.tz * w)
        i = start + PER_ELEMENT * j
        force = _with_straight(force, v_normal, v_tangential, i, j, rows, rate, x, dx, rotor)
    return force


@kernel
def _curved_sampled(
    start, psi, t, pose, hub, now, series, field, blade_pitch, rows, rate, x, dx, rotor, shape
):
    """CurvedForce of a curved blade, the wind sampled station by station."""
    blade = blade_wind(-sin(psi), cos(psi), x[State.ROTOR_SPEED], pose, hub)
    cosine, sine = cos(blade_pitch), sin(blade_pitch)
    force = NO_CURVED_FORCE
    for j in range(shape.distance.shape[0]):
        at, lever = station_at(j, cosine, sine, shape), lever_of(j, cosine, sine, shape)
        u, v, w = wind_at(
            t,
            hub.X + at.x * pose.r11 + at.r * blade.rx + at.t * blade.tx,
            hub.Y + at.x * pose.r21 + at.r * blade.ry + at.t * blade.ty,
            hub.Z + at.x * pose.r31 + at.r * blade.rz + at.t * blade.tz,
            now,
            series,
            field,
        )
        v_normal, v_tangential = station_inflow(u, v, w, at, pose, blade)
        i = start + PER_ELEMENT * j
        force = _with_curved(force, v_normal, v_tangential, i, j, lever, rows, rate, x, dx, rotor)
    return force


# blades straight and in the rotor plane, or curved ones
_sheared_blade = chosen_by_class("shape", {type(None): _straight_sheared, BladeShape: _curved_sheared})
_sampled_blade = chosen_by_class("shape", {type(None): _straight_sampled, BladeShape: _curved_sampled})


@kernel
def _reach(tip_radius, shape):
    """Largest distance of a station from the rotor centre, m."""
    if shape is None:
        return tip_radius
    return shape.reach


@kernel
def _tabled_load(t, pose, x, now, series, field, rotor, hub, first_row, dx, pitches, blades):
    """(stations outside the tables, RotorLoad) of a fast rotor whose blade pitches lie within them."""
    elements = rotor.elements
    reach = _reach(elements.tip_radius, elements.shape)
    bottom, top = hub.Z - reach, hub.Z + reach
    sheared = field is None and bottom > LOWEST_HEIGHT and top < LARGEST_RATIO * bottom
    if sheared:
        profile = _profile(bottom, top, series)
    else:
        profile = _profile(1.0, 1.0, series)
    rate = 1.0 / time_constants(0.0, hub.speed, 0.0, elements.tip_radius, rotor.wake)[0]
    total, outside = NO_LOAD, 0
    for number in range(elements.blades):
        psi = x[State.AZIMUTH] + 2.0 * pi * number / elements.blades
        start = State.INTERNAL + PER_ELEMENT * number * elements.radius.shape[0]
        rows, blade_pitch = (
            _rows(_blade_row(number, first_row, x, pitches), rotor),
            pitch_of(number, x, pitches),
        )
        if sheared:
            force = _sheared_blade(
                start, psi, pose, hub, now, series, profile, blade_pitch, rows, rate, x, dx, rotor,
                elements.shape,
            )  # fmt: skip
        else:
            force = _sampled_blade(
                start, psi, t, pose, hub, now, series, field, blade_pitch, rows, rate, x, dx, rotor,
                elements.shape,
            )  # fmt: skip
        store_blade_load(number, force.load, elements.air_density, pitches, blades)
        total = with_blade(total, force.load, Direction(-sin(psi), cos(psi)))
        outside += force.outside
    return outside, rotor_axes_load(total, elements.air_density, elements)


@kernel
def dynamic_sections_load(t, pose, x, now, series, field, rotor, dx, counters, pitches, blades):
    """RotorLoad of the state x at time t with its wake states, in rotor axes. No rotor or no wind: zero.

    pose                in rotor axes (tilt.py)
    now, series, field  wind (weather/wind.py); every station has the wind of where it is at this instant
    dx                  derivative of the state: only the wake states are written
    counters            as in rotor_load, to which all is left where a station lies outside the tables
    pitches, blades     as in rotor_load
    """
    if rotor is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    elements = rotor.elements
    hub = hub_flow(t, pose, now, series, field, elements.overhang, elements.hub_height)
    spin, first_row = x[State.ROTOR_SPEED] * elements.tip_radius, _pitch_row(x[State.BLADE_PITCH])
    induction = smoothstep(spin, SLOW_ROTOR * hub.speed, FAST_ROTOR * hub.speed)
    if induction == 1.0 and _all_rows(first_row, x, pitches):
        outside, load = _tabled_load(
            t, pose, x, now, series, field, rotor, hub, first_row, dx, pitches, blades
        )
        if outside == 0:
            return load
    return rotor_load(
        t, pose, x, now, series, field, elements, None, rotor.wake, dx, counters, pitches, blades
    )


@kernel
def dynamic_sections_equilibrium(t, pose, x, now, series, field, rotor, dx, counters, pitches, blades):
    """As wake_equilibrium for the wake states of DynamicSections."""
    if rotor is None:
        return 0
    if series is None:
        return 0
    count = PER_ELEMENT * rotor.elements.blades * rotor.elements.radius.shape[0]
    for i in range(State.INTERNAL, State.INTERNAL + count):
        x[i] = 0.0
    dynamic_sections_load(t, pose, x, now, series, field, rotor, dx, counters, pitches, blades)
    for i in range(State.INTERNAL, State.INTERNAL + count, 2):
        x[i + 1] = dx[i]
        x[i] = 1.0
    dynamic_sections_load(t, pose, x, now, series, field, rotor, dx, counters, pitches, blades)
    for i in range(State.INTERNAL, State.INTERNAL + count, 2):
        x[i] = x[i + 1] / (x[i + 1] - dx[i])
        x[i + 1] = x[i] / 0.4
        dx[i] = dx[i + 1] = 0.0
    return count
