"""The best linear control of a bound_plant.BoundPlant for what it knows: gains, deviations, Pareto fronts.

Controls are the rates of torque and pitch command. With a quadratic cost the best of all linear feedback is
state feedback on what is known or estimated, with a term for the wind that is to come. With P and K the
solution of the Riccati equation of plant and controls and its gain, F = A - B K, and the wind v known for the
time T ahead, that term is -R^-1 B^T g,

    g = int_0^T exp(F^T s) P e v(t + s) ds + exp(F^T T) X w(t + T),   F^T X + X a + P e c = 0,

with e what the wind does to the plant, and w, a, c the states, matrix and output of the wind's filter
(Tomizuka, 1975, Optimal continuous finite preview problem, IEEE Trans. Automatic Control 20, 362-365). For
T = 0 it is state feedback on plant and wind. Gains are optimal for the fitted weather. Deviations are
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

SAMPLE_TIME = 0.1  # s, at which the noise of a sensor holds per sample
TORQUE_RATE = 1e-3  # cost of (torque rate / 5 % of rated a second)^2: keeps the problem well posed
COMMAND_RATE = 1e-4  # cost of (rate of the pitch command / 0.2 deg/s)^2: the same
# on the plant's states per root second, so that no state is known for certain: far below the weather's effect
LEAST_NOISE = np.diag([1e-4, 1e-4, 1e-6, 1e-4, 1e-4, 1e-6, 1e-5, 1e-6]) ** 2
TOLERANCE = 2e-3  # of the limits, relative
ROUNDS = 80
STEP = 2.0  # of the multipliers' logarithms per relative excess
LEAST_RATIO = 1e-6  # of a deviation to its limit, of which the logarithm is taken
LOWEST, HIGHEST = np.log(1e-6), np.log(1e6)  # of a multiplier
GAUSSIAN_MEAN = sqrt(2.0 / pi)  # mean |x| of a Gaussian over its standard deviation
QUANTITIES = ("rotor_speed", "platform_pitch", "travel", "power", "torque")  # fields of Deviations
LIMITED = ("travel", "power", "torque")
TORQUE, COMMAND = N, N + 1  # states of the controls, after those of the plant


@dataclass(frozen=True)
class Deviations:
    """Standard deviations of a closed loop: rad/s, rad, mean |rad/s|, fractions of rated power and torque."""

    rotor_speed: float
    platform_pitch: float
    travel: float
    power: float
    torque: float


@dataclass(frozen=True)
class Information:
    """What a linear controller knows and moves.

    sensors: names of lqr/design.py's SENSORS, or None: all states of plant and weather. preview: s for which
    the rotor-averaged wind is known ahead, exactly; None: not even now, unless all is known. torque: whether
    it moves the generator torque. text: for plots.
    """

    text: str
    sensors: tuple | None = None
    preview: float | None = None
    torque: bool = True


class Problem:
    """A BoundPlant with what a controller knows: the best gains for a cost, and the deviations under them.

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
        self.wind_drive = np.outer(self.wind, plant.wind_filter.output)  # from the filters' states
        self.wave_drive = self.waves @ plant.force
        self.knows_wind = information.sensors is None or information.preview is not None
        # one unit of each is one of wind, of elevation and of each sensor's noise
        self.noise = self._noise(noise)
        self.estimates = {}

    def _noise(self, noise):
        """Return (k,) intensity of the noise of the sensors in use, per rad/s and both sides."""
        if self.information.sensors is None:
            return np.zeros(0)
        noise = noise_of(turbine=self.plant.turbine) if noise is None else dict(noise)
        for name in self.information.sensors:
            if not noise.get(name, 0.0) > 0.0:
                raise InputError(f"noise: {name} = {noise.get(name)}: must be a standard deviation above 0")
        return np.array([noise[name] ** 2 * SAMPLE_TIME for name in self.information.sensors])

    def cost(self, fraction, *multipliers):
        """Return Q with a fraction of platform pitch and multipliers on travel, power and torque."""
        weights = np.array([1.0 - fraction, fraction, *multipliers])
        return (self.rows * weights[:, None]).T @ self.rows

    def parts(self, deviations):
        """Return (5,) Deviations in the units of the cost's rows."""
        found = np.array([getattr(deviations, name) / self.scale[name] for name in QUANTITIES])
        found[QUANTITIES.index("travel")] /= GAUSSIAN_MEAN
        return found

    def gains(self, q):
        """Return (P, K): solution of the Riccati equation and gain on plant and controls."""
        p = solve_continuous_are(self.a, self.b, q, self.r)
        return p, np.linalg.solve(self.r, self.b.T @ p)

    def deviations(self, q, weather):
        """Return Deviations under the best control for the cost q, in a bound_plant.Weather."""
        p, k = self.gains(q)
        closed, n = self.a - self.b @ k, len(self.states)
        if id(weather) not in self.estimates:  # the same for all gains
            self.estimates[id(weather)] = weather, self._estimate(weather)
        errors, filters = self.estimates[id(weather)][1]
        inputs = 2 + self.noise.size
        drive = np.zeros((OMEGA.size, n, inputs), complex)
        drive[:, :, 0], drive[:, :, 1] = self.wind, weather.force @ self.waves.T
        # the feedback acts on the estimate, the state less its error
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
        """Return (n, states) g of the wind per wind speed, with that known for the preview's time ahead."""
        time = self.information.preview or 0.0
        at = self.plant.wind_filter
        states = at.states(OMEGA)
        states = states / (states @ at.output)[:, None]
        shift, later = expm(closed.T * time), np.exp(1j * OMEGA * time)[:, None]
        found = later * (states @ (shift @ wind).T)
        if time > 0.0:
            n = len(self.states)
            pe = p @ self.wind
            change = later * (shift @ pe) - pe
            within = closed.T + 1j * OMEGA[:, None, None] * np.eye(n)
            found = found + np.linalg.solve(within, change[:, :, None])[:, :, 0]
        return found

    def _estimate(self, weather):
        """Return (plant's state less its estimate, estimates of the filters' states), both (n, 8, k).

        Responses over OMEGA to each of k inputs in a weather; the gains do not matter.
        """
        plant, k = self.plant, 2 + self.noise.size
        waves, order = plant.wave_filter, plant.wind_filter.b.size
        size = N + order + waves.b.size
        if self.information.sensors is None:
            found = np.zeros((OMEGA.size, size, k), complex)
            states = waves.states(OMEGA)
            elevation = (states @ waves.output)[:, None]
            np.divide(states, elevation, out=found[:, N + order :, 1], where=elevation != 0.0)
            return found[:, :N], found[:, N:]
        gain, c = self.estimator()
        used = [SENSORS.index(name) for name in self.information.sensors]
        # state of the plant less its estimate, and estimates of the weather
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
        """Return (A, Q) of the plant with the filters' states, and the intensity of the noise on them."""
        plant, wind, waves = self.plant, self.plant.wind_filter, self.plant.wave_filter
        a = block_diag(plant.A, wind.a, waves.a)
        a[:N, N:] = np.hstack([np.outer(plant.wind, wind.output), plant.E @ plant.force])
        return a, block_diag(LEAST_NOISE, np.outer(wind.b, wind.b), np.outer(waves.b, waves.b))

    def estimator(self):
        """Return (gain, C): Kalman gain on plant and filters' states, and what the sensors read of these.

        Torque and pitch command are known. A wind that is known acts through them alike: its filter's states
        are not estimated, and have no gain.
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
    """Return {sensor: standard deviation of a reading} of SENSORS through a chain, a name or SensorChain.

    Noise and quantisation together; low pass and delay, small beside the plant's times, are left out.
    Raises: InputError for an unknown name, and for a chain without one of SENSORS or that is exact.
    """
    found = sensor_chain(chain) if turbine is None else sensors_of(chain, turbine)
    for name in SENSORS:
        if found is None or name not in found.sensors:
            raise InputError(
                f"sensors = {chain!r}: must be a chain with noise on each of {', '.join(SENSORS)}"
            )
    used = {name: found.sensors[name] for name in SENSORS}
    return {name: sqrt(sensor.noise**2 + sensor.step**2 / 12.0) for name, sensor in used.items()}


def front(problem, limits, fractions):
    """Return [(fraction, Deviations, cost)] best for each fraction of platform pitch; limits: Deviations.

    In the plant's true weather. Each multiplier grows while its limit is exceeded and shrinks while it is
    kept. Fractions at which ROUNDS rounds of that end outside the limits are left out.
    Raises: InputError where that is all of them.
    """
    found, multipliers = [], np.log([1.0, 0.3, 0.1])
    wanted = np.array([getattr(limits, name) for name in LIMITED])
    for fraction in fractions:
        step, last = np.full(len(LIMITED), STEP), np.zeros(len(LIMITED))
        for _ in range(ROUNDS):
            q = problem.cost(fraction, *np.exp(multipliers))
            reached = problem.deviations(q, problem.plant.true)
            values = np.array([getattr(reached, name) for name in LIMITED])
            excess = np.log(np.maximum(values / wanted, LEAST_RATIO))
            # a limit that is kept, and whose cost counts for nothing, does not hold anything
            parts = problem.parts(reached) ** 2
            share = np.exp(multipliers) * parts[2:] / (parts[:2] @ [1.0 - fraction, fraction])
            slack = (excess < 0.0) & (share < TOLERANCE)
            if np.all((np.abs(excess) < TOLERANCE) | slack):
                break
            # smaller steps where the last one went too far
            step = np.where(excess * last < 0.0, 0.5 * step, np.minimum(1.2 * step, STEP))
            last = excess
            multipliers = np.clip(multipliers + step * excess, LOWEST, HIGHEST)
        if excess.max() < 2.0 * TOLERANCE:
            found.append((float(fraction), reached, q))
    if not found:
        raise InputError(f"{problem.information.text}: no gains meet the limits")
    return found


def baseline_deviations(plant, weather):
    """Return Deviations under gspi_oc3 in a bound_plant.Weather; constant torque: power goes with speed."""
    responses = plant.baseline_response(weather)

    def deviation(row, weight=1.0):
        parts = zip(responses, (weather.wind, weather.elevation), strict=True)
        squares = sum(np.abs((moved @ row) * weight) ** 2 * density for moved, density in parts)
        return sqrt(np.trapezoid(squares, OMEGA))

    eye = np.eye(N)
    speed, lean = deviation(eye[SPEED]), deviation(eye[LEAN])
    travel = GAUSSIAN_MEAN * deviation(eye[BLADE], OMEGA)
    return Deviations(speed, lean, travel, speed / plant.turbine.rated_rotor_speed, 0.0)
