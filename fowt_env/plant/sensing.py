"""Between plant and controller: sensors, what the controller may know, and the wind that is foreseen.

A measurement has N_MEASUREMENTS fields and, where every blade has a pitch of its own, those of
BladeMeasurement after them. In a reading the wind that is foreseen stands between the two.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.compile.handle import by_reference
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure

GIVEN, HIDDEN = -0.0, np.nan  # what is added to a field; minus zero leaves every bit, the sign of zero too


class Setting(IntEnum):
    """Rows of Sensors.chain."""

    HIDDEN = 0  # GIVEN or HIDDEN
    DELAY = 1  # control periods from measurement to reading
    KEPT = 2  # fraction of the old value that a first-order low pass leaves in a control period; 0: none
    STEP = 3  # of the quantisation, SI; 0: none
    SOURCE = 4  # field whose reading is integrated; the field itself: it is measured
    LEFT = 5  # fraction of an integral that its high pass leaves in a control period
    PERIOD = 6  # s, control period of an integral


class Sensors(NamedTuple):
    """What stays fixed in a run: noise is drawn beforehand, so that a snapshot needs no generator."""

    chain: np.ndarray  # (len(Setting), n) of the n fields of a measurement
    noise: np.ndarray  # (readings, n), SI; the last row goes on; no row: exact sensors


class NacelleMotion(NamedTuple):
    """What the nacelle's fore-aft velocity adds to the wind ahead of a lidar on it, at the control period.

    taps of no column: nothing. weight (3,): y = weight[0] y before + weight[1] velocity before + weight[2]
    velocity is a low pass of the velocity between two control instants; the preview j is changed by
    -sum(taps[j, m] y) of m control periods ago.
    """

    taps: np.ndarray  # (leads, m)
    weight: np.ndarray
    past: np.ndarray  # (m + 1,) ring of y, then the last velocity


@by_reference
class Reader(NamedTuple):
    """Sensors of a run with their memory, and the wind ahead."""

    sensors: Sensors
    past: np.ndarray  # see new_past
    preview_time: np.ndarray  # (k,) s, increasing
    preview: np.ndarray  # (leads, k) rotor-averaged wind read at these times, m/s
    motion: NacelleMotion
    reading: np.ndarray  # (n + leads,) of the present control instant


def open_chain(size: int = N_MEASUREMENTS) -> np.ndarray:
    """Sensors.chain of exact sensors of so many fields that hide nothing."""
    chain = np.zeros((len(Setting), size))
    chain[Setting.HIDDEN] = GIVEN
    chain[Setting.SOURCE] = np.arange(size)
    return chain


def new_past(chain: np.ndarray) -> np.ndarray:
    """Memory of a chain: a ring of (longest delay + 1) measurements, the low passes, the integrals."""
    return np.zeros((int(chain[Setting.DELAY].max()) + 3, chain.shape[1]))


def open_reader(size: int = N_MEASUREMENTS) -> Reader:
    """Reader of everything that is measured, as it is, and of no wind ahead."""
    chain = open_chain(size)
    sensors = Sensors(chain, np.zeros((0, size)))
    return Reader(sensors, new_past(chain), np.zeros(0), np.zeros((0, 0)), no_motion(), np.zeros(size))


def no_motion() -> NacelleMotion:
    """NacelleMotion of a preview that it does not get into."""
    return NacelleMotion(np.zeros((0, 0)), np.zeros(3), np.zeros(1))


@kernel
def place_of(field, ahead):
    """Index in a reading of a field of the measurement; ahead: how many times the wind is foreseen for."""
    return field if field < N_MEASUREMENTS else field + ahead


@kernel
def take_reading(sensors, period, measurement, past, reading):
    """Fill the reading of a control period from what is measured now; sensors None: it is that.

    Low pass, delay, noise and quantisation, in this order. period counts control instants from 0, where every
    memory starts at what is measured then; asking again for period 0 gives the same. past: new_past.
    """
    if sensors is None:
        return
    chain = sensors.chain
    n = chain.shape[1]
    ahead = reading.shape[0] - n
    if sensors.noise.shape[0] == 0:
        for i in range(n):
            reading[place_of(i, ahead)] = measurement[i] + chain[Setting.HIDDEN, i]
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
        reading[place_of(i, ahead)] = value
    reading[Measure.TIME] = measurement[Measure.TIME]
    for i in range(n):
        source = int(chain[Setting.SOURCE, i])
        if source != i:
            value = 0.0  # a mean velocity is none that an accelerometer sees
            if period > 0:
                value = chain[Setting.LEFT, i] * past[size + 1, i]
                value += chain[Setting.PERIOD, i] * reading[place_of(source, ahead)]
            past[size + 1, i] = value
            reading[place_of(i, ahead)] = value
    for i in range(n):
        reading[place_of(i, ahead)] += chain[Setting.HIDDEN, i]


@kernel
def read_preview(t, time, preview, reading):
    """Fill what follows the measurements in a reading with the wind foreseen at t; ends are held."""
    if preview.shape[0] == 0:
        return
    last = time.shape[0] - 1
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if time[middle] <= t:
            low = middle
        else:
            high = middle
    fraction = 0.0
    if t >= time[high]:
        fraction = 1.0
    elif t > time[low]:
        fraction = (t - time[low]) / (time[high] - time[low])
    for j in range(preview.shape[0]):
        reading[N_MEASUREMENTS + j] = (1.0 - fraction) * preview[j, low] + fraction * preview[j, high]


@kernel
def add_motion(motion, period, velocity, reading):
    """Change the wind ahead in a reading by the nacelle's velocity (m/s), up to this control period.

    Before period 0 it is what it is then.
    """
    size = motion.taps.shape[1]
    if size == 0:
        return
    past, weight = motion.past, motion.weight
    if period == 0:
        for m in range(size):
            past[m] = velocity
    else:
        before = past[(period - 1) % size]
        past[period % size] = weight[0] * before + weight[1] * past[size] + weight[2] * velocity
    past[size] = velocity
    for j in range(motion.taps.shape[0]):
        total = 0.0
        for m in range(size):
            total += motion.taps[j, m] * past[(period - m) % size]
        reading[N_MEASUREMENTS + j] -= total


@kernel
def read(reader, period, t, measurement):
    """Fill the reader's reading of a control period, which begins at time t (s)."""
    take_reading(reader.sensors, period, measurement, reader.past, reader.reading)
    read_preview(t, reader.preview_time, reader.preview, reader.reading)
    add_motion(reader.motion, period, measurement[Measure.NACELLE_VELOCITY], reader.reading)
