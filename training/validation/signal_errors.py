"""Computes decay parameters, harmonics, band energies and rms errors of time series."""

import numpy as np
from scipy.optimize import least_squares

from fowt_env.errors import InputError


def crossings(time, value):
    """Return the times (n,) of the zero crossings of a series, by linear interpolation."""
    at = np.flatnonzero((value[:-1] > 0.0) != (value[1:] > 0.0))
    return time[at] - value[at] * (time[at + 1] - time[at]) / (value[at + 1] - value[at])


def extrema(time, value):
    """Return the extrema (n,) between successive zero crossings, by a parabola through each maximum."""
    edges = np.flatnonzero((value[:-1] > 0.0) != (value[1:] > 0.0)) + 1
    result = []
    for low, high in zip(np.concatenate(([0], edges[:-1])), edges, strict=True):
        i = low + int(np.argmax(np.abs(value[low:high])))
        if 0 < i < len(value) - 1:
            bend = value[i + 1] - 2.0 * value[i] + value[i - 1]
            slope = 0.5 * (value[i + 1] - value[i - 1])
            result.append(value[i] - 0.5 * slope * slope / bend if bend != 0.0 else value[i])
        else:
            result.append(value[i])
    return np.array(result)


def decay_period(time, value, centre, cycles=4):
    """Return the mean period (s) of the first cycles of a decay, from its crossings of a centre value."""
    at = crossings(time, value - centre)
    if len(at) < 2 * cycles + 1:
        raise InputError(f"decay: {len(at)} zero crossings, {2 * cycles + 1} are needed for {cycles} cycles")
    return float((at[2 * cycles] - at[0]) / cycles)


def decay_decrement(time, value, centre, cycle=1):
    """Return the logarithmic decrement of a cycle (from 1), from peak-to-peak values one cycle apart."""
    peaks = extrema(time, value - centre)
    height = np.abs(np.diff(peaks))
    return float(np.log(height[2 * cycle - 2] / height[2 * cycle]))


def ringing(time, value, low, high):
    """Return (Hz, damping ratio) of a damped oscillation between two frequencies (Hz), by least squares.

    Slower motion is fitted by a polynomial of eighth order.
    """
    at = (time - time.mean()) / (0.5 * (time[-1] - time[0]))
    slow = np.polynomial.chebyshev.chebvander(at, 8)
    rest = value - slow @ np.linalg.lstsq(slow, value, rcond=None)[0]
    size = 32 * len(time)
    frequency = np.fft.rfftfreq(size, (time[-1] - time[0]) / (len(time) - 1))
    inside = (frequency >= low) & (frequency <= high)
    largest = np.argmax(np.abs(np.fft.rfft(rest * np.hanning(len(time)), size)) * inside)

    def residual(parameters):
        omega, ratio = parameters
        waves = np.exp((1j - ratio) * omega * (time - time[0]))
        basis = np.column_stack([waves.real, waves.imag, slow])
        return value - basis @ np.linalg.lstsq(basis, value, rcond=None)[0]

    solution = least_squares(residual, [2.0 * np.pi * frequency[largest], 0.005], x_scale=[1e-2, 1e-3]).x
    return float(solution[0] / (2.0 * np.pi)), float(solution[1])


def recovery(time, value, step, settled):
    """Return (level before, level after, overshoot, decay time) of a series with a step at `step` s.

    Level after: mean from `settled` (s). Overshoot: largest signed excess over that level. Decay time (s):
    integral of the excess from its peak, divided by the overshoot; the time constant of an exponential.
    """
    before, after = value[time < step].mean(), value[time >= settled].mean()
    first = np.flatnonzero(time >= step)[0]
    deviation = value[first:] - after
    top = int(np.argmax(deviation * np.sign(after - before)))
    area = np.trapezoid(deviation[top:], time[first + top :])
    return before, after, deviation[top], area / deviation[top]


def normalised_rms(value, reference):
    """Return the rms difference divided by the standard deviation of the reference."""
    value, reference = np.asarray(value), np.asarray(reference)
    return float(np.sqrt(np.mean((value - reference) ** 2)) / np.std(reference))


def harmonics(time, value, omega, count=2):
    """Return complex amplitudes (count,) of harmonics: value ~ Re(sum c_k exp(i k omega t)), omega rad/s.

    Projection with a Hann window: its sidelobes keep a slow transient (surge, 124 s) out of the second
    harmonic. time: whole periods, evenly spaced.
    """
    window = np.hanning(len(time) + 1)[:-1]
    fluctuation = value - np.average(value, weights=window)
    return np.array(
        [
            2.0 * np.sum(window * fluctuation * np.exp(-1j * k * omega * time)) / np.sum(window)
            for k in range(1, count + 1)
        ]
    )


def band_energy(time, value, low, high):
    """Return the variance of a series between two frequencies (Hz): periodogram, Hann window, no mean."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    window = np.hanning(len(time))
    transform = np.fft.rfft((value - np.mean(value)) * window)
    frequency = np.fft.rfftfreq(len(time), step)
    density = 2.0 * np.abs(transform) ** 2 / np.sum(window**2) / len(time)
    return float(density[(frequency >= low) & (frequency < high)].sum())
