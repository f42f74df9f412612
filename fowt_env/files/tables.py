"""Writes and reads tables: CSV, Parquet, and for time series OpenFAST's .outb."""

from pathlib import Path

from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

TABLE_SUFFIXES = (".csv", ".parquet")
SERIES_SUFFIXES = (*TABLE_SUFFIXES, ".outb")  # of a time series
READ_SUFFIXES = (*SERIES_SUFFIXES, ".out")  # of a time series that is read
TIME = "Time_[s]"


def table_path(path, allowed=TABLE_SUFFIXES, what="output file"):
    """Return `path` as a Path after a check of its suffix. Raises: InputError for a suffix not in allowed."""
    path = Path(path)
    if path.suffix.lower() not in allowed:
        *others, last = allowed
        endings = f"{', '.join(others)} or {last}" if others else last
        raise InputError(f"{what} {str(path)!r}: must end with {endings}")
    return path


def write_table(frame, path):
    """Write a table as CSV (10 significant digits), Parquet or .outb (exact), by suffix; return the path."""
    path = table_path(path, SERIES_SUFFIXES)
    with replacing(path) as temporary:
        if path.suffix.lower() == ".csv":
            frame.to_csv(temporary, index=False, float_format="%.10g")
        elif path.suffix.lower() == ".outb":
            from fowt_env.files.openfast import write_outb

            write_outb(frame, temporary)
        else:
            frame.to_parquet(temporary.absolute(), index=False)  # "a:b/c" alone would be read as a URI
    return path


def read_series(path, timed=True):
    """Return the DataFrame of a time series written by write_table, or of OpenFAST's output (.outb, .out).

    timed: whether it must have a column Time_[s] (FAST 7: Time_[sec], renamed) and at least two rows.
    Raises: InputError for a missing, empty or broken file, another suffix, text in a column with a unit, and
    a series without time.
    """
    path = table_path(path, READ_SUFFIXES, "file")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"file {str(path)!r}: is empty (0 bytes)")
    if path.suffix.lower() in TABLE_SUFFIXES:
        table = _of_numbers(read_table(path), path)
    else:
        from fowt_env.files.openfast import read_out, read_outb

        table = read_outb(path) if path.suffix.lower() == ".outb" else read_out(path)
    table = table.rename(columns={"Time_[sec]": TIME})
    if timed and (TIME not in table.columns or len(table) < 2):
        columns = ", ".join(map(str, table.columns))
        found = f"has {len(table)} rows of {columns:.200}"
        raise InputError(f"file {str(path)!r}: needs a column {TIME!r} and at least two rows; {found}")
    return table


def _of_numbers(table, path):
    """Return the table. Raises: InputError for a value of a column with a unit that is no number."""
    import pandas as pd

    for name in (name for name in table.columns if "_[" in str(name)):
        wrong = table[name].notna() & pd.to_numeric(table[name], errors="coerce").isna()
        if wrong.any():
            row = int(wrong.to_numpy().argmax())
            found = f"column {name!r}, row {row + 1}: {table[name].iloc[row]!r}"
            raise InputError(f"file {str(path)!r}: {found} is not a number")
    return table


def read_table(path):
    """Return the DataFrame of a CSV or Parquet file written by write_table.

    Raises: InputError for a missing or broken file, or another suffix.
    """
    import pandas as pd

    path = table_path(path, what="file")
    if not path.is_file():
        raise InputError(f"file {str(path)!r}: not found")
    try:
        return pd.read_csv(path) if path.suffix.lower() == ".csv" else pd.read_parquet(path.absolute())
    except Exception as error:  # a broken file may raise any exception in pandas and pyarrow
        raise InputError(f"file {str(path)!r} cannot be read: {error!s:.300}") from None
