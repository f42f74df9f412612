"""Slow, obvious twin of a turbine whose tower bends: particles, the second derivatives of their paths.

Every rigid body is a handful of particles of the same mass, centre and inertia (some of negative mass), the
tower a row of them, and the rotor and the generator turn. A path of the generalised coordinates
c = (r, angles, azimuth, q) gives each particle's velocity and acceleration by Taylor arithmetic, and virtual
power the equation of motion: no mass matrix, velocity term or angular velocity is written down anywhere.
"""

from dataclasses import dataclass

import numpy as np

SPIN_CENTRE = np.array([2.0, 0.3, 88.0])  # m, of the generator's wheel, which may be anywhere in the nacelle


class Path:
    """Value, first and second derivative by time."""

    __array_ufunc__ = None

    def __init__(self, value, first=0.0, second=0.0):
        self.value, self.first, self.second = value, first, second

    def __add__(self, other):
        o = other if isinstance(other, Path) else Path(other)
        return Path(self.value + o.value, self.first + o.first, self.second + o.second)

    def __mul__(self, other):
        o = other if isinstance(other, Path) else Path(other)
        return Path(
            self.value * o.value,
            self.first * o.value + self.value * o.first,
            self.second * o.value + 2.0 * self.first * o.first + self.value * o.second,
        )

    def __neg__(self):
        return self * -1.0

    def __sub__(self, other):
        return self + (-other if isinstance(other, Path) else -np.asarray(other))

    __radd__, __rmul__ = __add__, __mul__

    def sin_cos(self):
        s, c = np.sin(self.value), np.cos(self.value)
        return (
            Path(s, c * self.first, c * self.second - s * self.first**2),
            Path(c, -s * self.first, -s * self.second - c * self.first**2),
        )


def turned(axis, angle, point):
    """A point [x, y, z] turned about a coordinate axis."""
    s, c = angle.sin_cos()
    x, y, z = point
    if axis == 0:
        return [x, c * y - s * z, s * y + c * z]
    if axis == 1:
        return [c * x + s * z, y, c * z - s * x]
    return [c * x - s * y, s * x + c * y, z]


def particles(mass, centre, inertia):
    """(masses (7,), places (7, 3)) of the same mass, centre and inertia (3,) or (3, 3) about it."""
    tensor = np.diag(inertia) if np.ndim(inertia) == 1 else inertia
    moments, axes = np.linalg.eigh(0.5 * np.trace(tensor) * np.eye(3) - tensor)
    masses, places = [mass], [np.array(centre, dtype=float)]
    for moment, axis in zip(moments, axes.T, strict=True):
        share = np.copysign(0.1 * mass, moment)
        away = np.sqrt(moment / (2.0 * share)) * axis
        masses[0] -= 2.0 * share
        masses += [share, share]
        places += [centre + away, centre - away]
    return np.array(masses), np.array(places)


@dataclass
class Tower:
    """Line mass in lumps, with the shapes of n modes (fore-aft and side-side by turns) there."""

    height: np.ndarray  # (k,) m
    mass: np.ndarray  # (k,) kg
    shape: np.ndarray  # (k, n)
    slope: np.ndarray  # (n,) at the top, where the shapes are 1
    top: float  # m
    stiffness: np.ndarray
    damping: np.ndarray
    shortening: np.ndarray  # (k, n, n) 1/m: a lump sinks by q S q / 2; the last lump is the top


class Turbine:
    """The particles of a platform, its bending tower and a turbine (two descriptions)."""

    def __init__(self, platform, turbine, tower):
        ballast, straight, nacelle, rotor = platform.ballast, platform.tower, turbine.nacelle, turbine.rotor
        self.tower, self.n, self.gravity = tower, len(tower.slope), platform.environment.gravity
        self.ratio, self.tilt, self.base = (
            turbine.drivetrain.gear_ratio,
            rotor.shaft_tilt,
            straight.base_height,
        )
        shaft = np.array([np.cos(self.tilt), 0.0, -np.sin(self.tilt)])
        self.hub = np.array([-rotor.overhang, 0.0, rotor.hub_height])
        self.rotor_centre = self.hub + rotor.cm_offset * shaft
        place = np.array([ballast.cm_downwind, ballast.cm_left, -ballast.cm_depth])
        self.floater = particles(ballast.mass, place, ballast.inertia)
        # the lumps take the straight tower's mass from its axis and put it where they are
        axis = np.column_stack([0.0 * tower.height, 0.0 * tower.height, tower.height])
        whole = particles(straight.mass, np.array([0.0, 0.0, straight.cm_height]), straight.inertia)
        self.straight = together(whole, (-tower.mass, axis))
        centre = np.array([nacelle.cm_downwind, nacelle.cm_left, nacelle.cm_height])
        wheel, rim = self._wheel(turbine.drivetrain.generator_inertia)
        self.nacelle = together(particles(nacelle.mass, centre, nacelle.inertia), (-wheel, rim + SPIN_CENTRE))
        along = np.outer(shaft, shaft)
        inertia = rotor.inertia * along + rotor.inertia_diameter * (np.eye(3) - along)
        masses, places = particles(rotor.mass, self.rotor_centre, inertia)
        self.rotor = masses, places - self.hub
        self.wheel = wheel, rim

    def _wheel(self, inertia):
        """(masses (4,), places (4, 3)) of a rim around the shaft."""
        side = np.array([[0.0, 1.0, 0.0], [np.sin(self.tilt), 0.0, np.cos(self.tilt)]])
        return np.full(4, 0.25 * inertia), np.concatenate([side, -side])

    def angles(self, c):
        """Bending slopes at the top: about y, about x."""
        a = b = Path(0.0)
        for i in range(self.n):
            turn = c[7 + i] * self.tower.slope[i]
            a, b = (a + turn, b) if i % 2 == 0 else (a, b - turn)
        return a, b

    def on_platform(self, c, point):
        for axis in range(3):
            point = turned(axis, c[3 + axis], point)
        return [p + c[i] for i, p in enumerate(point)]

    def on_nacelle(self, c, point):
        a, b = self.angles(c)
        x, y, z = turned(1, a, turned(0, b, [point[0], point[1], point[2] + Path(-self.tower.top)]))
        for i in range(self.n):
            x, y = (x + c[7 + i], y) if i % 2 == 0 else (x, y + c[7 + i])
        return self.on_platform(c, [x, y, z + self.tower.top - self.sunk(c, self.tower.shortening[-1])])

    def sunk(self, c, shortening):
        """How far a lump, or (k,) of them, have sunk along the tower's axis."""
        total = Path(0.0 * shortening[..., 0, 0])
        for i in range(self.n):
            for j in range(self.n):
                total = total + c[7 + i] * c[7 + j] * (0.5 * shortening[..., i, j])
        return total

    def on_shaft(self, c, point, centre, turns):
        point = turned(1, Path(-self.tilt), point)
        point = turned(1, Path(self.tilt), turned(0, c[6] * turns, point))
        return self.on_nacelle(c, [p + centre[i] for i, p in enumerate(point)])

    def bodies(self, c):
        """[(masses, [X, Y, Z] Paths)] of all particles for coordinates [Path]."""
        tower = self.tower
        x = y = Path(np.zeros(len(tower.height)))
        for i in range(self.n):
            moved = c[7 + i] * tower.shape[:, i]
            x, y = (x + moved, y) if i % 2 == 0 else (x, y + moved)
        return [
            (self.floater[0], self.on_platform(c, columns(self.floater[1]))),
            (self.straight[0], self.on_platform(c, columns(self.straight[1]))),
            (tower.mass, self.on_platform(c, [x, y, Path(tower.height) - self.sunk(c, tower.shortening)])),
            (self.nacelle[0], self.on_nacelle(c, columns(self.nacelle[1]))),
            (self.rotor[0], self.on_shaft(c, columns(self.rotor[1]), self.hub, 1.0)),
            (self.wheel[0], self.on_shaft(c, columns(self.wheel[1]), SPIN_CENTRE, self.ratio)),
        ]

    def potential(self, c):
        """Path of the potential energy: weight, structure of the tower."""
        total = Path(0.0)
        for masses, (_, _, Z) in self.bodies(c):
            parts = (np.asarray(part) * masses for part in (Z.value, Z.first, Z.second))
            total = total + Path(*(np.sum(part, axis=-1, keepdims=True) for part in parts)) * self.gravity
        for i in range(self.n):
            for j in range(self.n):
                square = c[7 + i] * c[7 + j] * 0.5
                total = total + square * self.tower.stiffness[i, j]
        return total

    def kinetic(self, c):
        return 0.5 * sum(np.sum(m * (x.first**2)) for m, place in self.bodies(c) for x in place)

    def path(self, x, blocks):
        """Coordinates [Path] of a plant's state, no second derivatives; blocks: index of q, of its rates."""
        n = self.n
        place = np.r_[x[:6], x[6], x[blocks[0] : blocks[0] + n]]
        rate, units = np.zeros(7 + n), self.units(place)
        rate[:3] = self.frame(units)[0] @ x[7:10]
        rate[3:6] = np.linalg.solve(self.motion(units)[1][:, 3:6], x[10:13])
        rate[6], rate[7:] = x[13], x[blocks[1] : blocks[1] + n]
        return [Path(p, r) for p, r in zip(place, rate, strict=True)]

    def units(self, place):
        """One path for each coordinate, along which it alone moves: a row of first derivatives each."""
        return [Path(p, unit[:, None]) for p, unit in zip(place, np.eye(len(place)), strict=True)]

    def fall(self, moving, torque, forces, added):
        """moving (a path) with the second derivatives that follow from its loads.

        torque: of the generator, on its own shaft; added: (6, 6) added mass.
        forces: [(on the nacelle or not, point, force, moment, (3,) each)] in the axes of what they act on.
        """
        size = 7 + self.n
        units = self.units([c.value for c in moving])
        matrix, right = np.zeros((size, size)), -self.potential(units).first[:, 0]
        for (masses, alone), (_, found) in zip(self.bodies(units), self.bodies(moving), strict=True):
            jacobian = np.array([np.broadcast_to(X.first, (size, len(masses))) for X in alone])
            bias = np.array([np.broadcast_to(X.second, masses.shape) for X in found])
            right -= np.einsum("p,ip,ikp->k", masses, bias, jacobian)
            matrix += np.einsum("p,ijp,ikp->jk", masses, jacobian, jacobian)
        right[7:] -= self.tower.damping @ [c.first for c in moving[7:]]
        right[6] -= self.ratio * torque
        for aloft, point, force, moment in forces:
            place = self.carry(aloft)(units, [Path(p) for p in point])
            speed = np.array([np.broadcast_to(X.first, (size, 1))[:, 0] for X in place])
            right += (self.frame(units, aloft)[0] @ force) @ speed + moment @ self.motion(units, aloft)[1]
        # added mass acts on the rates of the body's own velocity components, which are linear in c''
        body = np.concatenate(self.motion(units)[:2])
        matrix += body.T @ added @ body
        right -= body.T @ added @ np.concatenate(self.motion(moving)[2:])
        return [
            Path(c.value, c.first, a) for c, a in zip(moving, np.linalg.solve(matrix, right), strict=True)
        ]

    def accelerations(self, falling):
        """(v', w', q'', rotor acceleration) of a path."""
        second = [c.second for c in falling]
        return np.r_[self.motion(falling)[2], self.motion(falling)[3], second[7:], second[6]]

    def point(self, falling, place):
        """(velocity, acceleration) of a point of the nacelle, in its axes."""
        found, R = self.on_nacelle(falling, [Path(p) for p in place]), self.frame(falling, True)[0]
        return R.T @ [float(X.first) for X in found], R.T @ [float(X.second) for X in found]

    def base_load(self, falling, forces):
        """Force and moment on the tower's base, in the platform's axes: of forces and masses above it."""
        R, up = self.frame(falling)[0], np.array([0.0, 0.0, 1.0])
        foot = np.array([X.value for X in self.on_platform(falling, [Path(0.0), Path(0.0), Path(self.base)])])
        force, moment = np.zeros(3), np.zeros(3)
        for masses, found in self.bodies(falling)[1:]:
            at = np.array([np.broadcast_to(X.value, masses.shape) for X in found])
            a = np.array([np.broadcast_to(X.second, masses.shape) for X in found])
            weight = -masses * (a + self.gravity * up[:, None])
            force += weight.sum(axis=1)
            moment += np.cross(at.T - foot, weight.T).sum(axis=0)
        for aloft, point, push, turn in forces:
            if aloft:
                at = np.array([float(X.value) for X in self.on_nacelle(falling, [Path(p) for p in point])])
                frame = self.frame(falling, True)[0]
                force += frame @ push
                moment += np.cross(at - foot, frame @ push) + frame @ turn
        return np.r_[R.T @ force, R.T @ moment]

    def carry(self, aloft):
        return self.on_nacelle if aloft else self.on_platform

    def frame(self, c, aloft=False):
        """Rotation (3, 3) of platform or nacelle, and its two derivatives, (3, 3) or (3, 3, k)."""
        carry = self.carry(aloft)
        origin = carry(c, [Path(0.0)] * 3)
        ends = [carry(c, [Path(float(i == k)) for i in range(3)]) for k in range(3)]
        parts = [[e - o for e, o in zip(end, origin, strict=True)] for end in ends]
        size = self.rows(c)
        return (
            np.array([[p.value for p in part] for part in parts]).T,
            np.array([[spread(p.first, size) for p in part] for part in parts]).swapaxes(0, 1),
            np.array([[spread(p.second, size) for p in part] for part in parts]).swapaxes(0, 1),
        )

    def rows(self, c):
        """Shape of the derivatives of a quantity: () or, of units, (k,)."""
        return np.broadcast_shapes(*(np.shape(p.first) for p in c))[:1]

    def motion(self, c, aloft=False):
        """(v, w, v', w'), (3,) or (3, k), of platform or nacelle in its own axes."""
        R, dR, ddR = self.frame(c, aloft)
        size = self.rows(c)
        r1 = np.array([spread(p.first, size) for p in c[:3]])
        r2 = np.array([spread(p.second, size) for p in c[:3]])
        turning = np.einsum("ji,jk...->ik...", R, ddR) + np.einsum("ji...,jk...->ik...", dR, dR)
        rate = R.T @ r2 + np.einsum("ji...,j...->i...", dR, r1)
        return R.T @ r1, vee(np.einsum("ji,jk...->ik...", R, dR)), rate, vee(turning)


def spread(derivative, size):
    """A derivative () or (k, 1) in the shape (k,) of units, or ()."""
    return np.broadcast_to(derivative, size + (1,) * len(size)).reshape(size)


def together(*parts):
    """One (masses, places) of several."""
    return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def columns(places):
    return [Path(places[:, i]) for i in range(3)]


def vee(matrix):
    """The vector of the antisymmetric part of a matrix."""
    m = 0.5 * (matrix - matrix.swapaxes(0, 1))
    return np.array([m[2, 1], m[0, 2], m[1, 0]])
