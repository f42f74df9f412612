"""Defines the Gymnasium environment, which couples a task, a scene and the compiled control period."""

from collections import deque
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import numpy.typing as npt
import pandas as pd
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from fowt_env.analysis.trim_cache import cached_trim, interpolated_trim, plant_key
from fowt_env.control import (
    EXACT,
    CommandUnits,
    catalogue,
    hidden,
    known_scene,
    preview_leads,
    view_of,
    whole_view,
)
from fowt_env.descriptions.platform import Platform, turbine_of
from fowt_env.descriptions.protection import read_protection
from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.descriptions.sensors import SensorChain
from fowt_env.envs.actions import (
    ACTION_MODES,
    ADDING,
    OF_EACH_BLADE,
    ActionMode,
    n_actions,
    start_tracking,
)
from fowt_env.envs.assembly import (
    adapted_task,
    allocate_episode,
    build_config,
    check_decisions,
    check_shown,
    feature_bounds,
    named_baseline,
    nominal_parts,
)
from fowt_env.envs.decisions import DecisionMap, DecisionSettings
from fowt_env.envs.episode import (
    BAD_ACTION,
    RUNNING,
    SHOWN_COUNTS,
    STEP,
    act,
    act_physical,
    record_last,
    rewrite_observation,
    start_episode,
)
from fowt_env.envs.external_baseline import ExternalBaseline
from fowt_env.envs.goals import GOAL_KEYS, ROOT_REWARD, usual_deviations
from fowt_env.envs.observations import ESTIMATE_CHANNELS, entries
from fowt_env.envs.reset import Start, kept_if_refused, moved_state, with_options
from fowt_env.envs.rewards import REWARD_TERMS, Reference, check_own_reward, paid
from fowt_env.envs.sensors import check_sensors, draw_sensors, reading_scales
from fowt_env.envs.settings import (
    ControlSettings,
    EpisodeSettings,
    InterfaceSettings,
    PlantSettings,
    read_settings,
)
from fowt_env.envs.snapshot import Snapshot, carried, fill_carried
from fowt_env.envs.tables import task_tables
from fowt_env.envs.tasks import TASKS, Task, draw_faults, task_of
from fowt_env.errors import InputError, unknown, warn_once
from fowt_env.loop.interface import Interface, interface_data
from fowt_env.loop.protection import LOADING, PRODUCTION, READY, START, Watch
from fowt_env.loop.sensing import open_sensors
from fowt_env.plant.advance import STOP_REASONS, TRIPPED, output
from fowt_env.plant.compile.handle import Handle
from fowt_env.plant.events import counted
from fowt_env.plant.measurement import Measurement
from fowt_env.plant.state import N_COMMANDS, Command, State
from fowt_env.run.initial_conditions import initial_state
from fowt_env.run.interface import guard_of, law_wind_ahead, starts_parked, wind_ahead_of
from fowt_env.run.outcome import run_frame, stop_facts, trip_name
from fowt_env.run.simulation import check_duration, steps_in
from fowt_env.scene.build import build_scene
from fowt_env.scene.scene import Scene
from fowt_env.weather.preview import exact_preview

SMALL_SEA = {"kind": "regular", "H": 1e-3, "T": 10.0}  # used if the first draw of a task has no waves
SHORTEST_WEATHER = 600.0  # s of random wind and sea: turbulence intensity is defined over 10 min
TRACED = 600  # rows that the traces of a picture begin with: a minute of control periods of 0.1 s
CLOSED = "the environment was closed: create another"
StepResult = tuple[np.ndarray, float, bool, bool, dict[str, Any]]
REFERENCE_SHUTDOWN = Reference._fields.index("shutdown")
REWARD_KEYS = tuple(f"reward/{name}" for name in REWARD_TERMS)
# attributes with arrays that kernels read and write: rebuilt in a copy and filled from a Snapshot
COMPILED = (
    "_view", "_baseline", "_estimator", "_baseline_law", "_estimator_law", "_config", "_episode", "_handle",
)  # fmt: skip


class FowtEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Simulates a floating wind turbine under torque and blade-pitch commands as a Gymnasium environment.

    task          name in TASKS ("above_rated", ...), scaled to the platform's turbine, or a Task
    platform      built-in name, path or descriptions.platform.Platform
    episode, plant, control, interface
                  settings records (EpisodeSettings, PlantSettings, ControlSettings, InterfaceSettings in
                  fowt_env.envs). Each field of a record is also a keyword, as are the options of build_scene:
                  FowtEnv(action_mode="residual", sensors="standard", loads=[...])
    render_mode   None, "rgb_array" (render() returns an image) or "human" (every step draws into a window)
    render_size   image size (width, height), pixels; None: (960, 640)

    An episode starts at the operating point of its mean wind plus the task's offsets, in wind and sea drawn
    from the task's ranges with the environment's seed: the same seed gives the same bits. If the mean wind
    is drawn, the operating point is interpolated between exact ones 0.25 m/s apart, to within 0.05 m of surge
    and 0.03 deg of blade pitch (0.9 m and 0.6 deg in the intervals next to rated wind).
    reset(options=...) accepts "wind", "sea", "weather_seed", "offsets", "shutdown" and "faults" in place of
    drawn values; wind, sea and offsets may be ranges. info["sampled"] of a reset holds the drawn values and,
    passed as options, replays the episode. New weather compiles no kernels: an environment whose task has a
    sea accepts any sea, None for still water; an environment built in still water accepts no waves, and
    a full-field wind box cannot be replaced by another wind. A rejected reset leaves the episode unchanged.

    Actions outside [-1, 1] are clipped; info["saturated_actions"] counts such periods. The torque stays
    within the generator's range and rate limit, the blade pitch within the range and rate limit of its
    actuator; info["torque_limited"] counts periods with a limited torque command. "individual" commands the
    pitch of each blade in a scene with pitch="individual", "individual_residual" adds to it; the other action
    modes command one pitch for all blades. In residual mode the baseline lqr continues from the applied
    command, so an addition in every period is an addition to its rates.

    Failure terminates an episode: rotor speed above the turbine file's overspeed, capsize (platform pitch
    beyond 80 deg) or a state that is not finite; info["termination"] has the reason. The environment
    truncates an episode at the end of its duration, so spec.max_episode_steps is None;
    gymnasium.make(..., max_episode_steps=n) ends episodes earlier.

    protection, faults, sensors and preview have the same meaning as in simulate. With protection or faults
    the overspeed of the turbine file no longer ends an episode: a trip stops the turbine, later actions are
    ignored (info["stopping"]) and the episode continues to its end, as a run of a suite does; a trip with the
    stop "end" terminates the episode. The last info has "tripped" (s), "trip", "stop". Faults may be drawn:
    {"kind": "stuck_pitch", "time": (60.0, 300.0)}. With record=True frame() returns the episode in the format
    of simulate. fowt_env.training.evaluation.case_environment has the settings of a load case.

    Observation, baseline, estimator and measurement() use the same sensor reading in a control period. The
    weather seed determines its noise. Azimuth, last action and the exact preview have no noise; rewards and
    failures use true motions.

    In a task with `shutdown` the baseline operates the turbine within reset for the drawn time. The episode
    begins at the stop signal; its duration includes the operation by the baseline.

    An image shows one control period: 30 images per second are three times real time.
    gymnasium.make(..., render_mode="rgb_array_list") collects the images.

    copy.deepcopy and pickle return an independent environment at the same instant: both then give the same
    bits for the same actions, and the same later episodes. A copy shares constant parts such as the scene; a
    pickle contains the scene (about 13 MB at fidelity "standard", mainly the rotor table). The window of
    render mode "human" stays with the original.

    Domain randomisation: plants differ by settings (platform, turbine, sensors; nominal_plant is the plant
    known to the controllers). fowt_env.training.rl.randomisation.randomised draws lists of such settings of
    OC3-Hywind, for gymnasium.make(name, **settings) or make_vec(name, n, per_env=list).

    Constraints and multiple objectives: SafetyCosts adds info["cost"] as in Safety-Gymnasium. The reward
    vector of MO-Gymnasium is [info["reward/" + term] for term in terms], from a gymnasium.Wrapper whose step
    returns this vector and whose reward_space is a Box of the terms' ranges (REWARD_TERMS).

    info of each step: "time" (s), "saturated_actions", "torque_limited", "reward/<term>" of each term before
    weighting; at a reset and at the end of an episode also "events": {name: count} of rare events of the
    plant (fowt_env.plant.events).

    Raises: InputError for invalid settings and actions.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 30}

    def __init__(
        self,
        task: str | Task = "above_rated",
        platform: str | Path | Platform = "oc3_hywind",
        *,
        episode: EpisodeSettings | None = None,
        plant: PlantSettings | None = None,
        control: ControlSettings | None = None,
        interface: InterfaceSettings | None = None,
        render_mode: str | None = None,
        render_size: Sequence[int] | None = None,
        **keywords: Any,
    ) -> None:
        if render_mode is not None:
            if render_mode not in self.metadata["render_modes"]:
                raise unknown("render_mode", render_mode, self.metadata["render_modes"])
            from fowt_env.visual.rendering import check_size, load_pygame  # only for images

            if render_mode == "human":  # images may never be asked for: stable-baselines3 makes "rgb_array"
                load_pygame()
            check_size("render_size", render_size)
        records = {"episode": episode, "plant": plant, "control": control, "interface": interface}
        settings = read_settings(records, keywords)
        control, options, dt = settings.control, dict(settings.plant.options), settings.plant.dt
        if control.action_mode not in ACTION_MODES:
            raise unknown("action_mode", control.action_mode, ACTION_MODES)
        mode = ACTION_MODES[control.action_mode]
        if mode in OF_EACH_BLADE and options.setdefault("pitch", "individual") != "individual":
            raise InputError(
                f"pitch = {options['pitch']!r}: action_mode = {control.action_mode!r} commands the pitch of"
                " each blade, which needs pitch = 'individual'"
            )
        self.render_mode = render_mode
        self._view: Any = None
        self._passed: deque[dict[str, float]] = deque(maxlen=TRACED)  # with a render mode: rows since reset
        self._reward: float | None = None  # of the last step of the episode
        self.render_size = render_size
        turbine = turbine_of(platform, options.get("turbine"))
        reward = settings.episode.reward
        if isinstance(reward, str) and reward not in GOAL_KEYS:
            raise unknown("reward", reward, GOAL_KEYS)
        self._custom_reward = check_own_reward("reward", reward) if callable(reward) else None
        decisions = check_decisions(control.decisions)
        by_goals = isinstance(reward, str)
        self._agent = (decisions, settings.episode.normalise, reward if by_goals else None)
        self.term_keys = GOAL_KEYS[reward] if isinstance(reward, str) else REWARD_KEYS
        task = self.task = adapted_task(task_of(task, turbine), settings)
        if by_goals and task.shutdown is not None:
            raise InputError(f"reward = {reward!r}: is of operation: task {task.name!r} has a shutdown")
        self.action_mode, self.baseline = control.action_mode, control.baseline
        if mode not in ADDING and task.shutdown is None and self.baseline != ControlSettings.baseline:
            unused = f"baseline = {self.baseline!r}: is not used with action_mode = {self.action_mode!r}"
            warn_once(unused, f"{unused}; allowed: residual, individual_residual, or a task with a shutdown")
        control_dt = control.control_dt
        steps_in("duration", task.duration, control_dt, "control_dt")
        first = task.draw(np.random.default_rng(0))
        sea = first.sea
        if task.has_sea and sea_state_of(sea).height == 0.0:
            sea = SMALL_SEA
        common = {
            "wind": first.wind,
            "sea": sea,
            "rotor": task.rotor,
            "duration": settings.episode.weather_duration or max(task.duration, SHORTEST_WEATHER),
            "fidelity": settings.plant.fidelity,
        }
        self.scene = build_scene(platform, **common, **options)
        if reward == ROOT_REWARD and not self.individual:
            raise InputError(f"reward = {reward!r}: is of single blades: needs pitch = 'individual'")
        check_duration(self.scene, task.duration)
        self._nominal = None  # scene of the nominal plant, if different from the true plant
        if control.nominal_plant is not None:
            parts = nominal_parts(control.nominal_plant)
            self._nominal = build_scene(
                parts["platform"], **common, **options | {"turbine": parts["turbine"]}
            )
        self._interface = settings.interface
        sensors = settings.interface.sensors
        self._sensors = None if sensors is None else check_sensors(sensors, self.scene.turbine)
        self._chain = None  # (name, fields) of a sensor chain, which may lack a requested channel
        if isinstance(self._sensors, SensorChain):
            self._chain = (
                self._sensors.name,
                self._sensors.available + (self._sensors.available_of_blades if self.individual else ()),
            )
            check_shown(task.observation, self._chain)
        self._limits = None  # Protection, with trips or faults
        if settings.interface.protection is not None or settings.interface.faults is not None:
            ratio = turbine.overspeed / turbine.rated_rotor_speed
            self._limits = read_protection(settings.interface.protection, turbine.protection, ratio)
        self.control_dt = float(control_dt)
        self.dt = min(self.scene.dt, self.control_dt) if dt is None else float(dt)
        per_control = steps_in("control_dt", control_dt, self.dt if dt is None else dt)
        self.scene = self.scene.with_step(self.dt)
        self._last = per_control * steps_in("duration", task.duration, control_dt, "control_dt")
        self._key = plant_key(self.scene)
        self._build(mode, per_control)
        if decisions is not None:
            steps_in("duration", task.duration, control_dt * decisions.hold, "the period of a decision")
            if isinstance(self._baseline, ExternalBaseline):
                raise InputError(f"baseline = {self._baseline.name!r}: is not compiled: needs decisions=None")
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n_actions(mode),), np.float32)
        low, high = feature_bounds(self._config)
        self.observation_space = gymnasium.spaces.Box(low.astype(np.float32), high.astype(np.float32))
        self._running, self._closed = False, False
        self._end = ""  # why the last episode ended, and when
        # a snapshot is valid only for an environment with equal values of these
        observed = (self.scene.weather_kind, task.observation, task.wind_preview)
        nominal_key = None if self._nominal is None else plant_key(self._nominal)
        baseline = control.baseline if isinstance(control.baseline, str) else type(control.baseline).__name__
        self._kind = (
            self._key, self.action_mode, baseline, *observed, self.dt, self.control_dt, self._last,
            (nominal_key, self._sensors, self._limits, repr(self._interface.preview), self._interface.record),
            repr(self._agent),
        )  # fmt: skip

    @property
    def decisions(self) -> DecisionSettings | None:
        """Return the settings of the decisions; None if a step is one control period."""
        return self._agent[0]

    @property
    def physics_steps(self) -> int:
        """Return the number of physics steps in a step."""
        return self._per_control * (1 if self.decisions is None else self.decisions.hold)

    @property
    def features(self) -> DecisionMap | None:
        """Return the compiled decisions with mean, scale and bound of the features; None as decisions."""
        return self._config.decisions

    @property
    def individual(self) -> bool:
        """Return whether each blade is pitched individually."""
        return self.scene.model.pitches is not None

    @property
    def is_protected(self) -> bool:
        """Return whether the turbine has trips or faults."""
        return self._limits is not None

    @property
    def is_stopping(self) -> bool:
        """Return whether the turbine is being stopped or started, so that actions are ignored."""
        if not self.is_protected:
            return False
        watch = self._episode.link.watch
        return bool(watch[Watch.STOP] >= 0.0 or PRODUCTION < watch[START] < LOADING)

    def hand_over(self) -> None:
        """End a start-up that has reached the speed of connection: loops restart, and actions count."""
        if self.is_protected and self._episode.link.watch[START] == READY:
            self._episode.link.watch[START] = LOADING
            self.restart_loops()

    def twin(self) -> "FowtEnv":
        """Return a new environment with the same settings, not reset; constant parts are shared."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._np_random = other._np_random_seed = None
        other._running, other._closed, other._end = False, False, ""
        other._view, other._passed = None, deque(maxlen=TRACED)
        other._build(ACTION_MODES[self.action_mode], self._per_control)
        return other

    def __getstate__(self) -> dict[str, Any]:
        """Return the state of a copy: all attributes except compiled ones, and a Snapshot."""
        kept = {name: value for name, value in self.__dict__.items() if name not in COMPILED}
        return kept | {
            "_snapshot": None if self._handle is None else self.get_state(),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the environment from the state of a copy."""
        state = dict(state)
        snapshot = state.pop("_snapshot")
        self.__dict__.update(state)
        self._view = None
        self._build(ACTION_MODES[self.action_mode], self._per_control)
        if snapshot is not None:
            self._restore(snapshot)

    def __deepcopy__(self, memo: dict[int, Any]) -> "FowtEnv":
        """Return an independent environment at the same instant; constant parts are shared."""
        for shared in (self.scene, self._nominal, self.task, self._kind, self._sensors, self.observed):
            memo[id(shared)] = shared
        other = object.__new__(type(self))
        memo[id(self)] = other
        other.__setstate__(deepcopy(self.__getstate__(), memo))
        return other

    def _build(self, mode, per_control):
        """Allocate the arrays of a run and fill the constant ones."""
        scene, task, individual = self.scene, self.task, self.individual
        observed = self.observed = entries(
            task.observation, scene.turbine, task.wind_preview, n_actions(mode), individual
        )
        self._baseline = None
        self._hidden = None  # measurements that the baseline law must not read
        if mode in ADDING:
            copy = deepcopy(self.baseline)  # each environment of a batch needs separate controller memory
            self._baseline = named_baseline(copy, self.design_scene.turbine, self.control_dt)
            preview_leads(self._baseline)
            self._hidden = hidden(self._baseline, self._chain, individual)
        self._estimator = None
        if set(ESTIMATE_CHANNELS) & set(task.observation):
            self._estimator = catalogue().WindEstimator(self.design_scene.turbine, self.control_dt)
            hidden(self._estimator, self._chain, individual)  # raises for inputs that the sensors lack
        laws = (self._baseline, self._estimator)
        self._baseline_law, self._estimator_law = (Handle(None, law and law.law) for law in laws)
        self._per_control = per_control
        # ranges are drawn again at each reset; kinds and number of the faults stay the same
        self._faults = draw_faults(self._interface.faults, np.random.default_rng(0))
        interface, ahead = self._connect(scene, self._guard(scene, self._faults))
        timing = (self.dt, per_control, self.control_dt)
        self._config = build_config(scene, task, mode, observed, timing, laws, interface, ahead, self._agent)
        periods = self._last // per_control + 1 if self._interface.record else 0
        self._episode = allocate_episode(scene, self._config, laws, periods)
        self._handle = None

    def _guard(self, scene, faults):
        """Return the Guard of an episode; None without trips and faults.

        Raises: InputError for faults of parts that the scene lacks.
        """
        if self._limits is None:
            return None
        return guard_of(scene, self._limits, faults, self._per_control * self.dt, self._baseline)

    def _connect(self, scene, guard):
        """Return (Interface, WindAhead of the observation or None) of an episode in a scene's weather."""
        control_dt, sensors = self._per_control * self.dt, None
        if guard is not None:
            sensors = open_sensors(scene.n_measurements)
        if self._sensors is not None:
            readings = self._last // self._per_control + 1
            scales = reading_scales(scene.turbine, self.individual)
            sensors = draw_sensors(self._sensors, scales, self.control_dt, scene.seed, readings)
        preview, observed, read = self._interface.preview, None, None
        if self._baseline is not None:
            period = (self._per_control * self.dt, self.task.duration)
            read = law_wind_ahead(scene, self._baseline, self._given_preview, *period)
        if preview is not None and self.task.wind_preview:
            observed = self._wind_ahead(scene, self.task.wind_preview, preview)
        return Interface(control_dt, sensors, self._hidden, read, guard), observed

    @property
    def _given_preview(self):
        """Return the argument preview of simulate for the baseline."""
        return EXACT if self._interface.preview is None else self._interface.preview

    def _known_scene(self, controller):
        return known_scene(self.design_scene, controller, self._given_preview)

    def _wind_ahead(self, scene, leads, preview):
        """Return the WindAhead of an episode at look-ahead times (s)."""
        return wind_ahead_of(scene, leads, preview, self._per_control * self.dt, self.task.duration)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Return (observation, info) at the start of a new episode.

        options: "wind", "sea", "weather_seed", "offsets" ({channel: offset from the operating point})
        replace the drawn values; "exact_start": whether the operating point is exact (the default for a
        single wind value) or interpolated. wind, sea and offsets may be ranges (low, high), wind a
        mixture and sea {"kind": "joint"}, as in a Task; these are drawn after the task's draws, with the
        same generator. The default sea is that of the task for the wind drawn by the task.

        Raises: InputError for unknown keys and invalid values, with the environment unchanged;
        ClosedEnvironmentError after close().
        """
        if self._closed:
            raise ClosedEnvironmentError(CLOSED)
        with kept_if_refused([self]):
            planned = self._plan(seed, options)
        return self._begin(planned)

    def _plan(self, seed, options):
        """Draw the Start of a new episode; only the random generator changes. Raises as reset."""
        super().reset(seed=seed)
        episode = with_options(self.task.draw(self.np_random), options, self.np_random)
        faults = self._interface.faults if (options or {}).get("faults") is None else options["faults"]
        episode = episode._replace(faults=draw_faults(faults, self.np_random))
        if episode.faults and self._limits is None:
            raise InputError("options['faults']: needs an environment with protection or faults (faults=())")
        scene = self.scene.with_weather(episode.wind, episode.sea, episode.weather_seed)
        check_duration(scene, self.task.duration)
        find = cached_trim if episode.exact_start else interpolated_trim
        state, command = find(scene, self._key, scene.wind_speed)
        reference = Reference(float(state[State.PLATFORM_PITCH]), float(state[State.ROTOR_SPEED]))
        if self._config.goals is not None:
            torque, turbine = float(command[Command.GENERATOR_TORQUE]), scene.turbine
            power = torque * reference.rotor_speed * turbine.drivetrain.gear_ratio
            usual = usual_deviations(turbine, scene.wind_speed)
            reference = Reference(*reference[:3], torque, power, *usual)
        if starts_parked(episode.faults):
            state, command = initial_state(scene, "parked")
        state, command = moved_state(scene, state, command, episode.offsets)
        guard = self._guard(scene, episode.faults)
        return Start(episode, scene, self._nominal_in(scene), state, command, reference, guard)

    def _begin(self, planned):
        """Return (observation, info) at the start of the planned episode."""
        self._running, self._end = False, ""  # until every step below has succeeded
        self._enter(planned.scene, planned.nominal, planned.episode.faults, planned.guard)
        run = self._episode
        run.x[:] = planned.state
        run.u[:] = planned.command
        run.reference[:] = planned.reference
        start_episode(self._handle)
        self.restart_loops()
        if self._estimator is not None:
            self._estimator.reset(self.measurement())
            rewrite_observation(self._handle)
        if planned.episode.shutdown is not None:
            self._operate(planned.episode.shutdown)
        self._running = True
        self._units = CommandUnits("step_physical", self.scene.turbine, self.control_dt)
        info = {
            "time": int(run.counts[STEP]) * self.dt,
            **dict.fromkeys(SHOWN_COUNTS, 0),
            **self._facts(),
            "wind_speed": self.scene.wind_speed,
            "sampled": deepcopy(planned.episode._asdict()),
        }
        self._reward = None
        self._passed.clear()
        self._show()
        return run.observation.copy(), info

    def _show(self):
        """Keep what render draws as traces, and draw in the mode "human"."""
        if self.render_mode is not None:
            self._passed.append(self.channels())
        if self.render_mode == "human":
            self.render()

    def _operate(self, seconds):
        """Operate the turbine with the baseline for the given time (s), then signal the stop."""
        turbine = self.design_scene.turbine
        controller = named_baseline(deepcopy(self.baseline), turbine, self.control_dt)
        leads = preview_leads(controller)
        if "lidar" in controller.information:
            raise InputError(f"baseline {controller.name!r}: reads a lidar, which an ordered stop has not")
        controller.prepare(known_scene(self.design_scene, controller))
        controller.reset(self.measurement(leads))
        run = self._episode
        command = np.empty(run.u.shape)
        for _ in range(round(seconds / self.control_dt)):
            torque, *blade_pitch = controller.act(self.measurement(leads))
            command[0], command[1:] = torque, blade_pitch
            status, _ = act_physical(self._handle, self._estimator_law, command)
            if status != RUNNING:  # the first step of the episode then ends the episode
                break
        run.counts[1:] = 0
        run.reference[REFERENCE_SHUTDOWN] = int(run.counts[STEP]) * self.dt
        self.restart_loops()
        rewrite_observation(self._handle)

    def restart_loops(self) -> None:
        """Restart the baseline of residual mode or the loop of set-point mode from the present measurement.

        Call after driving with step_physical: internal controller states were not updated meanwhile.
        """
        if self._baseline is not None:
            self._baseline.reset(self._baseline_reading())
        elif self._config.actions.mode == ActionMode.SETPOINT:
            start_tracking(self._episode.memory, self.measurement(), self._config.actions)

    def _baseline_reading(self):
        """Return the readings at the present control instant as the baseline's view."""
        values = self._episode.link.law_reading.tolist()
        return view_of(self._baseline, self._config.interface.ahead.values.shape[0])(values)

    def step(self, action: npt.ArrayLike) -> StepResult:
        """Advance one control period; return (observation, reward, terminated, truncated, info)."""
        if not self._running:
            raise self._not_running()
        try:
            requested = np.array(action, dtype=np.float64)  # a float64 copy for the kernel
        except (TypeError, ValueError):
            raise InputError(f"action = {action!r}: must be {self._episode.action.size} numbers") from None
        if requested.shape != self._episode.action.shape:
            raise InputError(f"action has shape {requested.shape}: must be {self.action_space.shape}")
        if isinstance(self._baseline, ExternalBaseline) and np.isfinite(requested).all():
            self._baseline.ask(self._baseline_reading())
        status, reward = act(self._handle, self._baseline_law, self._estimator_law, requested)
        if status == BAD_ACTION:
            raise InputError(f"action = {action!r}: must be finite")
        self.hand_over()
        return self._result(status, reward)

    def _not_running(self):
        """Return the error of a step without a running episode."""
        if self._closed:
            return ClosedEnvironmentError(CLOSED)
        if self._end:
            return ResetNeeded(f"{self._end}: call reset()")
        return ResetNeeded("call reset() first: no episode is running")

    def step_physical(self, torque: float, *blade_pitch: float) -> StepResult:
        """Advance one period under a generator torque (N m) and blade pitch (rad), applied as in simulate.

        blade_pitch: one value for all blades, or three with individual pitch. The generator and the actuator
        follow the command within their limits. Returns as step.
        """
        if not self._running:
            raise self._not_running()
        if self._episode.decided is not None:
            raise InputError("step_physical: advances one control period: needs decisions=None")
        command = np.empty(self._episode.u.shape)
        if len(blade_pitch) not in (1, command.size - 1):
            many = "one" if command.size == N_COMMANDS else f"one, or {command.size - 1}"
            raise InputError(f"blade_pitch = {blade_pitch!r}: must be {many}")
        command[:1], command[1:] = torque, blade_pitch
        if not np.isfinite(command).all():
            values = ", ".join(repr(float(value)) for value in blade_pitch)
            raise InputError(f"torque = {float(torque)!r}, blade_pitch = {values}: must be finite")
        self._units.see(float(command[0]), float(command[1]), self._episode.x[State.ROTOR_SPEED])
        outcome = act_physical(self._handle, self._estimator_law, command)
        self.hand_over()
        return self._result(*outcome)

    def _result(self, status, reward):
        """Return what step returns, from the status and reward of a control period."""
        run = self._episode
        step = int(run.counts[STEP])
        info = dict(zip(self.term_keys, run.terms.tolist(), strict=True))
        info["time"] = step * self.dt
        info |= {key: int(run.counts[entry]) for key, entry in SHOWN_COUNTS.items()}
        if self._limits is not None:
            info["stopping"] = self.is_stopping
        terminated = status != RUNNING
        truncated = not terminated and step >= self._last
        if terminated:
            info["termination"] = self._reason(status)
        if terminated or truncated:
            info |= self._facts()
            self._finish(status)
        if self._custom_reward is not None:
            reward = self._reward_of(info)
        self._reward = reward
        self._show()
        return run.observation.copy(), reward, terminated, truncated, info

    def _finish(self, status):
        """End the episode and store its reason and time for the error of a further step."""
        self._running = False
        if status == RUNNING and self._interface.record:
            record_last(self._handle)
        # without the explanation in brackets
        why = "end of its duration" if status == RUNNING else self._reason(status).partition(" (")[0]
        self._end = f"the episode ended ({why}) at {self._episode.counts[STEP] * self.dt:.1f} s"

    def _reward_of(self, info):
        """Return the reward of the user-defined function for the step described by info."""
        return paid(self._custom_reward, info, self.true_measurement())

    def _reason(self, status):
        """Return the reason of a termination, with the user load that caused the termination, if any."""
        reason = STOP_REASONS[status]
        if status == TRIPPED:
            reason = f"{trip_name(self._episode.link.watch)} ({reason})"
        fault = self.scene.first_nonfinite_load(self._episode.data)
        return f"{reason}: {fault}" if fault else reason

    def _facts(self):
        """Return {"events": ...}, and with trips or faults the entries of stop_facts."""
        facts = {"events": counted(self._episode.data.counters)}
        return facts if self._limits is None else facts | stop_facts(self._episode.link.watch)

    def get_state(self) -> Snapshot:
        """Return a Snapshot of all that determines the later run: plant, controller, weather, generator.

        For what-if studies: set_state(get_state()) and the same actions give the same bits, in this
        environment or another with the same settings. The weather is shared; a snapshot can be pickled.
        """
        if self._handle is None:
            raise ResetNeeded("call reset() first: there is no state yet")
        if isinstance(self._baseline, ExternalBaseline):
            raise InputError(
                f"baseline = {self._baseline.name!r}: is not compiled, so its state cannot be saved"
            )
        arrays = [None if array is None else array.copy() for array in carried(self._episode)]
        generator = None if self._np_random is None else self._np_random.bit_generator.state
        return Snapshot(
            self._kind,
            self.scene,
            self._faults,
            tuple(arrays),
            self._running,
            generator,
            self._np_random_seed,
            self._end,
        )

    def set_state(self, snapshot: Snapshot) -> None:
        """Continue from a Snapshot. Raises: InputError for a Snapshot from other settings."""
        if self._closed:
            raise ClosedEnvironmentError(CLOSED)
        self._check_snapshot(snapshot)
        self._restore(snapshot)

    def _restore(self, snapshot):
        """Continue from a checked Snapshot."""
        if (snapshot.scene, snapshot.faults) != (self.scene, self._faults) or self._handle is None:
            scene, faults = snapshot.scene, snapshot.faults
            self._enter(scene, self._nominal_in(scene), faults, self._guard(scene, faults))
        fill_carried(self._episode, snapshot.arrays)
        self._running, self._end = snapshot.running and not self._closed, snapshot.end
        if snapshot.generator is None:
            self._np_random = None
        else:
            self.np_random.bit_generator.state = snapshot.generator
        self._np_random_seed = snapshot.seed

    def _check_snapshot(self, snapshot):
        """Raise InputError unless snapshot is a Snapshot of an environment with these settings."""
        if not isinstance(snapshot, Snapshot):
            raise InputError(f"state = {type(snapshot).__name__}: must be what get_state() returned")
        if snapshot.kind != self._kind:
            raise InputError(
                "state: is of an environment with another plant, kind of weather, action mode, observation,"
                " duration or time step; must be of one with these settings"
            )

    def _nominal_in(self, scene):
        """Return the nominal plant, in the weather of another scene if a controller is designed on it."""
        if self._nominal is None or (self._baseline is None and self._estimator is None):
            return self._nominal
        return self._nominal.with_weather(scene.wind, scene.sea, scene.seed)

    def _enter(self, scene, nominal, faults, guard):
        """Switch to the scene's weather; reallocate data, whose size depends on the wave components."""
        self.scene, self._nominal, self._faults = scene, nominal, faults
        config = self._config._replace(model=scene.model)
        interface, ahead = self._connect(scene, guard)
        if self._baseline is not None:
            self._baseline.prepare(self._known_scene(self._baseline))
            config = config._replace(parameters=self._baseline.parameters)
        if self._estimator is not None:
            self._estimator.prepare(known_scene(self.design_scene, self._estimator))
            config = config._replace(estimator=self._estimator.parameters)
        self._config = config._replace(interface=interface, ahead=ahead)
        self._episode = self._episode._replace(
            data=scene.data(),
            link=interface_data(interface, scene.n_state, scene.n_commands, scene.n_measurements),
            motion=None if ahead is None else ahead.new_memory(),
        )
        self._handle = Handle(self._config, self._episode)

    def measurement(self, preview_times: Sequence[float] = ()) -> Measurement:
        """Return the present Measurement of all fields (SI), as read by the sensors.

        With individual pitch the field blades is a BladeMeasurement.
        preview_times: increasing, s; adds the field wind_preview, the exact rotor-averaged wind at these
        look-ahead times (only the channel wind_preview and the baseline read a lidar).
        """
        if self._handle is None:
            raise ResetNeeded("call reset() first: nothing has been measured yet")
        reading = self._episode.link.reading.tolist()
        if not len(preview_times):
            return whole_view(reading) if self.individual else Measurement(*reading)
        if self._interface.preview not in (None, EXACT):
            raise InputError(
                f"preview = {self._interface.preview!r}: measurement(preview_times) returns the exact"
                " wind only; the channel wind_preview and the baseline read the lidar"
            )
        time, values = exact_preview(self.scene, tuple(preview_times))[:2]
        return whole_view(reading, [float(np.interp(reading[0], time, row)) for row in values])

    def true_measurement(self) -> Measurement:
        """Return the present Measurement of all fields (SI): true motions, without sensor effects.

        With individual pitch the field blades is a BladeMeasurement.
        """
        if self._handle is None:
            raise ResetNeeded("call reset() first: nothing has been measured yet")
        values = self._episode.link.measurement.tolist()
        return whole_view(values) if self.individual else Measurement(*values)

    @property
    def design_scene(self) -> Scene:
        """Return the scene for controller design: the nominal plant, or the true plant if there is none."""
        return self.scene if self._nominal is None else self._nominal

    def channels(self) -> dict[str, float]:
        """Return {OpenFAST channel: value in its unit} at the present instant; the run is unchanged."""
        if self._handle is None:
            raise ResetNeeded("call reset() first: there is no state yet")
        run, scene = self._episode, self.scene
        data = scene.data()
        fill_carried(run._replace(data=data), carried(run))
        row = np.empty(len(scene.channels))
        time = run.counts[STEP] * self.dt
        output(scene.handle(data), run.x, run.u, time, np.zeros_like(run.x), row)
        values = scene.values(row[None, :])[0].tolist()
        return dict(zip((channel.name for channel in scene.channels), values, strict=True))

    def frame(self) -> pd.DataFrame:
        """Return the episode so far as a DataFrame with the rows and attrs of simulate.

        Needs record=True. Each row is the start of a control period with the command of this period; the
        row at the end of the episode is included once the episode is truncated.
        """
        if not self._interface.record or self._handle is None:
            raise InputError("frame() needs record=True, and a reset")
        run = self._episode
        done = int(run.counts[STEP]) // self._per_control
        filled = done + int(not self._running and done * self._per_control >= self._last)
        return run_frame(
            self.scene, run.rows[:filled].copy(), run.data.counters, run.link.watch, self.control_dt
        )

    @property
    def rows(self) -> np.ndarray | None:
        """Return the stored output rows (control periods + 1, n_channels), SI; None without record=True."""
        return self._episode.rows

    @property
    def last_action(self) -> np.ndarray:
        """Return a copy of the last accepted action (actions,)."""
        return self._episode.action.copy()

    def view(self) -> "View":
        """Return a View with copies of the arrays at the present instant."""
        run = self._episode
        link, estimate = run.link, run.estimate
        return View(
            run.x.copy(),
            run.u.copy(),
            link.command.copy(),
            link.measurement.copy(),
            link.reading.copy(),
            run.action.copy(),
            run.ahead.copy(),
            run.terms.copy(),
            run.memory.copy(),
            None if estimate is None else estimate.copy(),
        )

    def render(self) -> np.ndarray | None:
        """Return an image (height, width, 3) uint8 of this instant; mode "human": show it and return None.

        The image includes the last action and reward; render_size sets width and height.

        Without a render mode, warn as Gymnasium's built-in environments do and return None.
        """
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() needs a render_mode: gymnasium.make(..., render_mode='rgb_array'),"
                " or 'rgb_array_list' or 'human'"
            )
            return None
        if self._closed:
            raise ClosedEnvironmentError(CLOSED)
        from fowt_env.visual import rendering

        row = self.channels()
        if self._view is None:
            speed = self.metadata["render_fps"] * self.control_dt
            size = rendering.SIZE if self.render_size is None else tuple(self.render_size)
            self._view = rendering.View([self.scene], size=size, speed=speed)
        elif self._view.panels[0].scene is not self.scene:
            self._view.enter(self.scene)
        while self._passed:
            self._view.traces.add([self._passed.popleft()])
        self._view.draw([row], rendering.Agent(tuple(self._episode.action.tolist()), self._reward))
        if self.render_mode == "rgb_array":
            return self._view.array()
        self._view.show(self.metadata["render_fps"])
        return None

    def close(self) -> None:
        """Close the environment and its window; reset and step then raise ClosedEnvironmentError."""
        self._running, self._closed = False, True
        if isinstance(self._baseline, ExternalBaseline):
            self._baseline.finish()
        if self._view is not None:
            self._view.close()
            self._view = None
        super().close()


class View(NamedTuple):
    """Holds copies of the arrays of an environment at one instant; SI."""

    state: np.ndarray  # (n_state,) fowt_env.plant.state.State
    in_force: np.ndarray  # (n_commands,) torque and blade-pitch command in force
    command: np.ndarray  # (n_commands,) of the last action, before faults and limits
    measurement: np.ndarray  # of the true motions
    reading: np.ndarray  # measurement as read by the sensors
    action: np.ndarray  # last accepted action
    ahead: np.ndarray  # (leads,) wind ahead in the observation, m/s
    terms: np.ndarray  # reward terms of the last step
    baseline_memory: np.ndarray  # of the baseline law or the set-point loop
    estimate: np.ndarray | None  # memory of the estimator


FowtEnv.__doc__ = f"{FowtEnv.__doc__}\n{task_tables(TASKS['above_rated'])}"
