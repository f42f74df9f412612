"""rl-baselines3-zoo itself accepts the files of settings, in an environment of its own."""

import os
from pathlib import Path

import pytest
from distributions import ROOT, installed, repository, run, wheel_of

NAME = "fowt_env/OC3HywindEasy-v0"
DECISIONS = {"ppo": 2000, "sac": 5200, "tqc": 5200}  # the others learn from 5000 on


@pytest.mark.nightly
def test_the_zoo_trains_with_the_files_of_settings(tmp_path):
    python = installed(tmp_path, "rl_zoo3")
    wheel = wheel_of(repository(tmp_path / "sources"), tmp_path / "wheel")
    run(python, "-m", "pip", "install", "--quiet", wheel)
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    for algo, steps in DECISIONS.items():
        file = ROOT / "training" / "rl" / "zoo" / f"{algo}.yml"
        words = ("--algo", algo, "--env", NAME, "--gym-packages", "fowt_env", "--conf-file", file)
        words += ("-n", steps, "-f", tmp_path / "logs", "--device", "cpu")
        printed = run(python, "-m", "rl_zoo3.train", *words, cwd=tmp_path, env=environment)
        assert f"Loading hyperparameters from: {file}" in printed
        folder = tmp_path / "logs" / algo / f"{NAME.replace('/', '-')}_1"
        assert (folder / f"{NAME.replace('/', '-')}.zip").stat().st_size > 0
        assert "learning_rate" in Path(folder, NAME.replace("/", "-"), "config.yml").read_text()
