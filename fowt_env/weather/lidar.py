"""What a lidar on the nacelle knows of the wind that is on its way to the rotor, with the errors that it has.

The rotor-effective wind is estimated as is usual (Schlipf, "Lidar-Assisted Control Concepts for Wind
Turbines", PhD thesis, Stuttgart 2015; Guo, Schlipf, Cheng, Wind Energ. Sci. 8, 149, 2023): each line-of-sight
speed is taken for u times the cosine of its beam, the last measurements of all beams and distances are
averaged, each advanced by the travel of the wind at its mean speed, then filtered, and buffered until the
wind is due. Errors come from
- v and w in the line of sight, and from seeing some points of the disc instead of all of it;
- the average along the beam: Gaussian (pulsed) or Lorentzian (focused continuous wave);
- wind that evolves on its way: squared coherence exp(-a sqrt((f d/V)^2 + (b d)^2)) of points d apart along
  the wind, a = 8.4 sigma/V + 0.05 with sigma^2 = sigma_u^2 + sigma_v^2 + sigma_w^2 and b = 0.25 L^-1.24 with
  L = 8.1 Lambda_1 (m), of large-eddy simulations: Simley and Pao, American Control Conference 2015, Eq. 7.
  The coherence of two points is the root of this one times the IEC's across the wind (Chen, Guo, Schlipf,
  Cheng, Wind Energ. Sci. 7, 539, 2022);
- one beam after another, each held until its next shot, and shots lost to blades that pass in front;
- the low pass, whose corner is where the transfer function S_RL/S_LL falls below 1 by 3 dB, so that it lets
  through what rotor and lidar have in common; its delay is that with which it follows the rotor best;
- the power law, which the points see elsewhere than the rotor.
The motion of the nacelle along the wind adds to each line of sight at the time of measuring (Motion).

In a rotor-averaged wind the estimate is drawn, given that very wind: with R the rotor's mean and L the
lidar's, L(f) = (S_RL/S_RR) R(f) + N(f), and N, of spectrum S_LL - |S_RL|^2/S_RR, from a stream of the seed
of its own. A box of wind is sampled where the beams look, and evolves in addition. Gusts, steps and series of
the user's are taken to fill the disc and not to evolve.

Left out: the induction zone, yaw misalignment, tilt of the beams with the platform, its drift and sideways
motion, noise of the line-of-sight speed (of a shot, which averaging and filtering make small).
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

LIDAR_STREAM = 16  # random generator of what rotor and lidar do not share (16), and of held shots (17)
BEAM_NODES = np.arange(-5.0, 6.0)  # along a beam, in units of z_R or of a quarter of the pulse length
FREQUENCIES = np.geomspace(1e-4, 5.0, 120)  # Hz
DISK_NODES = 60  # in each part of a disc seen from a point
TUNING_CLASS = "B"  # of the normal turbulence model, for which the filter is made whatever the weather
TUNING_PERIOD = 600.0  # s of wind that the filter is to follow
TUNING_HIGHEST = 1.0  # Hz
MINUS_3_DB = 10.0 ** (-3.0 / 20.0)
LEADS = np.arange(0.0, 60.0, 0.05)  # s; delays of the filter that are looked through
SLOWEST = 1.0  # m/s of mean wind
LEAST_INSIDE = 0.8  # of a lidar's weights that a box of wind must hold
STEP = 0.1  # s between values, where the wind is no even series
SETTLING = 300.0  # s beyond the ends of such a wind, after which the filter has forgotten


class Points(NamedTuple):
    """Where a lidar measures, (n,) each; y and z from the rotor's centre."""

    upwind: np.ndarray  # m from the rotor plane
    late: np.ndarray  # m that the point lies beyond the distance for which it is taken
    y: np.ndarray
    z: np.ndarray
    weight: np.ndarray  # adding up to 1
    across: np.ndarray  # v in what the point is taken to be of u
    up: np.ndarray  # w in it


class Shares(NamedTuple):
    """Shares that the lidar's and the rotor's spectra have in those of a point, at FREQUENCIES."""

    rotor: np.ndarray  # (m,) S_RR over S_u
    cross: np.ndarray  # (m,) complex S_RL over S_u, the lidar's wind taken for due at the rotor
    own: np.ndarray  # (3, m) of S_u, S_v, S_w in S_LL


class Tuning(NamedTuple):
    """The filter of a lidar in a mean wind."""

    first: int  # index of the nearest distance in use; those beyond are in use too
    corner: float  # rad/s; inf: none
    lead: float  # s by which sampling and low pass are late
    horizon: float  # s ahead of which it knows at most
    error: float  # m/s, standard deviation that is expected of the difference to the rotor's wind


def directions(lidar):
    """(slope y, slope z) (n,) of each beam over its distance along the wind."""
    if lidar.beams is not None:
        angle = 2.0 * np.pi * np.arange(lidar.beams) / lidar.beams
        slope = np.tan(np.radians(lidar.half_angle))
        return slope * np.cos(angle), slope * np.sin(angle)
    azimuth, elevation = np.radians(lidar.azimuth), np.radians(lidar.elevation)
    return np.tan(azimuth), np.tan(elevation) / np.cos(azimuth)


def beam_weights(lidar, length):
    """(offset, weight) (k,) along a beam about its range (m): what a measurement averages."""
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
    """Points of a lidar that uses its distances from an index on."""
    found = []
    behind = lidar.behind_rotor or 0.0
    distances = lidar.distances[first:]
    slopes = np.stack(directions(lidar), axis=1)
    for slope_y, slope_z in slopes:
        stretch = np.sqrt(1.0 + slope_y**2 + slope_z**2)  # range over distance along the wind
        for distance in distances:
            offset, weight = beam_weights(lidar, distance * stretch)
            along = distance + offset / stretch
            one = np.ones(along.size)
            found.append(
                [
                    along - behind,
                    along - distance,
                    slope_y * along,
                    slope_z * along + lidar.above_shaft,
                    weight / (len(slopes) * len(distances)),
                    -slope_y * one,
                    -slope_z * one,
                ]
            )
    return Points(*np.concatenate(found, axis=1))


def evolution(speed, sigma, height):
    """(a, b in 1/m) of the coherence along the wind, Simley and Pao (2015); sigma: of u at a point, m/s."""
    total = sigma * np.sqrt((SIGMA_RATIO**2).sum())
    return 8.4 * total / speed + 0.05, 0.25 * (LENGTH_RATIO[0] * length_scale(height)) ** -1.24


def _along(frequency, distance, speed, a, b):
    """(m, n) root coherence of points some distances (n,) m apart along the wind, at frequencies (m,) Hz."""
    return np.exp(-0.5 * a * np.hypot(np.multiply.outer(frequency / speed, distance), b * distance))


@cached(1)
def _nodes():
    """(node, weight) of Gauss's quadrature from 0 to 1."""
    node, weight = np.polynomial.legendre.leggauss(DISK_NODES)
    return 0.5 * (node + 1.0), 0.5 * weight


def disk_coherence(k, distance, radius):
    """(m,) mean over a disc of exp(-k r), r from a point at a distance (m) from its centre; k (m,) 1/m.

    Rings about the point: whole ones, and arcs where they leave the disc; radius 0: the disc is its centre.
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
        total += np.exp(-np.outer(k, r)) @ (
            2.0 * arc * r * 0.5 * np.pi * np.sin(np.pi * node) * span * weight
        )
    return total / (np.pi * radius**2)


@cached(64)
def _pairs(lidar, first):
    """(distance across, along, late, weight (3, n)) of pairs of points, those alike to 1 mm together.

    late: difference of Points.late, m. weight: of S_u, S_v, S_w in the lidar's spectrum.
    """
    p = points(lidar, first)
    i, j = (index.ravel() for index in np.indices((p.y.size, p.y.size)))
    apart = [np.hypot(p.y[i] - p.y[j], p.z[i] - p.z[j]), p.upwind[i] - p.upwind[j], p.late[i] - p.late[j]]
    key = np.zeros(i.size, dtype=np.int64)
    for distance in apart:
        key = key * 2**21 + np.round(1000.0 * np.abs(distance)).astype(np.int64)
    _, one, alike = np.unique(key, return_index=True, return_inverse=True)
    both = p.weight[i] * p.weight[j]
    products = (np.ones(i.size), p.across[i] * p.across[j], p.up[i] * p.up[j])
    weight = np.array([np.bincount(alike, both * product) for product in products])
    return *(np.abs(distance[one]) for distance in apart), weight


@cached(64)
def shares(lidar, first, speed, sigma, height, radius, evolves=True):
    """Shares of a lidar that uses its distances from an index on; sigma: of u at a point, m/s.

    radius: of the rotor, m; 0: the wind over the rotor is that of its centre.
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
    pair = (
        np.exp(-np.outer(k, across)) * _along(f, along, speed, a, b) * np.cos(np.outer(omega, late / speed))
    )
    own = np.array([pair @ row for row in weight])
    rotor = disk_average(k * radius) if radius > 0.0 else np.ones(f.size)
    return Shares(rotor, cross, own)


def at_frequencies(values, frequency):
    """Values (..., m) of Shares at frequencies (n,) Hz, linear over their logarithm, the ends held."""
    place = np.interp(np.log(frequency), np.log(FREQUENCIES), np.arange(FREQUENCIES.size))
    low = np.minimum(place.astype(int), FREQUENCIES.size - 2)
    part = place - low
    return (1.0 - part) * values[..., low] + part * values[..., low + 1]


def lidar_spectra(lidar, frequency, speed, sigma, height, radius, first=0, evolves=True):
    """(S_RR, complex S_RL, S_LL) in m^2/s^2/Hz at frequencies (n,) Hz of rotor's mean and lidar's estimate.

    Before sampling and low pass; the lidar's wind is taken for due at the rotor. Arguments as in shares.
    """
    found = shares(lidar, first, speed, sigma, height, radius, evolves)
    rotor, cross, own = (at_frequencies(values, frequency) for values in found)
    point = _point_spectra(frequency, speed, sigma, height)
    return rotor * point[0], cross * point[0], (own * point).sum(axis=0)


def _point_spectra(frequency, speed, sigma, height):
    """(3, n) spectra of u, v and w at a point, m^2/s^2/Hz."""
    ratios = zip(SIGMA_RATIO, LENGTH_RATIO, strict=True)
    lengths = ((ratio * sigma, scale * length_scale(height)) for ratio, scale in ratios)
    return np.array([kaimal_spectrum(frequency, speed, deviation, length) for deviation, length in lengths])


def blocked_share(lidar, rotor, blade):
    """Share of shots that passing blades take away, mean over the beams.

    That of the azimuths at which a blade lies in front of the beam, flat in the rotor plane and as wide as
    its chord where the beam crosses the plane.
    """
    if lidar.behind_rotor is None:
        return 0.0
    slope_y, slope_z = directions(lidar)
    behind = lidar.behind_rotor
    r = np.maximum(np.hypot(slope_y * behind, lidar.above_shaft + slope_z * behind), 1e-9)
    half = np.arcsin(np.minimum(0.5 * np.interp(r, blade.radius, blade.chord) / r, 1.0))
    return float(np.minimum(rotor.blades * half / np.pi, 1.0).mean())


def sampling(lidar, blocked, frequency):
    """(n,) complex gain of shots that are held for a scan, or for more where the next ones are lost.

    A beam whose shots are lost with a probability holds a value for a geometric number of scans.
    """
    turn = 2.0 * np.pi * frequency * lidar.scan_period
    held = np.sinc(frequency * lidar.scan_period) * np.exp(-0.5j * turn)
    return held * (1.0 - blocked) / (1.0 - blocked * np.exp(-1j * turn))


def low_pass(frequency, corner):
    """(n,) complex gain of a first-order low pass of a corner (rad/s)."""
    return 1.0 / (1.0 + 2j * np.pi * frequency / corner)


@cached(256)
def tuning(lidar, first, speed, height, radius, blocked):
    """Tuning of a lidar that uses its distances from an index on, for turbulence of class B.

    blocked: share of shots lost. radius as in shares.
    """
    frequency = np.arange(1, int(TUNING_HIGHEST * TUNING_PERIOD)) / TUNING_PERIOD
    sigma = ntm_sigma(speed, TUNING_CLASS)
    found = shares(lidar, first, speed, sigma, height, radius)
    rotor, cross, own = (at_frequencies(values, frequency) for values in found)
    samples = int(round(TUNING_PERIOD / STEP))
    point = amplitudes(speed, sigma, height, 2.0 * radius, samples, STEP, "point")
    variance = 0.5 * point[:3, 1 : frequency.size + 1] ** 2
    rotor, cross, own = rotor * variance[0], cross * variance[0], (own * variance).sum(axis=0)
    gain = np.abs(cross) / own
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
    left = rotor + np.abs(gain) ** 2 * own + np.abs(passed) ** 2 * held_noise(lidar, blocked, frequency, own)
    error = np.sqrt(max(left.sum() - 2.0 * common.max(), 0.0))
    travel = (lidar.distances[first] - (lidar.behind_rotor or 0.0)) / speed
    return Tuning(first, float(corner), lead, travel - lead, float(error))


def held_noise(lidar, blocked, frequency, variance):
    """(n,) variance in bins at frequencies k/period of what sampling folds: as much as it takes away.

    Spread as that of independent values, each held for a geometric number of scans.
    """
    if lidar.scan_period == 0.0:
        return np.zeros(frequency.size)
    passed = np.abs(sampling(lidar, blocked, frequency)) ** 2
    spread = 2.0 * lidar.scan_period * (1.0 + blocked) / (1.0 - blocked) * passed
    return ((1.0 - passed) * variance).sum() * spread * frequency[0]


def lidar_horizon(scene, preset="four_beam_pulsed"):
    """Longest time (s) ahead that a lidar knows the wind of a scene: that of its farthest distance.

    preset: as in lidar_preview. Raises: InputError for a scene without wind.
    """
    lidar, place = _placed(scene, preset)
    return tuning(lidar, len(lidar.distances) - 1, *place).horizon


def lidar_tuning(scene, preset="four_beam_pulsed", ahead=0.0):
    """Tuning of a lidar in the mean wind of a scene that knows the wind some time (s) ahead.

    It uses all distances from which the wind is still far enough after the filter. preset: as in
    lidar_preview.
    Raises: InputError where it does not know the wind that far ahead, and for a scene without wind.
    """
    lidar, place = _placed(scene, preset)
    last = len(lidar.distances) - 1
    farthest = tuning(lidar, last, *place)
    if ahead > farthest.horizon:
        raise InputError(
            f"preview_times: {ahead:g} s ahead: must be <= {max(farthest.horizon, 0.0):.3g} s, what the lidar"
            f" {lidar.name!r} knows at {place[0]:g} m/s"
        )
    first = bisect_left(range(last), True, key=lambda first: tuning(lidar, first, *place).horizon >= ahead)
    return tuning(lidar, first, *place)


def _placed(scene, preset):
    """(Lidar, arguments of tuning behind it and first) of a lidar in a scene. Raises: InputError."""
    lidar = read_lidar(preset)
    if scene.model.aero is None:
        raise InputError(f"lidar {lidar.name!r}: needs a scene with wind to look ahead")
    speed = mean_speed(scene)
    if speed < SLOWEST:
        raise InputError(f"lidar {lidar.name!r}: mean wind = {speed:g}: must be >= {SLOWEST:g} m/s")
    rotor = scene.turbine.rotor
    blocked = blocked_share(lidar, rotor, scene.turbine.blade)
    if blocked > 0.9:
        raise InputError(
            f"lidar {lidar.name!r}: the blades of {scene.turbine.name!r} take away {100.0 * blocked:.0f} %"
            " of its shots: must be at most 90 %; mount it elsewhere (behind_rotor, above_shaft)"
        )
    return lidar, (speed, rotor.hub_height, _radius(scene), blocked)


def mean_speed(scene):
    """Mean wind (m/s) with which gusts travel to the rotor."""
    return float(scene.wind.speed if isinstance(scene.wind, WindBox) else scene.wind_speed)


def _radius(scene):
    """Radius (m) over which the wind of the rotor is averaged; 0 where a point's wind fills the disc."""
    drawn = _drawn(scene)
    return 0.0 if drawn is not None and drawn["average"] == "point" else scene.turbine.rotor.tip_radius


def _drawn(scene):
    """Arguments of turbulence() of a scene, None where its wind is not drawn from spectra."""
    if isinstance(scene.wind, WindBox):
        return None
    return drawn_turbulence(
        scene.wind,
        reference_height=scene.turbine.rotor.hub_height,
        rotor_diameter=2.0 * scene.turbine.rotor.tip_radius,
        seed=scene.seed,
        duration=scene.options["duration"],
    )


def lidar_preview(scene, times, preset="four_beam_pulsed", seed=None):
    """Preview of the rotor-averaged wind at times (k,) s ahead, as a lidar on the nacelle estimates it.

    preset  name of a built-in lidar (descriptions.lidar.lidars), a path to a TOML file with its keys, or a
            Lidar
    seed    of what rotor and lidar do not share; None: that of the scene
    All times are served by one filter, made for the last of them, and one buffer.
    Raises: InputError for times that do not increase from 0 to 600 s or go beyond what the lidar knows, with
    its horizon in this wind and what was asked, and for a scene without wind.
    """
    times = check_times(times)
    lidar, (speed, _, _, blocked) = _placed(scene, preset)
    tuned = lidar_tuning(scene, lidar, times[-1] if times.size else 0.0)
    seed = scene.seed if seed is None else check_whole_number("seed", seed, 0)
    if isinstance(scene.wind, WindBox):
        start, seen, period = _in_box(scene, lidar, tuned, seed)
    elif _drawn(scene) is not None:
        start, seen, period = _in_turbulence(scene, lidar, tuned, seed)
    else:
        start, seen, period = _as_given(scene, lidar, tuned)
        seed = None
    value = _filtered(start, seen, period, lidar, blocked, tuned, seed)
    distances = np.array(lidar.distances[tuned.first :])
    scans = 0.5 + blocked / (1.0 - blocked)  # that a value is old when it is used, on average
    motion = Motion(
        tuned.corner,
        (distances - distances[0]) / speed + scans * lidar.scan_period,
        np.full(distances.size, 1.0 / distances.size),
        tuned.horizon - times,
    )
    return series_ahead(scene, start, value, period, times)._replace(motion=motion)


def _profile_factor(scene, lidar, tuned):
    """Factor on the rotor's series, which is without the power law, for what of this the lidar sees more."""
    series, p = scene.model.aero.wind, points(lidar, tuned.first)
    height = np.maximum(series.reference_height + p.z, LOWEST_HEIGHT)
    seen = p.weight @ (height / series.reference_height) ** series.shear_exponent
    return 1.0 + seen - series.rotor_factor


def _in_turbulence(scene, lidar, tuned, seed):
    """(time, wind, period) that the lidar sees of a wind drawn from spectra, due at the rotor; unfiltered."""
    start, wind, period = rotor_wind_series(scene)
    drawn, count = _drawn(scene), wind.size - 1
    radius = _radius(scene)
    frequency = np.arange(1, count // 2 + 1) / period
    place = (drawn["speed"], drawn["sigma"], drawn["height"])
    found = shares(lidar, tuned.first, *place, radius)
    rotor, cross, own = (at_frequencies(values, frequency) for values in found)
    point = amplitudes(*place, 2.0 * scene.turbine.rotor.tip_radius, count, period / count, "point")[:3, 1:]
    variance = 0.5 * point**2
    # never below 0 but for rounding: no signal shares more with another than it has
    rest = np.maximum((own * variance).sum(axis=0) - np.abs(cross) ** 2 / rotor * variance[0], 0.0)
    spectrum = np.fft.rfft(wind[:-1])
    spectrum[0] *= _profile_factor(scene, lidar, tuned)
    spectrum[1:] = cross / rotor * spectrum[1:] + _noise(rest, count, seed, LIDAR_STREAM)
    return start[:-1], np.fft.irfft(spectrum, count), period


def _noise(variance, count, seed, stream):
    """(n,) complex Gaussian Fourier sums, of a series of count values, of a variance in each bin."""
    drawn = component_generator(seed, stream).normal(size=(2, variance.size))
    return 0.5 * count * np.sqrt(variance) * (drawn[0] + 1j * drawn[1])


def _in_box(scene, lidar, tuned, seed):
    """(time, wind, period) that the lidar sees of a box of wind, due at the rotor; unfiltered.

    Beams leave a box of little more than the rotor with their far ends; what lies within the grid counts.
    Raises: InputError where that is too little.
    """
    box, p = scene.wind, points(lidar, tuned.first)
    hub, speed = scene.turbine.rotor.hub_height, box.speed
    height = hub + p.z
    inside = (np.abs(p.y) <= box.y[-1]) & (height >= box.z[0]) & (height <= box.z[-1])
    if p.weight[inside].sum() < LEAST_INSIDE:
        raise InputError(
            f"wind: the grid from y = {box.y[0]:g} to {box.y[-1]:g} m and z = {box.z[0]:g} to {box.z[-1]:g} m"
            f" must hold {LEAST_INSIDE:g} of what the lidar {lidar.name!r} looks at, y to"
            f" {np.abs(p.y).max():.0f} m either way and z from {height.min():.0f} to {height.max():.0f} m:"
            f" it holds {p.weight[inside].sum():.2f}"
        )
    weight = p.weight * inside / p.weight[inside].sum()
    seen = np.zeros(box.velocity.shape[0])
    columns = (p.late / speed, p.y, height, weight, p.across, p.up)
    _look(box.field(), *(np.ascontiguousarray(column[inside]) for column in columns), seen)
    count, radius = seen.size, scene.turbine.rotor.tip_radius
    frequency = np.arange(1, count // 2 + 1) / (count * box.dt)
    sigma = ntm_sigma(speed, TUNING_CLASS)
    evolved, frozen = (
        at_frequencies(
            np.abs(shares(lidar, tuned.first, speed, sigma, hub, radius, evolves).cross), frequency
        )
        for evolves in (True, False)
    )
    kept = np.where(frozen > 1e-12, evolved / np.maximum(frozen, 1e-12), 0.0)
    spectrum = np.fft.rfft(seen)
    variance = 2.0 * np.abs(spectrum[1:] / count) ** 2
    spectrum[1:] = kept * spectrum[1:] + _noise((1.0 - kept**2) * variance, count, seed, LIDAR_STREAM)
    time = np.arange(count) * box.dt - box.shift
    return time, np.fft.irfft(spectrum, count), count * box.dt if box.periodic else None


@kernel
def _look(field, late, y, z, weight, across, up, seen):
    """Fill seen (n_time,) with what a lidar takes for u at the rotor, from points of a box (see Points)."""
    for i in range(seen.shape[0]):
        t = i / field.rate - field.shift
        for n in range(y.shape[0]):
            u, v, w = field_at(t + late[n], 0.0, y[n], z[n], field)
            seen[i] += weight[n] * (u + across[n] * v + up[n] * w)


def _as_given(scene, lidar, tuned):
    """(time, wind, period) that the lidar sees of a wind that fills the disc, at even times; unfiltered."""
    start, wind, period = rotor_wind_series(scene)
    span = max(start[-1] - start[0], STEP) if period is None else period
    count = int(np.ceil(span / STEP - 1e-9))
    time = start[0] + span / count * np.arange(count + (period is None))
    return time, _profile_factor(scene, lidar, tuned) * np.interp(time, start, wind, period=period), period


def _filtered(time, value, period, lidar, blocked, tuned, seed):
    """(n,) wind at even times (n,) s as the lidar gives it: sampled, held, low-passed, all without delay.

    seed: of what sampling folds into it; None: nothing. The ends of a wind without a period are held.
    """
    count, step = value.size, time[1] - time[0] if time.size > 1 else STEP
    folded = np.zeros(count)
    if seed is not None:
        frequency = np.arange(1, count // 2 + 1) / (count * step)
        variance = 2.0 * np.abs(np.fft.rfft(value)[1:] / count) ** 2
        spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
        spectrum[1:] = _noise(held_noise(lidar, blocked, frequency, variance), count, seed, LIDAR_STREAM + 1)
        folded = np.fft.irfft(spectrum, count)
    margin = 0 if period is not None else int(SETTLING / step)
    value, folded = np.pad(value, margin, mode="edge"), np.pad(folded, margin)
    frequency = np.fft.rfftfreq(value.size, step)
    gain = low_pass(frequency, tuned.corner) * np.exp(2j * np.pi * frequency * tuned.lead)
    spectrum = np.fft.rfft(value) * sampling(lidar, blocked, frequency) + np.fft.rfft(folded)
    return np.fft.irfft(spectrum * gain, value.size)[margin : margin + count]
