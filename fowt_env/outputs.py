"""Writing results: whole files or none, so that an interrupted run never leaves half a file."""

import os
import tempfile
from contextlib import contextmanager
from pathlib import Path

from fowt_env.errors import InputError

TABLE_SUFFIXES = (".csv", ".parquet")
SERIES_SUFFIXES = (*TABLE_SUFFIXES, ".outb")  # of a time series, which OpenFAST's format can hold too


@contextmanager
def replacing(path):
    """Path of a temporary file beside `path` that takes its place when the block ends well."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    try:
        yield Path(name)
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _umask():
    """The process's file mode mask (reading it means setting it for an instant)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def table_path(path, allowed=TABLE_SUFFIXES):
    """`path` as a Path, once its ending is known to be one of those allowed.

    Raises: InputError for another ending.
    """
    path = Path(path)
    if path.suffix.lower() not in allowed:
        raise InputError(f"output file {str(path)!r}: must end with {' or '.join(allowed)}")
    return path


def write_table(frame, path):
    """The path written: CSV (10 significant digits), Parquet or OpenFAST's .outb (exact), by its ending."""
    path = table_path(path, SERIES_SUFFIXES)
    with replacing(path) as temporary:
        if path.suffix.lower() == ".csv":
            frame.to_csv(temporary, index=False, float_format="%.10g")
        elif path.suffix.lower() == ".outb":
            from fowt_env.openfast_files import write_outb

            write_outb(frame, temporary)
        else:
            frame.to_parquet(temporary, index=False)
    return path


def read_table(path):
    """DataFrame of a CSV or Parquet file that write_table wrote.

    Raises: InputError if there is no such file or its ending is another.
    """
    import pandas as pd

    path = table_path(path)
    if not path.is_file():
        raise InputError(f"file {str(path)!r}: not found")
    return pd.read_csv(path) if path.suffix.lower() == ".csv" else pd.read_parquet(path)
