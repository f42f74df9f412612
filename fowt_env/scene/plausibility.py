"""Describes implausible winds and seas of a scene, for warnings of build_scene."""

from math import pi, tanh

import numpy as np

from fowt_env.descriptions.checks import is_number
from fowt_env.errors import warn_once
from fowt_env.weather.waves import wave_number
from fowt_env.weather.wind_field import WindBox

STEEPEST = 1.0 / 7.0  # height over length of a breaking wave, times tanh(k depth) in finite depth
MEAN_WINDS = ("steady", "ntm", "etm")  # kinds of wind with a mean speed in which a turbine operates


def warn_of_weather(air, sea, platform, turbine, label):
    """Warn, once per text, of an Air and a SeaState that are implausible for a platform and turbine."""
    faults = [*wind_faults(air, turbine), *sea_faults(sea, platform.environment)]
    text = " ".join(f"{fault[0].upper()}{fault[1:]}." for fault in faults)
    if text:
        warn_once((label, text), f"platform {label!r}: {text}")


def wind_faults(air, turbine):
    """Return sentences on a mean wind outside the operating range; none for still air, gusts and extremes."""
    spec = air.spec
    kind = spec.get("kind") if isinstance(spec, dict) else getattr(spec, "kind", None)
    if not air.speed or not (is_number(spec) or isinstance(spec, WindBox) or kind in MEAN_WINDS):
        return []
    start = f"the mean wind of {air.speed:.4g} m/s is"
    low, high = turbine.cut_in_wind_speed, turbine.cut_out_wind_speed
    if air.speed > high:
        return [
            f"{start} above the turbine's cut-out wind of {high:.4g} m/s: a run starts with feathered blades"
            " and a rotor at rest"
        ]
    return [f"{start} below the turbine's cut-in wind of {low:.4g} m/s"] if air.speed < low else []


def sea_faults(sea, site):
    """Return the sentences on a SeaState in which the waves would break, by Miche's limit.

    Height over length at most 1/7 tanh(k depth) (R. Miche, Annales des Ponts et Chaussees 114, 1944;
    DNV-RP-C205, 3.4.6). For a spectrum, significant height over length at the peak; real seas are far less
    steep: 1/11.6 in the steepest built-in sea state.
    """
    names = ("H", "T") if sea.kind == "regular" else ("Hs", "Tp")
    height, period = (getattr(sea, name) for name in names)
    if not height or not period:
        return []
    depth = site.water_depth
    k = float(wave_number(np.array([2.0 * pi / period]), depth, site.gravity)[0])
    length, steepest = 2.0 * pi / k, STEEPEST * tanh(k * depth)
    if height <= steepest * length:
        return []
    return [
        f"waves of {names[0]} = {height:.4g} m and {names[1]} = {period:.4g} s are {length:.3g} m long: their"
        f" steepness of {height / length:.2g} exceeds the breaking limit of {steepest:.2g}"
    ]
