"""States, winds, blades and ways to evaluate loads that the tests of rotors share."""

import numpy as np
from numba import njit

from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.coefficient_table import coefficient_table_load
from fowt_env.plant.aero.section_table import section_table_load
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.aero.wind_field import WindField
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.state import BLADES, N_RIGID, State, pose_of
from fowt_env.plant.tilt import build_tilt, rotor_pose, to_body_axes
from fowt_env.weather.wind import make_series


def series_of(row, shear=0.14):
    """Return a constant wind: u, v, w (m/s) at 90 m, vertical and horizontal shear (m/s in 126 m)."""
    return make_series([0.0], [row], reference_height=90.0, reference_length=126.0, shear_exponent=shear)


def wind_series(u, v=0.0, w=0.0, vertical=0.0, horizontal=0.0, shear=0.0):
    """Return series_of these; shear: exponent of the power law."""
    return series_of([u, v, w, vertical, horizontal], shear)


def rough_field(seed=4, mean=16.0, deviation=1.5, corner=(-95.0, 2.0), size=20, periodic=True):
    """Return a WindField of white noise, 10 m from point to point, so that each station has its own wind."""
    velocity = np.random.default_rng(seed).normal(0.0, deviation, (60, size, size, 3)).astype(np.float32)
    velocity[..., 0] += mean
    return WindField(velocity, 2.0, 10.0, 1.0 / mean, *corner, 0.1, 0.1, periodic)


def state(speed=0.0, blade_pitch=0.0, azimuth=0.0, position=(0,) * 6, velocity=(0,) * 6):
    """Return a state of a rigid turbine; position and velocity of the platform, (6,) each."""
    x = np.zeros(N_RIGID)
    x[:6], x[7:13] = position, velocity
    x[State.AZIMUTH], x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = azimuth, speed, blade_pitch
    return x


def move_platform(states, rng, pitch=8.0):
    """Put random places, attitudes (pitch and yaw up to `pitch` deg) and velocities into states."""
    n = len(states)
    states[:, 0:3] = rng.uniform(-1.0, 1.0, (n, 3)) * [20.0, 5.0, 3.0]
    states[:, 3:6] = np.radians(rng.uniform(-1.0, 1.0, (n, 3)) * [2.0, pitch, pitch])
    states[:, 7:10] = rng.uniform(-1.0, 1.0, (n, 3))
    states[:, 10:13] = np.radians(rng.uniform(-1.0, 1.0, (n, 3)))


def moving(n, seed=1, pitch=(8.0, 16.0), spread=6.0):
    """Return n states of a moving platform about 16 m/s and their rows of wind.

    Each has three pitches, means in a range (deg), which differ by up to `spread` deg; those of the other
    blades are at the end.
    """
    rng = np.random.default_rng(seed)
    states, winds = np.zeros((n, N_RIGID + 2)), np.zeros((n, 5))
    move_platform(states, rng)
    states[:, State.AZIMUTH] = rng.uniform(0.0, 2.0 * np.pi, n)
    states[:, State.ROTOR_SPEED] = 1.267 * rng.uniform(0.9, 1.1, n)
    mean = rng.uniform(*pitch, (n, 1))
    winds[:, 0] = rng.uniform(12.0, 20.0, n)
    winds[:, 1:] = winds[:, :1] * rng.uniform(-1.0, 1.0, (n, 4)) * [0.1, 0.05, 0.06, 0.06]
    states[:, State.BLADE_PITCH :] = np.radians(mean + 0.5 * spread * rng.uniform(-1.0, 1.0, (n, 3)))
    return states, winds


def curved(turbine, tilt=0.11, cone=0.07, bend=-3.0, blades=3):
    """Return the turbine with tilt, cone, a prebend of `bend` at the tip and a sweep to and fro."""
    x = (turbine.blade.radius - 1.5) / 61.5
    blade = turbine.blade.model_copy(update={"prebend": bend * x**2, "sweep": 0.3 * bend * x * (0.8 - x)})
    rotor = turbine.rotor.model_copy(update={"shaft_tilt": tilt, "cone": cone, "blades": blades})
    return turbine.model_copy(update={"rotor": rotor, "blade": blade})


@njit
def put_load(load, out, tilt=None):
    """Put the wrench in body axes, thrust and torque of a RotorLoad into out (8,)."""
    w = to_body_axes(load.wrench, tilt)
    out[0], out[1], out[2], out[3], out[4], out[5] = w.fx, w.fy, w.fz, w.mx, w.my, w.mz
    out[6], out[7] = load.thrust, load.torque


@njit
def solved(pose, x, now, series, field, elements, pitches, blades, counters):
    """Load by blade-element momentum."""
    return rotor_load(0.0, pose, x, now, series, field, elements, None, None, x, counters, pitches, blades)


@njit
def looked_up(pose, x, now, series, field, table, pitches, blades, counters):
    """Load by the table of stations."""
    return section_table_load(0.0, pose, x, now, series, field, table, counters, pitches, blades)


@njit
def averaged(pose, x, now, series, field, table, pitches, blades, counters):
    """Load by the table of the rotor."""
    return coefficient_table_load(pose, x, now, series, table, counters)


@njit
def _fill(load_of, states, winds, series, field, tilt, rotor, pitches, out, blades):
    counters = np.zeros(N_COUNTERS)
    for i in range(states.shape[0]):
        x = states[i]
        series.value[0] = winds[i]
        pose, now = rotor_pose(pose_of(x), tilt), wind_now(0.0, series)
        load = load_of(pose, x, now, series, field, rotor, pitches, blades[i], counters)
        put_load(load, out[i], tilt)


def by(load_of, states, winds, rotor, tilt=0.0, field=None, pitches=None, shear=0.14):
    """Return loads of states, each in its row of wind, by solved, looked_up or averaged.

    ((n, 8), (n, 3, 6)): wrench about the body origin in body axes, thrust, torque; and those of each blade.
    """
    states, winds = np.array(states, dtype=float), np.array(winds, dtype=float)
    out, blades = np.zeros((len(states), 8)), np.zeros((len(states), BLADES, 6))
    series = series_of([1.0, 0.0, 0.0, 0.0, 0.0], shear)
    _fill(load_of, states, winds, series, field, build_tilt(tilt), rotor, pitches, out, blades)
    return out, blades
