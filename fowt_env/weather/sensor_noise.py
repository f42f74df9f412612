"""Sensors of one run: a chain's figures at its control period, and its noise, drawn beforehand."""

from math import exp

import numpy as np

from fowt_env.descriptions.sensors import SensorChain
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.plant.sensing import Sensors, Setting, open_chain

NOISE_STREAM = 3  # of a run's seed: apart from that of its weather


def draw_noise(std: np.ndarray, seed: int, readings: int) -> np.ndarray:
    """(readings, N_MEASUREMENTS) white noise of standard deviations (N_MEASUREMENTS,), by the weather's seed.

    A longer run goes on from a shorter one's.
    """
    rng = np.random.default_rng([seed, NOISE_STREAM])
    return std * rng.normal(size=(readings, N_MEASUREMENTS))


def draw_sensors(chain: SensorChain | None, control_dt: float, seed: int, readings: int) -> Sensors:
    """Sensors of a run with so many readings, one per control period (s); None: exact ones.

    A delay counts as the nearest whole number of control periods. Fields that the chain does not have are
    left as they are measured: it is for the caller to hide them.
    """
    settings = open_chain()
    if chain is None:
        return Sensors(settings, np.zeros((0, N_MEASUREMENTS)))
    std = np.zeros(N_MEASUREMENTS)
    for name, sensor in chain.sensors.items():
        i = Measure[name.upper()]
        std[i] = sensor.noise
        settings[Setting.DELAY, i] = round(sensor.delay / control_dt)
        settings[Setting.STEP, i] = sensor.step
        if sensor.time_constant > 0.0:
            settings[Setting.KEPT, i] = exp(-control_dt / sensor.time_constant)
        if sensor.integral_of is not None:
            settings[Setting.SOURCE, i] = Measure[sensor.integral_of.upper()]
            settings[Setting.LEFT, i] = exp(-control_dt * sensor.high_pass)
            settings[Setting.PERIOD, i] = control_dt
    if not std.any():
        return Sensors(settings, np.zeros((1, N_MEASUREMENTS)))
    return Sensors(settings, draw_noise(std, seed, readings))
