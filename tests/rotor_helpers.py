"""States, winds and blades that the tests of rotor loads share."""

import numpy as np
from numba import njit

from fowt_env.plant.state import N_RIGID, State
from fowt_env.weather.wind import make_series


def series_of(row, shear=0.14):
    """Return a constant wind: u, v, w (m/s) at 90 m, vertical and horizontal shear (m/s in 126 m)."""
    return make_series([0.0], [row], reference_height=90.0, reference_length=126.0, shear_exponent=shear)


def wind_series(u, v=0.0, w=0.0, vertical=0.0, horizontal=0.0, shear=0.0):
    """Return series_of these; shear: exponent of the power law."""
    return series_of([u, v, w, vertical, horizontal], shear)


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


def curved(turbine, tilt=0.11, cone=0.07, bend=-3.0, blades=3):
    """Return the turbine with tilt, cone, a prebend of `bend` at the tip and a sweep to and fro."""
    x = (turbine.blade.radius - 1.5) / 61.5
    blade = turbine.blade.model_copy(update={"prebend": bend * x**2, "sweep": 0.3 * bend * x * (0.8 - x)})
    rotor = turbine.rotor.model_copy(update={"shaft_tilt": tilt, "cone": cone, "blades": blades})
    return turbine.model_copy(update={"rotor": rotor, "blade": blade})


@njit
def put_load(load, out):
    """Put wrench, thrust and torque of a RotorLoad into out (8,)."""
    w = load.wrench
    out[0], out[1], out[2], out[3], out[4], out[5] = w.fx, w.fy, w.fz, w.mx, w.my, w.mz
    out[6], out[7] = load.thrust, load.torque
