"""Computes the optimal linear control of a BoundPlant for given information: gains, deviations, fronts.

Controls are the rates of torque and pitch command. For a quadratic cost the optimal linear feedback is
state feedback on measured or estimated states, plus a term for the previewed wind. With P and K the
solution of the Riccati equation of plant and controls and the gain, F = A - B K, and the wind v known for the
time T ahead, that term is -R^-1 B^T g,

    g = int_0^T exp(F^T s) P e v(t + s) ds + exp(F^T T) X w(t + T),   F^T X + X a + P e c = 0,

with e the input vector of the wind, and w, a, c the states, matrix and output of the wind filter
(Tomizuka, 1975, Optimal continuous finite preview problem, IEEE Trans. Automatic Control 20, 362-365). For
T = 0 this is state feedback on plant and wind. Gains are optimal for the fitted weather. Deviations are
integrals over the spectra of the fitted or the true weather.
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from scipy.linalg import block_diag, expm, solve_continuous_are, solve_sylvester

from fowt_env.controllers.lqr.design import SENSORS
from fowt_env.descriptions.sensors import sensor_chain, sensors_of
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.training.design.bound_plant import BLADE, LEAN, OMEGA, SPEED, N

SAMPLE_TIME = 0.1  # s, sample time of sensor noise
TORQUE_RATE = 1e-3  # cost of (torque rate / 5 % of rated per second)^2: keeps the problem well posed
COMMAND_RATE = 1e-4  # cost of (rate of the pitch command / 0.2 deg/s)^2: the same
# process noise of the plant's states per root second, far below the weather: no state is known exactly
LEAST_NOISE = np.diag([1e-4, 1e-4, 1e-6, 1e-4, 1e-4, 1e-6, 1e-5, 1e-6]) ** 2
TOLERANCE = 2e-3  # relative tolerance of the limits
ROUNDS = 80
STEP = 2.0  # change of the logarithm of a multiplier per relative excess
LEAST_RATIO = 1e-6  # lower bound of the ratio of a deviation to its limit, for the logarithm
LOWEST, HIGHEST = np.log(1e-6), np.log(1e6)  # bounds of the logarithm of a multiplier
GAUSSIAN_MEAN = sqrt(2.0 / pi)  # mean |x| of a Gaussian over its standard deviation
QUANTITIES = ("rotor_speed", "platform_pitch", "travel", "power", "torque")  # fields of Deviations
LIMITED = ("travel", "power", "torque")
TORQUE, COMMAND = N, N + 1  # states of the controls, after those of the plant


@dataclass(frozen=True)
class Deviations:
    """Holds standard deviations of a closed loop: rad/s, rad, mean |rad/s|, of rated power and torque."""

    rotor_speed: float
    platform_pitch: float
    travel: float
    power: float
    torque: float


@dataclass(frozen=True)
class Information:
    """Defines the information and actuators of a linear controller.

    sensors: names of lqr/design.py's SENSORS, or None: all states of plant and weather. preview: time for
    which the rotor-averaged wind is known ahead exactly, s; None: unknown (known now if sensors is None).
    torque: whether the generator torque is controlled. text: label in plots.
    """

    text: str
    sensors: tuple | None = None
    preview: float | None = None
    torque: bool = True


class Problem:
    """Computes the optimal gains and the deviations of a BoundPlant for given Information.

    noise: {sensor: standard deviation of a sample every SAMPLE_TIME, SI}; None: noise_of().
    Raises: InputError for sensors without a positive noise.
    """

    def __init__(self, plant, information, noise=None):
        self.plant, self.information = plant, information
        rated = plant.turbine.rated_rotor_speed
        self.controls = [0, 1] if information.torque else [1]
        self.states = [*range(N), *(N + j for j in self.controls)]
        n = N + 2
        a, b = np.zeros((n, n)), np.zeros((n, 2))
        a[:N, :N], a[:N, N:] = plant.A, plant.B
        b[TORQUE, 0] = b[COMMAND, 1] = 1.0
        self.a, self.b = a[np.ix_(self.states, self.states)], b[np.ix_(self.states, self.controls)]
        eye = np.eye(n)
        power = eye[SPEED] / rated + eye[TORQUE]
        rows = {"rotor_speed": eye[SPEED], "platform_pitch": eye[LEAN], "travel": a[BLADE]}
        rows |= {"power": power, "torque": eye[TORQUE]}
        self.scale = {"rotor_speed": 0.05 * rated, "platform_pitch": DEGREE, "travel": 0.2 * DEGREE}
        self.scale |= {"power": 0.05, "torque": 0.05}
        self.rows = np.array([rows[name][self.states] / self.scale[name] for name in QUANTITIES])
        rates = np.array([TORQUE_RATE / 0.05**2, COMMAND_RATE / (0.2 * DEGREE) ** 2])
        self.r = np.diag(rates[self.controls])
        self.wind = np.r_[plant.wind, np.zeros(len(self.controls))]
        self.waves = np.vstack([plant.E, np.zeros((len(self.controls), 3))])
        self.wind_drive = np.outer(self.wind, plant.wind_filter.output)  # input from the filter states
        self.wave_drive = self.waves @ plant.force
        self.knows_wind = information.sensors is None or information.preview is not None
        # unit inputs: white noise of wind, of elevation and of each sensor
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
        return np.array([noise[name] ** 2 * SAMPLE_TIME for name in self.information.sensors])

    def cost(self, fraction, *multipliers):
        """Return cost matrix Q for a weight of platform pitch and multipliers of travel, power, torque."""
        weights = np.array([1.0 - fraction, fraction, *multipliers])
        return (self.rows * weights[:, None]).T @ self.rows

    def parts(self, deviations):
        """Return Deviations as an array (5,) in the units of the cost rows."""
        values = np.array([getattr(deviations, name) / self.scale[name] for name in QUANTITIES])
        values[QUANTITIES.index("travel")] /= GAUSSIAN_MEAN
        return values

    def gains(self, q):
        """Return (P, K): solution of the Riccati equation and gain on plant and controls."""
        p = solve_continuous_are(self.a, self.b, q, self.r)
        return p, np.linalg.solve(self.r, self.b.T @ p)

    def deviations(self, q, weather):
        """Return Deviations under the optimal control for the cost q in a bound_plant.Weather."""
        p, k = self.gains(q)
        closed, n = self.a - self.b @ k, len(self.states)
        if id(weather) not in self.estimates:  # independent of the gains
            self.estimates[id(weather)] = weather, self._estimate(weather)
        errors, filters = self.estimates[id(weather)][1]
        inputs = 2 + self.noise.size
        drive = np.zeros((OMEGA.size, n, inputs), complex)
        drive[:, :, 0], drive[:, :, 1] = self.wind, weather.force @ self.waves.T
        # feedback acts on the estimate: state minus estimation error
        drive += self.b @ (k[:, :N] @ errors)
        gain = np.linalg.solve(self.r, self.b.T)
        ahead = np.zeros((OMEGA.size, n, inputs), complex)
        wave = solve_sylvester(closed.T, self.plant.wave_filter.a, -p @ self.wave_drive)
        wind = solve_sylvester(closed.T, self.plant.wind_filter.a, -p @ self.wind_drive)
        order = wind.shape[1]
        ahead += wave @ filters[:, order:]
        if self.knows_wind:
            ahead[:, :, 0] += self._ahead(closed, p, wind)
        else:
            ahead += wind @ filters[:, :order]
        drive -= (self.b @ gain) @ ahead
        moved = np.linalg.solve(1j * OMEGA[:, None, None] * np.eye(n) - closed, drive)
        noise = np.broadcast_to(self.noise / pi, (OMEGA.size, self.noise.size))
        density = np.column_stack([weather.wind, weather.elevation, noise])
        squares = np.einsum("nqk,nk->nq", np.abs(self.rows @ moved) ** 2, density)
        found = np.sqrt(np.trapezoid(squares, OMEGA, axis=0)) * [self.scale[name] for name in QUANTITIES]
        found[QUANTITIES.index("travel")] *= GAUSSIAN_MEAN
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
        """Return (estimation error of the plant states, estimates of the filter states), both (n, 8, k).

        These are responses over OMEGA to each of k inputs in a weather, independent of the gains.
        """
        plant, k = self.plant, 2 + self.noise.size
        waves, order = plant.wave_filter, plant.wind_filter.b.size
        size = N + order + waves.b.size
        if self.information.sensors is None:
            response = np.zeros((OMEGA.size, size, k), complex)
            states = waves.states(OMEGA)
            elevation = (states @ waves.output)[:, None]
            np.divide(states, elevation, out=response[:, N + order :, 1], where=elevation != 0.0)
            return response[:, :N], response[:, N:]
        gain, c = self.estimator()
        used = [SENSORS.index(name) for name in self.information.sensors]
        # estimation error of the plant, and estimates of the weather
        sign = np.r_[np.ones(N), -np.ones(size - N)]
        loop = (self._with_filters()[0] - gain @ c) * sign[:, None] * sign
        drive = np.zeros((OMEGA.size, size, k), complex)
        drive[:, :N, 1] = weather.force @ plant.E.T
        drive[:, :, 1] -= (weather.force @ plant.F[used].T) @ gain.T * sign
        if not self.knows_wind:
            drive[:, :N, 0] = plant.wind
            drive[:, :, 0] -= gain @ plant.Dwind[used] * sign
        drive[:, :, 2:] -= gain * sign[:, None]
        moved = np.linalg.solve(1j * OMEGA[:, None, None] * np.eye(size) - loop, drive)
        return moved[:, :N], moved[:, N:]

    def _with_filters(self):
        """Return (A, Q): system matrix of plant and filter states, and intensity of the process noise."""
        plant, wind, waves = self.plant, self.plant.wind_filter, self.plant.wave_filter
        a = block_diag(plant.A, wind.a, waves.a)
        a[:N, N:] = np.hstack([np.outer(plant.wind, wind.output), plant.E @ plant.force])
        return a, block_diag(LEAST_NOISE, np.outer(wind.b, wind.b), np.outer(waves.b, waves.b))

    def estimator(self):
        """Return (gain, C): Kalman gain and output matrix of the sensors for plant and filter states.

        Torque and pitch command are known inputs, and so is a known wind: the states of the wind filter are
        then not estimated and have no gain.
        """
        plant, wind = self.plant, self.plant.wind_filter
        used = [SENSORS.index(name) for name in self.information.sensors]
        a, q = self._with_filters()
        of_wind = np.outer(plant.Dwind[used], wind.output)
        c = np.hstack([plant.C[used], of_wind, plant.F[used] @ plant.force])
        kept = np.r_[np.arange(N), np.arange(N + (wind.b.size if self.knows_wind else 0), len(a))]
        r, read = np.diag(self.noise), c[:, kept]
        p = solve_continuous_are(a[np.ix_(kept, kept)].T, read.T, q[np.ix_(kept, kept)], r)
        gain = np.zeros((len(a), len(used)))
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
    """Return [(fraction, Deviations, cost)] optimal for each weight of platform pitch; limits: Deviations.

    Deviations are in the plant's true weather. Each multiplier grows while its limit is exceeded and shrinks
    while the limit is met. Fractions without convergence in ROUNDS iterations are omitted.
    Raises: InputError if no fraction converges.
    """
    points, multipliers = [], np.log([1.0, 0.3, 0.1])
    bounds = np.array([getattr(limits, name) for name in LIMITED])
    for fraction in fractions:
        step, last = np.full(len(LIMITED), STEP), np.zeros(len(LIMITED))
        for _ in range(ROUNDS):
            q = problem.cost(fraction, *np.exp(multipliers))
            reached = problem.deviations(q, problem.plant.true)
            values = np.array([getattr(reached, name) for name in LIMITED])
            excess = np.log(np.maximum(values / bounds, LEAST_RATIO))
            # a limit that is met at negligible cost is inactive
            parts = problem.parts(reached) ** 2
            cost_fraction = np.exp(multipliers) * parts[2:] / (parts[:2] @ [1.0 - fraction, fraction])
            slack = (excess < 0.0) & (cost_fraction < TOLERANCE)
            if np.all((np.abs(excess) < TOLERANCE) | slack):
                break
            # smaller steps after an overshoot
            step = np.where(excess * last < 0.0, 0.5 * step, np.minimum(1.2 * step, STEP))
            last = excess
            multipliers = np.clip(multipliers + step * excess, LOWEST, HIGHEST)
        if excess.max() < 2.0 * TOLERANCE:
            points.append((float(fraction), reached, q))
    if not points:
        raise InputError(f"{problem.information.text}: no gains meet the limits")
    return points


def baseline_deviations(plant, weather):
    """Return Deviations under gspi_oc3 in a bound_plant.Weather; at constant torque power follows speed."""
    responses = plant.baseline_response(weather)

    def deviation(row, weight=1.0):
        parts = zip(responses, (weather.wind, weather.elevation), strict=True)
        squares = sum(np.abs((moved @ row) * weight) ** 2 * density for moved, density in parts)
        return sqrt(np.trapezoid(squares, OMEGA))

    eye = np.eye(N)
    speed, lean = deviation(eye[SPEED]), deviation(eye[LEAN])
    travel = GAUSSIAN_MEAN * deviation(eye[BLADE], OMEGA)
    return Deviations(speed, lean, travel, speed / plant.turbine.rated_rotor_speed, 0.0)
