"""Computes diffraction by a slender vertical hull: MacCamy and Fuchs' cylinder per strip (theory.md, 5.4).

The solution for a cylinder of radius a in a wave of number k replaces the inertia coefficient
1 + C_A of a strip by a complex coefficient that depends on k a alone and multiplies the acceleration of
each component before the sum; the coefficient of a tapered section is a polynomial along the axis.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import h1vp

from fowt_env.plant.compile.decorators import kernel

TERMS = 6  # of the polynomial: within 3e-6 of the coefficient on the taper of OC3 down to 2.5 s


class StripDiffraction(NamedTuple):
    """Holds the inertia coefficient over 1 + C_A of every wave component and section of a Strips part."""

    series: np.ndarray  # (n, m, 2 TERMS) powers of z - centre: TERMS real parts, TERMS imaginary parts
    centre: np.ndarray  # (m,) body z


def inertia_coefficient(ka):
    """Return the complex inertia coefficient (n,) of a vertical cylinder: 2 in long waves, less in shorter.

    ka   wave number times radius, > 0
    The force per unit length is rho A times the coefficient times the acceleration of the undisturbed
    wave, exp(i (k x - omega t)), on the axis: a positive argument is a lag.
    Source: MacCamy and Fuchs (1954), Beach Erosion Board TM-69; theory.md Eq. (A20).
    """
    ka = np.asarray(ka, dtype=np.float64)
    return 4.0j / (np.pi * ka**2 * h1vp(1, ka))


def coefficient_series(wave_number, bottom, top, diameter_bottom, diameter_top):
    """Return (n, TERMS) complex: the inertia coefficient in powers of z - (bottom + top) / 2 over a section.

    wave_number (n,); diameters at the section's ends, linear between. Interpolates at Chebyshev points.
    """
    series = np.zeros((np.size(wave_number), TERMS), dtype=complex)
    if diameter_bottom == diameter_top:
        series[:, 0] = inertia_coefficient(0.5 * wave_number * diameter_bottom)
        return series
    points = np.cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS)
    diameter = 0.5 * (diameter_bottom + diameter_top) + 0.5 * (diameter_top - diameter_bottom) * points
    values = inertia_coefficient(0.5 * np.outer(diameter, wave_number))
    powers = (0.5 * (top - bottom)) ** np.arange(TERMS)
    series[:] = np.linalg.solve(np.vander(points, increasing=True), values).T / powers
    return series


def build_strip_diffraction(waves, strips):
    """Return the StripDiffraction of a Waves and a Strips part."""
    top, bottom = strips.section_top, strips.section_bottom
    upper = strips.diameter_bottom + strips.diameter_slope * (top - bottom)
    upper = np.where(strips.diameter_slope == 0.0, strips.diameter_bottom, upper)
    ends = zip(bottom, top, strips.diameter_bottom, upper, strict=True)
    series = np.stack([coefficient_series(waves.wave_number, *section) for section in ends], axis=1)
    series /= 1.0 + strips.added_mass_coefficient
    return StripDiffraction(
        np.ascontiguousarray(np.concatenate([series.real, series.imag], axis=2)), 0.5 * (top + bottom)
    )


@kernel
def factor_at(series, x):
    """Return (real, imaginary) of a coefficient series at x; series: (2 TERMS,) as in StripDiffraction."""
    re, im = series[TERMS - 1], series[2 * TERMS - 1]
    for i in range(TERMS - 2, -1, -1):
        re = series[i] + x * re
        im = series[TERMS + i] + x * im
    return re, im
