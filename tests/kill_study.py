"""Kill -9 at random moments: does what is left stay readable, and does going on give the same figures?

    python tests/kill_study.py evaluate --kills 20 --seed 1 --folder study

A run goes through once, undisturbed. Then it is started again and again in one folder and killed at a moment
that is drawn from a seed, until it ends by itself; the rest of the kills are had in the same way in further
folders. After each kill every file of the folder is read. Runs are forked from a process that has imported
everything, so that the moments fall into the work and not into the start of Python.
"""

import argparse
import json
import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

import fowt_env.training.cli.app
from fowt_env.controllers.policy.controller import read_policy
from fowt_env.files.atomic import is_leftover
from fowt_env.training.evaluation import results

ROOT = Path(__file__).resolve().parent.parent
EVALUATE = (
    "evaluate --controllers pi,pi_land --cases ntm_16,ntm_18 --seeds 1,2 --duration 30 --skip 5 --no-plot"
)
VALIDATE = "dev validate --case steady --no-plot"
TRAIN = (
    "train --algo {algo} --steps 160 --seed 3 --set environment.num_envs=2 --set environment.rotor=table"
    " --set environment.wave_components=10 --set environment.duration=12 --set decisions.history=2"
    ' --set environment.wind={{"kind":"ntm","speed":18,"class":"B"}} --set validation.winds=[18]'
    " --set validation.seeds=2 --set validation.every=64 --set validation.skip=2"
    " --set checkpoint_minutes=0 --set algorithm.batch_size=16 {further}"
)
PPO = TRAIN.format(algo="ppo", further="--set algorithm.n_steps=16 --set algorithm.n_epochs=2")
SAC = TRAIN.format(algo="sac", further="--set algorithm.buffer_size=500 --set algorithm.learning_starts=20")


def command(study, folder):
    """Words of the command line that starts the study's run in the folder, or goes on with it."""
    if study in ("ppo", "sac"):
        if (folder / "settings.yml").exists():
            return ["train", "--resume", "--out", str(folder)]
        return [*{"ppo": PPO, "sac": SAC}[study].split(), "--out", str(folder)]
    return [*{"evaluate": EVALUATE, "validate": VALIDATE}[study].split(), "--out", str(folder)]


def started(words, log):
    """Identifier of a process that runs `fowt` with the words."""
    process = os.fork()
    if process == 0:
        handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(handle, 1)
        os.dup2(handle, 2)
        sys.argv = ["fowt", *words]
        code = 70
        try:
            fowt_env.training.cli.app.main()
        except SystemExit as end:
            code = end.code or 0
        finally:
            os._exit(code)
    return process


def went_through(words, log):
    """Seconds that a run took which nothing disturbed. Raises: RuntimeError where it failed."""
    begin = time.monotonic()
    _, status = os.waitpid(started(words, log), 0)
    if status != 0:
        raise RuntimeError(f"{' '.join(words)}: status {status}: {log.read_text()[-2000:]}")
    return time.monotonic() - begin


def killed(words, log, delay):
    """Whether a run was still going on after `delay` seconds and has been killed."""
    process = started(words, log)
    deadline = time.monotonic() + delay
    while time.monotonic() < deadline:
        if os.waitpid(process, os.WNOHANG)[0]:
            return False
        time.sleep(0.002)
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return True


def check_readable(folder, reference):
    """Read every file of a folder; assert that rows of tables are those of the undisturbed run."""
    for path in sorted(folder.rglob("*")):
        if path.is_dir() or is_leftover(path) or ".writing_" in str(path) or "tensorboard" in path.parts:
            continue
        if path.suffix == ".csv":
            check_rows(pd.read_csv(path), reference[path.name])
        elif path.suffix == ".json":
            json.loads(path.read_text(encoding="utf-8"))
        elif path.suffix == ".parquet":
            assert len(pd.read_parquet(path)) == 301, path
            results.read_row(path)
        elif path.suffix == ".yml":
            assert yaml.safe_load(path.read_text(encoding="utf-8"))["algo"]
        elif path.suffix == ".npz":
            read_policy(path)
        elif path.suffix == ".png":
            assert path.read_bytes()[-8:-4] == b"IEND", path
        elif path.suffix == ".md":
            assert path.read_text(encoding="utf-8") == reference[path.name], path
        else:
            assert path.suffix in (".pkl", ".zip", ".txt"), f"a file that was not expected: {path}"


def check_rows(table, whole):
    """Assert that each row of a table is in the whole one (wall times apart)."""
    rows, known = (frame.drop(columns="seconds", errors="ignore").astype(str) for frame in (table, whole))
    assert list(rows.columns) == list(known.columns)
    assert set(map(tuple, rows.to_numpy())) <= set(map(tuple, known.to_numpy()))


def outcome(folder):
    """{file: content} of a folder whose run has ended, for comparison; wall times and dates left out."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.suffix == ".csv":
            found[name] = pd.read_csv(path).drop(columns="seconds", errors="ignore").to_csv()
        elif path.suffix == ".npz":
            with np.load(path) as file:
                found[name] = {key: file[key].tobytes() for key in file.files}
        elif path.suffix == ".parquet":
            found[name] = pd.read_parquet(path).to_numpy().tobytes()
        elif path.suffix == ".md":
            found[name] = path.read_text(encoding="utf-8")
        elif path.name == "leaderboard.json":
            board = json.loads(path.read_text(encoding="utf-8"))
            found[name] = json.dumps({key: board[key] for key in board if key != "created"})
    return found


def run_study(study, kills, seed, place):
    """Mapping of figures of a study. Raises: AssertionError where anything is lost or differs."""
    place.mkdir(parents=True, exist_ok=True)
    log = place / "log.txt"
    whole = place / "whole"
    went_through(command(study, place / "first"), log)  # imports, compiles and fills caches
    length = went_through(command(study, whole), log)
    expected = outcome(whole)
    reference = {path.name: pd.read_csv(path) for path in whole.glob("*.csv")}
    reference |= {path.name: path.read_text(encoding="utf-8") for path in whole.glob("*.md")}
    rng = random.Random(seed)
    done = rounds = beyond_start = 0
    while done < kills:
        folder = place / f"round_{rounds}"
        if study == "validate":  # what an earlier run left must outlive the kill of a later one
            went_through(command(study, folder), log)
        while done < kills and killed(command(study, folder), log, rng.uniform(0.0, length)):
            done += 1
            beyond_start += folder.exists()
            check_readable(folder, reference)
        went_through(command(study, folder), log)
        assert outcome(folder) == expected, f"{folder} differs from {whole}"
        assert not [path for path in folder.rglob("*") if is_leftover(path) or ".writing_" in path.name]
        rounds += 1
    return {
        "study": study, "kills": done, "with files there": beyond_start, "folders": rounds,
        "seconds of a run": round(length, 2),
    }  # fmt: skip


def main():
    """Run one study and print its figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=("evaluate", "validate", "ppo", "sac"))
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, required=True)
    given = parser.parse_args()
    print(json.dumps(run_study(given.study, given.kills, given.seed, given.folder)))


if __name__ == "__main__":
    main()
