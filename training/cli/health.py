"""What `fowt doctor` looks at beside versions: the kernel cache, and a short run with known figures."""

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
# of a submission's kernels (training/board/isolated.py), and of such that were never finished
SUBMISSION_NAME = re.compile(r"[0-9a-f]{24}(-\w+)?")
TEST_DURATION = 60.0  # s
# Last row of reference_run(). They guard an installation, not the physics (tests do that): a part that is
# compiled wrongly or a data file that is not the shipped one moves them far beyond the tolerance.
EXPECTED = {
    "PtfmSurge_[m]": 19.2783,
    "PtfmPitch_[deg]": 2.6417,
    "RotSpeed_[rpm]": 12.6687,
    "FAIRTEN1_[kN]": 607.274,
}
TOLERANCE = 1e-3  # of each figure; half the step moves them by 1.4e-4


@dataclass(frozen=True)
class CacheState:
    """Where compiled kernels are kept, and what is there."""

    folder: Path | None  # None: neither FOWT_CACHE_DIR nor a home folder says where
    read: bool  # kernels that are there are used; False: all are compiled at each start
    written: bool  # those that are compiled are kept
    compiled: bool  # at least one kind of scene of this version
    megabytes: float  # of this version
    others: int  # folders of other source versions

    @property
    def advice(self):
        """What to do about it, "" where nothing is wrong."""
        if not self.read:
            return "kernels are compiled at each start: set FOWT_CACHE_DIR to a folder that can be written"
        return "" if self.written else "read only: kernels that are not there are compiled at each start"


class SelfTest(NamedTuple):
    """A short run beside the figures it must give."""

    found: dict  # {channel: last value}
    worst: float  # largest relative difference from EXPECTED
    seconds: float  # of the clock, without compiling
    passed: bool


def machine():
    """One line on the machine and the compiler's settings."""
    jit = "switched off (NUMBA_DISABLE_JIT)" if numba.config.DISABLE_JIT else "on"
    return (
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors,"
        f" {numba.config.NUMBA_NUM_THREADS} threads, compiler {jit}, {sys.executable}"
    )


def cache_state():
    """CacheState of this process."""
    root = cache_root()
    if CACHE_FOLDER is None:
        return CacheState(root and root / "kernels", False, False, kernels_compiled(), 0.0, 0)
    written = os.access(CACHE_FOLDER, os.W_OK | os.X_OK)
    size, others = 0, 0
    try:
        size = _bytes(CACHE_FOLDER)
        others = sum(path != CACHE_FOLDER for path in own_folders(CACHE_FOLDER.parent))
    except OSError:
        pass  # gone, or not ours to read: then there is nothing to count
    return CacheState(CACHE_FOLDER, True, written, kernels_compiled(), size / 1e6, others)


class CachePart(NamedTuple):
    """Something that is kept on disk and can be made again."""

    what: str  # "this version", "other versions" (of compiled kernels), "wind boxes" or "submissions"
    paths: list[Path]  # folders, or files of wind
    megabytes: float


def cache_parts() -> list[CachePart]:
    """CacheParts of this user, of what this package made; [] without a cache folder."""
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
    """Remove parts of the cache; the paths that are still there."""
    for path in (path for part in parts for path in part.paths):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()
    return [path for part in parts for path in part.paths if path.exists()]


def _ours(folder):
    """Whether a folder is there and nobody else could have put things into it."""
    try:
        return folder.is_dir() and not distrust(folder)
    except OSError:
        return False


def _bytes(path):
    """Size of a file, or of all files in a folder; of what another process removes meanwhile nothing."""
    total = 0
    for file in (path, *path.rglob("*")):
        with suppress(OSError):
            total += file.stat().st_size if file.is_file() else 0
    return total


def reference_run():
    """DataFrame of the self-test: 60 s from rest in steady 18 m/s and a regular wave, PI controller."""
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
