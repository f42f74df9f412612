"""Measures the compile time of a session: six kinds of scene in sequence, with an empty kernel cache.

The session uses only public names, so that `python compile_time.py` can time other versions of this project.
"""

import os
import subprocess
import sys
import tempfile

import pandas as pd

from fowt_env import InputError

REPORT = """
import time
start, cpu = time.perf_counter(), time.process_time()

def report(name):
    global start, cpu
    now, used = time.perf_counter(), time.process_time()
    print(f"{name}|{now - start}|{used - cpu}", flush=True)
    start, cpu = now, used
"""
SESSION = """
import numpy as np
import fowt_env

report("import")
def run(name, law="pi", initial=None, **what):
    scene = fowt_env.build_scene(fidelity="standard", **what)
    begin = {} if initial is None else {"initial": {"start": "zero"} | initial}
    fowt_env.simulate(scene, law, duration=10.0, **begin)
    report(name)

turbulence, sea = {"kind": "ntm", "speed": 18.0}, {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}
run("decay", None, initial={"PtfmPitch": 5.0})
run("regular wave", None, sea={"kind": "regular", "H": 6.0, "T": 10.0})
run("steady wind", wind=14.0)
run("turbulence and sea", wind=turbulence, sea=sea)
line = np.linspace(-75.0, 75.0, 16)
u = 18.0 + np.random.default_rng(0).normal(size=(100, 16, 16))
box = {"kind": "box", "u": u, "y": line, "z": line + 90.0, "dt": 0.5, "speed": 18.0}
run("full-field box", wind=box, sea=sea)
import gymnasium
env = gymnasium.make("fowt_env:fowt_env/OC3Hywind-v1")
env.reset(seed=0)
env.step(np.zeros(2, dtype=np.float32))
report("environment")
"""
NAMES = (
    "import", "decay", "regular wave", "steady wind", "turbulence and sea", "full-field box", "environment",
)  # fmt: skip


def session(code=SESSION, folder=None, progress=None):
    """Return a DataFrame (scene, seconds, processor_seconds) reported by code run in a new process.

    folder: kernel cache; None: an empty cache. progress: called with (text, done, total).
    Raises: InputError with the output of the process if it fails.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as empty:
            return session(code, empty, progress)
    process = subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", REPORT + code], env={**os.environ, "FOWT_CACHE_DIR": folder},
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    rows = []
    for line in process.stdout:
        rows.append(line.strip().split("|"))
        if progress is not None:
            progress(rows[-1][0], len(rows), len(NAMES))
    errors = process.communicate()[1]
    if process.returncode != 0:
        raise InputError(f"the session in a new process failed: {errors[-600:]}")
    types = {"seconds": float, "processor_seconds": float}
    return pd.DataFrame(rows, columns=["scene", *types]).astype(types)


if __name__ == "__main__":
    print(session().round(1).to_string(index=False))
