"""Defines the decorators of compiled functions, and the disk cache keyed by the package's sources.

Numba's built-in cache checks only the file of the function, not the files of its callees. Compiled kernels
are therefore kept in a folder named by a hash of the code of all plant sources (sources.py); the key of a
kernel of another package also has the hash of its module's imports. User functions are not cached.
"""

import hashlib
import os
import re
import shutil
import sys
import time
import warnings
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from pathlib import Path

import numba

from fowt_env.plant.compile.versions import check_numba

check_numba(numba.__version__)  # before imports and kernels that fail with other versions

from numba import types  # noqa: E402
from numba.core.ccallback import CFunc  # noqa: E402

from fowt_env.folders import cache_root, distrust, make_private  # noqa: E402
from fowt_env.layout import PACKAGE, installed_path  # noqa: E402
from fowt_env.plant.compile.disk_cache import KernelCache  # noqa: E402
from fowt_env.plant.compile.linked import (  # noqa: E402
    LinkedCompiler,
    LinkedDispatcher,
    SeparateCompiler,
    SharedCompiler,
)
from fowt_env.plant.compile.notice import NOTICE  # noqa: E402, F401  # registers its listener
from fowt_env.plant.compile.sources import imported_at_top, keep_sources, read_source  # noqa: E402

KEEP_CACHES = 4  # folders of older sources kept, so that switching branches does not recompile
DAY = 86400.0  # s; a folder used less than a day ago may still be in use
UNUSED = 30 * DAY  # s without use after which a folder of older sources is removed in any case
MARKER = "made_by_fowt_env"  # file that marks folders made by this module: only these are removed
OWN_NAME = re.compile("[0-9a-f]{16}")
PLANT = Path(__file__).absolute().parents[1]


def _hash(paths):
    """Return a hash (16 hexadecimal digits) of the code of sources and the versions of numba and Python."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for installed, path in sorted((installed_path(path), path) for path in paths):
        digest.update(installed.relative_to(PACKAGE).as_posix().encode())
        digest.update(read_source(path).code.encode())
    keep_sources()
    return digest.hexdigest()[:16]


def own_folders(kernels):
    """Return the subfolders of compiled kernels in a folder that this package made."""
    return [
        path
        for path in kernels.iterdir()
        if OWN_NAME.fullmatch(path.name) and not path.is_symlink() and (path / MARKER).is_file()
    ]


def _drop_oldest(folder):
    """Remove sibling cache folders unused for a day; the KEEP_CACHES last used are kept for a month."""
    now = time.time()
    used = {path: path.stat().st_mtime for path in own_folders(folder.parent) if path != folder}
    for rank, (path, last) in enumerate(sorted(used.items(), key=lambda item: -item[1])):
        if now - last > (DAY if rank >= KEEP_CACHES else UNUSED):
            shutil.rmtree(path, ignore_errors=True)


def _folders_to_check(folder):
    """Yield the folders that must belong to the user, outer ones first: only then can inner ones be read."""
    yield folder.parent
    yield folder
    yield from (Path(entry) for entry in os.scandir(folder) if entry.is_dir())


def _cache_folder(sources):
    """Return the folder of compiled kernels of these sources, made if missing; remove the oldest others.

    None without a usable folder, or, after a warning, with one that another user can write to: kernels are
    then compiled in each process.
    """
    root = cache_root()
    if root is None:
        return None
    folder = root / "kernels" / _hash(sources)
    with suppress(OSError):
        make_private(folder)
    try:
        for checked in _folders_to_check(folder):
            if fault := distrust(checked):
                warnings.warn(
                    f"{checked} {fault}: compiled kernels are executable code, so this folder is not used and"
                    " kernels are compiled at each start. Set FOWT_CACHE_DIR to a private folder",
                    RuntimeWarning,
                    stacklevel=2,
                )
                return None
    except OSError:  # the folder cannot be made or read
        return None
    with suppress(OSError):  # the folder is shared and read-only: its owner maintains it
        (folder / MARKER).touch(mode=0o600)
        os.utime(folder)
        _drop_oldest(folder)
    return folder


CACHE_FOLDER = _cache_folder(PLANT.rglob("*.py"))


def kernels_compiled():
    """Return whether compiled kernels of this version are on disk for at least one kind of scene."""
    if numba.config.DISABLE_JIT:
        return True
    return CACHE_FOLDER is not None and any(CACHE_FOLDER.rglob("*.nbi"))


@cache
def _stamp(path):
    """Return the hash of a source and its imports outside the plant; "" in the plant, None for user code."""
    path = Path(path)
    if installed_path(path) is None:
        return None
    return "" if PLANT in path.parents else _hash(imported_at_top(path, PLANT))


def _keep(compiled, function):
    """Attach the disk cache to a compiled function if its key covers all sources that it depends on."""
    stamp = CACHE_FOLDER and _stamp(os.path.abspath(function.__code__.co_filename))
    if stamp is not None:
        compiled._cache = KernelCache(function, CACHE_FOLDER, stamp, getattr(compiled, "stored", None))


def _decorator(linked=None, **options):
    """Return the decorator numba.njit with these options and the disk cache; linked: class of linked.py."""

    def decorate(function):
        if numba.config.DISABLE_JIT:
            return function
        if linked:
            options_of = options | {"nopython": True}
            compiled = LinkedDispatcher(function, targetoptions=options_of, pipeline_class=linked)
            compiled.keep = _keep
        else:
            compiled = numba.njit(**options)(function)
        _keep(compiled, function)
        return compiled

    return decorate


_HOUSE = {"error_model": "numpy", "nogil": True}

# _nrt=False: numba counts references at every slice and call that takes arrays, each an atomic
# instruction; without reference counts a time step takes a third less time. Such a kernel must not
# allocate, nor return an array or a tuple that contains one.
kernel = _decorator(**_HOUSE, _nrt=False, linked=LinkedCompiler)

# No fastmath anywhere: LLVM then orders a sum differently in each caller's copy of a function, and a
# process that compiles gets other last bits than one that loads from disk (observed with the look-up
# rotor and the wave sums). Time-critical sums use the fixed order of lanes of vector_sums.py.

# A kernel that is inlined whatever its size. A call passes a part of the model by value, up to a few
# hundred words, which takes longer than many loads: kernels that only pass parts on are inlined.
inlined_kernel = _decorator(**_HOUSE, _nrt=False, forceinline=True, linked=LinkedCompiler)

# A kernel of which an entry has one copy, whatever the number of its callers. LLVM inlines even the largest:
# copies of all loads take most of the time to compile, and of that to run, in which the processor then waits
# for instructions.
shared_kernel = _decorator(**_HOUSE, _nrt=False, linked=SharedCompiler)

# A kernel with machine code of its own, which all entries call: steps, outputs, periods. With a copy in each
# entry, a scene took half as long again to compile.
separate_kernel = _decorator(**_HOUSE, _nrt=False, linked=SeparateCompiler)

# Functions called from Python, which take Handles (counted references) or allocate.
entry = _decorator(**_HOUSE)

# Entries whose prange loops are spread over threads.
parallel_entry = _decorator(**_HOUSE, parallel=True)

FLOATS = types.float64[::1]
CONTROL_SIGNATURE = types.void(FLOATS, FLOATS, FLOATS, FLOATS)


class ControlKernel:
    """Holds a control law and compiles it at first use: a run needs only one of a dozen laws."""

    def __init__(self, function):
        self.function = function
        update_wrapper(self, function)

    @cached_property
    def compiled(self):
        """Return the law as a first-class function, or the Python function under NUMBA_DISABLE_JIT."""
        if numba.config.DISABLE_JIT:
            return self.function
        signature = CONTROL_SIGNATURE.args, CONTROL_SIGNATURE.return_type
        compiled = CFunc(self.function, signature, locals={}, options={"error_model": "numpy"})
        _keep(compiled, self.function)
        compiled.compile()
        return compiled


def control_kernel(function):
    """Return the ControlKernel of a law: one compiled loop calls every law as a first-class function.

    function(parameters, memory, measurement, command): four (n,) float64 arrays; the law reads the
    first and third and writes the second and fourth.
    """
    return ControlKernel(function)
