"""Slow, obvious twin of the rigid-body core (theory.md, section 2): five bodies, Newton and Euler for each.

No mass matrix is formed. Each body has its centre, its inertia and its spin; its acceleration is
written down in full and projected on the seven speeds (v, w, w_b) by its partial velocities.
"""

from dataclasses import dataclass, field

import numpy as np

GENERATOR_MASS = 3000.0  # kg; where the generator rotor sits and what it weighs must not matter, since
GENERATOR_CENTRE = np.array([3.0, 0.4, 89.0])  # m; the nacelle's figures include it


@dataclass
class Body:
    """One rigid body, in platform axes: mass, centre, inertia about the centre, spin ratio to the rotor's."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray  # (3, 3)
    spin: float = 0.0  # its angular velocity is w + spin * w_b * axis
    axis: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))

    def velocity(self, v, w):
        return v + np.cross(w, self.centre)

    def acceleration(self, v, w, dv, dw):
        """Absolute acceleration of the centre: of the origin, then of a point of the turning frame."""
        origin = dv + np.cross(w, v)
        return origin + np.cross(dw, self.centre) + np.cross(w, np.cross(w, self.centre))

    def turning(self, w, rotor_speed):
        return w + self.spin * rotor_speed * self.axis

    def turning_rate(self, w, rotor_speed, dw, drotor_speed):
        """Absolute angular acceleration: the spin axis itself turns with the platform."""
        spin = self.spin * rotor_speed * self.axis
        return dw + self.spin * drotor_speed * self.axis + np.cross(w, spin)


def steiner(mass, r):
    """Inertia about the origin of a point mass at r."""
    r = np.asarray(r, dtype=float)
    return mass * (r @ r * np.eye(3) - np.outer(r, r))


def bodies(platform, turbine):
    """[spar, tower, nacelle shell, generator rotor, rotor] of two descriptions."""
    ballast, tower, nacelle, rotor = platform.ballast, platform.tower, turbine.nacelle, turbine.rotor
    shaft = turbine.drivetrain
    spin_inertia = shaft.generator_inertia
    turn = rotation(0.0, rotor.shaft_tilt, 0.0)  # its first column is the shaft, downwind
    generator = Body(
        GENERATOR_MASS,
        GENERATOR_CENTRE,
        turn @ np.diag([spin_inertia, 0.7 * spin_inertia, 0.7 * spin_inertia]) @ turn.T,
        shaft.gear_ratio,
        turn[:, 0],
    )
    whole = np.array([nacelle.cm_downwind, nacelle.cm_left, nacelle.cm_height])
    shell_mass = nacelle.mass - GENERATOR_MASS
    shell_centre = (nacelle.mass * whole - GENERATOR_MASS * GENERATOR_CENTRE) / shell_mass
    about_origin = (
        np.diag(nacelle.inertia)
        + steiner(nacelle.mass, whole)
        - generator.inertia
        - steiner(GENERATOR_MASS, GENERATOR_CENTRE)
    )
    return [
        Body(
            ballast.mass,
            np.array([ballast.cm_downwind, ballast.cm_left, -ballast.cm_depth]),
            np.diag(ballast.inertia),
        ),
        Body(tower.mass, np.array([0.0, 0.0, tower.cm_height]), np.diag(tower.inertia)),
        Body(shell_mass, shell_centre, about_origin - steiner(shell_mass, shell_centre)),
        generator,
        Body(
            rotor.mass,
            hub(turbine) + rotor.cm_offset * turn[:, 0],
            turn @ np.diag([rotor.inertia, rotor.inertia_diameter, rotor.inertia_diameter]) @ turn.T,
            1.0,
            turn[:, 0],
        ),
    ]


def hub(turbine):
    return np.array([-turbine.rotor.overhang, 0.0, turbine.rotor.hub_height])


def rotation(roll, pitch, yaw):
    """R = Rz Ry Rx by three plain rotations."""
    c, s = np.cos(roll), np.sin(roll)
    Rx = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    c, s = np.cos(pitch), np.sin(pitch)
    Ry = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    c, s = np.cos(yaw), np.sin(yaw)
    Rz = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return Rz @ Ry @ Rx


def inertia_forces(parts, v, w, rotor_speed, dv, dw, drotor_speed):
    """(7,) generalised inertia forces: each body's m a and Euler term on the partial velocities."""
    total = np.zeros(7)
    for body in parts:
        force = body.mass * body.acceleration(v, w, dv, dw)
        W = body.turning(w, rotor_speed)
        moment = body.inertia @ body.turning_rate(w, rotor_speed, dw, drotor_speed)
        moment = moment + np.cross(W, body.inertia @ W)
        for j in range(7):
            unit = np.zeros(7)
            unit[j] = 1.0
            total[j] += force @ body.velocity(unit[:3], unit[3:6])
            total[j] += moment @ body.turning(unit[3:6], unit[6])
    return total


def accelerations(
    platform, turbine, R, v, w, rotor_speed, hub_force, hub_moment, torque, gravity, held=False, **generator
):
    """(7,) v', w', w_b' under gravity, a load on the rotor at the hub and a generator torque pair.

    held: a motor keeps the rotor speed, so that w_b' = 0 and the last equation gives its torque.
    """
    parts = bodies(platform, turbine, **generator)
    down = -gravity * R[2]  # platform axes
    loads = np.zeros(7)
    for j in range(7):
        unit = np.zeros(7)
        unit[j] = 1.0
        for body in parts:
            loads[j] += body.mass * down @ body.velocity(unit[:3], unit[3:6])
        rotor, shell, spinning = parts[4], parts[2], parts[3]
        loads[j] += hub_force @ (unit[:3] + np.cross(unit[3:6], hub(turbine)))
        loads[j] += hub_moment @ rotor.turning(unit[3:6], unit[6])
        # the stator pushes the generator rotor back, and is pushed forward as hard
        loads[j] -= torque * spinning.turning(unit[3:6], unit[6]) @ spinning.axis
        loads[j] += torque * shell.turning(unit[3:6], unit[6]) @ spinning.axis
    zero = np.zeros(3)
    rest = inertia_forces(parts, v, w, rotor_speed, zero, zero, 0.0)
    matrix = np.empty((7, 7))
    for j in range(7):
        unit = np.zeros(7)
        unit[j] = 1.0
        matrix[:, j] = inertia_forces(parts, v, w, rotor_speed, unit[:3], unit[3:6], unit[6]) - rest
    if held:
        return np.r_[np.linalg.solve(matrix[:6, :6], (loads - rest)[:6]), 0.0]
    return np.linalg.solve(matrix, loads - rest)


def kinetic_energy(parts, v, w, rotor_speed):
    total = 0.0
    for body in parts:
        u, W = body.velocity(v, w), body.turning(w, rotor_speed)
        total += 0.5 * body.mass * u @ u + 0.5 * W @ body.inertia @ W
    return total


def potential_energy(parts, r, R, gravity):
    return sum(body.mass * gravity * (r + R @ body.centre)[2] for body in parts)


def momenta(parts, r, R, v, w, rotor_speed):
    """Linear momentum and angular momentum about the inertial origin, inertial axes."""
    linear, angular = np.zeros(3), np.zeros(3)
    for body in parts:
        p = R @ (body.mass * body.velocity(v, w))
        linear += p
        angular += np.cross(r + R @ body.centre, p) + R @ (body.inertia @ body.turning(w, rotor_speed))
    return linear, angular


def quaternion(roll, pitch, yaw):
    """Unit quaternion, scalar first, of the same rotation."""
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for angle, axis in ((yaw, 3), (pitch, 2), (roll, 1)):
        turn = np.zeros(4)
        turn[0], turn[axis] = np.cos(angle / 2), np.sin(angle / 2)
        q = product(q, turn)
    return q


def product(a, b):
    """Quaternion product a b."""
    return np.r_[a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])]


def quaternion_rotation(q):
    """Rotation matrix of a quaternion of any length, column by column as q e q*."""
    q = q / np.linalg.norm(q)
    turned_back = q * np.array([1.0, -1.0, -1.0, -1.0])
    columns = [product(product(q, np.r_[0.0, axis]), turned_back)[1:] for axis in np.eye(3)]
    return np.array(columns).T


def quaternion_rate(q, w):
    """q' = q (0, w)/2."""
    return 0.5 * product(q, np.r_[0.0, w])
