"""Rotor aerodynamics: the stations of blade_elements.py, swept over every blade (theory.md, 5.1).

Each station sees the wind where it is at this instant. On a parked or slow rotor the induction fades
out between the tip-speed ratios SLOW_ROTOR and FAST_ROTOR (as AeroDyn does); below, the blade sees the
wind alone, at any angle of attack.
"""

from math import cos, pi, sin, sqrt
from typing import NamedTuple

from fowt_env.plant.aero.blade_elements import (
    airload,
    element_of,
    first_guess,
    pitching_moment,
    smoothstep,
    solve_section,
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
from fowt_env.plant.aero.wake import PER_ELEMENT, filtered_induction, skew_factor, skew_of
from fowt_env.plant.aero.wind import wind_at
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.events import Counter
from fowt_env.plant.state import NO_LOAD, State, Wrench

SLOW_ROTOR, FAST_ROTOR = 1.0, 2.0  # tip-speed ratios between which the induction fades in


class RotorLoad(NamedTuple):
    """Aerodynamic load of the rotor."""

    wrench: Wrench  # about the body origin, body components; contains the torque
    thrust: float  # N, along the shaft, downwind
    torque: float  # N m, about the shaft


NO_ROTOR_LOAD = RotorLoad(NO_LOAD, 0.0, 0.0)


class SectionInflow(NamedTuple):
    """Relative wind at a section (m/s) and the direction of its blade, e_r = (0, ey, ez)."""

    v_normal: float
    v_tangential: float
    ey: float
    ez: float


class HubFlow(NamedTuple):
    """Hub position in O, velocity of the hub and the wind relative to it in body components."""

    X: float
    Y: float
    Z: float
    vx: float
    vy: float
    vz: float
    wx: float
    wy: float
    wz: float
    speed: float  # of the relative wind, m/s


@kernel
def hub_flow(t, pose, now, series, field, overhang, hub_height):
    """HubFlow at the rotor centre (-overhang, 0, hub_height)."""
    X = pose.x - overhang * pose.r11 + hub_height * pose.r13
    Y = pose.y - overhang * pose.r21 + hub_height * pose.r23
    Z = pose.z - overhang * pose.r31 + hub_height * pose.r33
    vx = pose.vx + pose.wy * hub_height
    vy = pose.vy - pose.wx * hub_height - pose.wz * overhang
    vz = pose.vz + pose.wy * overhang
    u, v, w = wind_at(t, X, Y, Z, now, series, field)
    wx = pose.r11 * u + pose.r21 * v + pose.r31 * w - vx
    wy = pose.r12 * u + pose.r22 * v + pose.r32 * w - vy
    wz = pose.r13 * u + pose.r23 * v + pose.r33 * w - vz
    return HubFlow(X, Y, Z, vx, vy, vz, wx, wy, wz, sqrt(wx * wx + wy * wy + wz * wz))


@kernel
def store_blade_load(blade, load, factor, pitches, blades):
    """Put a factor times the BladeLoad of a blade into blades; nothing with one pitch for all blades."""
    if pitches is None:
        return
    row = blades[blade]
    row[0], row[1], row[2] = factor * load.fx, factor * load.fr, factor * load.ft
    row[3], row[4], row[5] = factor * load.mx, factor * load.mr, factor * load.mt


@inlined_kernel
def _straight_load(t, pose, x, now, series, field, rotor, shape, skew, wake, dx, counters, pitches, blades):
    hub = hub_flow(t, pose, now, series, field, rotor.overhang, rotor.hub_height)
    speed, azimuth = x[State.ROTOR_SPEED], x[State.AZIMUTH]
    induction = smoothstep(speed * rotor.tip_radius, SLOW_ROTOR * hub.speed, FAST_ROTOR * hub.speed)
    skewed = skew_of(hub, skew)
    stations = rotor.radius.shape[0]
    thrust = torque = fy = fz = my = mz = 0.0
    for blade in range(rotor.blades):
        blade_pitch = pitch_of(blade, x, pitches)
        psi = azimuth + 2.0 * pi * blade / rotor.blades
        ey, ez = -sin(psi), cos(psi)  # e_r = (0, ey, ez), e_t = (0, -ez, ey)
        rx, ry, rz = (
            pose.r12 * ey + pose.r13 * ez,
            pose.r22 * ey + pose.r23 * ez,
            pose.r32 * ey + pose.r33 * ez,
        )
        tx, ty, tz = (
            pose.r13 * ey - pose.r12 * ez,
            pose.r23 * ey - pose.r22 * ez,
            pose.r33 * ey - pose.r32 * ez,
        )
        normal_rate = pose.wy * ez - pose.wz * ey  # (w x e_r) . e_x
        hub_tangential = hub.vz * ey - hub.vy * ez
        spin = speed + pose.wx
        force_n = force_t = moment_n = moment_t = 0.0
        for j in range(stations):
            radius = rotor.radius[j]
            u, v, w = wind_at(
                t, hub.X + radius * rx, hub.Y + radius * ry, hub.Z + radius * rz, now, series, field
            )
            v_normal = pose.r11 * u + pose.r21 * v + pose.r31 * w - hub.vx - radius * normal_rate
            v_tangential = hub_tangential + radius * spin - (tx * u + ty * v + tz * w)
            element = element_of(j, blade_pitch, rotor)
            guess = first_guess(v_normal, v_tangential, blade_pitch, j, rotor)
            section = solve_section(v_normal, v_tangential, induction, guess, element, rotor.polars)
            if not section.solved:
                counters[Counter.BEM_FALLBACK] += 1.0
            flow = SectionInflow(v_normal, v_tangential, ey, ez)
            fn, ft = _wake_load(section, flow, element, blade, j, hub, skewed, skew, wake, x, dx, rotor)
            force_n += rotor.weight[j] * fn
            force_t += rotor.weight[j] * ft
            moment_n += rotor.moment_weight[j] * fn
            moment_t += rotor.moment_weight[j] * ft
        thrust += force_n
        torque += moment_t
        fy -= force_t * ez
        fz += force_t * ey
        my += moment_n * ez  # e_r x e_x = -e_t
        mz -= moment_n * ey
        load = BladeLoad(force_n, 0.0, force_t, moment_t, 0.0, -moment_n)
        store_blade_load(blade, load, 1.0, pitches, blades)
    return RotorLoad(
        Wrench(
            thrust,
            fy,
            fz,
            torque - rotor.hub_height * fy,
            my + rotor.hub_height * thrust + rotor.overhang * fz,
            mz - rotor.overhang * fy,
        ),
        thrust,
        torque,
    )


@kernel
def rotor_axes_load(about_centre, factor, rotor):
    """RotorLoad of a Wrench about the rotor centre times a factor, in rotor axes."""
    fx, fy, fz = factor * about_centre.fx, factor * about_centre.fy, factor * about_centre.fz
    torque, height, overhang = factor * about_centre.mx, rotor.hub_height, rotor.overhang
    return RotorLoad(
        Wrench(
            fx,
            fy,
            fz,
            torque - height * fy,
            factor * about_centre.my + height * fx + overhang * fz,
            factor * about_centre.mz - overhang * fy,
        ),
        fx,
        torque,
    )


@kernel
def curved_blade_load(
    number,
    t,
    pose,
    hub,
    blade,
    induction,
    x,
    now,
    series,
    field,
    rotor,
    shape,
    skewed,
    skew,
    wake,
    dx,
    counters,
    pitches,
):
    """BladeLoad of a blade of BladeShape shape, blade: its BladeWind; pose in rotor axes."""
    blade_pitch = pitch_of(number, x, pitches)
    cosine, sine = cos(blade_pitch), sin(blade_pitch)
    load = NO_BLADE_LOAD
    for j in range(rotor.radius.shape[0]):
        at = station_at(j, cosine, sine, shape)
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
        turned = effective_pitch(j, blade_pitch, shape)
        element = element_of(j, turned, rotor)
        guess = first_guess(v_normal, v_tangential, turned, j, rotor)
        section = solve_section(v_normal, v_tangential, induction, guess, element, rotor.polars)
        if not section.solved:
            counters[Counter.BEM_FALLBACK] += 1.0
        flow = SectionInflow(v_normal, v_tangential, blade.ey, blade.ez)
        normal, tangential = _induced(section, flow, number, j, hub, skewed, skew, wake, x, dx, rotor)
        fn, ft = _induced_load(section, flow, element, normal, tangential, skew, wake, rotor)
        moment = pitching_moment(
            v_normal + normal, v_tangential + tangential, j, element, shape, rotor.polars
        )
        weight = rotor.weight[j]
        load = with_station(load, weight * fn, weight * ft, weight * moment, lever_of(j, cosine, sine, shape))
    return load


@inlined_kernel
def _curved_load(t, pose, x, now, series, field, rotor, shape, skew, wake, dx, counters, pitches, blades):
    hub = hub_flow(t, pose, now, series, field, rotor.overhang, rotor.hub_height)
    induction = smoothstep(
        x[State.ROTOR_SPEED] * rotor.tip_radius, SLOW_ROTOR * hub.speed, FAST_ROTOR * hub.speed
    )
    skewed = skew_of(hub, skew)
    total = NO_LOAD
    for number in range(rotor.blades):
        psi = x[State.AZIMUTH] + 2.0 * pi * number / rotor.blades
        blade = blade_wind(-sin(psi), cos(psi), x[State.ROTOR_SPEED], pose, hub)
        load = curved_blade_load(
            number, t, pose, hub, blade, induction, x, now, series, field, rotor, shape, skewed, skew, wake,
            dx, counters, pitches,
        )  # fmt: skip
        store_blade_load(number, load, 1.0, pitches, blades)
        total = with_blade(total, load, blade)
    return rotor_axes_load(total, 1.0, rotor)


# the sweep over straight blades in the rotor plane, or over curved ones
_sweep = chosen_by_class("shape", {type(None): _straight_load, BladeShape: _curved_load}, inlined=True)


@kernel
def rotor_load(t, pose, x, now, series, field, rotor, skew, wake, dx, counters, pitches, blades):
    """RotorLoad of the state x at time t in rotor axes; theory.md, 5.1. No rotor or no wind series: zero.

    pose                in rotor axes (tilt.py)
    now, series, field  wind (weather/wind.py); every station samples it where it is at this instant
    skew, wake          optional SkewedWake and DynamicInflow (wake.py)
    dx                  derivative of the state: only the wake states are written
    counters            counters[Counter.BEM_FALLBACK] grows by one per station without a bracket
    pitches             BladePitches, or None: one pitch for all blades
    blades              with pitches the BladeLoad of each blade is put there, (blades, 6)
    """
    if rotor is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    return _sweep(
        t, pose, x, now, series, field, rotor, rotor.shape, skew, wake, dx, counters, pitches, blades
    )


@kernel
def wake_equilibrium(t, pose, x, now, series, field, rotor, skew, wake, dx, counters, pitches, blades):
    """Number of wake states, set in x to their steady values for the rest of x held as it is.

    The filter is linear in its states: the rates at two values of the first stage, 0 and 1, give its
    steady value 0.4 W_qs, whatever the time constants. dx: scratch, (n_state,).
    """
    if wake is None:
        return 0
    if rotor is None or series is None:
        return 0
    count = PER_ELEMENT * rotor.blades * rotor.radius.shape[0]
    for i in range(State.INTERNAL, State.INTERNAL + count):
        x[i] = 0.0
    rotor_load(t, pose, x, now, series, field, rotor, skew, wake, dx, counters, pitches, blades)
    for i in range(State.INTERNAL, State.INTERNAL + count, 2):
        x[i + 1] = dx[i]
        x[i] = 1.0
    rotor_load(t, pose, x, now, series, field, rotor, skew, wake, dx, counters, pitches, blades)
    for i in range(State.INTERNAL, State.INTERNAL + count, 2):
        x[i] = x[i + 1] / (x[i + 1] - dx[i])
        x[i + 1] = x[i] / 0.4
        dx[i] = dx[i + 1] = 0.0
    return count


@kernel
def _wake_load(section, flow, element, blade, j, hub, skewed, skew, wake, x, dx, rotor):
    """(fn, ft) of a section with the optional wake models; its own loads if there are none."""
    if wake is None and skew is None:
        return section.fn, section.ft
    normal, tangential = _induced(section, flow, blade, j, hub, skewed, skew, wake, x, dx, rotor)
    return _induced_load(section, flow, element, normal, tangential, skew, wake, rotor)


@kernel
def _induced(section, flow, blade, j, hub, skewed, skew, wake, x, dx, rotor):
    """(normal, tangential) induced velocity of a section with the optional wake models, m/s."""
    normal, tangential = filtered_induction(
        section, flow.v_normal, blade, j, hub.speed, wake, x, dx, rotor.radius, rotor.tip_radius
    )
    span = rotor.radius[j] / rotor.tip_radius
    normal *= skew_factor(normal, flow.v_normal, flow.ey, flow.ez, span, skewed, skew)
    return normal, tangential


@kernel
def _induced_load(section, flow, element, normal, tangential, skew, wake, rotor):
    """(fn, ft) of a section under these induced velocities; its own loads without wake models."""
    if wake is None and skew is None:
        return section.fn, section.ft
    cn, ct, square = airload(flow.v_normal + normal, flow.v_tangential + tangential, element, rotor.polars)
    return element.half_density_chord * square * cn, element.half_density_chord * square * ct
