"""Compiling the usual kinds of scene ahead, so that no later run waits for it."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.errors import InputError, unknown

WIND, SEA = {"kind": "ntm", "speed": 18.0}, {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}


def _simulated(platform, fidelity, **weather):
    from fowt_env.run.simulation import simulate
    from fowt_env.scene.build import build_scene

    scene = build_scene(platform, fidelity=fidelity, **weather)
    simulate(scene, "pi", duration=1.0)
    return scene


def _environment(platform):
    from fowt_env.envs import FowtEnv

    environment = FowtEnv("above_rated", platform=platform)
    environment.reset(seed=0)
    environment.step(np.zeros(environment.action_space.shape, dtype=np.float32))


def _vector(platform):
    from fowt_env.envs import FowtVectorEnv

    environments = FowtVectorEnv(num_envs=2, task="above_rated", platform=platform)
    environments.reset(seed=0)
    environments.step(np.zeros(environments.action_space.shape, dtype=np.float32))
    environments.close()


def _linear(platform):
    from fowt_env.analysis.linear_model import linearize
    from fowt_env.scene.build import build_scene

    linearize(build_scene(platform, wind=18.0, sea=SEA, fidelity="standard"))


KINDS: dict[str, tuple[str, Callable[[str], object]]] = {  # name: what it is, and how it is run
    "standard": (
        "runs in turbulence and a random sea at fidelity standard",
        lambda platform: _simulated(platform, "standard", wind=WIND, sea=SEA),
    ),
    "environment": ("reset and step of the Gymnasium environment", _environment),
    "vector": ("reset and step of the vector environment", _vector),
    "steady": (
        "runs in a steady wind and still water at fidelity standard",
        lambda platform: _simulated(platform, "standard", wind=18.0),
    ),
    "linear": ("linear models", _linear),
    "fast": (
        "runs in turbulence and a random sea at fidelity fast",
        lambda platform: _simulated(platform, "fast", wind=WIND, sea=SEA),
    ),
    "reference": (
        "runs in turbulence and a random sea at fidelity reference",
        lambda platform: _simulated(platform, "reference", wind=WIND, sea=SEA),
    ),
}
USUAL = ("standard", "environment")


def warmup(
    platform: str = "oc3_hywind",
    kinds: Sequence[str] = USUAL,
    jobs: int = 1,
    progress: Callable[[str, int, int], object] | None = None,
) -> pd.DataFrame:
    """DataFrame (kind, kernels, seconds) of the kinds that are compiled, where they are not yet on disk.

    platform  a built-in name or the path of a TOML file
    kinds     names of KINDS; what they share is compiled with the first
    jobs      processes: with more than one, the first kind is compiled here, then the others side by side
    progress  called with (kind, kinds done, kernels compiled) in a process that compiles

    Raises: InputError before anything is compiled for an unknown kind or jobs below 1, and for a platform
    that cannot be read.
    """
    if not kinds:
        raise InputError("kinds = []: name at least one")
    for kind in kinds:
        if kind not in KINDS:
            raise unknown("kind", kind, KINDS)
    check_whole_number("jobs", jobs, 1)
    rows, waiting = [], list(dict.fromkeys(kinds))
    while waiting and (jobs == 1 or not rows):
        kind = waiting.pop(0)
        rows.append(_compiled(platform, kind, len(rows), progress or (lambda *_: None)))
    running: dict[str, subprocess.Popen] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                kind = waiting.pop(0)
                running[kind] = _started(platform, kind)
            kind = next((name for name, one in running.items() if one.poll() is not None), "")
            if not kind:
                time.sleep(0.05)
                continue
            rows.append(_ended(kind, running.pop(kind)))
            if progress is not None:
                progress(kind, len(rows), 0)
    finally:
        for process in running.values():
            process.kill()
            process.wait()
    return pd.DataFrame(rows, columns=["kind", "kernels", "seconds"])


def _compiled(platform, kind, done, progress):
    """Row of a kind that is compiled in this process."""
    from fowt_env.plant.compile.notice import compilation_reported

    begin, compiled = time.perf_counter(), 0

    def said(count):
        nonlocal compiled
        compiled = count
        progress(kind, done, count)

    with compilation_reported(said):
        KINDS[kind][1](platform)
    progress(kind, done + 1, compiled)
    return kind, compiled, time.perf_counter() - begin


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


def _started(platform, kind):
    """A process that compiles a kind."""
    words = [sys.executable, "-c", CHILD, json.dumps(sys.path), str(platform), kind]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _ended(kind, process):
    """Row of a kind from a process that has ended."""
    stdout, stderr = process.communicate()
    if process.returncode != 0:
        raise InputError(f"kind {kind}: {stderr.strip()[-600:]}")
    return tuple(json.loads(stdout.splitlines()[-1]))
