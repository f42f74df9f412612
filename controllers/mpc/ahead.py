"""Predicts the rotor-averaged wind from its estimate at the rotor and from the raw readings of a lidar.

The estimate is the better anemometer for some seconds, the lidar for later ones. The prediction of the wind v
is the linear combination of least mean square error (Wiener) of the estimates e and of the readings g of all
gates of the last seconds,

w(tau) = E[v(t + tau) s^T] (E[s s^T] + D)^-1 s,    s = (e(t - ages), g(t - ages)),

with covariances from the spectra that simulate the lidar (fowt_env/weather/lidar_gates.py): rotor and beams
in Kaimal turbulence that evolves, probe volumes, shots that are held, folded and lost. They depend on rotor,
lidar and mean wind alone, and no weather is drawn. All signals share an unknown mean, so that an offset of
the mean wind has no influence.

The spectra account for single lost shots. The diagonal D has the additional doubt about readings without a
new shot for longer: it grows with time, so that a lidar that goes blind loses its influence gradually, and
the prediction becomes that from the estimates alone.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.descriptions.iec import length_scale, ntm_sigma
from fowt_env.weather.lidar import TUNING_CLASS, blocked_share, mean_age, sampling
from fowt_env.weather.lidar_gates import (
    FREQUENCIES,
    channel_shares,
    group_count,
    interpolated,
    represented,
    travel_distances,
)
from fowt_env.weather.turbulence import LENGTH_RATIO, kaimal_spectrum

BINS = np.arange(1, 1025) / 512.0  # Hz
WINDS = np.array([6.0, 8.0, *range(10, 20), *range(20, 29, 2)])  # m/s, mean winds of the design
MEMORY = 16.0  # s, age of the oldest values used
ESTIMATES = np.array([0.0, 1.0, 2.0, 4.0, 8.0, MEMORY])  # s, ages of the estimates used
STEP = 2.0  # s between the ages of the readings used
MEAN_DOUBT = 3.0  # m/s, deviation of the mean from the operating wind
LIDAR_DOUBT = 0.15  # m/s, deviation of the mean of all gates from that of the estimate
# error of lqr's estimate of the wind (OC3-Hywind, sensors "standard", 12 to 24 m/s)
LATE = 0.4  # s
SLOW_ERROR, SLOW_TIME = 0.12, 6.0  # m/s, s
FAST_ERROR = 0.04  # m/s, white
GAP = 2.0  # scans without a new shot, after which a reading is doubted
STALE = 0.7  # m/s per s of a longer gap, deviation of such a reading
UNKNOWN = 20.0  # m/s, deviation of values before the start of a run, and the largest one


class Fusion(NamedTuple):
    """Holds covariances and coefficients of the signals s over WINDS.

    Signals are the estimates, then the readings gate by gate, the newest values first.
    """

    signals: np.ndarray  # (winds, signals, signals)
    ahead: np.ndarray  # (winds, times, signals) covariances with the wind at the look-ahead times
    weights: np.ndarray  # (winds, times, signals) of the signals in this wind, without D
    scan: float  # s
    age: float  # s, mean age of a reading


class Covariances(NamedTuple):
    """Holds covariances over a lag, of wind v, its estimate e and readings g."""

    rotor: np.ndarray  # (n,) E[v(t + lag) v(t)]
    estimate: np.ndarray  # (n,) E[v(t + lag) e(t)]
    cross: np.ndarray  # (gates, n) E[g(t + lag) v(t)]
    mixed: np.ndarray  # (gates, n) E[g(t + lag) e(t)]
    gates: np.ndarray  # (gates, gates, n) E[g_i(t + lag) g_j(t)]


def reading_spectra(lidar, blocked, speed, height, radius):
    """Return spectra over BINS of the wind (n,), cross (n, gates), and of the readings (n, gates, gates).

    (m/s)^2 per bin, in a mean wind (m/s), with the travel times of the gates, hold and lost shots.
    """
    sigma = ntm_sigma(speed, TUNING_CLASS)
    shares = channel_shares(lidar, speed, sigma, height, radius)
    gates, groups = len(lidar.distances), group_count(lidar)
    own = shares.own.reshape(FREQUENCIES.size, gates, groups, gates, groups)
    same = np.einsum("fiqjq->fij", own) / groups**2  # of the same beams at two gates
    other = own.mean(axis=(2, 4)) - same
    cross = shares.cross.reshape(-1, gates, groups).mean(axis=2)
    point = BINS[0] * kaimal_spectrum(BINS, speed, sigma, LENGTH_RATIO[0] * length_scale(height))
    rotor = point * interpolated(shares.rotor, BINS)
    # channels are advanced to the rotor, readings are not
    hold, omega = sampling(lidar, blocked, BINS), 2.0 * np.pi * BINS
    early = np.exp(1j * np.multiply.outer(omega, travel_distances(lidar) / speed))
    cross = (point * hold)[:, None] * early * interpolated(cross, BINS)
    pair = point[:, None, None] * early[:, :, None] * early.conj()[:, None, :]
    same, other = (pair * interpolated(part, BINS) for part in (same, other))
    passed = np.abs(hold) ** 2
    # the values of a beam at two gates are held together: what this folds is as coherent as the values
    folded = ((1.0 - passed)[:, None, None] * same).sum(axis=0).real
    return rotor, cross, passed[:, None, None] * (same + other + folded / passed.sum())


def covariances(lidar, blocked, speed, height, radius, lags):
    """Return the Covariances at increasing lags (n,) s in a mean wind (m/s), without doubts of the means."""
    rotor, cross, held = reading_spectra(lidar, blocked, speed, height, radius)
    gates = len(lidar.distances)
    wave = np.exp(1j * np.multiply.outer(lags, 2.0 * np.pi * BINS))
    known, cross = (wave @ rotor).real, (wave @ cross).real.T
    return Covariances(
        known,
        np.interp(lags + LATE, lags, known),
        cross,
        np.array([np.interp(lags + LATE, lags, row) for row in cross]),
        (wave @ held.reshape(BINS.size, -1)).real.T.reshape(gates, gates, lags.size),
    )


def ages_of(period):
    """Return the ages of the estimates (n,) and readings (m,) used, in periods (s each)."""
    step = max(1, round(STEP / period))
    return np.rint(ESTIMATES / period).astype(int), np.arange(0, round(MEMORY / period) + 1, step)


def covariances_of_signals(lidar, blocked, speed, height, radius, period, count):
    """Return (signals, ahead) of a Fusion at one mean wind, m/s."""
    (e, r), times = ages_of(period), np.arange(count)
    gates, n = len(lidar.distances), e.size
    zero = int(max(e[-1], r[-1])) + count  # index of lag 0
    known = covariances(lidar, blocked, speed, height, radius, period * np.arange(-zero, zero + 1))
    total = np.empty((n + gates * r.size, n + gates * r.size))
    apart = e[None, :] - e[:, None]
    error = SLOW_ERROR**2 * np.exp(-period * np.abs(apart) / SLOW_TIME) + FAST_ERROR**2 * np.eye(n)
    total[:n, :n] = known.rotor[zero + apart] + error
    mixed = known.mixed[:, zero + e[:, None] - r]  # (gates, n, m)
    total[:n, n:] = np.moveaxis(mixed, 0, 1).reshape(n, -1)
    total[n:, :n] = total[:n, n:].T
    pairs = known.gates[:, :, zero + r - r[:, None]]  # (gates, gates, m, m)
    total[n:, n:] = np.moveaxis(pairs, 1, 2).reshape(gates * r.size, -1) + LIDAR_DOUBT**2
    with_wind = np.empty((count, len(total)))
    with_wind[:, :n] = known.estimate[zero + times[:, None] + e]
    with_wind[:, n:] = np.moveaxis(known.cross[:, zero - times[:, None] - r], 0, 1).reshape(count, -1)
    return total + MEAN_DOUBT**2, with_wind + MEAN_DOUBT**2


_FUSIONS = Cache(16)  # lidar, blocked share, size of the rotor, period, count -> Fusion


def fusion(scene, lidar, period, count):
    """Return the Fusion of a Lidar on a scene's turbine for `count` look-ahead times a period (s) apart."""
    rotor, lidar = scene.turbine.rotor, represented(lidar)
    blocked = blocked_share(lidar, rotor, scene.turbine.blade)
    site = (rotor.hub_height, rotor.tip_radius, period, count)

    def make():
        made = zip(*(covariances_of_signals(lidar, blocked, wind, *site) for wind in WINDS), strict=True)
        signals, ahead = (np.array(part) for part in made)
        weights = np.linalg.solve(signals, ahead.swapaxes(1, 2)).swapaxes(1, 2)
        return Fusion(signals, ahead, weights, lidar.scan_period, mean_age(lidar, blocked))

    return _FUSIONS.get((lidar, blocked, *site), make)


class Foresight:
    """Predicts the wind by a Fusion, from the estimates and readings of the last MEMORY seconds.

    gates: number of gates; forgetting: factor per period (s) of the mean difference of each gate from the
    estimate, which is removed.
    """

    def __init__(self, made, gates, period, forgetting):
        self.fusion, self.period, self.forgetting = made, period, forgetting
        self.ages = ages_of(period)
        kept = int(self.ages[1][-1]) + 1
        # rows: estimate, gates; newest first, m/s
        self.values, self.doubts = np.zeros((1 + gates, kept)), np.full((1 + gates, kept), UNKNOWN)
        self.late = made.age / period
        self.moving = np.zeros(int(self.late) + 2)  # m/s, newest first
        self.offset, self.gap = np.zeros(gates), np.zeros(gates)
        self.started = False

    def foresee(self, wind, estimate, moving, reading):
        """Return the expected wind (times,), m/s; called once per period.

        wind: mean, m/s; estimate: at the rotor, m/s; moving: velocity of the nacelle downwind, m/s; reading:
        LidarReading.
        """
        if not self.started:
            self.started = True
            self.values[:], self.moving[:] = estimate, moving
        for past in (self.values, self.doubts, self.moving):
            past[..., 1:] = past[..., :-1].copy()
        self.moving[0] = moving
        whole, part = int(self.late), self.late - int(self.late)
        speeds = reading.speed + (1.0 - part) * self.moving[whole] + part * self.moving[whole + 1]
        fresh = np.array(reading.fresh) > 0.0
        self.gap = np.where(fresh, 0.0, self.gap + self.period)
        self.offset += fresh * (1.0 - self.forgetting) * (estimate - speeds - self.offset)
        self.values[:, 0] = estimate, *(speeds + self.offset)
        doubts = STALE * np.maximum(self.gap - GAP * self.fusion.scan, 0.0)
        self.doubts[:, 0] = 0.0, *np.minimum(doubts, UNKNOWN)
        return self._expected(wind)

    def _expected(self, wind):
        e, r = self.ages
        signals, doubts = (np.r_[part[0, e], part[1:, r].ravel()] for part in (self.values, self.doubts))
        low, share = _between(wind)
        if not doubts.any():
            weights = (1.0 - share) * self.fusion.weights[low] + share * self.fusion.weights[low + 1]
            return wind + weights @ (signals - wind)
        made, more = self.fusion, np.diag(doubts**2)
        parts = [
            made.ahead[i] @ np.linalg.solve(made.signals[i] + more, signals - wind) for i in (low, low + 1)
        ]
        return wind + (1.0 - share) * parts[0] + share * parts[1]


def _between(wind):
    """Return (index, fraction) of a mean wind within WINDS, linear in the travel time and limited to them."""
    position = np.interp(-1.0 / max(wind, WINDS[0]), -1.0 / WINDS, np.arange(WINDS.size))
    low = min(int(position), WINDS.size - 2)
    return low, position - low
