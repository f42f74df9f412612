"""Simulates what a nacelle lidar measures at each distance (gate), shot by shot, without any filter.

Beams are taken in at most GROUPS groups of neighbours, whose members measure at the same time. The wind of
each group at each gate (a channel) is drawn jointly with the rotor-averaged wind from the spectra of
weather/lidar.py, so that errors have their true coherence between gates, beams and rotor. Groups measure in
turn, once per scan, all gates at once; passing blades take shots away at random. The reading of a gate is the
mean over the groups of their last successful shots, and is accompanied by the fraction of groups whose latest
shot succeeded.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.caches import cached
from fowt_env.descriptions.checks import check_whole_number
from fowt_env.descriptions.iec import length_scale, ntm_sigma
from fowt_env.descriptions.lidar import Lidar
from fowt_env.errors import InputError
from fowt_env.weather.lidar import (
    BEAM_NODES,
    LEAST_INSIDE,
    LIDAR_STREAM,
    STEP,
    TUNING_CLASS,
    directions,
    disc_radius,
    disk_coherence,
    drawn_of,
    evolution,
    look,
    mean_age,
    placed,
    points,
    profile_factor,
)
from fowt_env.weather.preview import Motion, Preview, rotor_wind_series
from fowt_env.weather.turbulence import (
    LENGTH_RATIO,
    SIGMA_RATIO,
    amplitudes,
    coherence_wave_number,
    component_generator,
    disk_average,
    kaimal_spectrum,
)
from fowt_env.weather.wind_field import WindBox

GROUPS = 8  # most groups of beams
FREQUENCIES = np.geomspace(1e-4, 5.0, 60)  # Hz
MOST_POINTS = 500  # of beams that are simulated
ROUNDING = 1e-9  # of the strength of a channel, added to keep covariances positive
LEAD_IN = 60.0  # s of shots before the start of a run
SHOTS = LIDAR_STREAM + 2  # random generator of lost shots


class Gates(NamedTuple):
    """Holds the readings of a lidar over a run.

    series: Preview with rows (2 gates, n): the wind speeds of the gates, m/s, from the nearest to the
    farthest, then the fraction of groups of beams whose latest shot succeeded, equal for all gates. Its
    motion, that of the nacelle, applies to the speeds alone.
    """

    lidar: Lidar
    series: Preview


class ChannelShares(NamedTuple):
    """Holds spectra of rotor and channels over the spectrum of u at a point, at FREQUENCIES.

    Channels are advanced to the rotor, groups of beams within gates: channel = gate * groups + group.
    """

    rotor: np.ndarray  # (m,)
    cross: np.ndarray  # (m, channels) complex, conj(rotor) times channel
    own: np.ndarray  # (m, channels, channels) complex


@cached(64)
def represented(lidar):
    """Return a Lidar with the beams that are simulated: all, or as many of them as MOST_POINTS permits.

    The beams kept are evenly distributed over the scan, and at least one for each of GROUPS groups.
    """
    slopes = np.stack(directions(lidar), axis=1)
    most = max(GROUPS, int(MOST_POINTS / (len(lidar.distances) * BEAM_NODES.size)))
    if len(slopes) <= most:
        return lidar
    y, z = slopes[(np.arange(most) + 0.5).astype(int) * len(slopes) // most].T
    angles = {"azimuth": np.arctan(y), "elevation": np.arctan(z * np.cos(np.arctan(y)))}
    angles = {key: tuple(np.degrees(value).tolist()) for key, value in angles.items()}
    return Lidar(**lidar.model_dump() | angles | {"beams": None, "half_angle": None})


def group_count(lidar):
    """Return the number of groups in which the beams of a lidar are simulated."""
    return min(GROUPS, int(points(lidar).beam.max()) + 1)


@cached(64)
def channel_weights(lidar):
    """Return the weights (channels, n) of the points of a lidar in each channel; each row has sum 1."""
    p, groups = points(lidar), group_count(lidar)
    group = p.beam * groups // (p.beam.max() + 1)
    channel = p.gate * groups + group
    weight = np.where(channel == np.arange(len(lidar.distances) * groups)[:, None], p.weight, 0.0)
    return weight / weight.sum(axis=1, keepdims=True)


def travel_distances(lidar):
    """Return the distance (gates,) from each gate to the rotor plane, m."""
    return np.array(lidar.distances) - (lidar.behind_rotor or 0.0)


@cached(64)
def channel_shares(lidar, speed, sigma, height, radius, evolves=True):
    """Return the ChannelShares of a lidar; arguments as lidar.shares."""
    p, weight, f = points(lidar), channel_weights(lidar), FREQUENCIES
    k, omega = coherence_wave_number(f, speed, height), 2.0 * np.pi * f
    a, b = evolution(speed, sigma, height) if evolves else (0.0, 0.0)
    fading = 0.5 * a * np.hypot(f / speed, b)  # 1/m along the wind
    from_centre, which = np.unique(np.round(np.hypot(p.y, p.z), 4), return_inverse=True)
    disc = np.array([disk_coherence(k, distance, radius) for distance in from_centre])
    across = np.hypot(p.y[:, None] - p.y, p.z[:, None] - p.z)
    along = np.abs(p.upwind[:, None] - p.upwind)
    u, v, w = (
        kaimal_spectrum(f, speed, ratio, length * length_scale(height))
        for ratio, length in zip(SIGMA_RATIO, LENGTH_RATIO, strict=True)
    )
    # points of a beam at a gate follow each other and have the same factors of v and w
    first = np.flatnonzero(np.diff(p.beam * len(lidar.distances) + p.gate, prepend=-1))
    of_beam = weight.sum(axis=0)
    member = (weight[:, first] > 0.0).astype(float)
    slope = np.array([np.ones(first.size), p.across[first], p.up[first]])
    cross = np.empty((f.size, len(weight)), dtype=np.complex128)
    own = np.empty((f.size, len(weight), len(weight)), dtype=np.complex128)
    for i in range(f.size):
        turned = of_beam * np.exp(1j * omega[i] * p.late / speed)
        seen = np.add.reduceat(turned * disc[which, i] * np.exp(-fading[i] * p.upwind), first)
        cross[i] = member @ seen
        pair = np.exp(-k[i] * across - fading[i] * along) * turned.conj()
        pair = np.add.reduceat(pair, first, axis=1) * turned[:, None]
        pair = np.add.reduceat(pair, first, axis=0)
        pair *= slope.T @ (np.array([u[i], v[i], w[i]])[:, None] / u[i] * slope)
        own[i] = member @ pair @ member.T
    rotor = disk_average(k * radius) if radius > 0.0 else np.ones(f.size)
    return ChannelShares(rotor, cross, own)


def position_in(frequency):
    """Return (index, fraction) of frequencies (n,) Hz within FREQUENCIES, linear in log frequency."""
    position = np.interp(np.log(frequency), np.log(FREQUENCIES), np.arange(FREQUENCIES.size))
    low = np.minimum(position.astype(int), FREQUENCIES.size - 2)
    return low, position - low


def interpolated(values, frequency):
    """Return values (m, ...) given at FREQUENCIES at frequencies (n,) Hz, shape (n, ...)."""
    low, part = position_in(frequency)
    part = part.reshape(-1, *(1,) * (values.ndim - 1))
    return (1.0 - part) * values[low] + part * values[low + 1]


def lidar_gates(scene, preset="four_beam_pulsed", seed=None):
    """Return the Gates of a lidar in a scene's weather. Arguments as lidar_preview. Raises: InputError."""
    described, (speed, _, _, blocked) = placed(scene, preset)
    lidar = represented(described)
    seed = scene.seed if seed is None else check_whole_number("seed", seed, 0)
    if isinstance(scene.wind, WindBox):
        start, seen, period = _in_box(scene, lidar, seed)
    elif drawn_of(scene) is not None:
        start, seen, period = _in_turbulence(scene, lidar, seed)
    else:
        start, seen, period = _uniform(scene, lidar)
    gates, groups = len(lidar.distances), group_count(lidar)
    scan = max(lidar.scan_period, STEP)
    end = max(scene.options["duration"], start[-1])
    time = STEP * np.arange(int(end / STEP) + 2)
    lost = component_generator(seed, SHOTS).uniform(size=(int((end + LEAD_IN) / scan) + 2, groups)) < blocked
    lost[0] = False
    value, fresh = np.zeros((gates, time.size)), np.zeros(time.size)
    delays = travel_distances(lidar) / speed
    for group in range(groups):
        shot = np.floor((time + LEAD_IN) / scan - (group + 1.0) / groups + ROUNDING).astype(int)
        good = np.maximum.accumulate(np.where(lost[:, group], 0, np.arange(len(lost))))[shot]
        fresh += (good == shot) / groups
        taken = scan * (good + (group + 1.0) / groups) - LEAD_IN
        for gate, delay in enumerate(delays):
            row = seen[gate * groups + group]
            value[gate] += np.interp(taken + delay, start, row, period=period) / groups
    motion = Motion(np.inf, np.array([mean_age(lidar, blocked)]), np.ones(1), np.zeros(2 * gates))
    return Gates(described, Preview(time, np.vstack([value, np.tile(fresh, (gates, 1))]), motion))


def _in_turbulence(scene, lidar, seed):
    """Return (time, winds (channels, n) advanced to the rotor, period) in a wind drawn from spectra."""
    start, wind, period = rotor_wind_series(scene)
    drawn, count = drawn_of(scene), wind.size - 1
    frequency = np.arange(1, count // 2 + 1) / period
    wind_at = (drawn["speed"], drawn["sigma"], drawn["height"])
    shares = channel_shares(lidar, *wind_at, disc_radius(scene))
    diameter = 2.0 * scene.turbine.rotor.tip_radius
    deviation = np.sqrt(0.5) * amplitudes(*wind_at, diameter, count, period / count, "point")[0, 1:]
    spectrum = np.fft.rfft(wind[:-1])
    p = points(lidar)
    mean = spectrum[0] * profile_factor(scene, p.z, channel_weights(lidar))
    gain = interpolated(shares.cross / shares.rotor[:, None], frequency)
    noise = 0.5 * count * deviation[:, None] * _coloured(_errors(shares), frequency, seed)
    seen = np.vstack([mean, gain * spectrum[1:, None] + noise])
    return start[:-1], np.fft.irfft(seen, count, axis=0).T, period


def _errors(shares):
    """Return the covariances (m, channels, channels) of what channels do not share with the rotor."""
    cross = shares.cross
    return shares.own - cross[:, :, None] * cross.conj()[:, None, :] / shares.rotor[:, None, None]


def _coloured(covariance, frequency, seed):
    """Return Gaussian coefficients (n, channels) of a covariance (m, channels, channels) at FREQUENCIES.

    Their factors are interpolated between FREQUENCIES.
    """
    channels = covariance.shape[1]
    strength = np.trace(covariance, axis1=1, axis2=2).real + ROUNDING
    factor = np.linalg.cholesky(covariance + ROUNDING * strength[:, None, None] * np.eye(channels))
    drawn = component_generator(seed, LIDAR_STREAM).normal(size=(2, frequency.size, channels))
    white, coloured = drawn[0] + 1j * drawn[1], np.empty((frequency.size, channels), dtype=np.complex128)
    low, part = position_in(frequency)
    for i in range(FREQUENCIES.size - 1):
        at = low == i
        if at.any():
            far, near = part[at, None] * white[at], (1.0 - part[at, None]) * white[at]
            coloured[at] = near @ factor[i].T + far @ factor[i + 1].T
    return coloured


def _in_box(scene, lidar, seed):
    """Return (time, winds (channels, n) advanced to the rotor, period) in a box of wind.

    Points outside the grid are omitted; a group without points inside has the mean of its gate.
    Raises: InputError if too few points remain.
    """
    box, p = scene.wind, points(lidar)
    hub, speed = scene.turbine.rotor.hub_height, box.speed
    height = hub + p.z
    inside = (np.abs(p.y) <= box.y[-1]) & (height >= box.z[0]) & (height <= box.z[-1])
    weights, count = channel_weights(lidar) * inside, box.velocity.shape[0]
    kept = weights.sum(axis=1)
    gates, groups = len(lidar.distances), group_count(lidar)
    if kept.mean() < LEAST_INSIDE or not kept.reshape(gates, groups).sum(axis=1).all():
        raise InputError(
            f"wind: the grid from y = {box.y[0]:g} to {box.y[-1]:g} m and z = {box.z[0]:g} to {box.z[-1]:g} m"
            f" must contain points of every distance of lidar {lidar.name!r} and {LEAST_INSIDE:g} of all,"
            f" |y| up to {np.abs(p.y).max():.0f} m and z from {height.min():.0f} to {height.max():.0f} m: it"
            f" contains {kept.mean():.2f}"
        )
    seen = np.zeros((len(weights), count))
    for channel in np.flatnonzero(kept):
        at = weights[channel] > 0.0
        columns = (p.late / speed, p.y, height, weights[channel] / kept[channel], p.across, p.up)
        look(box.field(), *(np.ascontiguousarray(column[at]) for column in columns), seen[channel])
    by_gate = seen.reshape(gates, groups, count)
    for gate, here in enumerate(kept.reshape(gates, groups) > 0.0):
        by_gate[gate, ~here] = by_gate[gate, here].mean(axis=0)
    a, b = evolution(speed, ntm_sigma(speed, TUNING_CLASS), hub)
    frequency = np.arange(1, count // 2 + 1) / (count * box.dt)
    fading = 0.5 * a * np.hypot(FREQUENCIES / speed, b)
    upwind = travel_distances(lidar)
    shared = np.exp(-np.multiply.outer(fading, np.abs(upwind[:, None] - upwind)))
    with_rotor = np.exp(-np.multiply.outer(fading, upwind))
    errors = shared - with_rotor[:, :, None] * with_rotor[:, None, :]
    spectrum = np.fft.rfft(seen, axis=1).reshape(gates, groups, -1)
    seeds = component_generator(seed, LIDAR_STREAM).integers(2**31, size=groups)
    for group in range(groups):
        noise = _coloured(errors, frequency, int(seeds[group]))
        strength = np.abs(spectrum[:, group, 1:])
        kept_part = interpolated(with_rotor, frequency).T * spectrum[:, group, 1:]
        spectrum[:, group, 1:] = kept_part + np.sqrt(0.5) * strength * noise.T
    time = np.arange(count) * box.dt - box.shift
    seen = np.fft.irfft(spectrum, count, axis=2).reshape(len(weights), count)
    return time, seen, count * box.dt if box.periodic else None


def _uniform(scene, lidar):
    """Return (time, winds (channels, n) at the rotor, period) in a wind that is uniform over the disc."""
    start, wind, period = rotor_wind_series(scene)
    factor = profile_factor(scene, points(lidar).z, channel_weights(lidar))
    if period is not None:
        start, wind = start[:-1], wind[:-1]
    return start, factor[:, None] * wind, period
