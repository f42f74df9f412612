"""Sensors between the plant and all who read it: late by whole control periods, with white noise.

One reading is made per control period, and observation, baseline, set-point loop and estimator are given that
same one. Rewards, failures and outputs are of the true motions.
"""

from collections.abc import Mapping
from math import isfinite
from typing import NamedTuple

import numpy as np

from fowt_env.envs.observations import observation_channels
from fowt_env.errors import InputError, unknown
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure, Measurement

NOISE_STREAM = 3  # of a run's seed: apart from that of its weather
LONGEST_DELAY = 1000  # control periods


class Sensors(NamedTuple):
    """What stays fixed in an episode: its noise is drawn beforehand, so that a snapshot needs none of it."""

    noise: np.ndarray  # (readings, N_MEASUREMENTS), SI; one row, repeated, where there is none
    delay: int  # control periods


def reading_scales(turbine):
    """(N_MEASUREMENTS,) what noise of 1 is on each field of a Measurement, SI; 0 for the time."""
    table = observation_channels(turbine)
    scales = {name: table[name][0].scale for name in Measurement._fields if name in table}
    scales["generator_speed"] = turbine.drivetrain.gear_ratio * scales["rotor_speed"]
    scales["time"] = 0.0  # a clock, not a sensor
    return np.array([scales[name] for name in Measurement._fields])


def check_sensors(given):
    """{"noise", "delay"} of what an environment is given as sensors. Raises: InputError."""
    if not isinstance(given, Mapping):
        raise InputError(f"sensors = {given!r}: must be a dict with noise and delay")
    settings = {"noise": 0.0, "delay": 0} | dict(given)
    for key in given:
        if key not in ("noise", "delay"):
            raise unknown("key of sensors", key, ("noise", "delay"))
    noise, delay = settings["noise"], settings["delay"]
    number = isinstance(noise, int | float | np.number) and not isinstance(noise, bool)
    if not number or not (isfinite(noise) and noise >= 0.0):
        raise InputError(f"sensors.noise = {noise!r}: must be a finite number >= 0")
    whole = isinstance(delay, int | np.integer) and not isinstance(delay, bool)
    if not whole or not 0 <= delay <= LONGEST_DELAY:
        raise InputError(f"sensors.delay = {delay!r}: must be a whole number from 0 to {LONGEST_DELAY}")
    return {"noise": float(noise), "delay": int(delay)}


def draw_sensors(noise, delay, scales, seed, readings):
    """Sensors of an episode: noise as a fraction of the scales (N_MEASUREMENTS,), by its weather's seed."""
    if noise == 0.0:
        return Sensors(np.zeros((1, N_MEASUREMENTS)), delay)
    rng = np.random.default_rng([seed, NOISE_STREAM])
    return Sensors(noise * scales * rng.normal(size=(readings, N_MEASUREMENTS)), delay)


@kernel
def take_reading(sensors, period, measurement, delay_buffer, reading):
    """Fill the reading (N_MEASUREMENTS,) of a control period from what is measured now; None: it is that.

    delay_buffer: (delay + 1, N_MEASUREMENTS) ring of last measurements; at period 0 all are the first.
    """
    if sensors is None:
        return
    size = delay_buffer.shape[0]
    for row in range(size):
        if period == 0 or row == period % size:
            for i in range(N_MEASUREMENTS):
                delay_buffer[row, i] = measurement[i]
    late = (period + 1) % size
    drawn = min(period, sensors.noise.shape[0] - 1)
    for i in range(N_MEASUREMENTS):
        reading[i] = delay_buffer[late, i] + sensors.noise[drawn, i]
    reading[Measure.TIME] = measurement[Measure.TIME]
