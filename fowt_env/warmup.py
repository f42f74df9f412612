"""Compiles the usual kinds of scene in advance, so that no later run waits for compilation."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed

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


def _stepped(name, **settings):
    """Return a function that resets and steps an environment, a class of fowt_env.envs."""

    def run(platform):
        from fowt_env import envs

        given = {"task": "above_rated", "platform": platform, "reward": "score"} | settings
        environment = getattr(envs, name)(**given)
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
    "environment": ("reset and step of the Gymnasium environment", _stepped("FowtEnv")),
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
