"""Settings of an environment in four records, which its keywords fill too."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from fowt_env.descriptions.records import RENAMED
from fowt_env.descriptions.sensors import SensorChain
from fowt_env.errors import InputError, unknown_keyword
from fowt_env.scene.options import OPTIONS


@dataclass(frozen=True)
class EpisodeSettings:
    """What replaces parts of the task; None: the task's."""

    observation: Sequence[str] | None = None  # channel names; "default" among them: those of the task
    # {term: weight} that replace single weights, or a function (info) or (info, measurement) that returns the
    # reward, from the info of the step, with each named term, and the Measurement at its end (true motions)
    reward: Mapping[str, float] | Callable[..., float] | None = None
    duration: float | None = None  # s
    weather_duration: float | None = None  # s of random wind and sea; None: 600, or the duration if longer
    wind: Any = None  # as build_scene takes it, ranges included
    sea: Any = None
    wind_preview: Sequence[float] | None = None  # look-ahead times (s) of the channel wind_preview


@dataclass(frozen=True)
class PlantSettings:
    """The simulated plant."""

    rotor: str | None = None  # "bem", "lookup" or "table"; None: the task's, or else that of the fidelity
    fidelity: str = "standard"  # level of build_scene: "reference", "standard" or "fast"
    dt: float | None = None  # physics step, s; None: that of the scene's integrator
    # further ones of build_scene, `loads` among them
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ControlSettings:
    """What actions mean, how often they come, and the compiled controller beside them."""

    action_mode: str = "direct"  # "direct", "setpoint", "residual" or "individual"
    baseline: Any = "pi"  # compiled controller, by name or itself, that the residual mode adds to
    control_dt: float = 0.1  # s between actions, a multiple of dt
    # {"platform": ..., "turbine": ...}: plant that baseline and estimator are designed on; None: the true one
    nominal_plant: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class InterfaceSettings:
    """Sensors, wind ahead, trips and faults, with the meaning of the same arguments of simulate."""

    # name of a sensor chain, a SensorChain, or {"noise": standard deviation of white noise on every reading,
    # as a fraction of the channel's scale; "delay": control periods}; None: exact
    sensors: str | SensorChain | Mapping[str, Any] | None = None
    # wind ahead of the channel wind_preview and of the baseline: "exact" (rotor-averaged), a lidar, a Preview
    # or a function; None: exact too, in the channel the wind at the hub
    preview: Any = None
    protection: Any = None  # trips; with protection or faults no other overspeed ends an episode
    faults: Any = None  # Faults or mappings of their keys, whose times and values may be ranges (low, high)
    record: bool = False  # whether frame() returns the episode as simulate does


@dataclass(frozen=True)
class Settings:
    """All settings of an environment beside task, platform and rendering."""

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
# record of each keyword of FowtEnv
KEYWORDS = {
    item.name: name for name, record in RECORDS.items() for item in fields(record) if item.name != "options"
}


def read_settings(records: Mapping[str, Any], keywords: Mapping[str, Any]) -> Settings:
    """Return Settings from records (None: the defaults) and single keywords, which replace fields of these.

    Keywords that no record has are options of build_scene. Raises: InputError for unknown ones.
    """
    found: dict[str, Any] = {}
    for name, kind in RECORDS.items():
        record = records.get(name)
        if record is not None and not isinstance(record, kind):
            raise InputError(f"{name} = {record!r}: must be {kind.__name__}(...), or None")
        found[name] = kind() if record is None else record
    options = dict(found["plant"].options)
    for key, value in keywords.items():
        if key in KEYWORDS:
            found[KEYWORDS[key]] = replace(found[KEYWORDS[key]], **{key: value})
        elif key in OPTIONS or key == "loads":
            options[key] = value
        elif key in RENAMED:
            raise InputError(f"setting {key!r} of FowtEnv: is called {RENAMED[key]} now")
        else:
            raise unknown_keyword("FowtEnv.__init__", key, {*OPTIONS, "loads", *SETTINGS})
    found["plant"] = replace(found["plant"], options=options)
    return Settings(**found)


# settings of FowtEnv by name, those of build_scene apart
SETTINGS = ("task", "platform", "render_mode", "render_size", *RECORDS, *KEYWORDS)
