"""The turbine as one rigid body with a spinning rotor: weight, momentum rate, attitude, and the solve.

Unknowns (v', w', w_b'): one symmetric positive-definite system. The rotor row is eliminated, which leaves a
6x6 solve (theory.md, Eqs 9, 10 and 13).
"""

from math import cos, sin, sqrt

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import State, Wrench, pose_in, pose_of
from fowt_env.plant.tilt import across_shaft, along_shaft


@kernel
def gravity_load(pose, body):
    """Weight of the whole turbine, Eq. (13)."""
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    mg = -body.mass * body.gravity
    g = body.gravity
    weight = Wrench(
        mg * nx,
        mg * ny,
        mg * nz,
        g * body.s_z * ny,
        -g * (body.s_z * nx - body.s_x * nz),
        -g * body.s_x * ny,
    )
    return _off_centre(weight, pose, g, body.s_y)


@kernel
def _off_centre(weight, pose, gravity, s_y):
    """The weight with the moment of a centre of mass beside the plane of symmetry."""
    if s_y is None:
        return weight
    moment = gravity * s_y
    return Wrench(
        weight.fx,
        weight.fy,
        weight.fz,
        weight.mx - moment * pose.r33,
        weight.my,
        weight.mz + moment * pose.r31,
    )


@kernel
def momentum_rate(pose, rotor_speed, mass_matrix, coupling, tilt):
    """C1 nu + C2 w_b: velocity-dependent part of the momentum rate, Eqs (9)-(10).

    coupling: H of the rotor, whose angular momentum lies along the shaft; tilt of the shaft, or None.
    """
    m = mass_matrix
    vx, vy, vz, wx, wy, wz = pose.vx, pose.vy, pose.vz, pose.wx, pose.wy, pose.wz
    px = m[0, 0] * vx + m[0, 1] * vy + m[0, 2] * vz + m[0, 3] * wx + m[0, 4] * wy + m[0, 5] * wz
    py = m[1, 0] * vx + m[1, 1] * vy + m[1, 2] * vz + m[1, 3] * wx + m[1, 4] * wy + m[1, 5] * wz
    pz = m[2, 0] * vx + m[2, 1] * vy + m[2, 2] * vz + m[2, 3] * wx + m[2, 4] * wy + m[2, 5] * wz
    kx = m[3, 0] * vx + m[3, 1] * vy + m[3, 2] * vz + m[3, 3] * wx + m[3, 4] * wy + m[3, 5] * wz
    ky = m[4, 0] * vx + m[4, 1] * vy + m[4, 2] * vz + m[4, 3] * wx + m[4, 4] * wy + m[4, 5] * wz
    kz = m[5, 0] * vx + m[5, 1] * vy + m[5, 2] * vz + m[5, 3] * wx + m[5, 4] * wy + m[5, 5] * wz
    spin = coupling * rotor_speed
    kx += along_shaft(spin, 0.0, tilt)
    kz -= across_shaft(spin, tilt)
    return Wrench(
        wy * pz - wz * py,
        wz * px - wx * pz,
        wx * py - wy * px,
        vy * pz - vz * py + wy * kz - wz * ky,
        vz * px - vx * pz + wz * kx - wx * kz,
        vx * py - vy * px + wx * ky - wy * kx,
    )


@kernel
def attitude_rate(x, dx, plane):
    """Position and Euler-angle rates: r' = R v, phi' = J^-1 w (singular at 90 deg of platform pitch)."""
    if plane is not None:
        pose = pose_in(x, plane)
        dx[State.SURGE] = pose.r11 * pose.vx + pose.r13 * pose.vz
        dx[State.HEAVE] = pose.r31 * pose.vx + pose.r33 * pose.vz
        dx[State.PLATFORM_PITCH] = pose.wy
        dx[State.SWAY] = dx[State.ROLL] = dx[State.YAW] = 0.0
        return
    pose = pose_of(x)
    dx[State.SURGE] = pose.r11 * pose.vx + pose.r12 * pose.vy + pose.r13 * pose.vz
    dx[State.SWAY] = pose.r21 * pose.vx + pose.r22 * pose.vy + pose.r23 * pose.vz
    dx[State.HEAVE] = pose.r31 * pose.vx + pose.r32 * pose.vy + pose.r33 * pose.vz
    s1, c1 = sin(x[State.ROLL]), cos(x[State.ROLL])
    s2, c2 = sin(x[State.PLATFORM_PITCH]), cos(x[State.PLATFORM_PITCH])
    swing = (s1 * pose.wy + c1 * pose.wz) / c2
    dx[State.ROLL] = pose.wx + swing * s2
    dx[State.PLATFORM_PITCH] = c1 * pose.wy - s1 * pose.wz
    dx[State.YAW] = swing


@kernel
def solve_spd(a, b):
    """Solve a b = b in place; a is (6, 6) symmetric positive definite and is overwritten.

    L D L^T with the reciprocals of D kept on the diagonal: six divisions and no root.
    """
    for i in range(6):  # a known count, which the compiler unrolls
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
    substitute_spd(a, b)


@kernel
def substitute_spd(a, b):
    """Solve for another right-hand side b in place, with what solve_spd has left of the matrix."""
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
    """As accelerate with sway, roll and yaw held: the rotor then turns apart from the platform."""
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
def accelerate(pose, x, load, torque, added, body, matrix, dx):
    """Solve (M1 + A_a, M2; M2^T, I_rx) (nu', w_b') = loads - C1 nu - C2 w_b into dx."""
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
    for i in range(6):
        for j in range(6):
            matrix[i, j] = body.mass_matrix[i, j] + added[i, j]
    if body.rotor_fixed:
        solve_spd(matrix, b)
        dx[State.ROTOR_SPEED] = 0.0
        return
    ratio = body.coupling / body.rotor_row
    _eliminate(ratio * body.coupling, ratio * torque, matrix, b, body.tilt)
    solve_spd(matrix, b)
    turning = along_shaft(b[3], b[5], body.tilt)
    dx[State.ROTOR_SPEED] = (torque - body.coupling * turning) / body.rotor_row


@kernel
def _eliminate(inertia, moment, matrix, b, tilt):
    """Take the rotor row out of the matrix and the right-hand side: both lie along the shaft."""
    if tilt is None:
        matrix[3, 3] -= inertia
        b[3] -= moment
        return
    c, s = tilt.cosine, tilt.sine
    matrix[3, 3] -= c * c * inertia
    matrix[3, 5] += c * s * inertia
    matrix[5, 3] += c * s * inertia
    matrix[5, 5] -= s * s * inertia
    b[3] -= c * moment
    b[5] += s * moment
