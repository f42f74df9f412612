"""Wind with the influence of a straight tower: potential flow and shadow of AeroDyn, with numpy vectors."""

import numpy as np


def around_cylinder(x, y, drag, intensity, potential, shadow):
    """(downwind, left) disturbance over the wind, x and y in tower radii from the axis."""
    u = v = 0.0
    if potential:
        z = complex(x + (0.1 if potential == "bak" else 0.0), y)
        w = -1.0 / z**2  # complex velocity u - iv of a dipole
        if potential == "bak":
            w += drag / (2.0 * np.pi * z)
        u, v = w.real, -w.imag
    deficit = 0.0
    if shadow == "powles" and x > 0.0:
        width = np.hypot(x, y) ** 0.5
        deficit = drag / width * np.cos(np.pi * y / (2.0 * width)) ** 2 if abs(y) < width else 0.0
    if shadow == "eames" and x > 0.0:
        spread = intensity * x
        deficit = drag / (spread * np.sqrt(2.0 * np.pi)) * np.exp(-0.5 * (y / spread) ** 2)
    return u - min(deficit, 0.5), v


def with_tower(wind, sections, potential, shadow, origin, R, velocity, rate):
    """Wind (3,) at an inertial point, by a platform at origin with rotation R; velocity, rate in body axes.

    wind: the undisturbed one, of a point. sections: height, diameter, drag, intensity, (k,) each.
    """
    height, *values = map(np.asarray, sections)
    axis = R[:, 2]

    def disturbed(point):
        along = (point - origin) @ axis
        foot = np.clip(along, height[0], height[-1])
        diameter, drag, intensity = (np.interp(foot, height, value) for value in values)
        at = origin + foot * axis
        arm = point - at
        distance = np.linalg.norm(arm) - 0.5 * diameter
        beyond = (along - foot) / (0.5 * diameter)
        if abs(beyond) >= 1.0 or not 0.01 * diameter < distance <= 20.0 * diameter:
            return wind(point)
        seen = wind(at) - R @ (velocity + np.cross(rate, [0.0, 0.0, foot]))
        seen = seen - (seen @ axis) * axis
        speed = np.linalg.norm(seen)
        ex = seen / speed
        ey = np.cross(axis, ex)
        scale = 0.5 * diameter * np.cos(0.5 * np.pi * beyond)
        u, v = around_cylinder(arm @ ex / scale, arm @ ey / scale, drag, intensity, potential, shadow)
        return wind(point) + speed * (u * ex + v * ey)

    return disturbed
