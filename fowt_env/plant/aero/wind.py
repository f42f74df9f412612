"""Computes the wind at any time and point from a wind box or a series, which is sheared over the height."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.wind_field import field_at
from fowt_env.plant.compile.decorators import kernel

LARGEST_RATIO = 12.0  # highest over lowest point of a Profile
LOWEST_HEIGHT = 1.0  # m; points below it (waves, rotor at sea level) see the wind of this height


class WindSeries(NamedTuple):
    """Holds a time series of the wind and the shear over the height."""

    time: np.ndarray  # (n,) s, increasing, n >= 1; with a period it runs from 0 to the period
    value: np.ndarray  # (n, 5) u, v, w at the reference height, vertical_shear, horizontal_shear; m/s
    inverse_step: float  # 1/dt of a uniform time, 1/s; 0: not uniform (then bisection)
    period: float  # s; > 0: the series repeats, its last row equals the first; 0: constant past the ends
    shear_exponent: float  # of the power law on u and v
    reference_height: float  # m
    reference_length: float  # m; the linear shears are m/s per this length
    rotor_factor: float  # mean of the power law over the blades of a rotor of this diameter at that height


class WindNow(NamedTuple):
    """Holds the values of a WindSeries at one instant, m/s."""

    u: float
    v: float
    w: float
    vertical_shear: float
    horizontal_shear: float


class Profile(NamedTuple):
    """Approximates a power law over the height by scale P(z)/Q(z), z = height/centre - 1."""

    centre: float  # m
    scale: float  # power law at the centre
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    q1: float
    q2: float
    q3: float
    q4: float
    q5: float


NO_WIND = WindNow(0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def _row(series, i, weight):
    """Return the WindNow at the fraction `weight` from row i to row i + 1."""
    value = series.value
    rest = 1.0 - weight
    return WindNow(
        rest * value[i, 0] + weight * value[i + 1, 0],
        rest * value[i, 1] + weight * value[i + 1, 1],
        rest * value[i, 2] + weight * value[i + 1, 2],
        rest * value[i, 3] + weight * value[i + 1, 3],
        rest * value[i, 4] + weight * value[i + 1, 4],
    )


@kernel
def wind_now(t, series):
    """Return the WindNow at time t (s): linear between samples, periodic, or constant past the ends."""
    if series is None:
        return NO_WIND
    time = series.time
    last = time.shape[0] - 1
    if series.period > 0.0:
        t = t % series.period
    # the negated comparison maps a NaN time to the first row instead of an invalid index
    if last == 0 or not t > time[0]:
        first = series.value[0]
        return WindNow(first[0], first[1], first[2], first[3], first[4])
    if t >= time[last]:
        final = series.value[last]
        return WindNow(final[0], final[1], final[2], final[3], final[4])
    if series.inverse_step > 0.0:
        i = min(int((t - time[0]) * series.inverse_step), last - 1)
    else:
        i = interval_at(time, t)
    return _row(series, i, (t - time[i]) / (time[i + 1] - time[i]))


@kernel
def interval_at(time, t):
    """Return the index of the last of increasing times (n,) that is not above t, within 0 to n - 2."""
    low, high = 0, time.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if time[middle] <= t:
            low = middle
        else:
            high = middle
    return low


@kernel
def wind_at(t, X, Y, Z, now, series, field):
    """Return the wind (u, v, w), m/s, inertial components, at the inertial point X, Y, Z (m) and time t (s).

    The horizontal wind follows the power law of Z/reference_height; the linear shears add to u, m/s per
    reference_length above and to the left (+y). Points below LOWEST_HEIGHT see the wind at that height. now:
    wind_now(t, series). field: None, or the wind_field.WindField that replaces the series.
    """
    if series is None:
        return 0.0, 0.0, 0.0
    if field is None:
        return _series_at(Y, Z, now, series)
    return field_at(t, X, Y, Z, field)


@kernel
def _series_at(Y, Z, now, series):
    """Return the wind (u, v, w) of a series, m/s, at height Z and distance Y to the left (m)."""
    height = max(Z, LOWEST_HEIGHT)
    profile = 1.0
    if series.shear_exponent != 0.0:
        profile = (height / series.reference_height) ** series.shear_exponent
    return scaled_wind(Y, height, profile, now, series)


@kernel
def scaled_wind(Y, height, profile, now, series):
    """Return the wind (u, v, w) of a series, m/s, at a distance Y to the left and a height with profile."""
    linear = (
        now.vertical_shear * (height - series.reference_height) + now.horizontal_shear * Y
    ) / series.reference_length
    return now.u * profile + linear, now.v * profile, now.w


@kernel
def profile_spans(low, high):
    """Return whether a Profile is accurate for heights from low to high (m)."""
    return low > LOWEST_HEIGHT and high < LARGEST_RATIO * low


@kernel
def power_profile(low, high, series):
    """Return the Profile for heights from low to high (m): the diagonal Pade approximant of order 5.

    Relative error 2 sin(pi exponent) ((r - 1)/(r + 1))**11 at the ends, r = (high/low)**(1/4): with an
    exponent of 0.14 it is 4e-8 from 27 to 153 m, and 2e-6 at LARGEST_RATIO.
    """
    a = series.shear_exponent
    centre = sqrt(low * high)
    p1 = (5.0 + a) * (5.0 / 10.0)
    p2 = p1 * (4.0 + a) * (4.0 / 18.0)
    p3 = p2 * (3.0 + a) * (3.0 / 24.0)
    p4 = p3 * (2.0 + a) * (2.0 / 28.0)
    p5 = p4 * (1.0 + a) * (1.0 / 30.0)
    q1 = (5.0 - a) * (5.0 / 10.0)
    q2 = q1 * (4.0 - a) * (4.0 / 18.0)
    q3 = q2 * (3.0 - a) * (3.0 / 24.0)
    q4 = q3 * (2.0 - a) * (2.0 / 28.0)
    q5 = q4 * (1.0 - a) * (1.0 / 30.0)
    scale = (centre / series.reference_height) ** a
    return Profile(centre, scale, p1, p2, p3, p4, p5, q1, q2, q3, q4, q5)


@kernel
def profile_at(z, profile):
    """Return (1 + z)**exponent of a Profile."""
    upper = profile.p1 + z * (profile.p2 + z * (profile.p3 + z * (profile.p4 + z * profile.p5)))
    lower = profile.q1 + z * (profile.q2 + z * (profile.q3 + z * (profile.q4 + z * profile.q5)))
    return (1.0 + z * upper) / (1.0 + z * lower)
