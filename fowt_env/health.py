"""What `fowt doctor` looks at: versions, optional parts, the kernel cache, a short run with known figures."""

import os
import platform
import re
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numba

from fowt_env.errors import InputError
from fowt_env.jit import CACHE_FOLDER, cache_root
from fowt_env.warmup import compilation_announced, kernels_compiled

DISTRIBUTION = "fowt-env"
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


class Package(NamedTuple):
    """An installed or missing distribution."""

    name: str
    version: str | None  # None: not installed


@dataclass(frozen=True)
class CacheState:
    """Where compiled kernels are kept, and what is there."""

    folder: Path
    usable: bool  # False: kernels are compiled at each start
    compiled: bool  # at least one kind of scene of this version
    megabytes: float  # of this version
    others: int  # folders of other source versions

    @property
    def advice(self):
        """What to do about it, "" where nothing is wrong."""
        if self.usable:
            return ""
        return "kernels are compiled at each start: set FOWT_CACHE_DIR to a folder that can be written"


class SelfTest(NamedTuple):
    """A short run beside the figures it must give."""

    found: dict  # {channel: last value}
    worst: float  # largest relative difference from EXPECTED
    seconds: float  # of the clock, without compiling
    passed: bool


def _installed(name):
    try:
        return Package(name, metadata.version(name))
    except metadata.PackageNotFoundError:
        return Package(name, None)


def _requirements():
    """{extra or "": [distribution names]} of the installed package; those of [dev] are for its developers.

    Raises: InputError where the package runs from a folder and was never installed.
    """
    try:
        lines = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        raise InputError(f"{DISTRIBUTION} is not installed here: pip install -e . in its folder") from None
    found = {}
    for line in lines:
        name = re.match(r"[A-Za-z0-9._-]+", line).group()
        extra = re.search(r"extra == ['\"]([^'\"]+)['\"]", line)
        key = extra.group(1) if extra else ""
        if key != "dev" and name != DISTRIBUTION:
            found.setdefault(key, []).append(name)
    return found


def versions():
    """[Package] of Python, this package and what it cannot do without."""
    from fowt_env import __version__

    head = [Package("fowt-env", __version__), Package("Python", platform.python_version())]
    try:
        needed = _requirements().get("", [])
    except InputError:
        needed = ["numpy", "scipy", "numba", "gymnasium", "pandas"]
    return head + [_installed(name) for name in (*needed, "llvmlite")]


def optional_parts():
    """{extra: [Package]}: what each extra of the package would bring, installed or not."""
    return {
        extra: [_installed(name) for name in names]
        for extra, names in sorted(_requirements().items())
        if extra
    }


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
    folder = root if CACHE_FOLDER is None else CACHE_FOLDER
    usable = CACHE_FOLDER is not None and os.access(CACHE_FOLDER, os.W_OK | os.X_OK)
    size, others = 0, 0
    try:
        if CACHE_FOLDER is not None:
            size = sum(path.stat().st_size for path in CACHE_FOLDER.rglob("*") if path.is_file())
        others = sum(path.is_dir() and path != folder for path in root.iterdir())
    except OSError:
        pass  # gone, or not ours to read: then there is nothing to count
    return CacheState(folder, usable, kernels_compiled(), size / 1e6, others)


def reference_run():
    """DataFrame of the self-test: 60 s from rest in steady 18 m/s and a regular wave, PI controller."""
    from fowt_env import build_scene, simulate

    sea = {"kind": "regular", "H": 4.0, "T": 10.0}
    scene = build_scene("oc3_hywind", wind=18.0, sea=sea, fidelity="standard")
    return simulate(scene, "pi", duration=TEST_DURATION, start="zero")


def self_test(say=None):
    """SelfTest of reference_run; say(text) is called if kernels have to be compiled for it."""
    with compilation_announced(say):
        reference_run()  # compiles what is not compiled
    start = perf_counter()
    last = reference_run().iloc[-1]
    seconds = perf_counter() - start
    found = {name: float(last[name]) for name in EXPECTED}
    worst = max(abs(found[name] / value - 1.0) for name, value in EXPECTED.items())
    return SelfTest(found, worst, seconds, worst <= TOLERANCE)
