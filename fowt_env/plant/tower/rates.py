"""Computes nacelle accelerations and the rate of momentum of all masses above the tower base, for outputs."""

from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import NO_LOAD, State, Wrench
from fowt_env.plant.tower.inertia import cross, deflection_rate, masses_of, top_bias, upper_of, upper_rate
from fowt_env.plant.tower.modes import TowerModes, to_nacelle, turned_pose


class Twist(NamedTuple):
    """Holds rates of the velocity components (vx..wz) of a Pose, m/s2 and rad/s2, in the pose's axes."""

    vx: float
    vy: float
    vz: float
    wx: float
    wy: float
    wz: float


@kernel
def _platform_rates(pose, bend, dx, tower):
    return Twist(dx[State.VX], dx[State.VY], dx[State.VZ], dx[State.WX], dx[State.WY], dx[State.WZ])


@kernel
def _top_rates(pose, bend, dx, tower):
    """Return the absolute accelerations (Twist) of tower top and nacelle rotation, platform axes."""
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
    # acceleration of the frame's origin, z below the top, then rates of the velocity components
    ax, ay, az = ax - by * z - wx * wz * z, ay + bx * z - wy * wz * z, az + (wx * wx + wy * wy) * z
    cx, cy, cz = cross(wx, wy, wz, now.vx, now.vy, now.vz)
    return Twist(ax - cx, ay - cy, az - cz, bx, by, bz)


# (pose, bend, dx, tower) -> Twist of nacelle_pose, from the rates dx of the state
nacelle_rates = chosen_by_class("tower", {type(None): _platform_rates, TowerModes: _nacelle_rates})


@kernel
def upper_momentum_rate(pose, x, dx, bend, body, tower):
    """Return the rate of momentum of nacelle and rotor, about the body origin, body axes.

    Zero for bending blades, where this is a part of RotorScratch.top_load.
    """
    if body.rotor_row == 0.0:
        return NO_LOAD
    mass, top, upper = tower.upper_mass, _top_rates(pose, bend, dx, tower), upper_of(bend, tower)
    _, _, _, _, _, _, wx, wy, wz = top_bias(pose, bend)
    spin = body.coupling * x[State.ROTOR_SPEED]
    fx, fy, fz, mx, my, mz = upper_rate(
        upper, mass, spin, top.vx, top.vy, top.vz, top.wx, top.wy, top.wz, wx, wy, wz
    )
    spun = body.coupling * dx[State.ROTOR_SPEED]
    mx += spun * upper.nx + bend.y * fz - bend.z * fy
    my += spun * upper.ny + bend.z * fx - bend.x * fz
    mz += spun * upper.nz + bend.x * fy - bend.y * fx
    return Wrench(fx, fy, fz, mx, my, mz)


@kernel
def above_base_rate(pose, x, dx, bend, body, tower):
    """Return the rate of momentum of bent tower, nacelle and rotor, about the body origin, body axes."""
    n, d = len(tower.count), masses_of(x, tower)
    q, v = tower.first, tower.first + n
    u = upper_momentum_rate(pose, x, dx, bend, body, tower)
    fx, fy, fz, mx, my, mz = u.fx, u.fy, u.fz, u.mx, u.my, u.mz
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
