"""A tower that bends: its modes, where it carries nacelle and rotor, and the equation of motion with it.

theory.md, "A tower that bends". The tower's points move across its axis by the sum of shape times deflection,
and nacelle and rotor turn with the tower's top as one rigid body. With a rigid tower the part is None.
Modes come in pairs, fore-aft and side-side of the same order: even ones are fore-aft, odd ones side-side.
"""

from math import cos, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.handle import by_reference
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.rigid_body import accelerate, momentum_rate, solve_spd, substitute_spd
from fowt_env.plant.state import Pose, State, Wrench

MOST_MODES = 4
# of the fourth difference of the structure's force: the error of Adams-Bashforth 4 (251/720) less that with
# which Adams-Moulton 4 moves the deflections (19/720), so that those of velocity and position cancel
ELASTIC_WEIGHT = 232.0 / 720.0
ELASTIC_ROUNDS = (
    2  # of the correction with its own new force: one is stable to 0.7 over the frequency, two to 1.29
)


@by_reference
class TowerModes(NamedTuple):
    """Modes of a tower, n of them: first fore-aft, first side-side, then the second ones if there are."""

    first: int  # index in the state of the first deflection; the velocities follow the n deflections
    fore_aft: np.ndarray  # (n,) 1.0 fore-aft, 0.0 side-side
    top_height: float  # m, tower top above the body origin; there the shapes are 1
    slope: np.ndarray  # (n,) 1/m, of each shape at the top
    first_moment: np.ndarray  # (n,) kg, integral of the tower's line mass times shape
    height_moment: np.ndarray  # (n,) kg m, of line mass times height above the body origin times shape
    mass: np.ndarray  # (n, n) kg, of line mass times both shapes, pairs across directions too
    stiffness: np.ndarray  # (n, n) N/m, of the structure
    damping: np.ndarray  # (n, n) N s/m, of the structure
    weight_stiffness: np.ndarray  # (n, n) kg/m, times gravity taken off the stiffness: axial shortening
    drag_shape: np.ndarray  # (points, n) shapes at the points of tower_drag.TowerDrag
    count: tuple  # n zeros: its length is known when a kernel is compiled, and so that of every loop
    lower: object = None  # (6, 6) mass matrix of floater and straight tower about the body origin
    straight: object = None  # (6, 6) that of the straight tower alone
    upper_mass: float = 0.0  # kg, of nacelle and rotor
    upper_moment: object = None  # (3,) kg m, their first moment about the tower top, nacelle axes
    upper_inertia: object = None  # (3, 3) kg m2, about the tower top, nacelle axes
    shaft: object = None  # (3,) direction of the shaft, downwind, nacelle axes


class Bend(NamedTuple):
    """Place and motion of the tower's top seen from the platform: the nacelle is turned by Ry(a) Rx(b)."""

    x: float  # m, displacement of the top
    y: float
    z: float  # m, its height
    vx: float  # m/s
    vy: float
    ca: float  # cosine and sine of a and b
    sa: float
    cb: float
    sb: float
    da: float  # rad/s
    db: float


class Twist(NamedTuple):
    """Rates of the velocity components (vx..wz) of a Pose, m/s2 and rad/s2, in its own axes."""

    vx: float
    vy: float
    vz: float
    wx: float
    wy: float
    wz: float


class Masses(NamedTuple):
    """Integrals of line mass over the bent tower, less those of the straight one; d(h) is its deflection."""

    dx: float  # kg m, of d
    dy: float
    ex: float  # kg m2, of h d
    ey: float
    gxx: float  # kg m2, of d d^T
    gxy: float
    gyy: float
    vx: float  # kg m/s, of the rate of d
    vy: float
    wx: float  # kg m2/s, of h times it
    wy: float
    hxx: float  # kg m2/s, of the rate of d times d^T
    hxy: float
    hyx: float
    hyy: float


class Upper(NamedTuple):
    """Nacelle and rotor about the tower top, platform axes."""

    sx: float  # kg m, first moment
    sy: float
    sz: float
    xx: float  # kg m2, inertia
    yy: float
    zz: float
    xy: float
    xz: float
    yz: float
    nx: float  # direction of the shaft
    ny: float
    nz: float


# ---------------------------------------------------------------- where the nacelle is


@kernel
def _straight(x, tower):
    return None


@inlined_kernel
def bend_by_modes(x, tower):
    """Bend of a state."""
    n = len(tower.count)
    q, v = tower.first, tower.first + n
    ux = uy = vx = vy = a = b = da = db = 0.0
    for i in range(0, n, 2):
        ux += x[q + i]
        uy += x[q + i + 1]
        vx += x[v + i]
        vy += x[v + i + 1]
        a += tower.slope[i] * x[q + i]
        b -= tower.slope[i + 1] * x[q + i + 1]
        da += tower.slope[i] * x[v + i]
        db -= tower.slope[i + 1] * x[v + i + 1]
    return Bend(ux, uy, tower.top_height, vx, vy, cos(a), sin(a), cos(b), sin(b), da, db)


# (x, tower) -> Bend of a state, None for a rigid tower
bend_of = chosen_by_class("tower", {type(None): _straight, TowerModes: bend_by_modes})


@kernel
def from_nacelle(bend, x, y, z):
    """Platform components of a vector in nacelle axes."""
    along = bend.sb * y + bend.cb * z
    return bend.ca * x + bend.sa * along, bend.cb * y - bend.sb * z, bend.ca * along - bend.sa * x


@kernel
def to_nacelle(bend, x, y, z):
    """Nacelle components of a vector in platform axes."""
    along = bend.sa * x + bend.ca * z
    return bend.ca * x - bend.sa * z, bend.sb * along + bend.cb * y, bend.cb * along - bend.sb * y


@kernel
def turned_pose(pose, bend):
    """Pose of the frame that is fixed in the nacelle and is the body frame where the tower is straight."""
    if bend is None:
        return pose
    z = bend.z
    r11, r12, r13 = to_nacelle(bend, pose.r11, pose.r12, pose.r13)
    r21, r22, r23 = to_nacelle(bend, pose.r21, pose.r22, pose.r23)
    r31, r32, r33 = to_nacelle(bend, pose.r31, pose.r32, pose.r33)
    wx, wy, wz = to_nacelle(bend, pose.wx, pose.wy, pose.wz)
    wx, wy, wz = wx + bend.db, wy + bend.cb * bend.da, wz - bend.sb * bend.da
    vx, vy, vz = to_nacelle(
        bend,
        pose.vx + pose.wy * z - pose.wz * bend.y + bend.vx,
        pose.vy + pose.wz * bend.x - pose.wx * z + bend.vy,
        pose.vz + pose.wx * bend.y - pose.wy * bend.x,
    )
    return Pose(
        pose.x + pose.r11 * bend.x + pose.r12 * bend.y + (pose.r13 - r13) * z,
        pose.y + pose.r21 * bend.x + pose.r22 * bend.y + (pose.r23 - r23) * z,
        pose.z + pose.r31 * bend.x + pose.r32 * bend.y + (pose.r33 - r33) * z,
        r11, r12, r13, r21, r22, r23, r31, r32, r33,
        vx - wy * z, vy + wx * z, vz, wx, wy, wz,
    )  # fmt: skip


@kernel
def nacelle_pose(pose, x, tower):
    """Pose of the frame fixed in the nacelle that is the body frame where the tower is straight.

    Its origin is where the body origin would be, were that fixed to the nacelle: every point of nacelle and
    rotor has in it the coordinates that it has in the body frame of a rigid tower. Rigid (None): pose.
    """
    return turned_pose(pose, bend_of(x, tower))


# ---------------------------------------------------------------- loads


@kernel
def carried(load, bend):
    """A wrench in nacelle axes about the nacelle frame's origin as one about the body origin, body axes."""
    if bend is None:
        return load
    fx, fy, fz = from_nacelle(bend, load.fx, load.fy, load.fz)
    mx, my, mz = from_nacelle(bend, load.mx + bend.z * load.fy, load.my - bend.z * load.fx, load.mz)
    return Wrench(
        fx, fy, fz,
        mx + bend.y * fz - bend.z * fy,
        my + bend.z * fx - bend.x * fz,
        mz + bend.x * fy - bend.y * fx,
    )  # fmt: skip


@kernel
def add_modal(load, bend, tower, modal):
    """Add to modal (n,) the generalised forces of a wrench of the nacelle; nothing with a rigid tower."""
    if bend is None:
        return
    fx, fy, _ = from_nacelle(bend, load.fx, load.fy, load.fz)
    turning = bend.cb * (load.my - bend.z * load.fx) - bend.sb * load.mz
    rolling = load.mx + bend.z * load.fy
    for i in range(0, len(tower.count), 2):
        modal[i] += fx + tower.slope[i] * turning
        modal[i + 1] += fy - tower.slope[i + 1] * rolling


@inlined_kernel
def begin_modal(x, tower, modal):
    """Set modal (n,) to the generalised forces of the tower's structure; nothing with a rigid tower."""
    if tower is None:
        return
    n = len(tower.count)
    q, v = tower.first, tower.first + n
    for i in range(n):
        force = 0.0
        for j in range(n):
            force -= tower.stiffness[i, j] * x[q + j] + tower.damping[i, j] * x[v + j]
        modal[i] = force


@inlined_kernel
def shortening(x, tower):
    """First moment of mass (kg m) by which bending brings the masses nearer to the tower base."""
    n, q = len(tower.count), tower.first
    total = 0.0
    for i in range(n):
        for j in range(n):
            total += 0.5 * x[q + i] * tower.weight_stiffness[i, j] * x[q + j]
    return total


@inlined_kernel
def displaced_moment(x, bend, tower):
    """(x, y, z) kg m: how far bending moves the whole turbine's first moment of mass, platform axes."""
    n, q = len(tower.count), tower.first
    dx = dy = 0.0
    for i in range(0, n, 2):
        dx += tower.first_moment[i] * x[q + i]
        dy += tower.first_moment[i + 1] * x[q + i + 1]
    s, m = tower.upper_moment, tower.upper_mass
    sx, sy, sz = from_nacelle(bend, s[0], s[1], s[2])
    return dx + m * bend.x + sx - s[0], dy + m * bend.y + sy - s[1], sz - s[2] - shortening(x, tower)


@kernel
def add_bent_weight(load, pose, x, bend, tower, gravity):
    """The load with the moment that bending adds to the weight of a straight turbine."""
    if bend is None:
        return load
    sx, sy, sz = displaced_moment(x, bend, tower)
    g, nx, ny, nz = gravity, pose.r31, pose.r32, pose.r33
    return Wrench(
        load.fx, load.fy, load.fz,
        load.mx + g * (sz * ny - sy * nz),
        load.my + g * (sx * nz - sz * nx),
        load.mz + g * (sy * nx - sx * ny),
    )  # fmt: skip


@kernel
def add_modal_weight(pose, x, bend, tower, gravity, modal):
    """Add to modal (n,) the generalised forces of the weight; nothing with a rigid tower."""
    if bend is None:
        return
    n, q, g = len(tower.count), tower.first, gravity
    s, m = tower.upper_moment, tower.upper_mass
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    sx, sy, sz = from_nacelle(bend, s[0], s[1], s[2])
    turning = sx * nz - sz * nx  # moment about the top over g, along y
    rolling = bend.ca * (sz * ny - sy * nz) - bend.sa * (sy * nx - sx * ny)  # along the turned x axis
    for i in range(n):
        raised = 0.0
        for j in range(n):
            raised += tower.weight_stiffness[i, j] * x[q + j]
        modal[i] += g * nz * raised
    for i in range(0, n, 2):
        modal[i] += g * (tower.slope[i] * turning - (m + tower.first_moment[i]) * nx)
        modal[i + 1] -= g * (tower.slope[i + 1] * rolling + (m + tower.first_moment[i + 1]) * ny)


# ---------------------------------------------------------------- inertia


@inlined_kernel
def masses_of(x, tower):
    """Masses of a state."""
    n = len(tower.count)
    q, v = tower.first, tower.first + n
    dx = dy = ex = ey = gxx = gxy = gyy = vx = vy = wx = wy = hxx = hxy = hyx = hyy = 0.0
    for i in range(0, n, 2):
        qx, qy, ux, uy = x[q + i], x[q + i + 1], x[v + i], x[v + i + 1]
        dx += tower.first_moment[i] * qx
        dy += tower.first_moment[i + 1] * qy
        vx += tower.first_moment[i] * ux
        vy += tower.first_moment[i + 1] * uy
        ex += tower.height_moment[i] * qx
        ey += tower.height_moment[i + 1] * qy
        wx += tower.height_moment[i] * ux
        wy += tower.height_moment[i + 1] * uy
        for j in range(0, n, 2):
            px, py = x[q + j], x[q + j + 1]
            xx, xy = tower.mass[i, j] * px, tower.mass[i, j + 1] * py
            yx, yy = tower.mass[i + 1, j] * px, tower.mass[i + 1, j + 1] * py
            gxx += qx * xx
            gxy += qx * xy
            gyy += qy * yy
            hxx += ux * xx
            hxy += ux * xy
            hyx += uy * yx
            hyy += uy * yy
    return Masses(dx, dy, ex, ey, gxx, gxy, gyy, vx, vy, wx, wy, hxx, hxy, hyx, hyy)


@inlined_kernel
def upper_of(bend, tower):
    """Upper of a bent tower."""
    s, m, t = tower.upper_moment, tower.upper_inertia, tower.shaft
    sx, sy, sz = from_nacelle(bend, s[0], s[1], s[2])
    nx, ny, nz = from_nacelle(bend, t[0], t[1], t[2])
    ax, ay, az = from_nacelle(bend, m[0, 0], m[1, 0], m[2, 0])  # rows of (A I)^T
    bx, by, bz = from_nacelle(bend, m[0, 1], m[1, 1], m[2, 1])
    cx, cy, cz = from_nacelle(bend, m[0, 2], m[1, 2], m[2, 2])
    xx, xy, xz = from_nacelle(bend, ax, bx, cx)
    _, yy, yz = from_nacelle(bend, ay, by, cy)
    _, _, zz = from_nacelle(bend, az, bz, cz)
    return Upper(sx, sy, sz, xx, yy, zz, xy, xz, yz, nx, ny, nz)


@inlined_kernel
def with_free_rotor(upper, inertia):
    """Upper without an inertia (kg m2) about the shaft."""
    u = upper
    nx, ny, nz = inertia * u.nx, inertia * u.ny, inertia * u.nz
    return Upper(
        u.sx, u.sy, u.sz,
        u.xx - nx * u.nx, u.yy - ny * u.ny, u.zz - nz * u.nz,
        u.xy - nx * u.ny, u.xz - nx * u.nz, u.yz - ny * u.nz,
        u.nx, u.ny, u.nz,
    )  # fmt: skip


@kernel
def turn(upper, x, y, z):
    """Inertia of Upper times a vector."""
    u = upper
    return u.xx * x + u.xy * y + u.xz * z, u.xy * x + u.yy * y + u.yz * z, u.xz * x + u.yz * y + u.zz * z


@kernel
def cross(ax, ay, az, bx, by, bz):
    """Cross product a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inlined_kernel
def top_bias(pose, bend):
    """Acceleration of the tower top and of the nacelle's rotation, and the nacelle's angular velocity.

    Platform axes, with no rate of any velocity: (ax, ay, az, alpha_x, alpha_y, alpha_z, wx, wy, wz).
    """
    wx, wy, wz = pose.wx, pose.wy, pose.wz
    # w x (v + w x p + p') + w x p', the top's own acceleration apart
    ux = pose.vx + wy * bend.z - wz * bend.y + 2.0 * bend.vx
    uy = pose.vy + wz * bend.x - wx * bend.z + 2.0 * bend.vy
    uz = pose.vz + wx * bend.y - wy * bend.x
    ax, ay, az = cross(wx, wy, wz, ux, uy, uz)
    tx, ty, tz = bend.db * bend.ca, bend.da, -bend.db * bend.sa  # turning against the platform
    bx, by, bz = cross(wx, wy, wz, tx, ty, tz)
    spread = bend.da * bend.db
    bx, bz = bx - spread * bend.sa, bz - spread * bend.ca
    return ax, ay, az, bx, by, bz, wx + tx, wy + ty, wz + tz


@inlined_kernel
def upper_rate(upper, mass, spin, ax, ay, az, bx, by, bz, wx, wy, wz):
    """Rate of momentum of nacelle and rotor about the tower top, platform axes: (force, moment), six numbers.

    a: acceleration of the top; b: of the nacelle's rotation; w: its angular velocity. spin: angular momentum
    of the rotor against the nacelle, N m s, which is constant along the shaft.
    """
    u = upper
    px, py, pz = cross(wx, wy, wz, u.sx, u.sy, u.sz)
    cx, cy, cz = cross(wx, wy, wz, px, py, pz)
    dx, dy, dz = cross(bx, by, bz, u.sx, u.sy, u.sz)
    kx, ky, kz = turn(u, wx, wy, wz)
    gx, gy, gz = cross(wx, wy, wz, kx + spin * u.nx, ky + spin * u.ny, kz + spin * u.nz)
    sx, sy, sz = cross(u.sx, u.sy, u.sz, ax, ay, az)
    tx, ty, tz = turn(u, bx, by, bz)
    return (
        mass * ax + cx + dx, mass * ay + cy + dy, mass * az + cz + dz,
        gx + sx + tx, gy + sy + ty, gz + sz + tz,
    )  # fmt: skip


@inlined_kernel
def deflection_rate(pose, d):
    """Wrench about the body origin: what velocities and deflections d (Masses) add to the straight tower's
    rate of momentum, with no rate of any velocity.
    """
    vx, vy, vz, wx, wy, wz = pose.vx, pose.vy, pose.vz, pose.wx, pose.wy, pose.wz
    px, py, pz = cross(wx, wy, wz, d.dx, d.dy, 0.0)
    fx, fy, fz = cross(wx, wy, wz, px + 2.0 * d.vx, py + 2.0 * d.vy, pz)
    ax, ay, az = cross(wx, wy, wz, vx, vy, vz)
    mx, my, mz = cross(d.dx, d.dy, 0.0, ax, ay, az)
    kx = d.gyy * wx - d.gxy * wy - d.ex * wz
    ky = d.gxx * wy - d.gxy * wx - d.ey * wz
    kz = (d.gxx + d.gyy) * wz - d.ex * wx - d.ey * wy
    gx, gy, gz = cross(wx, wy, wz, kx, ky, kz)
    growth = d.hxx + d.hyy
    return Wrench(
        fx, fy, fz,
        mx + gx + 2.0 * (growth * wx - d.hxx * wx - d.hxy * wy - d.wx * wz),
        my + gy + 2.0 * (growth * wy - d.hyx * wx - d.hyy * wy - d.wy * wz),
        mz + gz + 2.0 * growth * wz,
    )  # fmt: skip


# ---------------------------------------------------------------- equation of motion


@inlined_kernel
def _add_body(matrix, d, upper, mass, bend):
    """Add to the platform's rows (lower triangle) the bent tower's and the nacelle's masses."""
    u, px, py, pz = upper, bend.x, bend.y, bend.z
    sx, sy, sz = d.dx + mass * px + u.sx, d.dy + mass * py + u.sy, mass * pz + u.sz
    matrix[0, 0] += mass
    matrix[1, 1] += mass
    matrix[2, 2] += mass
    matrix[3, 1] -= sz
    matrix[3, 2] += sy
    matrix[4, 0] += sz
    matrix[4, 2] -= sx
    matrix[5, 0] -= sy
    matrix[5, 1] += sx
    tx, ty, tz = mass * px + 2.0 * u.sx, mass * py + 2.0 * u.sy, mass * pz + 2.0 * u.sz
    xx, yy, zz = px * tx, py * ty, pz * tz
    matrix[3, 3] += u.xx + yy + zz + d.gyy
    matrix[4, 4] += u.yy + zz + xx + d.gxx
    matrix[5, 5] += u.zz + xx + yy + d.gxx + d.gyy
    matrix[4, 3] += u.xy - mass * px * py - px * u.sy - py * u.sx - d.gxy
    matrix[5, 3] += u.xz - mass * px * pz - px * u.sz - pz * u.sx - d.ex
    matrix[5, 4] += u.yz - mass * py * pz - py * u.sz - pz * u.sy - d.ey


@inlined_kernel
def _add_modes(x, upper, mass, bend, tower, matrix):
    """Fill the rows of the modes (lower triangle)."""
    u, px, py, pz = upper, bend.x, bend.y, bend.z
    n, q = len(tower.count), tower.first
    tx, tz = bend.ca, -bend.sa  # axis about which side-side modes turn the nacelle
    ax, ay, az = u.xy, u.yy, u.yz  # inertia times the y axis
    bx, by, bz = turn(u, tx, 0.0, tz)
    cx, cy, cz = cross(tx, 0.0, tz, u.sx, u.sy, u.sz)
    for i in range(0, n, 2):
        over_x = over_y = 0.0  # integrals of line mass times shape times the other direction's deflection
        for j in range(0, n, 2):
            over_x += tower.mass[i + 1, j] * x[q + j]
            over_y += tower.mass[i, j + 1] * x[q + j + 1]
        slope, moment, height = tower.slope[i], tower.first_moment[i], tower.height_moment[i]
        lx, lz = mass + slope * u.sz, -slope * u.sx  # m e + theta x s
        kx, ky, kz = slope * ax, u.sz + slope * ay, slope * az - u.sy  # s x e + I theta
        row = 6 + i
        matrix[row, 0], matrix[row, 1], matrix[row, 2] = lx + moment, 0.0, lz
        matrix[row, 3] = kx + py * lz
        matrix[row, 4] = ky + pz * lx - px * lz + height
        matrix[row, 5] = kz - py * lx - over_y
        for j in range(0, i + 2, 2):
            matrix[row, 6 + j] = lx + tower.slope[j] * ky + tower.mass[i, j]
            if j < i:
                matrix[row, 7 + j] = -tower.slope[j + 1] * (tx * kx + tz * kz)
        slope, moment, height = -tower.slope[i + 1], tower.first_moment[i + 1], tower.height_moment[i + 1]
        lx, ly, lz = slope * cx, mass + slope * cy, slope * cz
        kx, ky, kz = slope * bx - u.sz, slope * by, slope * bz + u.sx
        row = 7 + i
        matrix[row, 0], matrix[row, 1], matrix[row, 2] = lx, ly + moment, lz
        matrix[row, 3] = kx + py * lz - pz * ly - height
        matrix[row, 4] = ky + pz * lx - px * lz
        matrix[row, 5] = kz + px * ly - py * lx + over_x
        for j in range(0, i + 2, 2):
            matrix[row, 6 + j] = lx + tower.slope[j] * ky
            matrix[row, 7 + j] = ly - tower.slope[j + 1] * (tx * kx + tz * kz) + tower.mass[i + 1, j + 1]


@inlined_kernel
def _take_modal_rates(pose, x, fx, fy, mx, my, mz, bend, tower, modal):
    """Take off modal (n,) the terms of velocities: of the tower's line mass, and of a wrench at its top."""
    n = len(tower.count)
    q, v = tower.first, tower.first + n
    wx, wy, wz = pose.wx, pose.wy, pose.wz
    ax, ay, _ = cross(wx, wy, wz, pose.vx, pose.vy, pose.vz)
    rolling = bend.ca * mx - bend.sa * mz
    for i in range(0, n, 2):
        xx = xy = yx = yy = vx = vy = 0.0
        for j in range(0, n, 2):
            xx += tower.mass[i, j] * x[q + j]
            xy += tower.mass[i, j + 1] * x[q + j + 1]
            yx += tower.mass[i + 1, j] * x[q + j]
            yy += tower.mass[i + 1, j + 1] * x[q + j + 1]
            vx += tower.mass[i + 1, j] * x[v + j]
            vy += tower.mass[i, j + 1] * x[v + j + 1]
        modal[i] -= (
            fx + tower.slope[i] * my + tower.first_moment[i] * ax + tower.height_moment[i] * wx * wz
            + wx * wy * xy - (wy * wy + wz * wz) * xx - 2.0 * wz * vy
        )  # fmt: skip
        modal[i + 1] -= (
            fy - tower.slope[i + 1] * rolling + tower.first_moment[i + 1] * ay
            + tower.height_moment[i + 1] * wy * wz
            + wx * wy * yx - (wx * wx + wz * wz) * yy + 2.0 * wz * vx
        )  # fmt: skip


@inlined_kernel
def _factor_modes(matrix, n):
    """Take the n modes out of the platform's system, the last first; the lower triangle alone counts."""
    for k in range(n - 1, -1, -1):
        row = 6 + k
        over = 1.0 / matrix[row, row]
        for i in range(6 + k):
            factor = matrix[row, i] * over
            for j in range(i + 1):
                matrix[i, j] -= factor * matrix[row, j]


@inlined_kernel
def _without_modes(matrix, b, modal, n):
    """Take the modes out of the right-hand sides b (6,) and modal (n,), with what _factor_modes has left."""
    for k in range(n - 1, -1, -1):
        row = 6 + k
        force = modal[k] / matrix[row, row]
        for i in range(6):
            b[i] -= matrix[row, i] * force
        for i in range(k):
            modal[i] -= matrix[row, 6 + i] * force


@inlined_kernel
def _find_modes(matrix, b, modal, n):
    """Put the accelerations of the deflections into modal, from those of the platform in b."""
    for k in range(n):
        row = 6 + k
        total = modal[k]
        for i in range(6):
            total -= matrix[row, i] * b[i]
        for i in range(k):
            total -= matrix[row, 6 + i] * modal[i]
        modal[k] = total / matrix[row, row]


@kernel
def accelerate_bending(pose, x, load, torque, added, body, tower, matrix, dx):
    """Put the accelerations of platform, deflections and rotor into dx.

    load: on the whole turbine, about the body origin. dx comes with the generalised forces on the deflections
    where it has the rates of their velocities. matrix (6 + n, 6 + n) is scratch.
    """
    n = len(tower.count)
    b, modal = dx[State.VX : State.WZ + 1], dx[tower.first + n : tower.first + 2 * n]
    bend, d, mass = bend_by_modes(x, tower), masses_of(x, tower), tower.upper_mass
    upper = upper_of(bend, tower)
    spin = body.coupling * x[State.ROTOR_SPEED]
    ratio = 0.0 if body.rotor_fixed else body.coupling / body.rotor_row
    free = with_free_rotor(upper, ratio * body.coupling)
    ax, ay, az, bx, by, bz, wx, wy, wz = top_bias(pose, bend)
    fx, fy, fz, mx, my, mz = upper_rate(upper, mass, spin, ax, ay, az, bx, by, bz, wx, wy, wz)
    # what the free rotor takes of the rotation's bias, and its own torque on the nacelle
    push = ratio * (torque - body.coupling * (upper.nx * bx + upper.ny * by + upper.nz * bz))
    mx, my, mz = mx + push * upper.nx, my + push * upper.ny, mz + push * upper.nz

    c, e = momentum_rate(pose, 0.0, tower.lower, 0.0, None), deflection_rate(pose, d)
    b[0] = load.fx - c.fx - e.fx - fx
    b[1] = load.fy - c.fy - e.fy - fy
    b[2] = load.fz - c.fz - e.fz - fz
    b[3] = load.mx - c.mx - e.mx - mx - bend.y * fz + bend.z * fy
    b[4] = load.my - c.my - e.my - my - bend.z * fx + bend.x * fz
    b[5] = load.mz - c.mz - e.mz - mz - bend.x * fy + bend.y * fx
    _take_modal_rates(pose, x, fx, fy, mx, my, mz, bend, tower, modal)

    for i in range(6):
        for j in range(i + 1):
            matrix[i, j] = tower.lower[i, j] + added[i, j]
    _add_body(matrix, d, free, mass, bend)
    _add_modes(x, free, mass, bend, tower, matrix)
    _factor_modes(matrix, n)
    _without_modes(matrix, b, modal, n)
    if body.platform_fixed:
        b[:] = 0.0
    else:
        solve_spd(matrix, b)
    _find_modes(matrix, b, modal, n)
    if body.rotor_fixed:
        dx[State.ROTOR_SPEED] = 0.0
        return
    turning = _along_shaft(bx, by, bz, b, modal, bend, tower, upper.nx, upper.ny, upper.nz)
    dx[State.ROTOR_SPEED] = (torque - body.coupling * turning) / body.rotor_row


@inlined_kernel
def _along_shaft(bx, by, bz, b, modal, bend, tower, nx, ny, nz):
    """Rate of the nacelle's rotation along the shaft (n), of its bias (b) and the accelerations."""
    for i in range(0, len(tower.count), 2):
        by += tower.slope[i] * modal[i]
        rolling = tower.slope[i + 1] * modal[i + 1]
        bx -= rolling * bend.ca
        bz += rolling * bend.sa
    return nx * (bx + b[3]) + ny * (by + b[4]) + nz * (bz + b[5])


@inlined_kernel
def _accelerate_rigid(pose, x, load, torque, added, body, tower, matrix, dx):
    accelerate(pose, x, load, torque, added, body, matrix, dx)


# (pose, x, load, torque, added, body, tower, matrix, dx): accelerations into dx
accelerate_turbine = chosen_by_class(
    "tower", {type(None): _accelerate_rigid, TowerModes: accelerate_bending}, inlined=True
)


@kernel
def fill_tower_rates(x, modal, tower, dx):
    """Put the rates of the deflections into dx, and for accelerate_bending the forces on them."""
    if tower is None:
        return
    n, q = len(tower.count), tower.first
    for i in range(n):
        dx[q + i] = x[q + n + i]
        dx[q + n + i] = modal[i]


@kernel
def fill_impulse(load, x, bend, tower, still, dx):
    """Put into `still` the deflections of x, and into dx the forces on them of a wrench of the nacelle."""
    if bend is None:
        return
    n, q = len(tower.count), tower.first
    for i in range(n):
        still[q + i] = x[q + i]
        dx[q + n + i] = 0.0
    add_modal(load, bend, tower, dx[q + n :])


@kernel
def add_tower_steps(dt, dx, tower, x):
    """Add dt times the rates in dx to the velocities of the deflections in x."""
    if tower is None:
        return
    v = tower.first + len(tower.count)
    for i in range(v, v + len(tower.count)):
        x[i] += dt * dx[i]


# ---------------------------------------------------------------- time steps


@kernel
def keep_elastic(x, tower, elastic):
    """Put the forces of the tower's structure at a state before those of past steps; nothing when rigid."""
    if tower is None:
        return
    for k in range(elastic.shape[0] - 1, 0, -1):
        for i in range(elastic.shape[1]):
            elastic[k, i] = elastic[k - 1, i]
    begin_modal(x, tower, elastic[0])


@kernel
def correct_elastic(dt, x, history, body, tower, matrix, elastic, still, extra, y):
    """Correct in y the velocities of Adams-Bashforth 4 for the force of the tower's structure.

    It is linear in the new deflections and velocities, so that its fourth difference with them is known for
    little: theory.md, section 6.3. matrix: what the solve at the step's beginning has left; still and extra
    (n_state,) are scratch.
    """
    if tower is None:
        return
    n, q = len(tower.count), tower.first
    v = q + n
    b, modal = extra[State.VX : State.WZ + 1], extra[v : v + n]
    new, done = still[v : v + n], still[q:v]
    done[:] = 0.0
    bend, t = bend_by_modes(x, tower), tower.shaft
    nx, ny, nz = from_nacelle(bend, t[0], t[1], t[2])
    for _ in range(ELASTIC_ROUNDS):
        for i in range(n):
            y[q + i] = x[q + i] + dt / 24.0 * (
                9.0 * y[v + i] + 19.0 * history[0, q + i] - 5.0 * history[1, q + i] + history[2, q + i]
            )  # fmt: skip
        begin_modal(y, tower, new)
        for i in range(n):
            past = 4.0 * (elastic[0, i] + elastic[2, i]) - 6.0 * elastic[1, i] - elastic[3, i]
            force = ELASTIC_WEIGHT * (new[i] - past)
            modal[i] = force - done[i]
            done[i] = force
        b[:] = 0.0
        _without_modes(matrix, b, modal, n)
        if body.platform_fixed:
            b[:] = 0.0
        else:
            substitute_spd(matrix, b)
        _find_modes(matrix, b, modal, n)
        for i in range(6):
            y[State.VX + i] += dt * b[i]
        for i in range(n):
            y[v + i] += dt * modal[i]
        if not body.rotor_fixed:
            turning = _along_shaft(0.0, 0.0, 0.0, b, modal, bend, tower, nx, ny, nz)
            y[State.ROTOR_SPEED] -= dt * body.coupling / body.rotor_row * turning


# ---------------------------------------------------------------- rates of the nacelle and above the base


@kernel
def _platform_rates(pose, bend, dx, tower):
    return Twist(dx[State.VX], dx[State.VY], dx[State.VZ], dx[State.WX], dx[State.WY], dx[State.WZ])


@kernel
def _top_rates(pose, bend, dx, tower):
    """Absolute acceleration of the tower top and of the nacelle's rotation, platform axes: Twist."""
    v = tower.first + len(tower.count)
    ax, ay, az, bx, by, bz, _, _, _ = top_bias(pose, bend)
    for i in range(0, len(tower.count), 2):
        rolling = tower.slope[i + 1] * dx[v + i + 1]
        ax += dx[v + i]
        ay += dx[v + i + 1]
        bx -= rolling * bend.ca
        by += tower.slope[i] * dx[v + i]
        bz += rolling * bend.sa
    wx, wy, wz = dx[State.WX], dx[State.WY], dx[State.WZ]
    return Twist(
        ax + dx[State.VX] + wy * bend.z - wz * bend.y,
        ay + dx[State.VY] + wz * bend.x - wx * bend.z,
        az + dx[State.VZ] + wx * bend.y - wy * bend.x,
        bx + wx, by + wy, bz + wz,
    )  # fmt: skip


@kernel
def _nacelle_rates(pose, bend, dx, tower):
    top = _top_rates(pose, bend, dx, tower)
    now, z = turned_pose(pose, bend), bend.z
    ax, ay, az = to_nacelle(bend, top.vx, top.vy, top.vz)
    bx, by, bz = to_nacelle(bend, top.wx, top.wy, top.wz)
    wx, wy, wz = now.wx, now.wy, now.wz
    # of the frame's origin, which lies z below the top, then of its components
    ax, ay, az = ax - by * z - wx * wz * z, ay + bx * z - wy * wz * z, az + (wx * wx + wy * wy) * z
    cx, cy, cz = cross(wx, wy, wz, now.vx, now.vy, now.vz)
    return Twist(ax - cx, ay - cy, az - cz, bx, by, bz)


# (pose, bend, dx, tower) -> Twist of nacelle_pose, from the rates of a state
nacelle_rates = chosen_by_class("tower", {type(None): _platform_rates, TowerModes: _nacelle_rates})


@kernel
def above_base_rate(pose, x, dx, bend, body, tower):
    """Wrench about the body origin, body axes: rate of momentum of the bent tower, nacelle and rotor."""
    n, mass = len(tower.count), tower.upper_mass
    q, v = tower.first, tower.first + n
    top, upper, d = _top_rates(pose, bend, dx, tower), upper_of(bend, tower), masses_of(x, tower)
    _, _, _, _, _, _, wx, wy, wz = top_bias(pose, bend)
    spin = body.coupling * x[State.ROTOR_SPEED]
    fx, fy, fz, mx, my, mz = upper_rate(
        upper, mass, spin, top.vx, top.vy, top.vz, top.wx, top.wy, top.wz, wx, wy, wz
    )
    spun = body.coupling * dx[State.ROTOR_SPEED]
    mx += spun * upper.nx + bend.y * fz - bend.z * fy
    my += spun * upper.ny + bend.z * fx - bend.x * fz
    mz += spun * upper.nz + bend.x * fy - bend.y * fx

    c, e, m = momentum_rate(pose, 0.0, tower.straight, 0.0, None), deflection_rate(pose, d), tower.straight
    ax, ay, az = dx[State.VX], dx[State.VY], dx[State.VZ]
    bx, by, bz = dx[State.WX], dx[State.WY], dx[State.WZ]
    px, py, pz = cross(bx, by, bz, d.dx, d.dy, 0.0)
    kx, ky, kz = cross(d.dx, d.dy, 0.0, ax, ay, az)
    fx, fy, fz = fx + c.fx + e.fx + px, fy + c.fy + e.fy + py, fz + c.fz + e.fz + pz
    mx += c.mx + e.mx + kx + d.gyy * bx - d.gxy * by - d.ex * bz
    my += c.my + e.my + ky + d.gxx * by - d.gxy * bx - d.ey * bz
    mz += c.mz + e.mz + kz + (d.gxx + d.gyy) * bz - d.ex * bx - d.ey * by
    for i in range(0, n, 2):
        over_x, over_y = dx[v + i], dx[v + i + 1]
        fx += tower.first_moment[i] * over_x
        fy += tower.first_moment[i + 1] * over_y
        mx -= tower.height_moment[i + 1] * over_y
        my += tower.height_moment[i] * over_x
        for j in range(0, n, 2):
            mz += tower.mass[i + 1, j] * x[q + j] * over_y - tower.mass[i, j + 1] * x[q + j + 1] * over_x
    for j in range(6):
        a = dx[State.VX + j]
        fx += m[0, j] * a
        fy += m[1, j] * a
        fz += m[2, j] * a
        mx += m[3, j] * a
        my += m[4, j] * a
        mz += m[5, j] * a
    return Wrench(fx, fy, fz, mx, my, mz)
