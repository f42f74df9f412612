"""Slow, obvious twin of plant/hydro/morison.py: the strip integrals of theory.md 5.4, point by point.

sea: components as in naive/waves.py, or None. current: function of inertial height to (u, v), or None.
"""

from dataclasses import dataclass

import numpy as np
from naive import waves


@dataclass
class Spar:
    """Hull, coefficients, site and switches."""

    z: np.ndarray  # keel first
    diameter: np.ndarray
    added_mass: float  # C_A
    drag: float  # C_D
    axial_drag: float  # C_Dz
    heave_added_mass: float  # A33
    density: float
    gravity: float
    depth: float
    position: str = "instantaneous"
    surface: str = "instantaneous"
    stretching: str = "wheeler"
    axis: str = "displaced"  # strips across and along the hull's axis, or the vertical (undisplaced)


def spar_of(platform, *switches, **named):
    """Spar of a descriptions.platform.Platform with the switches from position on."""
    hydro, site = platform.hydro, platform.environment
    return Spar(
        np.array(platform.hull.z), np.array(platform.hull.diameter),
        hydro.added_mass_coefficient, hydro.drag_coefficient, hydro.axial_drag_coefficient,
        hydro.heave_added_mass, site.water_density, site.gravity, site.water_depth, *switches, **named,
    )  # fmt: skip


def nodes(spar, surface, points=60):
    """(z, weight, diameter, dA/dz), each (n,), of Gauss points in every section up to the surface."""
    x, w = np.polynomial.legendre.leggauss(points)
    out = []
    for i in range(len(spar.z) - 1):
        low, high = spar.z[i], spar.z[i + 1]
        # every section ends at the surface: a deep trough reaches below the upper cylinder
        top = surface if i == len(spar.z) - 2 else min(high, surface)
        if top <= low:
            continue
        z = low + (top - low) * (x + 1.0) / 2.0
        d = spar.diameter[i] + (spar.diameter[i + 1] - spar.diameter[i]) * (z - low) / (high - low)
        slope = np.pi / 2.0 * d * (spar.diameter[i + 1] - spar.diameter[i]) / (high - low)
        out.append(np.array([z, w * (top - low) / 2.0, d, slope]))
    return np.concatenate(out, axis=1)


def surface_on_axis(t, r, R, sea, spar):
    """(body z where the axis meets the surface, elevation there), by plain iteration."""
    if spar.position == "fixed":
        eta = waves.elevation(t, 0.0, 0.0, sea, spar.depth, spar.gravity) if sea else 0.0
        return (eta if spar.surface == "instantaneous" else 0.0), eta
    z, eta = -r[2] / R[2, 2], 0.0
    for _ in range(60 if sea else 0):
        at = r + R[:, 2] * z
        eta = waves.elevation(t, at[0], at[1], sea, spar.depth, spar.gravity)
        if spar.surface == "swl":
            break
        z = (eta - r[2]) / R[2, 2]
    return z, eta


def water(t, point, eta, sea, spar):
    """(velocity, acceleration, pressure) of the water at an inertial point."""
    height = point[2]
    if spar.stretching == "wheeler":
        height = spar.depth * (height - eta) / (spar.depth + eta)
    velocity, acceleration, pressure = np.zeros(3), np.zeros(3), 0.0
    if sea:
        velocity, acceleration, pressure = waves.kinematics(
            t, point[0], point[1], height, sea, spar.depth, spar.density, spar.gravity
        )
    return velocity, acceleration, pressure


def load(t, r, R, v, w, sea, spar, current=None, at=None):
    """(F, M, (S_0, S_1, S_2)): body-axes load without the added-mass part, and that part's integrals.

    at: nodes to use, default many Gauss points.
    """
    top, eta = surface_on_axis(t, r, R, sea, spar)
    z_all = nodes(spar, top) if at is None else at
    axis = np.array([0.0, 0.0, 1.0])
    F, M, S = np.zeros(3), np.zeros(3), np.zeros(3)
    n = R.T @ axis if spar.axis == "undisplaced" else axis
    across = np.eye(3) - np.outer(n, n)

    def at_section(z):
        where = np.array([0.0, 0.0, z]) if spar.position == "fixed" else r + R @ (z * axis)
        velocity, acceleration, pressure = water(t, where, eta, sea, spar)
        if current is not None:
            velocity = velocity + np.r_[current((r + R @ (z * axis))[2]), 0.0]
        own = v + np.cross(w, z * axis)
        return R.T @ velocity, R.T @ acceleration, pressure, own, np.cross(w, own)

    for z, weight, d, slope in z_all.T:
        u, a, p, own, convective = at_section(z)
        area = np.pi * d**2 / 4.0
        relative = across @ (u - own)
        f = spar.density * area * (1.0 + spar.added_mass) * across @ a
        f -= spar.density * area * spar.added_mass * across @ convective
        f += 0.5 * spar.density * spar.drag * d * np.linalg.norm(relative) * relative
        f += p * slope * n
        F += weight * f
        M += weight * np.cross(z * axis, f)
        S += weight * spar.density * area * spar.added_mass * z ** np.arange(3)
    keel = spar.z[0]
    u, a, p, own, convective = at_section(keel)
    area = np.pi * spar.diameter[0] ** 2 / 4.0
    relative = n @ (u - own)
    f = p * area + spar.heave_added_mass * n @ (a - convective)
    f += 0.5 * spar.density * spar.axial_drag * area * abs(relative) * relative
    return F + f * n, M + f * np.cross(keel * axis, n), S
