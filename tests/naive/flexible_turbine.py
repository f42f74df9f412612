"""Slow, obvious twin of a turbine that bends and twists: particles, the second derivatives of their paths.

Every rigid body is a handful of particles of the same mass, centre and inertia (some of negative mass), tower
and blades are rows of them, and rotor and generator turn. A path of the generalised coordinates
c = (r, angles, azimuth of the generator, q of the tower, q of each blade, twist of the shaft) gives each
particle's velocity and acceleration by Taylor arithmetic, and virtual power the equation of motion: no mass
matrix, velocity term or angular velocity is written down anywhere.
"""

from typing import NamedTuple

import numpy as np

SPIN_CENTRE = np.array([2.0, 0.3, 88.0])  # m, of the generator's wheel, which may be anywhere in the nacelle
UP = np.array([0.0, 0.0, 1.0])


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


class Beam(NamedTuple):
    """Particles of a tower or blade along z, with the shapes of n modes there; the last one is its end."""

    z: np.ndarray  # (k,) m
    mass: np.ndarray  # (k,) kg
    U: np.ndarray  # (n, 2, k) deflections along x and y
    slope: np.ndarray  # (n, 2, k) 1/m
    S: np.ndarray  # (n, n, k) 1/m: a particle sinks by q S q / 2
    stiffness: np.ndarray
    damping: np.ndarray

    def bent(self, q):
        """[x, y, z] Paths of the particles for modal coordinates [Path]."""
        x, y, z = Path(0.0 * self.z), Path(0.0 * self.z), Path(self.z)
        for i, one in enumerate(q):
            x, y = x + one * self.U[i, 0], y + one * self.U[i, 1]
            for j, other in enumerate(q):
                z = z - one * other * (0.5 * self.S[i, j])
        return [x, y, z]

    def slopes(self, q, k=-1):
        """Path of the slopes along x and y at a particle."""
        return [sum((one * self.slope[i, a, k] for i, one in enumerate(q)), Path(0.0)) for a in range(2)]

    def between(self, q, z):
        """(place (3,) of the point at z, slopes (2,)) for coordinates q (n,).

        Both neighbours of the point move it as rigid bodies, weighted by the distance.
        """
        k = min(np.searchsorted(self.z, z, side="right") - 1, len(self.z) - 2)
        part = (z - self.z[k]) / (self.z[k + 1] - self.z[k])
        place, slopes = np.array([0.0, 0.0, z]), np.zeros(2)
        for node, weight in ((k, 1.0 - part), (k + 1, part)):
            slope, away = q @ self.slope[:, :, node], z - self.z[node]
            sunk = 0.5 * (q @ self.S[:, :, node] @ q + away * slope @ slope)
            place += weight * np.array([*(q @ self.U[:, :, node] + away * slope), -sunk])
            slopes += weight * slope
        return place, slopes


class Air(NamedTuple):
    """Loads of the air on a blade, pitched axes about the rotor centre, and on its modes."""

    force: np.ndarray  # (3,)
    moment: np.ndarray  # (3,)
    modal: np.ndarray  # (n,)


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


class Turbine:
    """The particles of a platform and a turbine (two descriptions) with what bends or twists of it.

    tower, blade: Beams or None, rigid; shaft: (stiffness, damping) or None. pitches: (3,) rad, are as they
    are: nothing is known here of their rates.
    """

    def __init__(self, platform, turbine, tower=None, blade=None, shaft=None, pitches=(0.0, 0.0, 0.0)):
        ballast, straight, nacelle, rotor = platform.ballast, platform.tower, turbine.nacelle, turbine.rotor
        self.tower, self.blade, self.shaft, self.pitches = tower, blade, shaft, pitches
        self.n, self.m = (0 if beam is None else len(beam.U) for beam in (tower, blade))
        self.size = 7 + self.n + 3 * self.m + (shaft is not None)
        self.gravity, self.base = platform.environment.gravity, straight.base_height
        self.ratio, self.tilt, self.cone = turbine.drivetrain.gear_ratio, rotor.shaft_tilt, rotor.cone
        along = np.array([np.cos(self.tilt), 0.0, -np.sin(self.tilt)])
        self.hub = np.array([-rotor.overhang, 0.0, rotor.hub_height])
        self.root = rotor.hub_radius
        self.rotor_centre = self.hub + rotor.cm_offset * along
        place = np.array([ballast.cm_downwind, ballast.cm_left, -ballast.cm_depth])
        self.floater = particles(ballast.mass, place, ballast.inertia)
        whole = particles(straight.mass, np.array([0.0, 0.0, straight.cm_height]), straight.inertia)
        if tower is not None:  # lumps take the straight tower's mass from its axis and put it where they are
            whole = together(whole, (-tower.mass, np.outer(tower.z, UP)))
        self.straight = whole
        centre = np.array([nacelle.cm_downwind, nacelle.cm_left, nacelle.cm_height])
        self.wheel = self._wheel(turbine.drivetrain.generator_inertia)
        still = (-self.wheel[0], self.wheel[1] + SPIN_CENTRE)
        self.nacelle = together(particles(nacelle.mass, centre, nacelle.inertia), still)
        inertia = [rotor.inertia, rotor.inertia_diameter, rotor.inertia_diameter]
        parts = [particles(rotor.mass, np.array([rotor.cm_offset, 0.0, 0.0]), inertia)]  # in rotor axes
        if blade is not None:  # the rotor less three straight blades
            for b in range(3):
                angle, lean = 2.0 * np.pi * b / 3.0, np.sin(self.cone)
                axis = np.array([-lean, *(np.cos(self.cone) * np.array([-np.sin(angle), np.cos(angle)]))])
                parts.append((-blade.mass, np.outer(blade.z, axis)))
        self.rotor = together(*parts)

    def _wheel(self, inertia):
        """(masses (4,), places (4, 3)) of a rim around the shaft."""
        side = np.array([[0.0, 1.0, 0.0], [np.sin(self.tilt), 0.0, np.cos(self.tilt)]])
        return np.full(4, 0.25 * inertia), np.concatenate([side, -side])

    # ------------------------------------------------------------------ where things are

    def of_tower(self, c):
        return c[7 : 7 + self.n]

    def of_blade(self, c, b):
        return c[7 + self.n + b * self.m : 7 + self.n + (b + 1) * self.m]

    def twist(self, c):
        return c[-1] if self.shaft is not None else Path(0.0)

    def azimuth(self, c):
        """Of the rotor."""
        return c[6] + self.twist(c)

    def on_platform(self, c, point):
        for axis in range(3):
            point = turned(axis, c[3 + axis], point)
        return [p + c[i] for i, p in enumerate(point)]

    def on_nacelle(self, c, point):
        if self.tower is None:
            return self.on_platform(c, point)
        q = self.of_tower(c)
        ahead, side = self.tower.slopes(q)
        top, height = [picked(X, -1) for X in self.tower.bent(q)], self.tower.z[-1]
        point = turned(1, ahead, turned(0, -side, [point[0], point[1], point[2] + Path(-height)]))
        return self.on_platform(c, [p + t for p, t in zip(point, top, strict=True)])

    def on_shaft(self, c, point, centre, angle):
        """A point [along the shaft, to the left, up] that turns about the shaft through a centre."""
        point = turned(1, Path(self.tilt), turned(0, angle, point))
        return self.on_nacelle(c, [p + centre[i] for i, p in enumerate(point)])

    def on_blade(self, b):
        """What carries a point of the pitched axes of a blade."""

        def carry(c, point):
            x, y, z = turned(2, Path(-self.pitches[b]), point)
            x, y, z = turned(1, Path(-self.cone), [x, y, z])
            return self.on_shaft(c, [x, y, z], self.hub, self.azimuth(c) + 2.0 * np.pi * b / 3.0)

        return carry

    def bodies(self, c):
        """{body: (masses, [X, Y, Z] Paths)} of all particles for coordinates [Path]."""
        rim = turned(1, Path(-self.tilt), columns(self.wheel[1]))
        found = {
            "floater": (self.floater[0], self.on_platform(c, columns(self.floater[1]))),
            "straight": (self.straight[0], self.on_platform(c, columns(self.straight[1]))),
            "nacelle": (self.nacelle[0], self.on_nacelle(c, columns(self.nacelle[1]))),
            "wheel": (
                self.wheel[0],
                self.on_shaft(c, rim, SPIN_CENTRE, c[6] * self.ratio),
            ),
            "hub": (self.rotor[0], self.on_shaft(c, columns(self.rotor[1]), self.hub, self.azimuth(c))),
        }
        if self.tower is not None:
            found["tower"] = self.tower.mass, self.on_platform(c, self.tower.bent(self.of_tower(c)))
        if self.blade is not None:
            found |= {f"blade {b}": self.along_blade(c, b, self.blade) for b in range(3)}
        return found

    def along_blade(self, c, b, beam):
        """(masses, [X, Y, Z] Paths) of a Beam that is a blade or its outer part."""
        return beam.mass, self.on_blade(b)(c, beam.bent(self.of_blade(c, b)))

    # ------------------------------------------------------------------ energy

    def parts_that_bend(self, c):
        """[(modal coordinates, Beam)]."""
        found = [] if self.tower is None else [(self.of_tower(c), self.tower)]
        return found if self.blade is None else found + [(self.of_blade(c, b), self.blade) for b in range(3)]

    def potential(self, c):
        """Path of the potential energy: weight and structure."""
        total = Path(0.0)
        for masses, (_, _, Z) in self.bodies(c).values():
            parts = (np.asarray(part) * masses for part in (Z.value, Z.first, Z.second))
            total = total + Path(*(np.sum(part, axis=-1, keepdims=True) for part in parts)) * self.gravity
        for q, beam in self.parts_that_bend(c):
            for i, one in enumerate(q):
                for j, other in enumerate(q):
                    total = total + one * other * (0.5 * beam.stiffness[i, j])
        if self.shaft is not None:
            total = total + self.twist(c) * self.twist(c) * (0.5 * self.shaft[0])
        return total

    def kinetic(self, c):
        return 0.5 * sum(np.sum(m * (x.first**2)) for m, place in self.bodies(c).values() for x in place)

    # ------------------------------------------------------------------ motion

    def path(self, x, blocks):
        """Coordinates [Path] of a plant's state, no second derivatives; blocks: {name: first index}."""

        def entries(part, count):
            return [x[blocks[f"{part}_{kind}"] :][:count] for kind in ("deflection", "velocity")]

        place, rate = [x[:7]], [np.zeros(7)]
        for part, count in (("tower", self.n), ("blade", 3 * self.m)):
            if count:
                q, v = entries(part, count)
                place.append(q)
                rate.append(v)
        twist, untwisting = 0.0, 0.0
        if self.shaft is not None:
            twist, untwisting = x[blocks["shaft_twist"]], x[blocks["shaft_twist_rate"]]
            place.append([twist])
            rate.append([untwisting])
        place, rate = np.concatenate(place), np.concatenate(rate)
        place[6] -= twist
        units = self.units(place)
        rate[:3] = self.frame(units, self.on_platform)[0] @ x[7:10]
        rate[3:6] = np.linalg.solve(self.motion(units, self.on_platform)[1][:, 3:6], x[10:13])
        rate[6] = x[13] - untwisting
        return [Path(p, r) for p, r in zip(place, rate, strict=True)]

    def units(self, place):
        """One path for each coordinate, along which it alone moves: a row of first derivatives each."""
        return [Path(p, unit[:, None]) for p, unit in zip(place, np.eye(len(place)), strict=True)]

    def fall(self, moving, torque, forces=(), added=None, air=(), held=()):
        """moving (a path) with the second derivatives that follow from its loads.

        torque: of the generator, on its own shaft; added: (6, 6) added mass, or None; air: Air of each blade.
        forces: [(what carries it, point, force, moment, (3,) each)] in the axes of what they act on.
        held: what keeps its velocities: "platform", "rotor" (at the generator).
        """
        units = self.units([c.value for c in moving])
        matrix = np.zeros((self.size, self.size))
        right = -spread(self.potential(units).first, (self.size,))
        for (masses, alone), (_, found) in zip(
            self.bodies(units).values(), self.bodies(moving).values(), strict=True
        ):
            jacobian = np.array([np.broadcast_to(X.first, (self.size, len(masses))) for X in alone])
            bias = np.array([np.broadcast_to(X.second, masses.shape) for X in found])
            right -= np.einsum("p,ip,ikp->k", masses, bias, jacobian)
            matrix += np.einsum("p,ijp,ikp->jk", masses, jacobian, jacobian)
        for (q, beam), (unit, _) in zip(
            self.parts_that_bend(moving), self.parts_that_bend(units), strict=True
        ):
            rows = [np.flatnonzero(u.first)[0] for u in unit]
            right[rows] -= beam.damping @ [one.first for one in q]
        right[6] -= self.ratio * torque
        if self.shaft is not None:
            right[-1] -= self.shaft[1] * moving[-1].first
        for b, load in enumerate(air):
            forces = [*forces, (self.on_blade(b), np.zeros(3), load.force, load.moment)]
            right[7 + self.n + b * self.m :][: self.m] += load.modal
        for carry, point, force, moment in forces:
            place = carry(units, [Path(p) for p in point])
            speed = np.array([spread(X.first, (self.size,)) for X in place])
            R, turning = self.frame(units, carry)[0], self.motion(units, carry)[1]
            right += (R @ force) @ speed + moment @ turning
        body = np.concatenate(self.motion(units, self.on_platform)[:2])
        if added is not None:  # acts on the rates of the body's own velocity components, linear in c''
            matrix += body.T @ added @ body
            right -= body.T @ added @ np.concatenate(self.motion(moving, self.on_platform)[2:])
        second, free = np.zeros(self.size), np.ones(self.size, dtype=bool)
        if "platform" in held:
            bias = np.concatenate(self.motion(moving, self.on_platform)[2:])
            second[:6] = np.linalg.solve(body[:, :6], -bias)
            free[:6] = False
        if "rotor" in held:
            free[6] = False
        right -= matrix @ second
        scale = 1.0 / np.sqrt(np.diag(matrix)[free])
        second[free] = scale * np.linalg.solve(
            matrix[np.ix_(free, free)] * np.outer(scale, scale), scale * right[free]
        )
        return [Path(c.value, c.first, a) for c, a in zip(moving, second, strict=True)]

    def accelerations(self, falling):
        """{what: its accelerations} of a path."""
        second = np.array([float(c.second) for c in falling])
        motion, end = self.motion(falling, self.on_platform), 7 + self.n
        twist = second[end + 3 * self.m :]
        return {
            "platform": motion[2],
            "turning": motion[3],
            "rotor": second[6:7] + twist.sum(),
            "tower": second[7:end],
            "blades": second[end : end + 3 * self.m],
            "twist": twist,
        }

    def point(self, falling, carry, place):
        """(position, velocity, acceleration) in inertial axes of a point of what carries it."""
        found = carry(falling, [Path(p) for p in place])
        return tuple(
            np.array([float(np.squeeze(part)) for part in parts])
            for parts in zip(*((X.value, X.first, X.second) for X in found), strict=True)
        )

    # ------------------------------------------------------------------ loads

    def load(self, bodies, about):
        """Force and moment (6,) about an inertial point by weight and inertia of [(masses, Paths)]."""
        force, moment = np.zeros(3), np.zeros(3)
        for masses, found in bodies:
            at = np.array([np.broadcast_to(X.value, masses.shape) for X in found])
            a = np.array([np.broadcast_to(X.second, masses.shape) for X in found])
            weight = -masses * (a + self.gravity * UP[:, None])
            force += weight.sum(axis=1)
            moment += np.cross(at.T - about, weight.T).sum(axis=0)
        return np.r_[force, moment]

    def carried(self, falling, carry, point, force, moment, about):
        """The same of a force and moment at a point, all in the axes of what carries it."""
        at, R = self.point(falling, carry, point)[0], self.frame(falling, carry)[0]
        return np.r_[R @ force, np.cross(at - about, R @ force) + R @ moment]

    def section_load(self, falling, carry, place, names, forces=(), beams=()):
        """Load (6,) of bodies and forces on what is inside of a place, in the axes of what carries it.

        names: of bodies; beams: [(number of a blade, Beam)] of outer parts.
        """
        about, bodies = self.point(falling, carry, place)[0], self.bodies(falling)
        taken = [bodies[name] for name in names if name in bodies]
        total = self.load(taken + [self.along_blade(falling, b, beam) for b, beam in beams], about)
        total = total + sum(self.carried(falling, *force, about) for force in forces)
        R = self.frame(falling, carry)[0]
        return np.r_[R.T @ total[:3], R.T @ total[3:]]

    def frame(self, c, carry):
        """Rotation (3, 3) of what carries points, and its two derivatives, (3, 3) or (3, 3, k)."""
        origin = carry(c, [Path(0.0)] * 3)
        ends = [carry(c, [Path(float(i == k)) for i in range(3)]) for k in range(3)]
        parts = [[e - o for e, o in zip(end, origin, strict=True)] for end in ends]
        size = self.rows(c)
        return (
            np.array([[spread(p.value, ()) for p in part] for part in parts]).T,
            np.array([[spread(p.first, size) for p in part] for part in parts]).swapaxes(0, 1),
            np.array([[spread(p.second, size) for p in part] for part in parts]).swapaxes(0, 1),
        )

    def rows(self, c):
        """Shape of the derivatives of a quantity: () or, of units, (k,)."""
        return np.broadcast_shapes(*(np.shape(p.first) for p in c))[:1]

    def motion(self, c, carry):
        """(v, w, v', w'), (3,) or (3, k): v of the platform's origin, w of what carries, in its axes."""
        R, dR, ddR = self.frame(c, carry)
        size = self.rows(c)
        r1 = np.array([spread(p.first, size) for p in c[:3]])
        r2 = np.array([spread(p.second, size) for p in c[:3]])
        turning = np.einsum("ji,jk...->ik...", R, ddR) + np.einsum("ji...,jk...->ik...", dR, dR)
        rate = R.T @ r2 + np.einsum("ji...,j...->i...", dR, r1)
        return R.T @ r1, vee(np.einsum("ji,jk...->ik...", R, dR)), rate, vee(turning)


def picked(path, k):
    """Path of particle k of a Path."""
    parts = path.value, path.first, path.second
    return Path(*(np.asarray(p)[..., [k]] if np.ndim(p) else p for p in parts))


def value_of(path, k):
    return float(np.broadcast_to(path.value, np.shape(path.value) or (1,))[k])


def spread(derivative, size):
    """A derivative () or (k, 1) in the shape (k,) of units, or ()."""
    return np.broadcast_to(derivative, size + (1,) * (np.ndim(derivative) > len(size))).reshape(size)


def together(*parts):
    """One (masses, places) of several."""
    return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def columns(places):
    return [Path(places[:, i]) for i in range(3)]


def vee(matrix):
    """The vector of the antisymmetric part of a matrix."""
    m = 0.5 * (matrix - matrix.swapaxes(0, 1))
    return np.array([m[2, 1], m[0, 2], m[1, 0]])
