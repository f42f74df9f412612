"""Defines the modes of a flexible tower and the resulting motion of nacelle and rotor (theory.md, 2.7).

The tower is a Beam (beam.py) in the axes of the platform, from the body origin up: its integrals hold the
change by bending alone, as the straight tower is part of the rigid body below. Nacelle and rotor turn with
the tower top as one rigid body. With a rigid tower the part is None. Modes come in pairs of the same order:
even indices are fore-aft, odd ones side-side.
"""

from math import cos, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.handle import by_reference
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.beam import Beam, reduce_beam
from fowt_env.plant.state import Pose, State, Wrench, assign, cross

MOST_MODES = 4


@by_reference
class TowerModes(NamedTuple):
    """Holds the n modes of a tower: first fore-aft, first side-side, and optionally the second pair."""

    first: int  # index in the state of the first deflection; the velocities follow the n deflections
    top_height: float  # m, straight tower top above the body origin, where all shapes are 1
    slope: np.ndarray  # (n,) 1/m, of each shape at the top
    shortening: np.ndarray  # (n, n) 1/m, S of the top
    beam: Beam  # about the body origin, without the straight tower: mass, first and second are zero
    drag_shape: np.ndarray  # (points, n) shapes at the points of tower_drag.TowerDrag
    root: np.ndarray  # (n, n) L of the stiffness L L^T
    flexible_root: np.ndarray  # (n, n) inverse of L^T


class Bend(NamedTuple):
    """Holds the motion of the tower top relative to the platform; Ry(a) Rx(b) rotates the nacelle."""

    x: float  # m, position of the top from the body origin
    y: float
    z: float
    height: float  # m, z of the straight tower
    vx: float  # m/s
    vy: float
    vz: float
    ca: float  # cosine and sine of a and b
    sa: float
    cb: float
    sb: float
    da: float  # rad/s
    db: float


class Twist(NamedTuple):
    """Holds rates of the velocity components (vx..wz) of a Pose, m/s2 and rad/s2, in the pose's axes."""

    vx: float
    vy: float
    vz: float
    wx: float
    wy: float
    wz: float


@kernel
def _straight(x, tower):
    return None


@inlined_kernel
def bend_by_modes(x, tower):
    """Return the Bend of the tower top in state x."""
    n = len(tower.beam.count)
    q, v = tower.first, tower.first + n
    ux = uy = vx = vy = vz = a = b = da = db = 0.0
    uz = tower.top_height
    for i in range(n):
        sunk = 0.0
        for j in range(n):
            sunk += tower.shortening[i, j] * x[q + j]
        uz -= 0.5 * sunk * x[q + i]
        vz -= sunk * x[v + i]
    for i in range(0, n, 2):
        ux += x[q + i]
        uy += x[q + i + 1]
        vx += x[v + i]
        vy += x[v + i + 1]
        a += tower.slope[i] * x[q + i]
        b -= tower.slope[i + 1] * x[q + i + 1]
        da += tower.slope[i] * x[v + i]
        db -= tower.slope[i + 1] * x[v + i + 1]
    return Bend(ux, uy, uz, tower.top_height, vx, vy, vz, cos(a), sin(a), cos(b), sin(b), da, db)


# (x, tower) -> Bend of a state, None for a rigid tower
bend_of = chosen_by_class("tower", {type(None): _straight, TowerModes: bend_by_modes})


@inlined_kernel
def keep_bend(bend, work):
    """Keep the Bend of an evaluation for kept_bend; no-op for a rigid tower."""
    if bend is None:
        return
    assign(bend, work.bend)


@kernel
def _still_straight(tower, work):
    return None


@inlined_kernel
def _read_bend(tower, work):
    x, y, z, height, vx, vy, vz, ca, sa, cb, sb, da, db = work.bend
    return Bend(x, y, z, height, vx, vy, vz, ca, sa, cb, sb, da, db)


# (tower, work) -> Bend of the last evaluation of the loads, None for a rigid tower: sines take longer to find
# than to read
kept_bend = chosen_by_class("tower", {type(None): _still_straight, TowerModes: _read_bend})


@kernel
def from_nacelle(bend, x, y, z):
    """Return the platform components of a vector in nacelle axes."""
    along = bend.sb * y + bend.cb * z
    return bend.ca * x + bend.sa * along, bend.cb * y - bend.sb * z, bend.ca * along - bend.sa * x


@kernel
def to_nacelle(bend, x, y, z):
    """Return the nacelle components of a vector in platform axes."""
    along = bend.sa * x + bend.ca * z
    return bend.ca * x - bend.sa * z, bend.sb * along + bend.cb * y, bend.cb * along - bend.sb * y


@kernel
def turned_pose(pose, bend):
    """Return the Pose of the nacelle frame, equal to that of the body frame for a straight tower."""
    if bend is None:
        return pose
    z = bend.height
    r11, r12, r13 = to_nacelle(bend, pose.r11, pose.r12, pose.r13)
    r21, r22, r23 = to_nacelle(bend, pose.r21, pose.r22, pose.r23)
    r31, r32, r33 = to_nacelle(bend, pose.r31, pose.r32, pose.r33)
    wx, wy, wz = to_nacelle(bend, pose.wx, pose.wy, pose.wz)
    wx, wy, wz = wx + bend.db, wy + bend.cb * bend.da, wz - bend.sb * bend.da
    vx, vy, vz = to_nacelle(
        bend,
        pose.vx + pose.wy * bend.z - pose.wz * bend.y + bend.vx,
        pose.vy + pose.wz * bend.x - pose.wx * bend.z + bend.vy,
        pose.vz + pose.wx * bend.y - pose.wy * bend.x + bend.vz,
    )
    return Pose(
        pose.x + pose.r11 * bend.x + pose.r12 * bend.y + pose.r13 * bend.z - r13 * z,
        pose.y + pose.r21 * bend.x + pose.r22 * bend.y + pose.r23 * bend.z - r23 * z,
        pose.z + pose.r31 * bend.x + pose.r32 * bend.y + pose.r33 * bend.z - r33 * z,
        r11, r12, r13, r21, r22, r23, r31, r32, r33,
        vx - wy * z, vy + wx * z, vz, wx, wy, wz,
    )  # fmt: skip


@kernel
def nacelle_pose(pose, x, tower):
    """Return the Pose of the nacelle frame, fixed in the nacelle; rigid tower (None): pose.

    For a straight tower the nacelle frame coincides with the body frame: points of nacelle and rotor have the
    same coordinates in the nacelle frame as in the body frame of a rigid tower.
    """
    return turned_pose(pose, bend_of(x, tower))


@kernel
def carried(load, bend):
    """Transform a Wrench from the nacelle frame to the body frame; rigid tower: unchanged."""
    if bend is None:
        return load
    fx, fy, fz = from_nacelle(bend, load.fx, load.fy, load.fz)
    mx, my, mz = from_nacelle(bend, load.mx + bend.height * load.fy, load.my - bend.height * load.fx, load.mz)
    return Wrench(
        fx, fy, fz,
        mx + bend.y * fz - bend.z * fy,
        my + bend.z * fx - bend.x * fz,
        mz + bend.x * fy - bend.y * fx,
    )  # fmt: skip


@kernel
def push_modes(scale, fx, fy, fz, mx, my, mz, bend, tower, work, modal):
    """Add scale times the generalised forces of a wrench at the tower top, platform axes, to modal (n,)."""
    rolling = bend.ca * mx - bend.sa * mz
    for i in range(0, len(tower.beam.count), 2):
        modal[i] += scale * (fx + tower.slope[i] * my - work.sinking[i] * fz)
        modal[i + 1] += scale * (fy - tower.slope[i + 1] * rolling - work.sinking[i + 1] * fz)


@kernel
def add_modal(load, bend, tower, work, modal):
    """Add the generalised forces of a Wrench on the nacelle to modal (n,); no-op for a rigid tower."""
    if bend is None:
        return
    fx, fy, fz = from_nacelle(bend, load.fx, load.fy, load.fz)
    mx, my, mz = from_nacelle(bend, load.mx + bend.height * load.fy, load.my - bend.height * load.fx, load.mz)
    push_modes(1.0, fx, fy, fz, mx, my, mz, bend, tower, work, modal)


@inlined_kernel
def elastic_force(x, tower, modal):
    """Set modal (n,) to the generalised elastic and damping forces of the tower; no-op for a rigid tower."""
    if tower is None:
        return
    n, beam = len(tower.beam.count), tower.beam
    q, v = tower.first, tower.first + n
    for i in range(n):
        force = 0.0
        for j in range(n):
            force -= beam.stiffness[i, j] * x[q + j] + beam.damping[i, j] * x[v + j]
        modal[i] = force


@inlined_kernel
def reduce_tower(x, pose, tower, work):
    """Fill work with the reduced inertia of the bent tower in platform axes; no-op for a rigid tower."""
    if tower is None:
        return
    n, q = len(tower.beam.count), tower.first
    reduce_beam(
        x[q : q + n], x[q + n : q + 2 * n], pose.wx, pose.wy, pose.wz, tower.beam, work.tower_moment,
        work.tower_block, work.tower_coupling, work.tower_mass, work.tower_pull, work.tower_rest,
    )  # fmt: skip
    for i in range(n):
        work.sinking[i] = 0.0
        for j in range(n):
            work.sinking[i] += tower.shortening[i, j] * x[q + j]


@inlined_kernel
def top_bias(pose, x, bend, tower):
    """Return the bias accelerations of tower top and nacelle rotation, and the nacelle's angular velocity.

    Platform axes, for zero rates of all velocities: (ax, ay, az, alpha_x, alpha_y, alpha_z, wx, wy, wz).
    """
    wx, wy, wz, n = pose.wx, pose.wy, pose.wz, len(tower.beam.count)
    # w x (v + w x p + p') + w x p', without the acceleration of the top
    ux = pose.vx + wy * bend.z - wz * bend.y + 2.0 * bend.vx
    uy = pose.vy + wz * bend.x - wx * bend.z + 2.0 * bend.vy
    uz = pose.vz + wx * bend.y - wy * bend.x + 2.0 * bend.vz
    ax, ay, az = cross(wx, wy, wz, ux, uy, uz)
    v = tower.first + n
    for i in range(n):  # centripetal, of the curved path of the top
        for j in range(n):
            az -= x[v + i] * tower.shortening[i, j] * x[v + j]
    tx, ty, tz = bend.db * bend.ca, bend.da, -bend.db * bend.sa  # nacelle rotation relative to the platform
    bx, by, bz = cross(wx, wy, wz, tx, ty, tz)
    spread = bend.da * bend.db
    bx, bz = bx - spread * bend.sa, bz - spread * bend.ca
    return ax, ay, az, bx, by, bz, wx + tx, wy + ty, wz + tz


@inlined_kernel
def _level_motion(b, modal, bend, tower):
    """Return top_motion without the sinking of the top by bending."""
    bx, by, bz = b[3], b[4], b[5]
    ax, ay, az = b[0] + by * bend.z - bz * bend.y, b[1] + bz * bend.x - bx * bend.z, b[2]
    az += bx * bend.y - by * bend.x
    for i in range(0, len(tower.beam.count), 2):
        rolling = tower.slope[i + 1] * modal[i + 1]
        ax += modal[i]
        ay += modal[i + 1]
        bx -= rolling * bend.ca
        by += tower.slope[i] * modal[i]
        bz += rolling * bend.sa
    return ax, ay, az, bx, by, bz


@inlined_kernel
def top_motion(b, modal, bend, tower, work):
    """Return the acceleration (6) of tower top and nacelle by those of platform b (6,) and deflections."""
    ax, ay, az, bx, by, bz = _level_motion(b, modal, bend, tower)
    for i in range(len(tower.beam.count)):
        az -= work.sinking[i] * modal[i]
    return ax, ay, az, bx, by, bz


@kernel
def _platform_rates(pose, x, bend, dx, tower):
    return Twist(dx[State.VX], dx[State.VY], dx[State.VZ], dx[State.WX], dx[State.WY], dx[State.WZ])


@kernel
def _nacelle_rates(pose, x, bend, dx, tower):
    now, z, n, q = turned_pose(pose, bend), bend.height, len(tower.beam.count), tower.first
    ax, ay, az, bx, by, bz, _, _, _ = top_bias(pose, x, bend, tower)
    kx, ky, kz, sx, sy, sz = _level_motion(dx[State.VX :], dx[q + n :], bend, tower)
    for i in range(n):
        for j in range(n):
            kz -= dx[q + n + i] * tower.shortening[i, j] * x[q + j]
    ax, ay, az = to_nacelle(bend, ax + kx, ay + ky, az + kz)
    bx, by, bz = to_nacelle(bend, bx + sx, by + sy, bz + sz)
    wx, wy, wz = now.wx, now.wy, now.wz
    # acceleration of the frame's origin, z below the top, then rates of the velocity components
    ax, ay, az = ax - by * z - wx * wz * z, ay + bx * z - wy * wz * z, az + (wx * wx + wy * wy) * z
    cx, cy, cz = cross(wx, wy, wz, now.vx, now.vy, now.vz)
    return Twist(ax - cx, ay - cy, az - cz, bx, by, bz)


# (pose, x, bend, dx, tower) -> Twist of nacelle_pose, from the rates dx of the state
nacelle_rates = chosen_by_class("tower", {type(None): _platform_rates, TowerModes: _nacelle_rates})


@kernel
def fill_tower_rates(x, modal, tower, dx):
    """Fill dx with the rates of the deflections and, as input of the chain, the forces on them."""
    if tower is None:
        return
    n, q = len(tower.beam.count), tower.first
    for i in range(n):
        dx[q + i] = x[q + n + i]
        dx[q + n + i] = modal[i]
