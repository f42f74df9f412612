"""The commands of learning: clear refusals, and a run from the command line."""

import re
import shlex

import pandas as pd
import pytest
from typer.testing import CliRunner

pytest.importorskip("stable_baselines3")

from fowt_env.training.benchmarks.training import VECTOR_ENVS
from fowt_env.training.cli import train as cli_train
from fowt_env.training.cli.app import app
from fowt_env.training.cli.console import EXIT_INPUT, EXIT_INTERRUPTED
from fowt_env.training.rl import callbacks
from fowt_env.training.rl.train import Training

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
    assert again.exit_code == EXIT_INPUT and "already contains a run" in again.output
    assert call("train", "--resume", "--out", folder, "--steps", 64).exit_code == 0
    assert [p.name for p in (folder / "checkpoints").iterdir()] == ["step_64"]
    refused = call("connect", "export-policy", folder, "--out", tmp_path / "p.npz")
    assert refused.exit_code == EXIT_INPUT and "executes code" in refused.output
    done = call("connect", "export-policy", folder, "--out", tmp_path / "p.npz", "--trust-zip")
    assert done.exit_code == 0 and "warning" in done.output
    assert (tmp_path / "p.npz").stat().st_size == pytest.approx((folder / "last.npz").stat().st_size, abs=50)


@pytest.mark.nightly
def test_a_run_is_validated_by_quarters_and_the_command_that_it_prints_works(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli_train, "LINE_EVERY", 0.0)
    monkeypatch.setattr(callbacks, "REPORT_EVERY", 0.0)
    done = train("run of mine", 64, "--set", "validation.every=1000000")
    assert done.exit_code == 0, done.output
    table = pd.read_csv(tmp_path / "run of mine" / "validation.csv")
    assert list(table["decisions"]) == [0, 16, 32, 48, 64]
    said = " ".join(done.output.split())
    assert "scoring the reference lqr" in said and "decisions/s" in said and " left" in said
    assert "return -" not in said and "created the folder run of mine" in said
    assert f"{table['score'][0]:.4g}" in said and "relative to lqr (score 1)" in said
    (command,) = re.findall(r"next: (fowt evaluate .*)", done.stderr)
    assert "policy:run of mine/best.npz,lqr" in command and "--baseline lqr" in command
    short = ("--cases", "steady_16", "--duration", "15", "--skip", "5", "--no-plot")
    result = call(*shlex.split(command)[1:], *short)
    assert result.exit_code == 0, result.output
    scored = pd.read_csv(tmp_path / "results" / "run of mine" / "results.csv")
    assert (scored["status"] == "ok").all()
    assert set(scored["controller"]) == {"policy:run of mine/best.npz", "lqr"}


def test_seeds_and_settings_are_trained_side_by_side_and_the_same_command_keeps_what_is_there(tmp_path):
    folder = tmp_path / "both"
    several = ("--seeds", "0", "--sweep", "algorithm.gamma=[0.9,0.99]")
    done = train(folder, 32, *several)
    assert done.exit_code == 0, done.output
    table = pd.read_csv(folder / "trainings.csv")
    assert set(table["folder"]) == {"gamma=0.9_seed_0", "gamma=0.99_seed_0"} and set(table["last"]) == {32}
    assert "gamma=0.9_seed_0" in done.output and "wrote trainings.csv and 2 runs" in done.output
    paths = sorted(folder.glob("*/last.npz"))
    written = [path.stat().st_mtime_ns for path in paths]
    assert len(paths) == 2 and train(folder, 32, *several).exit_code == 0
    assert [path.stat().st_mtime_ns for path in paths] == written
    other = train(folder, 64, *several)
    assert other.exit_code == EXIT_INPUT and "other settings" in other.output
    refused = train(folder, 32, "--seeds", "0", "--resume")
    assert refused.exit_code == EXIT_INPUT and "the same command continues" in refused.output


def test_an_interrupted_run_ends_with_a_checkpoint_its_own_exit_code_and_goes_on(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    whole = Training.save

    def save_and_ask(run):
        run.stop = True  # as an interrupt does
        return whole(run)

    monkeypatch.setattr(callbacks, "REPORT_EVERY", 0.0)
    monkeypatch.setattr(Training, "save", save_and_ask)
    stopped = train(folder, 96, "--set", "checkpoint_minutes=0")
    assert stopped.exit_code == EXIT_INTERRUPTED, stopped.output
    assert "stopped with a checkpoint" in stopped.output
    (checkpoint,) = (folder / "checkpoints").iterdir()
    assert checkpoint.name != "step_96"
    monkeypatch.undo()
    done = call("train", "--resume", "--trust-zip", "--out", folder)
    assert done.exit_code == 0 and "finished" in done.output and "warning: executing code" in done.output
    assert [p.name for p in (folder / "checkpoints").iterdir()] == ["step_96"]


@pytest.mark.nightly
def test_benchmark_training_writes_a_row_per_kind_of_environment(tmp_path):
    path = tmp_path / "training.csv"
    done = call("dev", "benchmark", "training", "--envs", "8", "--steps", "1024", "--out", path)
    assert done.exit_code == 0, done.output
    table = pd.read_csv(path, comment="#")
    assert list(table["kind"]) == list(VECTOR_ENVS) and (table["steps_per_s"] > 0.0).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("train", "--algo", "dqn"), "unknown algorithm 'dqn'"),
        (("train", "--task", "below"), "unknown task"),
        (("train", "--steps", "0"), "steps = 0"),
        (("train", "--set", "reward=1"), "unknown setting 'reward'"),
        (("train", "--resume", "--set", "task=x", "--out", "nowhere"), "keeps its settings"),
        (("train", "--resume", "--out", "nowhere"), "contains no run"),
        (("connect", "export-policy", "nowhere", "--out", "p.zip"), "must end with .npz"),
    ],
)
def test_wrong_input_is_named(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = call(*arguments)
    assert result.exit_code == EXIT_INPUT and message in " ".join(result.output.split())
