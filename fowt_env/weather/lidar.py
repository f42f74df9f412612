"""Simulates the wind preview of a nacelle lidar with its errors.

The rotor-effective wind is estimated in the usual way (Schlipf, "Lidar-Assisted Control Concepts for Wind
Turbines", PhD thesis, Stuttgart 2015; Guo, Schlipf, Cheng, Wind Energ. Sci. 8, 149, 2023): each line-of-sight
speed is divided by the cosine of its beam, the last measurements of all beams and distances are averaged,
each advanced by its travel time at the mean wind, then filtered and buffered. Sources of error:
- v and w in the line of sight, and the finite number of points in the disc;
- averaging along the beam: Gaussian (pulsed) or Lorentzian (continuous wave);
- evolution of the wind: squared coherence exp(-a sqrt((f d/V)^2 + (b d)^2)) of points d apart along the
  wind, a = 8.4 sigma/V + 0.05 with sigma^2 = sigma_u^2 + sigma_v^2 + sigma_w^2, b = 0.25 L^-1.24 and
  L = 8.1 Lambda_1 (m) (Simley and Pao, American Control Conference 2015, Eq. 7), whose root is multiplied by
  the IEC coherence across the wind (Chen, Guo, Schlipf, Cheng, Wind Energ. Sci. 7, 539, 2022);
- sequential beams, each value held until the next shot, and shots blocked by passing blades;
- the low pass with its corner where the transfer function S_RL/S_LL falls below 1 by 3 dB, and its delay;
- the power law at the measured points. The motion of the nacelle adds to each line of sight (Motion).

In a rotor-averaged wind R the estimate is L(f) = (S_RL/S_RR) R(f) + N(f) with noise N of the spectrum
S_LL - |S_RL|^2/S_RR from a separate random stream. A box of wind is sampled along the beams and evolves in
addition. Gusts, steps and user series are uniform over the disc and do not evolve.

Omitted: induction zone, yaw misalignment, tilt of the beams, drift and sideways motion, line-of-sight noise.
"""

from bisect import bisect_left
from typing import NamedTuple

import numpy as np

from fowt_env.caches import cached
from fowt_env.descriptions.checks import check_whole_number
from fowt_env.descriptions.iec import length_scale, ntm_sigma
from fowt_env.descriptions.lidar import read_lidar
from fowt_env.errors import InputError
from fowt_env.plant.aero.wind import LOWEST_HEIGHT
from fowt_env.plant.aero.wind_field import field_at
from fowt_env.plant.compile.decorators import kernel
from fowt_env.weather.preview import Motion, check_times, rotor_wind_series, series_ahead
from fowt_env.weather.turbulence import (
    LENGTH_RATIO,
    SIGMA_RATIO,
    amplitudes,
    coherence_wave_number,
    component_generator,
    disk_average,
    kaimal_spectrum,
)
from fowt_env.weather.wind import drawn_turbulence
from fowt_env.weather.wind_field import WindBox

LIDAR_STREAM = 16  # random generator of the noise N (16), and of held shots (17)
BEAM_NODES = np.arange(-5.0, 6.0)  # along a beam, in units of z_R or of a quarter of the pulse length
FREQUENCIES = np.geomspace(1e-4, 5.0, 120)  # Hz
DISK_NODES = 60  # in each part of a disc seen from a point
TUNING_CLASS = "B"  # turbulence class for which the filter is designed, whatever the actual class
TUNING_PERIOD = 600.0  # s of wind in the design of the filter
TUNING_HIGHEST = 1.0  # Hz
MINUS_3_DB = 10.0 ** (-3.0 / 20.0)
LEADS = np.arange(0.0, 60.0, 0.05)  # s; candidate delays of the filter
SLOWEST = 1.0  # m/s of mean wind
LEAST_INSIDE = 0.8  # smallest sum of a lidar's weights inside a box of wind
STEP = 0.1  # s between values of a wind resampled to even times
SETTLING = 300.0  # s added at both ends of such a wind for the transients of the filter


class Points(NamedTuple):
    """Holds the measured points of a lidar, (n,) each; y and z from the rotor's centre."""

    upwind: np.ndarray  # m from the rotor plane
    late: np.ndarray  # m behind the nominal distance of the measurement
    y: np.ndarray
    z: np.ndarray
    weight: np.ndarray  # sum 1
    across: np.ndarray  # factor of v in the estimate of u
    up: np.ndarray  # factor of w in the estimate of u
    beam: np.ndarray  # index
    gate: np.ndarray  # index of the distance


class Shares(NamedTuple):
    """Holds spectra of lidar and rotor divided by the spectra of a point, at FREQUENCIES."""

    rotor: np.ndarray  # (m,) S_RR over S_u
    cross: np.ndarray  # (m,) complex S_RL over S_u, with the lidar's wind advanced to the rotor
    own: np.ndarray  # (3, m) contributions of S_u, S_v, S_w to S_LL


class Tuning(NamedTuple):
    """Holds the filter of a lidar in a mean wind."""

    first: int  # index of the nearest used distance; all farther distances are used too
    corner: float  # rad/s; inf: none
    lead: float  # s, delay of sampling and low pass
    horizon: float  # s, longest preview time
    error: float  # m/s, expected standard deviation of the difference from the rotor's wind


def directions(lidar):
    """Return (slope y, slope z) (n,) of each beam per distance along the wind."""
    if lidar.beams is not None:
        angle = 2.0 * np.pi * np.arange(lidar.beams) / lidar.beams
        slope = np.tan(np.radians(lidar.half_angle))
        return slope * np.cos(angle), slope * np.sin(angle)
    azimuth, elevation = np.radians(lidar.azimuth), np.radians(lidar.elevation)
    return np.tan(azimuth), np.tan(elevation) / np.cos(azimuth)


def beam_weights(lidar, length):
    """Return (offset m, weight) (k,) of the probe volume along a beam about a range `length` (m)."""
    if lidar.pulse_length is not None:
        offset = 0.25 * lidar.pulse_length * BEAM_NODES
        weight = np.exp(-4.0 * np.log(2.0) * (offset / lidar.pulse_length) ** 2)
    elif lidar.lens_radius is not None:
        offset = lidar.wavelength * length**2 / (np.pi * lidar.lens_radius**2) * BEAM_NODES
        weight = 1.0 / (1.0 + BEAM_NODES**2)
    else:
        offset, weight = np.zeros(1), np.ones(1)
    kept = offset > -length
    return offset[kept], weight[kept] / weight[kept].sum()


@cached(64)
def points(lidar, first=0):
    """Return the Points of a lidar that uses its distances from the index `first` onwards."""
    parts = []
    distances = lidar.distances[first:]
    slopes = np.stack(directions(lidar), axis=1)
    for beam, (slope_y, slope_z) in enumerate(slopes):
        stretch = np.sqrt(1.0 + slope_y**2 + slope_z**2)  # range over distance along the wind
        for gate, distance in enumerate(distances):
            offset, weight = beam_weights(lidar, distance * stretch)
            along = distance + offset / stretch
            position = (slope_y * along, slope_z * along + lidar.above_shaft)
            weight = weight / (len(slopes) * len(distances))
            cross = np.outer([-slope_y, -slope_z], np.ones(along.size))
            upwind = along - (lidar.behind_rotor or 0.0)
            index = np.multiply.outer([beam, gate], np.ones(along.size, dtype=int))
            parts.append([upwind, along - distance, *position, weight, *cross, *index])
    return Points(*np.concatenate(parts, axis=1))


def evolution(speed, sigma, height):
    """Return (a, b in 1/m) of the coherence along the wind (Simley and Pao 2015); sigma of u, m/s."""
    total = sigma * np.sqrt((SIGMA_RATIO**2).sum())
    return 8.4 * total / speed + 0.05, 0.25 * (LENGTH_RATIO[0] * length_scale(height)) ** -1.24


def _along(frequency, distance, speed, a, b):
    """Return the root coherence (m, n) at frequencies (m,) Hz of points (n,) m apart along the wind."""
    return np.exp(-0.5 * a * np.hypot(np.multiply.outer(frequency / speed, distance), b * distance))


@cached(1)
def _nodes():
    """Return (node, weight) of Gauss quadrature from 0 to 1."""
    node, weight = np.polynomial.legendre.leggauss(DISK_NODES)
    return 0.5 * (node + 1.0), 0.5 * weight


def disk_coherence(k, distance, radius):
    """Return the mean (m,) of exp(-k r) over a disc, r from a point at a distance from the disc's centre.

    k (m,) 1/m, lengths in m. The quadrature uses rings about the point; radius 0: the centre alone.
    """
    if radius == 0.0:
        return np.exp(-k * distance)
    node, weight = _nodes()
    edge = abs(radius - distance)
    total = np.zeros(k.size)
    if distance < radius:
        r = edge * node**2
        total += np.exp(-np.outer(k, r)) @ (2.0 * np.pi * r * 2.0 * node * edge * weight)
    if distance > 0.0:
        span = radius + distance - edge
        r = edge + 0.5 * span * (1.0 - np.cos(np.pi * node))
        arc = np.arccos(np.clip((r**2 + distance**2 - radius**2) / (2.0 * r * distance), -1.0, 1.0))
        ring = 2.0 * arc * r * 0.5 * np.pi * np.sin(np.pi * node) * span * weight
        total += np.exp(-np.outer(k, r)) @ ring
    return total / (np.pi * radius**2)


@cached(64)
def _pairs(lidar, first):
    """Return (distance across, along, late, weight (3, n)) of pairs of points, merged if equal to 1 mm.

    late: difference of Points.late, m. weight: of S_u, S_v, S_w in the lidar's spectrum.
    """
    p = points(lidar, first)
    i, j = (index.ravel() for index in np.indices((p.y.size, p.y.size)))
    apart = [np.hypot(p.y[i] - p.y[j], p.z[i] - p.z[j]), p.upwind[i] - p.upwind[j], p.late[i] - p.late[j]]
    key = np.zeros(i.size, dtype=np.int64)
    for distance in apart:
        key = key * 2**21 + np.round(1000.0 * np.abs(distance)).astype(np.int64)
    _, one, group = np.unique(key, return_index=True, return_inverse=True)
    both = p.weight[i] * p.weight[j]
    products = (np.ones(i.size), p.across[i] * p.across[j], p.up[i] * p.up[j])
    weight = np.array([np.bincount(group, both * product) for product in products])
    return *(np.abs(distance[one]) for distance in apart), weight


@cached(64)
def shares(lidar, first, speed, sigma, height, radius, evolves=True):
    """Return the Shares of a lidar that uses its distances from `first` onwards; sigma of u at a point, m/s.

    radius: of the rotor, m; 0: the wind at the centre is uniform over the disc.
    """
    f, p = FREQUENCIES, points(lidar, first)
    k, omega = coherence_wave_number(f, speed, height), 2.0 * np.pi * f
    a, b = evolution(speed, sigma, height) if evolves else (0.0, 0.0)
    # points at the same distance from the centre have the same coherence with the disc
    from_centre, which = np.unique(np.round(np.hypot(p.y, p.z), 4), return_inverse=True)
    disc = np.array([disk_coherence(k, distance, radius) for distance in from_centre])
    turned = np.exp(1j * np.outer(omega, p.late / speed))
    cross = ((disc[which].T * turned * _along(f, p.upwind, speed, a, b)) * p.weight).sum(axis=1)
    across, along, late, weight = _pairs(lidar, first)
    pair = np.exp(-np.outer(k, across)) * _along(f, along, speed, a, b)
    pair = pair * np.cos(np.outer(omega, late / speed))
    auto = np.array([pair @ row for row in weight])
    rotor = disk_average(k * radius) if radius > 0.0 else np.ones(f.size)
    return Shares(rotor, cross, auto)


def at_frequencies(values, frequency):
    """Interpolate values (..., m) of Shares at frequencies (n,) Hz, linearly in log frequency."""
    position = np.interp(np.log(frequency), np.log(FREQUENCIES), np.arange(FREQUENCIES.size))
    low = np.minimum(position.astype(int), FREQUENCIES.size - 2)
    part = position - low
    return (1.0 - part) * values[..., low] + part * values[..., low + 1]


def lidar_spectra(lidar, frequency, speed, sigma, height, radius, first=0, evolves=True):
    """Return spectra (S_RR, complex S_RL, S_LL), m^2/s^2/Hz, of rotor mean and lidar at frequencies (n,) Hz.

    The estimate is unfiltered and advanced to the rotor. Arguments as in shares.
    """
    ratios, scale = zip(SIGMA_RATIO, LENGTH_RATIO, strict=True), length_scale(height)
    point = np.array([kaimal_spectrum(frequency, speed, r * sigma, length * scale) for r, length in ratios])
    return _times(shares(lidar, first, speed, sigma, height, radius, evolves), frequency, point)


def _times(ratios, frequency, point):
    """Return (S_RR, S_RL, S_LL) of Shares at frequencies (n,) with spectra or variances (3, n) of a point."""
    rotor, cross, auto = (at_frequencies(values, frequency) for values in ratios)
    return rotor * point[0], cross * point[0], (auto * point).sum(axis=0)


def blocked_share(lidar, rotor, blade):
    """Return the fraction of shots that passing blades block, averaged over the beams.

    A blade blocks the azimuths of its chord at the radius where the beam crosses the rotor plane.
    """
    if lidar.behind_rotor is None:
        return 0.0
    slope_y, slope_z = directions(lidar)
    behind = lidar.behind_rotor
    r = np.maximum(np.hypot(slope_y * behind, lidar.above_shaft + slope_z * behind), 1e-9)
    half = np.arcsin(np.minimum(0.5 * np.interp(r, blade.radius, blade.chord) / r, 1.0))
    return float(np.minimum(rotor.blades * half / np.pi, 1.0).mean())


def sampling(lidar, blocked, frequency):
    """Return the complex gain (n,) of sample and hold over one scan, or longer if the next shots are blocked.

    A beam with randomly blocked shots holds a value for a geometric number of scans.
    """
    phase = 2.0 * np.pi * frequency * lidar.scan_period
    hold = np.sinc(frequency * lidar.scan_period) * np.exp(-0.5j * phase)
    return hold * (1.0 - blocked) / (1.0 - blocked * np.exp(-1j * phase))


def low_pass(frequency, corner):
    """Return the complex gain (n,) of a first-order low pass with a corner (rad/s)."""
    return 1.0 / (1.0 + 2j * np.pi * frequency / corner)


@cached(256)
def tuning(lidar, first, speed, height, radius, blocked):
    """Return the Tuning of a lidar that uses its distances from `first` onwards, for turbulence of class B.

    blocked: fraction of blocked shots. radius as in shares.
    """
    frequency = np.arange(1, int(TUNING_HIGHEST * TUNING_PERIOD)) / TUNING_PERIOD
    sigma = ntm_sigma(speed, TUNING_CLASS)
    samples = int(round(TUNING_PERIOD / STEP))
    point = amplitudes(speed, sigma, height, 2.0 * radius, samples, STEP, "point")
    variance = 0.5 * point[:3, 1 : frequency.size + 1] ** 2
    ratios = shares(lidar, first, speed, sigma, height, radius)
    rotor, cross, auto = _times(ratios, frequency, variance)
    gain = np.abs(cross) / auto
    below = np.flatnonzero(gain < MINUS_3_DB)
    corner = np.inf
    if below.size:
        near = slice(max(below[0] - 1, 0), below[0] + 1)
        corner = 2.0 * np.pi * np.interp(-MINUS_3_DB, -gain[near], frequency[near])
    passed = low_pass(frequency, corner)
    gain = sampling(lidar, blocked, frequency) * passed
    turn = 2.0 * np.pi * np.outer(LEADS, frequency)
    common = np.cos(turn) @ (gain * cross).real - np.sin(turn) @ (gain * cross).imag
    lead = float(LEADS[np.argmax(common)])
    mse = rotor + np.abs(gain) ** 2 * auto + np.abs(passed) ** 2 * held_noise(lidar, blocked, frequency, auto)
    error = np.sqrt(max(mse.sum() - 2.0 * common.max(), 0.0))
    travel = (lidar.distances[first] - (lidar.behind_rotor or 0.0)) / speed
    return Tuning(first, float(corner), lead, travel - lead, float(error))


def held_noise(lidar, blocked, frequency, variance):
    """Return the aliased variance (n,) in bins at k/period; its sum is the variance that sampling removes.

    The spectrum is that of independent values, each held for a geometric number of scans.
    """
    if lidar.scan_period == 0.0:
        return np.zeros(frequency.size)
    passed = np.abs(sampling(lidar, blocked, frequency)) ** 2
    spread = 2.0 * lidar.scan_period * (1.0 + blocked) / (1.0 - blocked) * passed
    return ((1.0 - passed) * variance).sum() * spread * frequency[0]


def lidar_horizon(scene, preset="four_beam_pulsed"):
    """Return the longest preview time (s) of a lidar in a scene, set by the farthest distance.

    preset: as in lidar_preview. Raises: InputError for a scene without wind.
    """
    lidar, site = placed(scene, preset)
    return tuning(lidar, len(lidar.distances) - 1, *site).horizon


def lidar_tuning(scene, preset="four_beam_pulsed", ahead=0.0):
    """Return the Tuning of a lidar in the mean wind of a scene for a preview time `ahead` (s).

    The filter averages all distances with a sufficient preview time. preset: as in lidar_preview.
    Raises: InputError for a longer time than that of the farthest distance, and for a scene without wind.
    """
    lidar, site = placed(scene, preset)
    last = len(lidar.distances) - 1
    horizon = tuning(lidar, last, *site).horizon
    if ahead > horizon:
        raise InputError(
            f"preview_times: {ahead:g} s ahead: must be <= {max(horizon, 0.0):.3g} s, the horizon of lidar"
            f" {lidar.name!r} at {site[0]:g} m/s"
        )
    first = bisect_left(range(last), True, key=lambda first: tuning(lidar, first, *site).horizon >= ahead)
    return tuning(lidar, first, *site)


def placed(scene, preset):
    """Return (Lidar, further arguments of tuning) of a lidar in a scene. Raises: InputError."""
    lidar = read_lidar(preset)
    if scene.model.aero is None:
        raise InputError(f"lidar {lidar.name!r}: needs a scene with wind to look ahead")
    # the speed at which gusts travel to the rotor
    speed = float(scene.wind.speed if isinstance(scene.wind, WindBox) else scene.wind_speed)
    if speed < SLOWEST:
        raise InputError(f"lidar {lidar.name!r}: mean wind = {speed:g}: must be >= {SLOWEST:g} m/s")
    rotor = scene.turbine.rotor
    blocked = blocked_share(lidar, rotor, scene.turbine.blade)
    if blocked > 0.9:
        raise InputError(
            f"lidar {lidar.name!r}: the blades of {scene.turbine.name!r} block {100.0 * blocked:.0f} %"
            " of the shots: must be at most 90 %; change behind_rotor or above_shaft"
        )
    return lidar, (speed, rotor.hub_height, disc_radius(scene), blocked)


def disc_radius(scene):
    """Return the radius (m) of the rotor average; 0 if the wind of a point is uniform over the disc."""
    drawn = drawn_of(scene)
    return 0.0 if drawn is not None and drawn["average"] == "point" else scene.turbine.rotor.tip_radius


def drawn_of(scene):
    """Return the arguments of turbulence() for a scene; None for a wind that is not drawn from spectra."""
    if isinstance(scene.wind, WindBox):
        return None
    rotor, duration = scene.turbine.rotor, scene.options["duration"]
    size = {"reference_height": rotor.hub_height, "rotor_diameter": 2.0 * rotor.tip_radius}
    return drawn_turbulence(scene.wind, **size, seed=scene.seed, duration=duration)


def mean_age(lidar, blocked):
    """Return the mean age of the values in a reading, s; blocked: fraction of lost shots."""
    return lidar.scan_period * (0.5 + blocked / (1.0 - blocked))


def lidar_preview(scene, times, preset="four_beam_pulsed", seed=None):
    """Return the Preview of the rotor-averaged wind at times (k,) s ahead, estimated by a nacelle lidar.

    preset  name of a built-in lidar (descriptions.lidar.lidars), a path to a TOML file with its keys, or a
            Lidar
    seed    of the lidar's noise; None: the seed of the scene
    One filter, designed for the last time, and one buffer serve all times.
    Raises: InputError for times that do not increase from 0 to 600 s or exceed the lidar's horizon in this
    wind, and for a scene without wind.
    """
    times = check_times(times)
    lidar, (speed, _, _, blocked) = placed(scene, preset)
    tuned = lidar_tuning(scene, lidar, times[-1] if times.size else 0.0)
    seed = scene.seed if seed is None else check_whole_number("seed", seed, 0)
    if isinstance(scene.wind, WindBox):
        start, seen, period = _in_box(scene, lidar, tuned, seed)
    elif drawn_of(scene) is not None:
        start, seen, period = _in_turbulence(scene, lidar, tuned, seed)
    else:
        start, seen, period = _uniform(scene, lidar, tuned)
        seed = None
    value = _filtered(start, seen, period, lidar, blocked, tuned, seed)
    distances = np.array(lidar.distances[tuned.first :])
    motion = Motion(
        tuned.corner,
        (distances - distances[0]) / speed + mean_age(lidar, blocked),
        np.full(distances.size, 1.0 / distances.size),
        tuned.horizon - times,
    )
    return series_ahead(scene, start, value, period, times)._replace(motion=motion)


def profile_factor(scene, z, weight):
    """Return the factor (...) on the rotor's series that accounts for the power law at measured points.

    z (n,): heights of the points above the hub, m; weight (..., n), sum 1.
    """
    series = scene.model.aero.wind
    height = np.maximum(series.reference_height + z, LOWEST_HEIGHT)
    seen = weight @ (height / series.reference_height) ** series.shear_exponent
    return 1.0 + seen - series.rotor_factor


def _profile_factor(scene, lidar, tuned):
    p = points(lidar, tuned.first)
    return profile_factor(scene, p.z, p.weight)


def _in_turbulence(scene, lidar, tuned, seed):
    """Return the lidar's unfiltered (time, wind, period) at the rotor, in a wind drawn from spectra."""
    start, wind, period = rotor_wind_series(scene)
    drawn, count = drawn_of(scene), wind.size - 1
    frequency = np.arange(1, count // 2 + 1) / period
    wind_at = (drawn["speed"], drawn["sigma"], drawn["height"])
    ratios = shares(lidar, tuned.first, *wind_at, disc_radius(scene))
    rotor, cross, auto = (at_frequencies(values, frequency) for values in ratios)
    point = amplitudes(*wind_at, 2.0 * scene.turbine.rotor.tip_radius, count, period / count, "point")[:3, 1:]
    variance = 0.5 * point**2
    # negative only by rounding: the coherence is at most 1
    rest = np.maximum((auto * variance).sum(axis=0) - np.abs(cross) ** 2 / rotor * variance[0], 0.0)
    spectrum = np.fft.rfft(wind[:-1])
    spectrum[0] *= _profile_factor(scene, lidar, tuned)
    spectrum[1:] = cross / rotor * spectrum[1:] + _gaussian(rest, count, seed, LIDAR_STREAM)
    return start[:-1], np.fft.irfft(spectrum, count), period


def _gaussian(variance, count, seed, stream):
    """Return Gaussian Fourier coefficients (n,) of a series of `count` values with a variance per bin."""
    drawn = component_generator(seed, stream).normal(size=(2, variance.size))
    return 0.5 * count * np.sqrt(variance) * (drawn[0] + 1j * drawn[1])


def _in_box(scene, lidar, tuned, seed):
    """Return the lidar's unfiltered (time, wind, period) at the rotor, in a box of wind.

    Points outside the grid, such as the far ends of beams in a narrow box, are omitted.
    Raises: InputError if too few points remain.
    """
    box, p = scene.wind, points(lidar, tuned.first)
    hub, speed = scene.turbine.rotor.hub_height, box.speed
    height = hub + p.z
    inside = (np.abs(p.y) <= box.y[-1]) & (height >= box.z[0]) & (height <= box.z[-1])
    if p.weight[inside].sum() < LEAST_INSIDE:
        raise InputError(
            f"wind: the grid from y = {box.y[0]:g} to {box.y[-1]:g} m and z = {box.z[0]:g} to {box.z[-1]:g} m"
            f" must contain at least {LEAST_INSIDE:g} of the weight of the points of lidar {lidar.name!r},"
            f" |y| up to {np.abs(p.y).max():.0f} m and z from {height.min():.0f} to {height.max():.0f} m: it"
            f" contains {p.weight[inside].sum():.2f}"
        )
    weight = p.weight * inside / p.weight[inside].sum()
    seen = np.zeros(box.velocity.shape[0])
    columns = (p.late / speed, p.y, height, weight, p.across, p.up)
    look(box.field(), *(np.ascontiguousarray(column[inside]) for column in columns), seen)
    count, radius = seen.size, scene.turbine.rotor.tip_radius
    frequency = np.arange(1, count // 2 + 1) / (count * box.dt)
    sigma = ntm_sigma(speed, TUNING_CLASS)
    ratios = (shares(lidar, tuned.first, speed, sigma, hub, radius, evolves) for evolves in (True, False))
    evolved, frozen = (at_frequencies(np.abs(each.cross), frequency) for each in ratios)
    kept = np.where(frozen > 1e-12, evolved / np.maximum(frozen, 1e-12), 0.0)
    spectrum = np.fft.rfft(seen)
    variance = 2.0 * np.abs(spectrum[1:] / count) ** 2
    spectrum[1:] = kept * spectrum[1:] + _gaussian((1.0 - kept**2) * variance, count, seed, LIDAR_STREAM)
    time = np.arange(count) * box.dt - box.shift
    return time, np.fft.irfft(spectrum, count), count * box.dt if box.periodic else None


@kernel
def look(field, late, y, z, weight, across, up, seen):
    """Fill seen (n_time,) with the lidar's estimate of u at the rotor, from points of a box (see Points)."""
    for i in range(seen.shape[0]):
        t = i / field.rate - field.shift
        for n in range(y.shape[0]):
            u, v, w = field_at(t + late[n], 0.0, y[n], z[n], field)
            seen[i] += weight[n] * (u + across[n] * v + up[n] * w)


def _uniform(scene, lidar, tuned):
    """Return the lidar's unfiltered (time, wind, period) at even times, in a uniform wind."""
    start, wind, period = rotor_wind_series(scene)
    span = max(start[-1] - start[0], STEP) if period is None else period
    count = int(np.ceil(span / STEP - 1e-9))
    time = start[0] + span / count * np.arange(count + (period is None))
    return time, _profile_factor(scene, lidar, tuned) * np.interp(time, start, wind, period=period), period


def _filtered(time, value, period, lidar, blocked, tuned, seed):
    """Return the wind (n,) at even times (n,) s after sampling and low pass, with the filter delay removed.

    seed: of the aliased noise; None: no noise. A non-periodic wind is extended by its end values.
    """
    count, step = value.size, time[1] - time[0] if time.size > 1 else STEP
    folded = np.zeros(count)
    if seed is not None:
        frequency = np.arange(1, count // 2 + 1) / (count * step)
        variance = 2.0 * np.abs(np.fft.rfft(value)[1:] / count) ** 2
        spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
        spectrum[1:] = _gaussian(
            held_noise(lidar, blocked, frequency, variance), count, seed, LIDAR_STREAM + 1
        )
        folded = np.fft.irfft(spectrum, count)
    margin = 0 if period is not None else int(SETTLING / step)
    value, folded = np.pad(value, margin, mode="edge"), np.pad(folded, margin)
    frequency = np.fft.rfftfreq(value.size, step)
    gain = low_pass(frequency, tuned.corner) * np.exp(2j * np.pi * frequency * tuned.lead)
    spectrum = np.fft.rfft(value) * sampling(lidar, blocked, frequency) + np.fft.rfft(folded)
    return np.fft.irfft(spectrum * gain, value.size)[margin : margin + count]
