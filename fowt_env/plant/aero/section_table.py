"""Rotor loads from a table per blade station: every blade, station and wind sample, without iteration.

Quasi-steady blade element momentum is local (blade_elements.py): the load of a station over the square
of its inflow depends on the direction of the inflow and on the blade pitch alone. Both components are
tabulated once per blade from the kernels there, and interpolated linearly in both. Geometry, wind sampling,
integration and outputs are those of rotor_load.

The table spans the inflows from upwind (v_normal > 0) at any v_tangential, and blade pitches from -5 to
90 deg. Elsewhere the exact solution is taken, so nothing is lost but time: station by station in
reversed flow, by rotor_load on a slow or parked rotor (where the induction fades out) and at other blade
pitches. Where the exact load jumps from one root of the momentum balance to another (deep stall), and
where it fades within a few hundredths of an angle (a root in nearly axial flow), the table smooths it
over one cell.

The induction is not tabulated: dynamic inflow needs section_inflow.py, a skewed wake rotor_load.
"""

from math import cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.plant.aero.bem_rotor import (
    FAST_ROTOR,
    NO_ROTOR_LOAD,
    SLOW_ROTOR,
    RotorLoad,
    hub_flow,
    rotor_axes_load,
    rotor_load,
    store_blade_load,
)
from fowt_env.plant.aero.blade_elements import (
    LARGEST_SPEED,
    BladeElements,
    blade_section,
    element_of,
    elements_key,
    pitching_moment,
    smoothstep,
)
from fowt_env.plant.aero.blade_shape import (
    NO_BLADE_LOAD,
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
from fowt_env.plant.aero.wind import LOWEST_HEIGHT, wind_at
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.prefetch import prefetch
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.events import Counter
from fowt_env.plant.state import BLADES, NO_LOAD, State, Wrench

# Directions: v_normal/(v_normal + |v_tangential|) in AHEAD cells, from the rotor plane to the shaft (where
# this has a kink), then on in BEHIND cells to an inflow in the plane from behind (roots in cross wind).
# Halving the cells of both variables divides the error by three, at four times the memory.
AHEAD, BEHIND = 512, 64
DENSE_START, DENSE_END, DENSE_ROWS = -5.0, 30.0, 140  # deg, blade pitches where turbines operate
COARSE_END, COARSE_ROWS = 90.0, 60  # deg, on to feather
HALF_ROOT_3 = sqrt(0.75)  # cosine and sine of a third of a turn are -1/2 and this
LEAST_NORMAL = 1e-9  # v_normal of the first direction: the limit from upwind, as the load jumps at zero
LARGEST_RATIO = 12.0  # highest over lowest point of the rotor, else wind_at: see _profile


class SectionTable(NamedTuple):
    """Loads of the n stations of a blade over blade pitch and inflow direction."""

    load: np.ndarray  # (blade pitches, n, directions, 2, or 3 of curved blades) float32; see _fill
    radius: np.ndarray  # (n,) m
    arm: np.ndarray  # (n,) m, radius at which the station's part of the blade's force acts
    elements: BladeElements  # of the exact solution


class Profile(NamedTuple):
    """Power law over the height as scale P(z)/Q(z), z = height/centre - 1."""

    centre: float  # m
    scale: float  # power law at the centre
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    q1: float
    q2: float
    q3: float
    q4: float
    q5: float


class BladeMotion(NamedTuple):
    """Directions of a blade and the motion along it. e_r = (0, ey, ez) outwards, e_t = (0, -ez, ey)."""

    ey: float
    ez: float
    rx: float  # e_r in inertial components
    ry: float
    rz: float
    tx: float  # -e_t in inertial components
    ty: float
    tz: float
    normal_rate: float  # velocity along the shaft per radius, 1/s
    spin: float  # in-plane velocity per radius, 1/s
    tangential: float  # part of v_tangential from the motion of the hub, m/s


class BladeForce(NamedTuple):
    """Sums over a blade over the air density: forces normal and tangential, and their moments."""

    force_n: float
    force_t: float
    moment_n: float
    moment_t: float
    valid: bool  # False: some station lies outside the table


@entry
def _fill(load, blade_pitch, elements):
    """Put into load each station's part of the blade's force, normal and tangential, over the air density
    and the square of v_normal + |v_tangential|."""
    for i in range(load.shape[0]):
        for j in range(load.shape[1]):
            weight = elements.weight[j] / elements.air_density
            for k in range(load.shape[2]):
                v_tangential = 1.0 - k / AHEAD if k <= AHEAD else -(k - AHEAD) / BEHIND
                v_normal = max(1.0 - abs(v_tangential), LEAST_NORMAL)
                section = blade_section(v_normal, v_tangential, blade_pitch[i], j, 1.0, elements)
                load[i, j, k, 0] = weight * section.fn
                load[i, j, k, 1] = weight * section.ft


@entry
def _fill_curved(load, blade_pitch, elements, shape):
    """As _fill with the pitching moment as the third."""
    for i in range(load.shape[0]):
        for j in range(load.shape[1]):
            weight = elements.weight[j] / elements.air_density
            turned = effective_pitch(j, blade_pitch[i], shape)
            element = element_of(j, turned, elements)
            for k in range(load.shape[2]):
                v_tangential = 1.0 - k / AHEAD if k <= AHEAD else -(k - AHEAD) / BEHIND
                v_normal = max(1.0 - abs(v_tangential), LEAST_NORMAL)
                section = blade_section(v_normal, v_tangential, turned, j, 1.0, elements)
                moment = pitching_moment(
                    v_normal + section.induced_normal, v_tangential + section.induced_tangential, j, element,
                    shape, elements.polars,
                )  # fmt: skip
                load[i, j, k, 0] = weight * section.fn
                load[i, j, k, 1] = weight * section.ft
                load[i, j, k, 2] = weight * moment


_tables = Cache(8)  # one per blade, 18 MB each: building takes about a second


def build_section_table(elements):
    """SectionTable of a BladeElements; the same blade, in whatever air, gives the table built before.

    19 stations: 18 MB, 0.8 s compiled; without the compiler many minutes (use rotor_load there).
    """
    unit = elements._replace(air_density=1.0)
    key = elements_key(unit)
    load = _tables.get(key, lambda: _filled_table(unit))
    arm = np.ascontiguousarray(elements.moment_weight / elements.weight, dtype=np.float64)
    return SectionTable(load, elements.radius, arm, elements)


def table_pitches():
    """Blade pitches of the rows of a table, rad."""
    dense = np.linspace(DENSE_START, DENSE_END, DENSE_ROWS, endpoint=False)
    coarse = np.linspace(DENSE_END, COARSE_END, COARSE_ROWS + 1)
    return np.radians(np.concatenate((dense, coarse)))


def _filled_table(elements):
    """The loads of a SectionTable."""
    blade_pitch = table_pitches()
    size = (len(blade_pitch), len(elements.radius), AHEAD + BEHIND + 1)
    if elements.shape is None:
        load = np.zeros((*size, 2), dtype=np.float32)
        _fill(load, blade_pitch, elements)
    else:
        load = np.zeros((*size, 3), dtype=np.float32)
        _fill_curved(load, blade_pitch, elements, elements.shape)
    return load


@kernel
def _pitch_row(blade_pitch):
    """Place of a blade pitch (rad) among the rows of the table, in rows; -1 outside."""
    degrees = blade_pitch * (180.0 / pi)
    if DENSE_START <= degrees < DENSE_END:
        return (degrees - DENSE_START) * (DENSE_ROWS / (DENSE_END - DENSE_START))
    if DENSE_END <= degrees < COARSE_END:
        return DENSE_ROWS + (degrees - DENSE_END) * (COARSE_ROWS / (COARSE_END - DENSE_END))
    return -1.0


@kernel
def _blade_row(blade, first, x, pitches):
    """_pitch_row of a blade; first: that of the first one."""
    if pitches is None:
        return first
    return _pitch_row(pitch_of(blade, x, pitches))


@kernel
def _all_rows(first, x, pitches):
    """Whether every blade's pitch lies in the table; first: _pitch_row of the first one."""
    if pitches is None:
        return first >= 0.0
    inside = first >= 0.0
    for blade in range(1, BLADES):
        inside = inside and _pitch_row(pitch_of(blade, x, pitches)) >= 0.0
    return inside


@kernel
def _profile(low, high, series):
    """Profile for heights from low to high: the diagonal Pade approximant of order 5 of (1 + z)**exponent.

    Relative error 2 sin(pi exponent) ((r - 1)/(r + 1))**11 at the ends, r = (high/low)**(1/4): with an
    exponent of 0.14 it is 4e-8 from 27 to 153 m and 2e-6 at LARGEST_RATIO.
    """
    a = series.shear_exponent
    centre = sqrt(low * high)
    p1 = (5.0 + a) * (5.0 / 10.0)
    p2 = p1 * (4.0 + a) * (4.0 / 18.0)
    p3 = p2 * (3.0 + a) * (3.0 / 24.0)
    p4 = p3 * (2.0 + a) * (2.0 / 28.0)
    p5 = p4 * (1.0 + a) * (1.0 / 30.0)
    q1 = (5.0 - a) * (5.0 / 10.0)
    q2 = q1 * (4.0 - a) * (4.0 / 18.0)
    q3 = q2 * (3.0 - a) * (3.0 / 24.0)
    q4 = q3 * (2.0 - a) * (2.0 / 28.0)
    q5 = q4 * (1.0 - a) * (1.0 / 30.0)
    scale = (centre / series.reference_height) ** a
    return Profile(centre, scale, p1, p2, p3, p4, p5, q1, q2, q3, q4, q5)


@kernel
def _blade(psi, rotor_speed, pose, hub):
    """Blade at the azimuth psi."""
    ey, ez = -sin(psi), cos(psi)
    return BladeMotion(
        ey,
        ez,
        pose.r12 * ey + pose.r13 * ez,
        pose.r22 * ey + pose.r23 * ez,
        pose.r32 * ey + pose.r33 * ez,
        pose.r13 * ey - pose.r12 * ez,
        pose.r23 * ey - pose.r22 * ez,
        pose.r33 * ey - pose.r32 * ez,
        pose.wy * ez - pose.wz * ey,
        rotor_speed + pose.wx,
        hub.vz * ey - hub.vy * ez,
    )


@kernel
def _shear(z, profile):
    """(1 + z)**exponent."""
    upper = profile.p1 + z * (profile.p2 + z * (profile.p3 + z * (profile.p4 + z * profile.p5)))
    lower = profile.q1 + z * (profile.q2 + z * (profile.q3 + z * (profile.q4 + z * profile.q5)))
    return (1.0 + z * upper) / (1.0 + z * lower)


@kernel
def _station_force(v_normal, v_tangential, j, low, high, fraction):
    """(normal, tangential) force of station j over the air density, bilinear between two rows of the table.

    Any input is safe; it means something for v_normal > 0.
    """
    total = abs(v_normal) + abs(v_tangential)
    ahead = AHEAD * v_normal
    place = (ahead if v_tangential >= 0.0 else AHEAD * total - BEHIND * v_tangential) / total
    place = place if place > 0.0 else 0.0  # not a number too
    k = min(int(place), AHEAD + BEHIND - 1)
    part = place - k
    n0 = (1.0 - fraction) * float(low[j, k, 0]) + fraction * float(high[j, k, 0])
    t0 = (1.0 - fraction) * float(low[j, k, 1]) + fraction * float(high[j, k, 1])
    n1 = (1.0 - fraction) * float(low[j, k + 1, 0]) + fraction * float(high[j, k + 1, 0])
    t1 = (1.0 - fraction) * float(low[j, k + 1, 1]) + fraction * float(high[j, k + 1, 1])
    square = total * total
    return square * (n0 + part * (n1 - n0)), square * (t0 + part * (t1 - t0))


@kernel
def _sheared_force(pose, hub, blade, now, series, profile, low, high, fraction, radii, arm):
    """BladeForce in a wind uniform apart from its shears: v = v0 + v1 radius + v2 profile, no branches."""
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
    force_n = force_t = moment_n = moment_t = 0.0
    outside = 0
    for j in range(radii.shape[0]):
        radius = radii[j]
        shear = _shear(z0 + z1 * radius, profile)
        v_normal = n0 + n1 * radius + n2 * shear
        v_tangential = t0 + t1 * radius + t2 * shear
        outside += 0 if v_normal > 0.0 and v_normal + abs(v_tangential) < LARGEST_SPEED else 1
        fn, ft = _station_force(v_normal, v_tangential, j, low, high, fraction)
        force_n += fn
        force_t += ft
        moment_n += arm[j] * fn
        moment_t += arm[j] * ft
    return BladeForce(force_n, force_t, moment_n, moment_t, outside == 0)


@kernel
def _across(velocity, slice_now, row, column, component, p, q, r, d):
    """A component of the wind within a slice, from the corners of a cell with their weights."""
    above, beside = row + np.uintp(1), column + np.uintp(1)
    return (
        p * velocity[slice_now, row, column, component]
        + q * velocity[slice_now, row, beside, component]
        + r * velocity[slice_now, above, column, component]
        + d * velocity[slice_now, above, beside, component]
    )


@kernel
def _field_force(t, pose, hub, blade, field, low, high, fraction, radii, arm):
    """BladeForce in a box of wind, station by station without branches; not valid where the blade leaves the
    box or the table.

    Along a blade the place in the grid is linear in the radius, so that its ends tell whether all of it lies
    inside.
    """
    velocity = field.velocity
    s0 = (t + field.shift - hub.X * field.slowness) * field.rate
    if field.periodic:
        s0 = s0 % velocity.shape[0]
    s1 = -blade.rx * field.slowness * field.rate
    y0, y1 = (hub.Y - field.low_y) * field.inverse_dy, blade.ry * field.inverse_dy
    z0, z1 = (hub.Z - field.low_z) * field.inverse_dz, blade.rz * field.inverse_dz
    root, tip = radii[0], radii[radii.shape[0] - 1]
    inside = (
        min(s0 + s1 * root, s0 + s1 * tip) >= 0.0
        and max(s0 + s1 * root, s0 + s1 * tip) < velocity.shape[0] - 1.0
        and min(y0 + y1 * root, y0 + y1 * tip) >= 0.0
        and max(y0 + y1 * root, y0 + y1 * tip) < velocity.shape[2] - 1.0
        and min(z0 + z1 * root, z0 + z1 * tip) >= 0.0
        and max(z0 + z1 * root, z0 + z1 * tip) < velocity.shape[1] - 1.0
    )
    force_n = force_t = moment_n = moment_t = 0.0
    if not inside:
        return BladeForce(force_n, force_t, moment_n, moment_t, False)
    one = np.uintp(1)  # indices without sign are not tested for counting from the end
    outside = 0
    for j in range(radii.shape[0]):
        radius = radii[j]
        s, y, z = s0 + s1 * radius, y0 + y1 * radius, z0 + z1 * radius
        slice_now, row, column = np.uintp(s), np.uintp(z), np.uintp(y)
        late, up, left = s - float(slice_now), z - float(row), y - float(column)
        slice_next = slice_now + one
        # in a long box every new slice lies in memory that the processor does not expect to be read
        prefetch(velocity, slice_next + one, row, column)
        prefetch(velocity, slice_next + one, row + one, column)
        p, q = (1.0 - up) * (1.0 - left), (1.0 - up) * left
        r, d = up * (1.0 - left), up * left
        rest = 1.0 - late
        u = rest * _across(velocity, slice_now, row, column, 0, p, q, r, d)
        v = rest * _across(velocity, slice_now, row, column, 1, p, q, r, d)
        w = rest * _across(velocity, slice_now, row, column, 2, p, q, r, d)
        u += late * _across(velocity, slice_next, row, column, 0, p, q, r, d)
        v += late * _across(velocity, slice_next, row, column, 1, p, q, r, d)
        w += late * _across(velocity, slice_next, row, column, 2, p, q, r, d)
        v_normal = pose.r11 * u + pose.r21 * v + pose.r31 * w - hub.vx - radius * blade.normal_rate
        v_tangential = blade.tangential + radius * blade.spin - (blade.tx * u + blade.ty * v + blade.tz * w)
        outside += 0 if v_normal > 0.0 and v_normal + abs(v_tangential) < LARGEST_SPEED else 1
        fn, ft = _station_force(v_normal, v_tangential, j, low, high, fraction)
        force_n += fn
        force_t += ft
        moment_n += arm[j] * fn
        moment_t += arm[j] * ft
    return BladeForce(force_n, force_t, moment_n, moment_t, outside == 0)


@kernel
def _sampled_force(
    t, pose, hub, blade, now, series, field, blade_pitch, low, high, fraction, table, counters
):
    """BladeForce with the wind sampled station by station, and the exact solution outside the table."""
    elements = table.elements
    force_n = force_t = moment_n = moment_t = 0.0
    for j in range(table.radius.shape[0]):
        radius = table.radius[j]
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
        if v_normal > 0.0 and v_normal + abs(v_tangential) < LARGEST_SPEED:
            fn, ft = _station_force(v_normal, v_tangential, j, low, high, fraction)
        else:
            section = blade_section(v_normal, v_tangential, blade_pitch, j, 1.0, elements)
            if not section.solved:
                counters[Counter.BEM_FALLBACK] += 1.0
            # a blade without air has no load here either: the sums are multiplied by the density below
            weight = elements.weight[j] / elements.air_density if elements.air_density > 0.0 else 0.0
            fn, ft = weight * section.fn, weight * section.ft
        force_n += fn
        force_t += ft
        moment_n += table.arm[j] * fn
        moment_t += table.arm[j] * ft
    return BladeForce(force_n, force_t, moment_n, moment_t, True)


@inlined_kernel
def _straight_table_load(t, pose, x, now, series, field, table, shape, counters, pitches, blades):
    elements = table.elements
    hub = hub_flow(t, pose, now, series, field, elements.overhang, elements.hub_height)
    speed, azimuth = x[State.ROTOR_SPEED], x[State.AZIMUTH]
    induction = smoothstep(speed * elements.tip_radius, SLOW_ROTOR * hub.speed, FAST_ROTOR * hub.speed)
    first_row = _pitch_row(x[State.BLADE_PITCH])
    if not (induction == 1.0 and _all_rows(first_row, x, pitches)):
        return rotor_load(t, pose, x, now, series, field, elements, None, None, x, counters, pitches, blades)
    density = elements.air_density
    bottom, top = hub.Z - elements.tip_radius, hub.Z + elements.tip_radius
    sheared = field is None and bottom > LOWEST_HEIGHT and top < LARGEST_RATIO * bottom
    if sheared:
        profile = _profile(bottom, top, series)
    else:
        profile = _profile(1.0, 1.0, series)
    thrust = torque = fy = fz = my = mz = 0.0
    for number in range(elements.blades):
        row = _blade_row(number, first_row, x, pitches)
        i = int(row)
        fraction = row - i
        low, high = table.load[i], table.load[i + 1]
        blade = _blade(azimuth + 2.0 * pi * number / elements.blades, speed, pose, hub)
        force = BladeForce(0.0, 0.0, 0.0, 0.0, False)
        if sheared:
            force = _sheared_force(
                pose, hub, blade, now, series, profile, low, high, fraction, table.radius, table.arm
            )
        elif field is not None:
            force = _field_force(t, pose, hub, blade, field, low, high, fraction, table.radius, table.arm)
        if not force.valid:
            force = _sampled_force(
                t, pose, hub, blade, now, series, field, pitch_of(number, x, pitches), low, high, fraction,
                table, counters,
            )  # fmt: skip
        thrust += force.force_n
        torque += force.moment_t
        fy -= force.force_t * blade.ez
        fz += force.force_t * blade.ey
        my += force.moment_n * blade.ez  # e_r x e_x = -e_t
        mz -= force.moment_n * blade.ey
        load = BladeLoad(force.force_n, 0.0, force.force_t, force.moment_t, 0.0, -force.moment_n)
        store_blade_load(number, load, density, pitches, blades)
    thrust, torque = density * thrust, density * torque
    fy, fz = density * fy, density * fz
    return RotorLoad(
        Wrench(
            thrust,
            fy,
            fz,
            torque - elements.hub_height * fy,
            density * my + elements.hub_height * thrust + elements.overhang * fz,
            density * mz - elements.overhang * fy,
        ),
        thrust,
        torque,
    )


class CurvedForce(NamedTuple):
    """Sum over a curved blade over the air density."""

    load: BladeLoad
    outside: int  # stations outside the table or the box: the sum is valid where it is 0


NO_CURVED_FORCE = CurvedForce(NO_BLADE_LOAD, 0)


class Plane(NamedTuple):
    """A quantity linear in the place of a station: one + x, r and t times these."""

    one: float
    x: float
    r: float
    t: float


class ShearedFlow(NamedTuple):
    """Wind relative to a blade in its own directions, linear in place but for the power law times these."""

    height: Plane  # over that of the profile's centre, less 1
    flow_x: Plane
    flow_r: Plane
    flow_t: Plane
    scaled_x: float
    scaled_r: float
    scaled_t: float


@inlined_kernel
def _at(plane, at):
    return plane.one + plane.x * at.x + plane.r * at.r + plane.t * at.t


@kernel
def _sheared_flow(pose, hub, blade, now, series, profile):
    """ShearedFlow of a blade in a wind uniform apart from its shears."""
    vertical, horizontal = (
        now.vertical_shear / series.reference_length,
        now.horizontal_shear / series.reference_length,
    )
    one = vertical * (hub.Z - series.reference_height) + horizontal * hub.Y
    x = vertical * pose.r31 + horizontal * pose.r21
    r = vertical * blade.rz + horizontal * blade.ry
    t = vertical * blade.tz + horizontal * blade.ty
    inverse = 1.0 / profile.centre
    ax, ar, at = pose.r11, blade.rx, blade.tx
    return ShearedFlow(
        Plane(hub.Z * inverse - 1.0, inverse * pose.r31, inverse * blade.rz, inverse * blade.tz),
        Plane(ax * one + pose.r31 * now.w - blade.vx, ax * x, ax * r + blade.wt, ax * t - blade.wr),
        Plane(ar * one + blade.rz * now.w - blade.vr, ar * x - blade.wt, ar * r, ar * t + blade.wx),
        Plane(at * one + blade.tz * now.w - blade.vt, at * x + blade.wr, at * r - blade.wx, at * t),
        profile.scale * (pose.r11 * now.u + pose.r21 * now.v),
        profile.scale * (blade.rx * now.u + blade.ry * now.v),
        profile.scale * (blade.tx * now.u + blade.ty * now.v),
    )


@inlined_kernel
def _with_looked_up(force, v_normal, v_tangential, j, lever, low, high, fraction):
    """The CurvedForce with station j, bilinear between two rows of the table, as _station_force."""
    total = abs(v_normal) + abs(v_tangential)
    ahead = AHEAD * v_normal
    place = (ahead if v_tangential >= 0.0 else AHEAD * total - BEHIND * v_tangential) / total
    place = place if place > 0.0 else 0.0  # not a number too
    k = min(int(place), AHEAD + BEHIND - 1)
    part = place - k
    square = total * total
    a = square * (1.0 - fraction) * (1.0 - part)
    b = square * (1.0 - fraction) * part
    c = square * fraction * (1.0 - part)
    d = square * fraction * part
    fn = a * low[j, k, 0] + b * low[j, k + 1, 0] + c * high[j, k, 0] + d * high[j, k + 1, 0]
    ft = a * low[j, k, 1] + b * low[j, k + 1, 1] + c * high[j, k, 1] + d * high[j, k + 1, 1]
    moment = a * low[j, k, 2] + b * low[j, k + 1, 2] + c * high[j, k, 2] + d * high[j, k + 1, 2]
    valid = v_normal > 0.0 and v_normal + abs(v_tangential) < LARGEST_SPEED
    return CurvedForce(with_station(force.load, fn, ft, moment, lever), force.outside + (0 if valid else 1))


@inlined_kernel
def _with_sheared(force, flow, at, j, lever, profile, low, high, fraction):
    """The CurvedForce with station j in a sheared wind."""
    shear = _shear(_at(flow.height, at), profile)
    along = _at(flow.flow_x, at) + shear * flow.scaled_x
    out = _at(flow.flow_r, at) + shear * flow.scaled_r
    v_tangential = -_at(flow.flow_t, at) - shear * flow.scaled_t
    return _with_looked_up(force, at.nx * along + at.nr * out, v_tangential, j, lever, low, high, fraction)


@kernel
def _sheared_blade(flow, profile, low, high, fraction, cosine, sine, shape):
    """CurvedForce of a blade in a sheared wind."""
    force = NO_CURVED_FORCE
    for j in range(shape.distance.shape[0]):
        at, lever = station_at(j, cosine, sine, shape), lever_of(j, cosine, sine, shape)
        force = _with_sheared(force, flow, at, j, lever, profile, low, high, fraction)
    return force


@kernel
def _sheared_blades(first, second, third, profile, low, high, fraction, cosine, sine, shape):
    """CurvedForce of each of three blades in a sheared wind, whose stations are placed once."""
    a = b = c = NO_CURVED_FORCE
    for j in range(shape.distance.shape[0]):
        at, lever = station_at(j, cosine, sine, shape), lever_of(j, cosine, sine, shape)
        a = _with_sheared(a, first, at, j, lever, profile, low, high, fraction)
        b = _with_sheared(b, second, at, j, lever, profile, low, high, fraction)
        c = _with_sheared(c, third, at, j, lever, profile, low, high, fraction)
    return a, b, c


@kernel
def _curved_in_field(t, pose, hub, blade, field, low, high, fraction, cosine, sine, shape):
    """CurvedForce in a box of wind; not valid where a station leaves the box or the table."""
    velocity = field.velocity
    start = (t + field.shift) * field.rate
    pace = field.slowness * field.rate
    last_s, last_y, last_z = velocity.shape[0] - 1.0, velocity.shape[2] - 1.0, velocity.shape[1] - 1.0
    if field.periodic:
        s0 = (start - hub.X * pace) % velocity.shape[0]
    else:
        s0 = start - hub.X * pace
    one = np.uintp(1)  # indices without sign are not tested for counting from the end
    force = NO_CURVED_FORCE
    for j in range(shape.distance.shape[0]):
        at = station_at(j, cosine, sine, shape)
        s = s0 - pace * (at.x * pose.r11 + at.r * blade.rx + at.t * blade.tx)
        y = hub.Y + at.x * pose.r21 + at.r * blade.ry + at.t * blade.ty
        z = hub.Z + at.x * pose.r31 + at.r * blade.rz + at.t * blade.tz
        y, z = (y - field.low_y) * field.inverse_dy, (z - field.low_z) * field.inverse_dz
        inside = 0.0 <= s < last_s and 0.0 <= y < last_y and 0.0 <= z < last_z
        s, y, z = (s, y, z) if inside else (0.0, 0.0, 0.0)
        slice_now, row, column = np.uintp(s), np.uintp(z), np.uintp(y)
        late, up, across = s - float(slice_now), z - float(row), y - float(column)
        slice_next = slice_now + one
        prefetch(velocity, slice_next + one, row, column)
        prefetch(velocity, slice_next + one, row + one, column)
        p, q = (1.0 - up) * (1.0 - across), (1.0 - up) * across
        r, d = up * (1.0 - across), up * across
        rest = 1.0 - late
        u = rest * _across(velocity, slice_now, row, column, 0, p, q, r, d)
        v = rest * _across(velocity, slice_now, row, column, 1, p, q, r, d)
        w = rest * _across(velocity, slice_now, row, column, 2, p, q, r, d)
        u += late * _across(velocity, slice_next, row, column, 0, p, q, r, d)
        v += late * _across(velocity, slice_next, row, column, 1, p, q, r, d)
        w += late * _across(velocity, slice_next, row, column, 2, p, q, r, d)
        v_normal, v_tangential = station_inflow(u, v, w, at, pose, blade)
        lever = lever_of(j, cosine, sine, shape)
        force = _with_looked_up(force, v_normal, v_tangential, j, lever, low, high, fraction)
        force = CurvedForce(force.load, force.outside + (0 if inside else 1))
    return force


@kernel
def _curved_sampled(
    t, pose, hub, blade, now, series, field, blade_pitch, low, high, fraction, elements, shape, counters
):
    """CurvedForce with the wind sampled station by station, and the exact solution outside the table."""
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
        if v_normal > 0.0 and v_normal + abs(v_tangential) < LARGEST_SPEED:
            force = _with_looked_up(force, v_normal, v_tangential, j, lever, low, high, fraction)
        else:
            turned = effective_pitch(j, blade_pitch, shape)
            section = blade_section(v_normal, v_tangential, turned, j, 1.0, elements)
            if not section.solved:
                counters[Counter.BEM_FALLBACK] += 1.0
            weight = elements.weight[j] / elements.air_density if elements.air_density > 0.0 else 0.0
            moment = pitching_moment(
                v_normal + section.induced_normal, v_tangential + section.induced_tangential, j,
                element_of(j, turned, elements), shape, elements.polars,
            )  # fmt: skip
            load = with_station(force.load, weight * section.fn, weight * section.ft, weight * moment, lever)
            force = CurvedForce(load, 0)
    return force


@kernel
def _loads_of_three(first, second, third, first_row, x, profile, table, shape, pitches):
    """CurvedForce of each of three blades in the ShearedFlow of each."""
    i = int(first_row)
    low, high, fraction = table.load[i], table.load[i + 1], first_row - i
    cosine, sine = cos(x[State.BLADE_PITCH]), sin(x[State.BLADE_PITCH])
    if pitches is None:
        return _sheared_blades(first, second, third, profile, low, high, fraction, cosine, sine, shape)
    return _sheared_each(first, second, third, first_row, x, profile, table, shape, pitches)


@kernel
def _sheared_each(first, second, third, first_row, x, profile, table, shape, pitches):
    """As _sheared_blades of blades with pitches of their own: a station of all three at a time, which keeps
    the processor busier than one blade after the other."""
    second_pitch, third_pitch = pitch_of(1, x, pitches), pitch_of(2, x, pitches)
    second_row, third_row = _pitch_row(second_pitch), _pitch_row(third_pitch)
    i, k, m = int(first_row), int(second_row), int(third_row)
    low_a, high_a, fraction_a = table.load[i], table.load[i + 1], first_row - i
    low_b, high_b, fraction_b = table.load[k], table.load[k + 1], second_row - k
    low_c, high_c, fraction_c = table.load[m], table.load[m + 1], third_row - m
    cos_a, sin_a = cos(x[State.BLADE_PITCH]), sin(x[State.BLADE_PITCH])
    cos_b, sin_b = cos(second_pitch), sin(second_pitch)
    cos_c, sin_c = cos(third_pitch), sin(third_pitch)
    a = b = c = NO_CURVED_FORCE
    for j in range(shape.distance.shape[0]):
        at, lever = station_at(j, cos_a, sin_a, shape), lever_of(j, cos_a, sin_a, shape)
        a = _with_sheared(a, first, at, j, lever, profile, low_a, high_a, fraction_a)
        at, lever = station_at(j, cos_b, sin_b, shape), lever_of(j, cos_b, sin_b, shape)
        b = _with_sheared(b, second, at, j, lever, profile, low_b, high_b, fraction_b)
        at, lever = station_at(j, cos_c, sin_c, shape), lever_of(j, cos_c, sin_c, shape)
        c = _with_sheared(c, third, at, j, lever, profile, low_c, high_c, fraction_c)
    return a, b, c


@kernel
def _three_blades(
    azimuth, speed, first_row, x, pose, hub, now, series, profile, table, shape, pitches, blades
):
    """(whether every station lies in the table, RotorLoad) of three blades in a sheared wind."""
    density = table.elements.air_density
    y, z = -sin(azimuth), cos(azimuth)
    p = blade_wind(y, z, speed, pose, hub)
    q = blade_wind(-0.5 * y - HALF_ROOT_3 * z, HALF_ROOT_3 * y - 0.5 * z, speed, pose, hub)
    r = blade_wind(HALF_ROOT_3 * z - 0.5 * y, -HALF_ROOT_3 * y - 0.5 * z, speed, pose, hub)
    a, b, c = _loads_of_three(
        _sheared_flow(pose, hub, p, now, series, profile),
        _sheared_flow(pose, hub, q, now, series, profile),
        _sheared_flow(pose, hub, r, now, series, profile),
        first_row, x, profile, table, shape, pitches,
    )  # fmt: skip
    store_blade_load(0, a.load, density, pitches, blades)
    store_blade_load(1, b.load, density, pitches, blades)
    store_blade_load(2, c.load, density, pitches, blades)
    total = with_blade(with_blade(with_blade(NO_LOAD, a.load, p), b.load, q), c.load, r)
    return a.outside + b.outside + c.outside == 0, rotor_axes_load(total, density, table.elements)


@inlined_kernel
def _curved_table_load(t, pose, x, now, series, field, table, shape, counters, pitches, blades):
    elements = table.elements
    hub = hub_flow(t, pose, now, series, field, elements.overhang, elements.hub_height)
    speed, azimuth = x[State.ROTOR_SPEED], x[State.AZIMUTH]
    induction = smoothstep(speed * elements.tip_radius, SLOW_ROTOR * hub.speed, FAST_ROTOR * hub.speed)
    first_row = _pitch_row(x[State.BLADE_PITCH])
    if not (induction == 1.0 and _all_rows(first_row, x, pitches)):
        return rotor_load(t, pose, x, now, series, field, elements, None, None, x, counters, pitches, blades)
    bottom, top = hub.Z - shape.reach, hub.Z + shape.reach
    sheared = field is None and bottom > LOWEST_HEIGHT and top < LARGEST_RATIO * bottom
    if sheared:
        profile = _profile(bottom, top, series)
    else:
        profile = _profile(1.0, 1.0, series)
    if sheared and elements.blades == 3:
        all_valid, load = _three_blades(
            azimuth, speed, first_row, x, pose, hub, now, series, profile, table, shape, pitches, blades
        )
        if all_valid:
            return load
    total = NO_LOAD
    for number in range(elements.blades):
        blade_pitch, row = pitch_of(number, x, pitches), _blade_row(number, first_row, x, pitches)
        i = int(row)
        fraction = row - i
        low, high = table.load[i], table.load[i + 1]
        cosine, sine = cos(blade_pitch), sin(blade_pitch)
        psi = azimuth + 2.0 * pi * number / elements.blades
        blade = blade_wind(-sin(psi), cos(psi), speed, pose, hub)
        if sheared:
            flow = _sheared_flow(pose, hub, blade, now, series, profile)
            force = _sheared_blade(flow, profile, low, high, fraction, cosine, sine, shape)
        elif field is not None:
            force = _curved_in_field(t, pose, hub, blade, field, low, high, fraction, cosine, sine, shape)
        else:
            force = CurvedForce(NO_BLADE_LOAD, 1)
        if force.outside > 0:
            force = _curved_sampled(
                t, pose, hub, blade, now, series, field, blade_pitch, low, high, fraction, elements, shape,
                counters,
            )  # fmt: skip
        store_blade_load(number, force.load, elements.air_density, pitches, blades)
        total = with_blade(total, force.load, blade)
    return rotor_axes_load(total, elements.air_density, elements)


# the sweep over straight blades in the rotor plane, or over curved ones
_table_sweep = chosen_by_class(
    "shape", {type(None): _straight_table_load, BladeShape: _curved_table_load}, inlined=True
)


@kernel
def section_table_load(t, pose, x, now, series, field, table, counters, pitches, blades):
    """RotorLoad of the state x at time t from the tables of the stations, in rotor axes. No table or no wind
    series: zero.

    pose                in rotor axes (tilt.py)
    now, series, field  wind (weather/wind.py); every station has the wind of where it is at this instant
    counters            as in rotor_load, for the exact solutions outside the table
    pitches, blades     as in rotor_load
    Against rotor_load: rms 1e-4 of the load's standard deviation over all operating states, for thrust and
    torque; tests/plant/aero/test_section_table.py has the figures.
    """
    if table is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    return _table_sweep(
        t, pose, x, now, series, field, table, table.elements.shape, counters, pitches, blades
    )
