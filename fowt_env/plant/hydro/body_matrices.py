"""Applies constant matrices of a floating body about its undisplaced pose (theory.md, 5.7).

Potential-flow hydrostatics and the added mass at infinite frequency, with the additional preload, stiffness
and damping of the platform file, about the body origin, each in the axes of HydroDyn:

    inertial axes   preload - stiffness q - added_mass q''
    heading         buoyancy - water_stiffness (heave, roll, pitch)
    body axes       -linear_damping nu - quadratic_damping |nu| nu

Heading: the inertial axes turned by the yaw angle, in which roll and pitch are the tilt of the waterplane. A
stiffness in inertial axes would drive a yawed body in roll by its pitch, near the natural period of both.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import State, Wrench, add, to_body


class BodyMatrices(NamedTuple):
    """Holds matrices about the body origin; q: surge, sway, heave, roll, pitch, yaw."""

    preload: np.ndarray  # (6,) N, N m
    stiffness: np.ndarray  # (6, 6) additional
    buoyancy: np.ndarray  # (6,) of the undisplaced body, N, N m
    water_stiffness: np.ndarray  # (3, 3) hydrostatic, of heave, roll and pitch
    linear_damping: np.ndarray  # (6, 6)
    quadratic_damping: np.ndarray  # (6, 6), on |nu| nu of each motion
    added_mass: np.ndarray  # (6, 6) at infinite frequency, symmetric


def build_body_matrices(potential, additional, density, gravity):
    """Return the BodyMatrices of a PotentialFlow and AdditionalLoads, each optional; None without both."""
    if potential is None and additional is None:
        return None
    preload, buoyancy, water, added = np.zeros(6), np.zeros(6), np.zeros((3, 3)), np.zeros((6, 6))
    stiffness, linear, quadratic = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6))
    if potential is not None:
        weight = density * gravity * potential.volume
        x, y = potential.centre_of_buoyancy
        buoyancy += [0.0, 0.0, weight, weight * y, -weight * x, 0.0]
        water += potential.stiffness[2:5, 2:5]
        added += 0.5 * (potential.added_mass_infinite + potential.added_mass_infinite.T)
    if additional is not None:
        preload += additional.preload
        for matrix, rows in (
            (stiffness, additional.stiffness),
            (linear, additional.linear_damping),
            (quadratic, additional.quadratic_damping),
        ):
            if rows is not None:
                matrix += np.array(rows)
    return BodyMatrices(preload, stiffness, buoyancy, water, linear, quadratic, added)


@kernel
def add_body_matrices(pose, x, load, part, added):
    """Return load plus that of BodyMatrices except added mass times acceleration; add to added (6, 6).

    part None: unchanged. Accelerations of the added mass are those of the body origin: R (v' + w x v), R w'.
    """
    if part is None:
        return load
    level = sqrt(pose.r11 * pose.r11 + pose.r21 * pose.r21)
    c, s = pose.r11 / level, pose.r21 / level  # of the yaw angle
    h = part.buoyancy
    hz, hx, hy = _upright(0, x, part), _upright(1, x, part), _upright(2, x, part)
    force = to_body(
        pose,
        _earth_force(0, x, part) + c * h[0] - s * h[1],
        _earth_force(1, x, part) + s * h[0] + c * h[1],
        _earth_force(2, x, part) + hz,
    )
    moment = to_body(
        pose,
        _earth_force(3, x, part) + c * hx - s * hy,
        _earth_force(4, x, part) + s * hx + c * hy,
        _earth_force(5, x, part) + h[5],
    )
    u, w = (pose.vx, pose.vy, pose.vz), (pose.wx, pose.wy, pose.wz)
    held = Wrench(
        force[0] - _damping(0, u, w, part),
        force[1] - _damping(1, u, w, part),
        force[2] - _damping(2, u, w, part),
        moment[0] - _damping(3, u, w, part),
        moment[1] - _damping(4, u, w, part),
        moment[2] - _damping(5, u, w, part),
    )
    return add(add(load, held), _add_turned_mass(pose, part.added_mass, added))


@kernel
def _earth_force(i, x, part):
    """Return component i of preload and additional stiffness, inertial axes."""
    total = part.preload[i]
    for j in range(6):
        total -= part.stiffness[i, j] * x[State.SURGE + j]
    return total


@kernel
def _upright(i, x, part):
    """Return component i of heave, roll and pitch of the hydrostatic load, in the axes of the heading."""
    total = part.buoyancy[2 + i]
    for j in range(3):
        total -= part.water_stiffness[i, j] * x[State.HEAVE + j]
    return total


@kernel
def _damping(i, u, w, part):
    """Return component i of the damping times the velocities u, w of the body, body axes."""
    total = 0.0
    for j in range(3):
        total += (part.linear_damping[i, j] + part.quadratic_damping[i, j] * abs(u[j])) * u[j]
        total += (part.linear_damping[i, 3 + j] + part.quadratic_damping[i, 3 + j] * abs(w[j])) * w[j]
    return total


@kernel
def _add_turned_mass(pose, mass, added):
    """Add the added mass in body axes to `added`; return its load by rotation, -A (w x v, 0)."""
    cx = pose.wy * pose.vz - pose.wz * pose.vy
    cy = pose.wz * pose.vx - pose.wx * pose.vz
    cz = pose.wx * pose.vy - pose.wy * pose.vx
    fx = fy = fz = mx = my = mz = 0.0
    for j in range(3):  # columns of R, the body axes, and their products with the mass
        a, b, c = _axis(j, pose)
        p0 = _product(0, mass, a, b, c, 0)
        p1 = _product(1, mass, a, b, c, 0)
        p2 = _product(2, mass, a, b, c, 0)
        k0 = _product(3, mass, a, b, c, 0)
        k1 = _product(4, mass, a, b, c, 0)
        k2 = _product(5, mass, a, b, c, 0)
        r0, r1, r2 = to_body(pose, p0, p1, p2)
        s0, s1, s2 = to_body(pose, k0, k1, k2)
        added[0, j] += r0
        added[1, j] += r1
        added[2, j] += r2
        added[3, j] += s0
        added[4, j] += s1
        added[5, j] += s2
        added[j, 3] += s0
        added[j, 4] += s1
        added[j, 5] += s2
        turn = cx if j == 0 else (cy if j == 1 else cz)
        fx -= r0 * turn
        fy -= r1 * turn
        fz -= r2 * turn
        mx -= s0 * turn
        my -= s1 * turn
        mz -= s2 * turn
        k0 = _product(3, mass, a, b, c, 3)
        k1 = _product(4, mass, a, b, c, 3)
        k2 = _product(5, mass, a, b, c, 3)
        s0, s1, s2 = to_body(pose, k0, k1, k2)
        added[3, 3 + j] += s0
        added[4, 3 + j] += s1
        added[5, 3 + j] += s2
    return Wrench(fx, fy, fz, mx, my, mz)


@kernel
def _axis(j, pose):
    """Return body axis j in inertial components."""
    if j == 0:
        return pose.r11, pose.r21, pose.r31
    if j == 1:
        return pose.r12, pose.r22, pose.r32
    return pose.r13, pose.r23, pose.r33


@kernel
def _product(i, mass, a, b, c, start):
    """Return row i of three columns of the mass matrix from `start` on, times a vector."""
    return mass[i, start] * a + mass[i, start + 1] * b + mass[i, start + 2] * c
