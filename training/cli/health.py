"""Checks the kernel cache and a short run with known results, for fowt doctor and fowt dev cache."""

import os
import platform
import re
import shutil
import sys
from contextlib import suppress
from pathlib import Path
from time import perf_counter

import numba

from fowt_env.folders import cache_root, distrust
from fowt_env.plant.compile.decorators import CACHE_FOLDER, kernels_compiled, own_folders

BOX_NAME = re.compile(r"[0-9a-f]{24}\.npz")  # file of a box of wind (training/evaluation/wind_boxes.py)
# folder of a submission's kernels (training/board/isolated.py), complete or unfinished
SUBMISSION_NAME = re.compile(r"[0-9a-f]{24}(-\w+)?")
TEST_DURATION = 60.0  # s
# Last row of reference_run(), which checks the installation, not the physics (the tests do): wrongly compiled
# kernels or changed data files shift the values far outside the tolerance.
EXPECTED = {
    "PtfmSurge_[m]": 19.2783,
    "PtfmPitch_[deg]": 2.6417,
    "RotSpeed_[rpm]": 12.6687,
    "FAIRTEN1_[kN]": 607.274,
}
TOLERANCE = 1e-3  # relative; halving the step changes the values by 1.4e-4


def machine():
    """Return a line that describes the machine and the compiler's settings."""
    jit = "disabled (NUMBA_DISABLE_JIT)" if numba.config.DISABLE_JIT else "on"
    return (
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors,"
        f" {numba.config.NUMBA_NUM_THREADS} threads, compiler {jit}, {sys.executable}"
    )


def cache_state():
    """Return (line that describes the kernel cache, advice on a problem with the cache or "")."""
    root, size, others = cache_root(), 0.0, 0
    folder = CACHE_FOLDER or (root / "kernels" if root else "no home folder, and no FOWT_CACHE_DIR")
    with suppress(OSError):  # removed meanwhile, or not readable
        if CACHE_FOLDER is not None:
            size = megabytes([CACHE_FOLDER])
            others = sum(path != CACHE_FOLDER for path in own_folders(CACHE_FOLDER.parent))
    text = f"{folder}: " + (
        f"{size:.1f} MB of compiled kernels" if kernels_compiled() else "nothing compiled yet"
    )
    text += f", {others} folders of other versions" if others else ""
    if CACHE_FOLDER is None:
        return text, "kernels are compiled at each start: set FOWT_CACHE_DIR to a writable folder"
    written = os.access(CACHE_FOLDER, os.W_OK | os.X_OK)
    return text, "" if written else "read only: missing kernels are compiled at each start"


def cache_parts() -> dict[str, list[Path]]:
    """Return {part of the cache: its folders or files} created by this package; {} without a cache folder."""
    root = cache_root()
    if root is None:
        return {}
    kernels, boxes, submissions = root / "kernels", root / "wind_boxes", root / "submissions"
    parsed = root / "sources" / "parsed.json"
    folders = own_folders(kernels) if _ours(kernels) else []
    named = [path for path in boxes.glob("*.npz") if BOX_NAME.fullmatch(path.name)] if _ours(boxes) else []
    inner = submissions.iterdir() if _ours(submissions) else ()
    judged = [path for path in inner if SUBMISSION_NAME.fullmatch(path.name)]
    return {
        "this version": [path for path in folders if path == CACHE_FOLDER],
        "other versions": [path for path in folders if path != CACHE_FOLDER],
        "wind boxes": [path for path in named if path.is_file() and not path.is_symlink()],
        "submissions": [path for path in judged if path.is_dir() and not path.is_symlink()],
        "hashes of sources": [parsed] if _ours(parsed.parent) and parsed.is_file() else [],
    }


def remove(paths: list[Path]) -> list[Path]:
    """Remove parts of the cache; return the paths that could not be removed."""
    for path in paths:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()
    return [path for path in paths if path.exists()]


def _ours(folder):
    """Return whether a folder exists and no other user can write to it."""
    try:
        return folder.is_dir() and not distrust(folder)
    except OSError:
        return False


def megabytes(paths: list[Path]) -> float:
    """Return the total size (MB) of files and of files in folders, without files removed meanwhile."""
    total = 0
    for file in (file for path in paths for file in (path, *path.rglob("*"))):
        with suppress(OSError):
            total += file.stat().st_size if file.is_file() else 0
    return total / 1e6


def reference_run():
    """Return the DataFrame of the self-test: 60 s of pi from rest in steady 18 m/s and a regular wave."""
    from fowt_env import build_scene, simulate

    sea = {"kind": "regular", "H": 4.0, "T": 10.0}
    scene = build_scene("oc3_hywind", wind=18.0, sea=sea, fidelity="standard")
    return simulate(scene, "pi", duration=TEST_DURATION, initial="zero")


def self_test():
    """Return ({channel: last value}, largest relative error, run time without compilation in s)."""
    reference_run()
    start = perf_counter()
    last = reference_run().iloc[-1]
    seconds = perf_counter() - start
    values = {name: float(last[name]) for name in EXPECTED}
    worst = max(abs(values[name] / value - 1.0) for name, value in EXPECTED.items())
    return values, worst, seconds
