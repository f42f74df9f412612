"""Solves the equation of motion of a rigid turbine: accelerations of platform and rotor under given loads.

The unknowns are (v', w', w_b'); the rotor row is eliminated, which leaves a symmetric 6x6 solve (theory.md,
Eqs 9, 10 and 13). With elastic parts it is elastic/chain.py.
"""

from math import sqrt

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import State
from fowt_env.plant.tilt import along_shaft


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
