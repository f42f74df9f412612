"""The commands of learning: clear refusals, and a run from the command line."""

import pytest
from typer.testing import CliRunner

pytest.importorskip("stable_baselines3")

from fowt_env.cli import EXIT_INPUT, app

SMALL = (
    "environment.num_envs=2", "environment.rotor=table", "environment.wave_components=10",
    "environment.duration=12", "environment.wind=18", "validation.winds=[18]", "validation.seeds=1",
    "validation.skip=2", "validation.every=32", "algorithm.n_steps=16", "algorithm.batch_size=16",
)  # fmt: skip


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def train(folder, steps, *more):
    changes = [word for change in SMALL for word in ("--set", change)]
    return call("train", "--steps", steps, "--out", folder, *changes, *more)


def test_a_run_ends_goes_on_and_its_checkpoint_becomes_a_policy_on_request_only(tmp_path):
    folder = tmp_path / "run"
    assert train(folder, 32).exit_code == 0
    again = train(folder, 32)
    assert again.exit_code == EXIT_INPUT and "holds a run already" in again.output
    assert call("train", "--resume", "--out", folder, "--steps", 64).exit_code == 0
    assert [p.name for p in (folder / "checkpoints").iterdir()] == ["step_64"]
    refused = call("export-policy", folder, "--out", tmp_path / "p.npz")
    assert refused.exit_code == EXIT_INPUT and "executes code" in refused.output
    done = call("export-policy", folder, "--out", tmp_path / "p.npz", "--trust-zip")
    assert done.exit_code == 0 and "warning" in done.output
    assert (tmp_path / "p.npz").stat().st_size == pytest.approx((folder / "last.npz").stat().st_size, abs=50)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("train", "--algo", "dqn"), "unknown algorithm 'dqn'"),
        (("train", "--task", "below"), "unknown task"),
        (("train", "--steps", "0"), "steps = 0"),
        (("train", "--set", "reward=1"), "unknown setting 'reward'"),
        (("train", "--resume", "--set", "task=x", "--out", "nowhere"), "keeps its settings"),
        (("train", "--resume", "--out", "nowhere"), "holds no run"),
        (("export-policy", "nowhere", "--out", "p.zip"), "must end with .npz"),
    ],
)
def test_wrong_input_is_named(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = call(*arguments)
    assert result.exit_code == EXIT_INPUT and message in " ".join(result.output.split())
