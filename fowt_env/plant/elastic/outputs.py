"""Computes loads and deflections of bending blades, and the loads of rotor and nacelle on shaft and tower.

As in ElastoDyn a load is that of the outer part on the inner one: aerodynamics, weight and inertia. Coned
axes i of a blade: x normal to the cone, downwind; y against the rotation; z outwards. Pitched axes j: i
turned by the blade pitch about z.
"""

from math import sqrt
from typing import NamedTuple

from fowt_env.plant.aero.bent_blade import MOMENT, NORMAL, TANGENTIAL, loaded_at
from fowt_env.plant.aero.blade_shape import bent_lever
from fowt_env.plant.aero.blade_sweep import shape_of
from fowt_env.plant.compile.decorators import inlined_kernel, kernel, shared_kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import (
    COS_AZIMUTH,
    COS_PITCH,
    SIN_AZIMUTH,
    SIN_PITCH,
    BladeModes,
    RotorFrame,
)
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


NO_SECTION_LOAD = SectionLoad(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class BentRotor(NamedTuple):
    """Holds the loads of a rotor whose blades bend, of an instant."""

    frame: RotorFrame
    hub: Wrench  # on the shaft at the rotor centre, non-rotating rotor axes
    first: SectionLoad  # on the root of each blade
    second: SectionLoad
    third: SectionLoad


@inlined_kernel
def _root_motion(number, x, frame, work):
    """Return acceleration (3), with weight, and angular acceleration (3) of a blade's root, pitched axes.

    Of the rotor centre, as of the last solution of the chain.
    """
    f, E, A, speed = frame, work.axes[number], work.motion, x[State.ROTOR_SPEED]
    bx = f.bx + speed * (f.wy * f.nz - f.wz * f.ny) + A[3]
    by = f.by + speed * (f.wz * f.nx - f.wx * f.nz) + A[4]
    bz = f.bz + speed * (f.wx * f.ny - f.wy * f.nx) + A[5]
    ax, ay, az = _turned(E, f.ax + A[0], f.ay + A[1], f.az + A[2])
    bx, by, bz = _turned(E, bx, by, bz)
    return ax, ay, az, bx, by, bz


@inlined_kernel
def _inertial_load(number, x, dx, frame, blades, work):
    """Return the SectionLoad of weight and inertia of a blade about the rotor centre, pitched axes.

    dx: rates, of the last solution of the chain.
    """
    n, m = len(blades.beam.count), blades.beam.mass
    ax, ay, az, bx, by, bz = _root_motion(number, x, frame, work)
    v = blades.first + n * (BLADES + number)
    c, J, X, p = work.moment[number], work.block[number], work.own[number], work.pull[number]
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
def _with_aerodynamics(load, row, turn, blades):
    """Return a SectionLoad plus the BladeLoad in a row of Data.blades; turn: of RotorScratch.turns."""
    c, s, p, q = blades.cone_cosine, blades.cone_sine, turn[COS_PITCH], turn[SIN_PITCH]
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
def _outer_aerodynamics(number, x, c, s, aero, blades, loads):
    """Return the SectionLoads about the rotor centre, by the air, outside of the inner and the outer Section.

    Pitched axes; of the station loads of a blade; c, s: cosine and sine of its pitch.
    """
    if aero is None:
        return NO_SECTION_LOAD, NO_SECTION_LOAD
    elements = aero.rotor.elements
    shape = shape_of(number, x, elements.shape, elements.modes, loads)
    inner = outer = NO_SECTION_LOAD
    for j in range(blades.inner.outside.shape[0]):
        near, far = blades.inner.outside[j], blades.outer.outside[j]
        if near != 0.0 or far != 0.0:
            lever, normal = bent_lever(j, shape), shape.loads[loaded_at(j, NORMAL)]
            tangential, moment = shape.loads[loaded_at(j, TANGENTIAL)], shape.loads[loaded_at(j, MOMENT)]
            load = SectionLoad(
                normal * lever.nx,
                normal * lever.nr,
                tangential,
                lever.r * tangential - lever.t_nr * normal - moment * lever.nr,
                lever.t_nx * normal - lever.x * tangential + moment * lever.nx,
                lever.turn * normal,
            )
            inner = _moved(_plus(inner, near, load), normal, tangential, blades.inner.further[j], lever)
            outer = _moved(_plus(outer, far, load), normal, tangential, blades.outer.further[j], lever)
    return _pitched(inner, c, s, shape.rest), _pitched(outer, c, s, shape.rest)


@inlined_kernel
def _moved(total, normal, tangential, distance, lever):
    """Return a SectionLoad plus the moment of a station's load by a distance outwards along the bent axis."""
    return SectionLoad(
        total.fx, total.fy, total.fz,
        total.mx + distance * lever.nx * tangential,
        total.my + distance * lever.nr * tangential,
        total.mz - distance * normal,
    )  # fmt: skip


@inlined_kernel
def _plus(total, factor, load):
    """Return a SectionLoad plus a factor times another."""
    return SectionLoad(
        total.fx + factor * load.fx, total.fy + factor * load.fy, total.fz + factor * load.fz,
        total.mx + factor * load.mx, total.my + factor * load.my, total.mz + factor * load.mz,
    )  # fmt: skip


@inlined_kernel
def _pitched(load, c, s, rest):
    """Return the SectionLoad in pitched axes of one along the x, r and t of a BladeShape."""
    cosine, sine = rest.cone_cosine, rest.cone_sine
    fx, fz = cosine * load.fx + sine * load.fy, cosine * load.fy - sine * load.fx
    mx, mz = cosine * load.mx + sine * load.my, cosine * load.my - sine * load.mx
    return SectionLoad(
        c * fx + s * load.fz, s * fx - c * load.fz, fz, c * mx + s * load.mz, s * mx - c * load.mz, mz
    )


@inlined_kernel
def _put_particles(number, x, dx, frame, blades, work):
    """Put positions and accelerations of a blade's particles, as factors of section_columns, into work.

    Accelerations are those in a frame whose origin does not accelerate, pitched axes; dx: rates, of the last
    solution of the chain.
    """
    f, E, n, speed = frame, work.axes[number], len(blades.beam.count), x[State.ROTOR_SPEED]
    _, _, _, bx, by, bz = _root_motion(number, x, frame, work)
    wx, wy, wz = _turned(E, f.wx + speed * f.nx, f.wy + speed * f.ny, f.wz + speed * f.nz)
    # of a position: angular acceleration and centrifugal
    xx, yy, zz = -wy * wy - wz * wz, -wx * wx - wz * wz, -wx * wx - wy * wy
    xy, xz, yz = wx * wy - bz, wx * wz + by, wy * wz - bx
    yx, zx, zy = wx * wy + bz, wx * wz - by, wy * wz + bx
    q = blades.first + n * number
    v = q + BLADES * n
    place, ax, ay, az = work.particles[0], work.particles[1], work.particles[2], work.particles[3]
    place[0], ax[0], ay[0], az[0] = 1.0, xz, yz, zz
    at = 1 + 2 * n
    for i in range(n):
        one, two, p, r, a = 1 + i, 1 + n + i, x[q + i], 2.0 * x[v + i], dx[v + i]
        place[one] = place[two] = p
        ax[one], ay[one], az[one] = xx * p + a, yx * p + wz * r, zx * p - wy * r
        ax[two], ay[two], az[two] = xy * p - wz * r, yy * p + a, zy * p + wx * r
        for j in range(i + 1):
            half = 0.5 if i == j else 1.0
            short, shrinking = -half * p * x[q + j], -half * (r * x[q + j] + 2.0 * p * x[v + j])
            place[at] = short
            ax[at], ay[at] = xz * short + wy * shrinking, yz * short - wx * shrinking
            az[at] = zz * short - half * (a * x[q + j] + p * dx[v + j] + r * x[v + j])
            at += 1


@inlined_kernel
def _outer_inertia(number, x, frame, section, blades, work):
    """Return the SectionLoad of weight and inertia outside of a Section about the rotor centre.

    Pitched axes; of the particles that _put_particles has put into work.
    """
    ax, ay, az, _, _, _ = _root_motion(number, x, frame, work)
    n, second, first, m = len(blades.beam.count), section.second, section.first, section.mass
    size, place = first.shape[0], work.particles[0]
    px, py, pz = work.particles[1], work.particles[2], work.particles[3]
    cx = cy = cz = fx = fy = fz = mx = my = mz = 0.0
    for k in range(size):
        X = Y = 0.0
        for i in range(n):
            X += second[k, 1 + i] * place[1 + i]
            Y += second[k, 1 + n + i] * place[1 + n + i]
        Z = second[k, 0]
        for i in range(1 + 2 * n, size):
            Z += second[k, i] * place[i]
        fx += first[k] * px[k]
        fy += first[k] * py[k]
        fz += first[k] * pz[k]
        mx += Y * pz[k] - Z * py[k]
        my += Z * px[k] - X * pz[k]
        mz += X * py[k] - Y * px[k]
    for i in range(n):
        cx += first[1 + i] * place[1 + i]
        cy += first[1 + n + i] * place[1 + n + i]
    cz = first[0]
    for i in range(1 + 2 * n, size):
        cz += first[i] * place[i]
    return SectionLoad(
        -fx - m * ax, -fy - m * ay, -fz - m * az,
        cz * ay - cy * az - mx, cx * az - cz * ax - my, cy * ax - cx * ay - mz,
    )  # fmt: skip


@inlined_kernel
def _section_load(number, x, frame, wind, section, blades, work):
    """Return the SectionLoad at a Section of a blade, about its displaced centre; wind: that of the air."""
    inertia, q = _outer_inertia(number, x, frame, section, blades, work), blades.first
    px, py, pz = _displaced(x, q + len(blades.beam.count) * number, section.point)
    return _about(_plus(inertia, 1.0, wind), px, py, section.distance + pz)


@inlined_kernel
def _bending_moments(load, x, q, section):
    """Return the moments (x, y) of a SectionLoad along the local structural axes of a bent blade.

    q: index of the deflections. The axes are turned by bending, then by the structural twist.
    """
    ahead = side = 0.0
    for i in range(section.point.slope_x.shape[0]):
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
def _hub_load(frame, loads, work):
    """Return the Wrench of the rotor on its shaft at the rotor centre, non-rotating rotor axes."""
    f, h = frame, work.hub_load
    fx = f.nx * h[0] + f.ny * h[1] + f.nz * h[2]
    fy = f.yx * h[0] + f.yy * h[1] + f.yz * h[2]
    fz = f.zx * h[0] + f.zy * h[1] + f.zz * h[2]
    mx = f.nx * h[3] + f.ny * h[4] + f.nz * h[5]
    my = f.yx * h[3] + f.yy * h[4] + f.yz * h[5]
    mz = f.zx * h[3] + f.zy * h[4] + f.zz * h[5]
    for number in range(BLADES):
        row, turn = loads[number], work.turns[number]
        ey, ez = -turn[SIN_AZIMUTH], turn[COS_AZIMUTH]
        fx += row[0]
        fy += row[1] * ey - row[2] * ez
        fz += row[1] * ez + row[2] * ey
        mx += row[3]
        my += row[4] * ey - row[5] * ez
        mz += row[4] * ez + row[5] * ey
    return Wrench(fx, fy, fz, mx, my, mz)


@shared_kernel
def _root_load(number, x, dx, frame, loads, blades, work):
    """Return the SectionLoad of the root of a blade (0, 1, 2), pitched axes."""
    load = _with_aerodynamics(
        _inertial_load(number, x, dx, frame, blades, work), loads[number], work.turns[number], blades
    )
    return _about(load, 0.0, 0.0, blades.hub_radius)


@inlined_kernel
def _no_bending(pose, bend, x, dx, body, structure, tower, blades, loads, work):
    return None


@inlined_kernel
def _bent_rotor(pose, bend, x, dx, body, structure, tower, blades, loads, work):
    frame, _ = rotor_frame(pose, top_of(pose, x, bend, tower), bend, body.gravity, structure)
    return BentRotor(
        frame,
        _hub_load(frame, loads, work),
        _root_load(0, x, dx, frame, loads, blades, work),
        _root_load(1, x, dx, frame, loads, blades, work),
        _root_load(2, x, dx, frame, loads, blades, work),
    )


# (pose, bend, x, dx, body, structure, tower, blades, loads, work) -> BentRotor of bending blades,
# None of rigid ones; pose of the platform
bent_rotor = chosen_by_class("blades", {type(None): _no_bending, BladeModes: _bent_rotor})


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
def _shaft_of_rigid(thrust, torque, rotor):
    return thrust, torque


@inlined_kernel
def _shaft_of_bending(thrust, torque, rotor):
    return rotor.hub.fx, rotor.hub.mx


# (thrust, torque, rotor) -> thrust (N) and torque (N m) of the shaft: those of the rigid rotor, given, or of
# a BentRotor
shaft_load = chosen_by_class("rotor", {type(None): _shaft_of_rigid, BentRotor: _shaft_of_bending})


@shared_kernel
def _record_blade(number, root, x, dx, frame, model, blades, loads, work, row):
    """Fill the channels of a blade (0, 1, 2) into the row of record_bending; root: its SectionLoad."""
    c, s = work.turns[number, COS_PITCH], work.turns[number, SIN_PITCH]
    q = blades.first + len(blades.beam.count) * number
    px, py, pz = _displaced(x, q, blades.tip)
    row[number], row[3 + number], row[6 + number] = c * px + s * py, c * py - s * px, pz
    row[9 + number], row[12 + number] = c * root.fx + s * root.fy, c * root.fy - s * root.fx
    row[15 + number], row[18 + number], row[21 + number] = root.fz, root.mx, root.my
    row[40 + number], row[43 + number], row[46 + number] = px, py, root.mz
    _put_particles(number, x, dx, frame, blades, work)
    near, far = _outer_aerodynamics(number, x, c, s, model.aero, blades, loads)
    inner = _section_load(number, x, frame, near, blades.inner, blades, work)
    outer = _section_load(number, x, frame, far, blades.outer, blades, work)
    row[24 + number], row[27 + number] = _bending_moments(inner, x, q, blades.inner)
    row[30 + number], row[33 + number] = _bending_moments(outer, x, q, blades.outer)


@inlined_kernel
def _none_bent(rotor, x, dx, model, blades, loads, work, row):
    return


@inlined_kernel
def _record_bent(rotor, x, dx, model, blades, loads, work, row):
    for number in range(BLADES):
        root = rotor.first if number == 0 else rotor.second if number == 1 else rotor.third
        _record_blade(number, root, x, dx, rotor.frame, model, blades, loads, work, row)
    hub, c, s = rotor.hub, work.turns[0, COS_AZIMUTH], work.turns[0, SIN_AZIMUTH]
    row[36], row[37] = c * hub.my + s * hub.mz, c * hub.mz - s * hub.my
    row[38], row[39] = hub.fy, hub.fz
    row[49], row[50] = c * hub.fy + s * hub.fz, c * hub.fz - s * hub.fy


# (rotor, x, dx, model, blades, loads, work, row): channels of a BentRotor into row
record_bending = chosen_by_class("rotor", {type(None): _none_bent, BentRotor: _record_bent})
