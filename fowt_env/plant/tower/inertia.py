"""Computes mass integrals and rates of momentum of a flexible tower and of nacelle and rotor on its top."""

from typing import NamedTuple

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.state import Wrench
from fowt_env.plant.tower.modes import from_nacelle


class Masses(NamedTuple):
    """Holds integrals of line mass over the bent tower, minus those of the straight one; d(h): deflection."""

    dx: float  # kg m, of d
    dy: float
    ex: float  # kg m2, of h d
    ey: float
    gxx: float  # kg m2, of d d^T
    gxy: float
    gyy: float
    vx: float  # kg m/s, of the rate of d
    vy: float
    wx: float  # kg m2/s, of h times the rate of d
    wy: float
    hxx: float  # kg m2/s, of the rate of d times d^T
    hxy: float
    hyx: float
    hyy: float


class Upper(NamedTuple):
    """Holds first moment, inertia and shaft of nacelle and rotor about the tower top, platform axes."""

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


@inlined_kernel
def masses_of(x, tower):
    """Return the Masses of the bent tower in state x."""
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
    """Return the Upper, inertia of nacelle and rotor, on a bent tower."""
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
    """Return the Upper minus the inertia of the free rotor about the shaft (kg m2)."""
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
    """Return the inertia matrix of an Upper times a vector."""
    u = upper
    return u.xx * x + u.xy * y + u.xz * z, u.xy * x + u.yy * y + u.yz * z, u.xz * x + u.yz * y + u.zz * z


@kernel
def cross(ax, ay, az, bx, by, bz):
    """Return the cross product a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inlined_kernel
def top_bias(pose, bend):
    """Return the bias accelerations of tower top and nacelle rotation, and the nacelle's angular velocity.

    Platform axes, for zero rates of all velocities: (ax, ay, az, alpha_x, alpha_y, alpha_z, wx, wy, wz).
    """
    wx, wy, wz = pose.wx, pose.wy, pose.wz
    # w x (v + w x p + p') + w x p', without the acceleration of the top
    ux = pose.vx + wy * bend.z - wz * bend.y + 2.0 * bend.vx
    uy = pose.vy + wz * bend.x - wx * bend.z + 2.0 * bend.vy
    uz = pose.vz + wx * bend.y - wy * bend.x
    ax, ay, az = cross(wx, wy, wz, ux, uy, uz)
    tx, ty, tz = bend.db * bend.ca, bend.da, -bend.db * bend.sa  # nacelle rotation relative to the platform
    bx, by, bz = cross(wx, wy, wz, tx, ty, tz)
    spread = bend.da * bend.db
    bx, bz = bx - spread * bend.sa, bz - spread * bend.ca
    return ax, ay, az, bx, by, bz, wx + tx, wy + ty, wz + tz


@inlined_kernel
def upper_rate(upper, mass, spin, ax, ay, az, bx, by, bz, wx, wy, wz):
    """Return the rate of momentum of nacelle and rotor about the tower top, platform axes: (force, moment).

    a: acceleration of the top; b: angular acceleration of the nacelle; w: angular velocity of the nacelle.
    spin: angular momentum of the rotor relative to the nacelle, N m s, constant along the shaft.
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
    """Return the Wrench that deflections d (Masses) add to the rate of momentum of the straight tower.

    About the body origin, for zero rates of all velocities.
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
