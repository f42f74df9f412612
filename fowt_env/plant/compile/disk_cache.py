"""Defines the disk cache of compiled kernels, safe for concurrent processes, broken files and full disks.

Numba adds entries to a function's index without a lock, and a broken file or a full disk ends the program.
Here entries are added under a lock, a broken file counts as missing, and a kernel that cannot be stored is
compiled again in the next process. The files are pickles, which run code when loaded: a file that another
user may have written is not read.
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
    """Holds the index and machine code of one function in files shared between processes."""

    def save(self, key, data):
        """Store the machine code of a key, and then its entry in the index."""
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
        except OSError:  # the disk is full or the folder is gone
            return

    @contextmanager
    def _lock(self):
        """Return a context that holds the lock on the index: one process at a time."""
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
        except Exception:  # unpickling a broken file can raise anything
            return {}

    def _load_data(self, name):
        try:
            _check(self._data_path(name))
            return super()._load_data(name)
        except Exception as error:  # likewise; numba compiles again after an OSError
            raise OSError(f"{name}: {error}") from error

    def _open_for_write(self, path):
        """Return a context with a temporary file that replaces the file at path on exit."""
        return replaced_privately(path)


def _check(path):
    """Raise PermissionError for a cache file that another user may have written."""
    fault = distrust(path, stat.S_ISREG)
    if fault:
        raise PermissionError(f"{path} {fault}")


class _Locator(caching.UserProvidedCacheLocator):
    """Locates the cache files of a kernel by package and name, not by source path or line."""

    def __init__(self, function, path, folder, stamp):
        self._py_file = path
        self._code = function.__code__
        self._cache_path = os.path.join(folder, function.__module__.rpartition(".")[0])
        self._stamp = stamp

    def get_source_stamp(self):
        """Return the hash that, besides the folder's name, must match for a stored kernel to be valid."""
        return self._stamp

    def get_disambiguator(self):
        """Return a hash of bytecode and constants: it distinguishes functions of one name in a module."""
        numbers = [value for value in self._code.co_consts if isinstance(value, (int, float, complex, tuple))]
        shape = repr((self._code.co_code, self._code.co_names, numbers))
        return hashlib.sha256(shape.encode()).hexdigest()[:8]

    def ensure_cache_path(self):
        """Make the cache folder if possible; without the folder no kernel is stored."""
        with suppress(OSError):
            make_private(self._cache_path)


class _Files(caching.CompileResultCacheImpl):
    """Applies numba's rules for storing and naming compiled functions, with the _Locator."""

    def __init__(self, function, folder, stamp):
        path = inspect.getfile(function)
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function, path, folder, stamp)
        module = os.path.splitext(os.path.basename(path))[0]
        self._filename_base = self.get_filename_base(f"{module}.{function.__qualname__}", "")

    def rebuild(self, target_context, payload):
        """Return the stored CompileResult; a caller compiled from it loads first what it loads first.

        Numba forgets this: such a caller, in a process that has loaded nothing else, would call address 0.
        """
        cres = super().rebuild(target_context, payload)
        cres.library._reload_init.update(cres.reload_init)
        return cres


class _LinkedFiles(_Files):
    """Stores kernels of linked.py; stored: end of the names of their files."""

    def __init__(self, function, folder, stamp, stored):
        super().__init__(function, folder, stamp)
        self._filename_base += f".{stored}"

    def reduce(self, cres):
        return linked.reduced(cres)

    def rebuild(self, target_context, payload):
        return linked.rebuilt(target_context, payload)


class KernelCache(caching.FunctionCache):
    """Caches one compiled function in a folder; set as the attribute _cache of the compiled function.

    stamp: hash of further dependencies, in addition to the key and the folder's name.
    stored: end of the names of files of a kernel of linked.py, "linked" or "separate"; None: of another.
    """

    def __init__(self, function, folder, stamp="", stored=None):
        files = partial(_LinkedFiles, stored=stored) if stored else _Files
        self._impl_class = partial(files, folder=folder, stamp=stamp)
        super().__init__(function)
        file = getattr(self, "_cache_file", None)
        if type(file) is not caching.IndexDataCacheFile:
            raise ImportError(f"numba {numba.__version__} stores compiled functions in an unsupported way")
        locator = self._impl.locator
        self._cache_file = SharedCacheFile(
            locator.get_cache_path(), self._impl.filename_base, locator.get_source_stamp()
        )

    def save_overload(self, sig, data):
        """Store the machine code of a signature, unless an argument is a compiled function: no other process
        would recognise that argument, and each would add an entry."""
        if "CPUDispatcher(" not in repr(sig):
            super().save_overload(sig, data)
