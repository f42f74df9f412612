"""The user's folders of compiled kernels, wind boxes and configuration: where, and whose they must be."""

import os
import stat
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path

PRIVATE = 0o700
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def user_folder(own, base, usual):
    """Return the folder that the variable own names; else fowt_env in that of base, or in usual at home.

    A "~" at the beginning is the home folder. A path that is not absolute begins at the working folder; in
    base it counts for nothing, as the XDG specification has it. None for a user without a home.
    """
    given, shared = os.environ.get(own), os.environ.get(base)
    try:
        if given:
            return Path(given).expanduser().absolute()
        if shared and Path(shared).is_absolute():
            return Path(shared) / "fowt_env"
        return Path.home() / usual / "fowt_env"
    except (RuntimeError, OSError):  # no home, or no working folder any more
        return None


def cache_root():
    """Return the folder of what can be made again (FOWT_CACHE_DIR, else the user's cache folder), or None."""
    return user_folder("FOWT_CACHE_DIR", "XDG_CACHE_HOME", ".cache")


def make_private(folder):
    """Make a folder, and those above it that are missing, for this user alone whatever the umask.

    Raises: OSError where that cannot be.
    """
    folder = Path(folder)
    if not folder.is_dir():
        make_private(folder.parent)
        folder.mkdir(mode=PRIVATE, exist_ok=True)


@contextmanager
def replaced_privately(path):
    """Return a context with a binary file that takes the path's place at its end, private to the user."""
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
    """Return why what lies at a path may be from someone else than this user or root; "" where it cannot.

    Who owns a folder above it can put another thing into its place, but none that belongs to this user.
    """
    found = os.lstat(path)
    if not kind(found.st_mode):
        return "is a symbolic link" if stat.S_ISLNK(found.st_mode) else "is not of the right kind"
    if found.st_uid not in (0, os.geteuid()):
        return f"belongs to user {found.st_uid}"
    if found.st_mode & OTHERS_WRITE:
        return f"can be written by others (mode {stat.S_IMODE(found.st_mode):04o})"
    return ""
