"""Computes linear (Airy) waves by a sum of components: elevation, kinematics at a point (theory.md, 5.4)."""

from math import cos, exp, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel

# Above this product of wave number and depth an exponential is below 1e-12 of its surface value.
NEGLIGIBLE = 27.6


class Waves(NamedTuple):
    """Holds wave components; every array (n,), C-contiguous."""

    omega: np.ndarray  # rad/s
    wave_number: np.ndarray  # 1/m
    amplitude: np.ndarray  # m
    phase: np.ndarray  # e, rad
    cos_heading: np.ndarray
    sin_heading: np.ndarray
    velocity: np.ndarray  # a omega / (1 - exp(-2 k h)), so that cosh/sinh = (e1 + e2) * this / (a omega)
    depth: float
    density: float
    ramp: float  # s over which the waves are raised from rest; 0: none
    random: bool  # drawn from a spectrum: repeats after the duration of the draw


@kernel
def ramp_factor(t, ramp):
    """Return the fraction of the wave amplitude at time t: linear over ramp seconds."""
    if ramp <= 0.0 or t >= ramp:
        return 1.0
    return max(t, 0.0) / ramp


@kernel
def elevation(t, x, y, waves):
    """Return the surface elevation at an inertial point, m; 0 without waves."""
    if waves is None:
        return 0.0
    total = 0.0
    for j in range(waves.omega.shape[0]):
        k = waves.wave_number[j]
        total += waves.amplitude[j] * cos(
            k * (x * waves.cos_heading[j] + y * waves.sin_heading[j]) - waves.omega[j] * t + waves.phase[j]
        )
    return total * ramp_factor(t, waves.ramp)


class Kinematics(NamedTuple):
    """Holds water velocity (m/s), local acceleration (m/s2) and dynamic pressure (Pa) at one point."""

    u: float
    v: float
    w: float
    du: float
    dv: float
    dw: float
    pressure: float


@kernel
def wave_kinematics(t, x, y, z, waves):
    """Return the Kinematics at an inertial point (z already stretched), plain component sum."""
    u = v = w = du = dv = dw = p = 0.0
    h = waves.depth
    for j in range(waves.omega.shape[0]):
        k, om = waves.wave_number[j], waves.omega[j]
        phase = k * (x * waves.cos_heading[j] + y * waves.sin_heading[j]) - om * t + waves.phase[j]
        c, s = cos(phase), sin(phase)
        e1 = exp(k * z)
        e2 = exp(-k * (z + 2.0 * h))
        even = waves.velocity[j] * (e1 + e2)
        odd = waves.velocity[j] * (e1 - e2)
        u += even * c * waves.cos_heading[j]
        v += even * c * waves.sin_heading[j]
        w += odd * s
        du += om * even * s * waves.cos_heading[j]
        dv += om * even * s * waves.sin_heading[j]
        dw -= om * odd * c
        p += waves.density * om / k * even * c
    f = ramp_factor(t, waves.ramp)
    return Kinematics(f * u, f * v, f * w, f * du, f * dv, f * dw, f * p)
