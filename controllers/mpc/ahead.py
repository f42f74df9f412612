"""Predicts the rotor-averaged wind from its estimate at the rotor and from the raw readings of a lidar.

The estimate is the better anemometer for some seconds, the lidar for later ones. The prediction of the wind
tau ahead is the linear combination of least mean square error (Wiener) of the estimates of the last seconds
and of the readings of all gates of the last seconds,

w(tau) = c_e e + c_g g,    [c_e c_g] = E[v(tau) [e g]] E[[e g] [e g]^T]^-1,

with covariances from the spectra that simulate the lidar (fowt_env/weather/lidar_gates.py): rotor and beams
in Kaimal turbulence, its evolution, probe volumes, shots that are held, folded and lost. They depend on
turbine, lidar and mean wind, and are computed in prepare() without any draw of weather. All signals may share
an unknown mean, so that an offset of the mean wind has no influence.

A reading without new shots is replaced by its own prediction from the estimates and the readings before it.
A prediction from predictions is the conditional mean (tower property): with a lidar that has been blind for a
while the result is that of the estimates alone, and the change is gradual.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.descriptions.iec import length_scale, ntm_sigma
from fowt_env.weather.lidar import TUNING_CLASS, blocked_share, sampling
from fowt_env.weather.lidar_gates import (
    channel_shares,
    group_count,
    interpolated,
    represented,
    travel_distances,
    FREQUENCIES,
)
from fowt_env.weather.turbulence import kaimal_spectrum

BINS = np.arange(1, 1025) / 512.0  # Hz
WINDS = np.array([6.0, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0, 24.0, 28.0])  # m/s, mean winds of a design
MEMORY = 16.0  # s, age of the oldest values used
ESTIMATES = np.array([0.0, 1.0, 2.0, 4.0, 8.0, MEMORY])  # s, ages of the estimates used
STEP = 1.0  # s between the ages of the readings used
MEAN_DOUBT = 3.0  # m/s, deviation of the mean from the operating wind
LIDAR_DOUBT = 0.15  # m/s, lasting difference of all gates from the estimate
# error of the Kalman estimate: it is late, and it errs slowly (OC3-Hywind, sensors "standard", 12 to 24 m/s)
LATE = 0.4  # s
SLOW_ERROR, SLOW_TIME = 0.12, 6.0  # m/s, s
FAST_ERROR = 0.04  # m/s, white
HALF = 0.5  # fraction of the expected fresh shots from which a reading counts in full


class Fusion(NamedTuple):
    """Holds coefficients over WINDS; features are estimates, then gates, each from the newest to the oldest."""

    ahead: np.ndarray  # (winds, times, features) of the wind at the look-ahead times
    reading: np.ndarray  # (winds, gates, features) of each gate's reading, from all features but the newest


class Ages(NamedTuple):
    """Holds the ages of values used, in periods."""

    estimates: np.ndarray
    readings: np.ndarray


def ages_of(period):
    """Return the Ages for a time between plans (s)."""
    step = max(1, round(STEP / period))
    return Ages(np.rint(ESTIMATES / period).astype(int), np.arange(0, round(MEMORY / period) + 1, step))


class Covariances(NamedTuple):
    """Holds covariances over a lag (s) on a grid of periods, index 0 at lag -(n - 1)/2."""

    rotor: np.ndarray  # (n,)
    cross: np.ndarray  # (gates, n) E[g(t + lag) v(t)]
    gates: np.ndarray  # (gates, gates, n) E[g_i(t + lag) g_j(t)]


def covariances(lidar, blocked, speed, height, radius, lags):
    """Return the Covariances of rotor-averaged wind and raw readings at lags (n,) s in a mean wind (m/s)."""
    sigma = ntm_sigma(speed, TUNING_CLASS)
    shares = channel_shares(lidar, speed, sigma, height, radius)
    gates, groups = len(lidar.distances), group_count(lidar)
    own = shares.own.reshape(FREQUENCIES.size, gates, groups, gates, groups)
    same = np.einsum("fiqjq->fij", own) / groups**2
    other = own.mean(axis=(2, 4)) - same
    width = BINS[0]
    power = width * kaimal_spectrum(BINS, speed, sigma, 8.1 * length_scale(height))
    same, other = (power[:, None, None] * interpolated(part, BINS) for part in (same, other))
    cross = power[:, None] * interpolated(shares.cross.reshape(-1, gates, groups).mean(axis=2), BINS)
    rotor = power * interpolated(shares.rotor, BINS)
    hold = sampling(lidar, blocked, BINS)
    turned = np.exp(2j * np.pi * np.multiply.outer(BINS, travel_distances(lidar) / speed))  # not advanced
    cross = cross * turned * hold[:, None]
    same, other = (part * turned[:, :, None] * turned.conj()[:, None, :] for part in (same, other))
    passed = np.abs(hold) ** 2
    # values of one beam are held together: what this folds has the covariance between its gates
    folded = ((1.0 - passed)[:, None, None] * same).sum(axis=0).real
    spread = passed / passed.sum()
    both = passed[:, None, None] * (same + other) + spread[:, None, None] * folded
    wave = np.exp(2j * np.pi * np.multiply.outer(lags, BINS))
    return Covariances(
        (wave @ rotor).real,
        (wave @ cross).real.T,
        np.moveaxis((wave @ both.reshape(BINS.size, -1)).real.reshape(lags.size, gates, gates), 0, 2),
    )


def coefficients(lidar, blocked, speed, height, radius, period, count):
    """Return (ahead (count, features), reading (gates, features)) of a Fusion at one mean wind, m/s."""
    ages, gates = ages_of(period), len(lidar.distances)
    reach = int(ages.readings[-1]) + count + 1
    lags = period * np.arange(-reach, reach + 1)
    known = covariances(lidar, blocked, speed, height, radius, lags)
    late = covariances_late(known, lags)
    e, r = ages.estimates, ages.readings
    n, m = e.size, r.size
    total = np.empty((n + gates * m, n + gates * m))
    apart = e[None, :] - e[:, None]
    total[:n, :n] = known.rotor[reach + apart] + SLOW_ERROR**2 * np.exp(-period * np.abs(apart) / SLOW_TIME)
    total[:n, :n] += FAST_ERROR**2 * np.eye(n)
    mixed = late[1][:, reach + e[:, None] - r[None, :]]  # (gates, n, m) E[g(t - r) e(t - e)]
    total[:n, n:] = np.moveaxis(mixed, 0, 1).reshape(n, gates * m)
    total[n:, :n] = total[:n, n:].T
    pair = known.gates[:, :, reach + r[None, :] - r[:, None]]  # lag of g_i(t - r_i) after g_j(t - r_j)
    total[n:, n:] = np.moveaxis(pair, 1, 2).reshape(gates * m, gates * m) + LIDAR_DOUBT**2
    times = np.arange(count)
    target = np.empty((count, n + gates * m))
    target[:, :n] = late[0][reach + times[:, None] + e[None, :]]
    target[:, n:] = np.moveaxis(
        known.cross[:, reach - times[:, None] - r[None, :]], 0, 1
    ).reshape(count, gates * m)
    total += MEAN_DOUBT**2
    target += MEAN_DOUBT**2
    newest = np.zeros(n + gates * m, dtype=bool)
    newest[n::m] = True
    ahead = np.linalg.solve(total, target.T).T
    old = ~newest
    reading = np.zeros((gates, n + gates * m))
    reading[:, old] = np.linalg.solve(total[np.ix_(old, old)], total[np.ix_(old, newest)]).T
    return ahead, reading


def covariances_late(known, lags):
    """Return (E[v(t + lag) e(t)], E[g(t + lag) e(t)]) for an estimate e(t) of v(t - LATE)."""
    rotor = np.interp(lags + LATE, lags, known.rotor)
    return rotor, np.array([np.interp(lags + LATE, lags, row) for row in known.cross])


_FUSIONS = Cache(16)  # lidar, turbine's size, blocked share, period, count -> Fusion


def fusion(scene, lidar, period, count):
    """Return the Fusion of a Lidar on a scene's turbine for `count` look-ahead times, a period (s) apart."""
    turbine, lidar = scene.turbine, represented(lidar)
    rotor = turbine.rotor
    blocked = blocked_share(lidar, rotor, turbine.blade)
    key = (lidar, blocked, rotor.hub_height, rotor.tip_radius, period, count)

    def make():
        site = (rotor.hub_height, rotor.tip_radius, period, count)
        found = [coefficients(lidar, blocked, speed, *site) for speed in WINDS]
        return Fusion(*(np.array(part) for part in zip(*found, strict=True)))

    return _FUSIONS.get(key, make), blocked


class Foresight:
    """Predicts the wind online by a Fusion: keeps the estimates and readings of the last MEMORY seconds.

    blocked: expected fraction of lost shots; forgetting: factor per period of the lidar's mean difference
    from the estimate, which is removed.
    """

    def __init__(self, made, blocked, period, forgetting):
        self.fusion, self.forgetting = made, forgetting
        self.expected = 1.0 - blocked
        ages = ages_of(period)
        self.ages = ages
        self.estimates = np.zeros(ages.readings[-1] + 1)  # m/s, newest first, as the following
        self.readings = np.zeros((made.reading.shape[1], ages.readings[-1] + 1))
        self.bias = np.zeros(len(self.readings))
        self.started = False

    def foresee(self, wind, estimate, speeds, fresh):
        """Return the expected wind (times,) m/s; called once per period.

        wind: mean, m/s; estimate: at the rotor, m/s; speeds, fresh (gates,): readings, without the nacelle's
        motion, and fractions of fresh shots.
        """
        trust = np.clip(np.asarray(fresh) / (HALF * self.expected), 0.0, 1.0)
        low, part = _between(wind)
        if not self.started:
            self.started = True
            self.estimates[:] = estimate
            self.readings[:] = (trust * speeds + (1.0 - trust) * estimate)[:, None]
        self.estimates[1:] = self.estimates[:-1].copy()
        self.readings[:, 1:] = self.readings[:, :-1].copy()
        self.estimates[0] = estimate
        features = self._features(wind)
        expected = wind + _mixed(self.fusion.reading, low, part) @ features
        self.bias += trust * (1.0 - self.forgetting) * (estimate - speeds - self.bias)
        self.readings[:, 0] = trust * (speeds + self.bias) + (1.0 - trust) * expected
        return wind + _mixed(self.fusion.ahead, low, part) @ self._features(wind)

    def _features(self, wind):
        e, r = self.ages
        return np.concatenate([self.estimates[e], self.readings[:, r].ravel()]) - wind


def _between(wind):
    """Return (index, fraction) of a mean wind within WINDS, linear in the travel time."""
    position = np.interp(-1.0 / wind if wind > WINDS[0] else -1.0 / WINDS[0], -1.0 / WINDS, np.arange(WINDS.size))
    low = min(int(position), WINDS.size - 2)
    return low, position - low


def _mixed(values, low, part):
    return (1.0 - part) * values[low] + part * values[low + 1]
