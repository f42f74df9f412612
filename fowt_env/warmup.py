"""Compiles the usual kinds of scene in advance, so that no later run waits for compilation.

Also packs what was compiled, for wheels (fowt_env/shipped.py reads it).
"""

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path, PurePosixPath

import numpy as np
import pandas as pd

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.errors import InputError, unknown
from fowt_env.registration import EASY

WIND, SEA = {"kind": "ntm", "speed": 18.0}, {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}


def _simulated(fidelity, **weather):
    """Return a function that simulates a platform at a fidelity in given weather."""

    def run(platform):
        from fowt_env.run.simulation import simulate
        from fowt_env.scene.build import build_scene

        simulate(build_scene(platform, fidelity=fidelity, **weather), "pi", duration=1.0)

    return run


def _stepped(name, modes=("direct",), **settings):
    """Return a function that resets and steps an environment, a class of fowt_env.envs, in action modes."""

    def run(platform):
        from fowt_env import envs

        for mode in modes:
            given = {"task": "above_rated", "platform": platform, "reward": "score", "action_mode": mode}
            environment = getattr(envs, name)(**given | settings)
            environment.reset(seed=0)
            environment.step(np.zeros(environment.action_space.shape, dtype=np.float32))
            environment.close()

    return run


def _linear(platform):
    from fowt_env.analysis.linear_model import linearize
    from fowt_env.scene.build import build_scene

    linearize(build_scene(platform, wind=18.0, sea=SEA, fidelity="standard"))


RUNS = "runs in turbulence and a random sea at fidelity"
KINDS: dict[str, tuple[str, Callable[[str], object]]] = {  # name: (summary, function that runs it)
    "standard": (f"{RUNS} standard", _simulated("standard", wind=WIND, sea=SEA)),
    "environment": (
        "reset and step of the Gymnasium environment",
        _stepped("FowtEnv", ("direct", "residual")),
    ),
    "easy": ("reset and step of the easiest task for agents", _stepped("FowtEnv", **EASY)),
    "vector": ("reset and step of the vector environment", _stepped("FowtVectorEnv", num_envs=2)),
    "steady": (
        "runs in a steady wind and still water at fidelity standard",
        _simulated("standard", wind=18.0),
    ),
    "linear": ("linear models", _linear),
    "fast": (f"{RUNS} fast", _simulated("fast", wind=WIND, sea=SEA)),
    "reference": (f"{RUNS} reference", _simulated("reference", wind=WIND, sea=SEA)),
}
USUAL = ("standard", "environment")
PACKED = ("standard", "environment", "easy", "vector", "steady")  # which a wheel brings compiled


def warmup(
    platform: str = "oc3_hywind",
    kinds: Sequence[str] = USUAL,
    jobs: int = 1,
    progress: Callable[[str, int, int], object] | None = None,
) -> pd.DataFrame:
    """Compile kinds of scene that are not yet on disk; return a DataFrame (kind, kernels, seconds).

    platform  a built-in name or the path of a TOML file
    kinds     names of KINDS; shared kernels are compiled with the first kind
    jobs      processes: with more than one, the first kind is compiled here, then the others in parallel
    progress  called with (kind, kinds done, kernels compiled) in a process that compiles

    Raises: InputError before anything is compiled for an unknown kind or jobs below 1, and for a platform
    that cannot be read.
    """
    if not kinds:
        raise InputError("kinds = []: must name at least one")
    for kind in kinds:
        if kind not in KINDS:
            raise unknown("kind", kind, KINDS)
    check_whole_number("jobs", jobs, 1)
    progress = progress or (lambda *_: None)
    first, *others = dict.fromkeys(kinds)
    here = [first, *others] if jobs == 1 else [first]
    rows = [_compiled(platform, kind, done, progress) for done, kind in enumerate(here)]
    pool = ThreadPoolExecutor(jobs)
    try:
        tasks = [pool.submit(_compiled_apart, platform, kind) for kind in others if jobs > 1]
        for task in as_completed(tasks):
            rows.append(task.result())
            progress(rows[-1][0], len(rows), 0)
    finally:
        pool.shutdown(cancel_futures=True)
    return pd.DataFrame(rows, columns=["kind", "kernels", "seconds"])


def _compiled(platform, kind, done, progress):
    """Compile a kind in this process and return its row."""
    from fowt_env.plant.compile.notice import compilation_reported

    begin, counts = time.perf_counter(), [0]

    def report(count):
        counts[0] = count
        progress(kind, done, count)

    with compilation_reported(report):
        KINDS[kind][1](platform)
    progress(kind, done + 1, counts[0])
    return kind, counts[0], time.perf_counter() - begin


CHILD = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from fowt_env.errors import InputError
from fowt_env.warmup import warmup
try:
    (row,) = warmup(sys.argv[2], [sys.argv[3]]).itertuples(index=False)
except InputError as error:
    sys.exit(str(error))
print(json.dumps(list(row)))
"""


def _compiled_apart(platform, kind):
    """Compile a kind in a separate process and return its row. Raises: InputError."""
    words = [sys.executable, "-c", CHILD, json.dumps(sys.path), str(platform), kind]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        raise InputError(f"kind {kind}: {done.stderr.strip()[-600:]}")
    return tuple(json.loads(done.stdout.splitlines()[-1]))


def write_pack(target: str | Path) -> list[str]:
    """Write the kernels in this process's cache folder as a pack; return the names of its index files.

    Kernels that are linked into others are left out: their callers contain them.
    """
    from fowt_env.files.atomic import replacing
    from fowt_env.plant.compile.decorators import CACHE_FOLDER
    from fowt_env.shipped import MANIFEST, facts

    paths = [path for path in sorted(CACHE_FOLDER.rglob("*.nb[ic]")) if ".linked" not in path.name]
    names = [PurePosixPath(path.relative_to(CACHE_FOLDER).as_posix()) for path in paths]
    indices = [name for name in names if name.suffix == ".nbi"]
    contents = {MANIFEST: json.dumps(facts(indices), indent=1).encode()}
    contents |= {name.as_posix(): path.read_bytes() for name, path in zip(names, paths, strict=True)}
    with replacing(target) as temporary, tarfile.open(temporary, "w:xz") as archive:
        for name, content in contents.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return [name.as_posix() for name in indices]


PACKER = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from fowt_env.warmup import warmup, write_pack
warmup(kinds=json.loads(sys.argv[2]))
write_pack(sys.argv[3])
"""


def compile_pack(folder: str | Path, kinds: Sequence[str] = PACKED) -> Path:
    """Compile kinds of scene for x86-64-v3, apart from this process and cache; return the path of their pack.

    folder  where the pack is written: fowt_env/kernels of the sources that a wheel is built from
    kinds   names of KINDS, compiled for OC3-Hywind

    Raises: InputError for an unknown kind, or if the kernels could not be compiled.
    """
    from fowt_env.shipped import PACK, VARIABLES

    for kind in kinds:
        if kind not in KINDS:
            raise unknown("kind", kind, KINDS)
    target = Path(folder, PACK.name)
    with tempfile.TemporaryDirectory() as kernels:
        variables = os.environ | VARIABLES | {"FOWT_CACHE_DIR": kernels}
        words = [sys.executable, "-c", PACKER, json.dumps(sys.path), json.dumps(list(kinds)), str(target)]
        done = subprocess.run(words, capture_output=True, text=True, env=variables)
    if done.returncode != 0:
        raise InputError(f"the pack could not be compiled: {done.stderr.strip()[-600:]}")
    return target
