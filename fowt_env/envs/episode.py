"""One control period of an environment as one compiled call: command, physics, measurement, reward.

Everything that a period reads is an EpisodeConfig, everything it writes EpisodeData: arrays of one
environment, so that many environments are rows of larger ones.
"""

from math import isfinite
from typing import NamedTuple

import numpy as np

from fowt_env.envs.actions import ActionMap, accept, action_of, command_of
from fowt_env.envs.observations import ObservationMap, fill_observation, fill_signals
from fowt_env.envs.rewards import Scales, fill_terms, weighted_sum
from fowt_env.plant.compile.decorators import entry, kernel
from fowt_env.plant.compile.handle import by_reference, data_of, model_of
from fowt_env.plant.drivetrain import followed_torque, torque_was_limited
from fowt_env.plant.hydro.radiation import forget_memory
from fowt_env.plant.measurement import Measure
from fowt_env.plant.model import Data, LoadCache, Model
from fowt_env.plant.rollout import NON_FINITE, OVERSPEED, RUNNING, advance_plant, observe_plant
from fowt_env.plant.sensing import Sensors, place_of, read_preview, take_reading
from fowt_env.plant.state import Command, State

BAD_ACTION = -1  # beside the statuses of rollout.py
STEP, SATURATED, LIMITED = 0, 1, 2  # entries of EpisodeData.counts
N_COUNTS = 3
SHOWN_COUNTS = {"saturated_actions": SATURATED, "torque_limited": LIMITED}  # in the infos


class Given(NamedTuple):
    """What a baseline controller declares, and the wind ahead that it is given."""

    hidden: np.ndarray  # (n_measurements,) added to a reading: fowt_env.control.hidden
    preview_time: np.ndarray  # (k,) s; no entry: no wind ahead
    preview: np.ndarray  # (leads, k) m/s


@by_reference
class EpisodeConfig(NamedTuple):
    """What stays fixed during an episode."""

    model: Model
    actions: ActionMap
    parameters: np.ndarray  # of the baseline law
    estimator: np.ndarray | None  # parameters of the estimator's law
    observation_map: ObservationMap
    scales: Scales
    weights: np.ndarray  # (N_TERMS,)
    overspeed: float  # rad/s
    dt: float  # s
    per_control: int  # physics steps in a control period
    sensors: Sensors | None  # between the plant and its readers; None: readings are the measurements
    given: Given | None  # what the baseline is given of a reading; None: there is no baseline


@by_reference
class EpisodeData(NamedTuple):
    """What moves during an episode; the arrays down to reference are its whole state."""

    data: Data
    x: np.ndarray  # (n_state,)
    u: np.ndarray  # (n_commands,) generator torque and blade-pitch command in force
    memory: np.ndarray  # of the baseline law or the set-point loop
    estimate: np.ndarray | None  # memory of the estimator; None: no channel asks for it
    action: np.ndarray  # (actions,) last accepted action
    measurement: np.ndarray  # (n_measurements,) at the present instant
    reading: np.ndarray  # the same as sensors show it; without any the measurement itself
    past: np.ndarray | None  # what the sensors remember: delays, low passes and integrals
    observation: np.ndarray  # (n,) float32
    # int64: physics steps done, control periods with a clipped action, those with a torque at its limits
    counts: np.ndarray
    reference: np.ndarray  # rewards.Reference of the episode
    previous_measurement: np.ndarray  # (n_measurements,) scratch from here on: one control period ago
    dx: np.ndarray  # (n_state,)
    baseline_command: np.ndarray  # (n_commands,) command of the last period, before the generator's limits
    baseline_reading: (
        np.ndarray
    )  # (n_measurements + leads,) what the baseline is given; the reading without one
    signals: np.ndarray  # what observations are made of
    terms: np.ndarray  # (N_TERMS,) of the last period


@kernel
def copy_into(target, source):
    """Copy an array element by element; a slice assignment would allocate in compiled code."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@kernel
def measure_and_sense(config, episode):
    """Measure and read at the present instant; RUNNING, or NON_FINITE with the last measurement kept."""
    model = config.model
    t = episode.counts[STEP] * config.dt
    observe_plant(model, episode.data, episode.x, episode.u, t, episode.dx, episode.measurement)
    for value in episode.measurement:
        if not isfinite(value):
            copy_into(episode.measurement, episode.previous_measurement)
            return NON_FINITE
    period = episode.counts[STEP] // config.per_control
    take_reading(config.sensors, period, episode.measurement, episode.past, episode.reading)
    give_reading(config.given, t, episode.reading, episode.baseline_reading)
    return RUNNING


@kernel
def give_reading(given, t, reading, baseline_reading):
    """Fill what the baseline is given at time t (s) from the reading."""
    if given is None:
        return
    ahead = baseline_reading.shape[0] - reading.shape[0]
    for i in range(reading.shape[0]):
        baseline_reading[place_of(i, ahead)] = reading[i] + given.hidden[i]
    read_preview(t, given.preview_time, given.preview, baseline_reading)


@kernel
def write_observation(config, episode):
    """Fill the observation from the present reading."""
    t = episode.counts[STEP] * config.dt
    observation_map = config.observation_map
    fill_signals(
        t, config.model, episode.x, episode.reading, episode.action, episode.estimate, episode.reference[2],
        observation_map.preview, episode.signals,
    )  # fmt: skip
    fill_observation(episode.signals, observation_map, episode.observation)


@entry
def start_episode(handle):
    """Measure and observe the first instant of an episode; returns the status."""
    config, episode = model_of(handle), data_of(handle)
    for i in range(N_COUNTS):
        episode.counts[i] = 0
    episode.data.cache[LoadCache.TORQUE_LIMITED] = 0.0
    episode.data.cache[LoadCache.VALID] = 0.0
    episode.data.cache[LoadCache.STEPS] = 0.0
    forget_memory(episode.data.radiation)
    status = measure_and_sense(config, episode)
    copy_into(episode.previous_measurement, episode.measurement)
    action_of(episode.u, episode.x[State.ROTOR_SPEED], config.actions, episode.action)
    write_observation(config, episode)
    return status


@entry
def rewrite_observation(handle):
    """Fill the observation anew, after an estimator was started."""
    write_observation(model_of(handle), data_of(handle))


@kernel
def update_estimate(estimator_law, config, episode):
    """Take the period that is over, its command and what is read now into the estimate."""
    if estimator_law is None:
        return
    u = episode.u
    first, total, blades = u[Command.BLADE_PITCH], 0.0, u.shape[0] - Command.BLADE_PITCH
    for blade in range(blades):
        total += u[Command.BLADE_PITCH + blade]
    u[Command.BLADE_PITCH] = total / blades  # it knows one pitch
    estimator_law(config.estimator, episode.estimate, episode.reading, u)
    u[Command.BLADE_PITCH] = first


@kernel
def advance_period(config, episode, estimator_law):
    """Advance one control period under episode.u, measure, observe and reward; returns (status, reward)."""
    torque = episode.u[Command.GENERATOR_TORQUE]
    commanded = episode.baseline_command[Command.GENERATOR_TORQUE]
    was_limited = torque_was_limited(torque, commanded, config.model.generator)
    episode.counts[LIMITED] += was_limited
    episode.data.cache[LoadCache.TORQUE_LIMITED] = 1.0 if was_limited else 0.0
    copy_into(episode.previous_measurement, episode.measurement)
    first = episode.counts[STEP]
    status = advance_plant(
        config.model, episode.data, episode.x, episode.u, first, config.per_control, config.dt
    )
    episode.counts[STEP] = first + config.per_control
    if status != NON_FINITE:
        sensed = measure_and_sense(config, episode)
        if sensed != RUNNING:
            status = sensed
    if status == RUNNING and episode.measurement[Measure.ROTOR_SPEED] > config.overspeed:
        status = OVERSPEED
    update_estimate(estimator_law, config, episode)
    write_observation(config, episode)
    fill_terms(
        episode.measurement, episode.previous_measurement, episode.reference, status != RUNNING,
        config.scales, episode.terms,
    )  # fmt: skip
    return status, weighted_sum(config.weights, episode.terms)


@entry
def act(handle, baseline_law, estimator_law, action):
    """One control period under an action (actions,) in [-1, 1]; returns (status, reward).

    baseline_law, estimator_law: Handles whose data is the control kernel, or None; Python takes ten times as
    long to hand over a kernel itself. BAD_ACTION leaves everything as it was.
    """
    config, episode = model_of(handle), data_of(handle)
    saturated = accept(action, episode.action)
    if saturated < 0:
        return BAD_ACTION, 0.0
    episode.counts[SATURATED] += saturated
    command_of(
        episode.action, config.actions, baseline_law.data, config.parameters, episode.memory,
        episode.baseline_reading, episode.u, episode.baseline_command,
    )  # fmt: skip
    return advance_period(config, episode, estimator_law.data)


@entry
def act_physical(handle, estimator_law, command):
    """One control period under a physical command (n_commands,), as simulate applies it: (status, reward).

    estimator_law: as act takes it.
    """
    config, episode = model_of(handle), data_of(handle)
    torque = episode.u[Command.GENERATOR_TORQUE]
    copy_into(episode.baseline_command, command)
    copy_into(episode.u, command)
    episode.u[Command.GENERATOR_TORQUE] = followed_torque(
        torque, command[Command.GENERATOR_TORQUE], config.actions.control_dt, config.model.generator
    )
    action_of(episode.u, episode.x[State.ROTOR_SPEED], config.actions, episode.action)
    return advance_period(config, episode, estimator_law.data)
