"""Defines the fixed-step integrators: a class, a step and a row of INTEGRATORS each.

Within a step, blade pitch and generator torque are exact (constant command), and so are the torsion of the
shaft (elastic/shaft.py) and, with Adams methods, the bending of the tower (elastic/steps.py). The states of
radiation memory are exact for velocities linear in time (hydro/radiation.py), moving mooring lines have steps
of their own (line_dynamics.py), and the rotor load in a wind box is evaluated several times a step
(rotor_substeps.py), so that none of these limits the step.
"""

from typing import NamedTuple

from fowt_env.errors import unknown
from fowt_env.plant.adams import bashforth, moulton
from fowt_env.plant.aero.load import rotor_part, step_air
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.blade_pitches import advance_actuators, mean_pitch, pitches_jump, set_followed
from fowt_env.plant.compile.decorators import inlined_kernel, kernel, separate_kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.dynamics import derivative, evaluate_loads, respond, store, stored
from fowt_env.plant.elastic.in_phase import (
    keep_twist,
    keep_twist_after,
    shift_means,
    twist_again,
    twist_on,
)
from fowt_env.plant.elastic.shaft import advance_twist, begin_twist, keep_smooth, smooth_of
from fowt_env.plant.elastic.steps import (
    begin_swing,
    correct_blades,
    keep_blades,
    keep_swing,
    swing_again,
    swing_on,
)
from fowt_env.plant.elastic.tower import add_modal, bend_of, carried, turned_pose
from fowt_env.plant.followers import begin_followers, end_followers, follow, integrated_states
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rigid_body import attitude_rate
from fowt_env.plant.rotor_substeps import build_substeps, follow_rotor, sample_rotor, shift_samples
from fowt_env.plant.slow_loads import begin_slow, keep_slow
from fowt_env.plant.state import BLADES, State, Wrench, add, pose_in

START_STEPS = 3  # steps before four past derivatives exist
# rad of blade pitch (30.4 deg) above which the lift of the blades damps the speed of a free rotor: by up to
# 4.5 1/s in 70 m/s, where Adams-Bashforth alone is stable to 0.3 over that and the corrected method to 1.3;
# and the edgewise swings of a held one, which shake the nacelle
FEATHERING = 0.53


class RungeKutta(NamedTuple):
    """Selects the classical Runge-Kutta method of order 4."""

    stages: int = 4


class Heun(NamedTuple):
    """Selects the explicit trapezoidal rule."""

    stages: int = 2


class Adams(NamedTuple):
    """Selects Adams-Bashforth 4, with or without correction by Adams-Moulton 4."""

    corrector: bool  # Adams-Bashforth-Moulton in PECE form, two evaluations; else predictor only, one
    substeps: object = None  # RotorSubsteps, or None: one evaluation of the rotor load, as of all loads


KEPT_STATE, KEPT_RATES = 3, 4  # rows of Data.stages between an output row and the step that begins there


@kernel
def keep_rates(x, u, dx, data):
    """Keep the rates dx of a state under u, of the last answer, for the next call of rates with both."""
    cache, state, kept = data.cache, data.stages[KEPT_STATE], data.stages[KEPT_RATES]
    cache[LoadCache.ANSWERED] = 1.0
    for i in range(u.shape[0]):
        cache[LoadCache.COMMAND + i] = u[i]
    for i in range(x.shape[0]):
        state[i], kept[i] = x[i], dx[i]


@kernel
def _are_kept(x, u, data):
    """Return whether keep_rates has the rates of this state under u, and nothing was answered since."""
    cache, state, changed = data.cache, data.stages[KEPT_STATE], 0
    if cache[LoadCache.ANSWERED] < 0.5:
        return False
    for i in range(u.shape[0]):
        changed += 1 if u[i] != cache[LoadCache.COMMAND + i] else 0
    for i in range(x.shape[0]):  # a sum, of which the compiler makes vector instructions
        changed += 1 if x[i] != state[i] else 0
    return changed == 0


@inlined_kernel
def rates(t, x, u, model, data, dx):
    """Fill dx with the rates of the state under u, from the cached loads, or kept rates, where valid."""
    cache = data.cache
    if cache[LoadCache.VALID] < 0.5 or cache[LoadCache.TIME] != t:
        evaluate_loads(t, x, model, data, data.stages[0])
        cache[LoadCache.VALID] = 1.0
        cache[LoadCache.TIME] = t
        cache[LoadCache.ELEVATED] = 0.0
    if _are_kept(x, u, data):
        for i in range(x.shape[0]):
            dx[i] = data.stages[KEPT_RATES, i]
        return
    for i in range(State.INTERNAL, x.shape[0]):
        dx[i] = data.stages[0, i]
    respond(x, u, model, data, dx)


@inlined_kernel
def rk4(t, x, u, dt, model, method, data):
    """Advance x in place by one classical Runge-Kutta step, blade pitch exact at every stage."""
    k1, k2, k3, k4, y = data.stages[0], data.stages[1], data.stages[2], data.stages[3], data.stages[4]
    n, shaft, work, half = integrated_states(x, model), model.shaft, data.rotor, 0.5 * dt
    rates(t, x, u, model, data, k1)
    begin_twist(shaft, work)
    keep_smooth(shaft, work, k1)
    begin_followers(x, dt, True, model, data)
    for i in range(n):
        y[i] = x[i] + 0.5 * dt * k1[i]
    advance_actuators(x, u, 0.5 * dt, model, y)
    s1 = smooth_of(shaft, k1)
    advance_twist(x, u, half, s1, 0.0, 0.0, 0.0, shaft, model, work, y)
    follow(x, y, True, dt, model, data)
    derivative(t + 0.5 * dt, y, u, model, data, k2)
    keep_smooth(shaft, work, k2)
    for i in range(n):
        y[i] = x[i] + 0.5 * dt * k2[i]
    advance_actuators(x, u, 0.5 * dt, model, y)
    s2 = smooth_of(shaft, k2)
    advance_twist(x, u, half, s2, 0.0, 0.0, 0.0, shaft, model, work, y)
    follow(x, y, True, dt, model, data)
    derivative(t + 0.5 * dt, y, u, model, data, k3)
    keep_smooth(shaft, work, k3)
    for i in range(n):
        y[i] = x[i] + dt * k3[i]
    advance_actuators(x, u, dt, model, y)
    s3 = smooth_of(shaft, k3)
    advance_twist(x, u, dt, s1, 2.0 * (s3 - s1), 0.0, 0.0, shaft, model, work, y)
    follow(x, y, False, dt, model, data)
    derivative(t + dt, y, u, model, data, k4)
    keep_smooth(shaft, work, k4)
    for i in range(n):
        y[i] = x[i] + dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    advance_actuators(x, u, dt, model, y)
    s4, middle = smooth_of(shaft, k4), 0.5 * (s2 + s3)
    linear, square = 4.0 * middle - 3.0 * s1 - s4, 2.0 * (s1 - 2.0 * middle + s4)
    advance_twist(x, u, dt, s1, linear, square, 0.0, shaft, model, work, y)
    step_air(x, dt, model.aero, k1, y)
    for i in range(n):
        x[i] = y[i]
    end_followers(x, dt, model, data)


@inlined_kernel
def heun(t, x, u, dt, model, method, data):
    """Advance x in place by one step of the explicit trapezoidal rule, blade pitch exact."""
    k1, k2, y = data.stages[0], data.stages[1], data.stages[4]
    n, shaft, work = integrated_states(x, model), model.shaft, data.rotor
    rates(t, x, u, model, data, k1)
    begin_twist(shaft, work)
    keep_smooth(shaft, work, k1)
    begin_followers(x, dt, False, model, data)
    for i in range(n):
        y[i] = x[i] + dt * k1[i]
    advance_actuators(x, u, dt, model, y)
    s1 = smooth_of(shaft, k1)
    advance_twist(x, u, dt, s1, 0.0, 0.0, 0.0, shaft, model, work, y)
    follow(x, y, False, dt, model, data)
    derivative(t + dt, y, u, model, data, k2)
    keep_smooth(shaft, work, k2)
    for i in range(n):
        y[i] = x[i] + 0.5 * dt * (k1[i] + k2[i])
    advance_actuators(x, u, dt, model, y)
    advance_twist(x, u, dt, s1, smooth_of(shaft, k2) - s1, 0.0, 0.0, shaft, model, work, y)
    step_air(x, dt, model.aero, k1, y)
    for i in range(n):
        x[i] = y[i]
    end_followers(x, dt, model, data)


@kernel
def feathering(x, model):
    """Return whether the air damps blades pitched above FEATHERING heavily: if they turn freely, or bend."""
    if model.blades is None and model.rigid_body.rotor_fixed:
        return False
    return mean_pitch(x, model.pitches) > FEATHERING


@inlined_kernel
def adams(t, x, u, dt, model, method, data):
    """Advance x by one step: velocities by Adams-Bashforth 4, then positions by Adams-Moulton 4.

    With the corrector, in the first three steps, and while feathered blades are heavily damped,
    velocities are corrected by Adams-Moulton after an evaluation at the predicted state. Otherwise
    follow_rotor may correct them for the rotor load within the step.
    """
    history, new, y = data.history, data.stages[1], data.stages[4]
    cache = data.cache
    n = integrated_states(x, model)
    steps = int(cache[LoadCache.STEPS])
    order = min(steps + 1, START_STEPS + 1)
    for k in range(START_STEPS, 0, -1):
        for i in range(n):
            history[k, i] = history[k - 1, i]
    body, tower, blades, shaft, work = model.rigid_body, model.tower, model.blades, model.shaft, data.rotor
    matrix, still, extra = data.matrix, data.stages[2], data.stages[3]
    keep_blades(x, blades, data.elastic)
    if not method.corrector:
        begin_slow(steps, blades, data)
    rates(t, x, u, model, data, history[0])
    keep_slow(steps, blades, data)
    begin_twist(shaft, work)
    keep_twist(x, blades, shaft, data.elastic, work, history[0])
    begin_swing(steps, x, body, tower, blades, matrix, work, still)
    keep_swing(x, tower, blades, shaft, work, history[0])
    begin_followers(x, dt, False, model, data)
    for i in range(n):
        y[i] = x[i] + dt * bashforth(order, i, history)
    advance_actuators(x, u, dt, model, y)
    twist_on(steps, dt, x, u, order, history, data.elastic, blades, shaft, model, matrix, work, still, y)
    swing_on(dt, x, order, history, body, tower, blades, shaft, matrix, work, still, extra, y)
    sample_rotor(t, x, u, dt, model, method.substeps, data)
    if method.corrector or steps < START_STEPS or feathering(x, model):
        follow(x, y, False, dt, model, data)
        derivative(t + dt, y, u, model, data, new)
        keep_twist_after(y, blades, shaft, work, new)
        keep_swing(y, tower, blades, shaft, work, new)
        for i in range(State.VX, n):
            y[i] = x[i] + dt * moulton(order, new[i], i, history)
        advance_actuators(x, u, dt, model, y)
        twist_again(dt, x, u, order, new, history, blades, shaft, model, work, y)
        swing_again(dt, x, order, new, history, body, tower, blades, shaft, matrix, work, still, extra, y)
    else:
        follow_rotor(dt, x, model, method.substeps, data, y)
        correct_blades(dt, x, history, data.elastic, blades, shaft, work, y)
    attitude_rate(y, new, model.rigid_body.plane)
    new[State.AZIMUTH] = y[State.ROTOR_SPEED]
    bend_blades(dt, x, order, history, blades, shaft, work, y)
    step_air(x, dt, model.aero, history[0], y)
    for i in range(State.VX):
        x[i] += dt * moulton(order, new[i], i, history)
    for i in range(State.VX, n):
        x[i] = y[i]
    end_followers(x, dt, model, data)
    cache[LoadCache.STEPS] = steps + 1.0


@kernel
def bend_blades(dt, x, order, history, blades, shaft, work, y):
    """Fill y with the deflections of the blades by Adams-Moulton, from their new velocities in y.

    On a shaft that twists, their means are shifted to those of in_phase.py.
    """
    if blades is None:
        return
    size = BLADES * len(blades.beam.count)
    for i in range(blades.first, blades.first + size):
        y[i] = x[i] + dt * moulton(order, y[size + i], i, history)
    shift_means(blades, shaft, work, y)


@inlined_kernel
def set_pitch(t, x, u, dt, model, method, data):
    """Set the blade pitch to another value at once, for a method without memory of past steps."""
    set_followed(x, u, dt, model.actuator, model.pitches)
    data.cache[LoadCache.VALID] = 0.0


@inlined_kernel
def renew_loads(t, x, model, user, blades, data):
    """Update the loads of the last evaluation to another blade pitch, which changes the rotor load alone.

    User loads may depend on the blade pitch, and bending blades turn their masses: all loads are then
    evaluated again.
    """
    if user is None:
        if blades is None:
            renew_rotor(t, x, model, model.aero, data)
            return
    evaluate_loads(t, x, model, data, data.stages[0])


@inlined_kernel
def renew_rotor(t, x, model, aero, data):
    """Replace the rotor load of the last evaluation by that at this state; aero None: unchanged."""
    if aero is None:
        return
    cache, bend = data.cache, bend_of(x, model.tower)
    pose = turned_pose(pose_in(x, model.rigid_body.plane), bend)
    now = wind_now(t, aero.wind)
    rotor = rotor_part(
        t, pose, x, now, aero, aero.rotor, data.stages[0], data.counters, model.pitches, data.blades
    )
    was, new = stored(cache, LoadCache.ROTOR), rotor.wrench
    change = Wrench(
        new.fx - was.fx, new.fy - was.fy, new.fz - was.fz,
        new.mx - was.mx, new.my - was.my, new.mz - was.mz,
    )  # fmt: skip
    store(cache, LoadCache.TOTAL, add(stored(cache, LoadCache.TOTAL), carried(change, bend)))
    add_modal(change, bend, model.tower, data.rotor, cache[LoadCache.MODAL :])
    store(cache, LoadCache.ROTOR, new)
    cache[LoadCache.TORQUE] = rotor.torque
    cache[LoadCache.THRUST] = rotor.thrust


@inlined_kernel
def set_pitch_and_history(t, x, u, dt, model, method, data):
    """Set the blade pitch at once, and correct the past derivatives to this pitch.

    A polynomial through derivatives before and after a jump has first-order errors; the change of the
    derivative at the jump is added to the past ones, which keeps their smooth part.
    """
    before, after, history, cache = data.stages[1], data.stages[4], data.history, data.cache
    rates(t, x, u, model, data, before)
    keep_twist_after(x, model.blades, model.shaft, data.rotor, before)
    was = stored(cache, LoadCache.ROTOR)
    torque = cache[LoadCache.TORQUE]
    set_followed(x, u, dt, model.actuator, model.pitches)
    renew_loads(t, x, model, model.user, model.blades, data)
    respond(x, u, model, data, after)
    keep_twist_after(x, model.blades, model.shaft, data.rotor, after)
    for k in range(START_STEPS):
        for i in range(State.VX, State.ROTOR_SPEED + 1):
            history[k, i] += after[i] - before[i]
        shift_tower(after, before, model.tower, data.rotor, history[k])
        shift_blades(after, before, model.blades, history[k])
        shift_twist(after, before, model.shaft, history[k])
    shift_samples(was, torque, method.substeps, data)


@kernel
def shift_tower(after, before, tower, work, row):
    """Add the difference of two derivatives to the rates of the deflection velocities, and to g, in a row."""
    if tower is None:
        return
    n, q = len(tower.beam.count), tower.first
    for i in range(q + n, q + 2 * n):
        row[i] += after[i] - before[i]
    for i in range(n):
        for j in range(n):
            row[q + i] += work.to_own[i, j] * (after[q + n + j] - before[q + n + j])


@kernel
def shift_blades(after, before, blades, row):
    """Add the difference of two derivatives to the rates of the blades' deflection velocities in a row."""
    if blades is None:
        return
    size = BLADES * len(blades.beam.count)
    for i in range(blades.first + size, blades.first + 2 * size):
        row[i] += after[i] - before[i]


@kernel
def shift_twist(after, before, shaft, row):
    """Add the difference of two derivatives to the smooth torque and the rate of the twist in a row."""
    if shaft is None:
        return
    for i in range(shaft.first, shaft.first + 2):
        row[i] += after[i] - before[i]


class Method(NamedTuple):
    """Describes an integrator: its step and its numerical properties."""

    order: int  # of convergence on a smooth plant
    evaluations: int  # of the loads per step
    dt: float  # s, default step: within half the stability limit for every built-in scene
    # stability limits: decay rate (1/s) of a velocity times dt, and frequency (rad/s) of an undamped
    # oscillation times dt; 0: an oscillation grows at any step, however slowly
    decay_limit: float
    oscillation_limit: float
    part: tuple  # value of Model.integrator; its class selects the step
    step: object  # (t, x, u, dt, model, method, data): one step of x in place
    samples_rotor: bool = False  # whether the rotor load can be evaluated more than once a step
    swings: bool = False  # whether bending of the tower, and blades in phase on a twisting shaft, are exact


# The limits are textbook values, except for an oscillation under ab4 (0.43 for Adams-Bashforth alone): the
# positions follow from the new velocities.
INTEGRATORS = {
    "rk4": Method(
        order=4, evaluations=4, dt=0.05, decay_limit=2.785, oscillation_limit=2.828,
        part=RungeKutta(), step=rk4,
    ),
    "heun": Method(
        order=2, evaluations=2, dt=0.05, decay_limit=2.0, oscillation_limit=0.0,
        part=Heun(), step=heun,
    ),
    "abm4": Method(
        order=4, evaluations=2, dt=0.1, decay_limit=1.285, oscillation_limit=0.0,
        part=Adams(corrector=True), step=adams, swings=True,
    ),
    "ab4": Method(
        order=4, evaluations=1, dt=0.1, decay_limit=0.3, oscillation_limit=0.929,
        part=Adams(corrector=False), step=adams, samples_rotor=True, swings=True,
    ),
}  # fmt: skip
method_step = chosen_by_class("method", {type(m.part): m.step for m in INTEGRATORS.values()})
jump_pitch = chosen_by_class("method", {RungeKutta: set_pitch, Heun: set_pitch, Adams: set_pitch_and_history})


def build_integrator(name, rotor_samples=1):
    """Return the integrator part of a Model by its name.

    rotor_samples  evaluations of the rotor load per step; more than one where the Method samples_rotor
    Raises: InputError for an unknown name.
    """
    if name not in INTEGRATORS:
        raise unknown("integrator", name, INTEGRATORS)
    method = INTEGRATORS[name]
    if method.samples_rotor:
        return method.part._replace(substeps=build_substeps(rotor_samples))
    return method.part


def rotor_samples(method):
    """Return the rotor loads that an integrator stores per step: 0 where the load is evaluated once."""
    substeps = getattr(method, "substeps", None)
    return 0 if substeps is None else substeps.samples


@separate_kernel
def take_step(t, x, u, dt, model, method, data):
    """Advance x in place by one step of the integrator of the scene."""
    if pitches_jump(x, u, dt, model.actuator, model.pitches):  # an actuator without lag
        jump_pitch(t, x, u, dt, model, method, data)
    method_step(t, x, u, dt, model, method, data)
    data.cache[LoadCache.VALID] = 0.0
