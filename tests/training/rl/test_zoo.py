"""rl-baselines3-zoo itself accepts the files of settings, in an environment of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from distributions import ROOT, index_reached, repository, run, wheel_of

NAME = "fowt_env/OC3HywindEasy-v0"
DECISIONS = {"ppo": 2000, "sac": 5200, "tqc": 5200}  # the others learn from 5000 on


@pytest.mark.slow
@pytest.mark.nightly
def test_the_zoo_trains_with_the_files_of_settings(tmp_path):
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    python = tmp_path / "venv" / "bin" / "python"
    done = subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "rl_zoo3"], capture_output=True, text=True
    )
    if done.returncode and not index_reached(python, tmp_path):
        pytest.skip("no package index: pip finds no version of itself there either")
    assert done.returncode == 0, done.stderr[-3000:]
    run(
        python,
        "-m",
        "pip",
        "install",
        "--quiet",
        wheel_of(repository(tmp_path / "sources"), tmp_path / "wheel"),
    )
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    for algo, steps in DECISIONS.items():
        file = ROOT / "training" / "rl" / "zoo" / f"{algo}.yml"
        words = ("--algo", algo, "--env", NAME, "--gym-packages", "fowt_env", "--conf-file", file)
        command = (
            python,
            "-m",
            "rl_zoo3.train",
            *words,
            "-n",
            steps,
            "-f",
            tmp_path / "logs",
            "--device",
            "cpu",
        )
        assert f"Loading hyperparameters from: {file}" in run(*command, cwd=tmp_path, env=environment)
        folder = tmp_path / "logs" / algo / f"{NAME.replace('/', '-')}_1"
        assert (folder / f"{NAME.replace('/', '-')}.zip").stat().st_size > 0
        assert "learning_rate" in Path(folder, NAME.replace("/", "-"), "config.yml").read_text()
