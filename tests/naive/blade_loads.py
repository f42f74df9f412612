"""Moments at blade roots, hub and tower top by lumps, whose accelerations are differences of their places."""

import numpy as np
from naive.curved_rotor import about_y
from naive.rigid_body import rotation

STEP = 2e-3  # s


class Motion:
    """Motion of nacelle frame and rotor as smooth functions of time."""

    def __init__(self, seed, rotor_speed):
        rng = np.random.default_rng(seed)
        self.size = np.array([4.0, 4.0, 4.0, 0.2, 0.2, 0.2, 0.3]) * rng.uniform(0.5, 1.0, 7)
        self.frequency, self.phase = rng.uniform(0.3, 0.8, 7), rng.uniform(0.0, 6.0, 7)
        self.rotor_speed = rotor_speed

    def at(self, t):
        """(7,): place, Euler angles, azimuth."""
        values = self.size * np.sin(self.frequency * t + self.phase)
        values[6] += self.rotor_speed * t
        return values

    def velocity(self, t):
        """(7,): velocity and angular velocity in the frame's own axes, rotor speed."""
        rate = derivative(self.at, t)
        frame = rotation(*self.at(t)[3:6])
        turning = frame.T @ derivative(lambda s: rotation(*self.at(s)[3:6]), t)
        return np.array([*(frame.T @ rate[:3]), turning[2, 1], turning[0, 2], turning[1, 0], rate[6]])

    def rates(self, t):
        """(7,): derivatives of the velocities."""
        return derivative(self.velocity, t)

    def frame(self, t):
        """(place (3,), axes (3, 3)) of the nacelle frame."""
        return self.at(t)[:3], rotation(*self.at(t)[3:6])

    def blade_axes(self, t, blade, rotor):
        """(rotor centre, unit vectors x, r, t of a blade) in O."""
        place, axes = self.frame(t)
        shaft = axes @ about_y(rotor.shaft_tilt)
        turned = shaft @ rotation(self.at(t)[6] + 2.0 * np.pi * blade / 3.0, 0.0, 0.0)
        centre = place + axes @ [-rotor.overhang, 0.0, rotor.hub_height]
        return centre, turned[:, 0], turned[:, 2], -turned[:, 1]

    def lump(self, t, blade, distance, rotor):
        """Place in O of a point of a blade's pitch axis."""
        centre, x, r, _ = self.blade_axes(t, blade, rotor)
        return centre + distance * (np.cos(rotor.cone) * r - np.sin(rotor.cone) * x)


def derivative(function, t):
    """Of a smooth function, to the fourth order of STEP."""
    near = function(t + STEP) - function(t - STEP)
    far = function(t + 2.0 * STEP) - function(t - 2.0 * STEP)
    return (8.0 * near - far) / (12.0 * STEP)


def pull(place, mass, t, gravity):
    """Weight less mass times acceleration of a lump whose place is a function of time, in O."""
    before, here, after = place(t - STEP), place(t), place(t + STEP)
    far = place(t - 2.0 * STEP) + place(t + 2.0 * STEP)
    acceleration = (16.0 * (before + after) - far - 30.0 * here) / (12.0 * STEP**2)
    return mass * (np.array([0.0, 0.0, -gravity]) - acceleration)


def _blade_sum(motion, t, blade, about, rotor, lumps, gravity):
    """(3,) moment in O about a point of a blade; lumps: (distance from the rotor centre, mass)."""
    total = np.zeros(3)
    for distance, mass in lumps:

        def place(s, distance=distance):
            return motion.lump(s, blade, distance, rotor)

        total += np.cross(place(t) - about, pull(place, mass, t, gravity))
    return total


def root_moments(motion, t, blade, load, rotor, lumps, gravity):
    """(in plane, out of plane); load: (6,) of the air about the rotor centre in the blade's directions."""
    centre, x, r, turning = motion.blade_axes(t, blade, rotor)
    root = motion.lump(t, blade, rotor.hub_radius, rotor)
    axes = np.column_stack([x, r, turning])
    air = axes @ load[3:] + np.cross(centre - root, axes @ load[:3])
    total = air + _blade_sum(motion, t, blade, root, rotor, lumps, gravity)
    normal = np.cos(rotor.cone) * x + np.sin(rotor.cone) * r
    return total @ normal, -total @ turning


def rotor_moment(motion, t, about, loads, rotor, lumps, hub, gravity):
    """(3,) moment in O of three blades and a hub; hub: (distance downwind along the shaft, mass)."""
    total = np.zeros(3)
    for blade, load in enumerate(loads):
        centre, x, r, turning = motion.blade_axes(t, blade, rotor)
        axes = np.column_stack([x, r, turning])
        total += axes @ load[3:] + np.cross(centre - about, axes @ load[:3])
        total += _blade_sum(motion, t, blade, about, rotor, lumps, gravity)

    def place(s):
        centre, x, *_ = motion.blade_axes(s, 0, rotor)
        return centre + hub[0] * x

    return total + np.cross(place(t) - about, pull(place, hub[1], t, gravity))


def nacelle_moment(motion, t, about, lumps, gravity):
    """(3,) moment in O of lumps of the nacelle: (place (3,) in its frame, mass)."""
    total = np.zeros(3)
    for at, mass in lumps:

        def place(s, at=at):
            origin, axes = motion.frame(s)
            return origin + axes @ at

        total += np.cross(place(t) - about, pull(place, mass, t, gravity))
    return total
