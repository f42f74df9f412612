"""Provides the base of all descriptions: strict frozen records, units of files, and precise error messages.

A problem is one line of text: key, value and allowed range. Keys are dotted paths as in the file.
"""

import math
import types
import typing
from typing import Annotated

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from fowt_env.descriptions.checks import (
    check_array,
    check_choice,
    check_flag,
    check_in_range,
    check_path,
    check_samples,
    check_whole_number,
    interval,
    is_number,
    plain_number,
    short,
)
from fowt_env.descriptions.files import raise_problems, read_toml
from fowt_env.descriptions.units import FILE_UNITS
from fowt_env.errors import did_you_mean

# Renamed keys: old name: new name.
RENAMED = {"designed_on": "nominal_plant"}

# Tables that files may contain instead of a field: key in the file: field.
OTHER_FORMS = {"mooring": "lines"}


def bounded(**limits):
    return Annotated[float, BeforeValidator(plain_number), Field(strict=True, allow_inf_nan=False, **limits)]


def _float_array(value):
    """Return a (n,) float64 copy of a list or array of finite numbers."""
    try:
        array = np.array(value)
    except (ValueError, TypeError):  # a ragged list, or not a list
        array = np.array(None)
    if array.dtype.kind not in "iuf" or array.ndim != 1 or not np.isfinite(array).all():
        raise PydanticCustomError("no_array", "must be a list of finite numbers")
    return array.astype(np.float64)


KEY = "\0"  # placeholder of the key in messages of checks


class Allowed(typing.NamedTuple):
    """Describes the allowed values of a checked field in words."""

    text: str


def checked(check, allowed, *arguments):
    """Return the annotated type of a field checked by check(key, value, *arguments) of checks.py."""
    return Annotated[
        typing.Any, BeforeValidator(lambda value: check(KEY, value, *arguments)), Allowed(allowed)
    ]


def in_range(low, high, unit=""):
    """Return the annotated type of a number within [low, high]."""
    return checked(check_in_range, f"a number in [{low:g}, {high:g}] {unit}".rstrip(), low, high, unit)


def one_of(choices):
    """Return the annotated type of one of several names or numbers; upper and lower case are equal."""
    return checked(check_choice, f"one of {', '.join(map(str, choices))}", choices)


def samples(low, high, unit):
    """Return the annotated type of a (n,) float64 array of at least one number within [low, high]."""
    return checked(check_samples, f"a list of numbers in [{low:g}, {high:g}] {unit}", low, high, unit)


def array(axes):
    """Return the annotated type of an array of finite numbers with this many axes."""
    return checked(check_array, f"an array of numbers with {axes} axes", axes)


Flag = checked(check_flag, "True or False")
Seed = checked(check_whole_number, "a whole number >= 0", 0)
FilePath = checked(check_path, "a path")
Positive = bounded(gt=0)
NonNegative = bounded(ge=0)
Finite = bounded()
Position = bounded(ge=-1e5, le=1e5)  # m, small enough for a finite square times a mass
Fraction = bounded(gt=0, le=1)
FloatArray = Annotated[np.ndarray, BeforeValidator(_float_array)]
NumberOrArray = Annotated[
    typing.Any, BeforeValidator(lambda value: float(value) if is_number(value) else _float_array(value))
]


class Record(BaseModel):
    """Provides the base of all descriptions: frozen, no unknown keys, no implicit type conversion."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    def _problems(self):
        """Yield a line for each inconsistency between fields."""
        return ()

    @model_validator(mode="after")
    def _checked(self):
        if problems := "\n".join(self._problems()):
            raise ValueError(problems)
        return self


# --------------------------------------------------------------------------- units


def to_si(data, problems, path=()):
    """Return (data in SI units, {path in SI names: (path in the file, value there)}) of nested TOML data.

    Only the keys of FILE_UNITS are converted; other values than numbers are rejected by validation.
    """
    converted, origin = {}, {}
    for key, value in data.items():
        field, factor = FILE_UNITS.get(key, (key, None))
        here = (*path, field)
        if factor is not None and field in data:
            problems.append(f"{dotted((*path, key))}: given twice, also as {field!r}; allowed: one of them")
            continue
        if factor is not None:
            origin[here] = ((*path, key), value)
            value = _scaled(value, factor)
        elif isinstance(value, dict):
            value, below = to_si(value, problems, here)
            origin.update(below)
        converted[field] = value
    return converted, origin


def _scaled(value, factor):
    if isinstance(value, list):
        return [_scaled(item, factor) for item in value]
    if is_number(value):
        return value * factor
    return value


# --------------------------------------------------------------------------- validation


def validate(model, data, origin=None):
    """Return (record, []) of a pydantic model, or (None, problems) with one line per wrong value."""
    try:
        return model.model_validate(data), []
    except ValidationError as error:
        items = error.errors(include_url=False)
        return None, [line for item in items for line in _problem(model, item, origin or {})]


def checked_record(model, data, where):
    """Return the record of a pydantic model. Raises: InputError that names `where` and every wrong value."""
    record, problems = validate(model, data)
    raise_problems(where, problems)
    return record


def checked_entries(model, path, kind, table):
    """Return {name: record} of a table of tables in a TOML file. Raises: InputError."""
    records, problems = {}, []
    for name, entry in read_toml(path, kind)[table].items():
        records[name], wrong = validate(model, {"name": name, **entry})
        problems += [f"{table}.{name}: {problem}" for problem in wrong]
    raise_problems(f"{kind} file {str(path)!r}", problems)
    return records


def _problem(model, item, origin):
    """Return the problem lines of one entry of pydantic's ValidationError.errors()."""
    loc = tuple(part for part in item["loc"] if part != "[key]")
    shown, value = loc, item["input"]
    for length in range(len(loc), 0, -1):
        if loc[:length] in origin:
            shown, whole = origin[loc[:length]]
            shown = (*shown, *loc[length:])
            value = _element(whole, loc[length:], value)
            break
    key = dotted(shown)
    kind = item["type"]
    if kind == "missing":
        named = [name for name, (field, _) in FILE_UNITS.items() if field == loc[-1]]
        alias = f" (or {named[0]})" if named else ""
        return [f"{key}{alias} is missing: must be {allowed(model, loc)}"]
    if kind == "extra_forbidden":
        return [unknown_key(key, shown[-1], _fields_at(model, loc[:-1]))]
    if kind == "value_error":
        if KEY in (text := str(item["ctx"]["error"])):
            return [text.replace(KEY, key)]
        return [f"{key}: {line}" if key else line for line in text.splitlines()]
    close = ""
    if isinstance(value, str) and kind == "literal_error":
        options = [option.strip("'") for option in allowed(model, loc).removeprefix("one of ").split(", ")]
        close = did_you_mean(value, options)
    given = f"{key} = {short(value)}" if key else short(value)  # the whole record has no key
    return [f"{given}: must be {allowed(model, loc)}.{close}".rstrip(".")]


def unknown_key(key, name, known):
    """Return the problem line for an unknown key, with the nearest known key or the new name."""
    if name in RENAMED:
        elsewhere = "" if RENAMED[name] in known else f", which is no key here. Allowed: {', '.join(known)}"
        return f"{key}: is called {RENAMED[name]} now{elsewhere}"
    return f"{key}: unknown key.{did_you_mean(name, known)} Allowed: {', '.join(known)}"


def _fields_at(model, loc):
    """Return the names of the keys allowed in the table at loc, including those of FILE_UNITS."""
    here, _ = _type_at(model, loc)
    if not (isinstance(here, type) and issubclass(here, BaseModel)):
        return []
    fields = list(here.model_fields)
    named = [name for name, (field, _) in FILE_UNITS.items() if field in fields]
    return sorted(fields + named + [key for key, field in OTHER_FORMS.items() if field in fields])


def _unwrapped(kind, metadata):
    """Return (type, constraints) without Annotated and Optional."""
    while True:
        origin = typing.get_origin(kind)
        if origin is typing.Annotated:
            kind, *more = typing.get_args(kind)
            for entry in more:
                metadata = [*metadata, *getattr(entry, "metadata", [entry])]
        elif origin in (typing.Union, types.UnionType):
            kind = next(arg for arg in typing.get_args(kind) if arg is not type(None))
        else:
            return kind, metadata


def _type_at(model, loc):
    """Return (type, constraints) of the field at loc; (None, []) if the model has no such field."""
    kind, metadata = model, []
    for part in loc:
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            field = kind.model_fields.get(part)
            if field is None:
                return None, []
            kind, metadata = _unwrapped(field.annotation, list(field.metadata))
            continue
        arguments = typing.get_args(kind)
        if typing.get_origin(kind) is dict:
            keys = typing.get_args(arguments[0])  # of a Literal; empty for str
            if keys and part not in keys:
                return arguments[0], []
            kind, metadata = _unwrapped(arguments[1], [])
        elif typing.get_origin(kind) is tuple:
            index = 0 if arguments[-1] is Ellipsis else min(part, len(arguments) - 1)
            kind, metadata = _unwrapped(arguments[index], [])
        else:
            return None, []
    return kind, metadata


def allowed(model, loc):
    """Return the allowed values of the field at loc of a pydantic model: "a number > 0", "a table" ..."""
    kind, metadata = _type_at(model, loc)
    for entry in metadata:
        if isinstance(entry, Allowed):
            return entry.text
    if kind in (float, int):
        low, high, low_open, high_open = -math.inf, math.inf, True, True
        for entry in metadata:
            for name in ("ge", "gt"):
                if (limit := getattr(entry, name, None)) is not None:
                    low, low_open = limit, name == "gt"
            for name in ("le", "lt"):
                if (limit := getattr(entry, name, None)) is not None:
                    high, high_open = limit, name == "lt"
        return interval(low, high, low_open, high_open, "a number" if kind is float else "a whole number")
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return "one of " + ", ".join(map(repr, arguments))
    if origin in (list, tuple):
        count = "" if origin is list or arguments[-1] is Ellipsis else f"{len(arguments)} "
        return f"a list of {count}{'numbers' if _unwrapped(arguments[0], [])[0] is float else 'entries'}"
    words = {
        str: "text",
        np.ndarray: "a list of finite numbers",
        typing.Any: "a finite number or, for components, a list of finite numbers",
    }
    return words.get(kind, "a table")


def dotted(path):
    """Return a key as written in the file; list positions count from 1."""
    return ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in path)


def _element(whole, path, default):
    for part in path:
        try:
            whole = whole[part]
        except (KeyError, IndexError, TypeError):
            return default
    return whole
