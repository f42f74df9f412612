"""Trains agents: settings from one YAML file per algorithm, resumable checkpoints, validation.

    from fowt_env.training.rl.train import Training, resolve
    Training(resolve("ppo", "above_rated", seed=0, steps=2_000_000), "runs/ppo_0").run()

A run folder contains settings.yml and versions.json; checkpoints/step_N (model, normalisation, environments,
replay buffer, random states); validation.csv with a row per validation; best.npz, the policy with the best
validation score, and last.npz; curve.csv with returns and reward terms of the training; learning_curve.png;
and TensorBoard files.

A resumed run is bit-identical to an uninterrupted run on the same machine with the same number of torch
threads: checkpoints contain parameters, optimiser, environments in mid-episode, normalisation, replay buffer
and the states of all random generators.
"""

import errno
import json
import os
import pickle
import random
import shutil
import signal
import sys
from collections import deque
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.descriptions.platform import turbine_of
from fowt_env.descriptions.sea_state import joint_sea_state
from fowt_env.envs.observations import BLADE_CHANNELS, N_ACTIONS
from fowt_env.envs.tasks import SITE, task_of
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import process_lives, remove_leftovers, replacing
from fowt_env.registration import LADDER
from fowt_env.training.evaluation.locks import locked
from fowt_env.training.evaluation.seeds import TRAINING, seeds_for
from fowt_env.training.rl.checkpoint_signature import is_own, seal
from fowt_env.training.rl.settings import (
    REFERENCE,
    SCHEDULES,
    TASK_FIELDS,
    check_algorithm,
    check_settings,
    read_settings,
)

SETTINGS_FOLDER = Path(__file__).parent  # contains the YAML file of each algorithm
ZOO = SETTINGS_FOLDER / "zoo"  # the same for the ladder's names, in the format of rl-baselines3-zoo
NAMESPACE = "fowt_env/"
ALGORITHMS = ("ppo", "sac", "tqc")
# standard sensors of a turbine: drivetrain, blade pitch, motion of nacelle and platform
MEASURED = (
    "rotor_speed", "blade_pitch", "generator_torque", "platform_pitch", "platform_pitch_rate",
    "nacelle_acceleration", "previous_action",
)  # fmt: skip
# estimates of lqr's observer from these sensors: wind, surge and waves
ESTIMATED = ("estimated_wind", "estimated_platform", "estimated_waves")
AHEAD = ("wind_speed", "wind_preview")
OBSERVATIONS = {  # information sets for comparing agents
    "measured": MEASURED,
    "state": ("default", "nacelle_acceleration", "previous_action"),  # all motions and rates of the platform
    "preview": (*MEASURED, *AHEAD),
    "blade": ("rotor_speed", "blade_pitch", "previous_action"),
    "estimate": (*MEASURED, *ESTIMATED),
    "estimate_preview": (*MEASURED, *ESTIMATED, *AHEAD),
}
SECTIONS = ("environment", "decisions", "algorithm", "normalise", "validation", "checkpoint_minutes", "task")
VERSIONS = ("fowt-env", "stable-baselines3", "sb3-contrib", "torch", "numpy", "numba", "gymnasium")
MONITORED = ("episode_returns", "episode_lengths", "episode_count")  # attributes of VecMonitor
MOTIONS = ("rotor_speed_std_[rpm]", "platform_pitch_std_[deg]")
RATIOS = (
    *MOTIONS, "blade_pitch_travel_[deg/s]", "torque_travel_[kN-m/s]", "shaft_torque_DEL_[kN-m]",
    "capped_power_mean_[kW]", "shaft_power_std_[kW]",
)  # fmt: skip
# costs that the validation score adds to the mean ratio of the motions
FAILURE_COST = 10.0  # times the fraction of failed episodes
TRAVEL_COST = 2.0  # per unit of blade-pitch travel above the reference's
TORQUE_COST = 1.0  # per unit of torque travel, and of shaft-torque DEL, above the reference's
POWER_COST = 20.0  # per unit of mean power up to rated below LEAST_POWER
LEAST_POWER = 0.999  # fraction of the reference's mean power
UNREST_COST = 0.5  # times the fraction of episodes of steady wind that did not come to rest
GUST_COST = 2.0  # per unit by which the worse motion ratio in gusts exceeds 1
LARGEST_OFFSET = 0.5  # % of rated rotor speed: limit for rest in steady wind
LARGEST_SWING = 0.05  # deg of blade pitch, peak to peak: limit for rest
STEADY_KICK = {"PtfmPitch": 0.5}  # deg, initial offset in steady wind, as in the suite settling
GUST_START = 120.0  # s


def resolve(algo, task, seed, steps, changes=None):
    """Return all settings of a run (dict): those of training/rl/ALGO.yml for the task, with changes.

    task: also a name of the ladder without namespace, "OC3HywindEasy-v0", with the settings of zoo/ALGO.yml.

    changes: {dotted key: value}, such as {"environment.action_mode": "direct"}.
    Raises: InputError for unknown names and keys, and numbers out of range.
    """
    import yaml

    if algo not in ALGORITHMS:
        raise unknown("algorithm", algo, ALGORITHMS)
    with (SETTINGS_FOLDER / f"{algo}.yml").open(encoding="utf-8") as file:
        table = yaml.safe_load(file)
    with (ZOO / f"{algo}.yml").open(encoding="utf-8") as file:
        zoo = yaml.safe_load(file)
    tasks = [name for name in table if not name.startswith("_")]
    ladder = [name.removeprefix(NAMESPACE) for name in zoo]
    if task not in tasks + ladder:
        raise unknown(f"task of training/rl/{algo}.yml and training/rl/zoo/{algo}.yml", task, tasks + ladder)
    check_whole_number("seed", seed, 0)
    check_whole_number("steps", steps, 1)
    settings = deepcopy(table[task]) if task in tasks else of_ladder(task, zoo[NAMESPACE + task])
    for key, value in (changes or {}).items():
        *sections, last = key.split(".")
        if (sections or [last])[0] not in SECTIONS:
            raise unknown("setting", key, (f"{section}.*" for section in SECTIONS))
        section_settings = settings
        for section in sections:
            section_settings = section_settings.setdefault(section, {})
            if not isinstance(section_settings, dict):
                raise InputError(f"setting {key!r}: {section!r} has no further settings")
        section_settings[last] = value
    return check_settings({"algo": algo, "name": task, "seed": seed, "steps": steps} | settings)


def of_ladder(name, entry):
    """Return the settings of a run on a name of the ladder (fowt_env/registration.py).

    entry: that of the name in a file of rl-baselines3-zoo; the environment is that of the registered name.
    """
    environment = json.loads(json.dumps(LADDER[NAMESPACE + name]))  # lists, as in a file
    entry = {key: value for key, value in entry.items() if key not in ("n_timesteps", "policy")}
    normalise = entry.pop("normalize", False)
    return {
        "task": environment.pop("task"),
        "decisions": environment.pop("decisions"),
        "environment": environment | {"num_envs": entry.pop("n_envs", 1)},
        "algorithm": entry,
        "normalise": {"norm_obs": normalise, "norm_reward": normalise},
        "validation": {"winds": [12, 14, 16, 18, 20, 22, 24], "first": 100, "seeds": 1},
        "checkpoint_minutes": 5.0,
    }


def environment_settings(settings):
    """Return the FowtEnv settings of a run: task with action ranges and weather seeds, inputs, decisions."""
    section = {k: v for k, v in settings["environment"].items() if k not in ("num_envs", "randomise")}
    task = task_of(settings["task"], turbine_of(section["platform"]) if "platform" in section else None)
    reach = {name: section.pop(name) for name in TASK_FIELDS if name in section}
    reach = {name: tuple(value) if isinstance(value, list) else value for name, value in reach.items()}
    task = replace(task, weather_seeds=(TRAINING.start, TRAINING.stop), **reach)
    chosen = section.pop("observation", "measured")
    if isinstance(chosen, str):
        if chosen not in OBSERVATIONS:
            raise unknown("observation set", chosen, OBSERVATIONS)
        chosen = OBSERVATIONS[chosen]
    return {"task": task, "observation": chosen, "decisions": settings["decisions"]} | section


def make_algorithm(name):
    """Return the class of an algorithm. Raises: InputError if the library is missing."""
    try:
        if name == "tqc":
            from sb3_contrib import TQC

            return TQC
        import stable_baselines3

        return getattr(stable_baselines3, name.upper())
    except ImportError as error:
        raise InputError(f"training with {name} needs pip install 'fowt-env[train]' ({error})") from error


def versions():
    """Return {package: version} of the packages that affect results, and the number of processors."""
    installed = {"python": sys.version.split()[0], "processors": os.cpu_count()}
    for name in VERSIONS:
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            installed[name] = None
    return installed


def validation_episodes(settings):
    """Return (reset options, kinds) of the validation episodes of resolved settings, two lists.

    turbulent: each wind with each of its validation seeds; steady: still water, from STEADY_KICK; gust: one
    EOG and one EDC for each wind.
    """
    chosen = settings["validation"]
    seeds = seeds_for("validation", int(chosen["first"]), int(chosen["seeds"]))
    episodes, kinds = [], []

    def add(kind, wind, seed, **more):
        state = None if kind == "steady" else joint_sea_state(SITE, wind["speed"])
        sea = None if state is None else {"kind": "jonswap", "Hs": state.Hs, "Tp": state.Tp}
        episodes.append({"wind": wind, "sea": sea, "weather_seed": seed} | more)
        kinds.append(kind)

    for speed in map(float, chosen["winds"]):
        wind = {"kind": "ntm", "speed": speed, "class": "B", "sigma": chosen.get("sigma", "90%")}
        for seed in seeds:
            add("turbulent", wind, seed)
    for speed in map(float, chosen.get("steady", ())):
        add("steady", {"kind": "steady", "speed": speed}, seeds[0], offsets=STEADY_KICK)
    for speed in map(float, chosen.get("gusts", ())):
        for kind in ("eog", "edc"):
            add("gust", {"kind": kind, "speed": speed, "start": GUST_START}, seeds[0])
    return episodes, kinds


def _check_collective(single):
    """Raise InputError for a FowtEnv whose agent commands or observes single blades: files cannot hold it."""
    of_blades = [entry.name for entry in single.observed if entry.name in BLADE_CHANNELS]
    if single.action_space.shape != (N_ACTIONS,) or of_blades:
        seen = ", ".join(of_blades) or "no individual blades"
        raise InputError(
            f"environment: action_mode = {single.action_mode!r}, observation of {seen}: agents are trained"
            " only with collective pitch; use FowtEnv directly"
        )


def make_envs(settings):
    """Return (training VecNormalize, validation VecNormalize); plants are randomised for training only."""
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    from fowt_env.training.rl.randomisation import randomised
    from fowt_env.training.rl.sb3_env import FowtSB3VecEnv

    chosen = environment_settings(settings)
    normalise = {"gamma": settings["algorithm"].get("gamma", 0.99)} | settings["normalise"]
    n = settings["environment"].get("num_envs", 1)
    plants = settings["environment"].get("randomise")
    per_env = None if not plants else randomised(plants, n, settings["seed"])
    base = FowtSB3VecEnv(n, threads=1, per_env=per_env, **chosen)
    _check_collective(base.env.envs[0])
    env, validation = (
        VecNormalize(VecMonitor(inner), **normalise) for inner in (base, validation_env(settings, chosen))
    )
    validation.training = validation.norm_reward = False
    return env, validation


def validation_env(settings, chosen):
    """Return the ValidationVecEnv of resolved settings: FowtEnvs with settings `chosen` and nominal plant.

    The validation sensors of the settings alternate over the episodes of each wind.
    """
    from fowt_env.training.rl.validation_env import ValidationVecEnv

    validation = settings["validation"]
    episodes, kinds = validation_episodes(settings)
    sensors, per_env = validation.get("sensors"), None
    if sensors:
        exact = {"noise": 0.0, "delay": 0}
        per_env = [
            {"sensors": exact if kind == "steady" else sensors[i % validation["seeds"] % len(sensors)]}
            for i, kind in enumerate(kinds)
        ]
    return ValidationVecEnv(episodes, validation.get("skip", 60.0), threads=1, per_env=per_env, **chosen)


def inner_env(env):
    """Return the FowtSB3VecEnv inside the wrappers of env."""
    while hasattr(env, "venv"):
        env = env.venv
    return env


def baseline_figures(settings, reference=None):
    """Return {metric: (n,)} of a compiled controller on the validation episodes of resolved settings.

    reference: name of the controller; None: that of the settings. The controller runs in the agent's
    environment, not in evaluation.evaluate, to have the same weather, start, sensors and control periods.
    """
    reference = reference or settings["validation"].get("reference", REFERENCE)
    chosen = environment_settings(settings) | {"action_mode": "residual", "baseline": reference}
    env = validation_env(settings, chosen)
    env.reset()
    nothing = np.zeros((env.num_envs, 2))
    while not env.over:
        env.step(nothing)
    return env.figures()


def validation_score(figures, reference, kinds=None):
    """Return {ratio, check or score: number} of metrics relative to the reference's; lower is better.

    kinds: of the episodes, as from validation_episodes; None: all turbulent. Ratios are means over turbulent
    episodes; for torque travel the ratio of the means, as a reference may hold its torque in some. score:
    mean ratio of rotor-speed and platform-pitch standard deviation, plus costs of more travel, torque travel
    and shaft load or less power than the reference's, of failures, of unrest in steady wind and of larger
    motions in gusts.
    """
    kinds = np.array(["turbulent"] * len(figures["failed"]) if kinds is None else kinds)
    turbulent, steady, gust = (kinds == kind for kind in ("turbulent", "steady", "gust"))
    ratios = {name: _mean(figures[name][turbulent] / reference[name][turbulent]) for name in RATIOS}
    moved = "torque_travel_[kN-m/s]"
    ratios[moved] = _mean(figures[moved][turbulent]) / _mean(reference[moved][turbulent])
    speed, platform, travel, torque, shaft, power, _ = ratios.values()
    failed = float(figures["failed"].mean())
    offset, swing = figures["rotor_speed_offset_[%]"][steady], figures["blade_pitch_swing_[deg]"][steady]
    at_rest = (offset <= LARGEST_OFFSET) & (swing <= LARGEST_SWING)
    unrest = _mean(~at_rest) if steady.any() else 0.0
    in_gusts = [_mean(figures[name][gust] / reference[name][gust]) for name in MOTIONS]
    gusts = max(in_gusts) if gust.any() else 1.0
    row = {f"{name.split('_[')[0]}_ratio": ratio for name, ratio in ratios.items()}
    row |= {"unrest": unrest, "gust_ratio": gusts, "failed": failed}
    excess = np.maximum([travel - 1.0, torque - 1.0, shaft - 1.0, LEAST_POWER - power, gusts - 1.0], 0.0)
    score = 0.5 * (speed + platform) + FAILURE_COST * failed + UNREST_COST * unrest
    score += float(excess @ [TRAVEL_COST, TORQUE_COST, TORQUE_COST, POWER_COST, GUST_COST])
    return row | {"score": score if np.isfinite(score) else float("inf")}


def _mean(values):
    """Return the mean of the finite values (failed episodes are NaN); NaN without any."""
    values = np.asarray(values, dtype=np.float64)
    kept = values[np.isfinite(values)]
    return float(kept.mean()) if len(kept) else float("nan")


class Training:
    """Runs one training in one folder. resume: continue from the newest checkpoint, if any.

    Loading a checkpoint executes code from it: one that this user's runs did not write is refused unless
    trusted. Raises: InputError if the folder contains another run, no run to resume or an untrusted
    checkpoint; on run(), if another training is writing to the folder.
    """

    def __init__(self, settings, folder, resume=False, trusted=False):
        self.folder = Path(folder)
        self.checkpoints, self.settings_path = self.folder / "checkpoints", self.folder / "settings.yml"
        self.resume, self.trusted = resume, trusted
        self._check_folder()
        self.settings = settings
        if resume:
            stored = read_settings(self.settings_path)
            self.settings = stored if settings is None else stored | {"steps": settings["steps"]}
        self.stop, self.rows, self.curve = False, [], []

    def _check_folder(self):
        """Raise InputError unless the run can start or continue in the folder."""
        if self.resume != self.settings_path.exists():
            raise InputError(
                f"--resume: {self.folder} contains no run"
                if self.resume
                else f"{self.folder} already contains a run: use --resume to continue it, or another --out"
            )
        newest = self.newest() if self.resume else None
        if newest is not None and not self.trusted and not is_own(newest):
            raise InputError(
                f"--resume: loading {newest} executes code from it, and it is not signed by this user;"
                " add --trust-zip if you trust its origin"
            )

    def newest(self):
        """Return the folder of the newest checkpoint of the run, or None."""
        folders = [p for p in self.checkpoints.glob("step_*") if p.name.removeprefix("step_").isdigit()]
        return max(folders, key=lambda p: int(p.name.removeprefix("step_")), default=None)

    def run(self, report=None):
        """Train until the end or an interrupt; return whether the end was reached.

        report(done, total, text): called about once a second.
        Raises: InputError if another training is writing to the folder, or the settings cannot be used.
        """
        name, busy = f"run folder {str(self.folder)!r}", "another training is writing to it"
        with locked(self.folder, name, busy):  # before anything is built, which may take minutes
            self._check_folder()  # again, now that the folder is locked
            if not self.resume:
                self._write_settings()  # mark the folder as a run's
            try:
                validation, state = self._build()
            except BaseException:
                if not self.resume:  # the run never started: leave the folder free for other settings
                    self.settings_path.unlink(missing_ok=True)
                raise
            if self.resume:
                self._write_settings()  # the number of steps may have changed
            with replacing(self.folder / "versions.json") as path:
                path.write_text(json.dumps(versions(), indent=1), encoding="utf-8")
            return self._learn(validation, state, report)

    def _build(self):
        """Set model and env; return (validation environment, stored state of a resumed run or None)."""
        import torch
        from stable_baselines3.common.utils import set_random_seed

        settings = self.settings
        torch.set_num_threads(int(os.environ.get("FOWT_TORCH_THREADS", "1")))
        kind = make_algorithm(settings["algo"])
        check_algorithm(kind, settings["algo"], settings["algorithm"])
        self.env, validation = make_envs(settings)
        self._remove_leftovers()
        set_random_seed(settings["seed"])
        state = None
        if self.resume and self.newest() is not None:
            self.model, state = self._load(kind, self.env)
        else:
            self.env.seed(settings["seed"])
            self.model = new_model(kind, settings, self.env)
        return validation, state

    def _learn(self, validation, state, report):
        """Train the rest of the run; return whether the end was reached."""
        from stable_baselines3.common.logger import configure

        from fowt_env.training.rl.callbacks import CheckpointCallback, Curve, Stopped, Validation

        model, steps = self.model, self.settings["steps"]
        self.reference_name = self.settings["validation"].get("reference", REFERENCE)
        if report is not None:
            report(model.num_timesteps, steps, f"scoring the reference {self.reference_name}")
        self.reference = baseline_figures(self.settings)
        self.kinds = validation_episodes(self.settings)[1]
        model.set_logger(configure(str(self.folder / "tensorboard"), ["tensorboard"]))
        self.evaluation, self.checkpointing = Validation(self, validation), CheckpointCallback(self, report)
        if state is not None:
            self.evaluation.n_calls, self.evaluation.best = state["evaluation_calls"], state["best"]
            self.checkpointing.before, self.checkpointing.torch_state = state["seconds"], state["torch"]
        finished, left = True, steps - model.num_timesteps
        with self._signals():
            if left > 0:
                try:
                    listeners = [self.evaluation, Curve(self), self.checkpointing]
                    model.learn(left, callback=listeners, reset_num_timesteps=state is None)
                except Stopped:
                    finished = False
                if finished and (not self.rows or self.rows[-1]["decisions"] != model.num_timesteps):
                    self.evaluation.now()
        if finished:
            self.save()
        self.export("last.npz")
        self.plot()
        return finished

    @contextmanager
    def _signals(self):
        """Set self.stop on the first interrupt or termination signal in the block: checkpoint, then end."""

        def ask(number, frame):
            if self.stop:
                raise KeyboardInterrupt
            self.stop = True

        before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _remove_leftovers(self):
        """Remove partly written files of killed processes."""
        remove_leftovers(self.folder)
        for path in self.checkpoints.glob(".writing_*"):
            number = path.name.removeprefix(".writing_")
            if not (number.isdigit() and process_lives(int(number))):
                shutil.rmtree(path, ignore_errors=True)

    def _write_settings(self):
        import yaml

        with replacing(self.settings_path) as path:
            path.write_text(yaml.safe_dump(self.settings, sort_keys=False), encoding="utf-8")

    def save(self):
        """Write a checkpoint atomically, replacing the previous checkpoint.

        Raises: OSError naming the checkpoint if it cannot be written; the previous checkpoint remains.
        """
        target = self.checkpoints / f"step_{self.model.num_timesteps}"
        if target.exists():
            return
        temporary = self.checkpoints / f".writing_{os.getpid()}"
        shutil.rmtree(temporary, ignore_errors=True)
        try:
            temporary.mkdir(parents=True)
            self._fill(temporary)
        except (OSError, RuntimeError) as error:  # RuntimeError: torch raises it for a full disk
            shutil.rmtree(temporary, ignore_errors=True)
            number = getattr(error, "errno", None) or errno.EIO
            raise OSError(number, f"the checkpoint cannot be written: {error}", str(target)) from error
        os.replace(temporary, target)
        for old in self.checkpoints.glob("step_*"):
            if old != target:
                shutil.rmtree(old, ignore_errors=True)

    def _fill(self, folder):
        """Write the files of a checkpoint into the folder and sign them."""
        import torch

        model, env = self.model, self.env
        model.save(folder / "model.zip")
        env.save(str(folder / "normalisation.pkl"))
        if hasattr(model, "replay_buffer"):
            model.save_replay_buffer(folder / "replay_buffer.pkl")
        monitor = env.venv
        state = {
            "environments": inner_env(env).get_state(),
            "monitor": [deepcopy(getattr(monitor, name)) for name in MONITORED],
            "returns": env.returns.copy(),
            "original": (deepcopy(env.old_obs), deepcopy(env.old_reward)),
            "random": random.getstate(),
            "numpy": np.random.get_state(),
            "torch": torch.get_rng_state(),
            "action_space": model.action_space.np_random.bit_generator.state,
            "evaluation_calls": self.evaluation.n_calls,
            "best": self.evaluation.best,
            "rows": self.rows,
            "curve": self.curve,
            "seconds": self.checkpointing.seconds(),
            "episodes": list(model.ep_info_buffer),
        }
        with (folder / "state.pkl").open("wb") as file:
            pickle.dump(state, file)
        seal(folder)

    def _load(self, kind, env):
        """Return (model, state) of the newest checkpoint, with environments and generators restored."""
        from stable_baselines3.common.vec_env import VecNormalize

        folder = self.newest()
        with (folder / "state.pkl").open("rb") as file:
            state = pickle.load(file)
        stored = VecNormalize.load(str(folder / "normalisation.pkl"), env.venv)
        for name in ("obs_rms", "ret_rms") if stored.norm_obs else ("ret_rms",):
            setattr(env, name, getattr(stored, name))
        env.venv.reset()
        inner_env(env).set_state(state["environments"])
        monitor = env.venv
        for name, value in zip(MONITORED, state["monitor"], strict=True):
            setattr(monitor, name, value)
        env.returns = state["returns"]
        env.old_obs, env.old_reward = state["original"]
        objects = _schedules(self.settings)
        model = kind.load(
            folder / "model.zip", env=env, device="cpu", force_reset=False, custom_objects=objects
        )
        if hasattr(model, "replay_buffer"):
            model.load_replay_buffer(folder / "replay_buffer.pkl")
        model.ep_info_buffer = deque(state["episodes"], maxlen=100)
        model.action_space.np_random.bit_generator.state = state["action_space"]
        random.setstate(state["random"])
        np.random.set_state(state["numpy"])
        self.rows, self.curve = state["rows"], state["curve"]
        return model, state

    def best(self):
        """Return the row of the validation with the lowest score; None before the first validation."""
        return min(self.rows, key=lambda row: row["score"], default=None)

    def export(self, name):
        """Write the current policy as a plain array file in the run folder; return the path."""
        from fowt_env.training.rl.export import export_policy

        about = {key: self.settings[key] for key in ("algo", "name", "seed")}
        about["steps"] = int(self.model.num_timesteps)
        single = inner_env(self.env).env.envs[0]
        return export_policy(self.model, single, self.folder / name, about, self.env)

    def plot(self):
        """Plot the learning curve; return the path, or None before the first validation."""
        from fowt_env.training.rl.learning_curve import plot_learning_curve

        if not self.rows:
            return None
        path = self.folder / "learning_curve.png"
        return plot_learning_curve(self.folder.name, self.rows, self.curve, path)


def _schedules(settings):
    """Return {setting: LinearSchedule} of the settings in SCHEDULES that fall linearly over a run."""
    from stable_baselines3.common.utils import LinearSchedule

    values = {key: settings["algorithm"].get(key) for key in SCHEDULES}
    pairs = {key: map(float, pair) for key, pair in values.items() if isinstance(pair, list)}
    return {key: LinearSchedule(*pair, 1.0) for key, pair in pairs.items()}


def new_model(kind, settings, env, device="cpu"):
    """Return an untrained model. Raises: InputError for settings that the algorithm does not accept."""
    import torch

    arguments = dict(settings["algorithm"]) | _schedules(settings)
    policy = dict(arguments.pop("policy_kwargs", {}))
    if "activation" in policy:
        policy["activation_fn"] = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}[policy.pop("activation")]
    try:
        return kind("MlpPolicy", env, policy_kwargs=policy, seed=settings["seed"], device=device, **arguments)
    except (AssertionError, TypeError, ValueError) as error:
        raise InputError(f"algorithm: {settings['algo']} does not accept these settings: {error}") from error
