"""Slow and obvious strip loads: every component at every node, each section cut at the surface."""

import numpy as np


def kinematics(t, x, y, z, waves):
    """(u, v, w, u', v', w', p) at points (n,), plain sum; z is used as given."""
    k, om = waves.wave_number, waves.omega
    ramp = min(t / waves.ramp, 1.0) if waves.ramp > 0.0 else 1.0
    along = np.outer(x, waves.cos_heading) + np.outer(y, waves.sin_heading)
    phase = k * along - om * t + waves.phase
    down, up = np.exp(np.outer(z, k)), np.exp(-np.outer(z + 2.0 * waves.depth, k))
    even, odd = ramp * waves.velocity * (down + up), ramp * waves.velocity * (down - up)
    c, s = np.cos(phase), np.sin(phase)
    return (
        (even * c) @ waves.cos_heading,
        (even * c) @ waves.sin_heading,
        np.sum(odd * s, axis=1),
        (om * even * s) @ waves.cos_heading,
        (om * even * s) @ waves.sin_heading,
        -np.sum(om * odd * c, axis=1),
        np.sum(waves.density * om / k * even * c, axis=1),
    )


def elevation(t, x, y, waves):
    """Surface elevation at a point."""
    ramp = min(t / waves.ramp, 1.0) if waves.ramp > 0.0 else 1.0
    along = x * waves.cos_heading + y * waves.sin_heading
    phase = waves.wave_number * along - waves.omega * t + waves.phase
    return ramp * np.sum(waves.amplitude * np.cos(phase))


def strip_load(t, position, rotation, velocity, spin, hull, strips, waves, current=None, points=12):
    """(wrench (6,), S0, S1, S2) of theory.md 5.4; points: Gauss nodes of each 6 m of a section.

    position (3,), rotation (3, 3) body to inertial, velocity and spin (3,) in body axes;
    current: callable Z -> (u, v) or None.
    """
    rho, ca, cd = strips.density, strips.added_mass_coefficient, strips.drag_coefficient
    moved = strips.instantaneous_position
    origin, axis = (position, rotation[:, 2]) if moved else (np.zeros(3), np.array([0.0, 0.0, 1.0]))
    surface, eta = -origin[2] / axis[2], 0.0
    if waves is not None:
        for _ in range(60):
            at = origin + axis * surface
            eta = elevation(t, at[0], at[1], waves)
            if not strips.instantaneous_surface:
                break
            surface = (eta - origin[2]) / axis[2]
    if not moved:
        eta = elevation(t, 0.0, 0.0, waves) if waves is not None else 0.0
    surface = min(max(surface, hull.z[0]), hull.z[-1])

    def field(z):
        at = origin + np.outer(z, axis)
        height = at[:, 2]
        if strips.wheeler:
            height = strips.depth * (height - eta) / (strips.depth + eta)
        if waves is None:
            return np.zeros((7, z.size))
        return kinematics(t, at[:, 0], at[:, 1], height, waves)

    def flow(z):
        u, v, w, du, dv, dw, p = field(z)
        if current is not None:
            cu, cv = np.transpose([current(h) for h in position[2] + rotation[2, 2] * z])
            u, v = u + cu, v + cv
        return np.array([u, v, w]).T @ rotation, np.array([du, dv, dw]).T @ rotation, p

    force, moment, mass = np.zeros(3), np.zeros(3), np.zeros(3)
    x, weights = np.polynomial.legendre.leggauss(points)
    last = len(hull.z) - 2
    for i in range(last + 1):
        bottom, top = hull.z[i], min(hull.z[i + 1], surface)
        if top <= bottom:
            continue
        slope = 0.0 if i == last else (hull.diameter[i + 1] - hull.diameter[i]) / (hull.z[i + 1] - bottom)
        edges = np.linspace(bottom, top, 1 + int(np.ceil((top - bottom) / 6.0)))
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            z = 0.5 * (low + high) + 0.5 * (high - low) * x
            dz = 0.5 * (high - low) * weights
            d = (hull.diameter[i + 1] if i == last else hull.diameter[i]) + slope * (z - bottom)
            area = 0.25 * np.pi * d**2
            arm = np.zeros((z.size, 3))
            arm[:, 2] = z
            section = velocity + np.cross(spin, arm)
            water, acceleration, pressure = flow(z)
            relative = water - section
            relative[:, 2] = 0.0
            f = (rho * area * (1.0 + ca))[:, None] * acceleration
            f -= (rho * area * ca)[:, None] * np.cross(spin, section)
            f += (0.5 * rho * cd * d * np.linalg.norm(relative, axis=1))[:, None] * relative
            f[:, 2] = pressure * 0.5 * np.pi * d * slope
            force += dz @ f
            f[:, 2] = 0.0
            moment += dz @ np.cross(arm, f)
            mass += [dz @ (rho * ca * area * z**power) for power in range(3)]
    keel = np.array([hull.z[0]])
    water, acceleration, pressure = flow(keel)
    section = velocity + np.cross(spin, [0.0, 0.0, keel[0]])
    area = 0.25 * np.pi * hull.diameter[0] ** 2
    along = water[0, 2] - velocity[2]
    force[2] += pressure[0] * area
    force[2] += strips.heave_added_mass * (acceleration[0, 2] - np.cross(spin, section)[2])
    force[2] += 0.5 * rho * strips.axial_drag_coefficient * area * abs(along) * along
    return np.concatenate([force, moment]), mass
