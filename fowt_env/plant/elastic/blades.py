"""Condenses hub and bending blades into the inertia of one body at the rotor centre.

A blade is a Beam whose axis is the pitch axis, with x flapwise and y edgewise at zero pitch and twist (axes j
of ElastoDyn). Its modal accelerations are eliminated, which leaves a (6, 6) inertia and a (6,) force and
moment about the rotor centre, in platform axes. Weight enters as an upward acceleration of every frame.
"""

from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import inlined_kernel, kernel, shared_kernel
from fowt_env.plant.compile.handle import by_reference
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.beam import Beam, reduce_beam
from fowt_env.plant.state import BLADES, State

APART_COSINE, APART_SINE = cos(2.0 * pi / BLADES), sin(2.0 * pi / BLADES)  # of the angle between blades
COS_AZIMUTH, SIN_AZIMUTH, COS_PITCH, SIN_PITCH = range(4)  # columns of RotorScratch.turns


class Point(NamedTuple):
    """Holds shapes of n modes at a point of the pitch axis of a blade."""

    x: np.ndarray  # (n,) along pitched axes
    y: np.ndarray
    slope_x: np.ndarray  # (n,) 1/m
    slope_y: np.ndarray
    shortening: np.ndarray  # (n, n) 1/m


@by_reference
class Section(NamedTuple):
    """Holds the part of a blade outside of a point of the pitch axis, for the loads there.

    first and second: integrals over the mass of the outer part of the columns of beam.section_columns.
    """

    distance: float  # m, from the rotor centre
    cosine: float  # of the structural twist
    sine: float
    point: Point
    mass: float  # kg
    first: np.ndarray  # (k,) of each column
    second: np.ndarray  # (k, k) of the products of two
    outside: np.ndarray  # (stations,) fraction of the load of each station that acts outside
    further: np.ndarray  # (stations,) m, its moment about the point of the whole load, along the pitch axis


@by_reference
class BladeModes(NamedTuple):
    """Holds three blades that bend by n modes each."""

    first: int  # index in the state of the first of 3 n deflections; their velocities follow
    beam: Beam  # about the rotor centre
    cone_cosine: float
    cone_sine: float  # positive: blades lean upwind
    hub_radius: float  # m, from the rotor centre to a blade root along the pitch axis
    # accelerations of the modes, less their signs, see steps.py
    spring: np.ndarray  # (n, n) 1/s2, over the deflections, by stiffness
    decay: np.ndarray  # (n, n) 1/s, over their velocities, by structural damping and the wind at rated speed
    tip: Point
    inner: Section  # at a quarter and at half of the span
    outer: Section


class RotorFrame(NamedTuple):
    """Holds the motion of the rotor's non-rotating frame in platform axes, for zero accelerations."""

    ax: float  # m/s2, of the rotor centre, with gravity upward
    ay: float
    az: float
    bx: float  # rad/s2
    by: float
    bz: float
    wx: float  # rad/s
    wy: float
    wz: float
    nx: float  # direction of the shaft, downwind
    ny: float
    nz: float
    zx: float  # direction of a blade at zero azimuth without cone
    zy: float
    zz: float
    yx: float  # third axis
    yy: float
    yz: float


@inlined_kernel
def _turn_blades(x, pitches, turns):
    """Fill the turns (3, 4) of RotorScratch: each cosine and sine is found once for loads and outputs."""
    c, s, pitch = cos(x[State.AZIMUTH]), sin(x[State.AZIMUTH]), x[State.BLADE_PITCH]
    pitch_cosine, pitch_sine = cos(pitch), sin(pitch)
    for number in range(BLADES):
        own = pitch_of(number, x, pitches)
        if own != pitch:
            pitch, pitch_cosine, pitch_sine = own, cos(own), sin(own)
        turn = turns[number]
        turn[COS_AZIMUTH], turn[SIN_AZIMUTH], turn[COS_PITCH], turn[SIN_PITCH] = (
            c,
            s,
            pitch_cosine,
            pitch_sine,
        )
        c, s = APART_COSINE * c - APART_SINE * s, APART_SINE * c + APART_COSINE * s


@inlined_kernel
def fill_blade_axes(turn, cone_cosine, cone_sine, frame, axes):
    """Fill axes (3, 3) with the columns j1, j2, j3 of a blade, platform axes; turn (4,): of its turns."""
    c, s = turn[COS_AZIMUTH], turn[SIN_AZIMUTH]
    rx, ry, rz = c * frame.zx - s * frame.yx, c * frame.zy - s * frame.yy, c * frame.zz - s * frame.yz
    # against the direction of rotation
    kx, ky, kz = c * frame.yx + s * frame.zx, c * frame.yy + s * frame.zy, c * frame.yz + s * frame.zz
    c, s = turn[COS_PITCH], turn[SIN_PITCH]
    ix, iy, iz = (
        cone_cosine * frame.nx + cone_sine * rx,
        cone_cosine * frame.ny + cone_sine * ry,
        cone_cosine * frame.nz + cone_sine * rz,
    )
    axes[0, 0], axes[1, 0], axes[2, 0] = c * ix - s * kx, c * iy - s * ky, c * iz - s * kz
    axes[0, 1], axes[1, 1], axes[2, 1] = s * ix + c * kx, s * iy + c * ky, s * iz + c * kz
    axes[0, 2] = cone_cosine * rx - cone_sine * frame.nx
    axes[1, 2] = cone_cosine * ry - cone_sine * frame.ny
    axes[2, 2] = cone_cosine * rz - cone_sine * frame.nz


@inlined_kernel
def reduce_blade(number, x, wx, wy, wz, blades, work):
    """Fill work with the reduced inertia (reduce_beam) of a blade in a frame of angular velocity w.

    The angular velocity is in platform axes; work.axes has the axes of the blade.
    """
    beam, E = blades.beam, work.axes[number]
    n = len(beam.count)
    at = blades.first + n * number
    reduce_beam(
        x[at : at + n], x[at + BLADES * n : at + (BLADES + 1) * n],
        E[0, 0] * wx + E[1, 0] * wy + E[2, 0] * wz,
        E[0, 1] * wx + E[1, 1] * wy + E[2, 1] * wz,
        E[0, 2] * wx + E[1, 2] * wy + E[2, 2] * wz,
        beam, work.moment[number], work.block[number], work.own[number], work.mass, work.pull[number],
        work.rest[number],
    )  # fmt: skip


@shared_kernel
def _add_blade(number, x, frame, bx, by, bz, wx, wy, wz, blades, work):
    """Add a blade, its modes eliminated, to inertia (lower triangle) and bias of the rotor.

    b, w: angular acceleration and velocity of the rotating hub.
    """
    ax, ay, az = frame.ax, frame.ay, frame.az
    fill_blade_axes(work.turns[number], blades.cone_cosine, blades.cone_sine, frame, work.axes[number])
    reduce_blade(number, x, wx, wy, wz, blades, work)
    m, n = blades.beam.mass, len(blades.beam.count)
    E, h, M = work.axes[number], work.rest[number], work.mass
    own, X = work.own[number], work.coupling[number]
    inertia, bias, force, factors = work.inertia, work.bias, work.force[number], work.factors[number]
    e11, e12, e13, e21, e22, e23, e31, e32, e33 = (
        E[0, 0], E[0, 1], E[0, 2], E[1, 0], E[1, 1], E[1, 2], E[2, 0], E[2, 1], E[2, 2],
    )  # fmt: skip
    c1, c2, c3 = work.moment[number, 0], work.moment[number, 1], work.moment[number, 2]
    cx, cy, cz = (
        e11 * c1 + e12 * c2 + e13 * c3,
        e21 * c1 + e22 * c2 + e23 * c3,
        e31 * c1 + e32 * c2 + e33 * c3,
    )
    J = work.block[number]
    xx, yy, zz, xy, xz, yz = J[0], J[1], J[2], J[3], J[4], J[5]
    t11, t12, t13 = (
        e11 * xx + e12 * xy + e13 * xz,
        e11 * xy + e12 * yy + e13 * yz,
        e11 * xz + e12 * yz + e13 * zz,
    )
    t21, t22, t23 = (
        e21 * xx + e22 * xy + e23 * xz,
        e21 * xy + e22 * yy + e23 * yz,
        e21 * xz + e22 * yz + e23 * zz,
    )
    t31, t32, t33 = (
        e31 * xx + e32 * xy + e33 * xz,
        e31 * xy + e32 * yy + e33 * yz,
        e31 * xz + e32 * yz + e33 * zz,
    )
    jxx, jyx = t11 * e11 + t12 * e12 + t13 * e13, t21 * e11 + t22 * e12 + t23 * e13
    jyy, jzx = t21 * e21 + t22 * e22 + t23 * e23, t31 * e11 + t32 * e12 + t33 * e13
    jzy, jzz = t31 * e21 + t32 * e22 + t33 * e23, t31 * e31 + t32 * e32 + t33 * e33
    p = work.pull[number]
    f1, f2, f3, m1, m2, m3 = p[0], p[1], p[2], p[3], p[4], p[5]
    bias[0] += e11 * f1 + e12 * f2 + e13 * f3 + m * ax + by * cz - bz * cy
    bias[1] += e21 * f1 + e22 * f2 + e23 * f3 + m * ay + bz * cx - bx * cz
    bias[2] += e31 * f1 + e32 * f2 + e33 * f3 + m * az + bx * cy - by * cx
    bias[3] += e11 * m1 + e12 * m2 + e13 * m3 + cy * az - cz * ay + jxx * bx + jyx * by + jzx * bz
    bias[4] += e21 * m1 + e22 * m2 + e23 * m3 + cz * ax - cx * az + jyx * bx + jyy * by + jzy * bz
    bias[5] += e31 * m1 + e32 * m2 + e33 * m3 + cx * ay - cy * ax + jzx * bx + jzy * by + jzz * bz
    inertia[0, 0] += m
    inertia[1, 1] += m
    inertia[2, 2] += m
    inertia[3, 1] -= cz
    inertia[3, 2] += cy
    inertia[4, 0] += cz
    inertia[4, 2] -= cx
    inertia[5, 0] -= cy
    inertia[5, 1] += cx
    inertia[3, 3] += jxx
    inertia[4, 3] += jyx
    inertia[4, 4] += jyy
    inertia[5, 3] += jzx
    inertia[5, 4] += jzy
    inertia[5, 5] += jzz
    for i in range(n):
        l1, l2, l3, k1, k2, k3 = own[i, 0], own[i, 1], own[i, 2], own[i, 3], own[i, 4], own[i, 5]
        x0, x1, x2 = (
            e11 * l1 + e12 * l2 + e13 * l3,
            e21 * l1 + e22 * l2 + e23 * l3,
            e31 * l1 + e32 * l2 + e33 * l3,
        )
        x3, x4, x5 = (
            e11 * k1 + e12 * k2 + e13 * k3,
            e21 * k1 + e22 * k2 + e23 * k3,
            e31 * k1 + e32 * k2 + e33 * k3,
        )
        h[i] = force[i] - h[i] - x0 * ax - x1 * ay - x2 * az - x3 * bx - x4 * by - x5 * bz
        # L D L^T of the modal mass, and forward elimination of this row by those above
        for k in range(i):
            for j in range(k):
                M[i, k] -= M[i, j] * M[k, j]
        pivot = M[i, i]
        for k in range(i):
            total = M[i, k]
            scaled = total * M[k, k]
            pivot -= scaled * total
            M[i, k] = scaled
            x0 -= scaled * X[k, 0]
            x1 -= scaled * X[k, 1]
            x2 -= scaled * X[k, 2]
            x3 -= scaled * X[k, 3]
            x4 -= scaled * X[k, 4]
            x5 -= scaled * X[k, 5]
            h[i] -= scaled * h[k]
        over = 1.0 / pivot
        M[i, i] = over
        X[i, 0], X[i, 1], X[i, 2], X[i, 3], X[i, 4], X[i, 5] = x0, x1, x2, x3, x4, x5
        y0, y1, y2, y3, y4, y5 = x0 * over, x1 * over, x2 * over, x3 * over, x4 * over, x5 * over
        rest = h[i]
        bias[0] += y0 * rest
        bias[1] += y1 * rest
        bias[2] += y2 * rest
        bias[3] += y3 * rest
        bias[4] += y4 * rest
        bias[5] += y5 * rest
        inertia[0, 0] -= y0 * x0
        inertia[1, 0] -= y1 * x0
        inertia[1, 1] -= y1 * x1
        inertia[2, 0] -= y2 * x0
        inertia[2, 1] -= y2 * x1
        inertia[2, 2] -= y2 * x2
        inertia[3, 0] -= y3 * x0
        inertia[3, 1] -= y3 * x1
        inertia[3, 2] -= y3 * x2
        inertia[3, 3] -= y3 * x3
        inertia[4, 0] -= y4 * x0
        inertia[4, 1] -= y4 * x1
        inertia[4, 2] -= y4 * x2
        inertia[4, 3] -= y4 * x3
        inertia[4, 4] -= y4 * x4
        inertia[5, 0] -= y5 * x0
        inertia[5, 1] -= y5 * x1
        inertia[5, 2] -= y5 * x2
        inertia[5, 3] -= y5 * x3
        inertia[5, 4] -= y5 * x4
        inertia[5, 5] -= y5 * x5
    for i in range(n):
        for k in range(i + 1):
            factors[i, k] = M[i, k]


@inlined_kernel
def _add_hub(f, wx, wy, wz, bx, by, bz, structure, work):
    """Add the hub, a body of revolution about the shaft, to inertia and bias of the rotor.

    w, b: angular velocity and acceleration of the rotating hub.
    """
    m, s, across = structure.hub_mass, structure.hub_first, structure.hub_across
    more = structure.hub_axial - across
    nx, ny, nz = f.nx, f.ny, f.nz
    sx, sy, sz = s * nx, s * ny, s * nz
    inertia, bias = work.inertia, work.bias
    inertia[0, 0] += m
    inertia[1, 1] += m
    inertia[2, 2] += m
    inertia[3, 1] -= sz
    inertia[3, 2] += sy
    inertia[4, 0] += sz
    inertia[4, 2] -= sx
    inertia[5, 0] -= sy
    inertia[5, 1] += sx
    inertia[3, 3] += across + more * nx * nx
    inertia[4, 3] += more * nx * ny
    inertia[4, 4] += across + more * ny * ny
    inertia[5, 3] += more * nx * nz
    inertia[5, 4] += more * ny * nz
    inertia[5, 5] += across + more * nz * nz
    px, py, pz = wy * sz - wz * sy, wz * sx - wx * sz, wx * sy - wy * sx
    bias[0] += m * f.ax + by * sz - bz * sy + wy * pz - wz * py
    bias[1] += m * f.ay + bz * sx - bx * sz + wz * px - wx * pz
    bias[2] += m * f.az + bx * sy - by * sx + wx * py - wy * px
    spin, turning = more * (wx * nx + wy * ny + wz * nz), more * (bx * nx + by * ny + bz * nz)
    bias[3] += sy * f.az - sz * f.ay + across * bx + turning * nx + spin * (wy * nz - wz * ny)
    bias[4] += sz * f.ax - sx * f.az + across * by + turning * ny + spin * (wz * nx - wx * nz)
    bias[5] += sx * f.ay - sy * f.ax + across * bz + turning * nz + spin * (wx * ny - wy * nx)


@inlined_kernel
def _no_blades(x, frame, wx, wy, wz, bx, by, bz, pitches, blades, work):
    return


@inlined_kernel
def _add_blades(x, frame, wx, wy, wz, bx, by, bz, pitches, blades, work):
    _turn_blades(x, pitches, work.turns)
    for number in range(BLADES):
        _add_blade(number, x, frame, bx, by, bz, wx, wy, wz, blades, work)


_add_bending = chosen_by_class("blades", {type(None): _no_blades, BladeModes: _add_blades})


@inlined_kernel
def condense_rotor(x, frame, pitches, structure, blades, work):
    """Fill work with inertia (6, 6) and bias (6,) of the rotor about its centre, platform axes.

    frame: RotorFrame. Of a unit modal acceleration of a blade nothing is left: modes are eliminated.
    """
    f, speed = frame, x[State.ROTOR_SPEED]
    wx, wy, wz = f.wx + speed * f.nx, f.wy + speed * f.ny, f.wz + speed * f.nz
    bx = f.bx + speed * (f.wy * f.nz - f.wz * f.ny)
    by = f.by + speed * (f.wz * f.nx - f.wx * f.nz)
    bz = f.bz + speed * (f.wx * f.ny - f.wy * f.nx)
    inertia, bias = work.inertia, work.bias
    for i in range(6):
        bias[i] = 0.0
        for j in range(6):
            inertia[i, j] = 0.0
    _add_bending(x, frame, wx, wy, wz, bx, by, bz, pitches, blades, work)
    _add_hub(frame, wx, wy, wz, bx, by, bz, structure, work)
    for i in range(6):
        for j in range(i):
            inertia[j, i] = inertia[i, j]


@kernel
def fill_deflection_rates(x, blades, dx):
    """Fill dx with the rates of the deflections of bending blades; no-op for rigid blades."""
    if blades is None:
        return
    size = BLADES * len(blades.beam.count)
    for i in range(blades.first, blades.first + size):
        dx[i] = x[i + size]


@inlined_kernel
def _no_accelerations(acceleration, forced, blades, work, dx):
    return


@inlined_kernel
def _accelerations(acceleration, forced, blades, work, dx):
    n = len(blades.beam.count)
    for number in range(BLADES):
        X, h, F = work.coupling[number], work.rest[number], work.factors[number]
        at = blades.first + n * (BLADES + number)
        for i in range(n - 1, -1, -1):
            total = forced * h[i]
            for j in range(6):
                total -= X[i, j] * acceleration[j]
            total *= F[i, i]
            for k in range(i + 1, n):
                total -= F[k, i] * dx[at + k]
            dx[at + i] = total


# (acceleration, forced, blades, work, dx): modal accelerations of blades into dx, from the acceleration (6,)
# of the hub, platform axes; forced: factor on all other forces
fill_blade_accelerations = chosen_by_class(
    "blades", {type(None): _no_accelerations, BladeModes: _accelerations}
)
