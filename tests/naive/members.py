"""Slow, obvious twin of plant/hydro/members.py and member_buoyancy.py (theory.md 5.10), point by point.

members: descriptions.platform.Member records. sea: components as in naive/waves.py, or None. site: a
descriptions.platform.Environment. current: function of inertial height to (u, v), or None.
"""

import numpy as np
from naive import waves
from scipy.optimize import brentq


def cross_matrix(r):
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def load(t, r, R, v, w, members, sea, site, switches, current=None, points=40, axis="displaced"):
    """(force and moment (6,) in body axes without the added mass, added mass (6, 6)).

    switches: (position, surface, stretching). axis: of members as they tilt, or as at rest.
    """
    position, surface, stretching = switches
    rho = site.water_density

    def inertial(p):
        return p if position == "fixed" else r + R @ p

    def eta_at(p):
        return waves.elevation(t, p[0], p[1], sea, site.water_depth, site.gravity) if sea else 0.0

    def water(p):
        at = inertial(p)
        height = at[2]
        if stretching == "wheeler":
            eta = eta_at(at)
            height = site.water_depth * (height - eta) / (site.water_depth + eta)
        velocity, acceleration, pressure = np.zeros(3), np.zeros(3), 0.0
        if sea:
            velocity, acceleration, pressure = waves.kinematics(
                t, at[0], at[1], height, sea, site.water_depth, rho, site.gravity
            )
        if current is not None:
            velocity = velocity + np.r_[current((r + R @ p)[2]), 0.0]
        return R.T @ velocity, R.T @ acceleration, pressure

    total, mass = np.zeros(6), np.zeros((6, 6))

    def put(p, force, added):
        nonlocal total, mass
        J = np.hstack([np.eye(3), -cross_matrix(p)])
        total += J.T @ force
        mass += J.T @ added @ J

    x, weights = np.polynomial.legendre.leggauss(points)
    for member in members:
        start, end = np.array(member.start), np.array(member.end)
        length = np.linalg.norm(end - start)
        along = (end - start) / length
        a = R.T @ along if axis == "undisplaced" else along
        across = np.eye(3) - np.outer(a, a)
        own = 0.0 if member.potential_flow else 1.0

        def above(s, start=start, along=along):
            at = inertial(start + s * along)
            return at[2] - (eta_at(at) if surface == "instantaneous" else 0.0)

        low, high = 0.0, length
        if above(0.0) > 0.0 and above(length) > 0.0:
            continue
        if above(0.0) * above(length) < 0.0:
            cut = brentq(above, 0.0, length, xtol=1e-13)
            low, high = (0.0, cut) if above(0.0) < 0.0 else (cut, length)
        for s, weight in zip(low + 0.5 * (high - low) * (1.0 + x), 0.5 * (high - low) * weights, strict=True):
            share = s / length
            d, cd, ca, cp = (
                (1.0 - share) * pair[0] + share * pair[1]
                for pair in (
                    member.diameter, member.drag_coefficient,
                    member.added_mass_coefficient, member.pressure_coefficient,
                )
            )  # fmt: skip
            p = start + s * along
            area, growth = (
                0.25 * np.pi * d**2,
                0.5 * np.pi * d * (member.diameter[1] - member.diameter[0]) / length,
            )
            u, du, pressure = water(p)
            section = v + np.cross(w, p)
            q = across @ (u - section)
            f = 0.5 * rho * cd * d * np.linalg.norm(q) * q
            f += own * rho * area * (cp + ca) * across @ du + own * cp * pressure * growth * a
            f -= own * rho * area * ca * across @ np.cross(w, section)
            put(p, weight * f, weight * own * rho * area * ca * across)
        for number, p in enumerate((start, end)):
            if above(number * length) > 0.0:
                continue
            radius = 0.5 * member.diameter[number]
            outwards = a if number else -a
            u, du, pressure = water(p)
            section = v + np.cross(w, p)
            q = a @ (u - section)
            added = own * rho * 2.0 / 3.0 * np.pi * radius**3 * member.axial_added_mass_coefficient[number]
            f = 0.5 * rho * np.pi * radius**2 * member.axial_drag_coefficient[number] * abs(q) * q * a
            f += added * (a @ du - a @ np.cross(w, section)) * a
            f -= own * np.pi * radius**2 * member.axial_pressure_coefficient[number] * pressure * outwards
            put(p, f, added * np.outer(a, a))
    return total, mass


def displaced(r, R, members, steps=(160, 100, 100)):
    """(V, first moment (3,)) below Z = 0 in body axes, by counting small pieces of each member."""
    volume, moment = 0.0, np.zeros(3)
    along, around, out = ((np.arange(n) + 0.5) / n for n in steps)
    for member in members:
        start, end = np.array(member.start), np.array(member.end)
        length = np.linalg.norm(end - start)
        a = (end - start) / length
        e1 = np.linalg.svd(a[None])[2][1]
        e2 = np.cross(a, e1)
        s, angle, share = np.meshgrid(along, 2.0 * np.pi * around, np.sqrt(out), indexing="ij")
        radius = 0.5 * (member.diameter[0] + s * (member.diameter[1] - member.diameter[0]))
        piece = np.pi * radius**2 * length / np.prod(steps)  # rings of equal area
        p = start + np.multiply.outer(s * length, a)
        p += np.multiply.outer(radius * share * np.cos(angle), e1)
        p += np.multiply.outer(radius * share * np.sin(angle), e2)
        wet = np.where((p @ R[2] + r[2]) < 0.0, piece, 0.0)
        volume += wet.sum()
        moment += np.einsum("ijk,ijkl->l", wet, p)
    return volume, moment
