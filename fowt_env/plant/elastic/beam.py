"""Computes the inertia of a beam that bends by modes, seen from a frame that moves with its root.

A particle of the beam lies at (U1 q, U2 q, z - q' S q / 2) in the axes of the frame: deflections along x and
y, the sum of shape times modal coordinate, and the shortening by bending along the axis z. All sums over the
particles are integrals of the shapes, computed once per turbine (scene/blade_beam.py); the terms of a state
are contractions of these. Centrifugal stiffening and the effect of weight follow from the shortening.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel
from fowt_env.plant.compile.handle import by_reference


@by_reference
class Beam(NamedTuple):
    """Holds integrals over the mass of a beam with n modes: of distance z, shapes U1, U2, shortening S."""

    count: tuple  # n zeros: a tuple, so that n is known at compile time
    mass: float  # kg
    first: float  # kg m, of z
    second: float  # kg m2, of z z
    a: np.ndarray  # (n,) kg, of U1
    b: np.ndarray  # (n,) kg, of U2
    e: np.ndarray  # (n,) kg m, of z U1
    f: np.ndarray  # (n,) kg m, of z U2
    A: np.ndarray  # (n, n) kg, of U1 U1
    B: np.ndarray  # (n, n) kg, of U2 U2
    C: np.ndarray  # (n, n) kg, of U1 U2
    S0: np.ndarray  # (n, n) kg/m, of S
    S1: np.ndarray  # (n, n) kg, of z S
    P: np.ndarray  # (n, n, n) kg/m, of U1 S
    Q: np.ndarray  # (n, n, n) kg/m, of U2 S
    T: np.ndarray  # (n, n, n, n) kg/m2, of S S
    stiffness: np.ndarray  # (n, n) N/m
    damping: np.ndarray  # (n, n) N s/m


@inlined_kernel
def reduce_beam(q, v, wx, wy, wz, beam, c, J, X, M, bias, h):
    """Fill the inertia of a beam with deflections q (n,) and rates v (n,) in a frame of angular velocity w.

    c (3,): first moment of mass; J (6,): inertia xx, yy, zz, xy, xz, yz; X (n, 6): force and moment on the
    root by unit modal accelerations; M (n, n): modal mass; bias (6,) and h (n,): force and moment on the
    root, and generalised forces, by velocities alone. All are about the origin of the frame, in its axes.
    """
    n = len(beam.count)
    cx = cy = px = py = pz = oz = gxx = gxy = gyy = gxz = gyz = 0.0
    gx = gy = hxx = hxy = hxz = hyx = hyy = hyz = hzx = hzy = hzz = 0.0
    cz, gzz = beam.first, beam.second
    for i in range(n):
        pqq = qqq = tqq = s0q = s1q = xu1 = xu2 = yu1 = yu2 = xw = yw = 0.0
        wp = wq = pv = qv = tvv = v12 = v21 = s0v = 0.0
        for j in range(n):
            pij = qij = tij = pji = qji = tjv = pjv = qjv = 0.0
            for k in range(n):
                pij += beam.P[i, j, k] * q[k]  # U1_i w_j, where w = S q
                qij += beam.Q[i, j, k] * q[k]
                pji += beam.P[j, i, k] * q[k]
                qji += beam.Q[j, i, k] * q[k]
                pjv += beam.P[i, j, k] * v[k]
                qjv += beam.Q[i, j, k] * v[k]
                tjk = 0.0
                for m in range(n):
                    tjk += beam.T[i, m, j, k] * q[m]  # w_i S_jk
                tij += tjk * q[k]  # w_i w_j
                tjv += tjk * v[k]
            M[i, j] = beam.A[i, j] + beam.B[i, j] + tij
            pqq += pij * q[j]
            qqq += qij * q[j]
            tqq += tij * q[j]
            xw += pji * q[j]
            yw += qji * q[j]
            pv += pji * v[j]
            qv += qji * v[j]
            wp += pij * v[j]
            wq += qij * v[j]
            tvv += tjv * v[j]
            gx += q[i] * pjv * v[j]
            gy += q[i] * qjv * v[j]
            s0q += beam.S0[i, j] * q[j]
            s1q += beam.S1[i, j] * q[j]
            s0v += beam.S0[i, j] * v[j]
            xu1 += beam.A[i, j] * q[j]
            xu2 += beam.C[j, i] * q[j]
            yu1 += beam.C[i, j] * q[j]
            yu2 += beam.B[i, j] * q[j]
            v12 += beam.C[j, i] * v[j]
            v21 += beam.C[i, j] * v[j]
        zu1, zu2, zw = beam.e[i] - 0.5 * pqq, beam.f[i] - 0.5 * qqq, s1q - 0.5 * tqq
        cx += beam.a[i] * q[i]
        cy += beam.b[i] * q[i]
        cz -= 0.5 * s0q * q[i]
        gxx += xu1 * q[i]
        gxy += yu1 * q[i]
        gyy += yu2 * q[i]
        gxz += zu1 * q[i]
        gyz += zu2 * q[i]
        gzz += (0.25 * tqq - s1q) * q[i]
        X[i, 0], X[i, 1], X[i, 2] = beam.a[i], beam.b[i], -s0q
        X[i, 3], X[i, 4], X[i, 5] = -yw - zu2, zu1 + xw, xu2 - yu1
        px += beam.a[i] * v[i]
        py += beam.b[i] * v[i]
        pz -= s0q * v[i]
        oz -= s0v * v[i]
        hxx += xu1 * v[i]
        hxy += yu1 * v[i]
        hxz += zu1 * v[i]
        hyx += xu2 * v[i]
        hyy += yu2 * v[i]
        hyz += zu2 * v[i]
        hzx -= xw * v[i]
        hzy -= yw * v[i]
        hzz -= zw * v[i]
        # with D = dG/dq_i of the second moments G: w D w - w w tr D, Coriolis terms, and the curved paths
        dxy, dxz, dyz, trace = yu1 + xu2, zu1 - xw, zu2 - yw, xu1 + yu2 - zw
        h[i] = (
            wx * wx * (xu1 - trace) + wy * wy * (yu2 - trace) + wz * wz * (-zw - trace)
            + wx * wy * dxy + wx * wz * dxz + wy * wz * dyz
            + 2.0 * (wx * (wq - qv) + wy * (pv - wp) + wz * (v12 - v21)) + tvv
        )  # fmt: skip
    c[0], c[1], c[2] = cx, cy, cz
    J[0], J[1], J[2] = gyy + gzz, gxx + gzz, gxx + gyy
    J[3], J[4], J[5] = -gxy, -gxz, -gyz
    ax, ay, az = wy * cz - wz * cy + 2.0 * px, wz * cx - wx * cz + 2.0 * py, wx * cy - wy * cx + 2.0 * pz
    bias[0], bias[1], bias[2] = wy * az - wz * ay, wz * ax - wx * az, wx * ay - wy * ax + oz
    kx = J[0] * wx + J[3] * wy + J[4] * wz
    ky = J[3] * wx + J[1] * wy + J[5] * wz
    kz = J[4] * wx + J[5] * wy + J[2] * wz
    trace = hxx + hyy + hzz
    bias[3] = wy * kz - wz * ky + 2.0 * (trace * wx - hxx * wx - hxy * wy - hxz * wz) - gy
    bias[4] = wz * kx - wx * kz + 2.0 * (trace * wy - hyx * wx - hyy * wy - hyz * wz) + gx
    bias[5] = wx * ky - wy * kx + 2.0 * (trace * wz - hzx * wx - hzy * wy - hzz * wz)
