"""Sensors of one run: a chain's values at its control period, and its noise, drawn beforehand."""

from math import exp

import numpy as np

from fowt_env.descriptions.sensors import SensorChain
from fowt_env.loop.sensing import Sensors, Setting, open_chain
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasurement, Measurement

NOISE_STREAM, BLADE_NOISE_STREAM = 3, 4  # of a run's seed: apart from that of its weather


def draw_noise(std: np.ndarray, seed: int, readings: int) -> np.ndarray:
    """Return (readings, n) white noise of standard deviations (n,), by the weather's seed.

    A longer run goes on from a shorter one's. Fields of BladeMeasurement, which follow those of Measurement,
    have a stream of their own, so that the noise of the others is the same with and without them.
    """
    rng = np.random.default_rng([seed, NOISE_STREAM])
    noise = std[:N_MEASUREMENTS] * rng.normal(size=(readings, N_MEASUREMENTS))
    others = std[N_MEASUREMENTS:]
    if not others.size:
        return noise
    rng = np.random.default_rng([seed, BLADE_NOISE_STREAM])
    return np.hstack([noise, others * rng.normal(size=(readings, others.size))])


def draw_sensors(
    chain: SensorChain | None, control_dt: float, seed: int, readings: int, individual: bool = False
) -> Sensors:
    """Return the sensors of a run with so many readings, one per control period (s); None: exact ones.

    individual: whether the scene's blades have individual pitch, with a BladeMeasurement to read. A delay
    counts as the nearest whole number of control periods. Fields that the chain does not have are left as
    they are measured: it is for the caller to hide them.
    """
    fields = Measurement._fields + (BladeMeasurement._fields if individual else ())
    settings = open_chain(len(fields))
    if chain is None:
        return Sensors(settings, np.zeros((0, len(fields))))
    std = np.zeros(len(fields))
    for name, sensor in chain.sensors.items():
        if name not in fields:
            continue
        i = fields.index(name)
        std[i] = sensor.noise
        settings[Setting.DELAY, i] = round(sensor.delay / control_dt)
        settings[Setting.STEP, i] = sensor.step
        if sensor.time_constant > 0.0:
            settings[Setting.KEPT, i] = exp(-control_dt / sensor.time_constant)
        if sensor.integral_of is not None:
            settings[Setting.SOURCE, i] = fields.index(sensor.integral_of)
            settings[Setting.LEFT, i] = exp(-control_dt * sensor.high_pass)
            settings[Setting.PERIOD, i] = control_dt
    if not std.any():
        return Sensors(settings, np.zeros((1, len(fields))))
    return Sensors(settings, draw_noise(std, seed, readings))
