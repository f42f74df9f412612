"""What a user may ask of the wind: the kinds, their keys, units, ranges and defaults, and the checks.

KINDS are those that are uniform over the rotor but for shear, FIELD_KINDS the boxes of full-field wind.
`wind_of` turns the text or path that stands for a wind into a number or a mapping, and `read_wind` these
into a checked WindSpec.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fowt_env.descriptions.checks import check_number, check_whole_number, parse_number, refusal, short
from fowt_env.descriptions.files import json_text
from fowt_env.descriptions.iec import REFERENCE_SPEED, TURBULENCE_INTENSITY
from fowt_env.descriptions.wind_files import TABLES, UNIFORM, read_uniform_wind, read_wind_table
from fowt_env.errors import InputError, unknown


class Required:
    """Mark of a key that has no default."""


class Number(NamedTuple):
    """A finite number within [low, high]."""

    low: float
    high: float
    unit: str
    default: Any = Required

    def read(self, where, value):
        allowed = f"in [{self.low:g}, {self.high:g}] {self.unit}".rstrip()
        return check_number(where, as_float(where, value), self.low, self.high, allowed=allowed)


class Choice(NamedTuple):
    """One of a few names or numbers; letters of either case."""

    allowed: tuple
    default: Any = Required

    def read(self, where, value):
        wanted = value.upper() if isinstance(value, str) else value
        for choice in self.allowed:
            same = choice.upper() if isinstance(choice, str) else choice
            if type(wanted) is not bool and wanted == same:
                return choice
        if isinstance(value, str):
            raise unknown(where, value, self.allowed)
        raise refusal(where, value, f"one of {', '.join(map(str, self.allowed))}")


class Flag(NamedTuple):
    """True or False."""

    default: Any = Required

    def read(self, where, value):
        if not isinstance(value, (bool, np.bool_)):
            raise refusal(where, value, "True or False")
        return bool(value)


class Samples(NamedTuple):
    """A non-empty one-dimensional array of finite numbers within [low, high]."""

    low: float
    high: float
    unit: str
    default: Any = Required

    def read(self, where, value):
        try:
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise refusal(where, value, "a list of numbers") from None
        if array.ndim != 1 or array.size == 0:
            raise InputError(
                f"{where} has shape {array.shape}: must be a list of at least one number, shape (n,)"
            )
        wrong = np.flatnonzero(~((array >= self.low) & (array <= self.high)))
        if wrong.size:
            raise InputError(
                f"{where}[{wrong[0]}] = {array[wrong[0]]}: must be in "
                f"[{self.low:g}, {self.high:g}] {self.unit}"
            )
        return array


class Array(NamedTuple):
    """A non-empty array of finite numbers with a given number of axes."""

    axes: int
    default: object = None

    def read(self, where, value):
        try:
            array = np.asarray(value, dtype=np.float32 if self.axes > 1 else np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{where}: must be an array of numbers with {self.axes} axes") from None
        if array.ndim != self.axes or array.size == 0 or not np.isfinite(array).all():
            raise InputError(f"{where} has shape {array.shape}: must be finite numbers with {self.axes} axes")
        return array


class Text(NamedTuple):
    """A path."""

    default: object = None

    def read(self, where, value):
        if not isinstance(value, str | Path):
            raise InputError(f"{where} = {value!r}: must be a path")
        return Path(value).expanduser()


class Seed(NamedTuple):
    """A non-negative whole number."""

    default: Any = Required

    def read(self, where, value):
        return check_whole_number(where, value, 0)


def as_float(where, value):
    """float(value) of a real number; text and booleans are refused."""
    if isinstance(value, (bool, np.bool_, str, bytes)):
        raise refusal(where, value, "a number")
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise refusal(where, value, "a number") from None


SPEED_LIMIT = 100.0  # m/s; above every extreme of the standard (70 m/s)
SPEED = Number(0.0, SPEED_LIMIT, "m/s")
# the mean of turbulence and gusts divides frequencies and angles, so it cannot be zero
MOVING = Number(1.0, SPEED_LIMIT, "m/s")
DIRECTION = Number(-180.0, 180.0, "deg", 0.0)  # towards which the wind blows, from +x towards +y
TURBINE_CLASS = Choice(tuple(REFERENCE_SPEED), "I")
TURBULENCE_CLASS = Choice(tuple(TURBULENCE_INTENSITY), "B")
# of the normal turbulence model: the standard's representative value, or one drawn from its distribution
NTM_SIGMA = Choice(("90%", "drawn"), "90%")
START = Number(0.0, 1e6, "s", 60.0)
SIGN = Choice((1, -1), 1)
COMPONENT = Samples(-SPEED_LIMIT, SPEED_LIMIT, "m/s", None)

RANDOM = {  # keys of every turbulent wind
    "direction": DIRECTION,
    "average": Choice(("rotor", "point"), "rotor"),
    "shear_turbulence": Flag(True),
    "period": Number(60.0, 1e5, "s", None),
    "seed": Seed(None),
}
GUST = {"speed": MOVING, "start": START, "class": TURBULENCE_CLASS}
SHARED = {"shear_exponent": Number(0.0, 1.0, "", None)}  # key of every kind; None: that of the site

KINDS = {
    "steady": {
        "speed": SPEED,
        "direction": DIRECTION,
        "vertical": Number(-SPEED_LIMIT, SPEED_LIMIT, "m/s", 0.0),
    },
    "series": {
        "time": Samples(-1e6, 1e9, "s"),
        "speed": Samples(0.0, SPEED_LIMIT, "m/s"),
        "v": COMPONENT,
        "w": COMPONENT,
        "vertical_shear": COMPONENT,
        "horizontal_shear": COMPONENT,
    },
    "steps": {
        "speeds": Samples(0.0, SPEED_LIMIT, "m/s"),
        "every": Number(0.01, 1e6, "s"),
        "ramp": Number(1e-3, 1e6, "s", 0.1),
    },
    "eog": GUST | {"turbine_class": TURBINE_CLASS},
    "edc": GUST | {"sign": SIGN},
    "ecd": {"speed": MOVING, "start": START, "sign": SIGN},
    "ews": GUST | {"sign": SIGN, "orientation": Choice(("vertical", "horizontal"), "vertical")},
    "ntm": {"speed": MOVING, "class": TURBULENCE_CLASS, "sigma": NTM_SIGMA} | RANDOM,
    "etm": {"speed": MOVING, "class": TURBULENCE_CLASS, "turbine_class": TURBINE_CLASS} | RANDOM,
    "ewm": {"turbine_class": TURBINE_CLASS, "recurrence": Choice((50, 1), 50), "turbulent": Flag(False)}
    | RANDOM,
}
REQUIRED = object()
SHIFT = Number(0.0, 1e5, "s", None)
FIELD_KINDS = {  # kind -> {key: (rule, default)}; None: found from the box
    "bts": {
        "path": (Text(), REQUIRED),
        "periodic": (Flag(), None),
        "shift": (SHIFT, None),
    },
    "box": {
        "u": (Array(3), REQUIRED),
        "v": (Array(3), None),
        "w": (Array(3), None),
        "y": (Array(1), REQUIRED),
        "z": (Array(1), REQUIRED),
        "dt": (Number(1e-4, 1e3, "s"), REQUIRED),
        "speed": (MOVING, REQUIRED),
        "periodic": (Flag(), False),
        "shift": (SHIFT, None),
    },
    "mann": {
        "speed": (MOVING, REQUIRED),
        "class": (TURBULENCE_CLASS, "B"),
        "sigma": (NTM_SIGMA, "90%"),
        "seed": (Seed(), None),
        "dt": (Number(0.05, 1.0, "s"), 0.2),
        "shear_exponent": (Number(0.0, 1.0, ""), None),
    },
}
ALL_KINDS = (*KINDS, *FIELD_KINDS)
BOX = ".bts"  # ending of TurbSim's boxes
OTHER_NAMES = {  # what others call a kind
    "turbsim": "bts",
    "constant": "steady",
    "uniform": "steady",
    "kaimal": "ntm",
    "turbulent": "ntm",
}
FORMS = (
    f"a speed (18), KIND:SPEED[:CLASS] (ntm:18:B), a {BOX}, {', '.join(UNIFORM)}, {' or '.join(TABLES)} file,"
    f" a mapping with 'kind' or its JSON, or none; kinds: {', '.join(ALL_KINDS)}"
)


@dataclass(frozen=True)
class WindSpec:
    """A checked wind: its kind and the value of each of its keys (see KINDS)."""

    kind: str
    values: dict = field(default_factory=dict)

    def __getitem__(self, key):
        return self.values[key]


def wind_of(spec: Any) -> Any:
    """The wind that a text or a path stands for, as a number or a mapping; anything else as it is.

    "18"; "ntm:18:B", which is KIND:SPEED[:CLASS]; JSON of a mapping; "none"; a path to a .bts box, a uniform
    wind file of InflowWind (.wnd, .hh) or a table of time (s) and speed (m/s) (.csv, .parquet).
    Raises: InputError for other texts, and for a table or uniform wind file that cannot be read.
    """
    if not isinstance(spec, str | Path):
        return spec
    text = str(spec).strip()
    if text.lower() == "none":
        return None
    number = parse_number(text)
    if number is not None:
        return number
    if text.startswith("{"):
        return json_text("wind", text)
    if is_wind_file(text):
        path = Path(text).expanduser()
        if path.suffix.lower() == BOX:
            return {"kind": "bts", "path": str(path)}
        return read_uniform_wind(path) if path.suffix.lower() in UNIFORM else read_wind_table(path)
    kind, *rest = text.split(":")
    if rest and kind not in ALL_KINDS and kind.isidentifier():
        raise unknown_kind(kind)
    if not rest or len(rest) > 2 or parse_number(rest[0]) is None:
        other = OTHER_NAMES.get(text.lower(), text.lower())
        hint = ""
        if other == "bts":
            hint = f"; a box of TurbSim is the path of its {BOX} file"
        elif other in ALL_KINDS:
            hint = f"; {other!r} is a kind and needs more, as {other}:18 or a mapping"
        raise InputError(f"wind = {short(text)}: must be {FORMS}{hint}")
    found = {"kind": kind, "speed": parse_number(rest[0])}
    return found | {"class": rest[1]} if len(rest) == 2 else found


def is_wind_file(text: str) -> bool:
    """Whether a text is the path of a wind, by its ending."""
    return Path(text).suffix.lower() in (BOX, *UNIFORM, *TABLES) and not text.lstrip().startswith("{")


def unknown_kind(kind):
    """InputError for a kind of wind that there is not, with what others call a kind as a suggestion."""
    other = OTHER_NAMES.get(kind.lower()) if isinstance(kind, str) else None
    if other is None:
        return unknown("wind.kind", kind, ALL_KINDS)
    of_a_file = ", and a path to a .bts file is a wind by itself" if other == "bts" else ""
    return InputError(
        f"unknown wind.kind {kind!r}. It is called {other!r} here{of_a_file}. Known: {', '.join(ALL_KINDS)}"
    )


def read_wind(spec):
    """WindSpec of a speed in m/s, a mapping with "kind", a text (wind_of), or a WindSpec.

    Raises: InputError naming the key, its value and what is allowed.
    """
    if isinstance(spec, WindSpec):
        return spec
    spec = wind_of(spec)
    if isinstance(spec, list | tuple | set) or spec is None:
        raise InputError(f"wind = {short(spec)}: must be {FORMS}")
    if not isinstance(spec, dict):
        spec = {"kind": "steady", "speed": SPEED.read("wind", spec)}
    if "kind" not in spec:
        raise InputError(f"wind.kind is missing: must be one of {', '.join(ALL_KINDS)}")
    kind = spec["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise unknown_kind(kind)
    keys = KINDS[kind] | SHARED
    for key in spec:
        if key != "kind" and key not in keys:
            raise unknown(f"key of the {kind} wind", key, keys)
    values = {}
    for key, rule in keys.items():
        value = spec.get(key, rule.default)
        if value is Required:
            raise InputError(f"wind.{key} is missing: the {kind} wind needs it")
        values[key] = value if value is None and rule.default is None else rule.read(f"wind.{key}", value)
    _check_together(kind, values)
    return WindSpec(kind, values)


def _check_together(kind, values):
    """Rules that join several keys. Raises InputError."""
    if kind == "series":
        time = values["time"]
        for key, array in values.items():
            if isinstance(array, np.ndarray) and array.size != time.size:
                raise InputError(
                    f"wind.{key} has {array.size} values: must be {time.size}, as many as wind.time"
                )
        wrong = np.flatnonzero(np.diff(time) <= 0.0)
        if wrong.size:
            late = wrong[0] + 1
            raise InputError(
                f"wind.time[{late}] = {time[late]}: must be above wind.time[{late - 1}] = {time[late - 1]}"
                " (strictly increasing)"
            )
    if kind == "steps" and values["ramp"] >= values["every"]:
        raise InputError(f"wind.ramp = {values['ramp']}: must be below wind.every = {values['every']} s")
    if kind == "eog":
        limit = 0.8 * 1.4 * REFERENCE_SPEED[values["turbine_class"]]
        if values["speed"] >= limit:
            raise InputError(
                f"wind.speed = {values['speed']}: must be below {limit:g} m/s, the one-year extreme speed of"
                f" turbine class {values['turbine_class']}"
            )
    if kind == "ewm" and not values["turbulent"]:
        for key, rule in RANDOM.items():
            if key != "direction" and values[key] != rule.default:
                raise InputError(f"wind.{key} = {values[key]!r}: needs wind.turbulent = True")
