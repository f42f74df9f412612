"""Files of OpenFAST: binary output (.outb) written, uniform wind (.wnd, .hh) read."""

import re
import struct
from pathlib import Path

import numpy as np

from fowt_env.errors import InputError
from fowt_env.textfiles import read_text

TIME = "Time_[s]"
# OpenFAST's format 3: double precision, time by its start and step; 2 and 4 would round to 16 bits
UNCOMPRESSED = 3
NAME_LENGTH = 10  # characters of a channel name and of a unit, its brackets included
EVEN = 1e-6  # largest deviation of a time from the even grid, as a share of its step
WIND_COLUMNS = 8
FINEST_TURN = np.radians(1.0)  # between two samples of a turning wind
WIND_ROWS = 1_000_000


def write_outb(frame, path, description="fowt_env"):
    """Write a run {OpenFAST channel: values} as binary output that OpenFAST's tools read, bit for bit.

    frame: DataFrame whose first column is Time_[s], evenly spaced. path: written as it is, not atomically.
    Raises: InputError for another frame, or names that the format has no room for.
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
    """("RotSpeed", "(rpm)") of "RotSpeed_[rpm]"."""
    found = re.fullmatch(r"([\x21-\x7e]{1,10})_\[([\x20-\x7e]{0,8})\]", str(column))
    if found is None:
        raise InputError(
            f".outb: column {column!r}: must be NAME_[UNIT] in ASCII, at most {NAME_LENGTH} and"
            f" {NAME_LENGTH - 2} characters"
        )
    return found[1], f"({found[2]})"


def read_uniform_wind(path):
    """Wind {"kind": "series", ...} of a uniform wind file of InflowWind, as build_scene takes it.

    Columns: time (s), horizontal speed (m/s), direction (deg, clockwise seen from above), vertical speed
    (m/s), horizontal linear shear, power-law exponent, vertical linear shear, gust (m/s). The file does
    not hold its reference height and length: they are taken as hub height and rotor diameter, as is usual.
    Between rows of different direction there are further samples, since a series is linear in the
    components and the file in speed and direction (source: OpenFAST, IfW_UniformWind.f90).

    Raises: InputError, also for what a series cannot hold: an exponent that varies, a gust (which the
    power law spares) with an exponent, a linear shear in wind that is not along x.
    """
    time, speed, direction, vertical, horizontal_shear, exponent, vertical_shear, gust = _wind_rows(path).T
    if np.ptp(exponent) > 0.0:
        raise _refused(path, "the power-law exponent (column 6) varies", "one exponent for all times")
    if exponent[0] != 0.0 and gust.any():
        raise _refused(path, "a gust (column 8) with a power-law exponent (column 6)", "one of them zero")
    if np.abs(direction).max() > 360.0:
        raise _refused(path, "a direction beyond a full turn", "directions in [-360, 360] deg")
    sheared = horizontal_shear.any() or vertical_shear.any()
    if sheared and direction.any():
        raise _refused(path, "linear shear (columns 5, 7) with a direction (column 3)", "one of them zero")
    turns = np.ceil(np.abs(np.diff(np.radians(direction))) / FINEST_TURN).astype(int)
    parts = np.maximum(turns, 1)
    if parts.sum() > WIND_ROWS:
        raise _refused(path, f"needs {parts.sum()} samples", f"at most {WIND_ROWS}")
    fine = np.append(np.repeat(time[:-1], parts), time[-1])
    inside = np.concatenate([np.arange(count) / count for count in parts] or [np.zeros(0)])
    fine[:-1] += inside * np.repeat(np.diff(time), parts)

    def at(values):
        return np.interp(fine, time, values)

    flow, angle = at(speed) + at(gust), np.radians(at(direction))
    along = flow * np.cos(angle)
    if along.min() < 0.0:
        raise _refused(path, "wind from behind the turbine", "a wind along +x, direction within 90 deg")
    return {
        "kind": "series",
        "time": fine,
        "speed": along,
        "v": -flow * np.sin(angle),
        "w": at(vertical),
        "vertical_shear": at(speed * vertical_shear),
        "horizontal_shear": at(speed * horizontal_shear),
        "shear_exponent": float(exponent[0]),
    }


def _refused(path, what, allowed):
    return InputError(f"uniform wind file {str(path)!r}: {what}; must have {allowed}")


def _wind_rows(path):
    """(n, 8) finite numbers of a uniform wind file, its times increasing."""
    rows = []
    for number, line in enumerate(read_text(Path(path), "uniform wind file").splitlines(), 1):
        words = re.split(r"[\s,]+", line.partition("!")[0].strip())
        if words == [""]:
            continue
        try:
            values = [float(word) for word in words[:WIND_COLUMNS]]
        except ValueError:
            raise _refused(path, f"line {number}: {line.strip()[:60]!r}", "numbers only") from None
        if len(values) < WIND_COLUMNS:
            raise _refused(path, f"line {number} has {len(values)} columns", f"{WIND_COLUMNS}")
        if not np.isfinite(values).all():
            raise _refused(path, f"line {number}: {line.strip()[:60]!r}", "finite numbers")
        if rows and not values[0] > rows[-1][0]:
            raise _refused(path, f"line {number}: time {values[0]:g}", "times that increase")
        rows.append(values)
    if not rows:
        raise _refused(path, "no rows", "at least one")
    return np.array(rows)
