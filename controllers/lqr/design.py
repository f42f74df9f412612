"""Designs LQG control of blade pitch and generator torque on the linear models of a scene.

The model at each wind speed has surge, platform pitch, rotor and pitch actuator in the plane, the
rotor-averaged wind as a second-order filter fitted to its Kaimal spectrum, and the waves of the site's sea as
one resonance with the hull's force at the spectrum's peak. The controls are the rates of torque and
blade-pitch command. Other internal states are residualised (analysis/reduced_model.py); the estimator
represents unmodelled effects by a moment on the platform.

Winds, travels and moments of the NREL 5 MW turbine are scaled to other turbines: winds by the difference of
rated winds, blade-pitch travel by rated rotor speed, moments by swept area and hub height.
"""

from dataclasses import dataclass, replace
from math import ceil, floor, pi, sqrt

import numpy as np
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import least_squares

from fowt_env.analysis.linear_model import linearize, sampled
from fowt_env.analysis.reduced_model import residualised
from fowt_env.analysis.trim import water_key, without_fluctuations
from fowt_env.analysis.trim_cache import plant_key
from fowt_env.analysis.wave_excitation import wave_force
from fowt_env.caches import Cache, cached
from fowt_env.controllers.settings import NOT_NEGATIVE, POSITIVE, Settings
from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.descriptions.nrel5mw import HUB_HEIGHT, RATED_WIND, ROTOR_SPEED, TIP_RADIUS
from fowt_env.descriptions.sea_state import joint_sea_state, sea_state_of
from fowt_env.errors import InputError
from fowt_env.plant.state import State
from fowt_env.weather.turbulence import amplitudes

SITE = "gulf_of_maine_normal"  # joint sea states, as in the named suites
LAST_SEA_WIND = 24.0  # m/s, end of the table: its sea is also used at higher winds
TURBULENCE_CLASS = "B"
ABOVE_RATED = 0.1  # m/s, minimum distance of the lowest design wind from rated wind
PLANT = ("surge", "platform_pitch", "vx", "wy", "rotor_speed", "blade_pitch")
SENSORS = ("rotor_speed", "blade_pitch", "platform_pitch", "platform_pitch_rate", "nacelle_acceleration")
N_PLANT, N_SENSORS = len(PLANT), len(SENSORS)
N_STATE = N_PLANT + 5  # estimated: plant, two wind states, two wave states, slow moment on the platform
N_FEEDBACK = N_PLANT + 7  # fed back: plant, torque, pitch command, speed integral, wind and wave states
WIND, WAVE, MOMENT = N_PLANT, N_PLANT + 2, N_PLANT + 4
SHARE_WIND = 18.0  # m/s, wind at which the setting `share` applies
SHARE_RANGE = (0.02, 0.98)  # limits of share over the wind
WAVE_DAMPING = 0.2  # damping ratio of the resonance that represents the wave spectrum
# Per sample: rad/s, rad, rad, rad/s, m/s2. The noise of blade pitch is that of a cheap encoder: the estimate
# then follows the actuator model, so that measurement noise does not cause pitch travel.
SENSOR_NOISE = (3e-3, 5e-3, 1e-3, 2e-4, 3e-2)
MODEL_NOISE = (1e-3, 1e-4, 1e-2, 1e-4, 3e-3, 1e-3)  # per root second, on the plant's states
MOMENT_NOISE = 2e5  # N m per root second: random walk of the moment of unmodelled effects


@dataclass(frozen=True)
class LQGSettings(Settings):
    """Holds objective and limits of the feedback of lqr, see controllers/lqr/optimum.py.

    The limits are on deviations of the linear loop; limits near rated wind apply at lowest_design_wind. The
    defaults are results of `fowt design search lqr` on OC3-Hywind; winds and travels are those of the NREL
    5 MW turbine and are scaled to other turbines.
    """

    NAME = "lqr"
    RANGES = {
        "share": {"low": 0.0, "high": 1.0},
        "share_growth": {},
        "speed_integral": NOT_NEGATIVE,
        **dict.fromkeys(("travel", "travel_cap", "travel_near_rated", "power", "torque", "shaft"), POSITIVE),
        **dict.fromkeys(("shaft_near_rated", "torque_rate", "schedule_time"), POSITIVE),
    }

    share: float = 0.577  # weight of platform pitch in the objective at SHARE_WIND; rotor speed: 1 - share
    share_growth: float = -0.00345  # of the share, per m/s
    travel: float = 0.9843  # blade-pitch travel, over that of gspi_oc3
    travel_cap: float = 0.1399  # deg/s, upper limit of blade-pitch travel
    travel_near_rated: float = 0.2418  # deg/s
    power: float = 1.0  # deviation of power, over that of gspi_oc3
    torque: float = 0.08  # deviation of generator torque, of rated
    shaft: float = 0.6  # deviation of shaft torque, over that of gspi_oc3
    shaft_near_rated: float = 0.06  # of rated torque
    speed_integral: float = 0.001  # cost of (speed integral / 5 % of rated times 10 s)^2
    torque_rate: float = 0.0474  # cost of (torque rate / 5 % of rated a second)^2
    schedule_time: float = 144.1  # s, over which the operating wind follows the estimate

    def share_at(self, wind):
        """Return the share of platform pitch at a wind (m/s) of the NREL 5 MW turbine (equivalent_wind)."""
        low, high = SHARE_RANGE
        return min(max(self.share + self.share_growth * (wind - SHARE_WIND), low), high)


@dataclass(frozen=True)
class DesignModel:
    """Holds the plant and weather model at one wind speed: dx = A x + B (torque, pitch) + G noise (SI).

    x: N_STATE deviations from trim (PLANT, wind filter, wind speed, wave, wave quadrature, moment).
    """

    wind: float
    A: np.ndarray  # (N_STATE, N_STATE)
    B: np.ndarray  # (N_STATE, 2)
    G: np.ndarray  # (N_STATE, 2) unit white noise of wind and wave
    C: np.ndarray  # (N_SENSORS, N_STATE)
    trim: np.ndarray  # (N_PLANT,)
    torque: float
    pitch: float


MODEL_SHAPES = {  # of the fields of DesignModel
    "wind": (), "A": (N_STATE, N_STATE), "B": (N_STATE, 2), "G": (N_STATE, 2), "C": (N_SENSORS, N_STATE),
    "trim": (N_PLANT,), "torque": (), "pitch": (),
}  # fmt: skip


def design_winds(turbine):
    """Return the winds (m/s, 1 apart) of the models of a turbine, above cut-in and up to cut-out."""
    return tuple(range(floor(turbine.cut_in_wind_speed) + 1, floor(turbine.cut_out_wind_speed) + 1))


def lowest_design_wind(turbine):
    """Return the lowest design wind (m/s); below, its gains are used with the pitch at the minimum."""
    return ceil(turbine.rated_wind_speed + ABOVE_RATED)


def winds_above_rated(turbine):
    """Return the integer winds (m/s) above rated, up to cut-out."""
    return tuple(range(lowest_design_wind(turbine), floor(turbine.cut_out_wind_speed) + 1))


def equivalent_wind(turbine, wind):
    """Return the wind of the NREL 5 MW turbine with the same difference from rated wind, m/s."""
    return wind - (turbine.rated_wind_speed - RATED_WIND)


def travel_scale(turbine):
    """Return the ratio of pitch travel to that of the NREL 5 MW turbine: equal travel per revolution."""
    return turbine.rated_rotor_speed / ROTOR_SPEED


def moment_scale(turbine):
    """Return the ratio of platform moments to those of the NREL 5 MW turbine."""
    return (turbine.rotor.tip_radius / TIP_RADIUS) ** 2 * (turbine.rotor.hub_height / HUB_HEIGHT)


@cached(64)
def wind_filter(speed, height, diameter):
    """Return (T1, T2, noise) of v = noise white / ((1 + T1 s)(1 + T2 s)), the rotor-averaged Kaimal wind.

    Time constants are fitted to the log spectrum from 1/300 to 0.2 Hz; noise matches the variance.
    """
    samples, step = 6000, 0.1
    sigma = ntm_sigma(speed, TURBULENCE_CLASS)
    amplitude = amplitudes(float(speed), sigma, height, diameter, samples, step, "rotor")[0]
    frequency = np.arange(amplitude.size) / (samples * step)
    used = (frequency >= 1.0 / 300.0) & (frequency <= 0.2)
    omega, density = 2.0 * pi * frequency[used], amplitude[used] ** 2
    weight = np.sqrt(density * frequency[used])

    def shape(p):
        t1, t2 = np.exp(p[:2])
        return p[2] - np.log(1.0 + (t1 * omega) ** 2) - np.log(1.0 + (t2 * omega) ** 2)

    fit = least_squares(lambda p: weight * (shape(p) - np.log(density)), [np.log(15.0), np.log(1.5), 0.0])
    t1, t2 = sorted(np.exp(fit.x[:2]), reverse=True)
    variance = 0.5 * np.sum(amplitude**2)
    return float(t1), float(t2), sqrt(2.0 * variance * (t1 + t2))


def scene_at(scene, speed):
    """Return the scene in a steady wind (m/s) and flat water."""
    speed = float(speed)
    return replace(without_fluctuations(scene, speed), wind=speed, sea=None, wind_speed=speed)


def design_model(scene, speed):
    """Return the DesignModel of a scene's plant at a wind speed, m/s."""
    try:
        sea = sea_state_of(joint_sea_state(SITE, min(float(speed), LAST_SEA_WIND)))
    except InputError as error:
        name = scene.turbine.name
        raise InputError(
            f"no design of lqr or mpc controllers for turbine {name!r} in wind of {speed:g} m/s: {error}"
        ) from error
    model = residualised(linearize(scene_at(scene, speed)))
    rows = [model.index(name) for name in PLANT]
    sensors = [model.output_index(name) for name in SENSORS]
    peak = 2.0 * pi / sea.Tp
    force = wave_force(scene, model.point.state, [peak])[0]
    a, b = np.zeros((N_STATE, N_STATE)), np.zeros((N_STATE, 2))
    c, g = np.zeros((N_SENSORS, N_STATE)), np.zeros((N_STATE, 2))
    a[:N_PLANT, :N_PLANT] = model.A[np.ix_(rows, rows)]
    b[:N_PLANT] = model.B[rows, :2]
    c[:, :N_PLANT] = model.C[np.ix_(sensors, rows)]
    extra = {
        WIND + 1: (model.B[:, 2], model.D[:, 2]),
        WAVE: (model.E @ force.real, model.F @ force.real),
        WAVE + 1: (model.E @ force.imag, model.F @ force.imag),
        MOMENT: (model.E[:, 4], model.F[:, 4]),
    }
    for column, (state, output) in extra.items():
        a[:N_PLANT, column] = state[rows]
        c[:, column] = output[sensors]
    rotor = scene.turbine.rotor
    t1, t2, noise = wind_filter(float(speed), rotor.hub_height, 2.0 * rotor.tip_radius)
    a[WIND, WIND] = -1.0 / t1
    a[WIND + 1, [WIND, WIND + 1]] = 1.0 / t2, -1.0 / t2
    g[WIND, 0] = noise / t1
    # elevation, and elevation rate over peak frequency: a quarter period ahead
    a[WAVE, WAVE + 1] = peak
    a[WAVE + 1, [WAVE, WAVE + 1]] = -peak, -2.0 * WAVE_DAMPING * peak
    g[WAVE + 1, 1] = 0.25 * sea.Hs * sqrt(4.0 * WAVE_DAMPING * peak)
    point = model.point
    full = np.array([point.state[State[name.upper()]] for name in PLANT])
    return DesignModel(float(speed), a, b, g, c, full, float(point.command[0]), float(point.command[1]))


_MODELS = Cache(16)  # all inputs of a design -> DesignModels


def design_models(scene):
    """Return the DesignModels of the scene's plant over design_winds, cached per plant for any weather."""
    aero = scene.model.aero
    key = (plant_key(scene), water_key(scene), aero.wind.shear_exponent, aero.field is None)
    winds = design_winds(scene.turbine)
    return _MODELS.get(key, lambda: tuple(design_model(scene, speed) for speed in winds))


def sampled_noise(a, q, dt):
    """Return the discrete-time covariance of noise of intensity q over dt (Van Loan)."""
    n = a.shape[0]
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a, q, a.T
    both = expm(block * dt)
    return both[n:, n:].T @ both[:n, n:]


def estimator_gain(model, dt, moments=1.0):
    """Return the steady Kalman gain (N_STATE, N_SENSORS) of the correction; moments: moment_scale."""
    intensity = model.G @ model.G.T
    intensity[:N_PLANT, :N_PLANT] += np.diag(np.square(MODEL_NOISE))
    intensity[MOMENT, MOMENT] += (MOMENT_NOISE * moments) ** 2
    a, _ = sampled(model.A, model.B, dt)
    q = sampled_noise(model.A, intensity, dt)
    scale = np.ones(N_STATE)
    scale[MOMENT] = 1e7 * moments  # N m: the other states are of order one
    r = np.diag(np.square(SENSOR_NOISE))
    a = a / scale[:, None] * scale
    c = model.C * scale
    q = q / scale[:, None] / scale
    p = solve_discrete_are(a.T, c.T, 0.5 * (q + q.T), r)
    return (p @ c.T @ np.linalg.inv(c @ p @ c.T + r)) * scale[:, None]


def feedback_plant(model, rated_speed):
    """Return (A, B, G) with torque (of rated), pitch command and speed integral as states; inputs: rates.

    State order: PLANT, torque, pitch command, integral, wind filter, wind, wave, wave quadrature.
    """
    n = N_FEEDBACK
    a, b, g = np.zeros((n, n)), np.zeros((n, 2)), np.zeros((n, 2))
    weather = slice(N_PLANT + 3, n)
    a[:N_PLANT, :N_PLANT] = model.A[:N_PLANT, :N_PLANT]
    a[:N_PLANT, N_PLANT : N_PLANT + 2] = model.B[:N_PLANT] * [model.torque, 1.0]
    a[:N_PLANT, weather] = model.A[:N_PLANT, WIND:MOMENT]
    a[weather, weather] = model.A[WIND:MOMENT, WIND:MOMENT]
    a[N_PLANT + 2, PLANT.index("rotor_speed")] = 1.0
    b[N_PLANT, 0] = b[N_PLANT + 1, 1] = 1.0
    g[weather] = model.G[WIND:MOMENT]
    return a, b, g
