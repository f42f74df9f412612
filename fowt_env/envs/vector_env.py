"""Steps many environments in one compiled call: Gymnasium's vector interface without a Python loop."""

import os
from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import gymnasium
import numba
import numpy as np
import numpy.typing as npt
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from fowt_env.descriptions.checks import short
from fowt_env.envs.env import CLOSED, FowtEnv
from fowt_env.envs.episode import N_COUNTS, RUNNING, SHOWN_COUNTS, STEP
from fowt_env.envs.episode_batch import act_all, act_all_parallel, thread_limit
from fowt_env.envs.external_baseline import ExternalBaseline
from fowt_env.envs.reset import kept_if_refused
from fowt_env.envs.snapshot import Snapshot
from fowt_env.errors import InputError, unknown
from fowt_env.plant.compile.handle import Handle

# attributes that a copy rebuilds: compiled ones, and arrays filled from those of the single environments
COMPILED = (
    "_baseline_law", "_estimator_law", "_observations", "_counts", "_terms", "_handles", "_listed",
)  # fmt: skip


class FowtVectorEnv(gymnasium.vector.VectorEnv):
    """Steps num_envs environments, each with separate weather, random generator and optional settings.

    num_envs         number of environments
    autoreset_mode   a gymnasium.vector.AutoresetMode, its value or its name ("next_step"): "NextStep" (as
                     Gymnasium's vector environments: the step after the end of an episode resets, ignores the
                     action and returns reward 0), "SameStep" (the step that ends an episode returns the
                     first observation of the next; infos["final_obs"] and infos["final_info"] hold the last
                     observation and info) or "Disabled" (the caller resets ended episodes with
                     reset(options={"reset_mask": mask}))
    threads          number of threads of the compiled call; None: as many as numba uses, at most num_envs
    per_env          settings of single environments: num_envs dicts that override the common settings. All
                     environments must have the same spaces and the same loads (one compiled type): wind,
                     sea, platform, turbine, task and reward may differ, rotor and options rarely.
                     Domain randomisation, with fowt_env.training.rl.randomisation.randomised:
                     gymnasium.make_vec(name, n, per_env=randomised({"plants": 8}, n, seed))
    max_episode_steps
                     largest number of steps of an episode, as gymnasium.make_vec passes; None: the duration
    settings         common settings of all environments, see FowtEnv

    One environment of the batch gives the same bits as a FowtEnv with its seed and its actions, whatever
    the number of threads. reset(seed=s) seeds the environments s, s + 1, ...; a list seeds each. Options of
    reset apply to every environment that is reset; a list of num_envs dicts has one entry for each.

    infos follow Gymnasium's SyncVectorEnv, except that infos["sampled"][i] is a dict: passed as options of
    reset, this dict replays the episode.

    envs holds the single environments; use call() to step one of them separately.

    A reward function is called in Python for one environment after the other, with an overhead of about
    5 microseconds per call. copy.deepcopy and pickle give an independent batch in the present state.

    An action that is not finite raises InputError before any environment is advanced.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        per_env: list[dict[str, Any]] | None = None,
        max_episode_steps: int | None = None,
        **settings: Any,
    ) -> None:
        self.num_envs = _count("num_envs", num_envs, 10**6)
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        if settings.get("render_mode") is not None:
            raise InputError(f"render_mode = {settings['render_mode']!r}: a vector environment cannot render")
        _shorten_spinning()
        most = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined] # set when numba starts
        self.threads = min(numba.get_num_threads(), num_envs) if threads is None else threads
        _count("threads", self.threads, most)
        self.envs = tuple(_environments(num_envs, per_env, settings))
        first = self.envs[0]
        if isinstance(first._baseline, ExternalBaseline):
            raise InputError(
                f"baseline = {first._baseline.name!r}: is not compiled: use gymnasium.vector.SyncVectorEnv"
            )
        self.render_mode = None
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._baseline_law, self._estimator_law = first._baseline_law, first._estimator_law
        self._share_rows()
        self._statuses = np.full(num_envs, RUNNING, dtype=np.int64)
        self._rewards = np.zeros(num_envs)
        self._info_keys = (*first.term_keys, "time")  # float64 entries of every step's infos
        self._info_masks = tuple(f"_{key}" for key in self._info_keys)
        self._last = np.array([env._last for env in self.envs])
        if max_episode_steps is not None:
            steps = _count("max_episode_steps", max_episode_steps, 10**9)
            self._last = np.minimum(self._last, [steps * env.physics_steps for env in self.envs])
        self._dt = np.array([env.dt for env in self.envs])
        self._ended = np.zeros(num_envs, dtype=bool)  # waiting for the reset of the next step
        self._protected = first.is_protected
        self._custom_rewards = [i for i, env in enumerate(self.envs) if env._custom_reward is not None]
        self._handles = None
        self._listed = [None] * num_envs  # handles in the compiled list, for comparison

    def __getstate__(self) -> dict[str, Any]:
        """Return the state of a copy: all attributes except compiled ones and shared arrays."""
        return {name: value for name, value in self.__dict__.items() if name not in COMPILED}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the batch from the state of a copy."""
        self.__dict__.update(state)
        first = self.envs[0]
        self._baseline_law, self._estimator_law = first._baseline_law, first._estimator_law
        filled = [(e._episode.observation, e._episode.counts, e._episode.terms) for e in self.envs]
        self._share_rows()
        self._handles, self._listed = None, [None] * self.num_envs
        for i, (observation, counts, terms) in enumerate(filled):
            self._observations[i], self._counts[i], self._terms[i] = observation, counts, terms
            env = self.envs[i]
            if env._handle is not None:
                env._handle = Handle(env._config, env._episode)
                if not self.closed:
                    self._renew(i)

    def _share_rows(self):
        """Replace observation, counts and terms of each environment by rows of common arrays."""
        n = self.num_envs
        self._observations = np.zeros((n, *self.single_observation_space.shape), dtype=np.float32)
        self._counts = np.zeros((n, N_COUNTS), dtype=np.int64)
        self._terms = np.zeros((n, len(self.envs[0].term_keys)))
        for i, env in enumerate(self.envs):
            env._episode = env._episode._replace(
                observation=self._observations[i], counts=self._counts[i], terms=self._terms[i]
            )

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | list[dict[str, Any]] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start new episodes in all environments or those in options["reset_mask"] (n,) bool.

        Returns (observations, infos). Raises: InputError as FowtEnv.reset, with all environments unchanged;
        ClosedEnvironmentError after close().
        """
        if self.closed:
            raise ClosedEnvironmentError(CLOSED)
        n = self.num_envs
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + i for i in range(n)]
        else:
            seeds = list(seed)
            if len(seeds) != n:
                raise InputError(f"seed has {len(seeds)} entries: must be a number or {n} of them")
        indices: Sequence[int] = range(n)
        if isinstance(options, list):
            if len(options) != n:
                raise InputError(f"options has {len(options)} entries: must be a dict or {n} of them")
        elif not isinstance(options, Mapping | None):
            raise InputError(f"options = {short(options)}: must be a mapping, a list of {n} of them, or None")
        else:
            options = dict(options or {})
            if "reset_mask" in options:
                indices = np.flatnonzero(self._mask(options.pop("reset_mask"))).tolist()
            options = [options] * n
        with kept_if_refused([self.envs[i] for i in indices]):
            planned = [self._plan(i, seeds[i], options[i]) for i in indices]
        infos: dict[str, Any] = {}
        for i, start in zip(indices, planned, strict=True):
            infos = self._begin(i, start, infos)
        return self._observations.copy(), infos

    def _plan(self, i, seed, options):
        """Draw the Start of a new episode of one environment. Raises: InputError naming the environment."""
        try:
            return self.envs[i]._plan(seed, options)
        except InputError as error:
            raise InputError(f"environment {i}: {error}") from None

    def _mask(self, mask):
        """Return the checked reset mask. Raises: InputError, ResetNeeded."""
        if not isinstance(mask, np.ndarray) or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise InputError(f"options['reset_mask']: must be a bool array of shape ({self.num_envs},)")
        if not mask.any():
            raise InputError("options['reset_mask']: must select at least one environment")
        if self._handles is None and not mask.all():
            raise ResetNeeded("call reset() of all environments first")
        return mask

    def _begin(self, i, start, infos):
        """Begin the planned episode of one environment; return the infos with the info of its reset added."""
        _, info = self.envs[i]._begin(start)
        self._ended[i] = False
        self._renew(i)
        sampled = info.pop("sampled")
        infos = self._add_info(infos, info, int(i))
        nothing = np.full(self.num_envs, None), np.zeros(self.num_envs, dtype=bool)
        for key, empty, value in zip(("sampled", "_sampled"), nothing, (sampled, True), strict=True):
            infos.setdefault(key, empty)[i] = value
        return infos

    def _renew(self, i):
        """Update the environment's handle in the compiled list if the handle has changed."""
        handle = self.envs[i]._handle
        if handle is self._listed[i]:
            return
        self._listed[i] = handle
        if self._handles is None:
            if any(listed is None for listed in self._listed):
                return
            self._handles = numba.typed.List(self._listed)
        else:
            self._handles[i] = handle

    def step(
        self, actions: npt.ArrayLike
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance all by one period; return (observations, rewards, terminations, truncations, infos)."""
        if self._handles is None:
            if self.closed:
                raise ClosedEnvironmentError(CLOSED)
            raise ResetNeeded("call reset() first: no episode is running")
        resets = self._ended.nonzero()[0]
        if len(resets) and self.autoreset_mode == AutoresetMode.DISABLED:
            i = int(resets[0])
            raise ResetNeeded(
                f"environment {i}: {self.envs[i]._end}: call reset(options={{'reset_mask': ...}})"
            )
        active = ~self._ended
        self._act(actions, active)
        statuses = self._statuses
        rewards = self._rewards.copy()
        if len(resets):
            statuses[resets] = RUNNING
            rewards[resets] = 0.0
        terminations = statuses != RUNNING
        truncations = self._counts[:, STEP] >= self._last
        truncations &= active & ~terminations
        ended = terminations | truncations
        infos = {}
        over = ended.any()
        for i in self._custom_rewards:
            if active[i]:
                rewards[i] = self.envs[i]._reward_of(self.last_info(i))
        if over:
            for i in np.flatnonzero(ended):
                self.envs[i]._finish(statuses[i])
            if self.autoreset_mode == AutoresetMode.SAME_STEP:
                infos = self._finals(ended)
                active &= ~ended
                resets = np.flatnonzero(ended)
                ended = np.zeros_like(ended)
        infos = self._infos(infos, active, terminations)
        if over:
            for i in (active & ended).nonzero()[0]:
                infos = self._add_info(infos, self.envs[i]._facts(), int(i))
        for i in resets:
            infos = self._begin(i, self._plan(i, None, None), infos)
        self._ended = ended
        return self._observations.copy(), rewards, terminations, truncations, infos

    def _act(self, actions, active):
        """Advance the active environments by one control period under checked actions."""
        shape = self.action_space.shape
        try:
            requested = np.array(actions, dtype=np.float64)  # a float64 copy for the kernel
        except (TypeError, ValueError):
            raise InputError(f"actions = {actions!r}: must be {shape} numbers") from None
        if requested.shape != shape:
            raise InputError(f"actions have shape {requested.shape}: must be {shape}")
        arguments = (
            self._handles, self._baseline_law, self._estimator_law, requested, active, self._statuses,
            self._rewards,
        )  # fmt: skip
        if self.threads == 1:
            bad = act_all(*arguments)
        else:
            with thread_limit(self.threads):
                bad = act_all_parallel(*arguments, self.threads)
        if bad >= 0:
            raise InputError(f"action of environment {bad} = {requested[bad].tolist()}: must be finite")
        if self.envs[0].is_protected:
            for env in self.envs:
                env.hand_over()

    def _infos(self, infos, shown, terminations):
        """Add the step infos of the shown environments to infos, in the format of _add_info."""
        if not shown.any():
            return infos
        columns = np.empty((len(self._info_keys), self.num_envs))
        columns[:-1] = self._terms.T
        np.multiply(self._counts[:, STEP], self._dt, out=columns[-1])
        counts = {key: self._counts[:, entry].copy() for key, entry in SHOWN_COUNTS.items()}
        if not shown.all():
            columns[:, ~shown] = 0.0
            for values in counts.values():
                values[~shown] = 0
        masks = np.empty(columns.shape, dtype=bool)
        masks[:] = shown  # separate rows, because a reset changes some of them
        infos.update(zip(self._info_keys, columns, strict=True))
        infos.update(zip(self._info_masks, masks, strict=True))
        if self._protected:
            counts["stopping"] = np.array([env.is_stopping for env in self.envs]) & shown
        for key, values in counts.items():
            infos[key], infos[f"_{key}"] = values, shown.copy()
        if terminations.any():
            for i in (shown & terminations).nonzero()[0]:
                reason = {"termination": self.envs[i]._reason(self._statuses[i])}
                infos = self._add_info(infos, reason, int(i))
        return infos

    def _finals(self, ended):
        """Return infos with the last observation and info of the ended environments."""
        infos = {}
        for i in np.flatnonzero(ended):
            final = {"final_obs": self._observations[i].copy(), "final_info": self.last_info(i)}
            infos = self._add_info(infos, final, int(i))
        return infos

    def last_info(self, i: int) -> dict[str, Any]:
        """Return the info of the last step of one environment, as FowtEnv.step returns it."""
        info = dict(zip(self.envs[i].term_keys, self._terms[i].tolist(), strict=True))
        info["time"] = float(self._counts[i, STEP] * self._dt[i])
        info |= {key: int(self._counts[i, entry]) for key, entry in SHOWN_COUNTS.items()}
        if self._protected:
            info["stopping"] = self.envs[i].is_stopping
        if self._statuses[i] != RUNNING:
            info["termination"] = self.envs[i]._reason(self._statuses[i])
        if self._statuses[i] != RUNNING or self._counts[i, STEP] >= self._last[i]:
            info |= self.envs[i]._facts()
        return info

    def get_state(self) -> tuple[Snapshot, ...]:
        """Return a tuple with the Snapshot of each environment."""
        return tuple(env.get_state() for env in self.envs)

    def set_state(self, snapshots: Snapshot | Sequence[Snapshot]) -> None:
        """Continue from one Snapshot per environment, or from a common Snapshot.

        An environment whose episode had ended at the Snapshot waits for a reset. Raises: InputError.
        """
        if isinstance(snapshots, Snapshot):
            snapshots = [snapshots] * self.num_envs
        if len(snapshots) != self.num_envs:
            raise InputError(f"state: {len(snapshots)} snapshots: must be one, or {self.num_envs}")
        for env, snapshot in zip(self.envs, snapshots, strict=True):
            env._check_snapshot(snapshot)
        for i, (env, snapshot) in enumerate(zip(self.envs, snapshots, strict=True)):
            env.set_state(snapshot)
            self._ended[i] = not snapshot.running
            self._renew(i)

    @property
    def observations(self) -> np.ndarray:
        """Return a copy of the present observations (num_envs, n)."""
        return self._observations.copy()

    @property
    def terms(self) -> np.ndarray:
        """Return a copy of the reward terms (num_envs, terms) of the last step, before weighting."""
        return self._terms.copy()

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environments; reset and step then raise ClosedEnvironmentError."""
        self._handles = None
        for env in self.envs:
            env.close()

    def call(
        self, name: str, *args: Any, indices: Sequence[int] | None = None, **kwargs: Any
    ) -> tuple[Any, ...]:
        """Return a tuple with an attribute, or its result when called, of all or selected environments."""
        results = []
        for i in range(self.num_envs) if indices is None else indices:
            attribute = self.envs[i].get_wrapper_attr(name)
            results.append(attribute(*args, **kwargs) if callable(attribute) else attribute)
            self._renew(i)
        return tuple(results)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return a tuple with an attribute of each environment."""
        return tuple(env.get_wrapper_attr(name) for env in self.envs)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override] # as SyncVectorEnv
        """Return a tuple with the random generator of each environment."""
        return self.get_attr("np_random")

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """Return a tuple with the seed of each environment's random generator."""
        return self.get_attr("np_random_seed")


def of_one(infos: dict[str, Any], i: int, but: Sequence[str] = ()) -> dict[str, Any]:
    """Return the info of environment i in the format of FowtEnv.step, from infos of a vector environment."""
    info = {}
    for key, values in infos.items():
        if key in but or f"_{key}" not in infos or not infos[f"_{key}"][i]:
            continue
        if isinstance(values, dict):
            info[key] = of_one(values, i)
        else:
            info[key] = values[i].item() if isinstance(values[i], np.generic) else values[i]
    return info


def _autoreset_mode(mode_or_name):
    """Return the AutoresetMode of a mode, its value or its name. Raises: InputError."""
    if isinstance(mode_or_name, AutoresetMode):
        return mode_or_name
    for mode in AutoresetMode:
        if isinstance(mode_or_name, str) and mode.value.lower() == mode_or_name.lower().replace("_", ""):
            return mode
    raise unknown("autoreset_mode", mode_or_name, [mode.value for mode in AutoresetMode])


def _count(name, value, most):
    """Return value as an int in [1, most]. Raises: InputError."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 1 <= value <= most:
        raise InputError(f"{name} = {value!r}: must be a whole number from 1 to {most}")
    return int(value)


def _environments(num_envs, per_env, settings):
    """Return the list of environments; those with equal settings share constant parts.

    Raises: InputError unless all have the same spaces and compiled type.
    """
    if per_env is None:
        per_env = [{}] * num_envs
    if isinstance(per_env, dict) or len(per_env) != num_envs:
        raise InputError(f"per_env: must be a list of {num_envs} dicts of settings")
    built, envs = [], []
    for i, changes in enumerate(per_env):
        same = next((env for one, env in built if one is changes or _equal(one, changes)), None)
        if same is not None:
            envs.append(same.twin())
            continue
        env = FowtEnv(**deepcopy(settings | changes) if changes else settings)
        if envs:
            _check_alike(i, env, envs[0])
        built.append((changes, env))
        envs.append(env)
    return envs


def _equal(one, other):
    """Return whether two dicts of settings are equal; False if they contain arrays."""
    try:
        return bool(one == other)
    except ValueError:
        return False


def _check_alike(i, env, first):
    """Raise InputError unless one compiled loop can step both environments."""
    if env.observation_space != first.observation_space:
        raise InputError(
            f"per_env[{i}]: the observation space differs from that of per_env[0]; all must be equal"
        )
    if env.action_mode != first.action_mode:
        raise InputError(f"per_env[{i}]: action_mode = {env.action_mode!r}: must be {first.action_mode!r}")
    if numba.config.DISABLE_JIT:
        return
    kinds = [numba.typeof(Handle(e._config, e._episode)) for e in (first, env)]
    if kinds[0] == kinds[1]:
        return
    models = [e.scene.model._asdict() | e._config.interface._asdict() for e in (first, env)]
    parts = [n for n in models[0] if numba.typeof(models[0][n]) != numba.typeof(models[1][n])]
    raise InputError(
        f"per_env[{i}]: differs from per_env[0] in the compiled types of {', '.join(parts)}; must be equal"
    )


def _shorten_spinning():
    """Limit the spinning of idle threads unless OMP_WAIT_POLICY is set; call before numba starts threads.

    GNU OpenMP, which runs the threads on Linux, lets an idle thread spin for milliseconds: fastest on an
    idle machine, very slow alongside other programs (performance.md). 3000 iterations take about 50
    microseconds, longer than the time between two steps.
    """
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", "3000")
