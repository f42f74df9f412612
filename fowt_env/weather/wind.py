"""Builds the wind of a scene from a user's specification: a time series at the reference height.

The series is uniform over the rotor apart from the power law and two linear shears; a box of full-field wind
(wind_field.py) replaces it. Frame: inertial, x downwind, y left when looking downwind, z up (state.py).
Specifications are defined in descriptions/wind.py; plant/aero/wind.py evaluates the wind.
"""

import operator
from math import cos, hypot, radians, sin

import numpy as np

from fowt_env.caches import cached
from fowt_env.descriptions.checks import check_in_range, check_whole_number
from fowt_env.descriptions.iec import EXTREME_SHEAR_EXPONENT, extreme_speed
from fowt_env.descriptions.wind import read_wind
from fowt_env.errors import InputError
from fowt_env.plant.aero.wind import LOWEST_HEIGHT, WindSeries
from fowt_env.weather import gusts
from fowt_env.weather.turbulence import SHORTEST_PERIOD, drawn_sigma, hub_turbulence, turbulence

OPENING = 60.0  # s; the trim uses the mean of a user's series over this time


@cached(64)
def rotor_factor(exponent, height, diameter):
    """Return the mean over radius and azimuth of the power law (Z/height)**exponent, with uniform weights."""
    if exponent == 0.0:
        return 1.0
    node, weight = np.polynomial.legendre.leggauss(20)
    radius = 0.25 * diameter * (node + 1.0)
    angle = 2.0 * np.pi * np.arange(180) / 180
    ratio = 1.0 + np.outer(np.sin(angle), radius) / height
    return float(0.5 * weight @ (np.maximum(ratio, LOWEST_HEIGHT / height) ** exponent).mean(axis=0))


def make_series(time, value, *, reference_height, reference_length, shear_exponent, period=0.0):
    """Return the WindSeries of samples value (n, 5) at time (n,) s; uniform time steps are detected."""
    time, value = _kernel_array(time), _kernel_array(value)
    inverse_step = 0.0
    if time.size > 1:
        step = (time[-1] - time[0]) / (time.size - 1)
        # each sample lies on the uniform grid, so that the index is exact up to rounding
        if np.abs(time - time[0] - step * np.arange(time.size)).max() <= 1e-6 * step:
            inverse_step = 1.0 / step
    profile = tuple(map(float, (shear_exponent, reference_height, reference_length)))
    return WindSeries(time, value, float(inverse_step), float(period), *profile, rotor_factor(*profile))


def _kernel_array(values):
    """Return values in the array type that kernels are compiled for: float64, C-contiguous, writeable."""
    return np.require(values, np.float64, "CAW")


def build_wind(spec, *, reference_height, rotor_diameter, shear_exponent, seed, duration):
    """Return the WindSeries of a wind specification; None for no aerodynamics.

    spec               None; a speed in m/s (0: still air); a dictionary with "kind", or the WindSpec that
                       read_wind returns for one (kinds and keys: descriptions.wind.KINDS); a WindSeries,
                       which is returned unchanged but for types
    reference_height   hub height, m
    shear_exponent     power law of the site, unless the spec gives one (ewm: 0.11 of the standard)
    seed               of turbulence: int >= 0 or numpy SeedSequence, unless the spec gives one
    duration           s, minimum period of turbulence
    Raises: InputError naming the key, its value and the allowed range.
    """
    if spec is None:
        return None
    if isinstance(spec, WindSeries):
        time, value, *numbers = spec
        typed = WindSeries(_kernel_array(time), _kernel_array(value), *map(float, numbers))
        return spec if all(map(operator.is_, typed, spec)) else typed
    spec = read_wind(spec)
    height = check_in_range("reference_height", reference_height, 1.0, 1000.0, "m")
    diameter = check_in_range("rotor_diameter", rotor_diameter, 1.0, 1000.0, "m")
    exponent = spec["shear_exponent"]
    if exponent is None:
        site = check_in_range("shear_exponent", shear_exponent, 0.0, 1.0)
        exponent = EXTREME_SHEAR_EXPONENT if spec.kind == "ewm" else site
    period = 0.0
    if spec.kind in GUSTS:
        gust, keys = GUSTS[spec.kind]
        available = {**spec.values, "height": height, "diameter": diameter}
        length, value = gust(spec["speed"], **{key: available[SPELT.get(key, key)] for key in keys})
        time = spec["start"] + np.linspace(0.0, length, len(value))
    elif _is_turbulent(spec):
        period, value = _turbulent(spec, height, diameter, seed, duration)
        time = _even_times(period, len(value))
    elif spec.kind == "series":
        columns = [spec[key] for key in ("speed", "v", "w", "vertical_shear", "horizontal_shear")]
        time, zero = spec["time"], np.zeros(spec["time"].size)
        value = np.stack([zero if column is None else column for column in columns], axis=1)
    elif spec.kind == "steps":
        time, value = _stepped(spec)
    else:
        speed, direction = nominal_speed(spec), radians(spec["direction"])
        vertical = spec.values.get("vertical", 0.0)
        time = np.zeros(1)
        value = np.array([[speed * cos(direction), speed * sin(direction), vertical, 0.0, 0.0]])
    profile = {"reference_height": height, "reference_length": diameter, "shear_exponent": exponent}
    return make_series(time, value, **profile, period=period)


@cached(8)
def _even_times(period, samples):
    """Return the sample times (samples,) from 0 to the period, s, as a shared array: don't write."""
    return np.linspace(0.0, period, samples)


def nominal_speed(spec):
    """Return the horizontal hub speed (m/s) at which a run is trimmed; spec as in build_wind.

    This is the nominal speed of steady, turbulent and gusty wind, the first speed of steps, and for a series
    the mean over the first 60 s, since a platform does not follow the single first sample. None gives 0.
    """
    if spec is None:
        return 0.0
    if isinstance(spec, WindSeries):
        mean = mean_wind(spec)
        return hypot(mean.value[0, 0], mean.value[0, 1])
    spec = read_wind(spec)
    if spec.kind == "steps":
        return float(spec["speeds"][0])
    if spec.kind == "series":
        return _opening_mean(spec["time"], spec["speed"])
    if spec.kind == "ewm" and spec["speed"] is None:
        return extreme_speed(spec["turbine_class"], spec["recurrence"], turbulent=spec["turbulent"])
    return spec["speed"]


def mean_wind(series):
    """Return the constant WindSeries at which a run is trimmed: the mean over the period of a periodic series
    or else over the first 60 s (with the first sample extended to earlier times). None: None."""
    if series is None:
        return None
    end = series.period if series.period > 0.0 else OPENING
    value = np.array([_opening_mean(series.time, column, end) for column in series.value.T])
    return series._replace(
        time=np.zeros(1), value=np.ascontiguousarray(value[None, :]), inverse_step=0.0, period=0.0
    )


def _opening_mean(time, value, length=OPENING):
    """Return the exact mean over [0, length] of a piecewise linear value, constant outside its samples."""
    inside = time[(time > 0.0) & (time < length)]
    nodes = np.concatenate(([0.0], inside, [length]))
    return float(np.trapezoid(np.interp(nodes, time, value), nodes) / length)


def _stepped(spec):
    """Return (time, value) of a staircase: each speed lasts `every`, then ramps to the next."""
    speeds = spec["speeds"]
    edges = spec["every"] * np.arange(1, speeds.size)
    time = np.concatenate(([0.0], np.stack([edges, edges + spec["ramp"]], axis=1).ravel()))
    value = np.zeros((time.size, 5))
    value[:, 0] = np.concatenate(([speeds[0]], np.stack([speeds[:-1], speeds[1:]], axis=1).ravel()))
    return time, value


def _is_turbulent(spec):
    """Return whether a WindSpec defines random turbulence."""
    return spec.kind in ("ntm", "etm") or (spec.kind == "ewm" and spec["turbulent"])


def _turbulent(spec, height, diameter, seed, duration):
    """Return (period, value) of one period of turbulence about its mean speed and direction."""
    drawn = _drawn(spec, height, diameter, seed, duration)
    period, value = turbulence(**drawn, average=spec["average"], shear_turbulence=spec["shear_turbulence"])
    value[:, 0] += drawn["speed"]
    _turn(value, radians(spec["direction"]))
    return period, value


def _drawn(spec, height, diameter, seed, duration):
    """Return arguments of turbulence(): speed, sigma, height, diameter, period, seed. Raises: InputError."""
    speed = nominal_speed(spec)
    duration = check_in_range("duration", duration, 0.0, 1e5, "s")
    period = spec["period"]
    if period is None:
        period = max(duration, SHORTEST_PERIOD)
    elif period < duration:
        raise InputError(f"wind.period = {period}: must be at least the duration, {duration:g} s")
    if spec["seed"] is not None:
        seed = spec["seed"]
    elif not isinstance(seed, np.random.SeedSequence):
        seed = check_whole_number("seed", seed, 0)
    sigma = drawn_sigma(spec.kind, speed, spec.values, seed)
    rotor = {"height": height, "diameter": diameter}
    return {"speed": speed, "sigma": sigma, **rotor, "period": period, "seed": seed}


def _turn(value, direction):
    """Rotate the wind of the rows by a direction (rad, from +x towards +y)."""
    if direction == 0.0:
        return
    along, across = value[:, 0].copy(), value[:, 1].copy()
    value[:, 0] = along * cos(direction) - across * sin(direction)
    value[:, 1] = along * sin(direction) + across * cos(direction)
    # WindSeries represents only gradients of u along z and y: those of v and along x are dropped
    value[:, 3:4] *= cos(direction)
    value[:, 4:5] *= cos(direction) ** 2


def drawn_turbulence(spec, *, reference_height, rotor_diameter, seed, duration):
    """Return the arguments of turbulence() and "average" for a wind drawn from spectra; else None.

    Arguments as in build_wind.
    """
    if spec is None or isinstance(spec, WindSeries):
        return None
    spec = read_wind(spec)
    if not _is_turbulent(spec):
        return None
    drawn = _drawn(spec, float(reference_height), float(rotor_diameter), seed, duration)
    return drawn | {"average": spec["average"]}


def hub_series(spec, **arguments):
    """Return (time, value (n, 3)) of u, v, w at the hub over one period of a rotor-averaged wind.

    Arguments as in build_wind. Returns None for other winds, which already are the wind at a point.
    """
    drawn = drawn_turbulence(spec, **arguments)
    if drawn is None or drawn.pop("average") != "rotor":
        return None
    period, value = hub_turbulence(**drawn)
    value[:, 0] += drawn["speed"]
    _turn(value, radians(read_wind(spec)["direction"]))
    return _even_times(period, len(value)), value


_CLASS, _PLACE = "turbulence_class", ("height", "diameter")
SPELT = {_CLASS: "class"}  # argument of a gust function: key of the specification, if different
GUSTS = {  # kind: (function of the speed, names of further arguments)
    "eog": (gusts.operating_gust, (_CLASS, "turbine_class", *_PLACE)),
    "edc": (gusts.direction_change, (_CLASS, *_PLACE, "sign")),
    "ecd": (gusts.coherent_gust, ("sign",)),
    "ews": (gusts.wind_shear, (_CLASS, *_PLACE, "orientation", "sign")),
}
