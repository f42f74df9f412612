"""Computes the optimal linear control of a BoundPlant for given information: gains, deviations, fronts.

Controls are the rates of torque and pitch command. For a quadratic cost the optimal linear feedback is
state feedback on measured or estimated states, plus a term for the previewed wind. With P and K the
solution of the Riccati equation of plant and controls and the gain, F = A - B K, and the wind v known for the
time T ahead, that term is -R^-1 B^T g,

    g = int_0^T exp(F^T s) P e v(t + s) ds + exp(F^T T) X w(t + T),   F^T X + X a + P e c = 0,

with e the input vector of the wind, and w, a, c the states, matrix and output of the wind filter
(Tomizuka, 1975, Optimal continuous finite preview problem, IEEE Trans. Automatic Control 20, 362-365). For
T = 0 this is state feedback on plant and wind. A lidar is a further sensor, of the states of a delay line
(bound_lidar.py). Gains are optimal for the fitted weather. Deviations are
integrals over the spectra of the fitted or the true weather.
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm, solve_continuous_are, solve_sylvester

from fowt_env.controllers.lqr.design import SENSORS
from fowt_env.descriptions.sensors import sensor_chain, sensors_of
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.training.design.bound_plant import BLADE, LEAN, OMEGA, SPEED

SAMPLE_TIME = 0.1  # s, sample time of sensor noise
TORQUE_RATE = 1e-3  # cost of (torque rate / 5 % of rated per second)^2: keeps the problem well posed
COMMAND_RATE = 1e-4  # cost of (rate of the pitch command / 0.2 deg/s)^2: the same
# process noise of the plant's states per root second, far below the weather: no state is known exactly
LEAST_NOISE = np.array([1e-4, 1e-4, 1e-6, 1e-4, 1e-4, 1e-6, 1e-5, 1e-6])
FURTHER_NOISE = 1e-4  # of the states after PLANAR
TOLERANCE = 2e-3  # relative tolerance of the limits
ROUNDS = 80
STEP = 2.0  # change of the logarithm of a multiplier per relative excess
STEP_OF_ODDS = (
    20.0  # largest change of the logarithm of the odds of a weight, per relative error of the ratio
)
LEAST_RATIO = 1e-6  # lower bound of the ratio of a deviation to its limit, for the logarithm
START = np.log([1.0, 0.3, 0.1, 1e-3])  # logarithms of the multipliers of LIMITED
MOST_ODDS = 5.0  # largest logarithm of the odds of a weight
LOWEST, HIGHEST = np.log(1e-6), np.log(1e6)  # bounds of the logarithm of a multiplier
GAUSSIAN_MEAN = sqrt(2.0 / pi)  # mean |x| of a Gaussian over its standard deviation
MOTIONS = ("rotor_speed", "platform_pitch")  # fields of Deviations that are minimised
LIMITED = ("travel", "power", "torque", "torque_travel")
QUANTITIES = (*MOTIONS, *LIMITED)
RATES = ("travel", "torque_travel")  # mean absolute rates
TORQUE, COMMAND = 0, 1  # controls, after the states of the plant


@dataclass(frozen=True)
class Deviations:
    """Holds standard deviations of a closed loop: rad/s, rad, mean |rad/s|, of rated power and torque.

    torque_travel: mean absolute torque rate, rated torques per second.
    """

    rotor_speed: float
    platform_pitch: float
    travel: float
    power: float
    torque: float
    torque_travel: float


class Cost(NamedTuple):
    """Holds the quadratic cost of a Problem: Q (n, n) of its states, R (m, m) of its controls."""

    q: np.ndarray
    r: np.ndarray


@dataclass(frozen=True)
class Information:
    """Defines the information and actuators of a linear controller.

    sensors: names of lqr/design.py's SENSORS, or None: all states of plant and weather. preview: time for
    which the rotor-averaged wind is known ahead exactly, s; None: unknown (known now if sensors is None).
    torque: whether the generator torque is controlled. lidar: whether the BoundLidar of the Problem is read
    besides the sensors. text: label in plots.
    """

    text: str
    sensors: tuple | None = None
    preview: float | None = None
    torque: bool = True
    lidar: bool = False


class Problem:
    """Computes the optimal gains and the deviations of a BoundPlant for given Information.

    noise: {sensor: standard deviation of a sample every SAMPLE_TIME, SI}; None: noise_of().
    lidar: BoundLidar, read if the information has a lidar.
    Raises: InputError for sensors without a positive noise, and for information on a missing lidar.
    """

    def __init__(self, plant, information, noise=None, lidar=None):
        self.plant, self.information, n = plant, information, plant.n
        if information.lidar and lidar is None:
            raise InputError(f"{information.text}: a lidar must be given")
        self.lidar = lidar if information.lidar else None
        self.wind_filter = plant.wind_filter if self.lidar is None else self.lidar
        rated = plant.turbine.rated_rotor_speed
        self.controls = [0, 1] if information.torque else [1]
        self.states = [*range(n), *(n + j for j in self.controls)]
        a, b = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 2))
        a[:n, :n], a[:n, n:] = plant.A, plant.B
        b[n:] = np.eye(2)
        self.a, self.b = a[np.ix_(self.states, self.states)], b[np.ix_(self.states, self.controls)]
        eye = np.eye(n + 2)
        torque = eye[n + TORQUE]
        rows = {"rotor_speed": eye[SPEED], "platform_pitch": eye[LEAN], "travel": a[BLADE]}
        rows |= {"power": eye[SPEED] / rated + torque, "torque": torque, "torque_travel": 0.0 * torque}
        self.scale = {"rotor_speed": 0.05 * rated, "platform_pitch": DEGREE, "travel": 0.2 * DEGREE}
        self.scale |= {"power": 0.05, "torque": 0.05, "torque_travel": 0.01}
        self.rows = np.array([rows[name][self.states] / self.scale[name] for name in QUANTITIES])
        # the torque rate is a control, not a state
        self.of_rates = np.zeros((len(QUANTITIES), len(self.controls)))
        if information.torque:
            self.of_rates[QUANTITIES.index("torque_travel"), TORQUE] = 1.0 / self.scale["torque_travel"]
        rates = np.array([TORQUE_RATE / 0.05**2, COMMAND_RATE / (0.2 * DEGREE) ** 2])
        self.r = np.diag(rates[self.controls])
        self.wind = np.r_[plant.wind, np.zeros(len(self.controls))]
        self.waves = np.vstack([plant.E, np.zeros((len(self.controls), 3))])
        self.wind_drive = np.outer(self.wind, self.wind_filter.output)  # input from the filter states
        self.wave_drive = self.waves @ plant.force
        self.knows_wind = information.sensors is None or information.preview is not None
        # unit inputs: wind, elevation, white noise of each sensor, error of the lidar
        self.noise = self._noise(noise)
        self.estimates = {}

    def _noise(self, noise):
        """Return the two-sided noise intensity (k,) of the sensors in use, per rad/s."""
        if self.information.sensors is None:
            return np.zeros(0)
        noise = noise_of(turbine=self.plant.turbine) if noise is None else dict(noise)
        for name in self.information.sensors:
            if not noise.get(name, 0.0) > 0.0:
                raise InputError(f"noise: {name} = {noise.get(name)}: must be a positive standard deviation")
        own = [] if self.lidar is None else [self.lidar.noise]
        return np.array([*(noise[name] ** 2 * SAMPLE_TIME for name in self.information.sensors), *own])

    def cost(self, fraction, *multipliers):
        """Return the Cost for a weight of platform pitch and multipliers of LIMITED, zero if omitted."""
        weights = np.zeros(len(QUANTITIES))
        weights[: 2 + len(multipliers)] = 1.0 - fraction, fraction, *multipliers
        weights = weights[:, None]
        by_rates = (self.of_rates * weights).T @ self.of_rates
        return Cost((self.rows * weights).T @ self.rows, self.r + by_rates)

    def parts(self, deviations):
        """Return Deviations as an array (6,) of standard deviations in the units of the cost rows."""
        return np.array([
            getattr(deviations, name) / (self.scale[name] * (GAUSSIAN_MEAN if name in RATES else 1.0))
            for name in QUANTITIES
        ])  # fmt: skip

    def gains(self, cost):
        """Return (P, K): solution of the Riccati equation of a Cost and gain on plant and controls."""
        p = solve_continuous_are(self.a, self.b, cost.q, cost.r)
        return p, np.linalg.solve(cost.r, self.b.T @ p)

    def deviations(self, cost, weather):
        """Return Deviations under the optimal control for a Cost in a bound_plant.Weather."""
        p, k = self.gains(cost)
        closed, n, plant_states = self.a - self.b @ k, len(self.states), self.plant.n
        if id(weather) not in self.estimates:  # independent of the gains
            self.estimates[id(weather)] = weather, self._estimate(weather)
        errors, filters = self.estimates[id(weather)][1]
        inputs = errors.shape[2]
        drive = np.zeros((OMEGA.size, n, inputs), complex)
        drive[:, :, 0], drive[:, :, 1] = self.wind, weather.force @ self.waves.T
        gain = np.linalg.solve(cost.r, self.b.T)
        ahead = np.zeros((OMEGA.size, n, inputs), complex)
        wave = solve_sylvester(closed.T, self.plant.wave_filter.a, -p @ self.wave_drive)
        wind = solve_sylvester(closed.T, self.wind_filter.a, -p @ self.wind_drive)
        order = wind.shape[1]
        ahead += wave @ filters[:, order:]
        if self.knows_wind:
            ahead[:, :, 0] += self._ahead(closed, p, wind)
        else:
            ahead += wind @ filters[:, :order]
        # feedback acts on the estimate: state minus estimation error
        rates = k[:, :plant_states] @ errors - gain @ ahead
        drive += self.b @ rates
        moved = np.linalg.solve(1j * OMEGA[:, None, None] * np.eye(n) - closed, drive)
        rates -= k @ moved
        noise = np.broadcast_to(self.noise / pi, (OMEGA.size, self.noise.size))
        own = [] if self.lidar is None else [self.lidar.of(weather, self.plant)[1]]
        density = np.column_stack([weather.wind, weather.elevation, noise, *own])
        squares = np.abs(self.rows @ moved + self.of_rates @ rates) ** 2
        squares = np.einsum("nqk,nk->nq", squares, density)
        found = np.sqrt(np.trapezoid(squares, OMEGA, axis=0)) * [self.scale[name] for name in QUANTITIES]
        found *= [GAUSSIAN_MEAN if name in RATES else 1.0 for name in QUANTITIES]
        return Deviations(*(float(value) for value in found))

    def _ahead(self, closed, p, wind):
        """Return the preview term g (n, states) per wind speed, with the wind known over the preview time."""
        time = self.information.preview or 0.0
        at = self.plant.wind_filter
        states = at.states(OMEGA)
        states = states / (states @ at.output)[:, None]
        shift, later = expm(closed.T * time), np.exp(1j * OMEGA * time)[:, None]
        term = later * (states @ (shift @ wind).T)
        if time > 0.0:
            n = len(self.states)
            pe = p @ self.wind
            change = later * (shift @ pe) - pe
            within = closed.T + 1j * OMEGA[:, None, None] * np.eye(n)
            term = term + np.linalg.solve(within, change[:, :, None])[:, :, 0]
        return term

    def _estimate(self, weather):
        """Return (estimation error of the plant states, estimates of the filter states), (OMEGA.size, ., k).

        These are responses to each of k inputs in a weather, independent of the gains.
        """
        plant, waves, n = self.plant, self.plant.wave_filter, self.plant.n
        order = len(self.wind_filter.a)
        size, k = n + order + waves.b.size, 2 + self.noise.size + (self.lidar is not None)
        if self.information.sensors is None:
            response = np.zeros((OMEGA.size, size, k), complex)
            states = waves.states(OMEGA)
            elevation = (states @ waves.output)[:, None]
            np.divide(states, elevation, out=response[:, n + order :, 1], where=elevation != 0.0)
            return response[:, :n], response[:, n:]
        gain, c = self.estimator()
        used = [SENSORS.index(name) for name in self.information.sensors]
        # estimation error of the plant, and estimates of the weather
        sign = np.r_[np.ones(n), -np.ones(size - n)]
        loop = (self._with_filters()[0] - gain @ c) * sign[:, None] * sign
        drive = np.zeros((OMEGA.size, size, k), complex)
        drive[:, :n, 1] = weather.force @ plant.E.T
        by_waves = np.zeros((OMEGA.size, len(c)), complex)
        by_waves[:, : len(used)] = weather.force @ plant.F[used].T
        drive[:, :, 1] -= by_waves @ gain.T * sign
        if not self.knows_wind:
            by_wind = np.zeros((OMEGA.size, len(c)), complex)
            by_wind[:, : len(used)] = plant.Dwind[used]
            if self.lidar is not None:
                by_wind[:, -1] = self.lidar.of(weather, plant)[0]
                drive[:, :, -1] = -gain[:, -1] * sign  # error of the reading
            drive[:, :n, 0] = plant.wind
            drive[:, :, 0] -= by_wind @ gain.T * sign
        drive[:, :, 2 : 2 + self.noise.size] -= gain * sign[:, None]
        moved = np.linalg.solve(1j * OMEGA[:, None, None] * np.eye(size) - loop, drive)
        return moved[:, :n], moved[:, n:]

    def _with_filters(self):
        """Return (A, Q): system matrix of plant and filter states, and intensity of the process noise."""
        plant, wind, waves, n = self.plant, self.wind_filter, self.plant.wave_filter, self.plant.n
        a = block_diag(plant.A, wind.a, waves.a)
        a[:n, n:] = np.hstack([np.outer(plant.wind, wind.output), plant.E @ plant.force])
        least = np.r_[LEAST_NOISE, np.full(n - LEAST_NOISE.size, FURTHER_NOISE)]
        return a, block_diag(np.diag(least**2), wind.intensity, waves.intensity)

    def estimator(self):
        """Return (gain, C): Kalman gain and output matrix of the sensors, and of a lidar, for all states.

        Torque and pitch command are known inputs, and so is a known wind: the states of the wind filter are
        then not estimated and have no gain.
        """
        plant, wind, n = self.plant, self.wind_filter, self.plant.n
        used = [SENSORS.index(name) for name in self.information.sensors]
        a, q = self._with_filters()
        of_wind = np.outer(plant.Dwind[used], wind.output)
        c = np.hstack([plant.C[used], of_wind, plant.F[used] @ plant.force])
        if self.lidar is not None:
            row = np.zeros((1, len(a)))
            row[0, n : n + len(wind.a)] = wind.reading
            c = np.vstack([c, row])
        kept = np.r_[np.arange(n), np.arange(n + (len(wind.a) if self.knows_wind else 0), len(a))]
        r, read = np.diag(self.noise), c[:, kept]
        p = solve_continuous_are(a[np.ix_(kept, kept)].T, read.T, q[np.ix_(kept, kept)], r)
        gain = np.zeros((len(a), len(c)))
        gain[kept] = p @ read.T @ np.linalg.inv(r)
        return gain, c


def noise_of(chain="standard", turbine=None):
    """Return {sensor: standard deviation of a reading} of SENSORS for a sensor chain, a name or SensorChain.

    Includes noise and quantisation; neglects low pass and delay, which are fast compared with the plant.
    Raises: InputError for an unknown name, and for a chain that is exact or lacks one of SENSORS.
    """
    chosen = sensor_chain(chain) if turbine is None else sensors_of(chain, turbine)
    for name in SENSORS:
        if chosen is None or name not in chosen.sensors:
            raise InputError(
                f"sensors = {chain!r}: must be a chain with noise on each of {', '.join(SENSORS)}"
            )
    used = {name: chosen.sensors[name] for name in SENSORS}
    return {name: sqrt(sensor.noise**2 + sensor.step**2 / 12.0) for name, sensor in used.items()}


def front(problem, limits, fractions):
    """Return [(fraction, Deviations, Cost)] optimal for each weight of platform pitch; limits: Deviations.

    Deviations are in the plant's true weather. Each search starts with the multipliers of the one before,
    which are near, and where it does not converge in ROUNDS iterations again from START; fractions that
    do not converge either way are omitted.
    Raises: InputError if no fraction converges.
    """
    points, start = [], START
    for fraction in fractions:
        met = _met(problem, limits, fraction, start)
        if met[1] is None and start is not START:
            met = _met(problem, limits, fraction, START)
        start = met[-1]
        if met[1] is not None:
            points.append((float(fraction), *met[1:3]))
    if not points:
        raise InputError(f"{problem.information.text}: no gains meet the limits")
    return points


def towards(problem, limits, aim):
    """Return (fraction, Deviations, Cost) of the front where both motions have the ratio of aim, Deviations.

    Where no weight of platform pitch gives this ratio, the point at its end.
    Raises: InputError without convergence.
    """
    fraction, best, cost, _ = _met(problem, limits, 0.5, START, aim)
    if best is None:
        raise InputError(f"{problem.information.text}: no gains meet the limits")
    return fraction, best, cost


def _met(problem, limits, fraction, multipliers, aim=None):
    """Return (fraction, Deviations or None, Cost, log multipliers) at which the limits are met.

    Each multiplier grows while its limit is exceeded and shrinks while the limit is met. With an aim, the
    logarithm of the odds of the fraction grows while platform pitch is too large for the ratio of the aim.
    """
    most = np.r_[np.full(len(LIMITED), STEP), STEP_OF_ODDS]
    step, last = np.full(most.size, STEP), np.zeros(most.size)
    bounds = np.array([getattr(limits, name) for name in LIMITED])
    odds = np.log(fraction / (1.0 - fraction))
    for _ in range(ROUNDS):
        cost = problem.cost(fraction, *np.exp(multipliers))
        reached = problem.deviations(cost, problem.plant.true)
        values = np.array([getattr(reached, name) for name in LIMITED])
        excess = np.log(np.maximum(values / bounds, LEAST_RATIO))
        # a limit that is met at negligible cost is inactive
        parts = problem.parts(reached) ** 2
        cost_fraction = np.exp(multipliers) * parts[2:] / (parts[:2] @ [1.0 - fraction, fraction])
        slack = (excess < 0.0) & (cost_fraction < TOLERANCE)
        turned = 0.0
        if aim is not None:
            wanted = np.log(aim.platform_pitch / aim.rotor_speed)
            turned = np.log(reached.platform_pitch / reached.rotor_speed) - wanted
        at_end = abs(odds) >= MOST_ODDS and turned * odds > 0.0
        if np.all((np.abs(excess) < TOLERANCE) | slack) and (abs(turned) < TOLERANCE or at_end):
            break
        # smaller steps after an overshoot
        both = np.r_[excess, turned]
        step = np.where(both * last < 0.0, 0.5 * step, np.minimum(1.2 * step, most))
        last = both
        multipliers = np.clip(multipliers + step[:-1] * excess, LOWEST, HIGHEST)
        if aim is not None:
            odds = float(np.clip(odds + step[-1] * turned, -MOST_ODDS, MOST_ODDS))
            fraction = 1.0 / (1.0 + np.exp(-odds))
    met = excess.max() < 2.0 * TOLERANCE and (at_end or abs(turned) < 5.0 * TOLERANCE)
    return fraction, reached if met else None, cost, multipliers


def baseline_deviations(plant, weather):
    """Return Deviations under gspi_oc3 in a bound_plant.Weather; at constant torque power follows speed."""
    responses = plant.baseline_response(weather)

    def deviation(row, weight=1.0):
        parts = zip(responses, (weather.wind, weather.elevation), strict=True)
        squares = sum(np.abs((moved @ row) * weight) ** 2 * density for moved, density in parts)
        return sqrt(np.trapezoid(squares, OMEGA))

    eye = np.eye(plant.n)
    speed, lean = deviation(eye[SPEED]), deviation(eye[LEAN])
    travel = GAUSSIAN_MEAN * deviation(eye[BLADE], OMEGA)
    return Deviations(speed, lean, travel, speed / plant.turbine.rated_rotor_speed, 0.0, 0.0)
