"""Parses texts from the command line into arguments of the library."""

import json

from fowt_env.descriptions.checks import parse_number
from fowt_env.descriptions.files import json_text
from fowt_env.errors import InputError


def parse_names(text, separator=","):
    """Return the names in a text as a list; None: None."""
    return None if text is None else [name.strip() for name in text.split(separator) if name.strip()]


def parse_fault(text):
    """Return a fault for simulate from "grid_loss:100" (kind and time, s) or JSON."""
    if text.lstrip().startswith("{"):
        return json_text("fault", text)
    kind, _, time = text.partition(":")
    if parse_number(time) is None:
        raise InputError(f"fault = {text!r}: must be KIND:TIME with a time in s, or JSON of its keys")
    return {"kind": kind, "time": parse_number(time)}


def parse_protection(text):
    """Return a protection for simulate from "none", "turbine" or JSON of trips."""
    if text.strip().lower() == "none":
        return None
    return json_text("protection", text) if text.lstrip().startswith("{") else text


def parse_pairs(pairs, what):
    """Return {key: value} of "key=value" texts (None: {}); a value that is not JSON stays a text."""
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
