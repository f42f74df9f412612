"""Computes loads and deflections of bending blades, and the loads of rotor and nacelle on shaft and tower.

As in ElastoDyn a load is that of the outer part on the inner one: aerodynamics, weight and inertia. Coned
axes i of a blade: x normal to the cone, downwind; y against the rotation; z outwards. Pitched axes j: i
turned by the blade pitch about z.
"""

from math import cos, pi, sin, sqrt
from typing import NamedTuple

from fowt_env.plant.aero.blade_shape import N_STATION_LOAD, bent_lever, turn_of
from fowt_env.plant.aero.blade_sweep import shape_of
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.beam import reduce_beam
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.elastic.chain import rotor_frame, to_nacelle_axes, top_of
from fowt_env.plant.elastic.structure import Structure
from fowt_env.plant.state import BLADES, State, Wrench, cross


class SectionLoad(NamedTuple):
    """Holds the force (N) and moment (N m) of the outer part of a blade on the inner one, pitched axes."""

    fx: float
    fy: float
    fz: float
    mx: float
    my: float
    mz: float


@inlined_kernel
def _reduce_outer(number, x, frame, beam, blades, work):
    """Reduce the outer part of a blade into the last rows of work."""
    f, E, n, speed = frame, work.axes[number], len(beam.count), x[State.ROTOR_SPEED]
    ux, uy, uz = _turned(E, f.wx + speed * f.nx, f.wy + speed * f.ny, f.wz + speed * f.nz)
    q = blades.first + n * number
    v = q + BLADES * n
    reduce_beam(
        x[q : q + n], x[v : v + n], ux, uy, uz, beam, work.moment[BLADES], work.block[BLADES],
        work.own[BLADES], work.mass, work.pull[BLADES], work.probe_rest,
    )  # fmt: skip


@inlined_kernel
def _inertial_load(number, reduced, x, dx, frame, beam, blades, work):
    """Return the SectionLoad of weight and inertia of a Beam about the rotor centre, pitched axes.

    beam: of the whole blade or of its outer part, in the rows `reduced` of work (number or BLADES). dx:
    rates, of the last solution of the chain.
    """
    f, E, A, n = frame, work.axes[number], work.motion, len(beam.count)
    speed = x[State.ROTOR_SPEED]
    bx = f.bx + speed * (f.wy * f.nz - f.wz * f.ny) + A[3]
    by = f.by + speed * (f.wz * f.nx - f.wx * f.nz) + A[4]
    bz = f.bz + speed * (f.wx * f.ny - f.wy * f.nx) + A[5]
    ax, ay, az = f.ax + A[0], f.ay + A[1], f.az + A[2]
    v = blades.first + n * (BLADES + number)
    c, J, X, p = work.moment[reduced], work.block[reduced], work.own[reduced], work.pull[reduced]
    ax, ay, az = _turned(E, ax, ay, az)
    bx, by, bz = _turned(E, bx, by, bz)
    m = beam.mass
    tx, ty, tz = cross(bx, by, bz, c[0], c[1], c[2])
    sx, sy, sz = cross(c[0], c[1], c[2], ax, ay, az)
    fx, fy, fz = p[0] + m * ax + tx, p[1] + m * ay + ty, p[2] + m * az + tz
    mx = p[3] + sx + J[0] * bx + J[3] * by + J[4] * bz
    my = p[4] + sy + J[3] * bx + J[1] * by + J[5] * bz
    mz = p[5] + sz + J[4] * bx + J[5] * by + J[2] * bz
    for i in range(n):
        rate = dx[v + i]
        fx += X[i, 0] * rate
        fy += X[i, 1] * rate
        fz += X[i, 2] * rate
        mx += X[i, 3] * rate
        my += X[i, 4] * rate
        mz += X[i, 5] * rate
    return SectionLoad(-fx, -fy, -fz, -mx, -my, -mz)


@inlined_kernel
def _turned(E, x, y, z):
    """Return the components along the columns of E of a vector."""
    return (
        E[0, 0] * x + E[1, 0] * y + E[2, 0] * z,
        E[0, 1] * x + E[1, 1] * y + E[2, 1] * z,
        E[0, 2] * x + E[1, 2] * y + E[2, 2] * z,
    )


@inlined_kernel
def _with_aerodynamics(load, row, pitch, blades):
    """Return a SectionLoad plus the BladeLoad in a row of Data.blades."""
    c, s, p, q = blades.cone_cosine, blades.cone_sine, cos(pitch), sin(pitch)
    fx, fy, mx, my = c * row[0] + s * row[1], -row[2], c * row[3] + s * row[4], -row[5]
    return SectionLoad(
        load.fx + p * fx - q * fy, load.fy + q * fx + p * fy, load.fz + c * row[1] - s * row[0],
        load.mx + p * mx - q * my, load.my + q * mx + p * my, load.mz + c * row[4] - s * row[3],
    )  # fmt: skip


@inlined_kernel
def _about(load, x, y, z):
    """Return a SectionLoad about the rotor centre as one about the point (x, y, z)."""
    return SectionLoad(
        load.fx, load.fy, load.fz,
        load.mx - y * load.fz + z * load.fy,
        load.my - z * load.fx + x * load.fz,
        load.mz - x * load.fy + y * load.fx,
    )  # fmt: skip


@inlined_kernel
def root_load(number, x, dx, frame, pitch, loads, blades, work):
    """Return the SectionLoad of the root of a blade (0, 1, 2), pitched axes."""
    load = _inertial_load(number, number, x, dx, frame, blades.beam, blades, work)
    return _about(_with_aerodynamics(load, loads[number], pitch, blades), 0.0, 0.0, blades.hub_radius)


@inlined_kernel
def _outer_aerodynamics(number, x, turn, aero, section, loads):
    """Return the SectionLoad about the rotor centre of the station loads outside of a Section."""
    if aero is None:
        return SectionLoad(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    elements = aero.rotor.elements
    shape = shape_of(number, x, elements.shape, elements.modes, loads)
    cosine, sine = shape.rest.cone_cosine, shape.rest.cone_sine
    fx = fr = ft = mx = mr = mt = 0.0
    for j in range(section.outside.shape[0]):
        part = section.outside[j]
        if part > 0.0:
            lever, at = bent_lever(j, shape), N_STATION_LOAD * j
            normal, tangential = part * shape.loads[at], part * shape.loads[at + 1]
            moment = part * shape.loads[at + 2]
            fx += normal * lever.nx
            fr += normal * lever.nr
            ft += tangential
            mx += lever.r * tangential - lever.t_nr * normal - moment * lever.nr
            mr += lever.t_nx * normal - lever.x * tangential + moment * lever.nx
            mt += lever.turn * normal
    fx, fz, mx, mz = (
        cosine * fx + sine * fr,
        cosine * fr - sine * fx,
        cosine * mx + sine * mr,
        cosine * mr - sine * mx,
    )
    c, s = turn.cosine, turn.sine
    return SectionLoad(c * fx + s * ft, s * fx - c * ft, fz, c * mx + s * mt, s * mx - c * mt, mz)


@inlined_kernel
def _section_load(number, x, dx, frame, pitch, section, aero, loads, blades, work):
    """Return the SectionLoad at a Section of a blade, about its displaced centre."""
    turn, n = turn_of(pitch), len(section.beam.count)
    _reduce_outer(number, x, frame, section.beam, blades, work)
    inertial = _inertial_load(number, BLADES, x, dx, frame, section.beam, blades, work)
    wind = _outer_aerodynamics(number, x, turn, aero, section, loads)
    load = SectionLoad(
        inertial.fx + wind.fx, inertial.fy + wind.fy, inertial.fz + wind.fz,
        inertial.mx + wind.mx, inertial.my + wind.my, inertial.mz + wind.mz,
    )  # fmt: skip
    q, point = blades.first + n * number, section.point
    px, py, pz = _displaced(x, q, point)
    return _about(load, px, py, section.distance + pz)


@inlined_kernel
def _bending_moments(load, x, q, section):
    """Return the moments (x, y) of a SectionLoad along the local structural axes of a bent blade.

    q: index of the deflections. The axes are turned by bending, then by the structural twist.
    """
    ahead = side = 0.0
    for i in range(len(section.beam.count)):
        ahead += section.point.slope_x[i] * x[q + i]
        side += section.point.slope_y[i] * x[q + i]
    both, w = 0.5 * ahead * side, sqrt(1.0 - 0.25 * (ahead * ahead + side * side))
    mx = (1.0 - 0.5 * ahead * ahead) * load.mx - both * load.my - ahead * w * load.mz
    my = (1.0 - 0.5 * side * side) * load.my - both * load.mx - side * w * load.mz
    return section.cosine * mx - section.sine * my, section.sine * mx + section.cosine * my


@inlined_kernel
def _displaced(x, q, point):
    """Return the displacement (3) of a Point, pitched axes; q: index of the deflections."""
    n, px, py, pz = point.x.shape[0], 0.0, 0.0, 0.0
    for i in range(n):
        px += point.x[i] * x[q + i]
        py += point.y[i] * x[q + i]
        for j in range(n):
            pz -= 0.5 * x[q + i] * point.shortening[i, j] * x[q + j]
    return px, py, pz


@inlined_kernel
def hub_load(x, frame, loads, blades, work):
    """Return the load (6) of the rotor on its shaft at the rotor centre, non-rotating rotor axes."""
    f, h = frame, work.hub_load
    fx = f.nx * h[0] + f.ny * h[1] + f.nz * h[2]
    fy = f.yx * h[0] + f.yy * h[1] + f.yz * h[2]
    fz = f.zx * h[0] + f.zy * h[1] + f.zz * h[2]
    mx = f.nx * h[3] + f.ny * h[4] + f.nz * h[5]
    my = f.yx * h[3] + f.yy * h[4] + f.yz * h[5]
    mz = f.zx * h[3] + f.zy * h[4] + f.zz * h[5]
    for number in range(BLADES):
        psi, row = x[State.AZIMUTH] + 2.0 * pi * number / BLADES, loads[number]
        ey, ez = -sin(psi), cos(psi)
        fx += row[0]
        fy += row[1] * ey - row[2] * ez
        fz += row[1] * ez + row[2] * ey
        mx += row[3]
        my += row[4] * ey - row[5] * ez
        mz += row[4] * ez + row[5] * ey
    return fx, fy, fz, mx, my, mz


@inlined_kernel
def bearing_moment(bend, rotor, work, height):
    """Return the moment (3) of nacelle and rotor on the tower top, nacelle axes.

    rotor: aerodynamic Wrench about the origin of the nacelle frame; height: of the tower top, m.
    """
    h = work.top_load
    fx, fy, _ = to_nacelle_axes(bend, h[0], h[1], h[2])
    mx, my, mz = to_nacelle_axes(bend, h[3], h[4], h[5])
    if bend is None:  # the load is about the body origin
        mx, my = mx + height * fy, my - height * fx
    return mx + rotor.mx + height * rotor.fy, my + rotor.my - height * rotor.fx, mz + rotor.mz


@kernel
def _no_upper(load, bend, structure, work):
    return load


@kernel
def _with_upper(load, bend, structure, work):
    h = work.top_load
    fx, fy, fz = h[0], h[1], h[2]
    x, y, z = place_of(bend)
    return Wrench(
        load.fx + fx, load.fy + fy, load.fz + fz,
        load.mx + h[3] + y * fz - z * fy,
        load.my + h[4] + z * fx - x * fz,
        load.mz + h[5] + x * fy - y * fx,
    )  # fmt: skip


@kernel
def place_of(bend):
    """Return the point (3) about which RotorScratch.top_load acts, m from the body origin."""
    if bend is None:
        return 0.0, 0.0, 0.0
    return bend.x, bend.y, bend.z


# (load, bend, structure, work) -> Wrench on the tower base plus weight and inertia of nacelle and rotor
add_upper_load = chosen_by_class("structure", {type(None): _no_upper, Structure: _with_upper})


@inlined_kernel
def _shaft_of_rigid(thrust, torque, pose, bend, x, body, structure, tower, blades, loads, work):
    return thrust, torque


@inlined_kernel
def _shaft_of_bending(thrust, torque, pose, bend, x, body, structure, tower, blades, loads, work):
    frame, _ = rotor_frame(pose, top_of(pose, x, bend, tower), bend, body.gravity, structure)
    thrust, _, _, torque, _, _ = hub_load(x, frame, loads, blades, work)
    return thrust, torque


# (thrust, torque, pose, bend, x, body, structure, tower, blades, loads, work) -> thrust (N) and torque (N m)
# of the shaft: those of the rigid rotor, given, or of bending blades
shaft_load = chosen_by_class(
    "blades", {type(None): _shaft_of_rigid, BladeModes: _shaft_of_bending}, inlined=True
)


@inlined_kernel
def _none_bent(pose, bend, x, dx, pitches, body, aero, structure, tower, blades, loads, work, row):
    return


@inlined_kernel
def _record_bent(pose, bend, x, dx, pitches, body, aero, structure, tower, blades, loads, work, row):
    frame, _ = rotor_frame(pose, top_of(pose, x, bend, tower), bend, body.gravity, structure)
    tip, n = blades.tip, len(blades.beam.count)
    for number in range(BLADES):
        pitch = pitch_of(number, x, pitches)
        c, s = cos(pitch), sin(pitch)
        q = blades.first + n * number
        px, py, pz = _displaced(x, q, tip)
        root = root_load(number, x, dx, frame, pitch, loads, blades, work)
        row[number], row[3 + number], row[6 + number] = c * px + s * py, c * py - s * px, pz
        row[9 + number], row[12 + number] = c * root.fx + s * root.fy, c * root.fy - s * root.fx
        row[15 + number], row[18 + number], row[21 + number] = root.fz, root.mx, root.my
        row[40 + number], row[43 + number], row[46 + number] = px, py, root.mz
        inner = _section_load(number, x, dx, frame, pitch, blades.inner, aero, loads, blades, work)
        outer = _section_load(number, x, dx, frame, pitch, blades.outer, aero, loads, blades, work)
        row[24 + number], row[27 + number] = _bending_moments(inner, x, q, blades.inner)
        row[30 + number], row[33 + number] = _bending_moments(outer, x, q, blades.outer)
    fx, fy, fz, _, my, mz = hub_load(x, frame, loads, blades, work)
    c, s = cos(x[State.AZIMUTH]), sin(x[State.AZIMUTH])
    row[36], row[37] = c * my + s * mz, c * mz - s * my
    row[38], row[39] = fy, fz
    row[49], row[50] = c * fy + s * fz, c * fz - s * fy


# (pose, bend, x, dx, pitches, body, aero, structure, tower, blades, loads, work, row): channels of bending
# blades into row; pose of the platform
record_bending = chosen_by_class("blades", {type(None): _none_bent, BladeModes: _record_bent}, inlined=True)
