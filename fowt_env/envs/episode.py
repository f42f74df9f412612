"""Advances an environment by one control period in one compiled call: command, physics, reading, reward.

The inputs of a period are in EpisodeConfig, its outputs in EpisodeData: arrays of one environment, which may
be rows of the arrays of a batch. Sensors, trips and faults act in the same order as in simulate
(fowt_env/loop/period.py).
"""

from typing import NamedTuple

import numpy as np

from fowt_env.envs.actions import ActionMap, accept, action_of, command_of
from fowt_env.envs.decisions import (
    DecisionData,
    DecisionMap,
    fill_features,
    shift_history,
    smooth_decision,
    start_decisions,
)
from fowt_env.envs.goals import Goals, fill_goals
from fowt_env.envs.observations import ObservationMap, fill_observation, fill_signals
from fowt_env.envs.rewards import Scales, fill_terms, weighted_sum
from fowt_env.loop.interface import Interface, InterfaceData
from fowt_env.loop.period import all_finite, apply_command, begin_period, show_command
from fowt_env.loop.protection import has_ended, is_sunk, is_supervised, supervise_turbine
from fowt_env.loop.sensing import WindAhead, read_wind_ahead
from fowt_env.plant.advance import (
    NON_FINITE,
    OVERSPEED,
    RUNNING,
    SUNK,
    TRIPPED,
    advance_plant,
    observe_plant,
    output_plant,
)
from fowt_env.plant.aero.load import wind_of
from fowt_env.plant.compile.decorators import entry, kernel
from fowt_env.plant.compile.handle import by_reference, data_of, model_of
from fowt_env.plant.hydro.radiation import forget_memory
from fowt_env.plant.measurement import Measure
from fowt_env.plant.model import Data, LoadCache, Model
from fowt_env.plant.state import Command, State

BAD_ACTION = -1  # in addition to the statuses of plant/advance.py
STEP, SATURATED, LIMITED = 0, 1, 2  # entries of EpisodeData.counts
N_COUNTS = 3
SHOWN_COUNTS = {"saturated_actions": SATURATED, "torque_limited": LIMITED}  # in the infos


@by_reference
class EpisodeConfig(NamedTuple):
    """Holds the parameters of an episode, which remain constant."""

    model: Model
    actions: ActionMap
    parameters: np.ndarray  # of the baseline law
    estimator: np.ndarray | None  # parameters of the estimator's law
    observation_map: ObservationMap
    scales: Scales
    goals: Goals | None  # of a bounded reward; None: the terms of rewards.REWARD_TERMS
    weights: np.ndarray  # (terms,)
    overspeed: float  # rad/s, above which the episode ends
    dt: float  # s
    per_control: int  # physics steps in a control period
    interface: Interface  # sensors, guard and preview between plant and controllers
    ahead: WindAhead | None  # wind preview of the observation; None: exact wind at the hub
    decisions: DecisionMap | None  # None: an action is that of one control period


@by_reference
class EpisodeData(NamedTuple):
    """Holds the variables of an episode; the arrays up to reference are its complete state."""

    data: Data
    x: np.ndarray  # (n_state,)
    u: np.ndarray  # (n_commands,) generator torque and blade-pitch command in force
    memory: np.ndarray  # of the baseline law or the set-point loop
    estimate: np.ndarray | None  # memory of the estimator; None: no channel needs an estimate
    action: np.ndarray  # (actions,) last accepted action
    link: InterfaceData  # measurement, readings, command
    ahead: np.ndarray  # (leads,) wind ahead in the observation, m/s
    motion: np.ndarray | None  # memory of the lidar of the preview; None as EpisodeConfig.ahead
    observation: np.ndarray  # (n,) float32; with decisions their features
    decided: DecisionData | None  # None: as EpisodeConfig.decisions
    # int64: physics steps done, control periods with a clipped action, control periods with limited torque
    counts: np.ndarray
    reference: np.ndarray  # rewards.Reference of the episode
    previous_measurement: np.ndarray  # (n_measurements,) scratch from here on: one control period ago
    signals: np.ndarray  # inputs of the observation map
    terms: np.ndarray  # (terms,) of the last period; with decisions the mean over the last decision
    rows: np.ndarray | None  # (control periods + 1, n_channels) output rows so far, SI; None: not stored


@kernel
def copy_into(target, source):
    """Copy an array element by element; a slice assignment would allocate in compiled code."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@kernel
def measure_and_begin(config, episode):
    """Measure at the present instant and begin the control period.

    Returns RUNNING, TRIPPED if a trip ends the episode, or NON_FINITE with the previous measurement.
    """
    model, link, interface = config.model, episode.link, config.interface
    t = episode.counts[STEP] * config.dt
    observe_plant(model, episode.data, episode.x, episode.u, t, link.dx, link.measurement)
    if not all_finite(link.measurement):
        copy_into(link.measurement, episode.previous_measurement)
        return NON_FINITE
    period = episode.counts[STEP] // config.per_control
    begin_period(period, t, episode.x, model, interface, link)
    look_ahead(config.ahead, t, period, model, config.observation_map.preview, episode)
    return TRIPPED if has_ended(interface.guard, link) else RUNNING


@kernel
def look_ahead(ahead, t, period, model, leads, episode):
    """Fill the wind preview of the observation: as in simulate, or the exact wind at the hub."""
    if ahead is None:
        for i in range(leads.shape[0]):
            wind = wind_of(t + leads[i], 0.0, 0.0, model.layout.hub[2], model.aero)
            episode.ahead[i] = wind[0]
        return
    velocity = episode.link.measurement[Measure.NACELLE_VELOCITY]
    read_wind_ahead(ahead, t, period, velocity, episode.motion, episode.ahead, 0)


@kernel
def write_observation(config, episode):
    """Fill the observation from the present reading."""
    since = episode.counts[STEP] * config.dt - episode.reference[2]
    fill_signals(
        episode.link.reading, episode.x[State.AZIMUTH], episode.action, episode.estimate, since,
        episode.ahead, episode.signals,
    )  # fmt: skip
    show_observation(episode.decided, config.observation_map, episode)


@kernel
def show_observation(decided, observation_map, episode):
    """Fill the observation, or that of the present instant from which the features of a decision follow."""
    if decided is None:
        fill_observation(episode.signals, observation_map, episode.observation)
        return
    fill_observation(episode.signals, observation_map, decided.seen)


@kernel
def begin_history(decisions, decided, episode):
    """Start the decisions from the present observation and the action in force."""
    if decisions is None:
        return
    start_decisions(episode.action, decisions, decided)
    fill_features(decisions, decided, episode.observation)


@kernel
def record_row(config, episode, rows):
    """Fill the output row of the present control instant; rows None: do nothing."""
    if rows is None:
        return
    step = episode.counts[STEP]
    output_plant(
        config.model, episode.data, episode.x, episode.u, step * config.dt, episode.link.dx,
        rows[step // config.per_control],
    )  # fmt: skip


@entry
def start_episode(handle):
    """Measure and observe the first instant of an episode. Returns the status."""
    config, episode = model_of(handle), data_of(handle)
    for i in range(N_COUNTS):
        episode.counts[i] = 0
    episode.data.cache[LoadCache.TORQUE_LIMITED] = 0.0
    episode.data.cache[LoadCache.VALID] = 0.0
    episode.data.cache[LoadCache.STEPS] = 0.0
    forget_memory(episode.data.radiation)
    copy_into(episode.link.command, episode.u)
    status = measure_and_begin(config, episode)
    copy_into(episode.previous_measurement, episode.link.measurement)
    action_of(episode.u, episode.x[State.ROTOR_SPEED], config.actions, episode.action)
    write_observation(config, episode)
    begin_history(config.decisions, episode.decided, episode)
    return status


@entry
def rewrite_observation(handle):
    """Fill the observation again after the start of an estimator."""
    config, episode = model_of(handle), data_of(handle)
    write_observation(config, episode)
    begin_history(config.decisions, episode.decided, episode)


@kernel
def update_estimate(estimator_law, config, episode):
    """Update the estimate with the command of the past period and the present reading."""
    if estimator_law is None:
        return
    u = episode.u
    first, total, blades = u[Command.BLADE_PITCH], 0.0, u.shape[0] - Command.BLADE_PITCH
    for blade in range(blades):
        total += u[Command.BLADE_PITCH + blade]
    u[Command.BLADE_PITCH] = total / blades  # the estimator has one pitch input
    estimator_law(config.estimator, episode.estimate, episode.link.reading, u)
    u[Command.BLADE_PITCH] = first


@kernel
def apply_period(config, episode):
    """Apply link.command for a control period and record the first instant of the period."""
    t = episode.counts[STEP] * config.dt
    apply_command(t, episode.x, episode.u, config.model, episode.data, config.interface, episode.link)
    episode.counts[LIMITED] += int(episode.data.cache[LoadCache.TORQUE_LIMITED])
    record_row(config, episode, episode.rows)


@kernel
def advance_period(config, episode, estimator_law):
    """Advance one control period under episode.u, measure, observe and compute (status, reward)."""
    model, data, link = config.model, episode.data, episode.link
    first = episode.counts[STEP]
    copy_into(episode.previous_measurement, link.measurement)
    status = advance_plant(model, data, episode.x, episode.u, first, config.per_control, config.dt)
    episode.counts[STEP] = first + config.per_control
    if status != NON_FINITE:
        begun = measure_and_begin(config, episode)
        if begun != RUNNING:
            status = begun
    if status == RUNNING and link.measurement[Measure.ROTOR_SPEED] > config.overspeed:
        status = OVERSPEED
    if status == RUNNING and is_sunk(episode.x, model, config.interface.guard):
        status = SUNK
    update_estimate(estimator_law, config, episode)
    write_observation(config, episode)
    rate_period(config.goals, status != RUNNING, config.scales, episode)
    return status, weighted_sum(config.weights, episode.terms)


@kernel
def rate_period(goals, failed, scales, episode):
    """Fill the reward terms of the past control period."""
    m, previous = episode.link.measurement, episode.previous_measurement
    if goals is None:
        fill_terms(m, previous, episode.reference, failed, scales, episode.terms)
        return
    fill_goals(m, previous, episode.reference, failed, goals, episode.terms)


@kernel
def act_for_period(config, episode, baseline_law, estimator_law):
    """Advance one control period under episode.action. Returns (status, reward)."""
    model, link, interface = config.model, episode.link, config.interface
    if is_supervised(interface.guard, link):
        supervise_turbine(episode.x, interface.guard, link)
    else:
        show_command(episode.u, interface, config.actions.individual, model.pitches, link)
        command_of(
            episode.action, config.actions, baseline_law, config.parameters, episode.memory,
            link.law_reading, link.command,
        )  # fmt: skip
    apply_period(config, episode)
    return advance_period(config, episode, estimator_law)


@kernel
def act_for_decision(decisions, decided, config, episode, baseline_law, estimator_law, action):
    """Advance one control period under an action, or the control periods of a decision.

    Returns (status, reward), BAD_ACTION as act. The reward and the terms of a decision are means over its
    control periods; those after the end of the episode count 0.
    """
    if decisions is None:
        saturated = accept(action, episode.action)
        if saturated < 0:
            return BAD_ACTION, 0.0
        episode.counts[SATURATED] += saturated
        return act_for_period(config, episode, baseline_law, estimator_law)
    saturated = accept(action, decided.decision)
    if saturated < 0:
        return BAD_ACTION, 0.0
    episode.counts[SATURATED] += saturated
    status, total, terms = RUNNING, 0.0, decided.terms
    for i in range(terms.shape[0]):
        terms[i] = 0.0
    for _ in range(decisions.hold):
        smooth_decision(decided.decision, decisions, decided, episode.action)
        status, reward = act_for_period(config, episode, baseline_law, estimator_law)
        total += reward
        for i in range(terms.shape[0]):
            terms[i] += episode.terms[i]
        if status != RUNNING:
            break
    for i in range(terms.shape[0]):
        episode.terms[i] = terms[i] / decisions.hold
    shift_history(decisions, decided)
    fill_features(decisions, decided, episode.observation)
    return status, total / decisions.hold


@entry
def act(handle, baseline_law, estimator_law, action):
    """Advance one control period or decision under an action (actions,) in [-1, 1]. Returns (status, reward).

    baseline_law, estimator_law: Handles whose data is the control kernel, or None; passing the kernel
    directly from Python takes ten times as long. With the status BAD_ACTION nothing is changed. While the
    guard stops or starts the turbine, the action is ignored.
    """
    config, episode = model_of(handle), data_of(handle)
    return act_for_decision(
        config.decisions, episode.decided, config, episode, baseline_law.data, estimator_law.data, action
    )


@entry
def act_physical(handle, estimator_law, command):
    """Advance one control period under a command (n_commands,), as in simulate. Returns (status, reward).

    estimator_law: as in act.
    """
    config, episode = model_of(handle), data_of(handle)
    link, interface = episode.link, config.interface
    if is_supervised(interface.guard, link):
        supervise_turbine(episode.x, interface.guard, link)
    else:
        copy_into(link.command, command)
    apply_period(config, episode)
    action_of(episode.u, episode.x[State.ROTOR_SPEED], config.actions, episode.action)
    return advance_period(config, episode, estimator_law.data)


@entry
def record_last(handle):
    """Fill the output row of the instant at which an episode ended."""
    config, episode = model_of(handle), data_of(handle)
    record_row(config, episode, episode.rows)
