"""Prepares the wind preview of a controller: time series of the wind at look-ahead times, over the run."""

from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.checks import is_number
from fowt_env.errors import InputError
from fowt_env.weather.wind_field import WindBox, rotor_average

LONGEST = 600.0  # s ahead
SAME_INSTANT = 1e-9  # s, tolerance for equal instants


class Motion(NamedTuple):
    """Defines the effect of the fore-aft nacelle velocity, positive downwind, on a lidar's preview.

    With y the low-passed velocity, dy/dt = corner (velocity - y), and z(t) = sum of weight_k y(t - offset_k),
    the value j of the preview changes by -z(t - delay_j).
    """

    corner: float  # rad/s; inf: no low pass
    offset: np.ndarray  # (k,) s
    weight: np.ndarray  # (k,) with sum 1
    delay: np.ndarray  # (len(times),) s


class Preview(NamedTuple):
    """Holds the rotor wind along x at look-ahead times: values[j] at time t is the wind at t + times[j]."""

    time: np.ndarray  # (n,) s, increasing; values are constant outside
    values: np.ndarray  # (len(times), n) m/s
    motion: Motion | None = None  # effect of the nacelle's motion; None: none


def check_times(times):
    """Check and return look-ahead times (k,) s, increasing from 0 to LONGEST. Raises: InputError."""
    if isinstance(times, (str, bytes)) or not np.iterable(times):
        raise InputError(f"preview_times = {times!r}: must be a list of times in s")
    times = tuple(times)
    for time in times:
        if not is_number(time) or not 0.0 <= time <= LONGEST:
            raise InputError(f"preview_times = {times!r}: each must be a number in [0, {LONGEST:g}] s")
    if any(late <= early for early, late in zip(times[:-1], times[1:], strict=True)):
        raise InputError(f"preview_times = {times!r}: must increase")
    return np.array(times, dtype=np.float64)


def rotor_wind_series(scene):
    """Return (time s, wind m/s, period s or None) of a scene's wind along x averaged over the rotor.

    Raises: InputError for a scene without wind.
    """
    if scene.model.aero is None:
        raise InputError("preview: needs a scene with wind to look ahead")
    if isinstance(scene.wind, WindBox):
        rotor, box = scene.turbine.rotor, scene.wind
        time, value = rotor_average(box, rotor.hub_height, 2.0 * rotor.tip_radius)
        return time, value[:, 0], len(value) * box.dt if box.periodic else None
    series = scene.model.aero.wind
    return series.time, series.value[:, 0], series.period if series.period > 0.0 else None


def exact_preview(scene, times):
    """Return the exact Preview of the rotor-averaged wind at times (k,) s ahead.

    Values are linear between the samples of the scene's wind; random wind repeats with its period, other wind
    keeps its last value, as in the plant.
    Raises: InputError for times that do not increase from 0 to 600 s, or a scene without wind.
    """
    return series_ahead(scene, *rotor_wind_series(scene), check_times(times))


def series_ahead(scene, start, speed, period, times):
    """Return the Preview of a speed (n,) m/s at times start (n,) s, repeated by its period (s) or, for None,
    extended by its end values."""
    end = max(scene.options["duration"], start[-1])
    knots = start
    if period is not None:
        first, last = np.floor(-start[0] / period), np.ceil((end + LONGEST) / period)
        knots = (start + period * np.arange(first, last + 1.0)[:, None]).ravel()
    # all instants at which the slope of a value changes
    time = np.concatenate([[0.0, end], *(knots - ahead for ahead in times)])
    time = np.sort(time[(time >= 0.0) & (time <= end)])
    time = time[np.concatenate([[True], np.diff(time) > SAME_INSTANT])]
    values = np.array([np.interp(time + ahead, start, speed, period=period) for ahead in times])
    return Preview(time, values.reshape(len(times), time.size))
