"""Ways for tests to evaluate and integrate a scene's plant themselves."""

import numpy as np
from scipy.integrate import solve_ivp

from fowt_env.plant.advance import forget, observe
from fowt_env.plant.measurement import N_MEASUREMENTS
from fowt_env.plant.state import Pose, State


def _rates(handle, t, x, u, dx):
    """Fill dx by what is compiled for the runs themselves: a kernel of the tests would not be kept."""
    forget(handle)
    observe(handle, x, u, t, dx, np.zeros(N_MEASUREMENTS))


def rates(scene, x, u=(0.0, 0.0), t=0.0, handle=None):
    """dx/dt of a scene as a new array."""
    dx = np.zeros_like(x)
    _rates(scene.handle() if handle is None else handle, float(t), x, np.array(u, dtype=float), dx)
    return dx


def integrate(scene, x0, duration, u=(0.0, 0.0), samples=51, rtol=1e-13, atol=1e-14):
    """(times, states (samples, n_state)) by an eighth-order method far finer than the plant's own."""
    handle, u = scene.handle(), np.array(u, dtype=float)

    def rate(t, x):
        dx = np.zeros_like(x)
        _rates(handle, t, x, u, dx)
        return dx

    # absolute tolerance in the size of each state: positions grow to kilometres in free fall
    scale = np.ones_like(x0)
    scale[:3], scale[7:10] = 100.0, 10.0
    times = np.linspace(0.0, duration, samples)
    solution = solve_ivp(
        rate, (0.0, duration), x0, method="DOP853", rtol=rtol, atol=atol * scale, t_eval=times, max_step=0.5
    )
    return times, solution.y.T


def state(n=15, **values):
    """State vector with the named entries, e.g. state(surge=3.0, wy=0.1)."""
    x = np.zeros(n)
    for name, value in values.items():
        x[State[name.upper()]] = value
    return x


def make_pose(r, R, v, w):
    """Pose of plain arrays."""
    return Pose(*(float(value) for value in (*r, *R.ravel(), *v, *w)))


def random_state(rng, n=15, offset=5.0, tilt=0.1, speed=1.0, turning=0.05):
    """A state of a platform in rough motion, rotor turning either way."""
    x = np.zeros(n)
    x[0:3] = rng.normal(size=3) * [offset, offset, 0.2 * offset]
    x[3:6] = rng.normal(size=3) * tilt
    x[State.AZIMUTH] = rng.uniform(0.0, 2.0 * np.pi)
    x[7:10] = rng.normal(size=3) * speed
    x[10:13] = rng.normal(size=3) * turning
    x[State.ROTOR_SPEED] = rng.uniform(0.5, 1.4)
    x[State.BLADE_PITCH] = rng.uniform(0.0, 0.4)
    return x


def leaning(platform, turbine):
    """(platform, turbine) with a tilted shaft, and centres of mass off the shaft and beside the plane."""
    ballast = platform.ballast.model_copy(update={"cm_downwind": 0.4, "cm_left": -0.3})
    rotor = turbine.rotor.model_copy(update={"shaft_tilt": 0.12, "cm_offset": -1.6})
    nacelle = turbine.nacelle.model_copy(update={"cm_left": 0.7})
    return (
        platform.model_copy(update={"ballast": ballast}),
        turbine.model_copy(update={"rotor": rotor, "nacelle": nacelle}),
    )
