"""A killed evaluation loses and repeats nothing."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

import fowt_env
from fowt_env.training.evaluation import results
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.evaluate import evaluate

CALM, WINDY = Case("calm", 16.0), Case("windy", 18.0)
SCRIPT = """
import sys
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.cases import Case
if __name__ == "__main__":
    cases = [Case("calm", 16.0), Case("windy", 18.0)]
    settings = {"seeds": (1, 2, 3), "duration": 60.0, "skip": 5.0}
    evaluate("pi,pi_land", cases, folder=sys.argv[1], jobs=int(sys.argv[2]), **settings)
"""


def killed_evaluation(tmp_path, jobs, delays):
    """Return the table of a folder whose evaluation was killed after each delay (s) and then finished."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    folder = tmp_path / "out"
    command = [sys.executable, str(script), str(folder), str(jobs)]
    root = Path(fowt_env.__file__).parent.parent
    environment = os.environ | {"PYTHONPATH": f"{root}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    seen = {}
    for delay in (*delays, None):
        process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, start_new_session=True)
        if delay is None:
            assert process.wait(timeout=500) == 0, process.stderr.read()
        else:
            wait_for_runs(process, folder, len(seen) + 1, delay)
            process.send_signal(signal.SIGKILL)  # the parent alone: its workers must see to themselves
            process.wait()
        process.stderr.close()
        time.sleep(1.5)
        found = {path: path.stat().st_mtime_ns for path in folder.glob("runs/*/[!.]*.parquet")}
        assert all(found.get(path) == when for path, when in seen.items())  # nothing lost, nothing repeated
        for path in found:
            results.read_row(path)
        seen = found
    assert len(seen) == 12
    return pd.read_csv(folder / "results.csv")


def wait_for_runs(process, folder, count, delay):
    """Wait until `count` runs are there or the process has ended, and a little longer."""
    deadline = time.monotonic() + 300.0
    while time.monotonic() < deadline and process.poll() is None:
        if len(list(folder.glob("runs/*/[!.]*.parquet"))) >= count:
            break
        time.sleep(0.02)
    time.sleep(delay)


@pytest.mark.parametrize(
    ("jobs", "kills"),
    [
        (1, 1),
        pytest.param(1, 5, marks=pytest.mark.nightly),
        pytest.param(2, 5, marks=pytest.mark.nightly),
    ],
)
def test_an_evaluation_that_was_killed_goes_on_where_it_was(tmp_path, jobs, kills):
    rng = random.Random(jobs)
    delays = [0.05] if kills == 1 else [rng.uniform(0.0, 0.4) for _ in range(kills)]
    table, folder = killed_evaluation(tmp_path, jobs, delays), tmp_path / "whole"
    evaluate("pi,pi_land", [CALM, WINDY], folder=folder, seeds=(1, 2, 3), duration=60.0, skip=5.0)
    pd.testing.assert_frame_equal(table, pd.read_csv(folder / "results.csv"), check_exact=True)
