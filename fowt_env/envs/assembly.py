"""Assembles an environment from its settings: task, compiled controllers, constant parts and arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from math import inf

import numpy as np

from fowt_env.control import CompiledController, catalogue, make
from fowt_env.descriptions.checks import is_number
from fowt_env.envs.actions import build_action_map, n_actions
from fowt_env.envs.decisions import DecisionSettings, build_decision_map, decision_data, wind_entry
from fowt_env.envs.episode import N_COUNTS, EpisodeConfig, EpisodeData
from fowt_env.envs.external_baseline import ExternalBaseline
from fowt_env.envs.goals import build_goals, goal_weights
from fowt_env.envs.observations import BLADE_CHANNELS, PREVIEW, build_observation_map, check_channels
from fowt_env.envs.rewards import Reference, build_scales, check_weights, weight_array
from fowt_env.envs.settings import Settings
from fowt_env.envs.tasks import Task
from fowt_env.errors import InputError, unknown
from fowt_env.loop.interface import interface_data
from fowt_env.plant.measurement import Measurement

FEATURE_BOUND = 10.0  # of normalised features


def adapted_task(task: Task, settings: Settings) -> Task:
    """Return the task with its values replaced by those of the settings."""
    episode = settings.episode
    replaced = {"rotor": settings.plant.rotor} | {
        name: getattr(episode, name) for name in ("duration", "wind", "sea", "wind_preview")
    }
    replaced |= {name: getattr(settings.control, name) for name in ("residual_torque", "residual_pitch")}
    changes = {name: value for name, value in replaced.items() if value is not None}
    if episode.observation is not None:
        changes["observation"] = check_channels("observation", episode.observation, default=task.observation)
    weights = episode.reward
    if weights is not None and not isinstance(weights, str) and not callable(weights):
        changes["weights"] = task.weights | check_weights("reward", weights)
    return replace(task, **changes)


def check_shown(names, chain):
    """Raise InputError for observation channels that a sensor chain (name, fields) does not measure."""
    for name in names:
        if name in (*Measurement._fields, *BLADE_CHANNELS) and name not in chain[1]:
            raise InputError(
                f"observation: {name!r}: is not measured by the sensor chain {chain[0]!r}; available:"
                f" {', '.join(chain[1])}"
            )


def named_baseline(name, turbine, control_dt):
    """Return the CompiledController of a name or object accepted by controllers.make.

    Raises: InputError for unknown names.
    """
    names = catalogue().CONTROLLERS
    if isinstance(name, str) and ":" not in name and name not in names:
        raise unknown("baseline", name, names)
    baseline = make(name, turbine, control_dt)
    return baseline if isinstance(baseline, CompiledController) else ExternalBaseline(baseline)


def nominal_parts(setting):
    """Return {"platform", "turbine"} of the setting nominal_plant. Raises: InputError."""
    if not isinstance(setting, Mapping) or "platform" not in setting:
        raise InputError(f"nominal_plant = {setting!r}: must be a dict with platform and optional turbine")
    for key in setting:
        if key not in ("platform", "turbine"):
            raise unknown("key of nominal_plant", key, ("platform", "turbine"))
    return {"turbine": None} | dict(setting)


def check_decisions(setting: object) -> DecisionSettings | None:
    """Return the DecisionSettings of the setting `decisions`: a record, a mapping of its fields or None.

    Raises: InputError.
    """
    if setting is None or isinstance(setting, DecisionSettings):
        return setting
    if not isinstance(setting, Mapping):
        raise InputError(
            f"decisions = {setting!r}: must be DecisionSettings, a mapping of its fields, or None"
        )
    known = [item.name for item in fields(DecisionSettings)]
    for key in setting:
        if key not in known:
            raise unknown("key of decisions", key, known)
    return DecisionSettings(**setting)


def feature_scaling(normalise, observed, history):
    """Return (mean, scale, bound) of the features of decisions, for the setting `normalise`; None without it.

    observed: entries of the observation. Raises: InputError.
    """
    if normalise is None:
        return None
    if not isinstance(normalise, Mapping):
        raise InputError(
            f"normalise = {normalise!r}: must be a mapping of entries of the observation, or None"
        )
    names = [entry.name for entry in observed]
    for name, value in normalise.items():
        if name not in names:
            raise unknown("entry of normalise", name, names)
        three = isinstance(value, Sequence) and len(value) == 3 and all(map(is_number, value))
        if not three or not min(value[1:]) > 0.0:
            raise InputError(
                f"normalise[{name!r}] = {value!r}: must be (centre, scale, change) with scale, change > 0"
            )
    given = [normalise.get(e.name, (e.centre, e.scale, e.scale)) for e in observed]
    mean = [(centre - e.centre) / e.scale for (centre, _, _), e in zip(given, observed, strict=True)]
    scale = [scale / e.scale for (_, scale, _), e in zip(given, observed, strict=True)]
    change = [change / e.scale for (_, _, change), e in zip(given, observed, strict=True)]
    return np.array(mean + [0.0] * len(mean) * history), np.array(scale + change * history), FEATURE_BOUND


def build_config(scene, task, mode, observed, timing, laws, interface, ahead, agent):
    """Return the EpisodeConfig of a scene and a Task.

    observed: entries of the observation; timing: (dt, physics steps in a control period, control_dt);
    laws: (baseline, estimator), compiled controllers or None; ahead: WindAhead of the observation or None;
    agent: (DecisionSettings or None, setting `normalise`, reward of goals.py or None).
    """
    chosen, normalise, goals = agent
    decisions = None
    if chosen is not None:
        decisions = build_decision_map(
            chosen,
            timing[2],
            len(observed),
            wind_entry(chosen, mode, observed),
            feature_scaling(normalise, observed, chosen.history),
        )
    elif normalise is not None:
        raise InputError("normalise: needs decisions")
    (dt, per_control, control_dt), (baseline, estimator), turbine = timing, laws, scene.turbine
    individual = baseline is not None and baseline.individual
    return EpisodeConfig(
        model=scene.model,
        actions=build_action_map(mode, task, turbine, control_dt, individual),
        parameters=np.zeros(1) if baseline is None else baseline.parameters,
        estimator=None if estimator is None else estimator.parameters,
        observation_map=build_observation_map(observed, task.wind_preview),
        scales=build_scales(turbine, control_dt),
        goals=build_goals(turbine, control_dt) if goals else None,
        weights=goal_weights(goals) if goals else weight_array(task.weights),
        overspeed=float(turbine.overspeed) if interface.guard is None else inf,
        dt=dt,
        per_control=per_control,
        interface=interface,
        ahead=ahead,
        decisions=decisions,
    )


def feature_bounds(config):
    """Return (low, high) of the observation of an EpisodeConfig, arrays of one size."""
    low, high, decisions = config.observation_map.low, config.observation_map.high, config.decisions
    if decisions is None:
        return low, high
    history = decisions.mean.shape[0] // low.shape[0] - 1
    ends = (low, *[low - high] * history), (high, *[high - low] * history)
    bounds = [(np.concatenate(end) - decisions.mean) / decisions.scale for end in ends]
    return tuple(np.clip(bound, -decisions.bound, decisions.bound) for bound in bounds)


def allocate_episode(scene, config, laws, periods):
    """Return EpisodeData for a config; periods: control instants whose output rows are stored, 0: none."""
    baseline, estimator = laws
    low, leads = config.observation_map.low, config.observation_map.preview.shape[0]
    n, size, terms = scene.n_state, scene.n_measurements, config.weights.shape[0]
    channels, actions = low.shape[0], n_actions(config.actions.mode)
    features = channels if config.decisions is None else config.decisions.mean.shape[0]
    history = features // channels - 1
    return EpisodeData(
        data=scene.data(),
        x=np.zeros(n),
        u=np.zeros(scene.n_commands),
        memory=np.zeros(1) if baseline is None else baseline.memory,
        estimate=None if estimator is None else estimator.memory,
        action=np.zeros(actions),
        link=interface_data(config.interface, n, scene.n_commands, size),
        ahead=np.zeros(leads),
        motion=None if config.ahead is None else config.ahead.new_memory(),
        observation=np.zeros(features, dtype=np.float32),
        decided=None if config.decisions is None else decision_data(history, channels, actions, terms),
        counts=np.zeros(N_COUNTS, dtype=np.int64),
        reference=np.zeros(len(Reference._fields)),
        previous_measurement=np.zeros(size),
        signals=np.zeros(PREVIEW + leads),
        terms=np.zeros(terms),
        rows=np.zeros((periods, len(scene.channels))) if periods else None,
    )
