"""Fixed-step integrators of one plant. A scene's `multistep` part chooses: None is classical Runge-Kutta.

The blade pitch follows its own first-order law exactly within a step (constant command), so the
stiffest part of the plant does not limit the multistep methods.
"""

from math import exp
from typing import NamedTuple

from fowt_env.dynamics import Kept, attitude_rate, derivative, evaluate, respond
from fowt_env.errors import unknown
from fowt_env.jit import inlined_kernel, kernel
from fowt_env.loads.drivetrain import followed_pitch, limited
from fowt_env.state import State

INTEGRATORS = ("rk4", "heun", "abm4", "ab4")
START_STEPS = 3  # steps before four past derivatives exist
# rad of blade pitch (30.4 deg) beyond which the lift of a free rotor's blades works against its speed: up to
# 4.5 1/s in 70 m/s, where Adams-Bashforth alone is stable to 0.3 over that and the corrected method to 1.3
FEATHERING = 0.53


class Multistep(NamedTuple):
    """Choice of a method other than Runge-Kutta 4."""

    heun: bool  # explicit trapezoid, two evaluations a step
    corrector: bool  # Adams-Bashforth-Moulton in PECE form, two evaluations; else predictor alone, one


def build_integrator(name):
    """Multistep part of an integrator's name, None for "rk4". Raises: InputError for an unknown name."""
    if name not in INTEGRATORS:
        raise unknown("integrator", name, INTEGRATORS)
    if name == "rk4":
        return None
    return Multistep(name == "heun", name == "abm4")


@inlined_kernel
def rates(t, x, u, scene, work, dx):
    """dx at an instant under u, from the kept loads where they are fresh."""
    kept = work.kept
    if kept[Kept.FRESH] < 0.5 or kept[Kept.TIME] != t:
        evaluate(t, x, scene, work, work.stages[0])
        kept[Kept.FRESH] = 1.0
        kept[Kept.TIME] = t
        kept[Kept.ELEVATED] = 0.0
    for i in range(State.WAKE, x.shape[0]):
        dx[i] = work.stages[0, i]
    respond(x, u, scene, work, dx)


@kernel
def pitch_after(blade_pitch, command, dt, actuator):
    """Blade pitch after dt under a constant command: exact solution of lag and rate limit."""
    if actuator.time_constant <= 0.0:
        return blade_pitch
    lag, fastest = actuator.time_constant, actuator.rate_limit
    target = limited(command, actuator.minimum, actuator.maximum)
    error = target - blade_pitch
    sign = 1.0 if error > 0.0 else -1.0
    size = abs(error)
    band = fastest * lag  # inside it the lag alone limits the rate
    if size > band:
        slewing = (size - band) / fastest
        if slewing >= dt:
            return blade_pitch + sign * fastest * dt
        return target - sign * band * exp(-(dt - slewing) / lag)
    return target - error * exp(-dt / lag)


@inlined_kernel
def rk4(t, x, u, dt, scene, work):
    """One classical Runge-Kutta step of x in place, blade pitch exact at every stage."""
    k1, k2, k3, k4, y = work.stages[0], work.stages[1], work.stages[2], work.stages[3], work.stages[4]
    half = pitch_after(x[State.BLADE_PITCH], u[1], 0.5 * dt, scene.actuator)
    whole = pitch_after(x[State.BLADE_PITCH], u[1], dt, scene.actuator)
    rates(t, x, u, scene, work, k1)
    for i in range(x.shape[0]):
        y[i] = x[i] + 0.5 * dt * k1[i]
    y[State.BLADE_PITCH] = half
    derivative(t + 0.5 * dt, y, u, scene, work, k2)
    for i in range(x.shape[0]):
        y[i] = x[i] + 0.5 * dt * k2[i]
    y[State.BLADE_PITCH] = half
    derivative(t + 0.5 * dt, y, u, scene, work, k3)
    for i in range(x.shape[0]):
        y[i] = x[i] + dt * k3[i]
    y[State.BLADE_PITCH] = whole
    derivative(t + dt, y, u, scene, work, k4)
    for i in range(x.shape[0]):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    x[State.BLADE_PITCH] = whole


@inlined_kernel
def heun(t, x, u, dt, scene, work):
    """One step of the explicit trapezoidal rule, blade pitch exact."""
    k1, k2, y = work.stages[0], work.stages[1], work.stages[4]
    rates(t, x, u, scene, work, k1)
    pitch = pitch_after(x[State.BLADE_PITCH], u[1], dt, scene.actuator)
    for i in range(x.shape[0]):
        y[i] = x[i] + dt * k1[i]
    y[State.BLADE_PITCH] = pitch
    derivative(t + dt, y, u, scene, work, k2)
    for i in range(x.shape[0]):
        x[i] += 0.5 * dt * (k1[i] + k2[i])
    x[State.BLADE_PITCH] = pitch


@kernel
def bashforth(order, i, history):
    """Adams-Bashforth combination of the latest derivatives of state i, history latest first."""
    if order == 1:
        return history[0, i]
    if order == 2:
        return 1.5 * history[0, i] - 0.5 * history[1, i]
    if order == 3:
        return (23.0 * history[0, i] - 16.0 * history[1, i] + 5.0 * history[2, i]) / 12.0
    return (55.0 * history[0, i] - 59.0 * history[1, i] + 37.0 * history[2, i] - 9.0 * history[3, i]) / 24.0


@kernel
def moulton(order, new, i, history):
    """Adams-Moulton combination of a derivative at the end of the step and the latest ones."""
    if order == 1:
        return 0.5 * (new + history[0, i])
    if order == 2:
        return (5.0 * new + 8.0 * history[0, i] - history[1, i]) / 12.0
    return (9.0 * new + 19.0 * history[0, i] - 5.0 * history[1, i] + history[2, i]) / 24.0


@kernel
def feathering(x, scene):
    """Whether a free rotor's blades are pitched beyond FEATHERING, where its speed is heavily damped."""
    return x[State.BLADE_PITCH] > FEATHERING and not scene.body.rotor_held


@inlined_kernel
def adams(t, x, u, dt, scene, work):
    """One Adams step: velocities by Adams-Bashforth 4, positions by Adams-Moulton 4 with the new velocities.

    With the corrector, in the first three steps, and while the blades of a free rotor are feathered,
    velocities are corrected by Adams-Moulton after an evaluation at the predicted state.
    """
    history, new, y = work.history, work.stages[1], work.stages[4]
    kept = work.kept
    steps = int(kept[Kept.STEPS])
    order = min(steps + 1, START_STEPS + 1)
    for k in range(START_STEPS, 0, -1):
        for i in range(x.shape[0]):
            history[k, i] = history[k - 1, i]
    rates(t, x, u, scene, work, history[0])
    pitch = pitch_after(x[State.BLADE_PITCH], u[1], dt, scene.actuator)
    for i in range(x.shape[0]):
        y[i] = x[i] + dt * bashforth(order, i, history)
    y[State.BLADE_PITCH] = pitch
    if scene.multistep.corrector or steps < START_STEPS or feathering(x, scene):
        derivative(t + dt, y, u, scene, work, new)
        for i in range(State.VX, x.shape[0]):
            y[i] = x[i] + dt * moulton(order, new[i], i, history)
        y[State.BLADE_PITCH] = pitch
    attitude_rate(y, new, scene.body.plane)
    new[State.AZIMUTH] = y[State.ROTOR_SPEED]
    for i in range(State.VX):
        x[i] += dt * moulton(order, new[i], i, history)
    for i in range(State.VX, x.shape[0]):
        x[i] = y[i]
    kept[Kept.STEPS] = steps + 1.0


@inlined_kernel
def take_step(t, x, u, dt, scene, multistep, work):
    """One step of the scene's integrator, x in place."""
    pitch = followed_pitch(x[State.BLADE_PITCH], u[1], dt, scene.actuator)
    if pitch != x[State.BLADE_PITCH]:  # an actuator without lag jumps: the kept loads are not of this pitch
        x[State.BLADE_PITCH] = pitch
        work.kept[Kept.FRESH] = 0.0
    if multistep is None:
        rk4(t, x, u, dt, scene, work)
    elif multistep.heun:
        heun(t, x, u, dt, scene, work)
    else:
        adams(t, x, u, dt, scene, work)
    work.kept[Kept.FRESH] = 0.0
