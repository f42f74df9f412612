"""Locates the user's folders of compiled kernels, wind boxes and configuration, and checks their owner."""

import os
import stat
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path

PRIVATE = 0o700
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def user_folder(own, base, usual):
    """Return the folder in the environment variable `own`, else $base/fowt_env, else ~/usual/fowt_env.

    A leading "~" is the home folder. A relative path in `own` starts at the working folder; in `base` a
    relative path is ignored, as the XDG specification requires. None for a user without a home folder.
    """
    custom, shared = os.environ.get(own), os.environ.get(base)
    try:
        if custom:
            return Path(custom).expanduser().absolute()
        if shared and Path(shared).is_absolute():
            return Path(shared) / "fowt_env"
        return Path.home() / usual / "fowt_env"
    except (RuntimeError, OSError):  # no home folder, or the working folder was removed
        return None


def cache_root():
    """Return the folder of reproducible files (FOWT_CACHE_DIR, else the user's cache folder), or None."""
    return user_folder("FOWT_CACHE_DIR", "XDG_CACHE_HOME", ".cache")


def make_private(folder):
    """Create a folder and its missing parents with access for this user alone, whatever the umask.

    Raises: OSError if a folder cannot be created.
    """
    folder = Path(folder)
    if not folder.is_dir():
        make_private(folder.parent)
        folder.mkdir(mode=PRIVATE, exist_ok=True)


@contextmanager
def replaced_privately(path):
    """Return a context with a binary file, private to the user, which replaces the file at path on exit."""
    folder, name = os.path.split(path)
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=f"{name}.tmp.")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise


def distrust(path, kind=stat.S_ISDIR):
    """Return why a path may have been written by someone other than this user or root; "" if not possible.

    The owner of a parent folder can replace the path, but not by a file that belongs to this user.
    """
    status = os.lstat(path)
    if not kind(status.st_mode):
        return "is a symbolic link" if stat.S_ISLNK(status.st_mode) else "is not of the right kind"
    if status.st_uid not in (0, os.geteuid()):
        return f"belongs to user {status.st_uid}"
    if status.st_mode & OTHERS_WRITE:
        return f"can be written by others (mode {stat.S_IMODE(status.st_mode):04o})"
    return ""
