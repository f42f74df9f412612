"""Computes the feedback of lqr at one wind: the linear optimum at the control period under limits.

The objective is (1 - share) var(rotor speed) + share var(platform pitch), each over that of gspi_oc3 on the
same linear model, with limits on blade-pitch travel and on the deviations of power, torque and shaft torque.
By duality this is a quadratic cost with one multiplier per limit, computed by iteration: a multiplier
increases while its limit is exceeded and decreases otherwise. Deviations are those of the sampled loop with
Kalman filter and sensor noise.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.linalg import solve_discrete_are

from fowt_env.controllers.lqr.design import (
    MOMENT,
    N_FEEDBACK,
    N_PLANT,
    N_STATE,
    PLANT,
    SENSOR_NOISE,
    WIND,
    equivalent_wind,
    estimator_gain,
    lowest_design_wind,
    moment_scale,
    sampled,
    sampled_noise,
    travel_scale,
)
from fowt_env.controllers.pi import PISettings, schedule_gain
from fowt_env.descriptions.units import DEGREE

SURGE, SPEED, LEAN, BLADE = (
    PLANT.index(name) for name in ("surge", "rotor_speed", "platform_pitch", "blade_pitch")
)
TORQUE, COMMAND, INTEGRAL = N_PLANT, N_PLANT + 1, N_PLANT + 2  # after the plant, in the states fed back
ESTIMATED = [*range(N_PLANT), *range(N_PLANT + 3, N_FEEDBACK)]  # feedback states estimated by the filter
OF_FILTER = [*range(N_PLANT), *range(WIND, MOMENT)]  # indices of ESTIMATED in the filter's states
GAUSSIAN_MEAN = sqrt(2.0 / np.pi)  # mean |x| of a Gaussian over its standard deviation
LIMITED = ("travel", "power", "torque", "shaft")  # fields of Deviations
# m/s, below which travel and shaft torque have separate limits: lulls bring the turbine below rated
NEAR_RATED, NO_LULLS = 14.0, 16.0  # of the NREL 5 MW turbine
# Upper limits of the deviations of gspi_oc3, used if its linear model gives more or, near rated, is unstable
SPEED_CEILING, POWER_CEILING, LEAN_CEILING = 0.09, 0.09, 1.2 * DEGREE  # of rated, of rated, rad
TRAVEL_CEILING = 0.17 * DEGREE  # rad/s, of the NREL 5 MW turbine
SHAFT_CEILING = 0.018  # of rated torque, if the loop is unstable
LOWEST, HIGHEST = np.log(1e-3), np.log(1e4)  # range of log multipliers; the objective is of order one
TOLERANCE = 5e-3  # of the limits, relative
ROUNDS = 60
STEP = 2.0  # initial step of a log multiplier over the relative excess of its limit
LONGER, SHORTER = 1.2, 0.5  # factors of the step if the excess keeps or changes its sign
LARGEST = 2.0  # largest step of a log multiplier


@dataclass(frozen=True)
class Deviations:
    """Holds the standard deviations of a closed loop; travel is a mean absolute rate."""

    speed: float  # of the rotor, rad/s
    lean: float  # platform pitch, rad
    travel: float  # of the blade pitch, rad/s
    power: float  # of rated
    torque: float  # of the generator, of rated
    shaft: float  # torque of the shaft, of rated
    surge: float  # m
    integral: float  # of the rotor-speed error, rad


def generator_inertia(turbine, torque):
    """Return the generator inertia over a generator torque (N m), both on the low-speed shaft, s2."""
    return turbine.drivetrain.gear_ratio * turbine.drivetrain.generator_inertia / torque


def stationary_covariance(a, q):
    """Return the covariance X = A X A' + Q of a stable sampled system, by doubling."""
    x = q
    while True:
        more = a @ x @ a.T
        x = x + more
        if np.all(np.diag(more) <= 1e-12 * np.diag(x)):
            return x
        a = a @ a


class SampledLoop:
    """Computes gains and deviations of one wind's plant with weather and Kalman filter, sampled.

    States fed back: as feedback_plant of design.py; inputs: rates of torque (rated torques/s) and of the
    pitch command (rad/s). Commands change at control instants and are constant over a period, as in the law.
    """

    def __init__(self, model, turbine, dt):
        self.model, self.turbine, self.dt = model, turbine, dt
        phi, gamma = sampled(model.A[:MOMENT, :MOMENT], model.B[:MOMENT] * [model.torque, 1.0], dt)
        a, b = np.eye(N_FEEDBACK), np.zeros((N_FEEDBACK, 2))
        a[np.ix_(ESTIMATED, ESTIMATED)] = phi
        a[np.ix_(ESTIMATED, [TORQUE, COMMAND])] = gamma
        b[ESTIMATED] = dt * gamma
        b[TORQUE, 0] = b[COMMAND, 1] = dt
        a[INTEGRAL] += dt * a[SPEED]
        b[INTEGRAL] = dt * b[SPEED]
        self.a, self.b = a, b
        white = model.G[:MOMENT] @ model.G[:MOMENT].T
        self.noise = sampled_noise(model.A[:MOMENT, :MOMENT], white, dt)
        self.filter_gain = estimator_gain(model, dt, moment_scale(turbine))
        self.rows = self._rows()

    def _rows(self):
        """Return {field of Deviations: (row on the states (13,), row on the inputs (2,))}."""
        eye, none = np.eye(N_FEEDBACK), np.zeros(2)
        rated, per_step = self.turbine.rated_rotor_speed, GAUSSIAN_MEAN / self.dt
        acceleration = np.zeros(N_FEEDBACK)
        acceleration[ESTIMATED] = self.model.A[SPEED, :MOMENT]
        acceleration[[TORQUE, COMMAND]] = self.model.B[SPEED] * [self.model.torque, 1.0]
        return {
            "speed": (eye[SPEED], none),
            "lean": (eye[LEAN], none),
            "travel": (per_step * (self.a[BLADE] - eye[BLADE]), per_step * self.b[BLADE]),
            "power": (eye[SPEED] / rated + eye[TORQUE], none),
            "torque": (eye[TORQUE], none),
            "shaft": (eye[TORQUE] + self._inertia * acceleration, none),
            "surge": (eye[SURGE], none),
            "integral": (eye[INTEGRAL], none),
        }

    @property
    def _inertia(self):
        return generator_inertia(self.turbine, self.model.torque)

    def gain(self, weights, integral, torque_rate):
        """Return the optimal gain K (2, N_FEEDBACK): inputs are -K x.

        weights: {field of Deviations: weight of its square}; integral, torque_rate: of the squared speed
        integral and torque input. The cost of travel is on the command rate: a cost on the blade rate would
        make the command lead the blades in jumps. Raises: LinAlgError if there is no stabilising gain.
        """
        q, s = np.zeros_like(self.a), np.zeros_like(self.b)
        r = np.diag([torque_rate, GAUSSIAN_MEAN**2 * weights["travel"]])
        for name, weight in weights.items():
            if name == "travel":
                continue
            on_state, on_input = self.rows[name]
            q += weight * np.outer(on_state, on_state)
            s += weight * np.outer(on_state, on_input)
            r += weight * np.outer(on_input, on_input)
        q[INTEGRAL, INTEGRAL] += integral
        p = solve_discrete_are(self.a, self.b, q, r, s=s)
        return np.linalg.solve(r + self.b.T @ p @ self.b, self.b.T @ p @ self.a + s.T)

    def closed(self, k, noise=SENSOR_NOISE):
        """Return (A, Q, u, v) of the loop with gain k on the filter's estimates, as in the law.

        States: feedback states, then the filter's prediction (N_STATE,); Q: noise covariance per period;
        inputs are u x + v white with white sensor noise; noise: standard deviations of the sensors.
        """
        n, model, correction = N_FEEDBACK, self.model, self.filter_gain
        on_estimate, on_known = np.zeros((2, N_STATE)), np.zeros((2, n))
        on_estimate[:, OF_FILTER] = k[:, ESTIMATED]
        on_known[:, TORQUE : INTEGRAL + 1] = k[:, TORQUE : INTEGRAL + 1]
        estimate = np.zeros((N_STATE, n + N_STATE))
        estimate[:, ESTIMATED] = correction @ model.C[:, :MOMENT]
        estimate[:, n:] = np.eye(N_STATE) - correction @ model.C
        u, v = -on_estimate @ estimate, -on_estimate @ correction
        u[:, :n] -= on_known
        command, moved = self.dt * u, self.dt * v
        command[0, TORQUE] += 1.0
        command[1, COMMAND] += 1.0
        a, by_noise = np.zeros((n + N_STATE, n + N_STATE)), np.zeros((n + N_STATE, len(noise)))
        fa, fb = sampled(model.A, model.B * [model.torque, 1.0], self.dt)
        a[:n, :n] = self.a
        a[:n] += self.b @ u
        a[n:] = fa @ estimate + fb @ command
        by_noise[:n] = self.b @ v
        by_noise[n:] = fa @ correction + fb @ moved
        q = (by_noise * np.square(noise)) @ by_noise.T
        q[np.ix_(ESTIMATED, ESTIMATED)] += self.noise
        return a, q, u, v

    def deviations(self, k, noise=SENSOR_NOISE):
        """Return the Deviations with gain k on the filter's estimates; noise: sensor standard deviations."""
        a, q, u, v = self.closed(k, noise)
        x = stationary_covariance(a, q)
        values = {}
        for name, (on_state, on_input) in self.rows.items():
            row, white = on_input @ u, (on_input @ v) * noise
            row[:N_FEEDBACK] += on_state
            values[name] = sqrt(row @ x @ row + white @ white)
        return Deviations(**values)

    def baseline(self):
        """Return the Deviations of sampled gspi_oc3, limited to the ceilings; the ceilings if unstable.

        The law is the published PI with the slope of its schedule (theory.md, Eq. (A7)) and speed filter.
        """
        rated = self.turbine.rated_rotor_speed
        speed, power, lean = SPEED_CEILING * rated, POWER_CEILING, LEAN_CEILING
        travel = TRAVEL_CEILING * travel_scale(self.turbine)
        settings = PISettings.published(self.turbine)
        gain = schedule_gain(self.model.pitch, settings.gain_schedule_pitch)
        gain *= settings.gear_ratio / (2.0 - gain)
        n, dt = MOMENT, self.dt  # followed by filtered speed and its integral at the last instant
        keep = np.exp(-settings.speed_filter_corner * dt)
        filtered, integral = np.zeros(n + 2), np.zeros(n + 2)
        filtered[[SPEED, n]] = 1.0 - keep, keep
        integral[n + 1] = 1.0
        integral += dt * filtered
        command = gain * (settings.KP * filtered + settings.KI * integral)
        phi, gamma = sampled(self.model.A[:n, :n], self.model.B[:n, 1:], dt)
        a, q = np.zeros((n + 2, n + 2)), np.zeros((n + 2, n + 2))
        a[:n, :n] = phi
        a[:n] += gamma * command
        a[n], a[n + 1] = filtered, integral
        q[:n, :n] = self.noise
        if np.abs(np.linalg.eigvals(a)).max() >= 1.0:
            return Deviations(speed, lean, travel, power, 0.0, SHAFT_CEILING, *[float("inf")] * 2)
        x = stationary_covariance(a, q)
        eye = np.eye(n + 2)
        acceleration = self.model.B[SPEED, 1] * command
        acceleration[:n] += self.model.A[SPEED, :n]
        rows = (eye[SPEED], eye[LEAN], a[BLADE] - eye[BLADE], acceleration, eye[SURGE], eye[n + 1])
        std = [sqrt(row @ x @ row) for row in rows]
        known = std[0], std[1], GAUSSIAN_MEAN / dt * std[2], std[0] / rated
        limited = map(min, known, (speed, lean, travel, power))
        return Deviations(*limited, 0.0, self._inertia * std[3], *std[4:])


def limits(settings, wind, baseline, turbine):
    """Return {name of LIMITED: limit} at a wind (m/s), from the Deviations of gspi_oc3 at this wind."""
    lowest = equivalent_wind(turbine, lowest_design_wind(turbine))
    wind, degree = equivalent_wind(turbine, wind), DEGREE * travel_scale(turbine)
    if wind < NEAR_RATED:
        known = (settings.travel_near_rated, settings.travel_cap)
        travel = degree * np.interp(wind, (lowest, NEAR_RATED), known)
    else:
        travel = min(settings.travel * baseline.travel, degree * settings.travel_cap)
    lulls = np.interp(wind, (NEAR_RATED, NO_LULLS), (1.0, 0.0))
    return {
        "travel": float(travel),
        "power": settings.power * baseline.power,
        "torque": settings.torque,
        "shaft": lulls * settings.shaft_near_rated + (1.0 - lulls) * settings.shaft * baseline.shaft,
    }


def optimal_gain(loop, settings, start=None):
    """Return (gain (2, N_FEEDBACK), Deviations, log multipliers) for LQGSettings at the wind of a loop.

    start: log multipliers of a neighbouring wind. If not all limits are met within ROUNDS iterations, the
    gain with the smallest largest excess is returned.
    """
    rated, baseline, wind = loop.turbine.rated_rotor_speed, loop.baseline(), loop.model.wind
    limited = limits(settings, wind, baseline, loop.turbine)
    bounds = np.array([limited[name] for name in LIMITED])
    share = settings.share_at(equivalent_wind(loop.turbine, wind))
    aims = {"speed": (1.0 - share) / baseline.speed**2, "lean": share / baseline.lean**2}
    integral = settings.speed_integral / (0.5 * rated) ** 2
    multipliers = np.zeros(len(LIMITED)) if start is None else start
    steps, before = np.full(len(LIMITED), STEP), np.zeros(len(LIMITED))
    least, nearest = np.inf, None
    for _ in range(ROUNDS):
        prices = dict(zip(LIMITED, np.exp(multipliers) / bounds**2, strict=True))
        gain = loop.gain(aims | prices, integral, settings.torque_rate / 0.05**2)
        reached = loop.deviations(gain)
        excess = np.log(np.array([getattr(reached, name) for name in LIMITED]) / bounds)
        slack = (excess < 0.0) & (multipliers <= LOWEST)
        if np.all((np.abs(excess) < TOLERANCE) | slack):
            return gain, reached, multipliers
        if excess.max() < least:
            least, nearest = excess.max(), (gain, reached, multipliers)
        steps *= np.where(excess * before < 0.0, SHORTER, LONGER)
        before = excess
        multipliers = np.clip(multipliers + np.clip(steps * excess, -LARGEST, LARGEST), LOWEST, HIGHEST)
    return nearest


def optimal_gains(models, settings, turbine, dt):
    """Return the gains [(2, N_FEEDBACK)] of DesignModels in ascending order of wind.

    Below lowest_design_wind, with the pitch at its minimum, the gain of the lowest design wind is used.
    """
    gains, start, lowest = [], None, lowest_design_wind(turbine)
    for model in reversed(models):  # from strong wind, where all limits can be met, down to rated
        if model.wind < lowest and gains:
            gains.append(gains[-1])
            continue
        gain, _, start = optimal_gain(SampledLoop(model, turbine, dt), settings, start)
        gains.append(gain)
    return gains[::-1]
