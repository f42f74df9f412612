"""Tabulates the wave kinematics at fixed points over the record (theory.md, 5.10).

Frequencies of a drawn sea are evenly spaced, so that the motion at a point is a fast Fourier transform times
a carrier. A regular wave has a table of one period. Rows are interpolated by a cubic through four of them.
"""

from math import ceil, floor, pi
from typing import NamedTuple

import numpy as np
from scipy.fft import fft, next_fast_len

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.hydro.waves import ramp_factor

VELOCITIES, N_WATER = 3, 7  # channels of a point: u, v, w; then du, dv, dw and pressure
POINTS_PER_PERIOD = 12  # of the shortest wave, of error 2e-3; the error of a sea's motion is below 4e-4
FEWEST_ROWS = 256  # of a period: 1e-8 of a regular wave
MOST_BYTES = 256_000_000  # of a table; longer records use the plain sum
LONGEST = 20.0  # records, repeat period of the frequency lattice; above it the plain sum is used
CHUNK = 2_000_000  # complex numbers transformed at once
PHASE_ERROR = 1e-3  # rad: allowed phase drift of a component from the lattice within the record


class WaterSeries(NamedTuple):
    """Holds wave kinematics in rows at the times (row - 1) step; no rows: plain sum of the waves."""

    values: np.ndarray  # (rows, points * channels) float32
    step: float  # s


def no_series():
    """Return a WaterSeries without rows."""
    return WaterSeries(np.zeros((0, 0), dtype=np.float32), 1.0)


def build_water_series(waves, positions, channels, duration):
    """Return the WaterSeries of Waves at positions (n, 3), inertial axes, m, for at least a duration (s).

    channels: VELOCITIES or N_WATER. Without rows where the frequencies lie on no lattice, as those of
    user-defined components may, or where the table would exceed MOST_BYTES.
    """
    omega = waves.omega
    gaps = np.diff(np.unique(omega))
    step = float(gaps.min()) if gaps.size else float(omega[0])
    base = float(omega.min())
    number = np.rint((omega - base) / step)
    period = 2.0 * pi / step
    drift = np.abs(omega - base - number * step).max() * duration
    if drift > PHASE_ERROR or (gaps.size and period > LONGEST * duration):
        return no_series()
    number = number.astype(int)
    most = max(FEWEST_ROWS if gaps.size == 0 else 0, ceil(POINTS_PER_PERIOD * omega.max() / step))
    size = next_fast_len(max(most, int(number.max()) + 1))
    tau = period / size
    periodic = abs(base / step - round(base / step)) * 2.0 * pi * duration / period < PHASE_ERROR
    rows = size if periodic else ceil(duration / tau) + 5
    if 4 * rows * len(positions) * channels > MOST_BYTES:
        return no_series()
    rank = np.arange(rows) - 1
    carrier = np.exp(-1j * base * tau * rank)
    values = np.empty((rows, len(positions) * channels), dtype=np.float32)
    several = max(1, CHUNK // (size * channels))
    for first in range(0, len(positions), several):
        points = positions[first : first + several]
        spectrum = np.zeros((len(points) * channels, size), dtype=complex)
        np.add.at(spectrum, (slice(None), number), motion_amplitudes(waves, points, channels))
        envelope = fft(spectrum, axis=1, overwrite_x=True)
        motion = (envelope[:, rank % size] * carrier).real
        values[:, first * channels : (first + len(points)) * channels] = motion.T
    return WaterSeries(values, tau)


def motion_amplitudes(waves, points, channels):
    """Return (n * channels, components) complex A of the motion Re(A exp(-i omega t)) at points (n, 3)."""
    x, y, z = points[:, 0, None], points[:, 1, None], points[:, 2, None]
    k, omega = waves.wave_number, waves.omega
    turned = np.exp(1j * (k * (x * waves.cos_heading + y * waves.sin_heading) + waves.phase))
    down, up = np.exp(k * z), np.exp(-k * (z + 2.0 * waves.depth))
    even, odd = waves.velocity * (down + up) * turned, waves.velocity * (down - up) * turned
    rows = [even * waves.cos_heading, even * waves.sin_heading, -1j * odd]
    if channels == N_WATER:
        rows += [-1j * omega * row for row in rows]
        rows.append(waves.density * omega / k * even)
    return np.stack(rows, axis=1).reshape(len(points) * channels, -1)


@kernel
def interpolate(t, ramp, series, water):
    """Fill water (points * channels,) with the wave motion at a time, by the cubic through four rows."""
    rows = series.values.shape[0]
    position = t / series.step
    whole = floor(position)
    x = position - whole
    f = ramp_factor(t, ramp) / 6.0
    w0 = -f * x * (x - 1.0) * (x - 2.0)
    w1 = 3.0 * f * (x + 1.0) * (x - 1.0) * (x - 2.0)
    w2 = -3.0 * f * (x + 1.0) * x * (x - 2.0)
    w3 = f * (x + 1.0) * x * (x - 1.0)
    first = int(whole) % rows
    a, b = series.values[first], series.values[(first + 1) % rows]
    c, d = series.values[(first + 2) % rows], series.values[(first + 3) % rows]
    for k in range(a.shape[0]):
        water[k] = w0 * a[k] + w1 * b[k] + w2 * c[k] + w3 * d[k]
