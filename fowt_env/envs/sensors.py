"""Checks the sensor settings of an environment and draws the sensors of an episode.

Observation, baseline, set-point loop and estimator use the same reading in a control period. Rewards,
failures and outputs use true motions. Readings are computed as in simulate, by fowt_env/loop/sensing.py.
"""

from collections.abc import Mapping

import numpy as np

from fowt_env.descriptions.checks import check_number, check_whole_number
from fowt_env.descriptions.sensors import SensorChain, sensor_chain, sensors_of
from fowt_env.envs.observations import observation_channels
from fowt_env.errors import InputError, unknown
from fowt_env.loop.sensing import Sensors, Setting, open_chain
from fowt_env.plant.measurement import (
    BLADES_MEASURED,
    MEASURED,
    N_MEASUREMENTS,
    BladeMeasurement,
    Measurement,
)
from fowt_env.weather.sensor_noise import draw_noise
from fowt_env.weather.sensor_noise import draw_sensors as draw_chain

LONGEST_DELAY = 1000  # control periods


def reading_scales(turbine, individual=False):
    """Return the unit of noise of each field of a Measurement (N_MEASUREMENTS,), SI; 0 for time and azimuth.

    The unit of noise is the scale of the observation channel of the same name, else of the first channel with
    the same physical unit, else 1. individual: append the fields of a BladeMeasurement.
    """
    table = {name: entries[0] for name, entries in observation_channels(turbine).items() if entries}
    in_unit = {entry.unit: entry.scale for entry in reversed(table.values())}
    exact = {"time": 0.0, "azimuth": 0.0}  # clock and encoder
    geared = {"generator_speed": turbine.drivetrain.gear_ratio * table["rotor_speed"].scale}
    known = {name: entry.scale for name, entry in table.items()} | geared | exact
    unit = {name: field.unit for name, field in (MEASURED | BLADES_MEASURED).items()}
    fields = Measurement._fields + (BladeMeasurement._fields if individual else ())
    return np.array([known.get(name, in_unit.get(unit[name], 1.0)) for name in fields])


def check_sensors(setting, turbine=None):
    """Return the checked setting `sensors`: {"noise", "delay"}, a SensorChain, or None for "exact".

    Raises: InputError.
    """
    if isinstance(setting, str | SensorChain):
        return sensor_chain(setting) if turbine is None else sensors_of(setting, turbine)
    if not isinstance(setting, Mapping):
        raise InputError(
            f"sensors = {setting!r}: must be a dict with noise and delay, a SensorChain or the name of one"
        )
    settings = {"noise": 0.0, "delay": 0} | dict(setting)
    for key in setting:
        if key not in ("noise", "delay"):
            raise unknown("key of sensors", key, ("noise", "delay"))
    noise = check_number("sensors.noise", settings["noise"], 0.0, allowed="a finite number >= 0")
    return {"noise": noise, "delay": check_whole_number("sensors.delay", settings["delay"], 0, LONGEST_DELAY)}


def draw_sensors(settings, scales, control_dt, seed, readings):
    """Return the Sensors of an episode for settings from check_sensors, drawn with the weather seed.

    Noise is a fraction of the scales (reading_scales). Fields without a sensor in a SensorChain read NaN.
    """
    if isinstance(settings, SensorChain):
        sensors = draw_chain(settings, control_dt, seed, readings, scales.size > N_MEASUREMENTS)
        for i, name in enumerate((Measurement._fields + BladeMeasurement._fields)[: scales.size]):
            if name != "time" and name not in settings.sensors:
                sensors.chain[Setting.HIDDEN, i] = np.nan
        return sensors
    chain = open_chain(scales.size)
    chain[Setting.DELAY] = settings["delay"]
    if settings["noise"] == 0.0:
        return Sensors(chain, np.zeros((1, scales.size)))
    return Sensors(chain, draw_noise(settings["noise"] * scales, seed, readings))
