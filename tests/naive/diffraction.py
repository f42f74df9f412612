"""Slow, obvious twins of plant/hydro/diffraction.py: the wave around a cylinder, and the force on strips.

A complex number stands for the real part of itself times exp(-i omega t). A sea is as in naive/waves.py, a
spar and its surface as in naive/morison.py.
"""

import numpy as np
from naive import waves
from scipy.special import h1vp, hankel1, jv, jvp


def total_wave(k, a, r, angle, terms=40):
    """exp(i k r cos(angle)) plus what a cylinder of radius a scatters of it, summed over angular orders."""
    total = 0.0
    for n in range(terms):
        scattered = jvp(n, k * a) / h1vp(n, k * a) * hankel1(n, k * r)
        total = total + (1.0 if n == 0 else 2.0) * 1j**n * (jv(n, k * r) - scattered) * np.cos(n * angle)
    return total


def excitation(t, r, R, eta, sea, spar, nodes, inertia):
    """(F, M) in body axes of the waves' inertia load; inertia: function of ka to a complex coefficient.

    nodes: (z, weight, diameter, ...); eta from surface_on_axis.
    """
    F, M = np.zeros(3), np.zeros(3)
    for z, weight, d in zip(*nodes[:3], strict=True):
        point = np.array([0.0, 0.0, z]) if spar.position == "fixed" else r + R[:, 2] * z
        height = point[2]
        if spar.stretching == "wheeler":
            height = spar.depth * (height - eta) / (spar.depth + eta)
        acceleration = np.zeros(3)
        for omega, amplitude, phase, heading in sea:
            k = waves.wave_number(omega, spar.depth, spar.gravity)
            along = point[0] * np.cos(heading) + point[1] * np.sin(heading)
            place = np.exp(1j * (k * along + phase))
            kz, kh = np.longdouble(k) * (height + spar.depth), np.longdouble(k) * spar.depth
            horizontal = float(np.cosh(kz) / np.sinh(kh)) * -1j * amplitude * omega**2 * place
            vertical = float(np.sinh(kz) / np.sinh(kh)) * -amplitude * omega**2 * place
            wave = np.array([np.cos(heading) * horizontal, np.sin(heading) * horizontal, vertical])
            acceleration += np.real(inertia(0.5 * k * d) * wave * np.exp(-1j * omega * t))
        f = spar.density * 0.25 * np.pi * d**2 * (R.T @ acceleration)
        f[2] = 0.0
        F += weight * f
        M += weight * np.cross([0.0, 0.0, z], f)
    return F, M
