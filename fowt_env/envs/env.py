"""The Gymnasium environment: a task, a scene and the compiled control period, glued together."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from fowt_env.analysis.trim_cache import cached_trim, interpolated_trim, plant_key
from fowt_env.control import (
    CommandUnits,
    CompiledController,
    catalogue,
    hidden,
    known_scene,
    make,
    preview_leads,
    view_of,
    whole_view,
)
from fowt_env.descriptions.checks import short
from fowt_env.descriptions.platform import Platform, read_platform
from fowt_env.descriptions.records import RENAMED
from fowt_env.descriptions.sea_state import sea_of, sea_state_of
from fowt_env.descriptions.sensors import SensorChain
from fowt_env.descriptions.turbine import Turbine, read_turbine
from fowt_env.descriptions.wind import wind_of
from fowt_env.envs.actions import ACTION_MODES, ActionMode, build_action_map, n_actions, start_tracking
from fowt_env.envs.episode import (
    BAD_ACTION,
    N_COUNTS,
    RUNNING,
    SHOWN_COUNTS,
    STEP,
    EpisodeConfig,
    EpisodeData,
    Given,
    act,
    act_physical,
    rewrite_observation,
    start_episode,
)
from fowt_env.envs.observations import (
    BLADE_CHANNELS,
    ESTIMATE_CHANNELS,
    PREVIEW,
    build_observation_map,
    check_channels,
    entries,
)
from fowt_env.envs.rewards import (
    N_TERMS,
    REWARD_TERMS,
    Reference,
    build_scales,
    check_own_reward,
    check_weights,
    paid,
    weight_array,
)
from fowt_env.envs.sensors import check_sensors, draw_sensors, reading_scales
from fowt_env.envs.snapshot import CARRIED, DATA_CARRIED, Snapshot
from fowt_env.envs.tables import task_tables
from fowt_env.envs.tasks import TASKS, Episode, Task, draw_offsets, draw_weather, is_mixture, task_of, varies
from fowt_env.errors import InputError, unknown, unknown_keyword
from fowt_env.initial_conditions import INITIAL
from fowt_env.plant.channels import DEG_PER_RAD
from fowt_env.plant.compile.handle import Handle
from fowt_env.plant.events import counted
from fowt_env.plant.measurement import Measurement
from fowt_env.plant.rollout import STOP_REASONS, output
from fowt_env.plant.sensing import new_past
from fowt_env.plant.state import N_COMMANDS, Command, State
from fowt_env.scene.actuators import rest_actuators
from fowt_env.scene.build import build_scene
from fowt_env.scene.options import OPTIONS
from fowt_env.scene.scene import Scene
from fowt_env.simulation import check_duration, steps_in
from fowt_env.weather.preview import exact_preview

SMALL_SEA = {"kind": "regular", "H": 1e-3, "T": 10.0}  # of a scene whose first draw happens to have no waves
SHORTEST_WEATHER = 600.0  # s of random wind and sea: turbulence intensity is defined over 10 min
CLOSED = "the environment was closed: make another"
StepResult = tuple[np.ndarray, float, bool, bool, dict[str, Any]]
REFERENCE_SHUTDOWN = Reference._fields.index("shutdown")
REWARD_KEYS = tuple(f"reward/{name}" for name in REWARD_TERMS)
# attributes that hold what a kernel reads and writes: made anew in a copy, and filled from a Snapshot
COMPILED = (
    "_view", "_baseline", "_estimator", "_baseline_law", "_estimator_law", "_config", "_episode", "_handle",
)  # fmt: skip


class FowtEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Floating wind turbine whose generator torque and blade pitch, or that of each blade, are commanded.

    task          name in TASKS ("above_rated", "full_range", "steady"), scaled to the platform's turbine, or
                  a Task, which is taken as it is
    platform      built-in name, path or descriptions.platform.Platform
    rotor         "bem", "lookup" or "table"; None: the task's, or else that of the fidelity
    action_mode   "direct", "setpoint", "residual" or "individual", see the table of actions. "individual"
                  commands the pitch of each blade, in a scene with pitch = "individual"; in such a scene the
                  others give their one pitch to all blades
    baseline      compiled controller, by name, that the residual mode adds to; lqr goes on from the sum, so
                  that what is added in every period is an addition to its rates
    observation   channel names in place of the task's; "default" among them stands for the task's
    reward        {term: weight} in place of single weights of the task, or a function (info) or (info,
                  measurement) that returns it, from the info of the step, with each named term, and the
                  Measurement at its end (SI, true motions)
    dt            physics step, s (None: that of the scene's integrator); control_dt: time between
                  actions, s, a multiple of dt
    duration      s of an episode; None: the task's
    wind, sea     in place of the task's, ranges included (None: the task's)
    wind_preview  look-ahead times (s) of the channel wind_preview
    render_mode   None, "rgb_array" (render() returns a picture) or "human" (every step shows one in a window)
    render_size   pixels (width, height) of it; None: (960, 640)
    fidelity      level of build_scene: "reference", "standard" or "fast"
    sensors       the name of a chain of sensors ("standard"), a SensorChain, or {"noise": standard deviation
                  of white noise on every reading, as a fraction of the channel's scale; "delay": control
                  periods from measurement to reading}, of which either may be left out. One
                  reading per control period is what observation, baseline and estimator are given, and
                  measurement() returns; its noise follows from the weather's seed. Azimuth, last action and
                  preview are exact; rewards and failures are of the true motions. None: readings are exact
    nominal_plant {"platform": ..., "turbine": ...} as build_scene takes them (the turbine may be left out:
                  the platform's): the plant that baseline and estimator are designed on, where it differs
                  from the true plant, which is simulated. None: the true plant
    options       further ones go to build_scene, loads of one's own (fowt_env.Load) among them

    An episode starts at the operating point of its mean wind, moved by the task's offsets, in wind and
    sea drawn from the task's ranges with the environment's seed: the same seed gives the same bits.
    Where the mean wind is drawn, the operating point is linear between exact ones 0.25 m/s apart: right
    to 0.05 m of surge and 0.03 deg of blade pitch, in the cells next to rated wind to 0.9 m and 0.6 deg.
    reset(options=...) takes "wind", "sea", "weather_seed", "offsets" and "shutdown" in place of what is
    drawn, wind, sea and offsets as ranges too, drawn with the environment's generator; the info of reset
    has what was drawn under "sampled", and given as options it replays the episode. Weather
    never compiles anything anew: an environment whose task has a sea takes any sea, None for still water, but
    one built in still water takes none; neither is a box of full-field wind exchanged for another wind. What
    is refused leaves the environment as it was, in its episode.

    An action beyond [-1, 1] counts as the nearest end, and info["saturated_actions"] counts the periods
    in which that happened. The torque stays within the generator's range and moves at most as fast as its
    rate limit allows, the blade pitch as its actuator does; info["torque_limited"] counts the periods in
    which the torque was not what was commanded.

    An episode is terminated by failure: rotor speed beyond the turbine file's overspeed, capsize
    (platform pitch beyond 80 deg) or a state that is not finite; info["termination"] has the reason. It
    is truncated at the end of its duration, by the environment itself: how many steps that takes follows from
    duration and control_dt, so spec.max_episode_steps is None. gymnasium.make(..., max_episode_steps=n) ends
    episodes earlier.

    In a task with `shutdown` the baseline operates the turbine, within reset, for the time that is drawn. The
    episode begins where the stop is signalled; its duration counts the operation too.

    A picture shows one control period, so that 30 of them a second are three times real time.
    gymnasium.make(..., render_mode="rgb_array_list") collects them.

    copy.deepcopy and pickle give an independent environment in the same instant: both then give the same bits
    for the same actions, and the same episodes after them. A copy shares what is never written, such as the
    scene; a pickle holds it (some 13 MB at fidelity "standard", most of it the rotor's table). A window of
    render mode "human" and the traces of pictures so far stay with the original.

    Plants that differ between environments (domain randomisation) are settings: platform, turbine, sensors,
    with nominal_plant for what controllers know. fowt_env.training.rl.randomisation.randomised draws lists of
    such settings of OC3-Hywind from named distributions, for gymnasium.make(name, **settings) or
    make_vec(name, n, per_env=list).

    Constraints and several objectives: SafetyCosts adds info["cost"] as Safety-Gymnasium has it. The reward
    vector of MO-Gymnasium is [info["reward/" + term] for term in terms], from a gymnasium.Wrapper whose
    step returns it and whose reward_space is a Box of the terms' ranges (REWARD_TERMS).

    info of each step: "time" (s), "saturated_actions", "torque_limited", "reward/<term>" for each term before
    weighting; at a reset and at the end of an episode "events" too: {name: count} of what the plant met
    outside its usual range (fowt_env.plant.events), of those that happened.

    Raises: InputError for settings and actions that cannot be used.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 30}

    def __init__(
        self,
        task: str | Task = "above_rated",
        platform: str | Path | Platform = "oc3_hywind",
        rotor: str | None = None,
        action_mode: str = "direct",
        baseline: str = "pi",
        observation: Sequence[str] | None = None,
        reward: Mapping[str, float] | Callable[[dict[str, Any], Measurement], float] | None = None,
        dt: float | None = None,
        control_dt: float = 0.1,
        duration: float | None = None,
        wind: Any = None,
        sea: Any = None,
        wind_preview: Sequence[float] | None = None,
        render_mode: str | None = None,
        render_size: Sequence[int] | None = None,
        fidelity: str = "standard",
        sensors: str | SensorChain | Mapping[str, Any] | None = None,
        nominal_plant: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        if render_mode is not None:
            if render_mode not in self.metadata["render_modes"]:
                raise unknown("render_mode", render_mode, self.metadata["render_modes"])
            from fowt_env.visual.rendering import check_size, load_pygame  # nobody else pays for it

            load_pygame()
            check_size("render_size", render_size)
        if action_mode not in ACTION_MODES:
            raise unknown("action_mode", action_mode, ACTION_MODES)
        mode = ACTION_MODES[action_mode]
        if mode == ActionMode.INDIVIDUAL and options.setdefault("pitch", "individual") != "individual":
            raise InputError(
                f"pitch = {options['pitch']!r}: action_mode = 'individual' commands the pitch of each blade,"
                " which needs pitch = 'individual'"
            )
        for key in options:
            if key in RENAMED:
                raise InputError(f"setting {key!r} of FowtEnv: is called {RENAMED[key]} now")
            if key not in OPTIONS and key != "loads":
                raise unknown_keyword("FowtEnv.__init__", key, {*OPTIONS, "loads", *SETTINGS})
        self.render_mode = render_mode
        self._view: Any = None
        self._reward: float | None = None  # of the last step of the episode
        self.render_size = render_size
        turbine = _turbine_of(platform, options.get("turbine"))
        task = task_of(task, turbine)
        self._own_reward = check_own_reward("reward", reward) if callable(reward) else None
        reward = None if callable(reward) else reward
        task = _adapted(task, rotor, observation, reward, duration, wind, sea, wind_preview)
        self.task = task
        self.action_mode = action_mode
        self.baseline = baseline
        steps_in("duration", task.duration, control_dt, "control_dt")
        episode = task.draw(np.random.default_rng(0))
        sea = episode.sea
        if task.has_sea and sea_state_of(sea).height == 0.0:
            sea = SMALL_SEA
        self.scene = build_scene(
            platform,
            wind=episode.wind,
            sea=sea,
            rotor=task.rotor,
            duration=max(task.duration, SHORTEST_WEATHER),
            fidelity=fidelity,
            **options,
        )
        check_duration(self.scene, task.duration)
        self._nominal = None  # the scene of the nominal plant, where that is not the true one
        if nominal_plant is not None:
            parts = _nominal_parts(nominal_plant)
            nominal_options = {**options, "turbine": parts["turbine"]}
            length = max(task.duration, SHORTEST_WEATHER)
            self._nominal = build_scene(
                parts["platform"], episode.wind, sea, rotor=task.rotor, duration=length,
                fidelity=fidelity, **nominal_options,
            )  # fmt: skip
        self._sensors = None if sensors is None else check_sensors(sensors, self.scene.turbine)
        self._chain = None  # (name, fields) of a sensor chain, which may lack what is asked for
        if isinstance(self._sensors, SensorChain):
            self._chain = (
                self._sensors.name,
                self._sensors.available + (self._sensors.available_of_blades if self.individual else ()),
            )
            _check_shown(task.observation, self._chain)
        self.control_dt = float(control_dt)
        self.dt = min(self.scene.dt, self.control_dt) if dt is None else float(dt)
        per_control = steps_in("control_dt", control_dt, self.dt if dt is None else dt)
        self.scene = self.scene.with_step(self.dt)
        self._last = per_control * steps_in("duration", task.duration, control_dt, "control_dt")
        self._key = plant_key(self.scene)
        self._build(mode, per_control)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n_actions(mode),), np.float32)
        low, high = self._config.observation_map.low, self._config.observation_map.high
        self.observation_space = gymnasium.spaces.Box(low.astype(np.float32), high.astype(np.float32))
        self._running, self._closed = False, False
        self._end = ""  # why the last episode ended, and when
        # what a snapshot must agree with: the same numbers then mean the same
        observed = (self.scene.weather_kind, task.observation, task.wind_preview)
        nominal_key = None if self._nominal is None else plant_key(self._nominal)
        self._kind = (
            self._key, action_mode, baseline, *observed, self.dt, self.control_dt, self._last,
            (nominal_key, self._sensors),
        )  # fmt: skip

    @property
    def individual(self) -> bool:
        """Whether every blade has a pitch of its own."""
        return self.scene.model.pitches is not None

    def twin(self) -> "FowtEnv":
        """Another environment of the same settings, before its first reset; shares what is never written."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._np_random = other._np_random_seed = None
        other._running, other._closed, other._end = False, False, ""
        other._view = None
        other._build(ACTION_MODES[self.action_mode], self._config.per_control)
        return other

    def __getstate__(self) -> dict[str, Any]:
        """What a copy is made from: the attributes less the compiled ones, and a Snapshot."""
        kept = {name: value for name, value in self.__dict__.items() if name not in COMPILED}
        return kept | {
            "_per_control": self._config.per_control,
            "_snapshot": None if self._handle is None else self.get_state(),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Become a copy."""
        state = dict(state)
        per_control, snapshot = state.pop("_per_control"), state.pop("_snapshot")
        self.__dict__.update(state)
        self._view = None
        self._build(ACTION_MODES[self.action_mode], per_control)
        if snapshot is not None:
            self._restore(snapshot)

    def __deepcopy__(self, memo: dict[int, Any]) -> "FowtEnv":
        """An independent environment in the same instant, which shares what is never written."""
        for shared in (self.scene, self._nominal, self.task, self._kind, self._sensors, self.observed):
            memo[id(shared)] = shared
        other = object.__new__(type(self))
        memo[id(self)] = other
        other.__setstate__(deepcopy(self.__getstate__(), memo))
        return other

    def _build(self, mode, per_control):
        """Allocate the arrays of a run and fill what never changes."""
        scene, turbine, task = self.scene, self.scene.turbine, self.task
        individual, actions = self.individual, n_actions(mode)
        observed = self.observed = entries(task.observation, turbine, task.wind_preview, actions, individual)
        self._baseline = None
        baseline_law = None
        parameters, memory = np.zeros(1), np.zeros(1)
        if mode == ActionMode.RESIDUAL:
            self._baseline = named_baseline(self.baseline, self.design_scene.turbine, self.control_dt)
            baseline_law = self._baseline.law
            parameters, memory = self._baseline.parameters, self._baseline.memory
        self._estimator = estimator_law = None
        if set(ESTIMATE_CHANNELS) & set(task.observation):
            self._estimator = catalogue().WindEstimator(self.design_scene.turbine, self.control_dt)
            estimator_law = self._estimator.law
            hidden(self._estimator, self._chain, individual)  # refuses what the sensors do not show
        leads, given = (), None
        if self._baseline is not None:
            leads = preview_leads(self._baseline)
            given = Given(hidden(self._baseline, self._chain, individual), *self._foresee(scene, leads))
        estimating, sensed = self._estimator is not None, self._sensors is not None
        self._baseline_law = Handle(None, baseline_law)
        self._estimator_law = Handle(None, estimator_law)
        self._config = EpisodeConfig(
            model=scene.model,
            actions=build_action_map(
                mode, task, turbine, self.control_dt, self._baseline is not None and self._baseline.individual
            ),
            parameters=parameters,
            estimator=self._estimator.parameters if estimating else None,
            observation_map=build_observation_map(observed, task.wind_preview),
            scales=build_scales(turbine, self.control_dt),
            weights=weight_array(task.weights),
            overspeed=float(turbine.overspeed),
            dt=self.dt,
            per_control=per_control,
            sensors=self._drawn(scene, per_control) if sensed else None,
            given=given,
        )
        n = scene.n_state
        measured = scene.n_measurements
        measurement = np.zeros(measured)
        reading = np.zeros(measured) if sensed else measurement
        self._episode = EpisodeData(
            data=scene.data(),
            x=np.zeros(n),
            u=np.zeros(scene.n_commands),
            memory=memory,
            estimate=self._estimator.memory if estimating else None,
            action=np.zeros(actions),
            measurement=measurement,
            reading=reading,
            past=new_past(self._config.sensors.chain) if sensed else None,
            observation=np.zeros(len(observed), dtype=np.float32),
            counts=np.zeros(N_COUNTS, dtype=np.int64),
            reference=np.zeros(len(Reference._fields)),
            previous_measurement=np.zeros(measured),
            dx=np.zeros(n),
            baseline_command=np.zeros(scene.n_commands),
            baseline_reading=reading if self._baseline is None else np.zeros(measured + len(leads)),
            signals=np.zeros(PREVIEW + len(task.wind_preview)),
            terms=np.zeros(N_TERMS),
        )
        self._handle = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """(observation, info) at the start of a new episode.

        options: "wind", "sea", "weather_seed", "offsets" ({channel: added to the operating point}) in
        place of what is drawn; "exact_start": whether the operating point is exact (it is where one wind
        is given) or interpolated. wind, sea and offsets may be ranges (low, high), the wind a mixture and the
        sea {"kind": "joint"}, as in a Task; drawn after what the task draws, with the same generator. A sea
        that is not given is the task's, for the wind that the task drew.

        Raises: InputError for other keys and values that cannot be used; the environment is then as it was
        before. ClosedEnvironmentError after close().
        """
        if self._closed:
            raise ClosedEnvironmentError(CLOSED)
        with kept_if_refused([self]):
            planned = self._plan(seed, options)
        return self._begin(planned)

    def _plan(self, seed, options):
        """Start of a new episode, drawn with the generator; nothing else changes. Raises as reset."""
        super().reset(seed=seed)
        episode = _with_options(self.task.draw(self.np_random), options, self.np_random)
        scene = self.scene.with_weather(episode.wind, episode.sea, episode.weather_seed)
        check_duration(scene, self.task.duration)
        find = cached_trim if episode.exact_start else interpolated_trim
        state, command = find(scene, self._key, scene.wind_speed)
        reference = Reference(float(state[State.PLATFORM_PITCH]), float(state[State.ROTOR_SPEED]))
        state, command = _moved(scene, state, command, episode.offsets)
        return Start(episode, scene, self._nominal_in(scene), state, command, reference)

    def _begin(self, planned):
        """(observation, info) at the start of the episode that was planned."""
        self._running, self._end = False, ""  # until all of it has worked
        self._enter(planned.scene, planned.nominal)
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
            "events": self._events(),
            "wind_speed": self.scene.wind_speed,
            "sampled": deepcopy(planned.episode._asdict()),
        }
        self._reward = None
        if self.render_mode == "human":
            self.render()
        return run.observation.copy(), info

    def _operate(self, seconds):
        """Let the baseline have the turbine for so long; then the stop is signalled."""
        controller = named_baseline(self.baseline, self.design_scene.turbine, self.control_dt)
        leads = preview_leads(controller)
        controller.prepare(known_scene(self.design_scene, controller))
        controller.reset(self.measurement(leads))
        run = self._episode
        command = np.empty(run.u.shape)
        for _ in range(round(seconds / self.control_dt)):
            torque, *blade_pitch = controller.act(self.measurement(leads))
            command[0], command[1:] = torque, blade_pitch
            status, _ = act_physical(self._handle, self._estimator_law, command)
            if status != RUNNING:  # and the first step of the episode ends it
                break
        run.counts[1:] = 0
        run.reference[REFERENCE_SHUTDOWN] = int(run.counts[STEP]) * self.dt
        self.restart_loops()
        rewrite_observation(self._handle)

    def restart_loops(self) -> None:
        """Start the baseline of residual mode, or the loop of set-point mode, from what is measured now.

        For whoever took over through step_physical and hands back: the loops have not followed.
        """
        if self._baseline is not None:
            self._baseline.reset(view_of(self._baseline)(self._episode.baseline_reading.tolist()))
        elif self._config.actions.mode == ActionMode.SETPOINT:
            start_tracking(self._episode.memory, self.measurement(), self._config.actions)

    def step(self, action: npt.ArrayLike) -> StepResult:
        """(observation, reward, terminated, truncated, info) after one control period."""
        if not self._running:
            raise self._standing()
        try:
            requested = np.array(action, dtype=np.float64)  # a copy: steady types, whatever was given
        except (TypeError, ValueError):
            raise InputError(f"action = {action!r}: must be {self._episode.action.size} numbers") from None
        if requested.shape != self._episode.action.shape:
            raise InputError(f"action has shape {requested.shape}: must be {self.action_space.shape}")
        status, reward = act(self._handle, self._baseline_law, self._estimator_law, requested)
        if status == BAD_ACTION:
            raise InputError(f"action = {action!r}: must be finite")
        return self._result(status, reward)

    def _standing(self):
        """The error of a step without a running episode."""
        if self._closed:
            return ClosedEnvironmentError(CLOSED)
        if self._end:
            return ResetNeeded(f"{self._end}: call reset()")
        return ResetNeeded("call reset() first: no episode is running")

    def step_physical(self, torque: float, *blade_pitch: float) -> StepResult:
        """As step, under a generator torque (N m) and blade pitch (rad), applied as simulate does.

        blade_pitch: one for all blades, or three where each has its own. The generator and the pitch actuator
        follow it as far as their limits allow.
        """
        if not self._running:
            raise self._standing()
        command = np.empty(self._episode.u.shape)
        if len(blade_pitch) not in (1, command.size - 1):
            many = "one" if command.size == N_COMMANDS else f"one, or {command.size - 1}"
            raise InputError(f"blade_pitch = {blade_pitch!r}: must be {many}")
        command[:1], command[1:] = torque, blade_pitch
        if not np.isfinite(command).all():
            values = ", ".join(repr(float(value)) for value in blade_pitch)
            raise InputError(f"torque = {float(torque)!r}, blade_pitch = {values}: must be finite")
        self._units.see(float(command[0]), float(command[1]), self._episode.x[State.ROTOR_SPEED])
        return self._result(*act_physical(self._handle, self._estimator_law, command))

    def _result(self, status, reward):
        """What step returns, from the status and reward of a control period."""
        run = self._episode
        step = int(run.counts[STEP])
        info = dict(zip(REWARD_KEYS, run.terms.tolist(), strict=True))
        info["time"] = step * self.dt
        info |= {key: int(run.counts[entry]) for key, entry in SHOWN_COUNTS.items()}
        terminated = status != RUNNING
        truncated = not terminated and step >= self._last
        if terminated:
            info["termination"] = self._reason(status)
        if terminated or truncated:
            info["events"] = self._events()
            self._finish(status)
        if self._own_reward is not None:
            reward = self._own(info)
        self._reward = reward
        if self.render_mode == "human":
            self.render()
        return run.observation.copy(), reward, terminated, truncated, info

    def _finish(self, status):
        """End the episode; says why and when in what a further step raises."""
        self._running = False
        # the words before the explanation in brackets
        why = "end of its duration" if status == RUNNING else self._reason(status).partition(" (")[0]
        self._end = f"the episode ended ({why}) at {self._episode.counts[STEP] * self.dt:.1f} s"

    def _own(self, info):
        """Reward of the user's function for the step of this info."""
        return paid(self._own_reward, info, self.true_measurement())

    def _reason(self, status):
        """Why an episode was terminated, with the user load that caused it, if one did."""
        fault = self.scene.first_nonfinite_load(self._episode.data)
        return f"{STOP_REASONS[status]}: {fault}" if fault else STOP_REASONS[status]

    def _events(self):
        """{event: count} since the reset, of the rare events that happened (fowt_env.plant.events)."""
        return counted(self._episode.data.counters)

    def get_state(self) -> Snapshot:
        """Snapshot of all that decides how the run goes on: plant, controller, counters, weather, draws.

        For what-if: set_state(get_state()) and the same actions give the same bits, in this environment
        or in another of the same settings. The weather is shared, not copied; a snapshot can be pickled.
        """
        if self._handle is None:
            raise ResetNeeded("call reset() first: there is no state yet")
        run = self._episode
        found = [getattr(run, name) for name in CARRIED] + [getattr(run.data, name) for name in DATA_CARRIED]
        arrays = [None if array is None else array.copy() for array in found]
        generator = None if self._np_random is None else self._np_random.bit_generator.state
        return Snapshot(
            self._kind, self.scene, tuple(arrays), self._running, generator, self._np_random_seed, self._end
        )

    def set_state(self, snapshot: Snapshot) -> None:
        """Go on from a Snapshot. Raises: InputError for one from an environment of other settings."""
        if self._closed:
            raise ClosedEnvironmentError(CLOSED)
        self._check_snapshot(snapshot)
        self._restore(snapshot)

    def _restore(self, snapshot):
        """Go on from a Snapshot of these settings."""
        if snapshot.scene is not self.scene or self._handle is None:
            self._enter(snapshot.scene, self._nominal_in(snapshot.scene))
        run, data = self._episode, self._episode.data
        arrays = iter(snapshot.arrays)
        for name in CARRIED:
            array, saved = getattr(run, name), next(arrays)
            if array is not None:
                array[:] = saved
        for name in DATA_CARRIED:
            getattr(data, name)[:] = next(arrays)
        self._running, self._end = snapshot.running and not self._closed, snapshot.end
        if snapshot.generator is None:
            self._np_random = None
        else:
            self.np_random.bit_generator.state = snapshot.generator
        self._np_random_seed = snapshot.seed

    def _check_snapshot(self, snapshot):
        """Refuse what is no Snapshot of an environment with these settings."""
        if not isinstance(snapshot, Snapshot):
            raise InputError(f"state = {type(snapshot).__name__}: must be what get_state() returned")
        if snapshot.kind != self._kind:
            raise InputError(
                "state: is of an environment with another plant, kind of weather, action mode, observation,"
                " duration or time step; must be of one with these settings"
            )

    def _nominal_in(self, scene):
        """Scene of the nominal plant in the weather of another scene, where anything is designed on it."""
        if self._nominal is None or (self._baseline is None and self._estimator is None):
            return self._nominal
        return self._nominal.with_weather(scene.wind, scene.sea, scene.seed)

    def _enter(self, scene, nominal):
        """Run in the scene's weather from now on, with new data: their size follows the wave components."""
        self.scene, self._nominal = scene, nominal
        self._episode = self._episode._replace(data=scene.data())
        self._config = self._config._replace(model=scene.model)
        if self._sensors is not None:
            self._config = self._config._replace(sensors=self._drawn(scene, self._config.per_control))
        if self._baseline is not None:
            self._baseline.prepare(known_scene(self.design_scene, self._baseline))
            ahead = self._foresee(scene, self._baseline.preview_times)
            given = Given(self._config.given.hidden, *ahead)
            self._config = self._config._replace(parameters=self._baseline.parameters, given=given)
        if self._estimator is not None:
            self._estimator.prepare(known_scene(self.design_scene, self._estimator))
            self._config = self._config._replace(estimator=self._estimator.parameters)
        self._handle = Handle(self._config, self._episode)

    def _drawn(self, scene, per_control):
        """Sensors of an episode in a scene's weather."""
        readings = self._last // per_control + 1
        scales = reading_scales(scene.turbine, self.individual)
        return draw_sensors(self._sensors, scales, self.control_dt, scene.seed, readings)

    @staticmethod
    def _foresee(scene, leads):
        """(time (k,), wind (leads, k)) of a scene as a controller of these leads (s) is given it."""
        return exact_preview(scene, leads)[:2] if leads else (np.zeros(0), np.zeros((0, 0)))

    def measurement(self, preview_times: Sequence[float] = ()) -> Measurement:
        """Measurement of all fields now (SI), as the sensors read them.

        Where every blade has a pitch of its own it has blades, a BladeMeasurement.
        preview_times: increasing, s; with them it has wind_preview, the rotor-averaged wind that far ahead.
        """
        if self._handle is None:
            raise ResetNeeded("call reset() first: nothing has been measured yet")
        reading = self._episode.reading.tolist()
        if not len(preview_times):
            return whole_view(reading) if self.individual else Measurement(*reading)
        time, values = self._foresee(self.scene, tuple(preview_times))
        return whole_view(reading, [float(np.interp(reading[0], time, row)) for row in values])

    def true_measurement(self) -> Measurement:
        """Measurement of all fields now (SI), of the true motions whatever the sensors show.

        Where every blade has a pitch of its own it has blades, a BladeMeasurement.
        """
        if self._handle is None:
            raise ResetNeeded("call reset() first: nothing has been measured yet")
        values = self._episode.measurement.tolist()
        return whole_view(values) if self.individual else Measurement(*values)

    @property
    def design_scene(self) -> Scene:
        """Scene that controllers may be designed on: the nominal plant, else the true one."""
        return self.scene if self._nominal is None else self._nominal

    def channels(self) -> dict[str, float]:
        """{OpenFAST channel: value in its unit} of the present instant; leaves the run as it is."""
        if self._handle is None:
            raise ResetNeeded("call reset() first: there is no state yet")
        run, scene = self._episode, self.scene
        data = scene.data()
        # what an evaluation at this instant has left
        for name in ("lines", "stages", "cache", "added_mass", "user", "blades"):
            getattr(data, name)[:] = getattr(run.data, name)
        row = np.empty(len(scene.channels))
        time = run.counts[STEP] * self.dt
        output(scene.handle(data), run.x, run.u, time, np.zeros_like(run.x), row)
        values = scene.values(row[None, :])[0].tolist()
        return dict(zip((channel.name for channel in scene.channels), values, strict=True))

    def render(self) -> np.ndarray | None:
        """Picture of the present instant, (height, width, 3) uint8; None in mode "human", which shows it.

        It has the last action and reward of the episode; render_size sets width and height.

        Without a render mode it warns, as Gymnasium's own environments do, and returns None.
        """
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() needs a render_mode: gymnasium.make(..., render_mode='rgb_array'),"
                " or 'rgb_array_list' or 'human'"
            )
            return None
        if self._closed:
            raise ClosedEnvironmentError(CLOSED)
        from fowt_env.visual.rendering import SIZE, Agent, View

        row = self.channels()
        if self._view is None:
            speed = self.metadata["render_fps"] * self.control_dt
            size = SIZE if self.render_size is None else tuple(self.render_size)
            self._view = View([self.scene], size=size, speed=speed)
        elif self._view.panels[0].scene is not self.scene:
            self._view.enter(self.scene)
        self._view.draw([row], Agent(tuple(self._episode.action.tolist()), self._reward))
        if self.render_mode == "rgb_array":
            return self._view.array()
        self._view.show(self.metadata["render_fps"])
        return None

    def close(self) -> None:
        """Close the window of render mode "human"; reset and step then raise ClosedEnvironmentError."""
        self._running, self._closed = False, True
        if self._view is not None:
            self._view.close()
            self._view = None
        super().close()


class Start(NamedTuple):
    """A new episode with all of it done that may be refused, so that it can be begun without fail."""

    episode: Episode
    scene: Scene
    nominal: Scene | None
    state: np.ndarray  # (n_state,) operating point with the offsets
    command: np.ndarray  # (2,)
    reference: Reference


@contextmanager
def kept_if_refused(envs):
    """Whatever is raised in the block puts the environments' random generators back as they were."""
    before = [
        (env._np_random, env._np_random_seed, env._np_random and env._np_random.bit_generator.state)
        for env in envs
    ]
    try:
        yield
    except BaseException:
        for env, (generator, seed, state) in zip(envs, before, strict=True):
            env._np_random, env._np_random_seed = generator, seed
            if generator is not None:
                generator.bit_generator.state = state
        raise


FowtEnv.__doc__ = f"{FowtEnv.__doc__}\n{task_tables(TASKS['above_rated'])}"


def _adapted(
    task: Task,
    rotor: Any,
    observation: Any,
    reward: Any,
    duration: Any,
    wind: Any,
    sea: Any,
    wind_preview: Any,
) -> Task:
    """The task with what the caller gave in place of its own."""
    given = {"rotor": rotor, "duration": duration, "wind": wind, "sea": sea, "wind_preview": wind_preview}
    changes = {name: value for name, value in given.items() if value is not None}
    if observation is not None:
        changes["observation"] = check_channels("observation", observation, default=task.observation)
    if reward is not None:
        changes["weights"] = task.weights | check_weights("reward", reward)
    return replace(task, **changes)


# settings of FowtEnv by name, those of build_scene apart
SETTINGS = tuple(name for name in inspect.signature(FowtEnv).parameters if name != "options")


def _turbine_of(platform, turbine):
    """Turbine of a platform, or the one given in its place; each a name, a path or a description."""
    if turbine is None:
        turbine = (platform if isinstance(platform, Platform) else read_platform(platform)).turbine
    return turbine if isinstance(turbine, Turbine) else read_turbine(turbine)


def _check_shown(names, chain):
    """Refuse observation channels that a chain (name, fields) of sensors does not show."""
    for name in names:
        if name in (*Measurement._fields, *BLADE_CHANNELS) and name not in chain[1]:
            raise InputError(
                f"observation: {name!r}: the sensor chain {chain[0]!r} does not have it; it has"
                f" {', '.join(chain[1])}"
            )


def named_baseline(name, turbine, control_dt):
    """Compiled controller of a name, as controllers.make takes it.

    Raises: InputError for unknown ones and those written in Python.
    """
    names = catalogue().CONTROLLERS
    if isinstance(name, str) and ":" not in name and name not in names:
        raise unknown("baseline", name, names)
    baseline = make(name, turbine, control_dt)
    if not isinstance(baseline, CompiledController):
        raise InputError(f"baseline = {name!r}: must be a compiled controller, such as 'pi' or 'gspi_oc3'")
    return baseline


def _nominal_parts(given):
    """{"platform", "turbine"} of what an environment is given as nominal_plant. Raises: InputError."""
    if not isinstance(given, Mapping) or "platform" not in given:
        raise InputError(f"nominal_plant = {given!r}: must be a dict with a platform, and a turbine or not")
    for key in given:
        if key not in ("platform", "turbine"):
            raise unknown("key of nominal_plant", key, ("platform", "turbine"))
    return {"turbine": None} | dict(given)


def _moved(scene, state, command, offsets):
    """(state, command) moved by {channel: offset in its unit}, the blade pitch within its drive's range.

    BldPitch1 stands for all blades, whose pitches are the same at an operating point.
    """
    x, u, drive = state.copy(), command.copy(), scene.turbine.pitch_drive
    for name, value in offsets.items():
        index, factor = INITIAL[name]
        x[index] += value * factor
    if abs(x[State.PLATFORM_PITCH]) >= 0.5 * pi:
        raise InputError(
            f"offsets['PtfmPitch'] = {offsets['PtfmPitch']:g}: leads to"
            f" {x[State.PLATFORM_PITCH] * DEG_PER_RAD:g} deg, must stay inside (-90, 90) deg"
        )
    x[list(scene.pitch_states)] = min(max(x[State.BLADE_PITCH], drive.minimum), drive.maximum)
    u[Command.BLADE_PITCH :] = x[State.BLADE_PITCH]
    rest_actuators(scene.model, x, u)
    return x, u


def _with_options(drawn, options, rng):
    """The drawn Episode with what reset's options give in place of it, ranges drawn with rng."""
    if not isinstance(options, Mapping | None):
        raise InputError(f"options = {short(options)}: must be a mapping of reset's options, or None")
    changes = {}
    for key, value in (options or {}).items():
        if key not in Episode._fields:
            raise unknown("option of reset", key, Episode._fields)
        if key == "offsets":
            value = draw_offsets(value, rng)
        if key == "wind":
            value = wind_of(value)
            if value is None:
                raise InputError("options['wind'] = None: an episode needs a wind (0.0 for still air)")
        if key == "sea":
            value = sea_of(value)
        changes[key] = value
    if "wind" in changes:
        changes.setdefault("exact_start", not varies(changes["wind"]))
    if any(varies(changes.get(key)) for key in ("wind", "sea")):
        wind = changes.get("wind", drawn.wind)
        sea = changes.get("sea", None if is_mixture(wind) else drawn.sea)
        changes["wind"], changes["sea"] = draw_weather("options", wind, sea, rng)
    return drawn._replace(**changes)
