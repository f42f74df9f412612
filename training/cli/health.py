"""Checks of `fowt doctor` besides versions: the kernel cache, and a short run with known results."""

import os
import platform
import re
import shutil
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numba

from fowt_env.folders import cache_root, distrust
from fowt_env.plant.compile.decorators import CACHE_FOLDER, kernels_compiled, own_folders

BOX_NAME = re.compile(r"[0-9a-f]{24}\.npz")  # of a box of wind (training/evaluation/wind_boxes.py)
# of a submission's kernels (training/board/isolated.py), complete or unfinished
SUBMISSION_NAME = re.compile(r"[0-9a-f]{24}(-\w+)?")
TEST_DURATION = 60.0  # s
# Last row of reference_run(). It checks the installation, not the physics (the tests do): a wrongly compiled
# part or a changed data file shifts it far outside the tolerance.
EXPECTED = {
    "PtfmSurge_[m]": 19.2783,
    "PtfmPitch_[deg]": 2.6417,
    "RotSpeed_[rpm]": 12.6687,
    "FAIRTEN1_[kN]": 607.274,
}
TOLERANCE = 1e-3  # relative; half the step changes the values by 1.4e-4


@dataclass(frozen=True)
class CacheState:
    """Folder and content of the cache of compiled kernels."""

    folder: Path | None  # None: neither FOWT_CACHE_DIR nor a home folder exists
    read: bool  # whether cached kernels are used; False: all are compiled at each start
    written: bool  # whether compiled kernels are cached
    compiled: bool  # at least one kind of scene of this version
    megabytes: float  # of this version
    others: int  # folders of other source versions

    @property
    def advice(self):
        """Advice on a problem of the cache, "" for none."""
        if not self.read:
            return "kernels are compiled at each start: set FOWT_CACHE_DIR to a folder that can be written"
        return "" if self.written else "read only: missing kernels are compiled at each start"


class SelfTest(NamedTuple):
    """The result of a short run, compared with EXPECTED."""

    found: dict  # {channel: last value}
    worst: float  # largest relative difference from EXPECTED
    seconds: float  # of the clock, without compiling
    passed: bool


def machine():
    """Return a line on the machine and the compiler's settings."""
    jit = "switched off (NUMBA_DISABLE_JIT)" if numba.config.DISABLE_JIT else "on"
    return (
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors,"
        f" {numba.config.NUMBA_NUM_THREADS} threads, compiler {jit}, {sys.executable}"
    )


def cache_state():
    """Return the CacheState of this process."""
    root = cache_root()
    if CACHE_FOLDER is None:
        return CacheState(root and root / "kernels", False, False, kernels_compiled(), 0.0, 0)
    written = os.access(CACHE_FOLDER, os.W_OK | os.X_OK)
    size, others = 0, 0
    try:
        size = _bytes(CACHE_FOLDER)
        others = sum(path != CACHE_FOLDER for path in own_folders(CACHE_FOLDER.parent))
    except OSError:
        pass  # removed meanwhile, or not readable
    return CacheState(CACHE_FOLDER, True, written, kernels_compiled(), size / 1e6, others)


class CachePart(NamedTuple):
    """A part of the cache on disk."""

    what: str  # "this version", "other versions" (of compiled kernels), "wind boxes" or "submissions"
    paths: list[Path]  # folders, or files of wind
    megabytes: float


def cache_parts() -> list[CachePart]:
    """Return the CacheParts of this user that this package made; [] without a cache folder."""
    root = cache_root()
    if root is None:
        return []
    kernels, boxes, submissions = root / "kernels", root / "wind_boxes", root / "submissions"
    folders = own_folders(kernels) if _ours(kernels) else []
    files = [path for path in boxes.glob("*.npz") if BOX_NAME.fullmatch(path.name)] if _ours(boxes) else []
    found = {
        "this version": [path for path in folders if path == CACHE_FOLDER],
        "other versions": [path for path in folders if path != CACHE_FOLDER],
        "wind boxes": [path for path in files if path.is_file() and not path.is_symlink()],
        "submissions": [
            path
            for path in (submissions.iterdir() if _ours(submissions) else ())
            if SUBMISSION_NAME.fullmatch(path.name) and path.is_dir() and not path.is_symlink()
        ],
    }
    return [CachePart(what, paths, sum(map(_bytes, paths)) / 1e6) for what, paths in found.items()]


def remove(parts: list[CachePart]) -> list[Path]:
    """Remove parts of the cache; return the paths that could not be removed."""
    for path in (path for part in parts for path in part.paths):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()
    return [path for part in parts for path in part.paths if path.exists()]


def _ours(folder):
    """Return whether a folder exists and no other user can write to it."""
    try:
        return folder.is_dir() and not distrust(folder)
    except OSError:
        return False


def _bytes(path):
    """Return the size of a file or of all files in a folder, without those removed meanwhile."""
    total = 0
    for file in (path, *path.rglob("*")):
        with suppress(OSError):
            total += file.stat().st_size if file.is_file() else 0
    return total


def reference_run():
    """Return the DataFrame of the self-test: 60 s from rest in steady 18 m/s and a regular wave with pi."""
    from fowt_env import build_scene, simulate

    sea = {"kind": "regular", "H": 4.0, "T": 10.0}
    scene = build_scene("oc3_hywind", wind=18.0, sea=sea, fidelity="standard")
    return simulate(scene, "pi", duration=TEST_DURATION, initial="zero")


def self_test():
    """Return the SelfTest of reference_run, timed once its kernels are compiled."""
    reference_run()
    start = perf_counter()
    last = reference_run().iloc[-1]
    seconds = perf_counter() - start
    found = {name: float(last[name]) for name in EXPECTED}
    worst = max(abs(found[name] / value - 1.0) for name, value in EXPECTED.items())
    return SelfTest(found, worst, seconds, worst <= TOLERANCE)
