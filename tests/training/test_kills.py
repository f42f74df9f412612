"""Kill -9 at random moments: tests/kill_study.py asserts that all stays readable and going on gives the same.

FOWT_KILLS is the number of kills in all: 50 as documented, fewer by default.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "kill_study.py"
ROOT = SCRIPT.parent.parent
KILLS = int(os.environ.get("FOWT_KILLS", "8"))
SHARES = {"evaluate": 0.36, "ppo": 0.28, "sac": 0.12, "validate": 0.24}


@pytest.mark.nightly
@pytest.mark.parametrize("study", SHARES)
def test_killed_runs_stay_readable_and_end_as_if_they_had_not_been(tmp_path, study):
    if study in ("ppo", "sac"):
        pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    kills = max(1, round(KILLS * SHARES[study]))
    command = [sys.executable, SCRIPT, study, "--kills", str(kills), "--seed", "1", "--folder", tmp_path]
    variables = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, env=variables)
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads(done.stdout.splitlines()[-1])["kills"] == kills
