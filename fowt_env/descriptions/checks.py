"""Checks single values and builds the message about a value that cannot be used.

A message is `key = value: must be ...`, with the allowed range in words.
"""

import math
from pathlib import Path

import numpy as np

from fowt_env.errors import InputError, did_you_mean


def plain_number(value):
    """Return a scalar of numpy or the like as a built-in Python number, as the strict float type requires."""
    return value.item() if getattr(value, "ndim", None) == 0 else value


def is_number(value):
    """Return whether a value is a finite number that fits a float, and not a bool."""
    value = plain_number(value)
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= 1e300


def is_whole(value):
    """Return whether a value is of an integer type, and not a bool."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def short(value):
    """Return the repr of a value, shortened for messages."""
    try:
        text = repr(plain_number(value))
    except ValueError:  # an integer of more digits than Python prints
        text = "a very large whole number"
    return text if len(text) <= 60 else text[:57] + "..."


def refusal(key, value, allowed):
    """Return the InputError for a value that is not allowed; allowed: the range in words."""
    return InputError(f"{key} = {short(value)}: must be {allowed}")


def interval(low, high, low_open, high_open, noun="a number"):
    """Return a range in words, such as "a number > 0" or "a finite number"."""
    above = f"{'>' if low_open else '>='} {low:g}" if low > -math.inf else ""
    below = f"{'<' if high_open else '<='} {high:g}" if high < math.inf else ""
    if not (above or below):
        return noun.replace("a ", "a finite ", 1)
    return f"{noun} {' and '.join(part for part in (above, below) if part)}"


def check_number(
    key, value, low=-math.inf, high=math.inf, *, low_open=False, high_open=False, infinite=False, allowed=None
):
    """Return the value as a float. Raises: InputError unless it is a number from low to high.

    low_open, high_open   whether that limit itself is excluded
    infinite              whether infinity is allowed
    allowed               the range in words, in place of "a number in [low, high]"
    """
    good = is_number(value) or infinite and isinstance(value, float) and math.isinf(value)
    if good:
        good = (low < value if low_open else low <= value) and (value < high if high_open else value <= high)
    if not good:
        if allowed is None and math.isfinite(low) and math.isfinite(high):
            ends = "(" if low_open else "[", ")" if high_open else "]"
            allowed = f"a number in {ends[0]}{low:g}, {high:g}{ends[1]}"
        raise refusal(key, value, allowed or interval(low, high, low_open, high_open))
    return float(value)


def check_whole_number(key, value, low=None, high=None):
    """Return the value as an int. Raises: InputError unless it is whole, low to high (None: no limit)."""
    good = is_whole(value) and (low is None or low <= value) and (high is None or value <= high)
    if not good:
        allowed = "a whole number" if low is None else f"a whole number >= {low}"
        raise refusal(key, value, allowed if high is None else f"a whole number from {low} to {high}")
    return int(value)


def check_pair(key, value, low, high):
    """Return an ordered pair (low, high) of numbers in a range. Raises: InputError."""
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise refusal(key, value, "a pair (low, high)")
    first, last = (check_number(key, number, low, high) for number in value)
    if first > last:
        raise InputError(f"{key} = {short(value)}: the low end must not exceed the high end")
    return first, last


def check_in_range(key, value, low, high, unit=""):
    """Return the value as a float. Raises: InputError unless it is a number in [low, high], with its unit."""
    return check_number(key, value, low, high, allowed=f"a number in [{low:g}, {high:g}] {unit}".rstrip())


def check_choice(key, value, choices):
    """Return the choice that equals a name or number, ignoring case. Raises: InputError."""
    plain = plain_number(value)
    folded = plain.upper() if isinstance(plain, str) else plain
    for choice in choices if isinstance(plain, str | int | float) and not isinstance(plain, bool) else ():
        if folded == (choice.upper() if isinstance(choice, str) else choice):
            return choice
    hint = did_you_mean(value, choices) if isinstance(value, str) else ""
    raise refusal(key, value, f"one of {', '.join(map(str, choices))}{'.' * bool(hint)}{hint}")


def check_flag(key, value):
    """Return the value as a bool. Raises: InputError unless it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise refusal(key, value, "True or False")
    return bool(value)


def check_path(key, value):
    """Return the value as a Path, with ~ expanded. Raises: InputError."""
    if not isinstance(value, str | Path):
        raise refusal(key, value, "a path")
    return Path(value).expanduser()


def check_samples(key, value, low, high, unit):
    """Return a (n,) float64 copy of a list or array of numbers in [low, high], n > 0. Raises: InputError."""
    try:
        values = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise refusal(key, value, "a list of numbers") from None
    if values.ndim != 1 or values.size == 0:
        raise InputError(f"{key} has shape {values.shape}: must be a list of at least one number, shape (n,)")
    wrong = np.flatnonzero(~((values >= low) & (values <= high)))
    if wrong.size:
        where = f"{key}[{wrong[0]}] = {values[wrong[0]]}"
        raise InputError(f"{where}: must be in [{low:g}, {high:g}] {unit}")
    return values


def check_array(key, value, axes):
    """Return an array of finite numbers, float32 with several axes, else float64. Raises: InputError."""
    try:
        values = np.asarray(value, dtype=np.float32 if axes > 1 else np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{key}: must be an array of numbers with {axes} axes") from None
    if values.ndim != axes or values.size == 0 or not np.isfinite(values).all():
        raise InputError(f"{key} has shape {values.shape}: must be finite numbers with {axes} axes")
    return values


def check_one_of(key, value, choices):
    """Return the value. Raises: InputError unless it is one of the choices."""
    if value not in tuple(choices):  # a tuple, as the value may be unhashable
        raise refusal(key, value, f"one of {', '.join(map(str, choices))}")
    return value


def parse_names(text):
    """Return the list of names in a comma-separated text."""
    return [name.strip() for name in text.split(",") if name.strip()]


def parse_numbers(text, what):
    """Return the numbers of "1,2,5" or "3:25:1" (start:stop:step, stop included; default step 1)."""
    if ":" in text:
        parts = [parse_number(part) for part in text.split(":")]
        parts = [*parts, 1.0] if len(parts) == 2 else parts
        start, stop, step = parts if len(parts) == 3 else (None, None, None)
        if None in (start, stop, step) or step <= 0.0 or stop < start or (stop - start) / step > 10_000:
            raise InputError(f"{what} = {text!r}: must be START:STOP[:STEP] with STEP > 0 and STOP >= START")
        return [start + step * i for i in range(math.floor((stop - start) / step + 1e-9) + 1)]
    values = [parse_number(part) for part in text.split(",") if part.strip()]
    if not values or None in values:
        raise InputError(f"{what} = {text!r}: must be numbers separated by commas, or START:STOP[:STEP]")
    return values


def parse_whole_numbers(text, what):
    """Return the whole numbers of a text in the format of parse_numbers. Raises: InputError."""
    values = parse_numbers(text, what)
    if any(value != int(value) for value in values):
        raise InputError(f"{what} = {text!r}: must be whole numbers")
    return [int(value) for value in values]


def parse_number(text):
    """Return the finite number in a text, or None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
