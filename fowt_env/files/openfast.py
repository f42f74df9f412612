"""Writes and reads OpenFAST's binary output (.outb), and reads its text output (.out)."""

import os
import re
import struct
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fowt_env.errors import InputError
from fowt_env.files.tables import TIME

# OpenFAST's FileIDs. 3 is double precision, with start and step of the time; the others are packed (16 bits)
WITH_TIME, WITHOUT_TIME, UNCOMPRESSED, WITH_LENGTH = 1, 2, 3, 4
NAME_LENGTH = 10  # characters of a channel name and of a unit with brackets
UNIT = re.compile(r"[(\[]([^()\[\]]*)[)\]]")  # in a line of units; MAP++ has square brackets
EVEN = 1e-6  # largest deviation of a time from the even grid, as a fraction of its step


def write_outb(frame, path, description="fowt_env"):
    """Write a run {OpenFAST channel: values} as binary output for OpenFAST's tools, in double precision.

    frame: DataFrame whose first column is Time_[s], evenly spaced. path: written directly, not atomically.
    Raises: InputError for another frame, or names that are too long for the format.
    """
    if len(frame.columns) < 2 or frame.columns[0] != TIME:
        raise InputError(f".outb: the first column must be {TIME}, with at least one channel after it")
    values = frame.to_numpy(dtype=np.float64)
    time = values[:, 0]
    step = (time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 0.0
    if len(time) < 2 or not np.abs(time - time[0] - step * np.arange(len(time))).max() <= EVEN * step:
        raise InputError(".outb: needs at least two rows at evenly spaced times")
    names, units = zip(*(_name_and_unit(column) for column in frame.columns), strict=True)
    text = description.encode("ascii", "replace")
    with Path(path).open("wb") as file:
        file.write(struct.pack("<hii", UNCOMPRESSED, len(names) - 1, len(time)))
        file.write(struct.pack("<ddi", time[0], step, len(text)) + text)
        for word in (*names, *units):
            file.write(word.ljust(NAME_LENGTH).encode("ascii"))
        file.write(np.ascontiguousarray(values[:, 1:], dtype="<f8").tobytes())


def _name_and_unit(column):
    """Return ("RotSpeed", "(rpm)") for the column "RotSpeed_[rpm]"."""
    match = re.fullmatch(r"([\x21-\x7e]{1,10})_\[([\x20-\x7e]{0,8})\]", str(column))
    if match is None:
        raise InputError(
            f".outb: column {column!r}: must be NAME_[UNIT] in ASCII, at most {NAME_LENGTH} and"
            f" {NAME_LENGTH - 2} characters"
        )
    return match[1], f"({match[2]})"


def read_outb(path):
    """Return the DataFrame of an OpenFAST binary output file; column names as in simulate: RotSpeed_[rpm].

    All four FileIDs are read: 1 (packed times), 2 and 4 (packed values), 3 (double precision, as written by
    write_outb). Values are float64, NaN included; the first column is the time (s).
    Memory: at most some ten times the size of the file, since all counts are checked against that size.
    Raises: InputError naming the file, the byte position and the fault; also for a duplicate channel.
    """
    import pandas as pd

    path = Path(path)
    try:
        if not path.is_file():
            raise InputError(f".outb file {str(path)!r}: no such file")
        with path.open("rb") as file:
            names, values = _outb(_Reader(file, str(path), os.fstat(file.fileno()).st_size))
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f".outb file {str(path)[:200]!r}: cannot be read: {error}") from None
    return pd.DataFrame(values, columns=names)


def read_out(path):
    """Return the DataFrame of an OpenFAST text output file (.out), with columns as read_outb.

    The channel names are the first line that begins with Time; units and values follow.
    Raises: InputError naming the file and the line.
    """
    import pandas as pd

    path = Path(path)
    if not path.is_file():
        raise InputError(f".out file {str(path)!r}: no such file")
    lines = path.read_text(encoding="latin-1").splitlines()
    head = next((i for i, line in enumerate(lines) if line.split()[:1] == ["Time"]), None)
    if head is None or len(lines) < head + 2:
        raise InputError(f".out file {str(path)!r}: no line begins with Time, as that of the channel names")
    names, units = lines[head].split(), UNIT.findall(lines[head + 1])
    if len(units) != len(names):
        raise InputError(
            f".out file {str(path)!r}: line {head + 2}: {len(units)} units of {len(names)} channels"
        )
    rows = []
    for number, line in enumerate(lines[head + 2 :], head + 3):
        try:
            row = [float(word) for word in line.split()]
        except ValueError as error:
            raise InputError(f".out file {str(path)!r}: line {number}: {error}") from None
        if row and len(row) != len(names):
            raise InputError(
                f".out file {str(path)!r}: line {number}: {len(row)} values of {len(names)} channels"
            )
        rows += [row] if row else []
    columns = [f"{name}_[{unit}]" for name, unit in zip(names, units, strict=True)]
    if len(set(columns)) < len(columns):
        raise InputError(
            f".out file {str(path)!r}: channel {Counter(columns).most_common(1)[0][0]!r} occurs twice"
        )
    return pd.DataFrame(np.array(rows).reshape(-1, len(columns)), columns=columns)


class _Reader(NamedTuple):
    """Reads a binary file sequentially, with a check of the remaining length before each read."""

    file: object
    path: str
    size: int  # bytes

    def refuse(self, what):
        """Return an InputError with the current byte position."""
        return InputError(f".outb file {self.path!r}: {what}, before byte {self.file.tell()} of {self.size}")

    def take(self, count, kind, what):
        """Read (count,) little-endian numbers of a numpy type; what: for the message."""
        kind = np.dtype(kind).newbyteorder("<")
        left = self.size - self.file.tell()
        if count < 0 or count * kind.itemsize > left:
            raise self.refuse(f"{what}: {count} x {kind.itemsize} bytes are needed, {left} are left")
        content = self.file.read(count * kind.itemsize)
        if len(content) < count * kind.itemsize:
            raise self.refuse(f"{what}: the file ended while it was read")
        return np.frombuffer(content, dtype=kind)

    def whole(self, kind, what, low):
        """Read one integer >= low."""
        value = int(self.take(1, kind, what)[0])
        if value < low:
            raise self.refuse(f"{what} is {value}: must be at least {low}")
        return value

    def scales(self, count, kind, what):
        """Read (slopes, offsets) (count,), finite and without zero slopes."""
        slope, offset = (self.take(count, kind, f"{word} of {what}") for word in ("slopes", "offsets"))
        if not (np.isfinite(slope).all() and np.isfinite(offset).all() and slope.all()):
            raise self.refuse(f"slopes and offsets of {what} must be finite, and no slope zero")
        return slope.astype(np.float64), offset.astype(np.float64)

    def words(self, count, length, what):
        """Read a list of `count` texts of `length` characters, stripped."""
        content = self.take(count * length, "u1", what)
        if not ((content >= 32) & (content < 127)).all():
            raise self.refuse(f"{what} must be printable ASCII")
        text = content.tobytes().decode("ascii")
        return [text[i : i + length].strip() for i in range(0, len(text), length)]


def _outb(reader):
    """Return (column names, values (n, columns)) of an open .outb file."""
    kind = int(reader.take(1, "i2", "FileID")[0])
    if kind not in (WITH_TIME, WITHOUT_TIME, UNCOMPRESSED, WITH_LENGTH):
        raise reader.refuse(f"FileID is {kind}: must be 1, 2, 3 or 4")
    length = reader.whole("i2", "length of names", 1) if kind == WITH_LENGTH else NAME_LENGTH
    channels = reader.whole("i4", "number of channels", 1)
    rows = reader.whole("i4", "number of time steps", 1)
    if kind == WITH_TIME:
        time_slope, time_offset = reader.scales(1, "f8", "the time")
    else:
        start, step = reader.take(2, "f8", "start and step of the time")
        if not (np.isfinite(start) and np.isfinite(step) and step > 0.0):
            raise reader.refuse(f"time starts at {start:g} s with step {step:g} s: must be finite, step > 0")
    packed = kind != UNCOMPRESSED
    if packed:
        slope, offset = reader.scales(channels, "f4", "the channels")
    reader.take(reader.whole("i4", "length of the description", 0), "u1", "description")
    names = reader.words(channels + 1, length, "channel names")
    units = reader.words(channels + 1, length, "units")
    units = [unit[1:-1] if unit[:1] + unit[-1:] in ("()", "[]") else unit for unit in units]
    columns = [f"{name}_[{unit}]" for name, unit in zip(names, units, strict=True)]
    if len(set(columns)) < len(columns):
        twice = Counter(columns).most_common(1)[0][0]
        raise reader.refuse(f"channel {twice!r} occurs twice")
    size = (4 * rows if kind == WITH_TIME else 0) + rows * channels * (2 if packed else 8)
    if size != (left := reader.size - reader.file.tell()):
        raise reader.refuse(f"{rows} rows of {channels} channels take {size} bytes, {left} are left")
    values = np.empty((rows, channels + 1))
    with np.errstate(over="ignore"):
        if kind == WITH_TIME:
            values[:, 0] = (reader.take(rows, "i4", "times") - time_offset) / time_slope
        else:
            values[:, 0] = start + step * np.arange(rows)
    if not (np.isfinite(values[:, 0]).all() and (np.diff(values[:, 0]) > 0.0).all()):
        raise reader.refuse("the times must be finite and increase")
    content = reader.take(rows * channels, "i2" if packed else "f8", "values").reshape(rows, channels)
    values[:, 1:] = content
    if packed:
        values[:, 1:] -= offset
        values[:, 1:] /= slope
    return columns, values
