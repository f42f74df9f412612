"""Models the sensors between plant and controller, the fields that a controller declares, and the wind ahead.

A measurement has N_MEASUREMENTS fields and, with individual pitch, the fields of BladeMeasurement
after them. The input of a law has the wind ahead between the two.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.wind import interval_at
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure

GIVEN, HIDDEN = -0.0, np.nan  # added to a field; minus zero keeps every bit, also the sign of zero


class Setting(IntEnum):
    """Enumerates the rows of Sensors.chain."""

    HIDDEN = 0  # GIVEN or HIDDEN
    DELAY = 1  # control periods from measurement to reading
    KEPT = 2  # fraction of the old value that a low pass of order 1 keeps over a control period; 0: no filter
    STEP = 3  # quantisation step, SI; 0: none
    SOURCE = 4  # field whose reading is integrated; the field itself: measured directly
    LEFT = 5  # fraction of an integral that its high pass keeps over a control period
    PERIOD = 6  # s, control period, of an integrated field


class Sensors(NamedTuple):
    """Holds the sensors of a run; noise is drawn beforehand, so that a snapshot needs no random generator."""

    chain: np.ndarray  # (len(Setting), n) of the n fields of a measurement
    noise: np.ndarray  # (readings, n), SI; the last row repeats; no row: exact sensors


class WindAhead(NamedTuple):
    """Holds the wind ahead of a run, with the effect of the motion of a lidar on the nacelle.

    taps without columns: no effect. weight (3,): y = weight[0] last y + weight[1] last velocity +
    weight[2] velocity is a low pass of the nacelle's fore-aft velocity between two control instants; the wind
    ahead j changes by -sum(taps[j, m] y) of m control periods ago.
    """

    time: np.ndarray  # (k,) s, increasing
    values: np.ndarray  # (leads, k) rotor-averaged wind read at these times, m/s
    taps: np.ndarray  # (leads, m)
    weight: np.ndarray

    def new_memory(self) -> np.ndarray:
        """Return (m + 1,) zeros: ring buffer of y, then the last velocity."""
        return np.zeros(self.taps.shape[1] + 1)


def open_chain(size: int = N_MEASUREMENTS) -> np.ndarray:
    """Return the Sensors.chain of exact sensors. size: number of measured quantities."""
    chain = np.zeros((len(Setting), size))
    chain[Setting.HIDDEN] = GIVEN
    chain[Setting.SOURCE] = np.arange(size)
    return chain


def new_past(chain: np.ndarray) -> np.ndarray:
    """Return the memory of a chain: ring of (longest delay + 1) measurements, low passes, integrals."""
    return np.zeros((int(chain[Setting.DELAY].max()) + 3, chain.shape[1]))


def open_sensors(size: int = N_MEASUREMENTS) -> Sensors:
    """Return exact Sensors. size: number of measured quantities."""
    return Sensors(open_chain(size), np.zeros((0, size)))


def no_wind_ahead() -> WindAhead:
    """Return the WindAhead of a law without wind ahead."""
    return WindAhead(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(3))


@kernel
def law_index(field, leads):
    """Return the index of a measured quantity in the input of a law. leads: its entries of wind ahead."""
    return field if field < N_MEASUREMENTS else field + leads


@kernel
def take_reading(sensors, period, measurement, past, reading):
    """Fill the reading (n,) of a control period from the measurement (n,); sensors None: both are one array.

    Low pass, delay, noise and quantisation, in this order. period counts control instants from 0, where every
    memory starts at the measurement; a repeated reading in period 0 is the same. past: new_past.
    """
    if sensors is None:
        return
    chain = sensors.chain
    n = chain.shape[1]
    if sensors.noise.shape[0] == 0:
        for i in range(n):
            reading[i] = measurement[i] + chain[Setting.HIDDEN, i]
        return
    size = past.shape[0] - 2
    drawn = min(period, sensors.noise.shape[0] - 1)
    for i in range(n):
        value = measurement[i]
        kept = chain[Setting.KEPT, i]
        if kept > 0.0:
            if period > 0:
                value = kept * past[size, i] + (1.0 - kept) * value
            past[size, i] = value
        if period == 0:
            for row in range(size):
                past[row, i] = value
        past[period % size, i] = value
        late = (period - int(chain[Setting.DELAY, i])) % size
        value = past[late, i] + sensors.noise[drawn, i]
        step = chain[Setting.STEP, i]
        if step > 0.0:
            value = step * np.floor(value / step + 0.5)
        reading[i] = value
    reading[Measure.TIME] = measurement[Measure.TIME]
    for i in range(n):
        source = int(chain[Setting.SOURCE, i])
        if source != i:
            value = 0.0  # an accelerometer cannot observe a constant velocity: the integral starts at zero
            if period > 0:
                value = chain[Setting.LEFT, i] * past[size + 1, i]
                value += chain[Setting.PERIOD, i] * reading[source]
            past[size + 1, i] = value
            reading[i] = value
    for i in range(n):
        reading[i] += chain[Setting.HIDDEN, i]


@kernel
def read_wind_ahead(ahead, t, period, velocity, motion, values, first):
    """Fill values[first:] with the wind ahead at time t (s), for a velocity (m/s) of the nacelle.

    Outside the times the first or last wind holds; before period 0 the velocity is that of period 0.
    """
    if ahead.values.shape[0] == 0:
        return
    time, last = ahead.time, ahead.time.shape[0] - 1
    low = interval_at(time, t)
    high = min(low + 1, last)
    fraction = 0.0
    if t >= time[high]:
        fraction = 1.0
    elif t > time[low]:
        fraction = (t - time[low]) / (time[high] - time[low])
    for j in range(ahead.values.shape[0]):
        values[first + j] = (1.0 - fraction) * ahead.values[j, low] + fraction * ahead.values[j, high]
    size = ahead.taps.shape[1]
    if size == 0:
        return
    weight = ahead.weight
    if period == 0:
        for m in range(size):
            motion[m] = velocity
    else:
        before = motion[(period - 1) % size]
        motion[period % size] = weight[0] * before + weight[1] * motion[size] + weight[2] * velocity
    motion[size] = velocity
    for j in range(ahead.taps.shape[0]):
        total = 0.0
        for m in range(size):
            total += ahead.taps[j, m] * motion[(period - m) % size]
        values[first + j] -= total


@kernel
def inform_law(hidden, ahead, period, t, link):
    """Fill the input of the law in a control period: the fields that it declares, and the wind ahead.

    hidden None: there is no law, and link.law_reading is link.reading.
    """
    if hidden is None:
        return
    leads = ahead.values.shape[0]
    for i in range(link.reading.shape[0]):
        link.law_reading[law_index(i, leads)] = link.reading[i] + hidden[i]
    velocity = link.measurement[Measure.NACELLE_VELOCITY]
    read_wind_ahead(ahead, t, period, velocity, link.motion, link.law_reading, N_MEASUREMENTS)
