"""Defines the modes of a flexible tower and the resulting motion of nacelle and rotor (theory.md, 2.7).

Points of the tower move normal to the tower axis by the sum of shape times deflection, and nacelle and rotor
rotate with the tower top as one rigid body. With a rigid tower the part is None. Modes come in pairs of the
same order: even indices are fore-aft, odd ones side-side.
"""

from math import cos, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.handle import by_reference
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.state import Pose

MOST_MODES = 4


@by_reference
class TowerModes(NamedTuple):
    """Holds the n modes of a tower: first fore-aft, first side-side, and optionally the second pair."""

    first: int  # index in the state of the first deflection; the velocities follow the n deflections
    fore_aft: np.ndarray  # (n,) 1.0 fore-aft, 0.0 side-side
    top_height: float  # m, tower top above the body origin, where all shapes are 1
    slope: np.ndarray  # (n,) 1/m, of each shape at the top
    first_moment: np.ndarray  # (n,) kg, integral of the tower's line mass times shape
    height_moment: np.ndarray  # (n,) kg m, of line mass times height above the body origin times shape
    mass: np.ndarray  # (n, n) kg, of line mass times both shapes, also across directions
    stiffness: np.ndarray  # (n, n) N/m, of the structure
    damping: np.ndarray  # (n, n) N s/m, of the structure
    weight_stiffness: np.ndarray  # (n, n) kg/m, times gravity subtracted from stiffness: axial shortening
    drag_shape: np.ndarray  # (points, n) shapes at the points of tower_drag.TowerDrag
    count: tuple  # n zeros: a tuple, so that n is known at compile time
    lower: object = None  # (6, 6) mass matrix of floater and straight tower about the body origin
    straight: object = None  # (6, 6) mass matrix of the straight tower alone
    upper_mass: float = 0.0  # kg, of nacelle and rotor
    upper_moment: object = None  # (3,) kg m, first moment of both about the tower top, nacelle axes
    upper_inertia: object = None  # (3, 3) kg m2, about the tower top, nacelle axes
    shaft: object = None  # (3,) direction of the shaft, downwind, nacelle axes
    # upper_mass and upper_moment, or zeros where the weight of both is in their own equations (elastic/)
    hanging_mass: float = 0.0
    hanging_moment: object = None


class Bend(NamedTuple):
    """Holds the motion of the tower top relative to the platform; Ry(a) Rx(b) rotates the nacelle."""

    x: float  # m, displacement of the top
    y: float
    z: float  # m, height of the top
    vx: float  # m/s
    vy: float
    ca: float  # cosine and sine of a and b
    sa: float
    cb: float
    sb: float
    da: float  # rad/s
    db: float


@kernel
def _straight(x, tower):
    return None


@inlined_kernel
def bend_by_modes(x, tower):
    """Return the Bend of the tower top in state x."""
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
    """Return the Pose of the nacelle frame, fixed in the nacelle; rigid tower (None): pose.

    For a straight tower the nacelle frame coincides with the body frame: points of nacelle and rotor have the
    same coordinates in the nacelle frame as in the body frame of a rigid tower.
    """
    return turned_pose(pose, bend_of(x, tower))
