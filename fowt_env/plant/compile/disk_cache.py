"""Numba's cache of compiled functions, made fit for several processes, broken files and full disks.

Numba adds entries to a function's index without a lock, and a broken file or a full disk ends the program.
Here entries are added under a lock, a broken file is as good as none, and what cannot be kept is compiled
again the next time. The files are pickles, which run code as they are read: one that may be from somebody
else is not.
"""

import fcntl
import hashlib
import inspect
import itertools
import os
import stat
from contextlib import contextmanager, suppress
from functools import partial

import numba
from numba.core import caching

from fowt_env.folders import distrust, make_private, replaced_privately
from fowt_env.plant.compile import linked


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
        except OSError:  # no space, or no longer a place to write
            return

    @contextmanager
    def _lock(self):
        """Return a context that one process at a time is in."""
        handle = os.open(self._index_path + ".lock", os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)

    def _load_index(self):
        try:
            _check(self._index_path)
            return super()._load_index()
        except Exception:  # whatever unpickling a broken file raises
            return {}

    def _load_data(self, name):
        try:
            _check(self._data_path(name))
            return super()._load_data(name)
        except Exception as error:  # likewise; numba compiles anew where the file cannot be read
            raise OSError(f"{name}: {error}") from error

    def _open_for_write(self, path):
        """Return a context with a file that takes the path's place at its end."""
        return replaced_privately(path)


def _check(path):
    """Raise PermissionError for a file that somebody else may have written."""
    fault = distrust(path, stat.S_ISREG)
    if fault:
        raise PermissionError(f"{path} {fault}")


class _Locator(caching.UserProvidedCacheLocator):
    """Where a kernel's files are: in its folder, named by the package, not by the path or the line."""

    def __init__(self, function, path, folder, stamp):
        self._py_file = path
        self._code = function.__code__
        self._cache_path = os.path.join(folder, function.__module__.rpartition(".")[0])
        self._stamp = stamp

    def get_source_stamp(self):
        """Return what must not have changed beside the folder's name."""
        return self._stamp

    def get_disambiguator(self):
        """Return the text that tells functions of one name in a module apart, by code and numbers."""
        numbers = [value for value in self._code.co_consts if isinstance(value, (int, float, complex, tuple))]
        shape = repr((self._code.co_code, self._code.co_names, numbers))
        return hashlib.sha256(shape.encode()).hexdigest()[:8]

    def ensure_cache_path(self):
        """Make the folder if it can be made; where it cannot, nothing is kept."""
        with suppress(OSError):
            make_private(self._cache_path)


class _Files(caching.CompileResultCacheImpl):
    """Numba's rules on what can be kept and what it is called, with our locator."""

    def __init__(self, function, folder, stamp):
        path = inspect.getfile(function)
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function, path, folder, stamp)
        module = os.path.splitext(os.path.basename(path))[0]
        self._filename_base = self.get_filename_base(f"{module}.{function.__qualname__}", "")


class _LinkedFiles(_Files):
    """The same for kernels that are linked into their callers: no machine code."""

    def __init__(self, function, folder, stamp):
        super().__init__(function, folder, stamp)
        self._filename_base += ".linked"

    def reduce(self, cres):
        return linked.reduced(cres)

    def rebuild(self, target_context, payload):
        return linked.rebuilt(target_context, payload)


class KernelCache(caching.FunctionCache):
    """Cache of one compiled function beneath a folder, for compiled functions' attribute _cache.

    stamp: whatever it depends on beside its key and the name of the folder.
    links: whether it is a kernel of linked.py.
    """

    def __init__(self, function, folder, stamp="", links=False):
        self._impl_class = partial(_LinkedFiles if links else _Files, folder=folder, stamp=stamp)
        super().__init__(function)
        file = getattr(self, "_cache_file", None)
        if type(file) is not caching.IndexDataCacheFile:
            raise ImportError(f"numba {numba.__version__} keeps compiled functions in an unknown way")
        locator = self._impl.locator
        self._cache_file = SharedCacheFile(
            locator.get_cache_path(), self._impl.filename_base, locator.get_source_stamp()
        )

    def save_overload(self, sig, data):
        """Keep the machine code for a signature, unless a compiled function is among its arguments: that is
        compiled into it, and as no other process knows it again, each would add its own."""
        if "CPUDispatcher(" not in repr(sig):
            super().save_overload(sig, data)
