"""What users type on the command line, turned into what the library takes."""

import json

from fowt_env.descriptions.checks import parse_number
from fowt_env.descriptions.sea_state import sea_of
from fowt_env.descriptions.wind import wind_of
from fowt_env.errors import InputError


def parse_names(text):
    """Return the list of the names in a text with commas; None for None."""
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def parse_wind(text):
    """Return a wind for build_scene from a text that wind_of takes; None for None. Raises: InputError."""
    return None if text is None else wind_of(text)


def parse_sea(text):
    """Return a sea for build_scene from a text that sea_of takes; None for None. Raises: InputError."""
    return None if text is None else sea_of(text)


def parse_fault(text):
    """Return a fault for simulate from "grid_loss:100" (kind and time, s) or JSON."""
    if text.lstrip().startswith("{"):
        return _json(text, "fault")
    kind, _, time = text.partition(":")
    if parse_number(time) is None:
        raise InputError(f"fault = {text!r}: must be KIND:TIME with a time in s, or JSON of its keys")
    return {"kind": kind, "time": parse_number(time)}


def parse_protection(text):
    """Return a protection for simulate from "none", "turbine" or JSON of trips."""
    if text.strip().lower() == "none":
        return None
    return _json(text, "protection") if text.lstrip().startswith("{") else text


def parse_pairs(pairs, what):
    """Return {key: value} of "key=value" texts (None: none); a value that is no JSON stays a text."""
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
