"""Defines the kinds of wind with their keys, units, ranges and defaults, and checks wind specifications.

KINDS are uniform over the rotor except for shear, FIELD_KINDS are full-field wind boxes. `wind_of` converts
the text or path of a wind to a number or a mapping, and `read_wind` both to a checked WindSpec.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import create_model

from fowt_env.descriptions.checks import check_in_range, check_whole_number, parse_number, short
from fowt_env.descriptions.files import json_text
from fowt_env.descriptions.iec import REFERENCE_SPEED, TURBULENCE_INTENSITY
from fowt_env.descriptions.records import (
    FilePath,
    Flag,
    Record,
    Seed,
    array,
    checked,
    in_range,
    one_of,
    samples,
    validate,
)
from fowt_env.descriptions.wind_files import TABLES, UNIFORM, read_uniform_wind, read_wind_table
from fowt_env.errors import InputError, unknown

SPEED_LIMIT = 100.0  # m/s; above all extreme speeds of the standard (70 m/s)
SPEEDS = (0.0, SPEED_LIMIT, "m/s")
# the mean speed of turbulence and gusts is a divisor of frequencies and angles, so it must not be zero
MOVING_SPEEDS = (1.0, SPEED_LIMIT, "m/s")
BOX_STEPS = (1e-4, 1e3, "s")
NTM_SIGMAS = ("90%", "drawn")  # the standard's representative value, or a random value of its distribution

# A key is (type, default); default ...: the key is required; None: taken from site, scene or box.
SPEED, MOVING = (in_range(*SPEEDS), ...), (in_range(*MOVING_SPEEDS), ...)
DIRECTION = (in_range(-180.0, 180.0, "deg"), 0.0)  # towards which the wind blows, from +x towards +y
TURBINE_CLASS = (one_of(tuple(REFERENCE_SPEED)), "I")
TURBULENCE_CLASS = (one_of(tuple(TURBULENCE_INTENSITY)), "B")
NTM_SIGMA = (one_of(NTM_SIGMAS), "90%")
START = (in_range(0.0, 1e6, "s"), 60.0)
SIGN = (one_of((1, -1)), 1)
COMPONENT = (samples(-SPEED_LIMIT, SPEED_LIMIT, "m/s") | None, None)
SEED = (Seed | None, None)
Points = checked(check_whole_number, "a whole number in [8, 64]", 8, 64)  # of a box's grid in each direction
SHIFT = (in_range(0.0, 1e5, "s") | None, None)
SHEAR_EXPONENT = (in_range(0.0, 1.0) | None, None)
RANDOM = {  # keys of every turbulent wind
    "direction": DIRECTION,
    "average": (one_of(("rotor", "point")), "rotor"),
    "shear_turbulence": (Flag, True),
    "period": (in_range(60.0, 1e5, "s") | None, None),
    "seed": SEED,
}
GUST = {"speed": MOVING, "start": START, "class": TURBULENCE_CLASS}


class WindKind(NamedTuple):
    """Describes a kind of wind."""

    form: str  # on the command line
    summary: str
    keys: type[Record]


def _kind(form, summary, keys):
    """Return the WindKind with these keys and the shear exponent."""
    return WindKind(form, summary, create_model("Wind", __base__=Record, **keys))


def _uniform(form, summary, keys):
    return _kind(form, summary, keys | {"shear_exponent": SHEAR_EXPONENT})


KINDS = {
    "steady": _uniform(
        "18", "constant wind, with the site's shear",
        {
            "speed": SPEED,
            "direction": DIRECTION,
            "vertical": (in_range(-SPEED_LIMIT, SPEED_LIMIT, "m/s"), 0.0),
        },
    ),
    "ntm": _uniform(
        "ntm:18:B", "normal turbulence model, IEC 61400-1; speed and class A+, A, B or C",
        {"speed": MOVING, "class": TURBULENCE_CLASS, "sigma": NTM_SIGMA} | RANDOM,
    ),
    "etm": _uniform(
        "etm:18:B", "extreme turbulence model, IEC 61400-1",
        {"speed": MOVING, "class": TURBULENCE_CLASS, "turbine_class": TURBINE_CLASS} | RANDOM,
    ),
    "eog": _uniform(
        "eog:18:B", "extreme operating gust, from 60 s on (JSON: start)",
        GUST | {"turbine_class": TURBINE_CLASS},
    ),
    "edc": _uniform("edc:18:B", "extreme direction change", GUST | {"sign": SIGN}),
    "ecd": _uniform(
        "ecd:18", "extreme coherent gust with direction change",
        {"speed": MOVING, "start": START, "sign": SIGN},
    ),
    "ews": _uniform(
        "ews:18:B", "extreme wind shear, vertical or (JSON: orientation) horizontal",
        GUST | {"sign": SIGN, "orientation": (one_of(("vertical", "horizontal")), "vertical")},
    ),
    "ewm": _uniform(
        '{"kind": "ewm"}', "extreme wind of 50 years or one, steady or turbulent: a parked turbine",
        {
            "turbine_class": TURBINE_CLASS, "recurrence": (one_of((50, 1)), 50), "turbulent": (Flag, False),
            "speed": (in_range(*MOVING_SPEEDS) | None, None),  # of a site; None: of the class
        }
        | RANDOM,
    ),
    "steps": _uniform(
        '{"kind": "steps", "speeds": [12, 14], "every": 60}',
        "consecutive wind speeds, each constant for a time, s",
        {
            "speeds": (samples(*SPEEDS), ...),
            "every": (in_range(0.01, 1e6, "s"), ...),
            "ramp": (in_range(1e-3, 1e6, "s"), 0.1),
        },
    ),
    "series": _uniform(
        "wind.csv, wind.parquet", "a table with columns time (s) and speed (m/s)",
        {"time": (samples(-1e6, 1e9, "s"), ...), "speed": (samples(*SPEEDS), ...)}
        | dict.fromkeys(("v", "w", "vertical_shear", "horizontal_shear"), COMPONENT),
    ),
}  # fmt: skip
FIELD_KINDS = {
    "bts": _kind(
        "wind.bts", "TurbSim's full-field box, met by the blades point by point",
        {"path": (FilePath, ...), "periodic": (Flag | None, None), "shift": SHIFT},
    ),
    "mann": _kind(
        "mann:18:B", "full-field Mann turbulence (needs the extra mann)",
        {
            "speed": MOVING, "class": TURBULENCE_CLASS, "sigma": NTM_SIGMA, "seed": SEED,
            "dt": (in_range(0.05, 5.0, "s"), 0.2), "shear_exponent": SHEAR_EXPONENT,
            "model": (one_of(("ntm", "etm", "ewm")), "ntm"), "turbine_class": TURBINE_CLASS,
            "direction": DIRECTION, "points": (Points, 32),
        },
    ),
    "box": _kind(
        "in Python only", "a full-field box from arrays",
        {
            "u": (array(3), ...), "v": (array(3) | None, None), "w": (array(3) | None, None),
            "y": (array(1), ...), "z": (array(1), ...), "dt": (in_range(*BOX_STEPS), ...),
            "speed": MOVING, "periodic": (Flag, False), "shift": SHIFT,
        },
    ),
}  # fmt: skip
ALL_KINDS = KINDS | FIELD_KINDS
BOX = ".bts"  # extension of TurbSim's boxes
OTHER_NAMES = {  # names of kinds in other tools
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
    """Holds a checked wind: the kind and the value of each key (see KINDS)."""

    kind: str
    values: dict = field(default_factory=dict)

    def __getitem__(self, key):
        return self.values[key]


def wind_of(spec: Any) -> Any:
    """Return the wind of a text or path as a number or mapping; other objects unchanged.

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
            hint = f"; for a box of TurbSim use the path of its {BOX} file"
        elif other in ALL_KINDS:
            hint = f"; the kind {other!r} needs further keys, as {other}:18 or a mapping"
        raise InputError(f"wind = {short(text)}: must be {FORMS}{hint}")
    mapping = {"kind": kind, "speed": parse_number(rest[0])}
    return mapping | {"class": rest[1]} if len(rest) == 2 else mapping


def is_wind_file(text: str) -> bool:
    """Return whether a text is the path of a wind file, by its extension."""
    return Path(text).suffix.lower() in (BOX, *UNIFORM, *TABLES) and not text.lstrip().startswith("{")


def unknown_kind(kind):
    """Return the InputError for an unknown kind of wind, with the kind of which it is another tool's name."""
    other = OTHER_NAMES.get(kind.lower()) if isinstance(kind, str) else None
    if other is None:
        return unknown("wind.kind", kind, ALL_KINDS)
    of_a_file = ", and the path of a .bts file can be used as the wind" if other == "bts" else ""
    return InputError(
        f"unknown wind.kind {kind!r}. It is called {other!r} here{of_a_file}. Known: {', '.join(ALL_KINDS)}"
    )


def read_wind(spec):
    """Return the WindSpec of a speed in m/s, a mapping with "kind", a text (wind_of), or a WindSpec.

    Raises: InputError naming the key, its value and what is allowed.
    """
    if isinstance(spec, WindSpec):
        return spec
    spec = wind_of(spec)
    if isinstance(spec, list | tuple | set) or spec is None:
        raise InputError(f"wind = {short(spec)}: must be {FORMS}")
    if not isinstance(spec, dict):
        spec = {"kind": "steady", "speed": check_in_range("wind", spec, *SPEEDS)}
    if "kind" not in spec:
        raise InputError(f"wind.kind is missing: must be one of {', '.join(ALL_KINDS)}")
    kind = spec["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise unknown_kind(kind)
    values = checked_keys(spec)
    _check_together(kind, values)
    return WindSpec(kind, values)


def checked_keys(spec):
    """Return {key: value} of a mapping of a known kind. Raises: InputError with a line per wrong key."""
    keys = ALL_KINDS[spec["kind"]].keys
    record, problems = validate(keys, {str(key): value for key, value in spec.items() if key != "kind"})
    if problems:
        raise InputError("\n".join(f"wind.{problem}" for problem in problems))
    return {key: getattr(record, key) for key in keys.model_fields}


def _check_together(kind, values):
    """Check the rules for combinations of keys. Raises: InputError."""
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
        for key, (_, default) in RANDOM.items():
            if key != "direction" and values[key] != default:
                raise InputError(f"wind.{key} = {values[key]!r}: needs wind.turbulent = True")
