"""The house decorators for compiled code, and the disk cache keyed by the package's sources.

Numba's own cache watches the file of the function alone, not those of its callees. So the cache lives in a
folder named by a hash of the code of every source of the plant (sources.py); a kernel of another package
carries the hash of what its module imports besides. A user's function is compiled anew in each process.
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

check_numba(numba.__version__)  # ahead of what other versions cannot import or compile

from numba import types  # noqa: E402
from numba.core.ccallback import CFunc  # noqa: E402

from fowt_env.folders import cache_root, distrust, make_private  # noqa: E402
from fowt_env.layout import PACKAGE, installed_path  # noqa: E402
from fowt_env.plant.compile.disk_cache import KernelCache  # noqa: E402
from fowt_env.plant.compile.linked import LinkedDispatcher  # noqa: E402
from fowt_env.plant.compile.notice import NOTICE  # noqa: E402, F401  # listens from here on
from fowt_env.plant.compile.sources import imported_at_top, keep_sources, read_source  # noqa: E402

KEEP_CACHES = 4  # folders of older sources kept, so that switching branches does not recompile
DAY = 86400.0  # s; what was used within it may be in use still
UNUSED = 30 * DAY  # s after which a folder of older sources goes, however few there are
MARKER = "made_by_fowt_env"  # a file in each folder that this module makes, and may therefore remove
OWN_NAME = re.compile("[0-9a-f]{16}")
PLANT = Path(__file__).absolute().parents[1]


def _hash(paths):
    """Return the hash (16 hexadecimal digits) of sources' code and of versions that shape machine code."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for place, path in sorted((installed_path(path), path) for path in paths):
        digest.update(place.relative_to(PACKAGE).as_posix().encode())
        digest.update(read_source(path).code.encode())
    keep_sources()
    return digest.hexdigest()[:16]


def own_folders(kernels):
    """Return the folders of compiled kernels in a folder, those that this package made and no others."""
    return [
        path
        for path in kernels.iterdir()
        if OWN_NAME.fullmatch(path.name) and not path.is_symlink() and (path / MARKER).is_file()
    ]


def _drop_oldest(folder):
    """Remove folders beside this one unused for a day or, of the KEEP_CACHES last used, a month."""
    now = time.time()
    used = {path: path.stat().st_mtime for path in own_folders(folder.parent) if path != folder}
    for place, (path, last) in enumerate(sorted(used.items(), key=lambda item: -item[1])):
        if now - last > (DAY if place >= KEEP_CACHES else UNUSED):
            shutil.rmtree(path, ignore_errors=True)


def _places(folder):
    """Yield the folders that must be ours: an inner one can only be looked at if its outer one is."""
    yield folder.parent
    yield folder
    yield from (Path(entry) for entry in os.scandir(folder) if entry.is_dir())


def _cache_folder(sources):
    """Return the folder of this source version's kernels, made if need be; the oldest others are dropped.

    None, and kernels are then compiled in each process, where there is none or, after a warning, where
    somebody else may have put files into it.
    """
    root = cache_root()
    if root is None:
        return None
    folder = root / "kernels" / _hash(sources)
    with suppress(OSError):
        make_private(folder)
    try:
        for place in _places(folder):
            if fault := distrust(place):
                warnings.warn(
                    f"{place} {fault}, and compiled kernels are code: it is not used, and kernels are"
                    " compiled at each start. Set FOWT_CACHE_DIR to a folder of your own",
                    RuntimeWarning,
                    stacklevel=2,
                )
                return None
    except OSError:  # it could not be made, or cannot be read
        return None
    with suppress(OSError):  # it is somebody else's to care for
        (folder / MARKER).touch(mode=0o600)
        os.utime(folder)
        _drop_oldest(folder)
    return folder


CACHE_FOLDER = _cache_folder(PLANT.rglob("*.py"))


def kernels_compiled():
    """Return whether this version's kernels are on disk already, for at least one kind of scene."""
    if numba.config.DISABLE_JIT:
        return True
    return CACHE_FOLDER is not None and any(CACHE_FOLDER.rglob("*.nbi"))


@cache
def _stamp(path):
    """Return the hash of a source and its imports outside the plant; "" for one in it, None for a user's."""
    path = Path(path)
    if installed_path(path) is None:
        return None
    return "" if PLANT in path.parents else _hash(imported_at_top(path, PLANT))


def _keep(compiled, function):
    """Have what numba made of a function kept on disk, if all that it can depend on is in its key."""
    stamp = CACHE_FOLDER and _stamp(os.path.abspath(function.__code__.co_filename))
    if stamp is not None:
        compiled._cache = KernelCache(function, CACHE_FOLDER, stamp, isinstance(compiled, LinkedDispatcher))


def _decorator(linked=False, **options):
    """Return the decorator numba.njit with these options, kept on disk; linked: by linked.py."""

    def decorate(function):
        if numba.config.DISABLE_JIT:
            return function
        if linked:
            compiled = LinkedDispatcher(function, targetoptions=options | {"nopython": True})
            compiled.keep = _keep
        else:
            compiled = numba.njit(**options)(function)
        _keep(compiled, function)
        return compiled

    return decorate


_HOUSE = {"error_model": "numpy", "nogil": True}

# _nrt=False: numba counts references at every slice and call that takes arrays, each an atomic
# instruction; without them a step takes a third less time. Such a kernel must not allocate, nor
# return an array or a part that holds one.
kernel = _decorator(**_HOUSE, _nrt=False, linked=True)

# No fastmath anywhere: LLVM then orders a sum differently in each caller's copy of a function, and a
# process that compiles gets other last bits than one that loads from disk (seen on the look-up rotor
# and the wave sums). Where a sum's time counts, vector_sums.py writes it in a fixed order of lanes.

# A kernel put into its caller whatever its size. A call hands over a part of the model by value, up to some
# hundred words: that takes longer than many a load, so what merely hands parts on is put into its caller.
inlined_kernel = _decorator(**_HOUSE, _nrt=False, forceinline=True, linked=True)

# Functions that Python calls: they take Handles, which are counted references, or allocate.
entry = _decorator(**_HOUSE)

# The same with its prange loops spread over threads.
parallel_entry = _decorator(**_HOUSE, parallel=True)

FLOATS = types.float64[::1]
CONTROL_SIGNATURE = types.void(FLOATS, FLOATS, FLOATS, FLOATS)


class ControlKernel:
    """A control law that is compiled when a run first needs it: a scene has one of a dozen."""

    def __init__(self, function):
        self.function = function
        update_wrapper(self, function)

    @cached_property
    def compiled(self):
        """Return the first-class function, or the Python function itself under NUMBA_DISABLE_JIT."""
        if numba.config.DISABLE_JIT:
            return self.function
        signature = CONTROL_SIGNATURE.args, CONTROL_SIGNATURE.return_type
        compiled = CFunc(self.function, signature, locals={}, options={"error_model": "numpy"})
        _keep(compiled, self.function)
        compiled.compile()
        return compiled


def control_kernel(function):
    """Return a ControlKernel: a law as a first-class function, so that one compiled loop serves all.

    function(parameters, memory, measurement, command): four (n,) float64 arrays; it reads the
    first and third and writes the second and fourth.
    """
    return ControlKernel(function)
