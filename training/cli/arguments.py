"""What users type on the command line, turned into what the library takes."""

import json
from pathlib import Path

from fowt_env.descriptions.checks import parse_number
from fowt_env.errors import InputError
from fowt_env.files.openfast import read_uniform_wind
from fowt_env.files.tables import read_table

SEA_KEYS = {"jonswap": ("Hs", "Tp", "gamma"), "pierson_moskowitz": ("Hs", "Tp"), "regular": ("H", "T")}


def parse_wind(text):
    """What build_scene takes as wind, from "18", "ntm:18:B", JSON, a CSV path, "none".

    Raises: InputError for anything else.
    """
    if text is None or text.strip().lower() == "none":
        return None
    number = parse_number(text)
    if number is not None:
        return number
    if text.lstrip().startswith("{"):
        return _json(text, "wind")
    if Path(text).suffix.lower() in (".csv", ".parquet"):
        return _wind_series(text)
    if Path(text).suffix.lower() in (".wnd", ".hh"):
        return read_uniform_wind(text)
    kind, *rest = text.split(":")
    if not rest or len(rest) > 2 or parse_number(rest[0]) is None:
        allowed = (
            "a speed (18), KIND:SPEED[:CLASS] (ntm:18:B), JSON, a .csv, .parquet, .wnd or .hh file, or none"
        )
        raise InputError(f"wind = {text!r}: must be {allowed}")
    spec = {"kind": kind, "speed": parse_number(rest[0])}
    return spec | {"class": rest[1]} if len(rest) == 2 else spec


def parse_sea(text):
    """What build_scene takes as sea, from a name, "jonswap:7.5:10:3.3", "regular:3:5", JSON, "none"."""
    if text is None or text.strip().lower() in ("none", "still"):
        return None
    if text.lstrip().startswith("{"):
        return _json(text, "sea")
    kind, *rest = text.split(":")
    keys = SEA_KEYS.get(kind)
    if keys is None or not rest:
        return text  # a name or a path: the library knows them
    values = [parse_number(item) for item in rest]
    if None in values or not 2 <= len(values) <= len(keys):
        form = ":".join((kind, *keys))
        raise InputError(f"sea = {text!r}: must be {form} with a number for each")
    return {"kind": kind, **dict(zip(keys, values, strict=False))}


def parse_fault(text):
    """Mapping that simulate takes as a fault, from "grid_loss:100" (kind and time, s) or JSON."""
    if text.lstrip().startswith("{"):
        return _json(text, "fault")
    kind, _, time = text.partition(":")
    if parse_number(time) is None:
        raise InputError(f"fault = {text!r}: must be KIND:TIME with a time in s, or JSON of its keys")
    return {"kind": kind, "time": parse_number(time)}


def parse_protection(text):
    """What simulate takes as protection, from "none", "turbine" or JSON of trips."""
    if text.strip().lower() == "none":
        return None
    return _json(text, "protection") if text.lstrip().startswith("{") else text


def parse_pairs(pairs, what):
    """{key: value} from "key=value" texts (None: none); values are JSON where they can be, else text."""
    result = {}
    for pair in pairs or ():
        key, sign, value = pair.partition("=")
        if not sign or not key:
            raise InputError(f"{what} {pair!r}: must be KEY=VALUE")
        try:
            result[key] = json.loads(value)
        except json.JSONDecodeError:
            result[key] = value
    return result


def _json(text, what):
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{what} = {text!r}: not valid JSON: {error}") from error


def _wind_series(path):
    """Series spec of a table with a time column (s) and a wind-speed column (m/s), named or in that order."""
    frame = read_table(path)
    if "Time_[s]" in frame and "Wind1VelX_[m/s]" in frame:
        frame = frame[["Time_[s]", "Wind1VelX_[m/s]"]]
    elif {"time", "speed"} <= set(frame.columns):
        frame = frame[["time", "speed"]]
    elif frame.shape[1] != 2:
        raise InputError(
            f"wind series {path!r}: needs columns time and speed (or Time_[s] and Wind1VelX_[m/s]);"
            f" it has {', '.join(map(str, frame.columns))}"
        )
    numeric = frame.select_dtypes("number")
    if numeric.shape[1] != 2:
        raise InputError(f"wind series {path!r}: both columns must hold numbers only")
    return {"kind": "series", "time": numeric.iloc[:, 0].to_numpy(), "speed": numeric.iloc[:, 1].to_numpy()}
