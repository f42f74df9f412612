"""Slow, obvious twin of fowt_env/weather/waves.py: Airy waves with the hyperbolic functions written out.

Extended precision holds cosh(kh) up to kh = 11000, so no rewriting with exponentials is needed.
A sea is a list of components (omega, amplitude, phase, heading), SI and radians.
"""

import numpy as np
from scipy.optimize import brentq


def wave_number(omega, depth, gravity):
    """k of omega^2 = g k tanh(k depth), by bisection."""
    deep = omega**2 / gravity
    high = deep + omega / np.sqrt(gravity * depth)  # deep and shallow water together
    return brentq(lambda k: k * np.tanh(k * depth) - deep, 1e-12, high, xtol=1e-18)


def elevation(t, x, y, sea, depth, gravity):
    total = 0.0
    for omega, amplitude, phase, heading in sea:
        k = wave_number(omega, depth, gravity)
        total += amplitude * np.cos(k * (x * np.cos(heading) + y * np.sin(heading)) - omega * t + phase)
    return total


def kinematics(t, x, y, z, sea, depth, density, gravity):
    """(velocity (3,), acceleration (3,), dynamic pressure) at a point whose z is used as given."""
    velocity, acceleration, pressure = np.zeros(3), np.zeros(3), 0.0
    for omega, amplitude, phase, heading in sea:
        k = np.longdouble(wave_number(omega, depth, gravity))
        angle = k * (x * np.cos(heading) + y * np.sin(heading)) - omega * t + phase
        horizontal = np.cosh(k * (z + depth)) / np.sinh(k * depth)
        vertical = np.sinh(k * (z + depth)) / np.sinh(k * depth)
        along = np.array([np.cos(heading), np.sin(heading), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        velocity += float(amplitude * omega * horizontal * np.cos(angle)) * along
        velocity += float(amplitude * omega * vertical * np.sin(angle)) * up
        acceleration += float(amplitude * omega**2 * horizontal * np.sin(angle)) * along
        acceleration -= float(amplitude * omega**2 * vertical * np.cos(angle)) * up
        share = np.cosh(k * (z + depth)) / np.cosh(k * depth)
        pressure += float(density * gravity * amplitude * share * np.cos(angle))
    return velocity, acceleration, pressure
