"""A full disk, or a place where nothing can be written: one clear line, and what was there stays as it was.

The disk is full by a limit on the size of files. The place is one beneath a file, which stops even the
superuser.
"""

import resource
from contextlib import contextmanager

import pandas as pd
import pytest
from typer.testing import CliRunner

from fowt_env.training.cli import app as cli
from fowt_env.training.cli import console
from fowt_env.training.evaluation import results

SHORT = ("--wind", "18", "--duration", "20", "--option", "wave_components=10")
EVALUATE = ("evaluate", "--controllers", "pi", "--cases", "ntm_18", "--duration", "20", "--skip", "5")
TRAIN = (
    "train", "--steps", "64", "--seed", "3", "--set", "environment.num_envs=2", "--set",
    "environment.rotor=table", "--set", "environment.wave_components=10", "--set", "environment.duration=12",
    "--set", 'environment.wind={"kind": "ntm", "speed": 18.0, "class": "B"}', "--set", "decisions.history=2",
    "--set", "validation.winds=[18]", "--set", "validation.seeds=2", "--set", "validation.every=64",
    "--set", "validation.skip=2", "--set", "algorithm.n_steps=16", "--set", "algorithm.batch_size=16",
    "--set", "checkpoint_minutes=0",
)  # fmt: skip


@contextmanager
def files_of_at_most(size):
    """Context in which no file grows beyond so many bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def invoke(*words):
    return CliRunner().invoke(cli.app, list(map(str, words)), env={"COLUMNS": "1000", "NO_COLOR": "1"})


def refused(*words, named):
    """Assert that a command ends with one line that names a path, and without a traceback."""
    result = invoke(*words)
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == console.EXIT_INPUT, result.output
    lines = [line for line in result.stderr.splitlines() if line.startswith("Error:")]
    assert len(lines) == 1 and str(named) in lines[0] and "cannot be written" in lines[0], result.stderr
    assert "Traceback" not in result.output


def contents(folder):
    """{path: bytes} of everything in a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def evaluation(tmp_path_factory):
    """Folder of a small evaluation that succeeded, with its page."""
    pytest.importorskip("plotly", reason="plotly is not installed")
    folder = tmp_path_factory.mktemp("evaluation") / "results"
    for words in ((*EVALUATE, "--out", folder, "--no-plot"), ("report", folder, "--no-schedule")):
        result = invoke(*words)
        assert result.exit_code == 0, result.output
    return folder


@pytest.mark.parametrize("name", ["run.csv", "run.parquet", "run.outb", "run.png"])
def test_simulate_without_space_names_the_file_and_keeps_the_old_one(tmp_path, name):
    path = tmp_path / name
    path.write_text("old")
    with files_of_at_most(2000):
        refused("simulate", *SHORT, "--plot" if name.endswith("png") else "--out", path, named=path)
    assert contents(tmp_path) == {path: b"old"}


def test_evaluate_without_space_keeps_the_runs_there_are_and_goes_on_later(evaluation):
    before = contents(evaluation)
    more = (*EVALUATE, "--seeds", "1,2", "--out", evaluation, "--no-plot")
    with files_of_at_most(8000):
        refused(*more, named=results.run_file(evaluation / "runs", "pi", "ntm_18", 2))
    after = contents(evaluation)
    kept = {path for path in before if path.name != "manifest.json"}  # which has the new seed in it
    assert {path: after[path] for path in kept} == {path: before[path] for path in kept}
    assert set(after) == set(before)
    result = invoke(*more)
    assert result.exit_code == 0, result.output
    assert len(pd.read_csv(evaluation / "results.csv")) == 2


def test_report_without_space_keeps_the_old_page(evaluation):
    before = contents(evaluation)
    with files_of_at_most(100_000):
        refused("report", evaluation, "--no-schedule", named=evaluation / "report.html")
    assert contents(evaluation) == before


@pytest.mark.parametrize("ending", [".gif", ".mp4"])
def test_animate_without_space_names_the_file_and_keeps_the_old_one(tmp_path, ending):
    pytest.importorskip("pygame", reason="pygame is not installed")
    pytest.importorskip("imageio_ffmpeg", reason="imageio_ffmpeg is not installed")
    path = tmp_path / f"run{ending}"
    path.write_text("old")
    words = ("dev", "animate", path, "--controllers", "pi", "--duration", "20", "--width", "320")
    with files_of_at_most(3000):
        refused(*words, named=path)
    assert contents(tmp_path) == {path: b"old"}


@pytest.mark.nightly
def test_train_without_space_keeps_the_checkpoint_before_and_goes_on_later(tmp_path):
    pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    folder = tmp_path / "run"
    assert invoke(*TRAIN, "--out", folder).exit_code == 0
    (checkpoint,) = (folder / "checkpoints").iterdir()
    before = contents(checkpoint)
    with files_of_at_most(20_000):
        refused("train", "--resume", "--steps", "128", "--out", folder, named="checkpoints")
    assert contents(checkpoint) == before
    assert list((folder / "checkpoints").iterdir()) == [checkpoint]
    result = invoke("train", "--resume", "--steps", "128", "--out", folder)
    assert result.exit_code == 0, result.output


def test_validate_without_space_keeps_the_old_table(tmp_path):
    words = ("dev", "validate", "--case", "steady", "--no-plot", "--out", tmp_path)
    result = invoke(*words)
    assert result.exit_code == 0, result.output
    before = contents(tmp_path)
    with files_of_at_most(1000):
        refused(*words, named=tmp_path / "validation.csv")
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    "words",
    [
        ("simulate", *SHORT, "--out", "PLACE/run.csv"),
        ("simulate", *SHORT, "--plot", "PLACE/run.png"),
        (*EVALUATE, "--no-plot", "--out", "PLACE"),
        (*TRAIN, "--out", "PLACE"),
        ("dev", "animate", "PLACE/run.gif", "--controllers", "pi", "--duration", "10", "--width", "320"),
        ("dev", "benchmark", "evaluation", "--count", "1", "--out", "PLACE/table.csv"),
        ("model", "trim", "--winds", "18", "--out", "PLACE/trim.csv"),
    ],
    ids=lambda words: f"{words[0]} {words[-2]}",
)
def test_a_place_where_nothing_can_be_written_is_named(tmp_path, words):
    (tmp_path / "file").write_text("no folder")
    place = tmp_path / "file" / "below"
    refused(*(str(word).replace("PLACE", str(place)) for word in words), named=tmp_path / "file")
    assert contents(tmp_path) == {tmp_path / "file": b"no folder"}


def test_report_into_a_place_where_nothing_can_be_written_names_it(evaluation, tmp_path):
    (tmp_path / "file").touch()
    out = tmp_path / "file" / "page.html"
    refused("report", evaluation, "--no-schedule", "--out", out, named=out)
