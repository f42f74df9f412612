"""Builds the sensors of one run: settings of a chain at the control period, and noise drawn beforehand."""

from math import exp, sqrt

import numpy as np

from fowt_env.descriptions.sensors import SensorChain
from fowt_env.loop.sensing import Sensors, Setting, open_chain
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasurement, Measurement

NOISE_STREAM, BLADE_NOISE_STREAM, DRIFT_STREAM = (
    3,
    4,
    9,
)  # random streams of a run's seed, separate from the weather's


def draw_noise(std: np.ndarray, seed: int, readings: int) -> np.ndarray:
    """Return (readings, n) white noise of standard deviations (n,), by the weather's seed.

    A longer run continues the noise of a shorter one. Fields of BladeMeasurement, which follow the fields of
    Measurement, have a separate stream, so that the noise of Measurement is the same with and without them.
    """
    rng = np.random.default_rng([seed, NOISE_STREAM])
    noise = std[:N_MEASUREMENTS] * rng.normal(size=(readings, N_MEASUREMENTS))
    blades = std[N_MEASUREMENTS:]
    if not blades.size:
        return noise
    rng = np.random.default_rng([seed, BLADE_NOISE_STREAM])
    return np.hstack([noise, blades * rng.normal(size=(readings, blades.size))])


def draw_drift(sensor, field: int, control_dt: float, seed: int, readings: int) -> np.ndarray:
    """Return the (readings,) slow error of the Sensor of a field, by the weather's seed.

    A stationary first-order Gauss-Markov process; a longer run continues the drift of a shorter one.
    """
    kept = exp(-control_dt / sensor.drift_time)
    steps = np.random.default_rng([seed, DRIFT_STREAM, field]).normal(size=readings)
    steps[1:] *= sqrt(1.0 - kept**2)
    from scipy.signal import lfilter  # takes half a second

    return sensor.drift * lfilter([1.0], [1.0, -kept], steps)


def draw_sensors(
    chain: SensorChain | None, control_dt: float, seed: int, readings: int, individual: bool = False
) -> Sensors:
    """Return the Sensors of a run for a number of readings, one per control period (s); None: exact sensors.

    individual: whether the blades have individual pitch, and so a BladeMeasurement. A delay is rounded to the
    nearest whole number of control periods. Fields that the chain lacks are passed unchanged: the caller has
    to hide them.
    """
    fields = Measurement._fields + (BladeMeasurement._fields if individual else ())
    settings = open_chain(len(fields))
    if chain is None:
        return Sensors(settings, np.zeros((0, len(fields))))
    std, drifts = np.zeros(len(fields)), {}
    for name, sensor in chain.sensors.items():
        if name not in fields:
            continue
        i = fields.index(name)
        std[i] = sensor.noise
        if sensor.drift > 0.0:
            drifts[i] = draw_drift(sensor, i, control_dt, seed, readings)
        settings[Setting.DELAY, i] = round(sensor.delay / control_dt)
        settings[Setting.STEP, i] = sensor.step
        if sensor.time_constant > 0.0:
            settings[Setting.KEPT, i] = exp(-control_dt / sensor.time_constant)
        if sensor.integral_of is not None:
            settings[Setting.SOURCE, i] = fields.index(sensor.integral_of)
            settings[Setting.LEFT, i] = exp(-control_dt * sensor.high_pass)
            settings[Setting.PERIOD, i] = control_dt
    if not std.any() and not drifts:
        return Sensors(settings, np.zeros((1, len(fields))))
    noise = draw_noise(std, seed, readings)
    for i, drift in drifts.items():
        noise[:, i] += drift
    return Sensors(settings, noise)
