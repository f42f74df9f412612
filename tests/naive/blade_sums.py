"""Sums over the elements of a blade, one by one, as ElastoDyn's subroutine Coeff writes them."""

from math import cos, pi, radians, sin, sqrt

import numpy as np


def read_blade(path):
    """{name: list of numbers} of the columns and {key: number} of the lines of an ElastoDyn blade file."""
    lines = [line.split() for line in open(path)]
    start = next(i for i, words in enumerate(lines) if words[:1] == ["BlFract"])
    keys = {words[1].replace("(", "").replace(")", ""): words[0] for words in lines[:start] if len(words) > 1}
    rows = lines[start + 2 : start + 2 + int(keys["NBlInpSt"])]
    columns = {name: [float(row[i]) for row in rows] for i, name in enumerate(lines[start])}
    for words in lines[start + 2 + len(rows) :]:
        if len(words) > 1:
            keys[words[1].replace("(", "").replace(")", "")] = words[0]
    return columns, keys


def polynomial(coefficients, x, length, derivative):
    """ElastoDyn's SHP: a mode shape of the powers 2 to 6 and its derivatives by the span in m."""
    total = 0.0
    for power, value in enumerate(coefficients, 2):
        factor = (1.0, power, power * (power - 1.0))[derivative]
        total += value * factor * x ** (power - derivative)
    return total / length**derivative


def blade_sums(path, hub_radius, tip_radius, elements, tip_mass=0.0):
    """{name: value} of a blade of an ElastoDyn file; modes in the order flap 1, flap 2, edge 1.

    nodes: (distance, mass, [3][2] shape, [3][2] slope, [3][3] shortening) of every element, then of the tip.
    """
    columns, keys = read_blade(path)
    length = tip_radius - hub_radius
    step = length / elements
    modes = [[float(keys[f"Bld{name}Sh{power}"]) for power in range(2, 7)] for name in ("Fl1", "Fl2", "Edg")]
    adjust = [float(keys[key]) for key in ("AdjBlMs", "AdjFlSt", "AdjEdSt")]
    tuner = [float(keys["FlStTunr1"]), float(keys["FlStTunr2"])]
    percent = [float(keys[key]) for key in ("BldFlDmp1", "BldFlDmp2", "BldEdDmp1")]
    at_element = []
    for j in range(elements):
        x = (j + 0.5) / elements
        density, flap, edge, twist = (
            np.interp(x, columns["BlFract"], columns[name])
            for name in ("BMassDen", "FlpStff", "EdgStff", "StrcTwst")
        )
        at_element.append((x, density * adjust[0], flap * adjust[1], edge * adjust[2], radians(twist)))

    nodes = []
    stiffness, generalised = np.zeros((3, 3)), [0.0] * 3
    slope_end, shape_end, short_end = np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((3, 3))
    for x, density, flap, edge, twist in at_element:
        bent = [polynomial(mode, x, length, 2) for mode in modes]
        curvature = np.array(
            [[bent[i] * cos(twist), -bent[i] * sin(twist)] for i in (0, 1)]
            + [[bent[2] * sin(twist), bent[2] * cos(twist)]]
        )
        slope = slope_end + curvature * step / 2.0
        slope_end = slope_end + curvature * step
        shape = shape_end + slope * step / 2.0
        shape_end = shape_end + slope * step
        square = np.array([[slope[i] @ slope[j] for j in range(3)] for i in range(3)])
        short = short_end + square * step / 2.0
        short_end = short_end + square * step
        nodes.append((hub_radius + x * length, density * step, shape, slope, short))
        for i in range(3):
            generalised[i] += density * step * polynomial(modes[i], x, length, 0) ** 2
        for i in range(2):
            for j in range(2):
                stiffness[i, j] += flap * step * bent[i] * bent[j] * sqrt(tuner[i] * tuner[j])
        stiffness[2, 2] += edge * step * bent[2] ** 2
    nodes.append((tip_radius, tip_mass, shape_end, slope_end, short_end))
    frequency = [sqrt(stiffness[i, i] / generalised[i]) / (2.0 * pi) for i in range(3)]
    damping = np.array(
        [[0.01 * percent[j] * stiffness[i, j] / (pi * frequency[j]) for j in range(3)] for i in range(3)]
    )
    return {"nodes": nodes, "stiffness": stiffness, "damping": damping, "frequency": frequency}
