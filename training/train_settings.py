"""What the settings of a training run may be: files and changes are checked before anything is built."""

from typing import Annotated, Any, Literal

from pydantic import Field

from fowt_env.errors import InputError
from fowt_env.records import NonNegative, Positive, Record, validate
from fowt_env.textfiles import raise_problems, read_text

Count = Annotated[int, Field(ge=1, strict=True)]
Whole = Annotated[int, Field(ge=0, strict=True)]


class Validation(Record):
    """Episodes on which an agent is judged as it learns."""

    winds: Annotated[list[Positive], Field(min_length=1)]  # m/s
    first: Whole
    seeds: Count
    every: Count  # decisions
    skip: NonNegative = 60.0  # s
    # of FowtEnv, in turn over the seeds of each wind; none: exact readings
    sensors: list[dict[str, Any]] = []


class TrainingSettings(Record):
    """Settings of a run. The environment's, the decisions' and the algorithm's are checked by these."""

    algo: Literal["ppo", "sac", "tqc"]
    name: str  # of the settings in training/agents/ALGO.yml
    seed: Whole
    steps: Count
    task: str  # of the environment
    environment: dict[str, Any]
    decisions: dict[str, Any]
    normalise: dict[str, Any]
    algorithm: dict[str, Any]
    validation: Validation
    checkpoint_minutes: NonNegative


def check_settings(settings, where="settings"):
    """The settings, once they are known to be those of a run. Raises: InputError naming each wrong key."""
    if not isinstance(settings, dict):
        raise InputError(f"{where}: must be a table of settings")
    raise_problems(where, validate(TrainingSettings, settings)[1])
    return settings


def read_settings(path):
    """Settings of a run's settings.yml. Raises: InputError."""
    import yaml

    where = f"settings file {str(path)!r}"
    try:
        settings = yaml.safe_load(read_text(path, "settings"))
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{where} is not valid YAML: {' '.join(str(error).split())[:300]}") from None
    return check_settings(settings, where)
