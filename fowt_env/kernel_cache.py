"""Numba's cache of compiled functions, made fit for several processes, broken files and full disks.

Numba reads a function's index, adds an entry and writes it back without a lock, and numbers the files of
machine code by what it read: of two processes that compile at once one loses its entry, or finds the other's
code under it. A broken file, or no room for a new one, ends the program. Here entries are added under a lock,
a broken file is as good as none, and what cannot be kept is compiled again the next time.
"""

import fcntl
import itertools
import os
from contextlib import contextmanager

from numba.core import caching


class SharedCacheFile(caching.IndexDataCacheFile):
    """Index and machine code of one function, in files that other processes use too."""

    def save(self, key, data):
        """Keep the machine code of a key, the code before the index that tells of it."""
        try:
            with self._lock():
                names = self._load_index()
                used = set(names.values())
                if key not in names:
                    names[key] = next(
                        name for name in map(self._data_name, itertools.count(1)) if name not in used
                    )
                self._save_data(names[key], data)
                self._save_index(names)
        except OSError:  # no room, or no longer a place to write
            return

    @contextmanager
    def _lock(self):
        """Context that one process at a time is in."""
        handle = os.open(self._index_path + ".lock", os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)

    def _load_index(self):
        try:
            return super()._load_index()
        except Exception:  # whatever unpickling a broken file raises
            return {}

    def _load_data(self, name):
        try:
            return super()._load_data(name)
        except Exception as error:  # likewise; numba compiles anew where the file cannot be read
            raise OSError(f"{name}: {error}") from error


def install():
    """Have numba keep the compiled functions of this process in SharedCacheFiles."""
    caching.IndexDataCacheFile = SharedCacheFile
