"""One control period of an environment as one compiled call: command, physics, measurement, reward.

Everything that a period reads is a Setting, everything it writes a Run: arrays of one environment,
so that many environments are rows of larger ones.
"""

from math import isfinite
from typing import NamedTuple

import numpy as np

from fowt_env.envs.actions import ActionMap, accept, action_of, command_of
from fowt_env.envs.observations import ObservationMap, fill_observation, fill_signals
from fowt_env.envs.rewards import Scales, fill_terms, weighted_sum
from fowt_env.envs.sensors import Sensors, take_reading
from fowt_env.plant.compile.decorators import entry, kernel
from fowt_env.plant.compile.handle import by_reference, data_of, model_of
from fowt_env.plant.drivetrain import followed_torque, torque_was_limited
from fowt_env.plant.measurement import Measure
from fowt_env.plant.model import Data, LoadCache, Model
from fowt_env.plant.rollout import NON_FINITE, OVERSPEED, RUNNING, advance_plant, observe_plant
from fowt_env.plant.state import Command, State

BAD_ACTION = -1  # beside the statuses of rollout.py
STEP, SATURATED, LIMITED = 0, 1, 2  # entries of Run.counts
N_COUNTS = 3
SHOWN_COUNTS = {"saturated_actions": SATURATED, "torque_limited": LIMITED}  # in the infos


@by_reference
class Setting(NamedTuple):
    """What stays fixed during an episode."""

    model: Model
    actions: ActionMap
    parameters: np.ndarray  # of the baseline law
    estimator: np.ndarray | None  # parameters of the estimator's law
    chosen: ObservationMap
    scales: Scales
    weights: np.ndarray  # (N_TERMS,)
    overspeed: float  # rad/s
    dt: float  # s
    per_control: int  # physics steps in a control period
    sensors: Sensors | None  # between the plant and its readers; None: readings are the measurements


@by_reference
class Run(NamedTuple):
    """What moves during an episode; the arrays down to reference are its whole state."""

    data: Data
    x: np.ndarray  # (n_state,)
    u: np.ndarray  # (2,) generator torque and blade-pitch command in force
    memory: np.ndarray  # of the baseline law or the set-point loop
    estimate: np.ndarray | None  # memory of the estimator; None: no channel asks for it
    action: np.ndarray  # (2,) last accepted action
    measurement: np.ndarray  # (N_MEASUREMENTS,) at the present instant
    reading: np.ndarray  # the same as sensors show it; without any the measurement itself
    past: np.ndarray | None  # last measurements, of the sensors' delay
    observation: np.ndarray  # (n,) float32
    # int64: physics steps done, control periods with a clipped action, those with a torque at its limits
    counts: np.ndarray
    reference: np.ndarray  # rewards.Reference of the episode
    before: np.ndarray  # (N_MEASUREMENTS,) scratch from here on: one control period ago
    dx: np.ndarray  # (n_state,)
    wanted: np.ndarray  # (2,) command of the last period, before the generator's limits
    signals: np.ndarray  # what observations are made of
    terms: np.ndarray  # (N_TERMS,) of the last period


@kernel
def copy_into(target, source):
    """Copy an array element by element; a slice assignment would allocate in compiled code."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@kernel
def look(setting, run):
    """Measure and read at the present instant; RUNNING, or NON_FINITE with the last measurement kept."""
    model = setting.model
    t = run.counts[STEP] * setting.dt
    observe_plant(model, run.data, run.x, run.u, t, run.dx, run.measurement)
    for value in run.measurement:
        if not isfinite(value):
            copy_into(run.measurement, run.before)
            return NON_FINITE
    period = run.counts[STEP] // setting.per_control
    take_reading(setting.sensors, period, run.measurement, run.past, run.reading)
    return RUNNING


@kernel
def show(setting, run):
    """Fill the observation from the present reading."""
    t = run.counts[STEP] * setting.dt
    chosen = setting.chosen
    fill_signals(
        t, setting.model, run.x, run.reading, run.action, run.estimate, chosen.preview, run.signals
    )
    fill_observation(run.signals, chosen, run.observation)


@entry
def start(handle):
    """Measure and show the first instant of an episode; returns the status."""
    setting, run = model_of(handle), data_of(handle)
    for i in range(N_COUNTS):
        run.counts[i] = 0
    run.data.cache[LoadCache.TORQUE_LIMITED] = 0.0
    run.data.cache[LoadCache.VALID] = 0.0
    run.data.cache[LoadCache.STEPS] = 0.0
    status = look(setting, run)
    copy_into(run.before, run.measurement)
    action_of(run.u, run.x[State.ROTOR_SPEED], setting.actions, run.action)
    show(setting, run)
    return status


@entry
def show_again(handle):
    """Fill the observation anew, after an estimator was started."""
    show(model_of(handle), data_of(handle))


@kernel
def update_estimate(law, setting, run):
    """Take the period that is over, its command and what is read now into the estimate."""
    if law is None:
        return
    law(setting.estimator, run.estimate, run.reading, run.u)


@kernel
def advance_period(setting, run, estimator):
    """Advance one control period under run.u, measure, observe and pay; returns (status, reward)."""
    torque, wanted = run.u[Command.GENERATOR_TORQUE], run.wanted[Command.GENERATOR_TORQUE]
    was_limited = torque_was_limited(torque, wanted, setting.model.generator)
    run.counts[LIMITED] += was_limited
    run.data.cache[LoadCache.TORQUE_LIMITED] = 1.0 if was_limited else 0.0
    copy_into(run.before, run.measurement)
    first = run.counts[STEP]
    status = advance_plant(setting.model, run.data, run.x, run.u, first, setting.per_control, setting.dt)
    run.counts[STEP] = first + setting.per_control
    if status != NON_FINITE:
        seen = look(setting, run)
        if seen != RUNNING:
            status = seen
    if status == RUNNING and run.measurement[Measure.ROTOR_SPEED] > setting.overspeed:
        status = OVERSPEED
    update_estimate(estimator, setting, run)
    show(setting, run)
    fill_terms(run.measurement, run.before, run.reference, status != RUNNING, setting.scales, run.terms)
    return status, weighted_sum(setting.weights, run.terms)


@entry
def act(handle, law, estimator, action):
    """One control period under an action (2,) in [-1, 1]; returns (status, reward).

    law, estimator: Handles whose data is the control kernel of the baseline and of the estimator, or None;
    Python takes ten times as long to hand over a kernel itself. BAD_ACTION leaves everything as it was.
    """
    setting, run = model_of(handle), data_of(handle)
    clipped = accept(action, run.action)
    if clipped < 0:
        return BAD_ACTION, 0.0
    run.counts[SATURATED] += clipped
    command_of(
        run.action, setting.actions, law.data, setting.parameters, run.memory, run.reading, run.u,
        run.wanted,
    )  # fmt: skip
    return advance_period(setting, run, estimator.data)


@entry
def act_physical(handle, estimator, torque, blade_pitch):
    """One control period under a physical command, as simulate applies it; returns (status, reward).

    estimator: as act takes it.
    """
    setting, run = model_of(handle), data_of(handle)
    run.wanted[Command.GENERATOR_TORQUE] = torque
    run.wanted[Command.BLADE_PITCH] = blade_pitch
    before = run.u[Command.GENERATOR_TORQUE]
    run.u[Command.GENERATOR_TORQUE] = followed_torque(
        before, torque, setting.actions.control_dt, setting.model.generator
    )
    run.u[Command.BLADE_PITCH] = blade_pitch
    action_of(run.u, run.x[State.ROTOR_SPEED], setting.actions, run.action)
    return advance_period(setting, run, estimator.data)
