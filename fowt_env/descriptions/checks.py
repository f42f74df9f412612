"""Checks of single values that several rooms share."""

import math

from fowt_env.errors import InputError


def parse_numbers(text, what):
    """List of numbers from "1,2,5" or "3:25:1" (start:stop:step, stop included)."""
    if ":" in text:
        parts = [_number(part) for part in text.split(":")]
        start, stop, step = parts if len(parts) == 3 else (None, None, None)
        if None in (start, stop, step) or step <= 0.0 or stop < start or (stop - start) / step > 10_000:
            raise InputError(f"{what} = {text!r}: must be START:STOP:STEP with STEP > 0 and STOP >= START")
        return [start + step * i for i in range(math.floor((stop - start) / step + 1e-9) + 1)]
    values = [_number(part) for part in text.split(",") if part.strip()]
    if not values or None in values:
        raise InputError(f"{what} = {text!r}: must be numbers separated by commas, or START:STOP:STEP")
    return values


def _number(text):
    """The finite number that a text means, or None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
