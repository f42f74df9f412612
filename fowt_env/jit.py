"""The house decorators for compiled code, and the disk cache keyed by the package's sources.

Numba's own cache watches only the file of the function itself: after an edit of a callee in
another file a cached caller would go on returning the old result. So the cache lives in a folder
named by a hash of every source file of the packages that hold kernels.
"""

import atexit
import hashlib
import os
import shutil
import sys
import tempfile
import time
from fnmatch import fnmatch
from pathlib import Path

import numba
from numba import types

from fowt_env import kernel_cache

KEEP_CACHES = 4  # folders of older sources kept, so that switching branches does not recompile
KERNEL_PACKAGES = ("fowt_env", "controllers")
# Sources that no module with a kernel imports at its top, so that an edit of them compiles nothing anew. A
# kernel freezes what its module's globals hold; tests/test_cache.py follows the imports and checks this list.
NOT_COMPILED = (
    "animation.py",
    "cli*.py",
    "openfast_files.py",
    "outputs.py",
    "plots*.py",
    "policy*.py",
    "rendering.py",
    "rosco.py",
    "saved_design.py",
)


def kernel_sources():
    """Sorted paths of the kernel packages' sources that machine code may depend on."""
    root = Path(__file__).resolve().parent.parent
    return sorted(
        path
        for package in KERNEL_PACKAGES
        for path in (root / package).rglob("*.py")
        if not any(fnmatch(path.name, pattern) for pattern in NOT_COMPILED)
    )


def _source_hash():
    """Hash of the kernels' sources and of the versions that shape machine code."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    root = Path(__file__).resolve().parent.parent
    for path in kernel_sources():
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def user_folder(own, base, usual):
    """Folder that the environment variable own names; else fowt_env in that of base, or in usual at home."""
    given = os.environ.get(own)
    if given:
        return Path(given)
    shared = os.environ.get(base)
    return (Path(shared) if shared else Path.home() / usual) / "fowt_env"


def cache_root():
    """Folder that holds the compiled kernels (FOWT_CACHE_DIR, else the user's cache folder)."""
    return user_folder("FOWT_CACHE_DIR", "XDG_CACHE_HOME", ".cache")


def _use_cache_folder():
    """Point numba at this source version's folder; drop the oldest others. Returns the folder.

    None where it cannot be written: kernels then go to a folder of this process alone, gone with it, since
    numba refuses to define a cached function that has nowhere to go.
    """
    root = cache_root()
    folder = root / _source_hash()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        others = sorted(
            (p for p in root.iterdir() if p.is_dir() and p != folder),
            key=lambda p: p.stat().st_mtime,
        )
        day_ago = time.time() - 86400.0  # a process that is still running may use a younger one
        for old in others[: max(0, len(others) - KEEP_CACHES)]:
            if old.stat().st_mtime < day_ago:
                shutil.rmtree(old, ignore_errors=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        own = tempfile.mkdtemp(prefix="fowt_env_")  # private: caches are code
        atexit.register(shutil.rmtree, own, ignore_errors=True)
        numba.config.CACHE_DIR = own
        return None
    numba.config.CACHE_DIR = str(folder)
    return folder


CACHE_FOLDER = _use_cache_folder()
kernel_cache.install()

_HOUSE = {"cache": True, "error_model": "numpy", "nogil": True}

# _nrt=False: numba counts references at every slice and call that takes arrays, each an atomic
# instruction; without them a step takes a third less time. Such a kernel must not allocate, nor
# return an array or a part that holds one.
kernel = numba.njit(**_HOUSE, _nrt=False)

# No fastmath anywhere: LLVM then orders a sum differently in each caller's copy of a function, and a
# process that compiles gets other last bits than one that loads from disk (seen on the look-up rotor
# and the wave sums). Where a sum's time counts, lane_sums.py writes it in a fixed order of lanes.

# A kernel put into its caller whatever its size. A call hands over a scene by value, some 400 words: that
# takes longer than most loads, so what lies between a run and its loads is put into the run.
inlined_kernel = numba.njit(**_HOUSE, _nrt=False, forceinline=True)

# Functions that take a Box, which is a counted reference, or that allocate.
entry = numba.njit(**_HOUSE)

# The same with its prange loops spread over threads.
parallel_entry = numba.njit(**_HOUSE, parallel=True)

FLOATS = types.float64[::1]
CONTROL_SIGNATURE = types.void(FLOATS, FLOATS, FLOATS, FLOATS)


def control_kernel(function):
    """Compile a control law to a first-class function, so that one compiled loop serves them all.

    function(parameters, memory, measurement, command): four (n,) float64 arrays; it reads the
    first and third and writes the second and fourth. Under NUMBA_DISABLE_JIT it stays Python.
    """
    if numba.config.DISABLE_JIT:
        return function
    return numba.cfunc(CONTROL_SIGNATURE, cache=True, error_model="numpy")(function)


if numba.config.DISABLE_JIT:

    class Box:
        """Plain twin of the compiled box, for runs with the JIT off."""

        def __init__(self, scene, work):
            self.scene = scene
            self.work = work

else:
    from numba.experimental import structref

    @structref.register
    class _BoxType(types.StructRef):
        def preprocess_fields(self, fields):
            return tuple((name, types.unliteral(kind)) for name, kind in fields)

    class Box(structref.StructRefProxy):
        """What Python holds and hands to kernels: a scene and its scratch arrays.

        A structref crosses from Python, and into prange, far cheaper than nested NamedTuples.
        """

        def __new__(cls, scene, work):
            return _filled_box(scene, work)

    structref.define_proxy(Box, _BoxType, ["scene", "work"])

    @entry
    def _filled_box(scene, work):
        """A Box; numba's own constructor would be compiled anew, for a second, in every process."""
        return Box(scene, work)
