"""Computes deterministic gusts of IEC 61400-1 (ed. 3), 6.3.2 "Extreme wind conditions".

Each function takes the hub speed and returns (duration, value): value (n, 5) with the columns of WindSeries,
evenly spaced over the duration; the wind is constant before the first and after the last row. Numbers in the
docstrings are from the standard; speeds in m/s, lengths in m, times in s.
"""

from math import atan, ceil, pi, radians

import numpy as np

from fowt_env.descriptions.iec import extreme_speed, length_scale, ntm_sigma

STEP = 0.01  # s; linear interpolation is then within 1e-4 of the gust's amplitude


def _rows(duration):
    """Return the times from 0 to the duration, and zeroed rows of the wind at these times."""
    time = np.linspace(0.0, duration, ceil(duration / STEP) + 1)
    return time, np.zeros((time.size, 5))


def _turned(speed, angle, value):
    """Fill and return the rows of a horizontal wind of a given speed, turned by an angle (rad) towards +y."""
    value[:, 0] = speed * np.cos(angle)
    value[:, 1] = speed * np.sin(angle)
    return value


def operating_gust(speed, *, turbulence_class, turbine_class, height, diameter):
    """Return the extreme operating gust (EOG): dip, rise and dip of the speed within 10.5 s."""
    duration = 10.5
    time, value = _rows(duration)
    gust = min(
        1.35 * (extreme_speed(turbine_class, 1) - speed),
        3.3 * ntm_sigma(speed, turbulence_class) / (1.0 + 0.1 * diameter / length_scale(height)),
    )
    value[:, 0] = speed - 0.37 * gust * np.sin(3.0 * pi * time / duration) * (
        1.0 - np.cos(2.0 * pi * time / duration)
    )
    return duration, value


def direction_change(speed, *, turbulence_class, height, diameter, sign):
    """Return the extreme direction change (EDC): the wind turns by theta_e within 6 s and stays."""
    duration = 6.0
    time, value = _rows(duration)
    part = 1.0 + 0.1 * diameter / length_scale(height)
    angle = sign * (4.0 * atan(ntm_sigma(speed, turbulence_class) / (speed * part)))
    return duration, _turned(speed, 0.5 * angle * (1.0 - np.cos(pi * time / duration)), value)


def coherent_gust(speed, *, sign):
    """Return the coherent gust with direction change (ECD): +15 m/s and a turn within 10 s.

    The turn is 180 deg below 4 m/s, else 720 deg m/s over the hub speed.
    """
    duration, rise = 10.0, 15.0
    time, value = _rows(duration)
    ramp = 0.5 * (1.0 - np.cos(pi * time / duration))
    turn = sign * radians(180.0 if speed < 4.0 else 720.0 / speed)
    return duration, _turned(speed + rise * ramp, turn * ramp, value)


def wind_shear(speed, *, turbulence_class, height, diameter, orientation, sign):
    """Return the extreme wind shear (EWS): a linear shear over the rotor that comes and goes in 12 s.

    orientation: "vertical" (sign +1: stronger above) or "horizontal" (+1: stronger at +y). The value
    is per rotor diameter, so the series' reference_length must be the diameter.
    """
    duration = 12.0
    time, value = _rows(duration)
    ratio = diameter / length_scale(height)
    amplitude = sign * (2.5 + 0.2 * 6.4 * ntm_sigma(speed, turbulence_class) * ratio**0.25)
    value[:, 0] = speed
    value[:, 3 if orientation == "vertical" else 4] = amplitude * (1.0 - np.cos(2.0 * pi * time / duration))
    return duration, value
