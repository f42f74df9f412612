"""Slow twin of a lidar's estimate: a field drawn at every point that matters, and beams that take turns."""

import numpy as np


def field(place, frequency, variance, speed, coherence_length, evolution, generator, records):
    """(records, 3, n_frequency, n) complex amplitudes of u, v, w at points, due at the rotor; Gaussian.

    place (n, 3): upwind, y, z, m. variance (3, n_frequency) in the bins. The root coherence of two points is
    the IEC's across the wind times exp(-a/2 sqrt((f d/V)^2 + (b d)^2)) along it.
    """
    a, b = evolution
    gap = place[:, None, :] - place[None, :, :]
    across, along = np.hypot(gap[..., 1], gap[..., 2]), np.abs(gap[..., 0])
    found = np.empty((records, 3, frequency.size, len(place)), dtype=complex)
    for i, f in enumerate(frequency):
        k = 12.0 * np.sqrt((f / speed) ** 2 + (0.12 / coherence_length) ** 2)
        matrix = np.exp(-k * across - 0.5 * a * np.sqrt((f * along / speed) ** 2 + (b * along) ** 2))
        factor = np.linalg.cholesky(matrix + 1e-10 * np.eye(len(place)))
        noise = generator.normal(size=(2, records, 3, len(place)))
        drawn = (noise[0] + 1j * noise[1]) @ factor.T
        found[:, :, i] = np.sqrt(variance[:, i])[None, :, None] * drawn
    return found


def series(amplitude, frequency, count, shift=0.0):
    """(count,) real series over a period of amplitudes (n,) at the first n frequencies, advanced by s."""
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    spectrum[1 : 1 + frequency.size] = 0.5 * count * amplitude * np.exp(2j * np.pi * frequency * shift)
    return np.fft.irfft(spectrum, count)


def last_values(value):
    """The values with each NaN replaced by the last number before it; round the corner at the start."""
    known = np.flatnonzero(~np.isnan(value))
    return value[known[np.searchsorted(known, np.arange(value.size), side="right") - 1]]


def rotor_and_lidar(
    amplitude, frequency, place, beams, disc, distance, speed, count, blocked, motion, generator
):
    """(2, count) mean wind of the disc, and mean of the last value of every beam put where it is due.

    amplitude (3, n_frequency, n) of points at place: first those of the disc, then beam by beam those along
    each. beams: of each, its points' weights, its cosine to the wind, its slopes in y and z. The beams take
    turns, one at each instant, and hold their last value; blocked: chance that a shot is lost. motion
    (count,): velocity of the lidar, downwind. distance: at which the wind is taken to be measured, m.
    """
    step = 1.0 / (frequency[0] * count)
    rotor = np.mean([series(amplitude[0, :, i], frequency, count) for i in range(disc)], axis=0)
    lost = generator.uniform(size=count) < blocked
    held, first = [], disc
    for number, (weights, cosine, slope_y, slope_z) in enumerate(beams):
        line_of_sight = -cosine * motion
        for weight in weights:
            u, v, w = (series(a[:, first], frequency, count, place[first, 0] / speed) for a in amplitude)
            line_of_sight = line_of_sight + weight * cosine * (u - slope_y * v - slope_z * w)
            first += 1
        value = line_of_sight / cosine
        value[lost | (np.arange(count) % len(beams) != number)] = np.nan
        held.append(last_values(value))
    return np.array([rotor, np.roll(np.mean(held, axis=0), int(round(distance / speed / step)))])
