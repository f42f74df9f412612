"""Naive reference for tower bending: a beam of many Hermite elements that carries a rigid body."""

import numpy as np


def beam_matrices(height, fraction, density, stiffness, top, gravity, elements=200):
    """(mass, stiffness) of a clamped beam in a plane, by deflection and slope of each node but the lowest.

    fraction, density, stiffness  line mass (kg/m) and EI (N m2), linear between height fractions
    top  (mass kg, height of its centre above the beam m, inertia about the beam's top kg m2)
    """
    step = height / elements
    nodes = elements + 1
    mass, bend = np.zeros((2 * nodes, 2 * nodes)), np.zeros((2 * nodes, 2 * nodes))
    middle = (np.arange(elements) + 0.5) / elements
    line, rigidity = np.interp(middle, fraction, density), np.interp(middle, fraction, stiffness)
    carried = top[0] + np.cumsum(line[::-1])[::-1] * step - 0.5 * line * step
    h = step
    ones = np.array([
        [156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
        [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
    ]) * h / 420  # fmt: skip
    curve = np.array([
        [12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
        [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2],
    ]) / h**3  # fmt: skip
    string = np.array([
        [36, 3 * h, -36, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)],
        [-36, -3 * h, 36, -3 * h], [3 * h, -(h**2), -3 * h, 4 * h**2],
    ]) / (30 * h)  # fmt: skip
    for k in range(elements):
        rows = slice(2 * k, 2 * k + 4)
        mass[rows, rows] += line[k] * ones
        bend[rows, rows] += rigidity[k] * curve - gravity * carried[k] * string
    weight, arm, inertia = top
    mass[-2:, -2:] += [[weight, weight * arm], [weight * arm, inertia]]
    bend[-1, -1] -= gravity * weight * arm
    return mass[2:, 2:], bend[2:, 2:]


def beam_frequencies(*args, **kwargs):
    """Sorted natural frequencies of beam_matrices, Hz."""
    mass, bend = beam_matrices(*args, **kwargs)
    return np.sort(np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, bend)).real)) / (2.0 * np.pi)
