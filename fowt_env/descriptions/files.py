"""Reads and checks TOML, JSON and CSV files; any problem becomes an InputError that names the file."""

import csv
import io
import json
import math
import re
import tomllib
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fowt_env.descriptions.checks import interval, short
from fowt_env.errors import NEAREST, InputError, did_you_mean, nearest

DATA = Path(__file__).parents[1] / "data"
MAX_BYTES = 5_000_000  # a description has a few kB; a much larger file is not one
MAX_LISTED = 20  # problems listed in one message
MOST_NAMED = 12  # most names listed in full; of more names the NEAREST are listed
MAX_DEPTH = 32  # parts of a dotted key; the time of tomllib grows with their square
_KEY_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_DEEP_KEY = re.compile(rf"(?m)(?:^|[\[{{,])[ \t]*{_KEY_PART}(?:[ \t]*\.[ \t]*{_KEY_PART}){{{MAX_DEPTH}}}")


def read_text(path, kind, largest=MAX_BYTES, fallback=None):
    """Return the text of a file of at most `largest` bytes; kind ("platform" ...) is for messages.

    fallback: encoding of a file that is not UTF-8; None: such a file is an InputError.
    """
    try:
        if not path.exists():
            raise InputError(f"{kind} file {str(path)!r} does not exist")
        if not path.is_file():
            raise InputError(f"{kind} file {str(path)!r} is not a regular file")
        size = path.stat().st_size
        if size > largest:
            raise InputError(f"{kind} file {str(path)!r} has {size} bytes; allowed: at most {largest}")
        content = path.read_bytes()
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if fallback is not None:
            return content.decode(fallback)
        where = f"{error.reason} at byte {error.start}"
        raise InputError(f"{kind} file {str(path)!r} is not UTF-8 text: {where}") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{kind} file {str(path)[:200]!r} cannot be read: {error}") from None


def read_toml(path, kind):
    """Return the contents of a TOML file as nested dicts."""
    text = read_text(path, kind)
    deep = _DEEP_KEY.search(text)
    if deep:
        line = text.count("\n", 0, deep.start()) + 1
        raise InputError(f"{kind} file {str(path)!r}: line {line}: a key of more than {MAX_DEPTH} parts")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{kind} file {str(path)!r} is not valid TOML: {error}") from None


def parse_json(text):
    """Return the value of a JSON text with finite numbers only. Raises: ValueError."""
    try:
        return json.loads(text, parse_constant=_finite, parse_float=_finite)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def json_text(where, text):
    """Return the value of a JSON text. Raises: InputError that names `where` and the error."""
    try:
        return parse_json(text)
    except ValueError as error:
        raise InputError(f"{where} = {short(text)}: not valid JSON: {error}") from None


def _finite(text):
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is not a JSON number")
    return value


def read_table(path, kind, columns, optional=()):
    """Return the rows of a CSV file with these columns, in any order: [(line number, dict of strings)].

    optional: further columns that the file may have.

    Lines starting with # and empty lines are skipped. Wrong columns, ragged or missing rows are errors.
    """
    lines = [
        (number, line)
        for number, line in enumerate(io.StringIO(read_text(path, kind), newline=None), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    where = f"{kind} file {str(path)!r}"
    try:
        cells = [[cell.strip() for cell in row] for row in csv.reader(line for _, line in lines)]
    except csv.Error as error:
        raise InputError(f"{where} is not valid CSV: {error}") from None
    expected = ", ".join(columns)
    if not cells:
        raise InputError(f"{where} is empty; expected the columns {expected} and at least one row")
    if len(set(cells[0])) < len(cells[0]) or set(cells[0]) - set(optional) != set(columns) - set(optional):
        raise InputError(f"{where}: columns are {', '.join(cells[0])[:200]}; expected {expected}")
    if len(cells) == 1:
        raise InputError(f"{where} has no rows below its header; expected the columns {expected}")
    if len(cells) != len(lines):
        raise InputError(f"{where}: a quoted cell runs over several lines; allowed: one row per line")
    rows = []
    for (number, _), row in zip(lines[1:], cells[1:], strict=True):
        if len(row) != len(cells[0]):
            raise InputError(f"{where}: line {number} has {len(row)} cells; expected {', '.join(cells[0])}")
        rows.append((number, dict(zip(cells[0], row, strict=True))))
    return rows


def column(rows, name, problems, minimum=-math.inf, maximum=math.inf, *, open_ends=True, increasing=False):
    """Return the (n,) float64 values of a CSV column; append a problem for each value out of range.

    open_ends: the limits themselves are excluded. increasing: each value must exceed the previous one.
    """
    values = np.full(len(rows), np.nan)
    allowed = interval(minimum, maximum, open_ends, open_ends)
    for i, (number, row) in enumerate(rows):
        try:
            value = float(row[name])
        except ValueError:
            value = math.nan
        inside = minimum < value < maximum if open_ends else minimum <= value <= maximum
        if not (math.isfinite(value) and inside):
            problems.append(f"line {number}: {name} = {row[name][:40]}: must be {allowed}")
        elif increasing and i > 0 and value <= values[i - 1]:
            problems.append(f"line {number}: {name} = {row[name][:40]}: must increase")
        values[i] = value
    return values


def raise_problems(where, problems):
    """Raise one InputError that lists the problems of `where` (a file), if there are any."""
    if not problems:
        return
    shown = problems[:MAX_LISTED]
    more = [f"... and {len(problems) - MAX_LISTED} more"] if len(problems) > MAX_LISTED else []
    if len(problems) == 1:
        raise InputError(f"{where}: {problems[0]}")
    raise InputError("\n  ".join([f"{where}: {len(problems)} problems", *shown, *more]))


@contextmanager
def noted(problems, prefix=""):
    """Return a context that appends an InputError raised inside to the problems."""
    try:
        yield
    except InputError as error:
        problems.append(f"{prefix}{error}")


def locate(kind, name_or_path, known, builtin=None, folder=Path(), listed=None, also=""):
    """Return the file of a built-in name (builtin(name) -> Path), or of a path relative to a folder.

    listed: the command that prints the names, for messages; also: allowed forms other than name and path.
    """
    if isinstance(name_or_path, str) and name_or_path in known:
        return builtin(name_or_path)
    if not isinstance(name_or_path, (str, Path)):
        raise InputError(f"{kind} = {short(name_or_path)}: must be a built-in name or a path to a .toml file")
    text = str(name_or_path)
    if isinstance(name_or_path, Path) or "/" in text or "\\" in text or text.lower().endswith(".toml"):
        try:
            return folder / Path(text).expanduser()
        except RuntimeError:  # ~user that does not exist
            return folder / text
    names = ", ".join(known)
    if len(known) > MOST_NAMED:
        near = nearest(text, known, NEAREST, cutoff=0.0)
        printed = "" if listed is None else f", all by `{listed}`"
        names = f"one of {len(known)} names (nearest: {', '.join(near)}{printed})"
    allowed = ", ".join(part for part in (names, also, "or a path to a .toml file") if part)
    what = f"unknown {kind.replace('_', ' ')} {short(text)}.{did_you_mean(text, known, 3)}"
    raise InputError(f"{what} Allowed: {allowed}")
