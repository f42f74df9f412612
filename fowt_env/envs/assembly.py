"""Assembles an environment from its settings: task, compiled controllers, constant parts and arrays."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf

import numpy as np

from fowt_env.control import CompiledController, catalogue, make
from fowt_env.envs.actions import build_action_map, n_actions
from fowt_env.envs.episode import N_COUNTS, EpisodeConfig, EpisodeData
from fowt_env.envs.external_baseline import ExternalBaseline
from fowt_env.envs.observations import BLADE_CHANNELS, PREVIEW, build_observation_map, check_channels
from fowt_env.envs.rewards import N_TERMS, Reference, build_scales, check_weights, weight_array
from fowt_env.envs.settings import Settings
from fowt_env.envs.tasks import Task
from fowt_env.errors import InputError, unknown
from fowt_env.loop.interface import interface_data
from fowt_env.plant.measurement import Measurement


def adapted_task(task: Task, settings: Settings) -> Task:
    """Return the task with its values replaced by those of the settings."""
    episode = settings.episode
    replaced = {"rotor": settings.plant.rotor} | {
        name: getattr(episode, name) for name in ("duration", "wind", "sea", "wind_preview")
    }
    changes = {name: value for name, value in replaced.items() if value is not None}
    if episode.observation is not None:
        changes["observation"] = check_channels("observation", episode.observation, default=task.observation)
    if episode.reward is not None and not callable(episode.reward):
        changes["weights"] = task.weights | check_weights("reward", episode.reward)
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


def build_config(scene, task, mode, observed, timing, laws, interface, ahead):
    """Return the EpisodeConfig of a scene and a Task.

    observed: entries of the observation; timing: (dt, physics steps in a control period, control_dt);
    laws: (baseline, estimator), compiled controllers or None; ahead: WindAhead of the observation or None.
    """
    (dt, per_control, control_dt), (baseline, estimator), turbine = timing, laws, scene.turbine
    individual = baseline is not None and baseline.individual
    return EpisodeConfig(
        model=scene.model,
        actions=build_action_map(mode, task, turbine, control_dt, individual),
        parameters=np.zeros(1) if baseline is None else baseline.parameters,
        estimator=None if estimator is None else estimator.parameters,
        observation_map=build_observation_map(observed, task.wind_preview),
        scales=build_scales(turbine, control_dt),
        weights=weight_array(task.weights),
        overspeed=float(turbine.overspeed) if interface.guard is None else inf,
        dt=dt,
        per_control=per_control,
        interface=interface,
        ahead=ahead,
    )


def allocate_episode(scene, config, laws, periods):
    """Return EpisodeData for a config; periods: control instants whose output rows are stored, 0: none."""
    baseline, estimator = laws
    low, leads = config.observation_map.low, config.observation_map.preview.shape[0]
    n, size = scene.n_state, scene.n_measurements
    return EpisodeData(
        data=scene.data(),
        x=np.zeros(n),
        u=np.zeros(scene.n_commands),
        memory=np.zeros(1) if baseline is None else baseline.memory,
        estimate=None if estimator is None else estimator.memory,
        action=np.zeros(n_actions(config.actions.mode)),
        link=interface_data(config.interface, n, scene.n_commands, size),
        ahead=np.zeros(leads),
        motion=None if config.ahead is None else config.ahead.new_memory(),
        observation=np.zeros(low.shape[0], dtype=np.float32),
        counts=np.zeros(N_COUNTS, dtype=np.int64),
        reference=np.zeros(len(Reference._fields)),
        previous_measurement=np.zeros(size),
        signals=np.zeros(PREVIEW + leads),
        terms=np.zeros(N_TERMS),
        rows=np.zeros((periods, len(scene.channels))) if periods else None,
    )
