"""Solves the equation of motion of a turbine with elastic parts: platform, tower, nacelle, shaft, blades.

The rotor is one (6, 6) inertia with a bias (blades.py). The speed of the generator is eliminated, the nacelle
is added, then the modes of the tower are eliminated, and the platform remains. Weight of nacelle and rotor,
and that of the bent tower, enters as an upward acceleration of their frames, so it is not in the other loads.
A shaft that twists adds one unknown to this solution for a rigid shaft (shaft.py).
"""

from typing import NamedTuple

from fowt_env.plant.accelerations import accelerate, factor_spd, substitute_spd
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import RotorFrame, condense_rotor, fill_blade_accelerations
from fowt_env.plant.elastic.shaft import MOBILITY, SHARE, SMOOTH, Torsion, generator_speed, torsion_torque
from fowt_env.plant.elastic.structure import Structure
from fowt_env.plant.elastic.tower import (
    Bend,
    TowerModes,
    from_nacelle,
    kept_bend,
    push_modes,
    to_nacelle,
    top_bias,
    top_motion,
)
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import State, assign, cross

FREE = (
    6  # entry of RotorScratch.place: inverse of the inertia of rotor and generator, 1/(kg m2), zero if held
)


class Top(NamedTuple):
    """Holds the motion of the frame that carries nacelle and rotor, platform axes, for zero accelerations.

    Its origin is the tower top of a flexible tower, and the body origin with a rigid one.
    """

    x: float  # m, from the body origin
    y: float
    z: float
    ax: float  # m/s2, without gravity
    ay: float
    az: float
    bx: float  # rad/s2
    by: float
    bz: float
    wx: float  # rad/s
    wy: float
    wz: float


@kernel
def _top_of_rigid(pose, x, bend, tower):
    ax, ay, az = cross(pose.wx, pose.wy, pose.wz, pose.vx, pose.vy, pose.vz)
    return Top(0.0, 0.0, 0.0, ax, ay, az, 0.0, 0.0, 0.0, pose.wx, pose.wy, pose.wz)


@kernel
def _top_of_bent(pose, x, bend, tower):
    ax, ay, az, bx, by, bz, wx, wy, wz = top_bias(pose, x, bend, tower)
    return Top(bend.x, bend.y, bend.z, ax, ay, az, bx, by, bz, wx, wy, wz)


@kernel
def _same_axes(bend, x, y, z):
    return x, y, z


# (pose, x, bend, tower) -> Top
top_of = chosen_by_class("tower", {type(None): _top_of_rigid, TowerModes: _top_of_bent})
# (bend, x, y, z) -> platform components of a vector in nacelle axes
to_platform = chosen_by_class("bend", {type(None): _same_axes, Bend: from_nacelle})
to_nacelle_axes = chosen_by_class("bend", {type(None): _same_axes, Bend: to_nacelle})


@inlined_kernel
def rotor_frame(pose, top, bend, gravity, structure):
    """Return (RotorFrame, rotor centre from the origin of Top (3)), platform axes."""
    c, s = structure.tilt_cosine, structure.tilt_sine
    dx, dy, dz = to_platform(bend, structure.centre[0], structure.centre[1], structure.centre[2])
    nx, ny, nz = to_platform(bend, c, 0.0, -s)
    zx, zy, zz = to_platform(bend, s, 0.0, c)
    yx, yy, yz = to_platform(bend, 0.0, 1.0, 0.0)
    wx, wy, wz = top.wx, top.wy, top.wz
    px, py, pz = cross(wx, wy, wz, dx, dy, dz)
    cx, cy, cz = cross(wx, wy, wz, px, py, pz)
    ex, ey, ez = cross(top.bx, top.by, top.bz, dx, dy, dz)
    frame = RotorFrame(
        top.ax + cx + ex + gravity * pose.r31,
        top.ay + cy + ey + gravity * pose.r32,
        top.az + cz + ez + gravity * pose.r33,
        top.bx, top.by, top.bz, wx, wy, wz,
        nx, ny, nz, zx, zy, zz, yx, yy, yz,
    )  # fmt: skip
    return frame, (dx, dy, dz)


@kernel
def _nothing_elastic(pose, x, bend, body, pitches, structure, tower, blades, work):
    return


@inlined_kernel
def _condense(pose, x, bend, body, pitches, structure, tower, blades, work):
    frame, _ = rotor_frame(pose, top_of(pose, x, bend, tower), bend, body.gravity, structure)
    condense_rotor(x, frame, pitches, structure, blades, work)


@inlined_kernel
def _whole(body, structure):
    return body


@inlined_kernel
def _below_nacelle(body, structure):
    return structure.lower


# (body, structure) -> RigidBody whose weight is a load: with elastic parts without nacelle and rotor
weighed_body = chosen_by_class("structure", {type(None): _whole, Structure: _below_nacelle})


# (pose, x, bend, body, pitches, structure, tower, blades, work): inertia of the rotor into work; None: no-op
condense_elastic = chosen_by_class("structure", {type(None): _nothing_elastic, Structure: _condense})


@inlined_kernel
def _times(matrix, i, j, x, y, z):
    """Return three rows, from i on, of three columns of a matrix, from j on, times a vector."""
    return (
        matrix[i, j] * x + matrix[i, j + 1] * y + matrix[i, j + 2] * z,
        matrix[i + 1, j] * x + matrix[i + 1, j + 1] * y + matrix[i + 1, j + 2] * z,
        matrix[i + 2, j] * x + matrix[i + 2, j + 1] * y + matrix[i + 2, j + 2] * z,
    )


@inlined_kernel
def _shift(inertia, x, y, z):
    """Move a (6, 6) inertia in place to a point from which its present one lies at (x, y, z)."""
    for j in range(6):  # moments: plus position times force
        fx, fy, fz = inertia[0, j], inertia[1, j], inertia[2, j]
        inertia[3, j] += y * fz - z * fy
        inertia[4, j] += z * fx - x * fz
        inertia[5, j] += x * fy - y * fx
    for i in range(6):
        fx, fy, fz = inertia[i, 0], inertia[i, 1], inertia[i, 2]
        inertia[i, 3] += y * fz - z * fy
        inertia[i, 4] += z * fx - x * fz
        inertia[i, 5] += x * fy - y * fx


@inlined_kernel
def _add_nacelle(bend, structure, upper):
    """Add the nacelle to the (6, 6) inertia about the origin of Top, platform axes."""
    s, m, tensor = structure.nacelle_moment, structure.nacelle_mass, structure.nacelle_inertia
    sx, sy, sz = to_platform(bend, s[0], s[1], s[2])
    ax, ay, az = to_platform(bend, tensor[0, 0], tensor[1, 0], tensor[2, 0])  # columns of A tensor
    bx, by, bz = to_platform(bend, tensor[0, 1], tensor[1, 1], tensor[2, 1])
    cx, cy, cz = to_platform(bend, tensor[0, 2], tensor[1, 2], tensor[2, 2])
    xx, xy, xz = to_platform(bend, ax, bx, cx)
    _, yy, yz = to_platform(bend, ay, by, cy)
    _, _, zz = to_platform(bend, az, bz, cz)
    upper[0, 0] += m
    upper[1, 1] += m
    upper[2, 2] += m
    upper[3, 1] -= sz
    upper[1, 3] -= sz
    upper[3, 2] += sy
    upper[2, 3] += sy
    upper[4, 0] += sz
    upper[0, 4] += sz
    upper[4, 2] -= sx
    upper[2, 4] -= sx
    upper[5, 0] -= sy
    upper[0, 5] -= sy
    upper[5, 1] += sx
    upper[1, 5] += sx
    upper[3, 3] += xx
    upper[4, 4] += yy
    upper[5, 5] += zz
    upper[4, 3] += xy
    upper[3, 4] += xy
    upper[5, 3] += xz
    upper[3, 5] += xz
    upper[5, 4] += yz
    upper[4, 5] += yz


@inlined_kernel
def _nacelle_load(pose, top, bend, gravity, structure):
    """Return force and moment of inertia and weight of the nacelle about the origin of Top."""
    s, m, tensor = structure.nacelle_moment, structure.nacelle_mass, structure.nacelle_inertia
    wx, wy, wz = top.wx, top.wy, top.wz
    sx, sy, sz = to_platform(bend, s[0], s[1], s[2])
    ax, ay, az = top.ax + gravity * pose.r31, top.ay + gravity * pose.r32, top.az + gravity * pose.r33
    px, py, pz = cross(wx, wy, wz, sx, sy, sz)
    cx, cy, cz = cross(wx, wy, wz, px, py, pz)
    ex, ey, ez = cross(top.bx, top.by, top.bz, sx, sy, sz)
    gx, gy, gz = cross(sx, sy, sz, ax, ay, az)
    ux, uy, uz = to_nacelle_axes(bend, wx, wy, wz)
    vx, vy, vz = to_nacelle_axes(bend, top.bx, top.by, top.bz)
    kx, ky, kz = _times(tensor, 0, 0, ux, uy, uz)
    tx, ty, tz = _times(tensor, 0, 0, vx, vy, vz)
    hx, hy, hz = cross(ux, uy, uz, kx, ky, kz)
    hx, hy, hz = to_platform(bend, tx + hx, ty + hy, tz + hz)
    return m * ax + cx + ex, m * ay + cy + ey, m * az + cz + ez, gx + hx, gy + hy, gz + hz


@inlined_kernel
def _no_deflection(pose, gravity, tower, work, b, modal):
    return


@inlined_kernel
def _deflected(pose, gravity, tower, work, b, modal):
    p, c, X, g = work.tower_pull, work.tower_moment, work.tower_coupling, gravity
    ax, ay, az = cross(pose.wx, pose.wy, pose.wz, pose.vx, pose.vy, pose.vz)
    ax, ay, az = ax + g * pose.r31, ay + g * pose.r32, az + g * pose.r33
    mx, my, mz = cross(c[0], c[1], c[2], ax, ay, az)
    b[0] -= p[0]
    b[1] -= p[1]
    b[2] -= p[2]
    b[3] -= p[3] + mx
    b[4] -= p[4] + my
    b[5] -= p[5] + mz
    for i in range(len(tower.beam.count)):
        modal[i] -= work.tower_rest[i] + X[i, 0] * ax + X[i, 1] * ay + X[i, 2] * az


# (pose, gravity, tower, work, b, modal): velocity terms and weight of the deflected tower off b and modal
_subtract_tower = chosen_by_class("tower", {type(None): _no_deflection, TowerModes: _deflected})


@inlined_kernel
def _from_platform(top, fx, fy, fz, mx, my, mz, bend, tower, work, b, modal):
    b[0] -= fx
    b[1] -= fy
    b[2] -= fz
    b[3] -= mx + top.y * fz - top.z * fy
    b[4] -= my + top.z * fx - top.x * fz
    b[5] -= mz + top.x * fy - top.y * fx


@inlined_kernel
def _from_tower(top, fx, fy, fz, mx, my, mz, bend, tower, work, b, modal):
    _from_platform(top, fx, fy, fz, mx, my, mz, bend, tower, work, b, modal)
    push_modes(-1.0, fx, fy, fz, mx, my, mz, bend, tower, work, modal)


# (top, fx, fy, fz, mx, my, mz, bend, tower, work, b, modal): a wrench at the origin of Top off b and modal
_subtract_wrench = chosen_by_class("tower", {type(None): _from_platform, TowerModes: _from_tower})


@inlined_kernel
def _only_platform(top, upper, bend, tower, work, matrix):
    for i in range(6):
        for j in range(i + 1):
            matrix[i, j] += upper[i, j]


@inlined_kernel
def _with_modes(top, upper, bend, tower, work, matrix):
    X, M, c, J, s, n = (
        work.tower_coupling, work.tower_mass, work.tower_moment, work.tower_block, work.sinking,
        len(tower.beam.count),
    )  # fmt: skip
    for i in range(n):
        k = i % 2
        slope = tower.slope[i] if k == 0 else -tower.slope[i]
        # rotation of the nacelle by a unit rate of the mode, whose top moves along axis k and sinks
        rx, ry, rz = (0.0, slope, 0.0) if k == 0 else (slope * bend.ca, 0.0, -slope * bend.sa)
        fx, fy, fz, mx, my, mz = (
            upper[0, k] - s[i] * upper[0, 2] + upper[0, 3] * rx + upper[0, 4] * ry + upper[0, 5] * rz,
            upper[1, k] - s[i] * upper[1, 2] + upper[1, 3] * rx + upper[1, 4] * ry + upper[1, 5] * rz,
            upper[2, k] - s[i] * upper[2, 2] + upper[2, 3] * rx + upper[2, 4] * ry + upper[2, 5] * rz,
            upper[3, k] - s[i] * upper[3, 2] + upper[3, 3] * rx + upper[3, 4] * ry + upper[3, 5] * rz,
            upper[4, k] - s[i] * upper[4, 2] + upper[4, 3] * rx + upper[4, 4] * ry + upper[4, 5] * rz,
            upper[5, k] - s[i] * upper[5, 2] + upper[5, 3] * rx + upper[5, 4] * ry + upper[5, 5] * rz,
        )
        row, rolling = matrix[6 + i], bend.ca * mx - bend.sa * mz
        row[0], row[1], row[2] = X[i, 0] + fx, X[i, 1] + fy, X[i, 2] + fz
        row[3] = X[i, 3] + mx + top.y * fz - top.z * fy
        row[4] = X[i, 4] + my + top.z * fx - top.x * fz
        row[5] = X[i, 5] + mz + top.x * fy - top.y * fx
        for j in range(i + 1):
            value = fx + tower.slope[j] * my if j % 2 == 0 else fy - tower.slope[j] * rolling
            row[6 + j] = M[i, j] + value - s[j] * fz
    _shift(upper, top.x, top.y, top.z)
    for i in range(6):
        for j in range(i + 1):
            matrix[i, j] += upper[i, j]
    _shift(upper, -top.x, -top.y, -top.z)
    matrix[3, 1] -= c[2]
    matrix[3, 2] += c[1]
    matrix[4, 0] += c[2]
    matrix[4, 2] -= c[0]
    matrix[5, 0] -= c[1]
    matrix[5, 1] += c[0]
    matrix[3, 3] += J[0]
    matrix[4, 4] += J[1]
    matrix[5, 5] += J[2]
    matrix[4, 3] += J[3]
    matrix[5, 3] += J[4]
    matrix[5, 4] += J[5]


# (top, upper, bend, tower, work, matrix): upper and the rows of the tower modes into matrix (lower triangle)
_add_upper = chosen_by_class("tower", {type(None): _only_platform, TowerModes: _with_modes})


@inlined_kernel
def _no_tower_motion(b, modal, bend, tower, work):
    return b[0], b[1], b[2], b[3], b[4], b[5]


# (b, modal, bend, tower, work) -> accelerations (6) of the origin of Top and the nacelle, without their bias
_top_motion = chosen_by_class("tower", {type(None): _no_tower_motion, TowerModes: top_motion})


@kernel
def _no_modes(tower):
    return 0, 0


@kernel
def _velocities_of(tower):
    return tower.first + len(tower.beam.count), len(tower.beam.count)


# (tower) -> (index of the first velocity of a deflection, number of modes)
modes_in_state = chosen_by_class("tower", {type(None): _no_modes, TowerModes: _velocities_of})


@inlined_kernel
def _factor_modes(matrix, n):
    """Eliminate the n modes from the platform's system, last mode first; only the lower triangle is used."""
    for k in range(n - 1, -1, -1):
        row = 6 + k
        over = 1.0 / matrix[row, row]
        for i in range(6 + k):
            factor = matrix[row, i] * over
            for j in range(i + 1):
                matrix[i, j] -= factor * matrix[row, j]


@inlined_kernel
def _solve_modes(matrix, held, b, modal):
    """Solve for b (6,) and modal (n,) in place, with the factors of _factor_modes and factor_spd."""
    n = modal.shape[0]
    for k in range(n - 1, -1, -1):
        row = 6 + k
        force = modal[k] / matrix[row, row]
        for i in range(6):
            b[i] -= matrix[row, i] * force
        for i in range(k):
            modal[i] -= matrix[row, 6 + i] * force
    if held:
        b[:] = 0.0
    else:
        substitute_spd(matrix, b)
    for k in range(n):
        row = 6 + k
        total = modal[k]
        for i in range(6):
            total -= matrix[row, i] * b[i]
        for i in range(k):
            total -= matrix[row, 6 + i] * modal[i]
        modal[k] = total / matrix[row, row]


@inlined_kernel
def _at_top(centre, push, h, fx, fy, fz, mx, my, mz):
    """Return a wrench at the rotor centre, plus a push (rad/s2) on the inertia h, at the origin of Top."""
    cx, cy, cz = centre
    fx, fy, fz = fx + push * h[0], fy + push * h[1], fz + push * h[2]
    mx, my, mz = mx + push * h[3], my + push * h[4], mz + push * h[5]
    return fx, fy, fz, mx + cy * fz - cz * fy, my + cz * fx - cx * fz, mz + cx * fy - cy * fx


@inlined_kernel
def _move_nacelle(top, centre, bend, tower, work, b, modal):
    """Return the acceleration (6) of the origin of Top without bias; that at the rotor centre into work."""
    cx, cy, cz = centre
    ax, ay, az, bx, by, bz = _top_motion(b, modal, bend, tower, work)
    motion = work.motion
    motion[0], motion[1], motion[2] = ax + by * cz - bz * cy, ay + bz * cx - bx * cz, az + bx * cy - by * cx
    motion[3], motion[4], motion[5] = bx, by, bz
    return ax, ay, az, bx, by, bz


@inlined_kernel
def _dot(a, b):
    total = 0.0
    for i in range(6):
        total += a[i] * b[i]
    return total


@inlined_kernel
def _solve(top, centre, fx, fy, fz, mx, my, mz, known, free, bend, body, tower, matrix, work, b, modal):
    """Solve for the accelerations of platform and tower in place of the loads in b (6,) and modal (n,).

    f, m: wrench of nacelle and rotor at the origin of Top without accelerations; known: torque (N m) on rotor
    and generator; free: inverse of their inertia, zero if held. Fills work.motion. Returns the acceleration
    of the generator, which is the rotor's with a rigid shaft.
    """
    _subtract_wrench(top, fx, fy, fz, mx, my, mz, bend, tower, work, b, modal)
    _solve_modes(matrix, body.platform_fixed, b, modal)
    _move_nacelle(top, centre, bend, tower, work, b, modal)
    return free * (known - _dot(work.shaft, work.motion))


@inlined_kernel
def answer(torque, bend, body, tower, blades, matrix, work, out):
    """Turn loads on platform and tower in out (n_state,), and a torque (N m), into accelerations.

    Of platform, tower, rotor and blades, without terms of velocities and weight; mass and frames are those of
    the last solution, with a rigid shaft.
    """
    x, y, z, cx, cy, cz, free = work.place
    top, centre = Top(x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (cx, cy, cz)
    fx, fy, fz, mx, my, mz = _at_top(centre, free * torque, work.shaft, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    first, n = modes_in_state(tower)
    b, modal = out[State.VX : State.WZ + 1], out[first : first + n]
    rate = _solve(
        top, centre, fx, fy, fz, mx, my, mz, torque, free, bend, body, tower, matrix, work, b, modal
    )
    out[State.ROTOR_SPEED] = rate
    for i in range(3):
        work.motion[3 + i] += rate * work.axis[i]
    fill_blade_accelerations(work.motion, 0.0, blades, work, out)


@inlined_kernel
def _no_twist(
    x, top, f, centre, rate, inertia, torques, free, fresh, bend, body, structure, tower, blades, shaft,
    matrix, work, b, modal, dx,
):  # fmt: skip
    return rate, 0.0


@inlined_kernel
def _twist(
    x, top, f, centre, rate, inertia, torques, free, fresh, bend, body, structure, tower, blades, shaft,
    matrix, work, b, modal, dx,
):  # fmt: skip
    """Add the motion by the twist to that of a rigid shaft; return accelerations of rotor and twist.

    rate: of the rotor with a rigid shaft; inertia: of the rotor about the shaft, kg m2; torques: of the air
    and of the generator, N m; fresh: whether the mass matrix has changed.
    """
    gear, h, bias, motion = structure.generator_coupling, work.shaft, work.bias, work.motion
    e, state, n = work.twist[0], work.shaft_torque, modal.shape[0]
    spun = gear * (f.nx * motion[3] + f.ny * motion[4] + f.nz * motion[5])
    steady = torques[0] - f.nx * bias[3] - f.ny * bias[4] - f.nz * bias[5] - inertia * rate
    steady -= _dot(h, motion) - spun
    first, modes = modes_in_state(tower)
    if fresh:
        e[:] = 0.0
        push = -free * inertia
        fx, fy, fz, mx, my, mz = _at_top(
            centre, push, h, h[0], h[1], h[2], h[3] - gear * f.nx, h[4] - gear * f.ny, h[5] - gear * f.nz
        )
        eb, em = e[State.VX : State.WZ + 1], e[first : first + modes]
        speed = _solve(
            top, centre, fx, fy, fz, mx, my, mz, -inertia, free, bend, body, tower, matrix, work, eb, em
        )
        spun = gear * (f.nx * motion[3] + f.ny * motion[4] + f.nz * motion[5])
        state[MOBILITY] = 1.0 / (inertia + _dot(h, motion) - spun + inertia * speed)
        e[State.ROTOR_SPEED] = 1.0 + speed
        _spin(f, 1.0 + speed, motion)
        fill_blade_accelerations(motion, 0.0, blades, work, e)
        e[shaft.first + 1] = 1.0
    change = state[MOBILITY] * (steady - torsion_torque(x, shaft))
    state[SHARE] = (1.0 - e[State.ROTOR_SPEED]) * torques[1]
    state[SMOOTH] = steady - state[SHARE]
    for i in range(6):
        b[i] += e[State.VX + i] * change
    for i in range(n):
        modal[i] += e[first + i] * change
    dx[shaft.first + 1] = change
    return rate + e[State.ROTOR_SPEED] * change, change


# -> accelerations of rotor and twist; see _twist
_add_twist = chosen_by_class("shaft", {type(None): _no_twist, Torsion: _twist})


@inlined_kernel
def _spin(f, rate, motion):
    """Add an acceleration (rad/s2) about the shaft to a motion (6,)."""
    motion[3] += rate * f.nx
    motion[4] += rate * f.ny
    motion[5] += rate * f.nz


@inlined_kernel
def accelerate_elastic(
    pose, x, load, torque, added, body, structure, tower, blades, shaft, matrix, work, cache, dx
):
    """Fill dx with the accelerations of platform, tower modes, rotor, shaft and blade modes.

    load: on the whole turbine about the body origin, without the weight of nacelle and rotor; torque: of air
    and generator on the shaft. On entry dx has the generalised forces on the tower deflections in place of
    their accelerations, and work the rotor (condense_elastic). matrix (6 + n, 6 + n) keeps its factors as in
    accelerate.
    """
    bend = kept_bend(tower, work)
    top = top_of(pose, x, bend, tower)
    f, centre = rotor_frame(pose, top, bend, body.gravity, structure)
    first, n = modes_in_state(tower)
    b, modal = dx[State.VX : State.WZ + 1], dx[first : first + n]
    bias, h, upper, gear = work.bias, work.shaft, work.upper, structure.generator_coupling
    fresh = cache[LoadCache.FACTORED] < 0.5
    if fresh:
        for i in range(6):
            h[i] = work.inertia[i, 3] * f.nx + work.inertia[i, 4] * f.ny + work.inertia[i, 5] * f.nz
        _spin(f, gear, h)
    turned = f.nx * h[3] + f.ny * h[4] + f.nz * h[5]
    free = 0.0 if body.rotor_fixed else 1.0 / (turned + structure.generator_row - gear)
    known = torque - f.nx * bias[3] - f.ny * bias[4] - f.nz * bias[5]
    known -= gear * (f.nx * f.bx + f.ny * f.by + f.nz * f.bz)
    if fresh:
        for i in range(6):
            for j in range(6):
                upper[i, j] = work.inertia[i, j] - free * h[i] * h[j]
        _shift(upper, centre[0], centre[1], centre[2])
        _add_nacelle(bend, structure, upper)
        for i in range(6):
            for j in range(i + 1):
                matrix[i, j] = structure.lower.mass_matrix[i, j] + added[i, j]
        _add_upper(top, upper, bend, tower, work, matrix)
        _factor_modes(matrix, n)
        if not body.platform_fixed:
            factor_spd(matrix)
        assign((top.x, top.y, top.z, centre[0], centre[1], centre[2], free), work.place)
        assign((f.nx, f.ny, f.nz), work.axis)
        cache[LoadCache.FACTORED] = 1.0
    spin = gear * generator_speed(x, shaft)
    gx, gy, gz = cross(f.wx, f.wy, f.wz, f.nx, f.ny, f.nz)
    fx, fy, fz, mx, my, mz = _at_top(
        centre, free * known, h, bias[0], bias[1], bias[2], bias[3] + spin * gx, bias[4] + spin * gy,
        bias[5] + spin * gz,
    )  # fmt: skip
    ex, ey, ez, kx, ky, kz = _nacelle_load(pose, top, bend, body.gravity, structure)
    fx, fy, fz, mx, my, mz = fx + ex, fy + ey, fz + ez, mx + kx, my + ky, mz + kz

    c = momentum_rate(pose, 0.0, structure.lower.mass_matrix, 0.0, None)
    b[0], b[1], b[2] = load.fx - c.fx, load.fy - c.fy, load.fz - c.fz
    b[3], b[4], b[5] = load.mx - c.mx, load.my - c.my, load.mz - c.mz
    _subtract_tower(pose, body.gravity, tower, work, b, modal)
    rate = _solve(top, centre, fx, fy, fz, mx, my, mz, known, free, bend, body, tower, matrix, work, b, modal)
    inertia = turned - gear
    torques = (cache[LoadCache.TORQUE], cache[LoadCache.TORQUE] - torque)
    rate, change = _add_twist(
        x, top, f, centre, rate, inertia, torques, free, fresh, bend, body, structure, tower, blades, shaft,
        matrix, work, b, modal, dx,
    )  # fmt: skip
    dx[State.ROTOR_SPEED] = rate

    # loads for outputs
    ax, ay, az, bx, by, bz = _move_nacelle(top, centre, bend, tower, work, b, modal)
    ex, ey, ez, kx, ky, kz = _at_top(
        centre, -free * inertia * change, h, change * h[0], change * h[1], change * h[2],
        change * (h[3] - gear * f.nx), change * (h[4] - gear * f.ny), change * (h[5] - gear * f.nz),
    )  # fmt: skip
    load_of_top, load_of_hub, motion = work.top_load, work.hub_load, work.motion
    load_of_top[0], load_of_top[1], load_of_top[2] = -fx - ex, -fy - ey, -fz - ez
    load_of_top[3], load_of_top[4], load_of_top[5] = -mx - kx, -my - ky, -mz - kz
    for i in range(6):
        load_of_top[i] -= (
            upper[i, 0] * ax + upper[i, 1] * ay + upper[i, 2] * az
            + upper[i, 3] * bx + upper[i, 4] * by + upper[i, 5] * bz
        )  # fmt: skip
    _spin(f, rate, motion)
    for i in range(6):
        load_of_hub[i] = -bias[i] - _dot(work.inertia[i], motion)
    fill_blade_accelerations(motion, 1.0, blades, work, dx)


@inlined_kernel
def _with_rigid_parts(
    pose, x, load, torque, added, body, structure, tower, blades, shaft, matrix, work, cache, dx
):
    accelerate(pose, x, load, torque, added, body, matrix, cache, dx)


# (pose, x, load, torque, added, body, structure, tower, blades, shaft, matrix, work, cache, dx):
# accelerations into dx
accelerate_all = chosen_by_class("structure", {type(None): _with_rigid_parts, Structure: accelerate_elastic})
