"""Generates turbulent wind of IEC 61400-1 (Kaimal spectrum, exponential coherence) averaged over the rotor.

A hub-point series applied to the whole disk overestimates the turbulence of a rotor, because gusts smaller
than the rotor average out. The point spectrum is therefore multiplied by the coherence averaged over all
pairs of points of the disk, (A22) of theory.md; gradients of u follow from pairs weighted with their
positions. With the coherence exp(-k r), k = 12 sqrt((f/V)^2 + (0.12/Lc)^2), Lc = 8.1 Lambda_1 (Annex B), the
averages are functions of k R alone: one table serves every rotor, wind speed and frequency.

Assumptions that the standard does not specify:
- Area weighting. With weights chord x radius, to which thrust and torque respond at constant rotor speed, the
  wind over the NREL 5 MW in a TurbSim box (18 m/s, class B) deviates 2 to 3 % more.
- The mean over azimuth and radius has no multiples of the blade-passing frequency.
- v and w have the coherence of u, and are independent of u.
- Only the phases are random: the point series has the standard deviation sigma_1 over its period. sigma_1 is
  the standard's 90 % quantile in every seed, or drawn from its distribution (drawn_ntm_sigma).
"""

import numpy as np
from scipy.fft import next_fast_len

from fowt_env.caches import cached
from fowt_env.descriptions.iec import etm_sigma, length_scale, ntm_sigma, ntm_sigma_at

LENGTH_RATIO = np.array([8.1, 2.7, 0.66])  # L_u, L_v, L_w over Lambda_1 (IEC Annex B)
SIGMA_RATIO = np.array([1.0, 0.8, 0.5])  # sigma of u, v, w over sigma_1 (IEC Annex B)
COHERENCE_DECAY = 12.0
COHERENCE_OFFSET = 0.12
SHORTEST_PERIOD = 600.0  # s; sigma_1 is defined over 10 min: shorter records would exaggerate fast gusts
STEP = 0.1  # s
OWN_PHASES = 5  # first random generator of a point's part uncorrelated with the disc (0 to 4: turbulence)
SIGMA_STREAM = 8  # random generator of a drawn sigma_1 (OWN_PHASES has 5 to 7)
TABLE_RANGE = (1e-6, 1e4)  # of k R; outside, the averages are 1 and 0 to 1e-6 and 1e-7
TABLE_SIZE = 2000  # log-spaced; log-log interpolation is then within 1e-5
PAIR_NODES = 200  # quadrature over pair distances, quadratically denser towards 0


@cached(1)
def _pair_tables():
    """Return the logarithms of k R, of the mean coherence of pairs, and of its gradient moment; (n,) each.

    With two points of the disk at distance d = 2 R cos(h), their midpoint lies in the overlap of two
    disks, i.e. two circular segments of half-angle h; area and second moments are elementary. That
    gives the density of d (disk line picking) and the mean scalar product of the two positions.
    """
    s, weight = np.polynomial.legendre.leggauss(PAIR_NODES)
    s = 0.5 * (s + 1.0)
    distance = 2.0 * s**2  # in radii
    weight = 0.5 * weight * 4.0 * s
    h = np.arccos(0.5 * distance)
    sine, cosine = np.sin(h), np.cos(h)
    area = h - sine * cosine
    first = 2.0 / 3.0 * sine**3  # moment about the disk's centre, along the distance
    along = 0.25 * (area + 2.0 * sine**3 * cosine) - 2.0 * cosine * first + cosine**2 * area
    across = (3.0 * area - 2.0 * sine**3 * cosine) / 12.0
    density = 2.0 * area * 2.0 * np.pi * distance / np.pi**2
    product = (along + across) / area - 0.25 * distance**2  # mean of rho . rho' over R^2
    log_kr = np.linspace(*np.log(TABLE_RANGE), TABLE_SIZE)
    coherence = np.exp(-np.outer(np.exp(log_kr), distance)) * (density * weight)
    # u ~ u0 + b z/R has b = 4 <u z/R>; <z z'> is half of <rho . rho'> by symmetry
    return log_kr, np.log(coherence.sum(axis=1)), np.log(8.0 * (coherence @ product))


def disk_average(kr):
    """Return the variance of the disk average of u over the point variance, for k R = kr (any shape)."""
    log_kr, mean, _ = _pair_tables()
    return np.exp(np.interp(np.log(kr), log_kr, mean))


def disk_gradient(kr):
    """Return the variance of R times the gradient of u over the point variance, for k R = kr.

    The gradient is the slope along one axis of the plane fitted to u over the disk (area weighting).
    """
    log_kr, _, gradient = _pair_tables()
    return np.exp(np.interp(np.log(kr), log_kr, gradient))


def centre_average(kr):
    """Return the mean coherence of the disc's centre with its points, for k R = kr > 0 (any shape)."""
    kr = np.asarray(kr, dtype=np.float64)
    series = 1.0 - kr * (2.0 / 3.0 - 0.25 * kr)  # for small k R, where the difference below cancels
    exact = -2.0 * (np.expm1(-kr) + kr * np.exp(-kr)) / kr**2
    return np.where(kr < 1e-3, series, exact)


def coherence_wave_number(frequency, speed, height):
    """Return k (1/m) of the coherence exp(-k r) at frequencies (Hz)."""
    coherence_length = LENGTH_RATIO[0] * length_scale(height)
    return COHERENCE_DECAY * np.hypot(frequency / speed, COHERENCE_OFFSET / coherence_length)


def kaimal_spectrum(frequency, speed, sigma, length):
    """Return the one-sided spectrum (m^2/s^2/Hz) with variance sigma^2 and scale L (m), IEC Annex B."""
    return sigma**2 * 4.0 * length / speed / (1.0 + 6.0 * frequency * length / speed) ** (5.0 / 3.0)


def _kaimal_below(frequency, speed, length):
    """Return the fraction of the Kaimal variance below a frequency (the integral of kaimal_spectrum)."""
    return 1.0 - (1.0 + 6.0 * frequency * length / speed) ** (-2.0 / 3.0)


@cached(64)
def amplitudes(speed, sigma, height, diameter, samples, step, average):
    """Return the amplitudes (m/s) of u, v, w, vertical_shear, horizontal_shear at k/(samples step); (5, m).

    The shears are per rotor diameter. average: "rotor", or "point" for the hub point without shears.
    Each frequency bin has the exact integral of the spectrum, scaled so that the point's standard deviation
    over the period is sigma (by 2 %, for energy below 1/period and above the Nyquist frequency).
    """
    frequency = np.arange(samples // 2 + 1) / (samples * step)
    half_bin = 0.5 * frequency[1]
    variance = np.zeros((5, frequency.size))
    inside = slice(1, (samples + 1) // 2)  # neither the mean nor, for even samples, the Nyquist bin
    for row, (length_ratio, sigma_ratio) in enumerate(zip(LENGTH_RATIO, SIGMA_RATIO, strict=True)):
        length = length_ratio * length_scale(height)
        ends = (frequency[inside] + half_bin, frequency[inside] - half_bin)
        above, below = (_kaimal_below(end, speed, length) for end in ends)
        fraction = above - below
        variance[row, inside] = (sigma_ratio * sigma) ** 2 * fraction / fraction.sum()
    if average == "rotor":
        kr = coherence_wave_number(frequency, speed, height) * 0.5 * diameter
        variance[3:] = 4.0 * variance[0] * disk_gradient(kr)  # per diameter, not per radius
        variance[:3] *= disk_average(kr)
    result = np.sqrt(2.0 * variance)
    result.flags.writeable = False
    return result


def fft_length(minimum):
    """Return the smallest even length with no prime factor above 5 that is at least the minimum."""
    return 2 * next_fast_len((minimum + 1) // 2, real=True)


def component_generator(seed, component):
    """Return the random generator of one wind component, independent of those of the other components.

    seed: non-negative int or SeedSequence (unchanged).
    """
    if not isinstance(seed, np.random.SeedSequence):
        seed = np.random.SeedSequence(seed)
    child = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, component))
    return np.random.Generator(np.random.PCG64(child))


def drawn_ntm_sigma(speed, turbulence_class, seed):
    """Return sigma_1 (m/s) of the normal turbulence model, drawn from its log-normal distribution.

    A seed draws one quantile of the distribution from a separate stream (SIGMA_STREAM), so that the phases
    are the same with and without the draw. sigma_1 follows from that quantile and the mean wind: a gusty seed
    is gusty at every wind speed. seed: as in component_generator.
    """
    return ntm_sigma_at(speed, turbulence_class, component_generator(seed, SIGMA_STREAM).normal())


def drawn_sigma(model, speed, values, seed):
    """Return sigma_1 (m/s) of the turbulence model ntm, etm or ewm at a mean speed (m/s).

    values: keys of the wind: class, turbine_class (etm) and sigma (ntm). seed: of a drawn sigma.
    """
    if model == "etm":
        return etm_sigma(speed, values["class"], values["turbine_class"])
    if model == "ewm":
        return 0.11 * speed  # the turbulent extreme wind of IEC 61400-1
    if values["sigma"] == "drawn":
        return drawn_ntm_sigma(speed, values["class"], seed)
    return ntm_sigma(speed, values["class"])


def turbulence(
    speed, sigma, *, height, diameter, period, seed, average="rotor", shear_turbulence=True, step=STEP
):
    """Return (period, value (n + 1, 5)) of one period of turbulence with zero mean; last row = first row.

    Columns as in WindSeries, the shears per rotor diameter; sigma is the standard deviation (m/s) of
    u at a point. The returned period is the requested one (s), rounded up to a length of a fast FFT. The
    phases belong to the frequencies k/period, so another period gives another wind.
    """
    samples = fft_length(int(np.ceil(period / step - 1e-9)))
    amplitude = amplitudes(speed, sigma, height, diameter, samples, step, average)
    used = 5 if average == "rotor" and shear_turbulence else 3
    count = amplitude.shape[1]
    spectrum = [0.5 * samples * amplitude[row] * _phasor(seed, row, count) for row in range(used)]
    return samples * step, _one_period(spectrum, samples, 5)


def hub_turbulence(speed, sigma, *, height, diameter, period, seed, step=STEP):
    """Return (period, value (n + 1, 3)) of turbulence at the hub that matches the disc average turbulence().

    u, v and w have the complete Kaimal spectrum: a part correlated with the disc average, by the mean
    coherence of the centre with the disc, and an independent remainder. Arguments as in turbulence.
    """
    samples = fft_length(int(np.ceil(period / step - 1e-9)))
    point = amplitudes(speed, sigma, height, diameter, samples, step, "point")[:3]
    frequency = np.arange(point.shape[1]) / (samples * step)
    kr = coherence_wave_number(frequency, speed, height) * 0.5 * diameter
    shared = centre_average(kr) / np.sqrt(disk_average(kr))
    rest = np.sqrt(np.maximum(1.0 - shared**2, 0.0))
    spectrum = []
    for row in range(3):
        common, other = (_phasor(seed, component, point.shape[1]) for component in (row, OWN_PHASES + row))
        spectrum.append(0.5 * samples * point[row] * (shared * common + rest * other))
    return samples * step, _one_period(spectrum, samples, 3)


def _phasor(seed, component, count):
    """Return (count,) complex numbers of modulus 1 and random phase."""
    return np.exp(1j * component_generator(seed, component).uniform(0.0, 2.0 * np.pi, count))


def _one_period(spectrum, samples, columns):
    """Return series (samples + 1, columns) of spectra (rows, m), zero in other columns; last row = first."""
    value = np.zeros((samples + 1, columns))
    value[:-1, : len(spectrum)] = np.fft.irfft(spectrum, samples, axis=1).T
    value[-1] = value[0]
    return value
