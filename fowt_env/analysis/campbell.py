"""Computes the natural frequencies of a turbine that bends over its rotor speed (Campbell diagram).

The turbine stands on a fixed base in still air. Its equations of motion are linear about the steady rotation,
in which the centrifugal load bends the blades; a rotor of three or more equal blades has constant
coefficients in multi-blade coordinates (analysis/multiblade.py). Gravity acts on the tower and its top; on
single blades, where it varies with the azimuth, it is omitted.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from fowt_env.analysis.blade_coordinates import blade_waves
from fowt_env.analysis.tower_frequencies import NAMES, bending
from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError, unknown
from fowt_env.scene.blade_beam import MODES, blade_beam, blade_modes, blade_nodes
from fowt_env.scene.mass import rotor_mass_matrix
from fowt_env.scene.tower import MODES as TOWER_MODES

BLADE_NAMES = {"flap_1": "first flapwise", "flap_2": "second flapwise", "edge_1": "first edgewise"}
PATTERNS = ("collective", "regressive", "progressive")  # of a blade mode around the rotor
TORSION = "drivetrain torsion"
SHAFTS, GENERATORS = ("rigid", "torsion"), ("free", "fixed")
BLADES = 3
STEP = 1e-30  # of complex steps: derivatives to rounding
NEWTON_STEPS = 6


class Campbell(NamedTuple):
    """Holds frequencies and damping of the modes of a turbine at each rotor speed."""

    rotor_speed: np.ndarray  # (s,) rad/s
    frequency: dict  # mode: (s,) Hz, undamped, in the fixed frame
    damping: dict  # mode: (s,) structural damping ratio

    def crossings(self, harmonic):
        """Return [(mode, rotor speed rad/s)] at which a mode has a multiple of the rotor's frequency."""
        found = []
        for mode, values in self.frequency.items():
            apart = values - harmonic * self.rotor_speed / (2.0 * np.pi)
            for i in np.flatnonzero(apart[:-1] * apart[1:] < 0.0):
                part = apart[i] / (apart[i] - apart[i + 1])
                speed = self.rotor_speed[i] + part * (self.rotor_speed[i + 1] - self.rotor_speed[i])
                found.append((mode, float(speed)))
        return found


def campbell(
    platform, turbine, rotor_speeds, *, blades="modes2", tower="modes2", shaft="torsion", generator="free",
    blade_pitch=0.0,
):  # fmt: skip
    """Return the Campbell of a turbine on the tower of a platform, whose base is fixed.

    rotor_speeds  (s,) rad/s, increasing, >= 0
    blades, tower, shaft  what bends, as the scene options
    generator     "free": its inertia moves; "fixed": it turns at the rotor speed, or is locked at standstill
    blade_pitch   rad, of all blades
    Raises: InputError for values that are not allowed, and parts without data in the files.
    """
    for name, value, known in (
        ("blades", blades, MODES), ("tower", tower, TOWER_MODES), ("shaft", shaft, SHAFTS),
        ("generator", generator, GENERATORS),
    ):  # fmt: skip
        if value not in known:
            raise unknown(name, value, known)
    speeds = np.array(rotor_speeds, dtype=float)
    if speeds.ndim != 1 or not len(speeds) or not (np.isfinite(speeds) & (speeds >= 0.0)).all():
        raise InputError("rotor_speeds: must be one or more numbers >= 0 rad/s")
    if (np.diff(speeds) <= 0.0).any():
        raise InputError("rotor_speeds: must increase")
    check_number("blade_pitch", blade_pitch, -np.pi, np.pi)
    if shaft == "torsion" and turbine.shaft_torsion is None:
        raise InputError(
            f"shaft = 'torsion': the turbine {turbine.name!r} has no [shaft_torsion] in its file; allowed:"
            " 'rigid'"
        )
    if turbine.rotor.blades != BLADES:
        raise InputError(
            f"rotor.blades = {turbine.rotor.blades}: must be {BLADES} for multi-blade coordinates"
        )
    machine = _Turbine(platform, turbine, blades, tower, shaft, generator, blade_pitch)
    if not machine.labels:
        raise InputError("blades, tower, shaft: all are rigid; must have a mode")
    found = [_natural_modes(machine, speed) for speed in speeds]
    tables = [
        {name: np.array([modes[name][k] for modes in found]) for name in machine.labels} for k in (0, 1)
    ]
    return Campbell(speeds, *tables)


class _Turbine:
    """Computes the forces that given motions of a turbine need, in nacelle axes.

    Coordinates: n deflections of the tower, angles of hub and generator (on the low-speed side) against the
    steady rotation, and m deflections of each blade in turn. The forces are exact to first order in the
    coordinates of tower and shaft.
    """

    def __init__(self, platform, turbine, blades, tower, shaft, generator, blade_pitch):
        rotor, drivetrain, count = turbine.rotor, turbine.drivetrain, TOWER_MODES[tower]
        self.rotor, self.pitch = rotor, blade_pitch
        self.shaft = np.array([np.cos(rotor.shaft_tilt), 0.0, -np.sin(rotor.shaft_tilt)])
        self.apex = np.array([-rotor.overhang, 0.0, rotor.hub_height])
        self.tower = bending(platform, turbine, count) if count else None
        self.n = 2 * count
        names = () if blades == "rigid" else blade_modes(turbine, blades)
        self.m = len(names)
        self.beam = blade_beam(turbine, blades)
        self.nodes = blade_nodes(turbine, names) if names else None
        self.hub = _hub(rotor, self.beam)
        self.ratio, self.generator = drivetrain.gear_ratio, drivetrain.generator_inertia
        spring = turbine.shaft_torsion
        self.spring = (spring.stiffness, spring.damping) if shaft == "torsion" else (0.0, 0.0)
        self.size = self.n + 2 + BLADES * self.m
        # coordinates that are free: the twist of the shaft, and the generator's angle, which the hub follows
        tower, hub, follower, blade = np.split(np.eye(self.size), [self.n, self.n + 1, self.n + 2])
        angles = [hub] * (shaft == "torsion") + [hub + follower] * (generator == "free")
        self.free = np.concatenate([tower, *angles, blade]).T
        self.labels = [f"{NAMES[i // 2][i % 2]} tower" for i in range(self.n)]
        self.labels += [TORSION] * (shaft == "torsion")
        self.named = len(self.labels)  # coordinates with a mode of their own before the blades'
        self.labels += [f"{BLADE_NAMES[name]}, {pattern}" for name in names for pattern in PATTERNS]

    def blade_axes(self, number):
        """Return the (3, 3) axes of a blade, in columns, at azimuth 0 of the first."""
        psi, cone = 2.0 * np.pi * number / BLADES, self.rotor.cone
        across, up = np.array([0.0, 1.0, 0.0]), np.array([-self.shaft[2], 0.0, self.shaft[0]])
        radial = np.cos(psi) * up - np.sin(psi) * across
        left = np.cos(psi) * across + np.sin(psi) * up  # of a blade that is up: against the rotation
        normal = np.cos(cone) * self.shaft + np.sin(cone) * radial
        c, s = np.cos(self.pitch), np.sin(self.pitch)
        along = np.cos(cone) * radial - np.sin(cone) * self.shaft
        return np.column_stack([c * normal - s * left, s * normal + c * left, along])

    def blade(self, q, v, a, origin, w, alpha):
        """Return the generalised forces (m,), force and moment about the apex of a blade, in its axes.

        q, v, a: deflections and derivatives; origin, w, alpha: acceleration of the apex, angular velocity and
        acceleration of the blade's axes.
        """
        (U, _, S), z, mass = self.nodes.shapes, self.nodes.z, self.nodes.mass
        shorter = np.einsum("ijk,j->ik", S, q)
        p = np.array([q @ U[:, 0], q @ U[:, 1], z - 0.5 * q @ shorter]).T
        moved = np.stack([U[:, 0], U[:, 1], -shorter], axis=-1)  # (m, k, 3)
        acceleration = origin + np.cross(alpha, p) + np.cross(w, np.cross(w, p) + 2.0 * _total(v, moved))
        acceleration = acceleration + _total(a, moved)
        acceleration[:, 2] -= np.einsum("i,ijk,j->k", v, S, v)
        load = mass[:, None] * acceleration
        modal = np.einsum("ikx,kx->i", moved, load) + self.beam.stiffness @ q + self.beam.damping @ v
        return modal, load.sum(axis=0), np.cross(p, load).sum(axis=0)

    def steady_deflection(self, speed):
        """Return the (m,) deflections of the blades at a rotor speed (rad/s), without gravity."""
        w, none = speed * self.blade_axes(0).T @ self.shaft, np.zeros(3)
        q = np.zeros(self.m)
        for _ in range(NEWTON_STEPS):
            force, slope = _slope(lambda x: self.blade(x, 0.0 * x, 0.0 * x, none, w, none)[0], q)
            q = q - np.linalg.solve(slope, force)
        return q

    def forces(self, q, v, a, speed):
        """Return the (size,) generalised forces that coordinates and their derivatives need."""
        n, m = self.n, self.m
        out = np.zeros(self.size, dtype=complex)
        nacelle, turning = np.zeros(6), np.zeros(3)  # acceleration at the body origin, angular velocity
        if n:
            nacelle, turning = self.tower.top_motion @ a[:n], self.tower.top_motion[3:] @ v[:n]
        w = turning + (speed + v[n]) * self.shaft
        alpha = nacelle[3:] + a[n] * self.shaft + np.cross(turning, speed * self.shaft)
        origin = nacelle[:3] + np.cross(nacelle[3:], self.apex)
        mass, first, inertia = self.hub
        centre, spin = first * self.shaft, inertia(self.shaft)
        force = mass * origin + np.cross(alpha, centre) + np.cross(w, np.cross(w, centre))
        moment = np.cross(centre, origin) + spin @ alpha + np.cross(w, spin @ w)
        for number in range(BLADES * bool(m)):
            axes, mine = self.blade_axes(number), slice(n + 2 + number * m, n + 2 + (number + 1) * m)
            modal, f, mo = self.blade(q[mine], v[mine], a[mine], axes.T @ origin, axes.T @ w, axes.T @ alpha)
            out[mine], force, moment = modal, force + axes @ f, moment + axes @ mo
        twist = self.spring[0] * (q[n] - q[n + 1]) + self.spring[1] * (v[n] - v[n + 1])
        out[n] = self.shaft @ moment + twist
        # the generator turns in the nacelle, whose inertia has that of the locked generator
        spun = self.ratio * self.generator
        out[n + 1] = spun * (self.ratio * a[n + 1] + self.shaft @ nacelle[3:]) - twist
        moment = moment + spun * a[n + 1] * self.shaft
        if n:
            tower, rotor = self.tower, rotor_mass_matrix(self.rotor)
            rest = tower.mass - tower.top_motion.T @ rotor @ tower.top_motion
            wrench = np.concatenate([force, np.cross(self.apex, force) + moment])
            out[:n] = (
                rest @ a[:n] + tower.stiffness @ q[:n] + tower.damping @ v[:n] + tower.top_motion.T @ wrench
            )
        return out

    def linear(self, speed):
        """Return mass, damping and stiffness in the free coordinates, the blades' as multi-blade ones."""
        q, zero = np.zeros(self.size), np.zeros(self.size)
        if self.m:
            q[self.n + 2 :] = np.tile(self.steady_deflection(speed), BLADES)
        stiffness = _slope(lambda x: self.forces(x, zero, zero, speed), q)[1]
        damping = _slope(lambda x: self.forces(q, x, zero, speed), zero)[1]
        mass = _slope(lambda x: self.forces(q, zero, x, speed), zero)[1]
        size, fixed = self.free.shape[1], self.free.shape[1] - BLADES * self.m
        psi = 2.0 * np.pi * np.arange(BLADES) / BLADES
        change, turn = np.eye(size), np.zeros((size, size))
        change[fixed:, fixed:] = np.kron(np.column_stack([psi**0, np.cos(psi), np.sin(psi)]), np.eye(self.m))
        turn[fixed:, fixed:] = np.kron([[0, 0, 0], [0, 0, 1], [0, -1, 0]], np.eye(self.m))  # per angle
        back = np.linalg.inv(change)
        mass, damping, stiffness = (
            back @ self.free.T @ matrix @ self.free @ change for matrix in (mass, damping, stiffness)
        )
        stiffness = stiffness + speed * damping @ turn + speed**2 * mass @ turn @ turn
        return mass, damping + 2.0 * speed * mass @ turn, stiffness


def _natural_modes(machine, speed):
    """Return {mode: (frequency Hz, damping ratio)} at a rotor speed (rad/s).

    Each mode has the name of the coordinate with the largest share of its kinetic energy, each name once.
    """
    mass, damping, stiffness = machine.linear(speed)
    size, m = len(mass), machine.m
    rates = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    values, vectors = np.linalg.eig(np.vstack([np.eye(size, 2 * size, size), rates]))
    kept = np.argsort(-values.imag)[: len(machine.labels)]
    values, shapes = values[kept], vectors[:size, kept]
    weight = np.abs(np.diag(mass))
    shares = [weight[: machine.named, None] * np.abs(shapes[: machine.named]) ** 2]
    for k in range(m):
        mean, tilt, yaw = (size - BLADES * m + k + i * m for i in range(BLADES))
        waves = blade_waves(shapes[tilt], shapes[yaw])
        shares.append(weight[mean] * np.abs([shapes[mean], *waves.values()]) ** 2)
    shares = np.concatenate(shares)
    labels, modes = linear_sum_assignment(-shares / shares.sum(axis=0))
    found = {machine.labels[i]: values[k] for i, k in zip(labels, modes, strict=True)}
    if speed == 0.0:  # no direction of rotation: the lower one is called regressive
        for name in machine.labels[machine.named :: BLADES]:
            pair = [name.replace(PATTERNS[0], pattern) for pattern in PATTERNS[1:]]
            found |= dict(zip(pair, sorted((found[each] for each in pair), key=abs), strict=True))
    return {name: (abs(value) / (2.0 * np.pi), -value.real / abs(value)) for name, value in found.items()}


def _hub(rotor, beam):
    """Return mass, first moment along the shaft and inertia about the apex of a rotor without its blades.

    The inertia is a function of the shaft's direction (3,).
    """
    mass, first = rotor.mass, rotor.mass * rotor.cm_offset
    about, across = rotor.inertia, rotor.inertia_diameter + rotor.mass * rotor.cm_offset**2
    if beam is not None:
        spin = beam.second * np.cos(rotor.cone) ** 2
        mass, first = mass - BLADES * beam.mass, first + BLADES * beam.first * np.sin(rotor.cone)
        about, across = about - BLADES * spin, across - BLADES * (beam.second - 0.5 * spin)
    return mass, first, lambda n: across * np.eye(3) + (about - across) * np.outer(n, n)


def _total(factors, vectors):
    """Return the (k, 3) sums of vectors (m, k, 3) times factors (m,)."""
    return np.einsum("i,ikx->kx", factors, vectors)


def _slope(function, x):
    """Return (value, (rows, n) derivatives) of an analytic function at x (n,), by complex steps."""
    columns = [function(x + 1j * STEP * unit) for unit in np.eye(len(x))]
    return np.real(columns[0]), np.array([np.imag(column) / STEP for column in columns]).T
