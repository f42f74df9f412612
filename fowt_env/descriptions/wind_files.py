"""Reads uniform wind files of InflowWind (.wnd, .hh) and tables of time and wind speed."""

import re
from pathlib import Path

import numpy as np

from fowt_env.descriptions.files import read_text
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError

UNIFORM = (".wnd", ".hh")
TABLES = (".csv", ".parquet")
COLUMNS = (("Time_[s]", "Wind1VelX_[m/s]"), ("time", "speed"))  # of tables with more than two columns
WIND_COLUMNS = 8
FINEST_TURN = DEGREE  # between two samples of a turning wind
WIND_ROWS = 1_000_000


def read_wind_table(path):
    """Return the wind {"kind": "series", ...} of a table with columns of time (s) and wind speed (m/s).

    path: .csv or .parquet with two columns in that order, or with columns named time and speed, or Time_[s]
    and Wind1VelX_[m/s] as in the table of a run.
    Raises: InputError that names the file and the problem.
    """
    import pandas as pd

    path = Path(path)
    where = f"wind series {str(path)!r}"
    if not path.is_file():
        raise InputError(f"{where}: not found")
    try:
        is_text = path.suffix.lower() == ".csv"
        frame = pd.read_csv(path) if is_text else pd.read_parquet(path.absolute())
    except Exception as error:  # any error of pandas and pyarrow for a broken file
        raise InputError(f"{where}: cannot be read: {error!s:.300}") from None
    named = [list(pair) for pair in COLUMNS if set(pair) <= set(frame.columns)]
    if named:
        frame = frame[named[0]]
    elif frame.shape[1] != 2:
        raise InputError(
            f"{where}: needs columns time and speed (or Time_[s] and Wind1VelX_[m/s]); it has"
            f" {', '.join(map(str, frame.columns)):.200}"
        )
    numeric = frame.select_dtypes("number")
    if numeric.shape[1] != 2:
        raise InputError(f"{where}: {_first_text(frame)}both columns must hold numbers only")
    return {"kind": "series", "time": numeric.iloc[:, 0].to_numpy(), "speed": numeric.iloc[:, 1].to_numpy()}


def _first_text(frame):
    """Return the column, value and row of the first cell of a table that is no number, or ""."""
    import pandas as pd

    wrong = frame.apply(pd.to_numeric, errors="coerce").isna() & frame.notna()
    if not wrong.to_numpy().any():
        return ""
    row, column = np.argwhere(wrong.to_numpy())[0]
    return f"{frame.columns[column]} = {frame.iat[row, column]!r} in row {row + 1}: "


def read_uniform_wind(path):
    """Return the wind {"kind": "series", ...} of a uniform wind file of InflowWind, for build_scene.

    Columns: time (s), horizontal speed (m/s), direction (deg, clockwise seen from above), vertical speed
    (m/s), horizontal linear shear, power-law exponent, vertical linear shear, gust (m/s). The file does
    not contain reference height and length; hub height and rotor diameter are used, as is common. Samples are
    added between rows of different direction, since a series is linear in the components and the file in
    speed and direction (source: OpenFAST, IfW_UniformWind.f90).

    Raises: InputError, also for properties that a series cannot represent: a varying exponent, a gust (not
    subject to the power law) with an exponent, linear shear in wind that is not along x.
    """
    time, speed, direction, vertical, horizontal_shear, exponent, vertical_shear, gust = _wind_rows(path).T
    if np.ptp(exponent) > 0.0:
        raise _refused(path, "the power-law exponent (column 6) varies", "one exponent for all times")
    if exponent[0] != 0.0 and gust.any():
        raise _refused(path, "a gust (column 8) with a power-law exponent (column 6)", "one of them zero")
    if np.abs(direction).max() > 360.0:
        raise _refused(path, "a direction outside one full turn", "directions in [-360, 360] deg")
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
    """Return the (n, 8) finite numbers of a uniform wind file, with increasing times."""
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
