"""Samples the rotor load within a step of Adams-Bashforth 4, for a wind box that the blades cross fast."""

from typing import NamedTuple

import numpy as np

from fowt_env.plant.accelerations import accelerate
from fowt_env.plant.aero.load import rotor_part
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.blade_pitches import advance_actuators
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.chain import answer, modes_in_state
from fowt_env.plant.elastic.structure import Structure
from fowt_env.plant.elastic.tower import add_modal, bend_of, carried, nacelle_pose
from fowt_env.plant.followers import integrated_states
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State, Wrench, pose_in

BASHFORTH = (55.0 / 24.0, -59.0 / 24.0, 37.0 / 24.0, -9.0 / 24.0)  # Adams-Bashforth 4, latest first
N_SAMPLE = 7  # entries of a sample of the rotor load: wrench and torque


class RotorSubsteps(NamedTuple):
    """Holds the sampling of the rotor load within a step of Adams-Bashforth 4, see follow_rotor."""

    samples: int  # evaluations of the rotor load per step, evenly spaced from the beginning of the step
    weight: np.ndarray  # (4 samples,) of the samples, latest first


def build_substeps(samples):
    """Return the RotorSubsteps of a number of samples per step, None for one.

    The weights are those of Adams-Bashforth 4 in `samples` shorter steps, less those of one step: zero in
    effect for a slowly varying load.
    """
    if samples == 1:
        return None
    weight = np.zeros(4 * samples)
    for latest in range(samples):  # of each short step, counted back from the last
        weight[latest : latest + 4] += np.array(BASHFORTH) / samples
    weight[samples - 1 :: samples] -= BASHFORTH
    return RotorSubsteps(samples, weight)


@kernel
def sample_rotor(t, x, u, dt, model, substeps, data):
    """Put the rotor loads within the step from t into data.samples, latest first, ahead of the past ones.

    Between the ends of the step the state is extrapolated from the last two derivatives, to second order:
    the platform hardly moves while the blades rotate by 7 deg. Without substeps nothing is done.
    """
    if substeps is None:
        return
    samples, cache, history, between = data.samples, data.cache, data.history, data.stages[2]
    n = substeps.samples
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
        for i in range(integrated_states(x, model)):
            between[i] = x[i] + after * history[0, i] + bend * (history[0, i] - history[past, i])
        advance_actuators(x, u, after, model, between)
        _bend_on(after, x, model.tower, between)
        now = wind_now(t + after, model.aero.wind)
        pose = nacelle_pose(pose_in(between, model.rigid_body.plane), between, model.tower)
        aero = rotor_part(
            t + after, pose, between, now, model.aero, model.aero.rotor, data.stages[3], data.counters,
            model.pitches, data.blades,
        )  # fmt: skip
        row = samples[n - 1 - part]
        row[0], row[1], row[2] = aero.wrench.fx, aero.wrench.fy, aero.wrench.fz
        row[3], row[4], row[5] = aero.wrench.mx, aero.wrench.my, aero.wrench.mz
        row[6] = aero.torque


@kernel
def _bend_on(after, x, tower, between):
    """Fill `between` with the deflections of the tower a time `after` (s) from x; no-op for a rigid tower."""
    if tower is None:
        return
    n = len(tower.beam.count)
    for i in range(tower.first, tower.first + n):
        between[i] = x[i] + 0.5 * after * (x[n + i] + between[n + i])


@kernel
def shift_samples(was, torque, substeps, data):
    """Add the change of the rotor load by a jump of the blade pitch to the samples of past steps, if any.

    was, torque: wrench and torque of the rotor before the jump; the cache has those after the jump.
    """
    if substeps is None:
        return
    samples, cache = data.samples, data.cache
    for k in range(samples.shape[0]):
        samples[k, 0] += cache[LoadCache.ROTOR] - was.fx
        samples[k, 1] += cache[LoadCache.ROTOR + 1] - was.fy
        samples[k, 2] += cache[LoadCache.ROTOR + 2] - was.fz
        samples[k, 3] += cache[LoadCache.ROTOR + 3] - was.mx
        samples[k, 4] += cache[LoadCache.ROTOR + 4] - was.my
        samples[k, 5] += cache[LoadCache.ROTOR + 5] - was.mz
        samples[k, 6] += cache[LoadCache.TORQUE] - torque


@inlined_kernel
def _push_rigid(dt, x, load, torque, model, structure, data, y):
    extra, still, body = data.stages[3], data.stages[2], model.rigid_body
    for i in range(still.shape[0]):
        still[i] = 0.0  # without velocities the equation of motion has no terms but the load
    accelerate(
        pose_in(still, body.plane), still, load, torque, data.added_mass, body, data.matrix, data.cache, extra
    )
    for i in range(State.VX, State.ROTOR_SPEED + 1):
        y[i] += dt * extra[i]


@inlined_kernel
def _push_elastic(dt, x, load, torque, model, structure, data, y):
    tower, work, extra = model.tower, data.rotor, data.stages[3]
    extra[:] = 0.0
    bend, (first, n) = bend_of(x, tower), modes_in_state(tower)
    b = extra[State.VX : State.WZ + 1]
    add_modal(load, bend, tower, work, extra[first : first + n])
    load = carried(load, bend)
    b[0], b[1], b[2], b[3], b[4], b[5] = load.fx, load.fy, load.fz, load.mx, load.my, load.mz
    answer(torque, bend, model.rigid_body, tower, model.blades, data.matrix, work, extra)
    for i in range(State.VX, y.shape[0]):
        y[i] += dt * extra[i]


# (dt, x, load, torque, model, structure, data, y): velocities y plus those by a Wrench on the nacelle and a
# torque on the shaft over dt, with the mass matrix of the last evaluation, at x
_push = chosen_by_class("structure", {type(None): _push_rigid, Structure: _push_elastic})


@inlined_kernel
def follow_rotor(dt, x, model, substeps, data, y):
    """Correct the velocities y at the end of a step for the rotor loads sampled within the step, if any.

    The correction is the difference between the impulses of the rotor load in short steps and in one step:
    dt M^-1 (sum of weight times sample), with the mass matrix at the beginning of the step.
    """
    if substeps is None:
        return
    samples, weight = data.samples, substeps.weight
    fx = fy = fz = mx = my = mz = torque = 0.0
    for k in range(samples.shape[0]):
        fraction = weight[k]
        fx += fraction * samples[k, 0]
        fy += fraction * samples[k, 1]
        fz += fraction * samples[k, 2]
        mx += fraction * samples[k, 3]
        my += fraction * samples[k, 4]
        mz += fraction * samples[k, 5]
        torque += fraction * samples[k, 6]
    _push(dt, x, Wrench(fx, fy, fz, mx, my, mz), torque, model, model.structure, data, y)
