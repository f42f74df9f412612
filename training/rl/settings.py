"""Checks the settings of a training run, from files and changes, before anything is built."""

import inspect
from dataclasses import fields
from typing import Annotated, Any, Literal, get_args

from pydantic import Field

from fowt_env.controllers.policy.network_file import ACTIVATIONS
from fowt_env.controllers.registry import CONTROLLERS
from fowt_env.descriptions.checks import check_one_of, check_whole_number, is_number, is_whole, refusal
from fowt_env.descriptions.files import raise_problems, read_text
from fowt_env.descriptions.records import (
    Fraction,
    NonNegative,
    Positive,
    Record,
    unknown_key,
    validate,
)
from fowt_env.descriptions.wind import NTM_SIGMAS
from fowt_env.envs.decisions import DecisionSettings
from fowt_env.envs.settings import KEYWORDS
from fowt_env.errors import InputError
from fowt_env.scene.options import OPTIONS

PositiveInteger = Annotated[int, Field(ge=1, strict=True)]
Whole = Annotated[int, Field(ge=0, strict=True)]
Switch = Annotated[bool, Field(strict=True)]
TASK_FIELDS = ("residual_pitch", "residual_torque", "blade_pitch", "setpoint")
OF_TRAINING = ("num_envs", "randomise", *TASK_FIELDS)  # keys of environment in addition to those of FowtEnv
FORMS = (  # compound settings of the environment: key, types, description
    ("reward", (dict, str), "a table of weights, or score"),
    ("randomise", dict, "a table"),
    ("observation", (str, list), "the name of an observation set, or a list of channels"),
)
SIMPLE = (  # further settings of the environment: key, default, check, allowed values
    ("num_envs", 1, check_whole_number, 1),
    ("baseline", "pi", check_one_of, CONTROLLERS),  # no import path: it would run code named in the file
)
SCHEDULES = ("learning_rate", "clip_range")  # settings of an algorithm that may fall linearly over a run
GIVEN_BY_TRAINING = (  # arguments of stable-baselines3's algorithms that Training sets
    "self", "policy", "env", "seed", "device", "tensorboard_log", "verbose", "_init_setup_model",
)  # fmt: skip
OBJECTS = ("action_noise", "rollout_buffer_class", "replay_buffer_class")  # not settable from a file
NOT_SET_THERE = ("task", "render_mode")  # arguments of FowtEnv that Training sets or does not use


class Normalise(Record):
    """Holds the arguments of stable-baselines3's VecNormalize, with defaults."""

    norm_obs: Switch = True
    norm_reward: Switch = True
    clip_obs: Positive = 10.0
    clip_reward: Positive = 10.0
    gamma: Fraction = 0.99
    epsilon: Positive = 1e-8


REFERENCE = "lqr"  # default reference controller of the validation


class Validation(Record):
    """Defines the episodes on which an agent is validated during training."""

    winds: Annotated[list[Positive], Field(min_length=1)]  # m/s
    first: Whole
    seeds: PositiveInteger
    every: PositiveInteger | None = None  # decisions, at most a quarter of the run; None: a quarter
    skip: NonNegative = 60.0  # s
    reference: Literal[tuple(CONTROLLERS)] = REFERENCE  # metrics are ratios to this controller's
    sigma: Literal[NTM_SIGMAS] = "90%"  # turbulence level, as for the ntm wind
    steady: list[Positive] = []  # m/s, steady winds in which the turbine must come to rest in still water
    gusts: list[Positive] = []  # m/s, mean winds of one gust (EOG) and one direction change (EDC) each
    # sensors of FowtEnv, alternating over the seeds of each wind; none, or steady wind: exact readings
    sensors: list[dict[str, Any] | str] = []


class TrainingSettings(Record):
    """Holds the settings of a run; environment, decisions and algorithm are checked separately."""

    algo: Literal["ppo", "sac", "tqc"]
    name: str  # key of the settings in training/rl/ALGO.yml
    seed: Whole
    steps: PositiveInteger
    task: str  # task of the environment
    environment: dict[str, Any]
    decisions: dict[str, Any]
    normalise: Normalise
    algorithm: dict[str, Any]
    validation: Validation
    checkpoint_minutes: NonNegative


def check_settings(settings, where="settings"):
    """Check and return the settings of a run. Raises: InputError naming each invalid key."""
    if not isinstance(settings, dict):
        raise InputError(f"{where}: must be a table of settings")
    raise_problems(where, validate(TrainingSettings, settings)[1])
    settable = [name for name in ("task", "platform", *KEYWORDS) if name not in NOT_SET_THERE]
    known = {
        "environment": list(dict.fromkeys([*OF_TRAINING, *settable, *OPTIONS])),
        "decisions": [f.name for f in fields(DecisionSettings)],
    }
    problems = [
        unknown_key(f"{section}.{key}", key, keys)
        for section, keys in known.items() for key in settings[section] if key not in keys
    ]  # fmt: skip
    environment = settings["environment"]
    for key, kinds, words in FORMS:
        if environment.get(key) is not None and not isinstance(environment[key], kinds):
            problems.append(str(refusal(f"environment.{key}", environment[key], words)))
    for key, default, check, allowed in SIMPLE:
        try:
            check(f"environment.{key}", environment.get(key, default), allowed)
        except InputError as error:
            problems.append(str(error))
    raise_problems(where, problems)
    DecisionSettings(**settings["decisions"])
    return settings


def check_algorithm(kind, name, settings):
    """Raise InputError for settings that an algorithm's class does not have or declares with another type."""
    arguments = inspect.signature(kind.__init__).parameters
    left_out = (*GIVEN_BY_TRAINING, *OBJECTS)
    known = {key: argument.annotation for key, argument in arguments.items() if key not in left_out}
    problems = []
    for key, value in settings.items():
        if key not in known:
            problems.append(unknown_key(f"algorithm.{key}", key, known))
            continue
        checked = {key: (value, _not_allowed(key, value, known[key]))}
        if key == "policy_kwargs" and isinstance(value, dict):
            checked = {f"{key}.{name}": (each, _not_of_policy(name, each)) for name, each in value.items()}
        for full_name, (each, allowed) in checked.items():
            if allowed is not None:
                problems.append(str(refusal(f"algorithm.{full_name}", each, allowed)))
    raise_problems(name, problems)


def _not_of_policy(key, value):
    """Return the allowed values of an item of policy_kwargs as text if its value is invalid; else None."""
    if key == "activation":
        return None if value in tuple(ACTIVATIONS) else f"one of {', '.join(ACTIVATIONS)}"
    return "numbers, or lists or tables of them" if _holds_text(value) else None


def _holds_text(value):
    """Return whether a value is or contains a string."""
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return isinstance(value, str) or any(map(_holds_text, items))


def _not_allowed(key, value, declared):
    """Return the allowed values of an algorithm's setting as text if its value is invalid; else None."""
    number = is_number(value)
    if key == "policy_kwargs":
        return None if isinstance(value, dict) else "a table"
    if key == "gamma":
        return None if number and 0.0 < value <= 1.0 else "a number > 0 and <= 1"
    if key in SCHEDULES:
        pair = isinstance(value, list) and len(value) == 2 and all(map(is_number, value))
        return None if number or pair else "a number or a pair [start, end]"
    if declared is bool:
        return None if isinstance(value, bool) else "true or false"
    if declared is int:
        return None if is_whole(value) else "a whole number"
    if declared is float:
        return None if number else "a number"
    if isinstance(value, str) and str not in get_args(declared):
        return "a number or a table"
    return None


def read_settings(path):
    """Return the settings of a run's settings.yml. Raises: InputError."""
    import yaml

    where = f"settings file {str(path)!r}"
    try:
        settings = yaml.safe_load(read_text(path, "settings"))
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{where} is not valid YAML: {' '.join(str(error).split())[:300]}") from None
    return check_settings(settings, where)
