"""Locks a folder, so that one process at a time uses it."""

import fcntl
import os
from contextlib import contextmanager, suppress
from pathlib import Path

from fowt_env.errors import InputError


@contextmanager
def locked(folder, what, busy):
    """Lock a folder (created if missing) against other processes and blocks; yield its path.

    The operating system releases the lock when its process ends, also after a crash. If the block raises, the
    folders created are removed if they are empty.
    Raises: InputError "{what}: {busy}" if another block has locked the folder, or if it cannot be locked.
    """
    folder = Path(folder)
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        why = "is a file" if folder.is_file() else f"cannot be written: {error.strerror}"
        raise InputError(f"{what}: {why}") from None
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{what}: {busy}") from None
        except OSError as error:  # a file system without locks
            raise InputError(f"{what}: cannot be locked: {error.strerror}") from None
        try:
            yield folder
        except BaseException:
            with suppress(OSError):  # a folder that is not empty, and its parents
                for path in made:
                    path.rmdir()
            raise
    finally:
        os.close(handle)  # releases the lock
