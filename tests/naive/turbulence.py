"""Slow twins of the rotor-averaged turbulence: random pairs of points, and Veers' synthesis on points."""

import numpy as np


def random_points(generator, number):
    """(number, 2) points spread evenly over the unit disk, by rejection."""
    points = generator.uniform(-1.0, 1.0, (2 * number + 100, 2))
    return points[np.hypot(points[:, 0], points[:, 1]) < 1.0][:number]


def pair_averages(kr, generator, number=1_000_000):
    """(average, its error, gradient, its error): disk averages of the coherence over random pairs.

    The gradient is that of b in u ~ u0 + a y/R + b z/R, b = <u z>/<z z> with <z z> = 1/4.
    """
    first, second = random_points(generator, number), random_points(generator, number)
    coherence = np.exp(-kr * np.hypot(*(first - second).T))
    moment = 16.0 * coherence * first[:, 1] * second[:, 1]
    error = 1.0 / np.sqrt(number)
    return coherence.mean(), coherence.std() * error, moment.mean(), moment.std() * error


def iec_coherence(distance, frequency, speed, coherence_length):
    """Exponential coherence of IEC 61400-1, Annex B, written out."""
    return np.exp(
        -12.0 * np.sqrt((frequency * distance / speed) ** 2 + (0.12 * distance / coherence_length) ** 2)
    )


def disk_grid(radius, spacing):
    """(n, 2) points y, z of a square grid inside a disk."""
    half = np.arange(spacing / 2, radius, spacing)
    axis = np.concatenate([-half[::-1], half])
    y, z = np.meshgrid(axis, axis)
    inside = np.hypot(y, z) < radius
    return np.stack([y[inside], z[inside]], axis=1)


def veers(points, frequency, variance, speed, coherence_length, generator, records):
    """(records, n_frequency, n_points) complex amplitudes of u at points, Gaussian, cross-correlated.

    For each frequency the coherence matrix is factored and driven with independent complex noise, so
    that the mean square of an amplitude's modulus is twice the variance in its frequency bin.
    """
    distance = np.hypot(*(points[:, None, :] - points[None, :, :]).transpose(2, 0, 1))
    result = np.empty((records, len(frequency), len(points)), dtype=complex)
    for i, f in enumerate(frequency):
        matrix = iec_coherence(distance, f, speed, coherence_length)
        factor = np.linalg.cholesky(matrix + 1e-12 * np.eye(len(points)))
        noise = generator.normal(size=(2, len(points), records))
        result[:, i] = np.sqrt(variance[i]) * (factor @ (noise[0] + 1j * noise[1])).T
    return result
