"""Defines parameters and wind models of IEC 61400-1 (ed. 3) shared by gusts and turbulence.

The theory page of pyIECWind, https://pyiecwind.readthedocs.io, lists the same formulas.
"""

from math import exp, log1p, sqrt

REFERENCE_SPEED = {"I": 50.0, "II": 42.5, "III": 37.5}  # Vref, m/s, of the wind turbine classes
TURBULENCE_INTENSITY = {"A+": 0.18, "A": 0.16, "B": 0.14, "C": 0.12}  # Iref; A+ from ed. 4
EXTREME_SHEAR_EXPONENT = 0.11  # of the extreme wind models, 6.3.2.1


def length_scale(height):
    """Return the longitudinal turbulence scale Lambda_1 (m) at a height (m): 0.7 z, 42 m from 60 m up."""
    return 0.7 * min(height, 60.0)


def ntm_sigma(speed, turbulence_class):
    """Return the standard deviation sigma_1 (m/s) of the normal turbulence model (NTM), 90 % quantile."""
    return TURBULENCE_INTENSITY[turbulence_class] * (0.75 * speed + 5.6)


def ntm_sigma_distribution(speed, turbulence_class):
    """Return (mean, standard deviation), m/s, of the log-normal sigma_1 of the NTM at a wind speed.

    E = I_ref (0.75 V + 3.8 m/s), D = 1.4 m/s I_ref (IEC 61400-1 ed. 3, 6.3.1.3); ntm_sigma is the 90 %
    quantile, which the standard prescribes for design.
    """
    intensity = TURBULENCE_INTENSITY[turbulence_class]
    return intensity * (0.75 * speed + 3.8), 1.4 * intensity


def ntm_sigma_at(speed, turbulence_class, normal):
    """Return sigma_1 (m/s) of the NTM at the quantile of a standard normal variate."""
    mean, deviation = ntm_sigma_distribution(speed, turbulence_class)
    variance = log1p((deviation / mean) ** 2)  # of ln sigma_1
    return mean * exp(normal * sqrt(variance) - 0.5 * variance)


def etm_sigma(speed, turbulence_class, turbine_class):
    """Return the standard deviation sigma_1 (m/s) of the extreme turbulence model (ETM), c = 2 m/s."""
    c = 2.0
    mean_of_year = 0.2 * REFERENCE_SPEED[turbine_class]
    return (
        c
        * TURBULENCE_INTENSITY[turbulence_class]
        * (0.072 * (mean_of_year / c + 3.0) * (speed / c - 4.0) + 10.0)
    )


def extreme_speed(turbine_class, recurrence, *, turbulent=False):
    """Return the hub wind speed (m/s) of the extreme wind model (EWM) with a return period of 50 or 1 years.

    Steady: 1.4 Vref, a 3 s gust. Turbulent: Vref, the 10 min mean about which the wind fluctuates.
    """
    fifty_years = REFERENCE_SPEED[turbine_class] * (1.0 if turbulent else 1.4)
    return fifty_years if recurrence == 50 else 0.8 * fifty_years
