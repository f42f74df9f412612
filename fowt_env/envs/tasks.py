"""Defines tasks: the ranges that episodes are drawn from, observation, reward and duration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from fowt_env.descriptions.checks import check_number, check_pair
from fowt_env.descriptions.faults import Fault, read_faults
from fowt_env.descriptions.nrel5mw import CUT_IN, CUT_OUT, PITCH_RATE, RATED_WIND, ROTOR_SPEED
from fowt_env.descriptions.sea_state import joint_sea_state, joint_tables, sea_of, sea_state_of
from fowt_env.descriptions.turbine import Turbine
from fowt_env.descriptions.units import DEGREE
from fowt_env.descriptions.wind import read_wind, wind_of
from fowt_env.display import html_table
from fowt_env.envs.observations import STANDARD, STOP_CHANNELS, check_channels
from fowt_env.envs.rewards import check_weights
from fowt_env.errors import InputError, unknown
from fowt_env.plant.aero.wind import WindSeries
from fowt_env.plant.state import State
from fowt_env.run.initial_conditions import INITIAL
from fowt_env.scene.channel_names import channel_name
from fowt_env.weather.wind import nominal_speed
from fowt_env.weather.wind_field import is_field

SITE = "gulf_of_maine_normal"
LARGEST_SEED = 2**31  # exclusive upper limit of weather seeds
# keys of a fault that may be ranges
RANGED, FAR = ("time", "delay", "rate", "offset", "value", "mass", "duration"), 1e9
SAMPLED = ("series", "steps", "components")  # kinds with lists of data, never ranges
OFFSETS = tuple(name for name, (index, _) in INITIAL.items() if not State.VX <= index <= State.WZ)


class Episode(NamedTuple):
    """Holds the drawn values of one episode of a task."""

    wind: Any  # as build_scene takes it
    sea: Any
    weather_seed: int
    offsets: dict  # {channel: offset from the operating point, in the channel's unit}
    exact_start: bool  # operating point solved for this wind, or interpolated between neighbouring winds
    shutdown: float | None = None  # s of operation by the baseline before the agent must stop the turbine
    faults: tuple = ()  # descriptions.faults.Faults of the episode


@dataclass(frozen=True)
class Task:
    """Defines weather, observation, reward and duration of the episodes of an agent.

    wind, sea: as in build_scene, where a tuple (low, high) in place of a number is a range from which
    each episode draws uniformly. sea may also be {"kind": "joint", "table": name}: the JONSWAP state
    that belongs to the mean wind at a site (constant outside the rows of the table); None: still water.

    A mixture of weathers is a list of (share, wind, sea) in place of wind: each episode draws one entry
    with probability proportional to its share, then draws from the ranges of the entry. sea must be None.
    Raises: InputError naming the task, the key, the value and the allowed range.
    """

    name: str
    wind: Any
    sea: Any = None
    duration: float = 600.0  # s
    rotor: str | None = None  # rotor model; None: that of the scene's fidelity
    observation: tuple = STANDARD
    weights: dict = field(default_factory=lambda: dict(WEIGHTS))  # {reward term: weight}
    offsets: dict = field(default_factory=lambda: dict(START))  # {channel: (low, high)} added to the trim
    blade_pitch: tuple = (0.0, 30.0)  # deg, reach of the pitch action
    setpoint: tuple = (0.5, 1.15)  # fraction of rated rotor speed, reach of the set-point action
    residual_torque: float = 0.1  # largest addition to the baseline's torque, fraction of rated torque
    residual_pitch: float = 2.0  # deg, largest addition to the baseline's blade pitch
    wind_preview: tuple = ()  # s, look-ahead times of the channel wind_preview
    # s, range of the time for which the baseline operates the turbine before the stop signal, when the agent
    # takes over; None: no stop, the agent operates the turbine from the start
    shutdown: tuple | None = None
    weather_seeds: tuple = (0, LARGEST_SEED)  # range (low, below) from which an episode's weather is drawn
    summary: str = field(default="", compare=False)  # objective in a few words, for lists

    def _repr_html_(self):
        """Return an HTML table of weather, observation and reward weights for notebooks."""
        rows = [
            *(
                (
                    f"weather {share:g}" if len(self.weathers) > 1 else "weather",
                    f"{wind}; sea: {sea or 'still water'}",
                )
                for share, wind, sea in self.weathers
            ),
            ("episode", f"{self.duration:g} s"),
            ("observation", ", ".join(self.observation)),
            ("reward", ", ".join(f"{weight:g} {term}" for term, weight in self.weights.items() if weight)),
            ("blade pitch", "{:g} to {:g} deg".format(*self.blade_pitch)),
            ("start", ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in self.offsets.items())),
        ]
        return html_table(f"Task {self.name}", (), rows)

    def __post_init__(self):
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"task.name = {self.name!r}: must be a name")
        where = f"task {self.name!r}"
        set_field = object.__setattr__
        check_number(f"{where}: duration", self.duration, 0.0, 1e5, low_open=True)
        set_field(self, "observation", check_channels(f"{where}: observation", self.observation))
        set_field(self, "weights", check_weights(f"{where}: weights", self.weights))
        set_field(self, "offsets", _check_offsets(where, self.offsets))
        set_field(self, "blade_pitch", check_pair(f"{where}: blade_pitch", self.blade_pitch, -90.0, 180.0))
        set_field(self, "setpoint", check_pair(f"{where}: setpoint", self.setpoint, 0.0, 2.0))
        check_number(f"{where}: residual_torque", self.residual_torque, 0.0, 1.0)
        check_number(f"{where}: residual_pitch", self.residual_pitch, 0.0, 90.0)
        set_field(self, "wind_preview", _check_preview(where, self.wind_preview))
        _check_seeds(where, self.weather_seeds)
        if self.shutdown is not None:
            set_field(self, "shutdown", check_pair(f"{where}: shutdown", self.shutdown, 0.0, self.duration))
        for name in set(self.observation) & set(STOP_CHANNELS) if self.shutdown is None else ():
            raise InputError(f"{where}: observation: {name!r}: needs a task with shutdown")
        if is_mixture(self.wind):
            set_field(self, "wind", _check_mixture(where, self.wind, self.sea))
        set_field(self, "wind", wind_of(self.wind))
        set_field(self, "sea", sea_of(self.sea))
        for _, wind, sea in self.weathers:
            _check_weather(where, wind, sea)

    @property
    def weathers(self):
        """Return the tuple of (share, wind, sea) of the mixture; a single entry without a mixture."""
        return self.wind if is_mixture(self.wind) else ((1.0, self.wind, self.sea),)

    def draw(self, rng):
        """Draw an Episode with a numpy Generator; the same generator state gives the same episode."""
        wind, sea = _drawn(self.weathers, rng)
        seed = int(rng.integers(*self.weather_seeds))
        offsets = {name: float(rng.uniform(*bounds)) for name, bounds in self.offsets.items()}
        shutdown = None if self.shutdown is None else float(rng.uniform(*self.shutdown))
        return Episode(wind, sea, seed, offsets, self.fixed_wind, shutdown)

    @property
    def has_sea(self):
        """Return whether an episode may have waves; kernels then compute waves in every episode."""
        return any(_has_waves(wind, sea) for _, wind, sea in self.weathers)

    @property
    def fixed_wind(self):
        """Return whether every episode has the same mean wind (always true for a full-field wind box)."""
        if is_field(self.wind):
            return True
        ends = [_weather(wind, None, pick)[0] for _, wind, _ in self.weathers for pick in (_lowest, _highest)]
        return len({nominal_speed(wind) for wind in ends}) == 1


def _drawn(weathers, rng):
    """Draw one (share, wind, sea) and return its (wind, sea) with numbers drawn from its ranges."""
    i = 0
    if len(weathers) > 1:
        shares = np.array([share for share, _, _ in weathers])
        i = int(rng.choice(len(weathers), p=shares / shares.sum()))
    return _weather(*weathers[i][1:], lambda low, high: float(rng.uniform(low, high)))


def varies(spec):
    """Return whether a wind or sea contains values to draw: a range, a mixture or a joint table."""
    if isinstance(spec, dict):
        if spec.get("kind") in SAMPLED:
            return False
        return spec.get("kind") == "joint" or any(isinstance(value, tuple) for value in spec.values())
    return type(spec) is tuple or (type(spec) is list and is_mixture(spec))  # excludes WindSeries, a subclass


def draw_weather(where, wind, sea, rng):
    """Draw (wind, sea) of an episode from ranges or a mixture with a Generator. Raises: InputError."""
    weathers = _check_mixture(where, wind, sea) if is_mixture(wind) else ((1.0, wind, sea),)
    for _, air, water in weathers:
        _check_weather(where, air, water)
    return _drawn(weathers, rng)


def draw_offsets(offsets, rng):
    """Draw {channel: offset} from {channel: offset or (low, high)}, channel units. Raises: InputError."""
    drawn = {}
    for name, value in {channel_name(name): value for name, value in offsets.items()}.items():
        if isinstance(value, tuple | list):
            low, high = _check_offsets("options", {name: value})[name]
            drawn[name] = float(rng.uniform(low, high))
        else:
            drawn[name] = check_offset(name, value)
    return drawn


def draw_faults(faults, rng):
    """Draw the tuple of Faults of an episode from Faults or mappings with ranges (low, high).

    Raises: InputError.
    """
    if faults is None or isinstance(faults, Fault | Mapping):
        faults = () if faults is None else (faults,)
    if isinstance(faults, str) or not isinstance(faults, Sequence):
        return read_faults(faults)
    drawn = []
    for fault in faults:
        if isinstance(fault, Mapping):
            fault = {
                key: float(rng.uniform(*check_pair(f"faults: {key}", value, -FAR, FAR)))
                if key in RANGED and isinstance(value, tuple | list)
                else value
                for key, value in fault.items()
            }
        drawn.append(fault)
    return read_faults(drawn)


def _lowest(low, high):
    return low


def _highest(low, high):
    return high


def _weather(wind, sea, pick):
    """Replace each range in (wind, sea) by pick(low, high), and a joint sea by its state at that wind."""
    wind = _picked("wind", wind, pick)
    if isinstance(sea, dict) and sea.get("kind") == "joint":
        rest = {key: value for key, value in sea.items() if key not in ("kind", "table")}
        rest = _picked("sea", rest, pick)
        if is_field(wind):
            raise InputError("sea: a joint sea state needs a mean wind speed, not a wind box; specify a sea")
        sea = _joint(sea.get("table", SITE), nominal_speed(wind)) | rest
    else:
        sea = _picked("sea", sea, pick)
    return wind, sea


def is_mixture(wind):
    """Return whether wind is a list of weathers: a range (low, high) has numbers, a mixture has triples."""
    return isinstance(wind, tuple | list) and any(isinstance(entry, tuple | list) for entry in wind)


def _check_mixture(where, mixture, sea):
    """Return the checked mixture as a tuple of (share, wind, sea). Raises: InputError."""
    if sea is not None:
        raise InputError(f"{where}: sea = {sea!r}: must be None with a mixture, which specifies the seas")
    checked = []
    for i, entry in enumerate(mixture):
        if not isinstance(entry, tuple | list) or len(entry) != 3:
            raise InputError(f"{where}: wind[{i}] = {entry!r}: must be (share, wind, sea)")
        if is_field(entry[1]):
            raise InputError(f"{where}: wind[{i}]: a box of full-field wind cannot be part of a mixture")
        share = check_number(f"{where}: share of wind[{i}]", entry[0], 0.0, 1e6, low_open=True)
        checked.append((share, wind_of(entry[1]), sea_of(entry[2])))
    return tuple(checked)


def _check_weather(where, wind, sea):
    """Raise InputError unless wind and sea can be read at both ends of their ranges."""
    if wind is None:
        raise InputError(f"{where}: wind = None: a task needs a wind (0.0 for still air)")
    for pick in (_lowest, _highest):
        air, water = _weather(wind, sea, pick)
        try:
            if not isinstance(air, WindSeries) and not is_field(air):  # these two are parsed already
                read_wind(air)
            sea_state_of(water)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None


def _has_waves(wind, sea):
    """Return whether a weather may have waves."""
    if isinstance(sea, dict) and sea.get("kind") == "joint":
        return True
    return sea_state_of(_weather(wind, sea, _highest)[1]).height > 0.0


def _picked(where, spec, pick):
    """Return the spec with each range replaced by pick(low, high)."""
    if isinstance(spec, tuple):
        return pick(*check_pair(where, spec, -1e9, 1e9))
    if not isinstance(spec, dict) or spec.get("kind") in SAMPLED:
        return spec
    return {
        key: pick(*check_pair(f"{where}.{key}", value, -1e9, 1e9)) if isinstance(value, tuple) else value
        for key, value in spec.items()
    }


def _joint(table, speed):
    """Return the JONSWAP sea of a joint table at a wind speed, limited to the table's range."""
    if isinstance(table, str) and table not in joint_tables():
        raise unknown("joint sea-state table", table, joint_tables())
    rows = joint_tables()[table] if isinstance(table, str) else table
    state = joint_sea_state(table, min(max(speed, rows.wind[0]), rows.wind[-1]))
    return {"kind": "jonswap", "Hs": state.Hs, "Tp": state.Tp}


def check_offset(name, value):
    """Return the checked offset (in the channel's unit) of one episode. Raises: InputError."""
    name = channel_name(name)
    if name not in OFFSETS:
        raise unknown("channel of offsets", name, OFFSETS)
    return check_number(f"offsets[{name!r}]", value, -360.0, 360.0)


def _check_offsets(where, offsets):
    checked = {}
    for name, bounds in {channel_name(name): bounds for name, bounds in dict(offsets).items()}.items():
        if name not in OFFSETS:
            raise unknown(f"channel of {where}: offsets", name, OFFSETS)
        checked[name] = check_pair(f"{where}: offsets[{name!r}]", bounds, -360.0, 360.0)
    return checked


def _check_preview(where, times):
    if isinstance(times, int | float):
        raise InputError(f"{where}: wind_preview = {times!r}: must be a list of times, such as ({times!r},)")
    return tuple(check_number(f"{where}: wind_preview", time, 0.0, 600.0, low_open=True) for time in times)


def _check_seeds(where, seeds):
    """Raise InputError unless seeds are whole numbers (low, below) with 0 <= low < below <= 2**31."""
    good = isinstance(seeds, tuple) and len(seeds) == 2 and all(type(seed) is int for seed in seeds)
    if not good or not 0 <= seeds[0] < seeds[1] <= LARGEST_SEED:
        raise InputError(
            f"{where}: weather_seeds = {seeds!r}: must be whole numbers (low, below)"
            f" with 0 <= low < below <= {LARGEST_SEED}"
        )


# These weights rank controllers as the metrics do (environment.md): a lower weight on travel favours
# aggressive pitch action, which excites the platform. The weight of power is low: its term falls faster
# above rated than below, which lowers the mean power.
WEIGHTS: dict[str, float] = {
    "power": 0.2,
    "rotor_speed": 3.0,
    "platform_motion": 6.0,
    "pitch_travel": 72.0,
    "torque_travel": 0.5,
    "failure": 100.0,
    "power_shortfall": 0.0,
}
START: dict[str, tuple[float, float]] = {  # about one standard deviation in operation
    "PtfmSurge": (-2.0, 2.0),
    "PtfmSway": (-0.5, 0.5),
    "PtfmHeave": (-0.3, 0.3),
    "PtfmRoll": (-0.2, 0.2),
    "PtfmPitch": (-1.0, 1.0),
    "PtfmYaw": (-0.5, 0.5),
    "RotSpeed": (-0.5, 0.5),
    "Azimuth": (0.0, 360.0),
}
# Favours a quick stop with little motion of platform and tower; feathering at full rate excites both.
STOP_WEIGHTS: dict[str, float] = {
    "standstill": 4.0,
    "platform_rate": 6.0,
    "tower_top": 6.0,
    "pitch_travel": 1.0,
    "torque_travel": 0.0,
    "failure": 100.0,
}
JOINT = {"kind": "joint", "table": SITE}
GUST_START = (60.0, 300.0)  # s


def _mixture(low, high):
    """Return the weather mixture for mean winds from low to high (m/s), with shares suited to training."""
    speed = (low, high)
    return (
        (0.65, {"kind": "ntm", "speed": speed, "class": "B", "sigma": "drawn"}, JOINT),
        (0.05, {"kind": "steady", "speed": speed}, None),
        (0.1, {"kind": "steady", "speed": speed}, JOINT),
        (0.1, {"kind": "eog", "speed": speed, "start": GUST_START}, JOINT),
        (0.05, {"kind": "edc", "speed": speed, "start": GUST_START, "sign": 1}, JOINT),
        (0.05, {"kind": "edc", "speed": speed, "start": GUST_START, "sign": -1}, JOINT),
    )


TASKS = {
    task.name: task
    for task in (
        Task(
            name="above_rated",
            summary="hold rotor speed and platform in turbulence and waves",
            wind={"kind": "ntm", "speed": (12.0, 24.0), "class": "B"},
            sea={"kind": "joint", "table": SITE},
            setpoint=(0.85, 1.15),
        ),
        Task(
            name="full_range",
            summary="produce power from cut-in to cut-out",
            wind={"kind": "ntm", "speed": (4.0, 25.0), "class": "B"},
            sea={"kind": "joint", "table": SITE},
        ),
        Task(
            name="steady",
            summary="steady wind over still water: the simplest to learn",
            wind={"kind": "steady", "speed": (4.0, 25.0)},
        ),
        Task(
            name="shutdown",
            summary="stop the rotor gently after a signal",
            wind={"kind": "ntm", "speed": (12.0, 24.0), "class": "B"},
            sea={"kind": "joint", "table": SITE},
            duration=240.0,
            observation=(*STANDARD, "nacelle_acceleration", "time_since_shutdown"),
            weights=STOP_WEIGHTS,
            blade_pitch=(0.0, 90.0),
            shutdown=(20.0, 60.0),
        ),
        Task(
            name="above_rated_mixture",
            summary="above_rated with gusts, steady wind and direction changes mixed in",
            wind=_mixture(12.0, 24.0),
            setpoint=(0.85, 1.15),
        ),
    )
}


def task_of(task: str | Task, turbine: Turbine | None = None) -> Task:
    """Return the Task of a name, scaled to a turbine if any, or the Task itself. Raises: InputError."""
    if isinstance(task, Task):
        return task
    if not isinstance(task, str) or task not in TASKS:
        raise unknown("task", task, TASKS)
    return TASKS[task] if turbine is None else scaled_task(TASKS[task], turbine)


def scaled_task(task: Task, turbine: Turbine) -> Task:
    """Scale a task of the NREL 5 MW turbine to another turbine; unchanged for equal winds, speed and drive.

    Winds above rated keep their difference from rated, others their fraction of the range from cut-in to
    rated, limited to cut-out; the rotor-speed offset scales with rated speed. The weight of pitch travel
    counts a degree of travel per rotor revolution equally for every turbine. Seas follow the scaled wind.
    """
    winds = (turbine.cut_in_wind_speed, turbine.rated_wind_speed, turbine.cut_out_wind_speed)
    drive = turbine.pitch_drive
    same = (*winds, turbine.rated_rotor_speed, drive.rate_limit) == (
        CUT_IN, RATED_WIND, CUT_OUT, ROTOR_SPEED, PITCH_RATE,
    )  # fmt: skip
    if not same:
        speed = turbine.rated_rotor_speed / ROTOR_SPEED
        travel = drive.rate_limit / PITCH_RATE / speed
        if is_mixture(task.wind):
            wind = tuple((share, _scaled_wind(air, winds), sea) for share, air, sea in task.wind)
        else:
            wind = _scaled_wind(task.wind, winds)
        offsets = dict(task.offsets)
        if "RotSpeed" in offsets:
            offsets["RotSpeed"] = tuple(speed * value for value in offsets["RotSpeed"])
        weights = task.weights | {"pitch_travel": travel * task.weights["pitch_travel"]}
        task = replace(task, wind=wind, offsets=offsets, weights=weights)
    low, high = task.blade_pitch
    reach = max(low, drive.minimum / DEGREE), min(high, drive.maximum / DEGREE)
    return task if reach == (low, high) else replace(task, blade_pitch=reach)


def _scaled_wind(wind, winds):
    """Return a wind of TASKS with its speeds mapped to the cut-in, rated and cut-out winds of a turbine."""
    cut_in, rated, cut_out = winds

    def moved(speed):
        if speed == CUT_OUT:
            return cut_out
        if speed > RATED_WIND:
            return min(rated + (speed - RATED_WIND), cut_out)
        return cut_in + (speed - CUT_IN) / (RATED_WIND - CUT_IN) * (rated - cut_in)

    return wind | {"speed": tuple(moved(speed) for speed in wind["speed"])}
