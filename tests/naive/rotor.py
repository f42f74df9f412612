"""Blade element momentum, theory.md, 5.1: numpy vectors, a scan for all roots and scipy for each of them."""

import numpy as np
from scipy.optimize import brentq

SMALL = 1e-6


def coefficients(alpha, polar, upside_down=False):
    """(cl, cd) of a polar (m, 4) at alpha, rad."""
    alpha = (alpha + np.pi) % (2 * np.pi) - np.pi
    if upside_down:
        return -np.interp(-alpha, polar[:, 0], polar[:, 1]), np.interp(-alpha, polar[:, 0], polar[:, 2])
    return np.interp(alpha, polar[:, 0], polar[:, 1]), np.interp(alpha, polar[:, 0], polar[:, 2])


def losses(f, radius, rotor):
    """Prandtl's tip and hub factor."""
    s = abs(np.sin(f))
    tip = np.exp(-rotor.blades * (rotor.tip_radius - radius) / (2 * radius * s))
    hub = np.exp(-rotor.blades * (radius - rotor.hub_radius) / (2 * rotor.hub_radius * s))
    return (2 / np.pi * np.arccos(tip)) * (2 / np.pi * np.arccos(hub))


def induction(f, theta, radius, chord, polar, rotor, upside_down=False):
    """(a, k', cn, ct) at the inflow angle f; beyond theory.md, 5.1 for f < 0 and |f| < 0.01, see rotor.py."""
    cl, cd = coefficients(f - (-theta if upside_down else theta), polar, upside_down)
    s, c = np.sin(f), np.cos(f)
    cn, ct = cl * c + cd * s, cl * s - cd * c
    sigma = rotor.blades * chord / (2 * np.pi * radius)
    loss = losses(f, radius, rotor)
    k = sigma * cn / (4 * loss * s * s)
    kp = sigma * ct / (4 * loss * max(abs(s), 0.01) * c)
    g1 = 2 * loss * k - (10 / 9 - loss)
    g2 = 2 * loss * k - loss * (4 / 3 - loss)
    g3 = 2 * loss * k - (25 / 9 - 2 * loss)
    if f > 0:
        if k <= 2 / 3:
            return k / (1 + k), kp, cn, ct
        return (1 - 1 / (2 * np.sqrt(g2)) if abs(g3) < 1e-6 else (g1 - np.sqrt(g2)) / g3), kp, cn, ct
    brake = k / (k - 1)
    if k > 1 and g2 > 0 and abs(g3) > 1e-9:
        buhl = (g1 + np.sqrt(g2)) / g3

        def thrust_on_buhl(a):
            return 8 / 9 + (4 * loss - 40 / 9) * a + (50 / 9 - 4 * loss) * a * a

        if buhl > 1 and thrust_on_buhl(buhl) > 4 * loss * buhl * (buhl - 1):
            return buhl, kp, cn, ct
    return brake, kp, cn, ct


def residual(f, ratio, *section):
    """sin f/(1-a) - (V_x/V_y) cos f (1-k'), theory.md, 5.1; ratio = V_x/V_y."""
    a, kp, _, _ = induction(f, *section)
    return np.sin(f) / (1 - a) - ratio * np.cos(f) * (1 - kp)


def roots(ratio, *section):
    """All sign changes of the residual from minus to plus in [-pi/2, pi/2], on a fine grid."""
    positive = np.concatenate([np.geomspace(SMALL, 1e-2, 60), np.linspace(1e-2, 1.5707, 500)[1:]])
    grid = np.concatenate([-positive[::-1], positive])
    value = np.array([residual(f, ratio, *section) for f in grid])
    up = np.flatnonzero((value[:-1] < 0) & (value[1:] > 0))
    found = [brentq(residual, grid[i], grid[i + 1], (ratio, *section), xtol=1e-15, rtol=1e-14) for i in up]
    return [f for f in found if abs(residual(f, ratio, *section)) < 1e-6]  # not the jumps


def smoothstep(x, low, high):
    """Smooth step of third order."""
    x = np.clip((x - low) / (high - low), 0.0, 1.0)
    return x * x * (3 - 2 * x)


def solve(v_normal, v_tangential, theta, radius, chord, polar, rotor):
    """(f, a, a', fn, ft) of one section of a fast rotor: the greatest root; none for v_tangential <= 0."""
    part = 0.0
    if v_tangential > 0:
        part = smoothstep(v_tangential / max(abs(v_normal), 1e-300), 0.01, 0.02)
    f, a, ap = np.arctan2(v_normal, v_tangential), 0.0, 0.0
    if part > 0:
        mirrored = v_normal < 0
        section = (theta, radius, chord, polar, rotor, mirrored)
        f = roots(abs(v_normal) / v_tangential, *section)[-1]
        a, kp, _, _ = induction(f, *section)
        ap = kp / (1 - kp)
        f = -f if mirrored else f
    w_normal, w_tangential = v_normal * (1 - part * a), v_tangential * (1 + part * ap)
    flow = np.arctan2(w_normal, w_tangential)
    cl, cd = coefficients(flow - theta, polar)
    q = 0.5 * rotor.air_density * chord * (w_normal**2 + w_tangential**2)
    fn, ft = cl * np.cos(flow) + cd * np.sin(flow), cl * np.sin(flow) - cd * np.cos(flow)
    return f, a, ap, q * fn, q * ft


def span_integrals(radius, load, rotor):
    """(force, moment): integrals of p and r p, the load p linear between stations and zero at hub and tip."""
    nodes = np.concatenate([[rotor.hub_radius], radius, [rotor.tip_radius]])
    values = np.concatenate([[0.0], load, [0.0]])
    force = moment = 0.0
    for r0, r1, p0, p1 in zip(nodes[:-1], nodes[1:], values[:-1], values[1:], strict=True):
        x, w = np.polynomial.legendre.leggauss(3)
        r = r0 + (r1 - r0) * (x + 1) / 2
        p = p0 + (p1 - p0) * (x + 1) / 2
        force += np.sum(w * p) * (r1 - r0) / 2
        moment += np.sum(w * p * r) * (r1 - r0) / 2
    return force, moment


def tower_wrench(tower, air_density, R, origin, velocity, rate, wind, points=2000):
    """(force, moment) of the tower drag by the midpoint rule."""
    height = (tower.top_height - tower.base_height) / points
    force, moment = np.zeros(3), np.zeros(3)
    for z in tower.base_height + height * (np.arange(points) + 0.5):
        share = (z - tower.base_height) / (tower.top_height - tower.base_height)
        diameter = tower.base_diameter + share * (tower.top_diameter - tower.base_diameter)
        arm = np.array([0.0, 0.0, z])
        W = R.T @ wind(origin + R @ arm) - velocity - np.cross(rate, arm)
        W[2] = 0.0
        f = 0.5 * air_density * tower.drag_coefficient * diameter * np.linalg.norm(W) * W * height
        force += f
        moment += np.cross(arm, f)
    return force, moment
