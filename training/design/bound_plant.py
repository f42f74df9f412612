"""Defines plant and weather of the performance limit: planar states with linear drag, and fitted filters.

Per wind speed: surge, heave and platform pitch, rotor and pitch actuator, the first bending of an elastic
tower and of elastic blades, and dynamic inflow, with hull drag linearised for the sea and for the motion
under gspi_oc3; faster modes of the structure are in equilibrium. The rotor-averaged Kaimal wind is white
noise through a filter of order 3 with one zero, the elevation white noise through two resonators in series,
and the wave force on the hull a combination of the resonator states. BoundPlant.fitted has these spectra;
BoundPlant.true has the spectra from which runs are drawn and the exact hull force at each frequency.
"""

from dataclasses import dataclass
from functools import reduce
from math import pi, sqrt

import numpy as np
from scipy.optimize import least_squares

from fowt_env.analysis.linear_drag import HullMotion, elevation_spectrum, linear_drag, with_drag
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.linear_plant import WAKE
from fowt_env.analysis.reduced_model import residualised, with_reduced_wake
from fowt_env.analysis.wave_excitation import wave_force
from fowt_env.controllers.gains import with_gains
from fowt_env.controllers.lqr.design import LAST_SEA_WIND, SENSORS, SITE, TURBULENCE_CLASS, scene_at
from fowt_env.controllers.pi import PISettings, schedule_gain
from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.descriptions.sea_state import joint_sea_state, sea_state_of
from fowt_env.errors import InputError
from fowt_env.weather.turbulence import amplitudes, fft_length

PLANAR = ("surge", "heave", "platform_pitch", "vx", "vz", "wy", "rotor_speed", "blade_pitch")
IN_PLANE = (0, 2, 4)  # indices of surge, heave and platform pitch in forces and velocities of the hull
N = len(PLANAR)
BENDING = ("tower_fore_aft", "tower_fore_aft_rate", "flap_1", "flap_1_rate")  # below 1 Hz, if there are any
WAKE_ORDER = 4  # states of dynamic inflow, of four per annulus
LEAN, VX, VZ, WY, SPEED, BLADE = (
    PLANAR.index(name) for name in ("platform_pitch", "vx", "vz", "wy", "rotor_speed", "blade_pitch")
)
RECORD = 800.0  # s, length of the wind records of the named suites: no slower components
SMALLEST_ROTOR = 200.0  # m2 of swept area, above which the wind models of IEC 61400-1 apply
SLOWEST = pi / RECORD  # rad/s, half the lowest frequency of a record
WIND_BAND = (1.0 / RECORD, 0.25)  # Hz, band of the wind fit
WAVE_BAND = (0.5, 3.0)  # peak frequencies, band of the elevation fit
LOWEST_FORCE = 0.1  # rad/s, above which the force fit is weighted by 1/frequency
# rad/s: dense at the resonances of platform and waves, wide enough for sensor noise
OMEGA = np.r_[
    np.geomspace(1e-4, 0.999 * SLOWEST, 16), SLOWEST * np.arange(1, 510),
    np.geomspace(510 * SLOWEST, 6.0, 50, endpoint=False), np.geomspace(6.0, 100.0, 60),
]  # fmt: skip
ROUNDS, SETTLED = 40, 1e-4  # iterations and tolerance for drag and motion under gspi_oc3
START = np.diag([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # m2/s2, initial guess of the motion: surge


@dataclass(frozen=True)
class Filter:
    """Models a signal as unit white noise through the filter dx = a x + b noise.

    output (m,) gives wind speed (m/s) or elevation (m). error: integral of the absolute difference from the
    fitted spectrum over the variance, at frequencies where that spectrum is not zero.
    """

    a: np.ndarray
    b: np.ndarray
    output: np.ndarray
    error: float

    @property
    def intensity(self):
        """Return the intensity (m, m) of the noise of the states."""
        return np.outer(self.b, self.b)

    def states(self, omega):
        """Return the complex response (n, m) of the states to the noise."""
        eye = np.eye(self.b.size)
        return np.linalg.solve(1j * omega[:, None, None] * eye - self.a, self.b[:, None])[:, :, 0]

    def density(self, omega):
        """Return the one-sided spectrum (n,) of the output, per rad/s."""
        return np.abs(self.states(omega) @ self.output) ** 2 / pi


@dataclass(frozen=True)
class Weather:
    """Holds spectra (n,) of wind and elevation over OMEGA, per rad/s; in-plane force (n, 3) per elevation."""

    wind: np.ndarray
    elevation: np.ndarray
    force: np.ndarray


class BoundPlant:
    """Holds the linear plant and weather of one wind speed (SI, deviations from trim).

    A (n, n) of `states` (PLANAR first, then those of BENDING and of the reduced wake that the plant has),
    B (n, 2) of torque (in rated torques) and pitch command, wind (n,), E (n, 3) of in-plane forces; C, D,
    Dwind, F the same of SENSORS. wind_filter and wave_filter are Filters, force (3, 4)
    maps the states of the latter to wave force; fitted and true are Weathers. drag is the LinearDrag.
    Raises: InputError if the blade pitch is at its limit, for a rotor too small for the wind models of
    IEC 61400-1, and if gspi_oc3 does not stabilise the plant.
    """

    def __init__(self, scene, wind, sea=None):
        self.wind_speed, self.turbine = float(wind), with_gains(scene)
        area = pi * scene.turbine.rotor.tip_radius**2
        if area <= SMALLEST_ROTOR:
            raise InputError(
                f"swept area = {area:.3g} m2: the performance limit uses the turbulence of"
                f" IEC 61400-1, which applies above {SMALLEST_ROTOR:g} m2"
            )
        if sea is None:
            sea = joint_sea_state(SITE, min(self.wind_speed, LAST_SEA_WIND))
        self.sea = sea_state_of(sea)
        whole = with_reduced_wake(linearize(scene_at(scene, wind)), WAKE_ORDER)
        further = [name for name in whole.states if name in BENDING or name.startswith(WAKE)]
        self.states = (*PLANAR, *further)
        self.n = len(self.states)
        model = residualised(whole, keep=further)
        if model.pitch_rests:
            raise InputError(
                f"wind = {wind:g}: the blade pitch is at its limit, so no controller can move it"
            )
        self.torque, self.pitch = (float(value) for value in model.point.command[:2])
        elevation = elevation_spectrum(self.sea, OMEGA)
        force = np.zeros((OMEGA.size, 3), complex)
        here = elevation > 0.0
        if here.any():
            force[here] = wave_force(scene, model.point.state, OMEGA[here])[:, IN_PLANE]
        self.true = Weather(_wind_spectrum(self.wind_speed, scene.turbine.rotor), elevation, force)
        self._settle_drag(scene, model)
        self.wind_filter = fit_wind(self.true.wind)
        self.wave_filter, self.force, self.force_errors = fit_waves(self.true, self.sea)
        states = self.wave_filter.states(OMEGA)
        elevation = (states @ self.wave_filter.output)[:, None]
        zero, here = np.zeros_like(self.true.force), elevation != 0.0
        force = np.divide(states @ self.force.T, elevation, out=zero, where=here)
        self.fitted = Weather(self.wind_filter.density(OMEGA), self.wave_filter.density(OMEGA), force)

    def _settle_drag(self, scene, model):
        """Linearise the drag for the sea and the motion under gspi_oc3, which depends on the drag."""
        strips, motion, damping = self.true, HullMotion(0.0, START), np.inf
        for _ in range(ROUNDS):
            drag = linear_drag(scene, model.point.state, OMEGA, self.sea, motion)
            self._take(with_drag(model, drag))
            self.true = Weather(strips.wind, strips.elevation, strips.force + drag.excitation[:, IN_PLANE])
            scale = np.abs(drag.damping).max()
            if np.abs(drag.damping - damping).max() <= SETTLED * scale:
                break
            damping, updated = drag.damping, self._motion()
            # half steps: more drag gives less motion, so that full steps would oscillate
            motion = HullMotion(0.5 * (motion.waves + updated.waves), 0.5 * (motion.other + updated.other))
        self.drag = drag

    def _take(self, model):
        """Set the matrices from a LinearModel."""
        rows = [model.index(name) for name in self.states]
        sensors = [model.output_index(name) for name in SENSORS]
        units = np.array([self.torque, 1.0])  # torque in units of rated torque
        self.A, self.B, self.wind = model.A[np.ix_(rows, rows)], model.B[rows, :2] * units, model.B[rows, 2]
        self.C = model.C[np.ix_(sensors, rows)]
        self.D, self.Dwind = model.D[sensors, :2] * units, model.D[sensors, 2]
        self.E, self.F = model.E[np.ix_(rows, IN_PLANE)], model.F[np.ix_(sensors, IN_PLANE)]

    def baseline(self):
        """Return the closed loop of gspi_oc3: `states`, filtered rotor speed, integral of its error.

        The law in continuous time, with the slope of its schedule (theory.md, Eq. (A7)) and its speed filter.
        Raises: InputError if the closed loop is unstable.
        """
        settings = PISettings.published(self.turbine)
        gain = schedule_gain(self.pitch, settings.gain_schedule_pitch)
        gain *= settings.gear_ratio / (2.0 - gain)
        n = self.n
        a = np.zeros((n + 2, n + 2))
        a[:n, :n] = self.A
        a[:n, n], a[:n, n + 1] = self.B[:, 1] * gain * settings.KP, self.B[:, 1] * gain * settings.KI
        corner = settings.speed_filter_corner
        a[n, SPEED], a[n, n], a[n + 1, n] = corner, -corner, 1.0
        if np.linalg.eigvals(a).real.max() >= 0.0:
            raise InputError(
                f"wind = {self.wind_speed:g}: the linear plant is unstable under gspi_oc3, whose travel and"
                " power deviation are the limits"
            )
        return a

    def baseline_response(self, weather):
        """Return the responses (OMEGA.size, n) of `states` under gspi_oc3 per wind speed and elevation."""
        n = self.n
        drive = np.zeros((OMEGA.size, n + 2, 2), complex)
        drive[:, :n, 0] = self.wind
        drive[:, :n, 1] = weather.force @ self.E.T
        response = np.linalg.solve(1j * OMEGA[:, None, None] * np.eye(n + 2) - self.baseline(), drive)
        return response[:, :n, 0], response[:, :n, 1]

    def _motion(self):
        """Return the HullMotion under gspi_oc3 on the true spectra."""
        wind, waves = self.baseline_response(self.true)
        velocities = [VX, VZ, WY]
        per_elevation, other = np.zeros((OMEGA.size, 6), complex), np.zeros((6, 6))
        per_elevation[:, IN_PLANE] = waves[:, velocities]
        moved = wind[:, velocities]
        density = moved[:, :, None] * moved[:, None, :].conj() * self.true.wind[:, None, None]
        other[np.ix_(IN_PLANE, IN_PLANE)] = np.trapezoid(density.real, OMEGA, axis=0)
        return HullMotion(per_elevation, other)


def _wind_spectrum(speed, rotor):
    """Return the one-sided spectrum (n,) over OMEGA, per rad/s, of rotor-averaged wind of RECORD seconds."""
    step = 0.1
    samples = fft_length(round(RECORD / step))
    sigma = ntm_sigma(speed, TURBULENCE_CLASS)
    amplitude = amplitudes(speed, sigma, rotor.hub_height, 2.0 * rotor.tip_radius, samples, step, "rotor")[0]
    spacing = 2.0 * pi / (samples * step)
    at = spacing * np.arange(amplitude.size)
    density = np.log(0.5 * amplitude[1:-1] ** 2 / spacing)
    spectrum = np.exp(np.interp(OMEGA, at[1:-1], density))
    spectrum[(OMEGA < 0.9995 * SLOWEST) | (OMEGA > at[-1])] = 0.0
    return spectrum * 0.5 * np.sum(amplitude**2) / np.trapezoid(spectrum, OMEGA)


def fit_wind(spectrum):
    """Return a Filter of order 3 with a zero, in series with a high-pass at the length of a record.

    Fitted to the log of a wind spectrum over OMEGA; the variances agree. Without the high-pass the optimal
    control would spend torque on slow changes that no run contains.
    """
    return fit_spectrum(spectrum, (60.0, 8.0, 1.0), (20.0,))


def fit_spectrum(spectrum, poles, zeros):
    """Return a Filter with real poles and zeros, and a high-pass at the length of a record, of a spectrum.

    spectrum: over OMEGA, per rad/s. poles, zeros: times (s) from which the fit of its log starts.
    """
    used = (OMEGA > 2.0 * pi * WIND_BAND[0]) & (OMEGA < 2.0 * pi * WIND_BAND[1])
    omega, target, order = OMEGA[used], spectrum[used], len(poles)
    slow = -np.log1p((SLOWEST / omega) ** 2)
    weight = np.sqrt(target * np.gradient(omega))
    weight /= np.sqrt(np.mean(weight**2))

    def miss(p):
        squares = np.log1p((np.exp(p[:-1])[:, None] * omega) ** 2)
        level = p[-1] + squares[order:].sum(axis=0) - squares[:order].sum(axis=0)
        return weight * (level + slow - np.log(target))

    start = np.r_[np.log([*poles, *zeros]), np.log(target[0])]
    times = np.exp(least_squares(miss, start).x[:-1])
    below, above = (
        reduce(np.polymul, ([time, 1.0] for time in part), np.ones(1))
        for part in (times[:order], times[order:])
    )
    below, above = np.polymul(below / below[0], [1.0, SLOWEST]), np.polymul(above / below[0], [1.0, 0.0])
    a, b, c = _companion(below, above)
    return _scaled(a, b, c, spectrum)


def fit_waves(weather, sea):
    """Return (Filter of the elevation, force (3, 4) of its states, relative rms errors (3,) of the force).

    The filter is s^2 through two resonators, with the variance of the sea. The errors are those at
    the frequencies of the sea; zero without a force.
    """
    peak = 2.0 * pi / sea.Tp if sea.height else 1.0
    used = (OMEGA > WAVE_BAND[0] * peak) & (OMEGA < WAVE_BAND[1] * peak)
    omega, target = OMEGA[used] / peak, weather.elevation[used]
    scale = target.max() if sea.height else 1.0

    def square(p, omega):
        s = 1j * omega
        w1, z1, w2, z2 = np.exp(p[:4])
        return np.abs(s * s / ((s * s + 2 * z1 * w1 * s + w1**2) * (s * s + 2 * z2 * w2 * s + w2**2))) ** 2

    best = None
    for damping in (0.05, 0.1, 0.2):
        start = np.r_[np.log([0.97, damping, 1.15, 2.0 * damping]), 0.0]
        start[4] = -np.log(square(start, omega).max())
        fit = least_squares(lambda p: np.exp(p[4]) * square(p, omega) - target / scale, start)
        if best is None or fit.cost < best.cost:
            best = fit
    w1, z1, w2, z2 = np.exp(best.x[:4])
    below = np.polymul([1.0, 2.0 * z1 * w1, w1**2], [1.0, 2.0 * z2 * w2, w2**2])
    a, b, c = _companion(below, np.array([1.0, 0.0, 0.0]))  # time in 1/peak: states of equal magnitude
    a, b = a * peak, b * sqrt(peak)
    filtered = _scaled(a, b, c, weather.elevation)
    states = filtered.states(OMEGA)
    elevation = states @ filtered.output
    # weighted by 1/frequency, as the response of a mass; outside the sea's band the force is kept small
    weight = np.sqrt(np.gradient(OMEGA)) / np.maximum(OMEGA, LOWEST_FORCE)
    true_force = weather.force * elevation[:, None]
    left, right = states * weight[:, None], true_force * weight[:, None]
    stacked = (np.r_[left.real, left.imag], np.r_[right.real, right.imag])
    force = np.linalg.lstsq(*stacked, rcond=None)[0].T
    density = (np.gradient(OMEGA) * (weather.elevation > 0.0))[:, None]
    size = np.sum(density * np.abs(true_force) ** 2, axis=0)
    miss = np.sum(density * np.abs(states @ force.T - true_force) ** 2, axis=0)
    return filtered, force, np.sqrt(np.divide(miss, size, out=np.zeros(3), where=size > 0.0))


def _companion(below, above):
    """Return (a, b, c) of the filter above/below, polynomials in s; the leading coefficient of below is 1."""
    n = below.size - 1
    a = np.zeros((n, n))
    a[:-1, 1:] = np.eye(n - 1)
    a[-1] = -below[:0:-1]
    b, c = np.zeros(n), np.zeros(n)
    b[-1] = 1.0
    c[: above.size] = above[::-1]
    return a, b, c


def _scaled(a, b, c, spectrum):
    """Return a Filter with the variance of a spectrum over OMEGA where the spectrum is not zero."""
    variance, here = np.trapezoid(spectrum, OMEGA), spectrum > 0.0
    density = np.where(here, np.abs(Filter(a, b, c, 0.0).states(OMEGA) @ c) ** 2 / pi, 0.0)
    ratio = variance / np.trapezoid(density, OMEGA) if variance > 0.0 else 0.0
    error = np.trapezoid(np.abs(ratio * density - spectrum), OMEGA) / variance if variance > 0.0 else 0.0
    return Filter(a, b, c * sqrt(ratio), float(error))
