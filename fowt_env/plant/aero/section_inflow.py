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
LEAST_LAG = 1e-6  # s, of a wake without a least one
THIRD = 2.0 * pi / 3.0  # of a turn, rad


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

    cosine: float  # of the blade pitch
    sine: float
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
    """The cell of a direction, its weights in the low and the high row."""

    k: int
    a: float
    b: float
    c: float
    d: float


class Rate(NamedTuple):
    """How fast the wake follows, 1/s."""

    slow: float  # 1/tau_1 without induction
    most: float  # of both filters


class Flow(NamedTuple):
    """Flow at a station with its wake."""

    normal: float  # m/s
    tangential: float
    rate_0: float  # of the four wake states, m/s2
    rate_1: float
    rate_2: float
    rate_3: float
    outside: int  # 1 where the tables do not know it, else 0


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
    free = wake._replace(least=0.0)
    lags = np.array([time_constants(0.0, 1.0, r, elements.tip_radius, free) for r in elements.radius])
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
def _rows(blade_pitch, rotor):
    """Rows of a blade pitch (rad) within the table."""
    row = _pitch_row(blade_pitch)
    i = int(row)
    return Rows(
        cos(blade_pitch), sin(blade_pitch), rotor.induced[i], rotor.induced[i + 1], rotor.load[i],
        rotor.load[i + 1], row - i,
    )  # fmt: skip


@inlined_kernel
def _blade_rows(blade, first, x, rotor, pitches):
    """Rows of a blade; first: those of the first one."""
    if pitches is None:
        return first
    return _rows(pitch_of(blade, x, pitches), rotor)


@inlined_kernel
def _cell(v_normal, v_tangential, scale, total, first, fraction):
    """Cell of a direction in a table whose direction within the rotor plane is at first.

    scale: of the weights; total: |v_normal| + |v_tangential|. Any input is safe.
    """
    ahead = AHEAD * v_normal
    place = (ahead if v_tangential >= 0.0 else AHEAD * total - BEHIND * v_tangential) / total + first
    place = place if place > 0.0 else 0.0  # not a number too
    k = min(int(place), first + AHEAD + BEHIND - 1)
    part = place - k
    return Cell(
        np.uintp(k),  # indices without sign are not tested for counting from the end
        scale * (1.0 - fraction) * (1.0 - part),
        scale * (1.0 - fraction) * part,
        scale * fraction * (1.0 - part),
        scale * fraction * part,
    )


@inlined_kernel
def _looked_up(cell, j, part, low, high):
    """A part of what the table has at a Cell of station j."""
    k = cell.k
    after = k + np.uintp(1)
    return (
        cell.a * low[j, k, part]
        + cell.b * low[j, after, part]
        + cell.c * high[j, k, part]
        + cell.d * high[j, after, part]
    )


@inlined_kernel
def _flow(v_normal, v_tangential, i, j, rows, rate, x, rotor):
    """Flow at station j in this wind with the wake states from i on.

    The filter is that of wake.filtered_induction.
    """
    total = abs(v_normal) + abs(v_tangential)
    cell = _cell(v_normal, v_tangential, total, total, 0, rows.fraction)
    steady_normal = _looked_up(cell, j, 0, rows.low_induced, rows.high_induced)
    steady_tangential = _looked_up(cell, j, 1, rows.low_induced, rows.high_induced)
    slow = pace(-steady_normal / v_normal) * rate.slow
    fast = min(slow * rotor.ratio[j], rate.most)
    slow = min(slow, rate.most)
    a, b, c, d = np.uintp(i), np.uintp(i + 1), np.uintp(i + 2), np.uintp(i + 3)
    first_normal, normal, first_tangential, tangential = x[a], x[b], x[c], x[d]
    known = v_normal + normal > 0.0 or REVERSED * v_tangential >= -AHEAD * (v_normal + normal)
    return Flow(
        v_normal + normal,
        v_tangential + tangential,
        (0.4 * steady_normal - first_normal) * slow,
        (first_normal + 0.6 * steady_normal - normal) * fast,
        (0.4 * steady_tangential - first_tangential) * slow,
        (first_tangential + 0.6 * steady_tangential - tangential) * fast,
        0 if v_normal > 0.0 and total < LARGEST_SPEED and known else 1,
    )


@inlined_kernel
def _put_rates(flow, i, dx):
    """Put the rates of a Flow into dx, from state i on."""
    dx[np.uintp(i)], dx[np.uintp(i + 1)] = flow.rate_0, flow.rate_1
    dx[np.uintp(i + 2)], dx[np.uintp(i + 3)] = flow.rate_2, flow.rate_3


@inlined_kernel
def _load_cell(flow, rows):
    """Cell of a Flow in the table of loads."""
    total = abs(flow.normal) + abs(flow.tangential)
    return _cell(flow.normal, flow.tangential, total * total, total, REVERSED, rows.fraction)


@inlined_kernel
def _with_straight(force, flow, j, rows, rotor):
    """The CurvedForce of a straight blade with station j in this Flow."""
    cell = _load_cell(flow, rows)
    fn = _looked_up(cell, j, 0, rows.low_load, rows.high_load)
    ft = _looked_up(cell, j, 1, rows.low_load, rows.high_load)
    load, arm = force.load, rotor.arm[j]
    return CurvedForce(
        BladeLoad(load.fx + fn, 0.0, load.ft + ft, load.mx + arm * ft, 0.0, load.mt - arm * fn),
        force.outside + flow.outside,
    )


@inlined_kernel
def _with_curved(force, flow, j, lever, rows):
    """The CurvedForce of a curved blade with station j in this Flow."""
    cell = _load_cell(flow, rows)
    fn = _looked_up(cell, j, 0, rows.low_load, rows.high_load)
    ft = _looked_up(cell, j, 1, rows.low_load, rows.high_load)
    moment = _looked_up(cell, j, 2, rows.low_load, rows.high_load)
    load = with_station(force.load, fn, ft, moment, lever)
    return CurvedForce(load, force.outside + flow.outside)


class StraightWind(NamedTuple):
    """Wind relative to a straight blade in a sheared wind: v0 + v1 radius + v2 profile(z0 + z1 radius)."""

    n0: float  # normal
    n1: float
    n2: float
    t0: float  # tangential
    t1: float
    t2: float
    z0: float
    z1: float


@inlined_kernel
def _straight_wind(psi, pose, hub, x, now, series, profile):
    """StraightWind of the blade at azimuth psi."""
    blade = _blade(psi, x[State.ROTOR_SPEED], pose, hub)
    height, left = hub.Z - series.reference_height, hub.Y
    linear = (now.vertical_shear * height + now.horizontal_shear * left) / series.reference_length
    slope = (now.vertical_shear * blade.rz + now.horizontal_shear * blade.ry) / series.reference_length
    return StraightWind(
        pose.r11 * linear + pose.r31 * now.w - hub.vx,
        pose.r11 * slope - blade.normal_rate,
        profile.scale * (pose.r11 * now.u + pose.r21 * now.v),
        blade.tangential - blade.tx * linear - blade.tz * now.w,
        blade.spin - blade.tx * slope,
        -profile.scale * (blade.tx * now.u + blade.ty * now.v),
        hub.Z / profile.centre - 1.0,
        blade.rz / profile.centre,
    )


@inlined_kernel
def _straight_inflow(wind, radius, profile):
    """(v_normal, v_tangential) m/s of a station in a sheared wind."""
    shear = _shear(wind.z0 + wind.z1 * radius, profile)
    return wind.n0 + wind.n1 * radius + wind.n2 * shear, wind.t0 + wind.t1 * radius + wind.t2 * shear


@inlined_kernel
def _straight_sheared(azimuth, pose, hub, now, series, profile, rows, rate, x, dx, rotor, shape):
    """CurvedForce of each of three straight blades in a sheared wind; rows: Rows of each.

    A station of all three at a time, and rates put away last, keep the processor busier than one by one.
    """
    first = _straight_wind(azimuth, pose, hub, x, now, series, profile)
    second = _straight_wind(azimuth + THIRD, pose, hub, x, now, series, profile)
    third = _straight_wind(azimuth + 2.0 * THIRD, pose, hub, x, now, series, profile)
    a = b = c = NO_CURVED_FORCE
    n = rotor.elements.radius.shape[0]
    for j in range(n):
        radius = rotor.elements.radius[j]
        i = State.INTERNAL + PER_ELEMENT * j
        k, m = i + PER_ELEMENT * n, i + 2 * PER_ELEMENT * n
        un, ut = _straight_inflow(first, radius, profile)
        vn, vt = _straight_inflow(second, radius, profile)
        wn, wt = _straight_inflow(third, radius, profile)
        p = _flow(un, ut, i, j, rows[0], rate, x, rotor)
        q = _flow(vn, vt, k, j, rows[1], rate, x, rotor)
        r = _flow(wn, wt, m, j, rows[2], rate, x, rotor)
        a = _with_straight(a, p, j, rows[0], rotor)
        b = _with_straight(b, q, j, rows[1], rotor)
        c = _with_straight(c, r, j, rows[2], rotor)
        _put_rates(p, i, dx)
        _put_rates(q, k, dx)
        _put_rates(r, m, dx)
    return a, b, c


@inlined_kernel
def _curved_wind(psi, pose, hub, x, now, series, profile):
    """ShearedFlow of the blade at azimuth psi."""
    blade = blade_wind(-sin(psi), cos(psi), x[State.ROTOR_SPEED], pose, hub)
    return _sheared_flow(pose, hub, blade, now, series, profile)


@inlined_kernel
def _curved_inflow(wind, at, profile):
    """(v_normal, v_tangential) m/s of a Station in a sheared wind."""
    shear = _shear(_at(wind.height, at), profile)
    along = _at(wind.flow_x, at) + shear * wind.scaled_x
    out = _at(wind.flow_r, at) + shear * wind.scaled_r
    return at.nx * along + at.nr * out, -_at(wind.flow_t, at) - shear * wind.scaled_t


@inlined_kernel
def _curved_sheared(azimuth, pose, hub, now, series, profile, rows, rate, x, dx, rotor, shape):
    """As _straight_sheared of curved blades."""
    first = _curved_wind(azimuth, pose, hub, x, now, series, profile)
    second = _curved_wind(azimuth + THIRD, pose, hub, x, now, series, profile)
    third = _curved_wind(azimuth + 2.0 * THIRD, pose, hub, x, now, series, profile)
    a = b = c = NO_CURVED_FORCE
    n = rotor.elements.radius.shape[0]
    for j in range(n):
        i = State.INTERNAL + PER_ELEMENT * j
        k, m = i + PER_ELEMENT * n, i + 2 * PER_ELEMENT * n
        u, v, w = rows[0], rows[1], rows[2]
        un, ut = _curved_inflow(first, station_at(j, u.cosine, u.sine, shape), profile)
        vn, vt = _curved_inflow(second, station_at(j, v.cosine, v.sine, shape), profile)
        wn, wt = _curved_inflow(third, station_at(j, w.cosine, w.sine, shape), profile)
        p = _flow(un, ut, i, j, u, rate, x, rotor)
        q = _flow(vn, vt, k, j, v, rate, x, rotor)
        r = _flow(wn, wt, m, j, w, rate, x, rotor)
        a = _with_curved(a, p, j, lever_of(j, u.cosine, u.sine, shape), u)
        b = _with_curved(b, q, j, lever_of(j, v.cosine, v.sine, shape), v)
        c = _with_curved(c, r, j, lever_of(j, w.cosine, w.sine, shape), w)
        _put_rates(p, i, dx)
        _put_rates(q, k, dx)
        _put_rates(r, m, dx)
    return a, b, c


@kernel
def _straight_sampled(start, psi, t, pose, hub, now, series, field, rows, rate, x, dx, rotor, shape):
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
        flow = _flow(v_normal, v_tangential, i, j, rows, rate, x, rotor)
        force = _with_straight(force, flow, j, rows, rotor)
        _put_rates(flow, i, dx)
    return force


@kernel
def _curved_sampled(start, psi, t, pose, hub, now, series, field, rows, rate, x, dx, rotor, shape):
    """CurvedForce of a curved blade, the wind sampled station by station."""
    blade = blade_wind(-sin(psi), cos(psi), x[State.ROTOR_SPEED], pose, hub)
    force = NO_CURVED_FORCE
    for j in range(shape.distance.shape[0]):
        at, lever = station_at(j, rows.cosine, rows.sine, shape), lever_of(j, rows.cosine, rows.sine, shape)
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
        flow = _flow(v_normal, v_tangential, i, j, rows, rate, x, rotor)
        force = _with_curved(force, flow, j, lever, rows)
        _put_rates(flow, i, dx)
    return force


# blades straight and in the rotor plane, or curved ones
_sheared_blades = chosen_by_class(
    "shape", {type(None): _straight_sheared, BladeShape: _curved_sheared}, inlined=True
)
_sampled_blade = chosen_by_class("shape", {type(None): _straight_sampled, BladeShape: _curved_sampled})


@kernel
def _direction(psi):
    """Direction of a blade at azimuth psi."""
    return Direction(-sin(psi), cos(psi))


@kernel
def _reach(tip_radius, shape):
    """Largest distance of a station from the rotor centre, m."""
    if shape is None:
        return tip_radius
    return shape.reach


@kernel
def _tabled_load(t, pose, x, now, series, field, rotor, hub, dx, pitches, blades):
    """(stations outside the tables, RotorLoad) of a fast rotor of three blades at pitches within them."""
    elements = rotor.elements
    reach = _reach(elements.tip_radius, elements.shape)
    bottom, top = hub.Z - reach, hub.Z + reach
    sheared = field is None and bottom > LOWEST_HEIGHT and top < LARGEST_RATIO * bottom
    if sheared:
        profile = _profile(bottom, top, series)
    else:
        profile = _profile(1.0, 1.0, series)
    wake = DynamicInflow(rotor.wake.scale, 0.0)
    slow, _ = time_constants(0.0, hub.speed, 0.0, elements.tip_radius, wake)
    rate = Rate(1.0 / slow, 1.0 / max(rotor.wake.least, LEAST_LAG))
    azimuth, shape = x[State.AZIMUTH], elements.shape
    low = _rows(x[State.BLADE_PITCH], rotor)
    rows = low, _blade_rows(1, low, x, rotor, pitches), _blade_rows(2, low, x, rotor, pitches)
    if sheared:
        a, b, c = _sheared_blades(azimuth, pose, hub, now, series, profile, rows, rate, x, dx, rotor, shape)
    else:
        n = PER_ELEMENT * elements.radius.shape[0]
        a = _sampled_blade(
            State.INTERNAL, azimuth, t, pose, hub, now, series, field, rows[0], rate, x, dx, rotor, shape
        )
        b = _sampled_blade(
            State.INTERNAL + n, azimuth + THIRD, t, pose, hub, now, series, field, rows[1], rate, x, dx,
            rotor, shape,
        )  # fmt: skip
        c = _sampled_blade(
            State.INTERNAL + 2 * n, azimuth + 2.0 * THIRD, t, pose, hub, now, series, field, rows[2], rate,
            x, dx, rotor, shape,
        )  # fmt: skip
    store_blade_load(0, a.load, elements.air_density, pitches, blades)
    store_blade_load(1, b.load, elements.air_density, pitches, blades)
    store_blade_load(2, c.load, elements.air_density, pitches, blades)
    total = with_blade(NO_LOAD, a.load, _direction(azimuth))
    total = with_blade(total, b.load, _direction(azimuth + THIRD))
    total = with_blade(total, c.load, _direction(azimuth + 2.0 * THIRD))
    return a.outside + b.outside + c.outside, rotor_axes_load(total, elements.air_density, elements)


@kernel
def dynamic_sections_load(t, pose, x, now, series, field, rotor, dx, counters, pitches, blades):
    """RotorLoad of the state x at time t with its wake states, in rotor axes. No rotor or no wind: zero.

    pose                in rotor axes (tilt.py)
    now, series, field  wind (weather/wind.py); every station has the wind of where it is at this instant
    dx                  derivative of the state: only the wake states are written
    counters            as in rotor_load, to which all is left of other than three blades, or
                        where a station lies outside the tables
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
    if elements.blades == 3 and induction == 1.0 and _all_rows(first_row, x, pitches):
        outside, load = _tabled_load(t, pose, x, now, series, field, rotor, hub, dx, pitches, blades)
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
