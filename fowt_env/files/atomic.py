"""Files written whole or not at all, so that an interrupted run never leaves half a file."""

import errno
import os
import re
import secrets
import stat
from contextlib import contextmanager
from pathlib import Path

NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)
_LEFTOVER = re.compile(r"\..*-(\d+)-[a-z0-9_]{8}(?:\.[^.]*)?")  # file of `replacing`, its process


@contextmanager
def replacing(path):
    """Path of a temporary file beside `path` that takes its place when the block ends well.

    A file that is replaced leaves its rights to the new one; a link goes on pointing, to the new content.
    Raises: OSError naming the path where there cannot be one, or the disk has no space for it.
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
        if isinstance(error, OSError) and error.errno in NO_SPACE:  # it names nothing, or the temporary file
            raise no_space(error, path) from error
        raise


def no_space(error, path):
    """OSError that names the path which there was no space to write."""
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
