"""Slow, obvious twin of fowt_env/plant/line_dynamics.py: forces on the nodes of a line, SI, Runge-Kutta."""

import numpy as np


def node_forces(r, v, line):
    """(N + 1, 3) forces of the segments, weight, drag and bed on all nodes; end nodes have half a share."""
    N = len(r) - 1
    force = np.zeros_like(r)
    for j in range(N):
        span = r[j + 1] - r[j]
        stretched = np.linalg.norm(span)
        q = span / stretched
        tension = max(line["EA"] * (stretched / line["l"] - 1.0), 0.0)
        tension += line["BA"] * q @ (v[j + 1] - v[j]) / line["l"]
        force[j] += tension * q
        force[j + 1] -= tension * q
    for i in range(N + 1):
        share = line["l"] * (0.5 if i in (0, N) else 1.0)
        q = tangent(r, i)
        along = (v[i] @ q) * q
        across = v[i] - along
        force[i, 2] -= share * line["w"]
        area = line["d"] * share
        force[i] -= 0.5 * line["rho"] * line["Cdn"] * area * np.linalg.norm(across) * across
        force[i] -= 0.5 * line["rho"] * line["Cdt"] * np.pi * area * np.linalg.norm(along) * along
        depth = line["bed"] - r[i, 2]
        if depth > 0.0:
            force[i, 2] += (line["kbot"] * depth - line["cbot"] * v[i, 2]) * line["d"] * share
    return force


def tangent(r, i):
    """Unit vector along the line at node i, between its neighbours."""
    span = r[min(i + 1, len(r) - 1)] - r[max(i - 1, 0)]
    return span / np.linalg.norm(span)


def accelerations(r, v, line):
    """(N - 1, 3) accelerations of the inner nodes; the added mass is a matrix per node."""
    force = node_forces(r, v, line)
    area = 0.25 * np.pi * line["d"] ** 2
    result = []
    for i in range(1, len(r) - 1):
        q = tangent(r, i)
        along = np.outer(q, q)
        water = line["Can"] * (np.eye(3) - along) + line["Cat"] * along
        mass = line["l"] * (line["m"] * np.eye(3) + line["rho"] * area * water)
        result.append(np.linalg.solve(mass, force[i]))
    return np.array(result)


def run(inner, velocity, fairlead, anchor, line, times, steps):
    """(len(times), 3) force on the fairlead; fairlead(t): position, velocity; steps: of each interval."""
    forces = []

    def whole(t, r, v):
        position, rate = fairlead(t)
        return np.vstack([anchor, r, position]), np.vstack([np.zeros(3), v, rate])

    def slope(t, r, v):
        return v, accelerations(*whole(t, r, v), line)

    r, v = inner.copy(), velocity.copy()
    for k, t in enumerate(times):
        if k:
            h = (t - times[k - 1]) / steps
            for n in range(steps):
                s = times[k - 1] + n * h
                a1, b1 = slope(s, r, v)
                a2, b2 = slope(s + h / 2, r + h / 2 * a1, v + h / 2 * b1)
                a3, b3 = slope(s + h / 2, r + h / 2 * a2, v + h / 2 * b2)
                a4, b4 = slope(s + h, r + h * a3, v + h * b3)
                r, v = r + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), v + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
        forces.append(node_forces(*whole(t, r, v), line)[-1])
    return np.array(forces)
