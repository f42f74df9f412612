"""Writing results: whole files or none, so that an interrupted run never leaves half a file."""

import errno
import os
import re
import secrets
import stat
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fowt_env.errors import InputError

if TYPE_CHECKING:
    from fowt_env.analysis.linear_model import LinearModel

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)
TABLE_SUFFIXES = (".csv", ".parquet")
_LEFTOVER = re.compile(r"\..*-(\d+)-[a-z0-9_]{8}(?:\.[^.]*)?")  # file of `replacing`, its process
SERIES_SUFFIXES = (*TABLE_SUFFIXES, ".outb")  # of a time series, which OpenFAST's format can hold too


@contextmanager
def replacing(path):
    """Path of a temporary file beside `path` that takes its place when the block ends well.

    A file that is replaced leaves its rights to the new one; a link goes on pointing, to the new content.
    Raises: OSError naming the path where there cannot be one, or the disk has no room for it.
    """
    path = Path(path)
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    name = target.with_name(f".{target.stem}-{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        # a new file's rights are those that the process's mask leaves; what is replaced may be private
        os.close(os.open(name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666 if mode is None else 0o600))
    except OSError as error:  # which names the temporary file
        raise OSError(error.errno, f"cannot be written: {error.strerror}", str(path)) from error
    try:
        yield name
        if mode is not None:
            name.chmod(mode)
        os.replace(name, target)
    except BaseException as error:
        name.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in NO_ROOM:  # it names nothing, or the temporary file
            raise no_room(error, path) from error
        raise


def no_room(error, path):
    """OSError that names the path which there was no room to write."""
    return OSError(error.errno, f"cannot be written: {os.strerror(error.errno)}", str(path))


def is_leftover(path):
    """Whether a file is a temporary one of `replacing`."""
    return _LEFTOVER.fullmatch(Path(path).name) is not None


def remove_leftovers(folder):
    """Remove the temporary files of `replacing` in a folder whose process is gone: it was killed."""
    for path in Path(folder).glob(".*"):
        found = _LEFTOVER.fullmatch(path.name)
        if found and not process_lives(int(found[1])):
            path.unlink(missing_ok=True)


def process_lives(number):
    """Whether a process of this machine has the number."""
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


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
            from fowt_env.files.openfast import write_outb

            write_outb(frame, temporary)
        else:
            frame.to_parquet(temporary.absolute(), index=False)  # "a:b/c" alone would be read as a URI
    return path


def read_table(path):
    """DataFrame of a CSV or Parquet file that write_table wrote.

    Raises: InputError if there is no such file, its ending is another, or it is broken.
    """
    import pandas as pd

    path = table_path(path)
    if not path.is_file():
        raise InputError(f"file {str(path)!r}: not found")
    try:
        return pd.read_csv(path) if path.suffix.lower() == ".csv" else pd.read_parquet(path.absolute())
    except Exception as error:  # whatever a broken file makes pandas and pyarrow raise
        raise InputError(f"file {str(path)!r} cannot be read: {error!s:.300}") from None


def write_mat(model: "LinearModel", path: str | Path) -> Path:
    """The path written: a MATLAB file (version 5) of a LinearModel, SI and radians.

    It holds the model's matrices by their names (A, B and those of outputs where it has them), the cell
    arrays states, inputs and outputs, and the operating point: x0 and u0 in the order of states and inputs
    (a wind speed that there is none of is NaN) and the struct operating_point of its OpenFAST channels.
    In MATLAB: m = load("model.mat"); plant = ss(m.A, m.B, eye(size(m.A)), 0, "StateName", m.states).
    Raises: InputError if the path does not end with .mat.
    """
    import numpy as np
    from scipy.io import savemat

    from fowt_env.analysis.linear_model import STATE_INDEX

    path = Path(path)
    if path.suffix.lower() != ".mat":
        raise InputError(f"output file {str(path)!r}: must end with .mat")
    point: Any = model.point  # an OperatingPoint
    wind = np.nan if point.wind_speed is None else point.wind_speed
    content = {name: getattr(model, name) for name in "ABCDEF" if hasattr(model, name)}
    for name in ("states", "inputs", "outputs"):
        if hasattr(model, name):
            content[name] = np.array(getattr(model, name), dtype=object)
    content |= {
        "x0": point.state[list(STATE_INDEX)][:, None],
        "u0": np.array([*point.command, wind])[:, None],
        "operating_point": dict(point),
    }
    with replacing(path) as temporary:
        savemat(temporary, content, appendmat=False, oned_as="column")
    return path
