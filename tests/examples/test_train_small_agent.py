"""A minute of the example that trains a small agent."""

import runpy
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3")

EXAMPLE = Path(__file__).parents[2] / "examples" / "10_train_small_agent.py"


@pytest.mark.nightly
def test_a_minute_of_training_learns_what_the_platform_needs(tmp_path, capsys):
    main = runpy.run_path(str(EXAMPLE))["main"]
    assert main(["--steps", "200000", "--out", str(tmp_path / "run")])
    shown = capsys.readouterr().out
    assert "the agent is ahead" in shown and (tmp_path / "run" / "best.npz").exists()
