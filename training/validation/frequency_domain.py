"""Computes natural periods and responses of a floating body in the frequency domain, with numpy and scipy.

Independent of the simulator: coefficients are read from the array file of the package, masses are those of
the public decks, line tensions those of the catenary below. Equations are linear about the equilibrium,
without drag. With X the excitation per metre and q = surge, sway, heave, roll, pitch, yaw:

    [-w^2 (M + A(w)) + i w (B(w) + D) + C + K] q = X(w).

C is the stiffness of hydrostatics and weight, K that of the lines, D optional damping.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import root

from fowt_env.errors import InputError

GRAVITY, DENSITY = 9.80665, 1025.0
NAMES = ("surge", "sway", "heave", "roll", "pitch", "yaw")


def read_arrays(path):
    """Return {name: array} of a coefficients file of the package. Raises: InputError if unreadable."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except OSError as error:
        raise InputError(f"coefficients file {str(path)!r} cannot be read: {error}") from None


def point_mass(mass, place, inertia=(0.0, 0.0, 0.0)):
    """Return the 6x6 mass matrix about the origin of a body with inertia about its centre."""
    x, y, z = place
    cross = mass * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = mass * np.eye(3)
    matrix[:3, 3:] = -cross
    matrix[3:, :3] = cross
    matrix[3:, 3:] = np.diag(inertia) - cross @ cross / mass
    return matrix


def tower_mass(stations, densities, base, top, slices=400):
    """Return the 6x6 mass matrix of a tower along z; densities (kg/m) at stations (fractions of height)."""
    fraction, height = (np.arange(slices) + 0.5) / slices, top - base
    masses = np.interp(fraction, stations, densities) * height / slices
    return sum(point_mass(m, (0.0, 0.0, base + f * height)) for f, m in zip(fraction, masses, strict=True))


def weight_stiffness(mass):
    """Return the 6x6 gravity stiffness of a mass matrix about the displaced origin, fixed axes."""
    x, y, z = mass[1, 5], -mass[0, 5], mass[0, 4]  # moments of mass
    stiffness = np.zeros((6, 6))
    stiffness[3, 3] = stiffness[4, 4] = -GRAVITY * z
    stiffness[3, 5], stiffness[4, 5] = GRAVITY * x, GRAVITY * y
    return stiffness


def weight(mass):
    """Return (6,) force and moment of the weight about the undisplaced origin."""
    return GRAVITY * np.array([0.0, 0.0, -mass[0, 0], mass[0, 5], mass[1, 5], 0.0])


@dataclass(frozen=True)
class CatenaryLine:
    """Holds the data of an elastic line above a flat seabed at the depth of its anchor."""

    anchor: tuple
    fairlead: tuple  # body axes, undisplaced
    length: float  # m, unstretched
    weight: float  # N/m, in water
    stiffness: float  # EA, N
    friction: float = 1.0  # of the seabed


def catenary(span, rise, line):
    """Return the (horizontal, vertical) tension (N) at the fairlead of a line with a span and rise (m).

    Closed form of Jonkman (2007), with or without seabed contact, solved for the logarithms.
    """
    w, length, ea, cb = line.weight, line.length, line.stiffness, line.friction

    def misses(tensions):
        h, v = np.exp(tensions)
        free = v >= w * length  # hangs freely
        lift = max(v - w * length, 0.0) / h
        rest = 0.0 if free else length - v / w
        x = rest + h / w * (np.arcsinh(v / h) - np.arcsinh(lift)) + h * length / ea
        z = h / w * (np.hypot(1.0, v / h) - np.hypot(1.0, lift))
        z += (v * length - 0.5 * w * length**2) / ea if free else 0.5 * v * v / (ea * w)
        if cb > 0.0 and not free:
            slack = rest - h / (cb * w)
            x += 0.5 * cb * w / ea * (-(rest**2) + slack * max(slack, 0.0))
        return x - span, z - rise

    taut = 3.0 * ((length**2 - rise**2) / span**2 - 1.0) if span > 0.0 else 1e6
    guess = np.sqrt(taut) if length > np.hypot(span, rise) else 0.2
    h = max(0.5 * w * span / guess, 1e-3 * w * length)
    v = 0.5 * w * (rise / np.tanh(guess) + length)
    solution = root(misses, np.log([h, v]), tol=1e-13)
    if not np.abs(solution.fun).max() < 1e-8 * length:
        raise InputError(f"catenary: no solution at span {span:g} m and rise {rise:g} m")
    return np.exp(solution.x)


def rotation(roll, pitch, yaw):
    """Return the rotation matrix of small angles to second order, as central differences need."""
    a = np.array([[0.0, -yaw, pitch], [yaw, 0.0, -roll], [-pitch, roll, 0.0]])
    return np.eye(3) + a + 0.5 * a @ a


def line_forces(lines, q):
    """Return force and moment (6,) of the lines about the displaced origin, in fixed axes."""
    total = np.zeros(6)
    turn = rotation(*q[3:])
    for line in lines:
        arm = turn @ np.array(line.fairlead)
        gap = np.array(line.anchor) - (q[:3] + arm)
        span = np.hypot(gap[0], gap[1])
        h, v = catenary(span, -gap[2], line)
        force = np.array([h * gap[0] / span, h * gap[1] / span, -v])
        total[:3] += force
        total[3:] += np.cross(arm, force)
    return total


def line_stiffness(lines, q):
    """Return (6, 6) stiffness of the lines at q, by central differences."""
    steps = np.diag((0.05, 0.05, 0.05, 1e-3, 1e-3, 1e-3))
    pairs = ((line_forces(lines, q + step), line_forces(lines, q - step)) for step in steps)
    return np.array([(behind - ahead) for ahead, behind in pairs]).T / (2.0 * np.diag(steps))


def interpolated(omega, grid, values, low=None, high=None):
    """Interpolate values linearly at omega (rad/s); low, high: values at zero and infinite frequency."""
    if omega < grid[0]:
        first = values[0] if low is None else low
        return first + (values[0] - first) * omega / grid[0]
    if omega > grid[-1] and high is not None:
        return high + (values[-1] - high) * grid[-1] / omega
    at = min(max(int(np.searchsorted(grid, omega)) - 1, 0), len(grid) - 2)
    fraction = (omega - grid[at]) / (grid[at + 1] - grid[at])
    return values[at] * (1.0 - fraction) + values[at + 1] * fraction


@dataclass(frozen=True)
class FloatingBody:
    """Holds a floating body: coefficients, mass, lines and displaced volume; computes its linear motion."""

    coefficients: dict  # of read_arrays
    mass: np.ndarray  # (6, 6)
    lines: tuple
    volume: float
    added_stiffness: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    added_damping: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))

    @property
    def stiffness(self):
        """Return the (6, 6) stiffness of hydrostatics, weight and added_stiffness."""
        return self.coefficients["stiffness"] + weight_stiffness(self.mass) + self.added_stiffness

    @property
    def rest_stiffness(self):
        """Return the (6, 6) stiffness at equilibrium, with that of the lines."""
        return self.stiffness + line_stiffness(self.lines, self.rest())

    def rest(self):
        """Return the equilibrium position (6,) under lines, weight and buoyancy."""
        lift, stiffness = DENSITY * GRAVITY * self.volume, self.stiffness
        fixed = weight(self.mass) + lift * np.eye(6)[2]
        solution = root(
            lambda q: fixed + line_forces(self.lines, q) - stiffness @ q, np.zeros(6), tol=1e-13,
            jac=lambda q: -stiffness - line_stiffness(self.lines, q),
        )  # fmt: skip
        if not np.abs(solution.fun).max() < 1e-6 * lift:
            raise InputError("frequency domain: no equilibrium position")
        return solution.x

    def added_mass(self, omega):
        """Return the added mass (6, 6) at omega (rad/s)."""
        c = self.coefficients
        limits = c.get("added_mass_zero"), c["added_mass_infinite"]
        return interpolated(omega, c["omega"], c["added_mass"], *limits)

    def damping(self, omega):
        """Return the damping (6, 6) of radiation plus added_damping, at omega (rad/s)."""
        c = self.coefficients
        return interpolated(omega, c["omega"], c["damping"], 0.0, 0.0) + self.added_damping

    def excitation(self, omega, heading=0.0):
        """Return the excitation (6,) per metre at omega (rad/s) and a tabulated heading (rad)."""
        c = self.coefficients
        turns = np.abs((c["heading"] - heading + np.pi) % (2.0 * np.pi) - np.pi)
        column = int(np.argmin(turns))
        if turns[column] > 1e-3:
            raise InputError(f"frequency domain: no excitation at the heading {heading:g} rad")
        return interpolated(omega, c["excitation_omega"], c["excitation"][:, column])

    def responses(self, omega, heading=0.0):
        """Return (n, 6) complex motion per metre of amplitude at omega (n,) rad/s."""
        stiffness, motion = self.rest_stiffness, []
        for w in omega:
            matrix = -w * w * (self.mass + self.added_mass(w)) + 1j * w * self.damping(w) + stiffness
            motion.append(np.linalg.solve(matrix, self.excitation(w, heading)))
        return np.array(motion)

    def retardation(self, time, spacing=0.004):
        """Return (n, 6, 6) K(t) = 2/pi times the integral of B cos(omega t), by the trapezoid rule."""
        grid = np.arange(0.0, self.coefficients["omega"][-1] + spacing, spacing)
        damping = np.array([self.damping(w) - self.added_damping for w in grid]).reshape(len(grid), 36)
        weight = np.full(len(grid), spacing)
        weight[[0, -1]] *= 0.5
        waves = np.cos(np.outer(time, grid)) * weight
        return (2.0 / np.pi * waves @ damping).reshape(-1, 6, 6)

    def free_decay(self, offset, duration, step=0.05, memory=60.0):
        """Return (time (n,), motion (n, 6) from rest) of a free decay from an offset (6,) in still water.

        Cummins' equation by the leapfrog rule: positions at whole steps, velocities at half steps, at which
        the convolution is summed by the midpoint rule.
        """
        inertia = np.linalg.inv(self.mass + self.coefficients["added_mass_infinite"])
        kernel = step * self.retardation((np.arange(round(memory / step)) + 0.5) * step)
        flat = kernel.transpose(1, 0, 2).reshape(6, -1)  # latest velocity first
        past, velocity, stiffness = np.zeros((len(kernel), 6)), np.zeros(6), self.rest_stiffness
        motion = np.zeros((round(duration / step) + 1, 6))
        motion[0] = offset
        for n in range(len(motion) - 1):
            force = -stiffness @ motion[n] - flat @ past.ravel() - self.added_damping @ velocity
            velocity = velocity + (0.5 if n == 0 else 1.0) * step * (inertia @ force)
            past = np.vstack([velocity, past[:-1]])
            motion[n + 1] = motion[n] + step * velocity
        return step * np.arange(len(motion)), motion

    def natural_modes(self):
        """Return {motion: (rad/s, damping ratio)} of six modes, each with coefficients at its frequency."""
        stiffness, modes = self.rest_stiffness, {}
        scale = np.array([1.0] * 3 + [self.volume ** (1.0 / 3.0)] * 3)[:, None]
        for i, name in enumerate(NAMES):
            omega = np.sqrt(stiffness[i, i] / (self.mass + self.added_mass(0.2))[i, i])
            for _ in range(100):
                inverse = np.linalg.inv(self.mass + self.added_mass(omega))
                lower = [-inverse @ stiffness, -inverse @ self.damping(omega)]
                values, vectors = np.linalg.eig(np.block([[np.zeros((6, 6)), np.eye(6)], lower]))
                shapes = np.abs(vectors[:6]) * scale
                participation = shapes[i] / np.linalg.norm(shapes, axis=0)
                value = values[np.argmax(np.where(values.imag > 0.0, participation, -1.0))]
                done, omega = abs(value.imag - omega) < 1e-10, 0.5 * (omega + value.imag)
                if done:
                    break
            modes[name] = (float(value.imag), float(-value.real / abs(value)))
        return modes


# --------------------------------------------------------------------------- values of the public decks

FLOATING_TOWER = (
    4667.0, 4345.28, 4034.76, 3735.44, 3447.32, 3170.40, 2904.69, 2650.18, 2406.88, 2174.77, 1953.87,
)  # fmt: skip
BARGE_TOWER = (
    5590.87, 5232.43, 4885.76, 4550.87, 4227.75, 3916.41, 3616.83, 3329.03, 3053.01, 2788.75, 2536.27,
)  # fmt: skip


def nrel5mw(tower, base):
    """Return the 6x6 mass matrix of the NREL 5 MW (rotor as a disk) on a tower from `base` to 87.6 m."""
    tilt, cone, hub_radius = np.radians(5.0), np.radians(2.5), 1.5
    apex = np.array([-5.0191 * np.cos(tilt), 0.0, 87.6 + 1.96256 + 5.0191 * np.sin(tilt)])
    shaft = np.array([np.cos(tilt), 0.0, -np.sin(tilt)])  # downwind
    blade, first, polar = 17740.0, 363231.0, 11776047.0  # kg, kg m, kg m2 about the blade root
    along = (first + hub_radius * blade) / blade  # from the apex, along the blade
    square = polar + 2.0 * hub_radius * first + hub_radius**2 * blade  # about the apex
    turning = 3.0 * square * np.cos(cone) ** 2
    centre = apex - shaft * along * np.sin(cone)  # cone leans upwind
    generator = np.zeros((6, 6))
    generator[3, 3] = 534.116 * 97.0**2
    parts = (
        (3.0 * blade, centre, (turning, 0.5 * turning, 0.5 * turning)),
        (56780.0, apex, (115926.0, 0.0, 0.0)),  # hub
        (240000.0, (1.9, 0.0, 87.6 + 1.75), (0.0, 0.0, 2607890.0 - 240000.0 * 1.9**2)),  # nacelle
    )
    fractions = np.linspace(0.0, 1.0, len(tower))
    return tower_mass(fractions, tower, base, 87.6) + generator + sum(point_mass(*part) for part in parts)


def oc4_semi(coefficients):
    """Return the FloatingBody of the OC4 DeepCwind semi: steel, and ballast water on the column axes.

    HydroDyn 2, for which the deck was written, lumps the water at member nodes, without inertia across the
    member. Water rotating as a solid would lengthen the periods of pitch and yaw by 0.8 and 1.4 %.
    """
    mass = nrel5mw(FLOATING_TOWER, 10.0)
    mass = mass + point_mass(3.85218e6, (0.0, 0.0, -8.6588), (2.56193e9, 2.56193e9, 4.24265e9))
    for diameter, top, bottom in ((11.88, -6.17, -14.0), (23.88, -14.89, -19.94)):
        height = top - bottom
        water = DENSITY * 0.25 * np.pi * diameter**2 * height
        across = water * height**2 / 12.0
        for x, y in ((14.43376, 25.0), (-28.86751, 0.0), (14.43376, -25.0)):
            mass = mass + point_mass(water, (x, y, 0.5 * (top + bottom)), (across, across, 0.0))
    wet_weight = (113.35 - DENSITY * 0.25 * np.pi * 0.0766**2) * GRAVITY
    lines = []
    for turn in np.radians((60.0, 180.0, 300.0)):
        c, s = np.cos(turn), np.sin(turn)
        ends = (837.6 * c, 837.6 * s, -200.0), (40.868 * c, 40.868 * s, -14.0)
        lines.append(CatenaryLine(*ends, 835.35, wet_weight, 7.536e8))
    return FloatingBody(coefficients, mass, tuple(lines), 13917.0)


def iti_barge(coefficients):
    """Return the FloatingBody of the ITI Energy barge."""
    mass = nrel5mw(BARGE_TOWER, 0.0)
    mass = mass + point_mass(5.452e6, (0.0, 0.0, -0.281768), (7.269e8, 7.269e8, 1.4539e9))
    weight_in_water = (130.403 - DENSITY * 0.25 * np.pi * 0.0809**2) * GRAVITY
    lines, end = [], (20.0, 20.0, -4.0)
    for x, y in ((386.92, 171.985), (171.985, 386.95)):
        for c, s in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)):
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            lines.append(CatenaryLine(turn @ (x, y, -150.0), turn @ end, 473.312, weight_in_water, 5.89e8))
    return FloatingBody(coefficients, mass, tuple(lines), 6000.0)
