"""Defines the settings of an environment as four records, whose fields are also keywords of FowtEnv."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from fowt_env.descriptions.records import RENAMED
from fowt_env.descriptions.sensors import SensorChain
from fowt_env.errors import InputError, unknown_keyword
from fowt_env.scene.options import OPTIONS


@dataclass(frozen=True)
class EpisodeSettings:
    """Holds values that replace parts of the task; None: value of the task."""

    observation: Sequence[str] | None = None  # channel names; "default" stands for the task's channels
    # {term: weight} to replace single weights, or a function (info) or (info, measurement) that returns the
    # reward: info of the step, with each named term, and Measurement at the end of the step (true motions)
    # "score": goals in [0, 1] that rank controllers as the score of suites does (goals.py)
    reward: Mapping[str, float] | Callable[..., float] | str | None = None
    # {entry of the observation: (centre, scale, change)}, SI: with decisions the features are
    # (value - centre) / scale, and the change between two decisions / change; None: as the table of channels
    normalise: Mapping[str, Sequence[float]] | None = None
    duration: float | None = None  # s
    weather_duration: float | None = None  # s of random wind and sea; None: 600, or the duration if longer
    wind: Any = None  # as in build_scene; ranges are allowed
    sea: Any = None
    wind_preview: Sequence[float] | None = None  # look-ahead times (s) of the channel wind_preview


@dataclass(frozen=True)
class PlantSettings:
    """Holds the settings of the simulated plant."""

    rotor: str | None = None  # "bem", "lookup" or "table"; None: of the task, or default of the fidelity
    fidelity: str = "standard"  # level of build_scene: "reference", "standard", "elastic", "fast"
    dt: float | None = None  # physics step, s; None: default step of the scene's integrator
    # further options of build_scene, including `loads`
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ControlSettings:
    """Holds the action mode, the control period and the compiled baseline controller."""

    action_mode: str = "direct"  # "direct", "setpoint", "residual", "individual" or "individual_residual"
    baseline: Any = "pi"  # controller (name or object) that the residual mode adds to
    # largest additions of the residual mode: fraction of rated torque, deg of blade pitch; None: of the task
    residual_torque: float | None = None
    residual_pitch: float | None = None
    control_dt: float = 0.1  # s between actions, a multiple of dt
    # DecisionSettings or a mapping of its fields: a step is then a decision, held for several control
    # periods, smoothed, with a history in the observation; None: a step is one control period
    decisions: Any = None
    # {"platform": ..., "turbine": ...}: plant that baseline and estimator are designed on; None: the true one
    nominal_plant: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class InterfaceSettings:
    """Holds sensors, wind preview, trips and faults, with the same meaning as in simulate."""

    # name of a sensor chain, a SensorChain, or {"noise": standard deviation of white noise on every reading,
    # as a fraction of the channel's scale; "delay": control periods}; None: exact
    sensors: str | SensorChain | Mapping[str, Any] | None = None
    # preview for the channel wind_preview and the baseline: "exact" (rotor-averaged), a lidar, a Preview or a
    # function; None: exact for the baseline, wind at the hub for the channel
    preview: Any = None
    protection: Any = None  # trips; with these or faults, the turbine file's overspeed ends no episode
    faults: Any = None  # Faults or mappings of Fault keys; times and values may be ranges (low, high)
    record: bool = False  # whether output rows are stored for frame()


@dataclass(frozen=True)
class Settings:
    """Holds all settings of an environment except task, platform and rendering."""

    episode: EpisodeSettings
    plant: PlantSettings
    control: ControlSettings
    interface: InterfaceSettings


RECORDS = {
    "episode": EpisodeSettings,
    "plant": PlantSettings,
    "control": ControlSettings,
    "interface": InterfaceSettings,
}
# record that each keyword of FowtEnv belongs to
KEYWORDS = {
    item.name: name for name, record in RECORDS.items() for item in fields(record) if item.name != "options"
}


def read_settings(records: Mapping[str, Any], keywords: Mapping[str, Any]) -> Settings:
    """Return Settings from records (None: the defaults) and keywords that replace single fields.

    Other keywords are options of build_scene. Raises: InputError for unknown keywords.
    """
    filled: dict[str, Any] = {}
    for name, kind in RECORDS.items():
        record = records.get(name)
        if record is not None and not isinstance(record, kind):
            raise InputError(f"{name} = {record!r}: must be {kind.__name__}(...), or None")
        filled[name] = kind() if record is None else record
    options = dict(filled["plant"].options)
    for key, value in keywords.items():
        if key in KEYWORDS:
            filled[KEYWORDS[key]] = replace(filled[KEYWORDS[key]], **{key: value})
        elif key in OPTIONS or key == "loads":
            options[key] = value
        elif key in RENAMED:
            raise InputError(f"setting {key!r} of FowtEnv: is called {RENAMED[key]} now")
        else:
            raise unknown_keyword("FowtEnv.__init__", key, {*OPTIONS, "loads", *SETTINGS})
    filled["plant"] = replace(filled["plant"], options=options)
    return Settings(**filled)


# names of the settings of FowtEnv, without the options of build_scene
SETTINGS = ("task", "platform", "render_mode", "render_size", *RECORDS, *KEYWORDS)
