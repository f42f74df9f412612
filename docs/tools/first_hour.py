"""A new user's first hour by the stopwatch: a fresh environment, an empty cache, and what is run first.

    python docs/tools/first_hour.py                        # with this Python, in an empty cache
    python docs/tools/first_hour.py --install "[train,plot]"  # in a new environment, also timed

Each row is a process of its own. All share one cache, as a user's do: a row compiles what the rows before
it have not. Seconds by the clock, and of the processor in user mode, which other work lengthens less.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TEN_LINES = """
import fowt_env
scene = fowt_env.build_scene(
    "oc3_hywind", wind={"kind": "ntm", "speed": 18.0, "class": "B"},
    sea={"kind": "jonswap", "Hs": 7.5, "Tp": 10.0, "gamma": 3.3}, seed=0, fidelity="standard",
)
df = fowt_env.simulate(scene, controller="pi", duration=600.0)
from fowt_env.visual.time_series import plot_run
plot_run(df).savefig("first.png")
"""
ENVIRONMENT = """
import gymnasium
import fowt_env
env = gymnasium.make("fowt_env/OC3Hywind-v2", task="above_rated")
env.reset(seed=1)
env.step(env.action_space.sample())
"""
VECTOR = """
import gymnasium
import fowt_env
envs = gymnasium.make_vec("fowt_env/OC3Hywind-v2", num_envs=8)
envs.reset(seed=1)
envs.step(envs.action_space.sample())
"""
LINEAR = """
import fowt_env
scene = fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard")
fowt_env.linearize(scene)
"""
CALIBRATE = "from fowt_env.training.benchmarks.speed import calibration; print(f'{calibration():.1f}')"
FOWT = ("-c", "from fowt_env.training.cli.app import main; main()")
ROWS = (  # what, words after `python`
    ("ten lines and the picture", ("-c", TEN_LINES)),
    ("the same again", ("-c", TEN_LINES)),
    ("fowt doctor", (*FOWT, "doctor")),
    ("gymnasium.make, reset, step", ("-c", ENVIRONMENT)),
    ("the same again", ("-c", ENVIRONMENT)),
    ("make_vec, reset, step", ("-c", VECTOR)),
    ("linearize", ("-c", LINEAR)),
    ("fowt model trim (fidelity reference)", (*FOWT, "model", "trim")),
    ("examples/05_own_sea_state.py", (str(ROOT / "examples" / "05_own_sea_state.py"),)),
    ("examples/06_own_load.py", (str(ROOT / "examples" / "06_own_load.py"),)),
    ("examples/06_own_load.py again", (str(ROOT / "examples" / "06_own_load.py"),)),
)


def timed(words, **options):
    """(seconds by the clock, of the processor in user mode, stderr) of a command that must end well."""
    begin, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{words}\n{done.stderr[-2000:]}")
    seconds = time.perf_counter() - begin
    return seconds, resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - used, done.stderr


def rows(folder, install):
    """Yield (what, seconds, seconds of the processor, whether it said that it compiles)."""
    python = sys.executable
    environment = {k: v for k, v in os.environ.items() if k != "FOWT_QUIET"}
    if install is not None:
        environment.pop("PYTHONPATH", None)
        make = [sys.executable, "-m", "venv", folder / "venv"]
        python = folder / "venv" / "bin" / "python"
        first = timed(make)
        get = [python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", "-e", f"{ROOT}{install}"]
        second = timed(get, env=environment)
        yield f"venv and pip install {install}", first[0] + second[0], first[1] + second[1], ""
    options = {"cwd": folder, "env": environment | {"FOWT_CACHE_DIR": str(folder / "cache")}}
    for what, words in ROWS:
        seconds, processor, said = timed([python, *words], **options)
        yield what, seconds, processor, "yes" if "compiling kernels" in said else ""
    done = subprocess.run([python, "-c", CALIBRATE], capture_output=True, text=True, check=True, **options)
    yield f"(calibration: {done.stdout.strip()} ms for 10^7 dependent multiply-adds)", 0.0, 0.0, ""


def main():
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--install", metavar="EXTRAS", help='make a new environment with these, e.g. "[plot]"'
    )
    install = parser.parse_args().install
    print("| step | clock s | processor s | said so |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="first-hour-") as folder:
        for what, seconds, processor, said in rows(Path(folder), install):
            times = f"{seconds:.1f} | {processor:.1f}" if seconds else " | "
            print(f"| {what} | {times} | {said} |", flush=True)


if __name__ == "__main__":
    main()
