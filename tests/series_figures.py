"""Figures of two time series that are compared, worked out apart from the code of the validation."""

import numpy as np

TIME = "Time_[s]"


def deviation(mine, wanted):
    """Error (%) of a standard deviation."""
    return 100.0 * (mine.std() / wanted.std() - 1.0)


def rms(mine, wanted):
    """Rms error (%) over the standard deviation of what is wanted."""
    return 100.0 * float(np.sqrt(((mine - wanted) ** 2).sum() / ((wanted - wanted.mean()) ** 2).sum()))


def of_decay(quantity, time, value):
    """Period (s) of four cycles of a decay about 0, or the logarithmic decrement of the first or third."""
    after = np.flatnonzero(np.diff(np.sign(value)))  # last sample before each zero crossing
    if quantity.startswith("period"):
        share = value[after] / (value[after] - value[after + 1])
        at = time[after] + share * (time[1] - time[0])
        return (at[8] - at[0]) / 4.0
    first = 0 if "first" in quantity else 4  # of the half cycles; the first one has begun before t = 0
    parts = np.split(value, after + 1)
    peaks = [part[np.abs(part).argmax()] for part in parts[first : first + 4]]
    return np.log(abs(peaks[1] - peaks[0]) / abs(peaks[3] - peaks[2]))


def harmonic(time, value, omega):
    """Amplitude at omega (rad/s), by least squares beside a drift and the second harmonic."""
    columns = [np.ones_like(time), time, time**2]
    columns += [f(k * omega * time) for k in (1, 2) for f in (np.cos, np.sin)]
    _, _, _, a, b, _, _ = np.linalg.lstsq(np.column_stack(columns), value, rcond=None)[0]
    return np.hypot(a, b)


def in_band(time, value, low, high):
    """Deviation between two frequencies (Hz), up to a factor."""
    transform = np.fft.rfft((value - value.mean()) * np.hanning(len(time)))
    frequency = np.fft.rfftfreq(len(time), time[1] - time[0])
    return np.sqrt((np.abs(transform[(frequency >= low) & (frequency < high)]) ** 2).sum())
