"""Tables written and read: CSV, Parquet, and OpenFAST's .outb of a time series."""

from pathlib import Path

from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

TABLE_SUFFIXES = (".csv", ".parquet")
SERIES_SUFFIXES = (*TABLE_SUFFIXES, ".outb")  # of a time series, which OpenFAST's format can hold too


def table_path(path, allowed=TABLE_SUFFIXES, what="output file"):
    """`path` as a Path, once its ending is known to be one of those allowed.

    Raises: InputError for another ending.
    """
    path = Path(path)
    if path.suffix.lower() not in allowed:
        *others, last = allowed
        endings = f"{', '.join(others)} or {last}" if others else last
        raise InputError(f"{what} {str(path)!r}: must end with {endings}")
    return path


def write_table(frame, path):
    """The path written: CSV (10 significant digits), Parquet or OpenFAST's .outb (exact), by its ending."""
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


def read_series(path):
    """DataFrame of a time series that write_table wrote, or of OpenFAST's binary output (.outb).

    Raises: InputError if there is no such file, its ending is another, or it is broken.
    """
    path = table_path(path, SERIES_SUFFIXES, "file")
    if path.suffix.lower() != ".outb":
        return read_table(path)
    from fowt_env.files.openfast import read_outb

    return read_outb(path)


def read_table(path):
    """DataFrame of a CSV or Parquet file that write_table wrote.

    Raises: InputError if there is no such file, its ending is another, or it is broken.
    """
    import pandas as pd

    path = table_path(path, what="file")
    if not path.is_file():
        raise InputError(f"file {str(path)!r}: not found")
    try:
        return pd.read_csv(path) if path.suffix.lower() == ".csv" else pd.read_parquet(path.absolute())
    except Exception as error:  # whatever a broken file makes pandas and pyarrow raise
        raise InputError(f"file {str(path)!r} cannot be read: {error!s:.300}") from None
