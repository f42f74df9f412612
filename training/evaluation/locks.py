"""One process at a time in a folder."""

import fcntl
import os
from contextlib import contextmanager, suppress
from pathlib import Path

from fowt_env.errors import InputError


@contextmanager
def locked(folder, what, busy):
    """Path of the folder, made where there is none, in which no other such block is while this one runs.

    The lock is the kernel's: it ends with the process that holds it, however that ends. A folder that was
    made for the block goes where the block raises and leaves it empty.
    Raises: InputError "{what}: {busy}" where another block has the folder, or that it cannot be had.
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
            with suppress(OSError):  # what is not empty stays, and so does all above it
                for path in made:
                    path.rmdir()
            raise
    finally:
        os.close(handle)  # and with it the lock
