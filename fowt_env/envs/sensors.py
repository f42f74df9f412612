"""Sensors of an environment: the setting, and the values and noise in one episode.

One reading is made per control period, and observation, baseline, set-point loop and estimator read that
same one. Rewards, failures and outputs are of the true motions. The readings are made as those of simulate
are, by fowt_env/plant/sensing.py.
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
    """Return what noise of 1 is on each field of a Measurement, (N_MEASUREMENTS,), SI; 0 for the time.

    It is the scale of the observation channel of that name; of a field without one, that of the first channel
    in its unit, or 1 where there is none.
    individual: with the fields of a BladeMeasurement behind them; 0 for the azimuth, which is exact.
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
    """Return the setting sensors of an environment: {"noise", "delay"}, or a SensorChain; "exact" is None.

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
    """Return the sensors of an episode from what check_sensors returned, by the seed of its weather.

    A noise is a fraction of the scales (reading_scales). What a SensorChain does not have reads as NaN.
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
