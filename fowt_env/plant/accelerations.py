"""Solves the equation of motion: accelerations of platform, rotor and tower under given loads.

Unknowns with a rigid tower are (v', w', w_b'); the rotor row is eliminated, which leaves a symmetric 6x6
solve (theory.md, Eqs 9, 10 and 13). A flexible tower adds a row for each mode, which is eliminated first.
"""

from math import sqrt

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import State
from fowt_env.plant.tilt import along_shaft
from fowt_env.plant.tower.inertia import (
    cross,
    deflection_rate,
    masses_of,
    top_bias,
    turn,
    upper_of,
    upper_rate,
    with_free_rotor,
)
from fowt_env.plant.tower.modes import TowerModes, bend_by_modes


@kernel
def factor_spd(a):
    """Factor a symmetric positive definite matrix a (6, 6) in place.

    L D L^T with the reciprocals of D on the diagonal: six divisions and no square root.
    """
    for i in range(6):  # a constant count, which the compiler unrolls
        for j in range(i):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = total  # L D
        pivot = a[i, i]
        for j in range(i):
            scaled = a[i, j] * a[j, j]
            pivot -= scaled * a[i, j]
            a[i, j] = scaled  # L
        a[i, i] = 1.0 / pivot


@kernel
def substitute_spd(a, b):
    """Solve for a right-hand side b (6,) in place, with the factors of factor_spd."""
    for i in range(6):
        total = b[i]
        for k in range(i):
            total -= a[i, k] * b[k]
        b[i] = total
    for i in range(5, -1, -1):
        total = b[i] * a[i, i]
        for k in range(i + 1, 6):
            total -= a[k, i] * b[k]
        b[i] = total


@kernel
def accelerate_in_plane(pose, load, torque, added, body, dx):
    """Fill dx with the accelerations of planar motion: rotor and platform are not coupled."""
    m, vx, vz, wy = body.mass_matrix, pose.vx, pose.vz, pose.wy
    px = m[0, 0] * vx + m[0, 2] * vz + m[0, 4] * wy
    pz = m[2, 0] * vx + m[2, 2] * vz + m[2, 4] * wy
    b1, b2 = load.fx - wy * pz, load.fz + wy * px
    b3 = load.my - vz * px + vx * pz
    l11 = sqrt(m[0, 0] + added[0, 0])
    l21, l31 = (m[2, 0] + added[2, 0]) / l11, (m[4, 0] + added[4, 0]) / l11
    l22 = sqrt(m[2, 2] + added[2, 2] - l21 * l21)
    l32 = (m[4, 2] + added[4, 2] - l31 * l21) / l22
    square = m[4, 4] + added[4, 4] - l31 * l31 - l32 * l32
    b1 /= l11
    b2 = (b2 - l21 * b1) / l22
    b3 = (b3 - l31 * b1 - l32 * b2) / square
    b2 = (b2 - l32 * b3) / l22
    dx[State.VX] = (b1 - l21 * b2 - l31 * b3) / l11
    dx[State.VZ] = b2
    dx[State.WY] = b3
    dx[State.VY] = dx[State.WX] = dx[State.WZ] = 0.0
    dx[State.ROTOR_SPEED] = 0.0 if body.rotor_fixed else torque / body.rotor_row


@kernel
def accelerate(pose, x, load, torque, added, body, matrix, cache, dx):
    """Solve (M1 + A_a, M2; M2^T, I_rx) (nu', w_b') = loads - C1 nu - C2 w_b into dx.

    The mass matrix depends on the state alone: its factors stay in matrix (6, 6) until the loads are
    evaluated at another state, which clears the entry FACTORED of the cache.
    """
    b = dx[State.VX : State.WZ + 1]
    if body.platform_fixed:
        b[:] = 0.0
        dx[State.ROTOR_SPEED] = 0.0 if body.rotor_fixed else torque / body.rotor_row
        return
    if body.plane is not None:
        accelerate_in_plane(pose, load, torque, added, body, dx)
        return
    c = momentum_rate(pose, x[State.ROTOR_SPEED], body.mass_matrix, body.coupling, body.tilt)
    b[0] = load.fx - c.fx
    b[1] = load.fy - c.fy
    b[2] = load.fz - c.fz
    b[3] = load.mx - c.mx
    b[4] = load.my - c.my
    b[5] = load.mz - c.mz
    ratio = 0.0 if body.rotor_fixed else body.coupling / body.rotor_row
    if cache[LoadCache.FACTORED] < 0.5:
        for i in range(6):
            for j in range(6):
                matrix[i, j] = body.mass_matrix[i, j] + added[i, j]
        _eliminate_rotor_row(ratio * body.coupling, matrix, body.tilt)
        factor_spd(matrix)
        cache[LoadCache.FACTORED] = 1.0
    _eliminate_rotor_moment(ratio * torque, b, body.tilt)
    substitute_spd(matrix, b)
    if body.rotor_fixed:
        dx[State.ROTOR_SPEED] = 0.0
        return
    turning = along_shaft(b[3], b[5], body.tilt)
    dx[State.ROTOR_SPEED] = (torque - body.coupling * turning) / body.rotor_row


@kernel
def _eliminate_rotor_row(inertia, matrix, tilt):
    """Eliminate the rotor row from the matrix: the rotor inertia lies along the shaft."""
    if tilt is None:
        matrix[3, 3] -= inertia
        return
    c, s = tilt.cosine, tilt.sine
    matrix[3, 3] -= c * c * inertia
    matrix[3, 5] += c * s * inertia
    matrix[5, 3] += c * s * inertia
    matrix[5, 5] -= s * s * inertia


@kernel
def _eliminate_rotor_moment(moment, b, tilt):
    """Eliminate the rotor row from the right-hand side: the rotor moment lies along the shaft."""
    if tilt is None:
        b[3] -= moment
        return
    b[3] -= tilt.cosine * moment
    b[5] += tilt.sine * moment


@inlined_kernel
def _add_body(matrix, d, upper, mass, bend):
    """Add the masses of deflected tower and nacelle to the platform rows (lower triangle)."""
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
    """Fill the rows of the tower modes (lower triangle)."""
    u, px, py, pz = upper, bend.x, bend.y, bend.z
    n, q = len(tower.count), tower.first
    tx, tz = bend.ca, -bend.sa  # axis about which side-side modes rotate the nacelle
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
def subtract_modal_rates(pose, x, fx, fy, mx, my, mz, bend, tower, modal):
    """Subtract velocity terms from modal (n,): of the tower's line mass, and of a wrench at the tower top."""
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
def factor_modes(matrix, n):
    """Eliminate the n modes from the platform's system, last mode first; only the lower triangle is used."""
    for k in range(n - 1, -1, -1):
        row = 6 + k
        over = 1.0 / matrix[row, row]
        for i in range(6 + k):
            factor = matrix[row, i] * over
            for j in range(i + 1):
                matrix[i, j] -= factor * matrix[row, j]


@inlined_kernel
def without_modes(matrix, b, modal, n):
    """Eliminate the modes from the right-hand sides b (6,) and modal (n,), after factor_modes."""
    for k in range(n - 1, -1, -1):
        row = 6 + k
        force = modal[k] / matrix[row, row]
        for i in range(6):
            b[i] -= matrix[row, i] * force
        for i in range(k):
            modal[i] -= matrix[row, 6 + i] * force


@inlined_kernel
def find_modes(matrix, b, modal, n):
    """Fill modal with the accelerations of the deflections, from those of the platform in b."""
    for k in range(n):
        row = 6 + k
        total = modal[k]
        for i in range(6):
            total -= matrix[row, i] * b[i]
        for i in range(k):
            total -= matrix[row, 6 + i] * modal[i]
        modal[k] = total / matrix[row, row]


@kernel
def accelerate_bending(pose, x, load, torque, added, body, tower, matrix, cache, dx):
    """Fill dx with the accelerations of platform, deflections and rotor.

    load: on the whole turbine, about the body origin. On entry dx has the generalised forces on the
    deflections in place of their accelerations. matrix (6 + n, 6 + n) keeps its factors as in accelerate.
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
    # moment of the free rotor by the bias of the rotation, and by the rotor torque
    push = ratio * (torque - body.coupling * (upper.nx * bx + upper.ny * by + upper.nz * bz))
    mx, my, mz = mx + push * upper.nx, my + push * upper.ny, mz + push * upper.nz

    c, e = momentum_rate(pose, 0.0, tower.lower, 0.0, None), deflection_rate(pose, d)
    b[0] = load.fx - c.fx - e.fx - fx
    b[1] = load.fy - c.fy - e.fy - fy
    b[2] = load.fz - c.fz - e.fz - fz
    b[3] = load.mx - c.mx - e.mx - mx - bend.y * fz + bend.z * fy
    b[4] = load.my - c.my - e.my - my - bend.z * fx + bend.x * fz
    b[5] = load.mz - c.mz - e.mz - mz - bend.x * fy + bend.y * fx
    subtract_modal_rates(pose, x, fx, fy, mx, my, mz, bend, tower, modal)

    if cache[LoadCache.FACTORED] < 0.5:
        for i in range(6):
            for j in range(i + 1):
                matrix[i, j] = tower.lower[i, j] + added[i, j]
        _add_body(matrix, d, free, mass, bend)
        _add_modes(x, free, mass, bend, tower, matrix)
        factor_modes(matrix, n)
        if not body.platform_fixed:
            factor_spd(matrix)
        cache[LoadCache.FACTORED] = 1.0
    without_modes(matrix, b, modal, n)
    if body.platform_fixed:
        b[:] = 0.0
    else:
        substitute_spd(matrix, b)
    find_modes(matrix, b, modal, n)
    if body.rotor_fixed:
        dx[State.ROTOR_SPEED] = 0.0
        return
    turning = rotation_along_shaft(bx, by, bz, b, modal, bend, tower, upper.nx, upper.ny, upper.nz)
    dx[State.ROTOR_SPEED] = (torque - body.coupling * turning) / body.rotor_row


@inlined_kernel
def rotation_along_shaft(bx, by, bz, b, modal, bend, tower, nx, ny, nz):
    """Return the angular acceleration of the nacelle along the shaft (nx, ny, nz), of bias (bx, by, bz)."""
    for i in range(0, len(tower.count), 2):
        by += tower.slope[i] * modal[i]
        rolling = tower.slope[i + 1] * modal[i + 1]
        bx -= rolling * bend.ca
        bz += rolling * bend.sa
    return nx * (bx + b[3]) + ny * (by + b[4]) + nz * (bz + b[5])


@inlined_kernel
def _accelerate_rigid(pose, x, load, torque, added, body, tower, matrix, cache, dx):
    accelerate(pose, x, load, torque, added, body, matrix, cache, dx)


# (pose, x, load, torque, added, body, tower, matrix, cache, dx): accelerations into dx
accelerate_turbine = chosen_by_class(
    "tower", {type(None): _accelerate_rigid, TowerModes: accelerate_bending}, inlined=True
)


@kernel
def fill_tower_rates(x, modal, tower, dx):
    """Fill dx with the rates of the deflections and, as input of accelerate_bending, the forces on them."""
    if tower is None:
        return
    n, q = len(tower.count), tower.first
    for i in range(n):
        dx[q + i] = x[q + n + i]
        dx[q + n + i] = modal[i]
