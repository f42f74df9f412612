"""Fixed-step integrators of one plant. A model's `multistep` part chooses: None is classical Runge-Kutta.

The blade pitch follows its own first-order law exactly within a step (constant command), so the
stiffest part of the plant does not limit the multistep methods. Nor does the rotor in a box of wind, whose
blades pass a cell of the grid in a tenth of a second: its load alone is evaluated several times a step
(Gusts), everything else once.
"""

from math import exp
from typing import NamedTuple

import numpy as np

from fowt_env.errors import unknown
from fowt_env.plant.aero.load import rotor_part
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.drivetrain import followed_pitch, limited
from fowt_env.plant.dynamics import derivative, evaluate, respond
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rigid_body import accelerate, attitude_rate
from fowt_env.plant.state import Command, State, Wrench, pose_in

INTEGRATORS = ("rk4", "heun", "abm4", "ab4")
START_STEPS = 3  # steps before four past derivatives exist
# rad of blade pitch (30.4 deg) beyond which the lift of a free rotor's blades works against its speed: up to
# 4.5 1/s in 70 m/s, where Adams-Bashforth alone is stable to 0.3 over that and the corrected method to 1.3
FEATHERING = 0.53
BASHFORTH = (55.0 / 24.0, -59.0 / 24.0, 37.0 / 24.0, -9.0 / 24.0)  # Adams-Bashforth 4, latest first
N_SAMPLE = 7  # of a sample of the rotor's load: its wrench and its torque


class Gusts(NamedTuple):
    """How the rotor's load is followed within a step of Adams-Bashforth 4, see follow_rotor."""

    samples: int  # evaluations of the rotor's load per step, evenly spaced from the step's beginning
    weight: np.ndarray  # (4 samples,) of the samples, latest first


class RungeKutta(NamedTuple):
    """Classical Runge-Kutta 4."""

    evaluations: int = 4


class Heun(NamedTuple):
    """Explicit trapezoidal rule."""

    evaluations: int = 2


class Multistep(NamedTuple):
    """Adams-Bashforth 4, with or without correction by Adams-Moulton 4."""

    corrector: bool  # Adams-Bashforth-Moulton in PECE form, two evaluations; else predictor alone, one
    gusts: object = None  # Gusts, or None: the rotor's load is evaluated once per step like all others


def build_gusts(samples):
    """Gusts of a number of samples per step, None for one.

    The weights are those of Adams-Bashforth 4 in `samples` shorter steps, less those of one step of it, so
    that a load that varies slowly is left alone.
    """
    if samples == 1:
        return None
    weight = np.zeros(4 * samples)
    for latest in range(samples):  # of each short step, counted back from the last
        weight[latest : latest + 4] += np.array(BASHFORTH) / samples
    weight[samples - 1 :: samples] -= BASHFORTH
    return Gusts(samples, weight)


def rotor_samples(multistep):
    """Rows per step that a Multistep (or None) keeps of the rotor's load: none where it is evaluated once."""
    gusts = getattr(multistep, "gusts", None)
    return 0 if gusts is None else gusts.samples


def build_integrator(name, rotor_samples=1):
    """Multistep part of an integrator's name, None for "rk4".

    rotor_samples  evaluations of the rotor's load per step; more than one with "ab4" alone
    Raises: InputError for an unknown name.
    """
    if name not in INTEGRATORS:
        raise unknown("integrator", name, INTEGRATORS)
    if name == "rk4":
        return RungeKutta()
    if name == "heun":
        return Heun()
    return Multistep(name == "abm4", build_gusts(rotor_samples) if name == "ab4" else None)


@inlined_kernel
def rates(t, x, u, model, data, dx):
    """dx at an instant under u, from the kept loads where they are fresh."""
    cache = data.cache
    if cache[LoadCache.VALID] < 0.5 or cache[LoadCache.TIME] != t:
        evaluate(t, x, model, data, data.stages[0])
        cache[LoadCache.VALID] = 1.0
        cache[LoadCache.TIME] = t
        cache[LoadCache.ELEVATED] = 0.0
    for i in range(State.WAKE, x.shape[0]):
        dx[i] = data.stages[0, i]
    respond(x, u, model, data, dx)


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
def rk4(t, x, u, dt, model, multistep, data):
    """One classical Runge-Kutta step of x in place, blade pitch exact at every stage."""
    k1, k2, k3, k4, y = data.stages[0], data.stages[1], data.stages[2], data.stages[3], data.stages[4]
    half = pitch_after(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], 0.5 * dt, model.actuator)
    whole = pitch_after(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], dt, model.actuator)
    rates(t, x, u, model, data, k1)
    for i in range(x.shape[0]):
        y[i] = x[i] + 0.5 * dt * k1[i]
    y[State.BLADE_PITCH] = half
    derivative(t + 0.5 * dt, y, u, model, data, k2)
    for i in range(x.shape[0]):
        y[i] = x[i] + 0.5 * dt * k2[i]
    y[State.BLADE_PITCH] = half
    derivative(t + 0.5 * dt, y, u, model, data, k3)
    for i in range(x.shape[0]):
        y[i] = x[i] + dt * k3[i]
    y[State.BLADE_PITCH] = whole
    derivative(t + dt, y, u, model, data, k4)
    for i in range(x.shape[0]):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    x[State.BLADE_PITCH] = whole


@inlined_kernel
def heun(t, x, u, dt, model, multistep, data):
    """One step of the explicit trapezoidal rule, blade pitch exact."""
    k1, k2, y = data.stages[0], data.stages[1], data.stages[4]
    rates(t, x, u, model, data, k1)
    pitch = pitch_after(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], dt, model.actuator)
    for i in range(x.shape[0]):
        y[i] = x[i] + dt * k1[i]
    y[State.BLADE_PITCH] = pitch
    derivative(t + dt, y, u, model, data, k2)
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
def feathering(x, model):
    """Whether a free rotor's blades are pitched beyond FEATHERING, where its speed is heavily damped."""
    return x[State.BLADE_PITCH] > FEATHERING and not model.rigid_body.rotor_held


@kernel
def sample_rotor(t, x, u, dt, model, gusts, data):
    """Put the rotor's loads within the step from t into data.samples, latest first, before those of the past.

    Between the ends of the step the state is extrapolated from the last two derivatives: to second order,
    while the platform hardly moves and the blades turn by 7 deg. Without gusts nothing is done.
    """
    if gusts is None:
        return
    samples, cache, history, between = data.samples, data.cache, data.history, data.stages[2]
    n = gusts.samples
    for k in range(samples.shape[0] - 1, n - 1, -1):
        for i in range(N_SAMPLE):
            samples[k, i] = samples[k - n, i]
    for i in range(6):
        samples[n - 1, i] = cache[LoadCache.ROTOR + i]
    samples[n - 1, 6] = cache[LoadCache.TORQUE]
    past = 0 if cache[LoadCache.STEPS] < 1.0 else 1
    for part in range(1, n):
        after = part * dt / n
        bend = 0.5 * after * after / dt
        for i in range(x.shape[0]):
            between[i] = x[i] + after * history[0, i] + bend * (history[0, i] - history[past, i])
        between[State.BLADE_PITCH] = pitch_after(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], after, model.actuator)
        now = wind_now(t + after, model.aero.wind)
        pose = pose_in(between, model.rigid_body.plane)
        aero = rotor_part(
            t + after, pose, between, now, model.aero, model.aero.rotor, data.stages[3], data.counters
        )
        row = samples[n - 1 - part]
        row[0], row[1], row[2] = aero.wrench.fx, aero.wrench.fy, aero.wrench.fz
        row[3], row[4], row[5] = aero.wrench.mx, aero.wrench.my, aero.wrench.mz
        row[6] = aero.torque


@kernel
def follow_rotor(dt, model, gusts, data, y):
    """Add to the velocities y at the end of a step what sample_rotor found within it; without gusts nothing.

    To the velocities of Adams-Bashforth 4 comes the difference that short steps of it make to the impulse of
    the rotor's load: dt M^-1 (sum of weight times sample), with the mass matrix of the step's beginning.
    """
    if gusts is None:
        return
    samples, weight = data.samples, gusts.weight
    fx = fy = fz = mx = my = mz = torque = 0.0
    for k in range(samples.shape[0]):
        share = weight[k]
        fx += share * samples[k, 0]
        fy += share * samples[k, 1]
        fz += share * samples[k, 2]
        mx += share * samples[k, 3]
        my += share * samples[k, 4]
        mz += share * samples[k, 5]
        torque += share * samples[k, 6]
    extra, still = data.stages[3], data.stages[2]
    for i in range(still.shape[0]):
        still[i] = 0.0  # without velocities the equation of motion has no terms but the load
    body = model.rigid_body
    accelerate(
        pose_in(still, body.plane), still, Wrench(fx, fy, fz, mx, my, mz), torque, data.added_mass, body,
        data.matrix, extra,
    )  # fmt: skip
    for i in range(State.VX, State.ROTOR_SPEED + 1):
        y[i] += dt * extra[i]


@inlined_kernel
def adams(t, x, u, dt, model, multistep, data):
    """One Adams step: velocities by Adams-Bashforth 4, positions by Adams-Moulton 4 with the new velocities.

    With the corrector, in the first three steps, and while the blades of a free rotor are feathered,
    velocities are corrected by Adams-Moulton after an evaluation at the predicted state. Without it, the
    rotor's load may be followed within the step (follow_rotor).
    """
    history, new, y = data.history, data.stages[1], data.stages[4]
    cache = data.cache
    steps = int(cache[LoadCache.STEPS])
    order = min(steps + 1, START_STEPS + 1)
    for k in range(START_STEPS, 0, -1):
        for i in range(x.shape[0]):
            history[k, i] = history[k - 1, i]
    rates(t, x, u, model, data, history[0])
    pitch = pitch_after(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], dt, model.actuator)
    for i in range(x.shape[0]):
        y[i] = x[i] + dt * bashforth(order, i, history)
    y[State.BLADE_PITCH] = pitch
    sample_rotor(t, x, u, dt, model, multistep.gusts, data)
    if multistep.corrector or steps < START_STEPS or feathering(x, model):
        derivative(t + dt, y, u, model, data, new)
        for i in range(State.VX, x.shape[0]):
            y[i] = x[i] + dt * moulton(order, new[i], i, history)
        y[State.BLADE_PITCH] = pitch
    else:
        follow_rotor(dt, model, multistep.gusts, data, y)
    attitude_rate(y, new, model.rigid_body.plane)
    new[State.AZIMUTH] = y[State.ROTOR_SPEED]
    for i in range(State.VX):
        x[i] += dt * moulton(order, new[i], i, history)
    for i in range(State.VX, x.shape[0]):
        x[i] = y[i]
    cache[LoadCache.STEPS] = steps + 1.0


method_step = chosen_by_class("multistep", {RungeKutta: rk4, Heun: heun, Multistep: adams}, inlined=True)


@inlined_kernel
def take_step(t, x, u, dt, model, multistep, data):
    """One step of the model's integrator, x in place."""
    pitch = followed_pitch(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], dt, model.actuator)
    if pitch != x[State.BLADE_PITCH]:  # an actuator without lag jumps: the kept loads are not of this pitch
        x[State.BLADE_PITCH] = pitch
        data.cache[LoadCache.VALID] = 0.0
    method_step(t, x, u, dt, model, multistep, data)
    data.cache[LoadCache.VALID] = 0.0
