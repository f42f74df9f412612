"""Writes files atomically, so that an interrupted run never leaves a partial file."""

import errno
import os
import re
import secrets
import stat
from contextlib import contextmanager
from pathlib import Path

NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)
_LEFTOVER = re.compile(r"\..*-(\d+)-[a-z0-9_]{8}(?:\.[^.]*)?")  # temporary file of `replacing`: process id


@contextmanager
def replacing(path):
    """Yield the path of a temporary file next to `path`, which replaces `path` if the block succeeds.

    The new file keeps the permissions of a replaced file; a symbolic link is kept and its target replaced.
    Raises: OSError naming the path if it cannot be created, or the disk is full.
    """
    path = Path(path)
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    name = target.with_name(f".{target.stem}-{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        # a new file gets the permissions of the umask; a replaced file may be private
        os.close(os.open(name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666 if mode is None else 0o600))
    except OSError as error:  # names the temporary file
        raise OSError(error.errno, f"cannot be written: {error.strerror}", str(path)) from error
    try:
        yield name
        if mode is not None:
            name.chmod(mode)
        os.replace(name, target)
    except BaseException as error:
        name.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in NO_SPACE:  # names no file, or the temporary file
            raise no_space(error, path) from error
        raise


def no_space(error, path):
    """Return an OSError naming the path that could not be written for lack of space."""
    return OSError(error.errno, f"cannot be written: {os.strerror(error.errno)}", str(path))


def is_leftover(path):
    """Return whether a file is a temporary file of `replacing`."""
    return _LEFTOVER.fullmatch(Path(path).name) is not None


def remove_leftovers(folder):
    """Remove temporary files of `replacing` in a folder that killed processes left behind."""
    for path in Path(folder).glob(".*"):
        match = _LEFTOVER.fullmatch(path.name)
        if match and not process_lives(int(match[1])):
            path.unlink(missing_ok=True)


def process_lives(number):
    """Return whether a process with this id runs on this machine."""
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
