"""fowt doctor: what it finds, what it says about what is missing, and when it fails."""

import os
import subprocess
import sys
from importlib import metadata

import pytest
from typer.testing import CliRunner

from fowt_env import cli, health

REQUIRES = [
    "numpy>=2.0",
    'matplotlib>=3.8; extra == "plot"',
    'fowt-no-such-package>=1; extra == "magic"',
    'fowt-env[plot,train]; extra == "dev"',
    'pytest>=8; extra == "dev"',
]


def doctor(*arguments, code=0):
    result = CliRunner().invoke(cli.app, ["doctor", *arguments], env={"COLUMNS": "200", "NO_COLOR": "1"})
    assert result.exit_code == code, f"{result.stdout}\n{result.exception!r}"
    return result.stdout


def test_the_self_test_gives_its_figures():
    stdout = doctor()
    assert "passed" in stdout and "expected" in stdout
    assert "60 s simulated in" in stdout


def test_a_wrong_figure_fails_with_code_1(monkeypatch):
    moved = health.reference_run()
    moved["RotSpeed_[rpm]"] *= 1.002
    monkeypatch.setattr(health, "reference_run", lambda: moved)
    stdout = doctor(code=1)
    assert "FAILED" in stdout and "2.0e-03" in stdout


def test_versions_are_those_installed(monkeypatch):
    monkeypatch.setattr(health.metadata, "requires", lambda name: REQUIRES)
    found = {package.name: package.version for package in health.versions()}
    assert found["numpy"] == metadata.version("numpy")
    assert found["Python"] == ".".join(map(str, sys.version_info[:3]))


def test_a_missing_part_is_told_with_how_to_install_it(monkeypatch):
    monkeypatch.setattr(health.metadata, "requires", lambda name: REQUIRES)
    assert set(health.optional_parts()) == {"plot", "magic"}
    stdout = doctor("--no-test")
    (line,) = (line for line in stdout.splitlines() if "magic" in line)
    assert "missing" in line and 'pip install "fowt-env[magic]"' in line
    (line,) = (line for line in stdout.splitlines() if "matplotlib" in line)
    assert "found" in line and "pip install" not in line


def test_a_folder_that_was_never_installed_is_no_failure(monkeypatch):
    def absent(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(health.metadata, "requires", absent)
    assert "pip install -e ." in doctor("--no-test")


def test_the_cache_is_measured_and_other_versions_counted(tmp_path, monkeypatch):
    folder = tmp_path / "this"
    (folder / "loads").mkdir(parents=True)
    (folder / "loads" / "kernel.nbi").write_bytes(b"0" * 2_000_000)
    (tmp_path / "older").mkdir()
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(health, "CACHE_FOLDER", folder)
    monkeypatch.setattr("fowt_env.warmup.CACHE_FOLDER", folder)
    state = health.cache_state()
    assert (state.folder, state.usable, state.compiled, state.others) == (folder, True, True, 1)
    assert state.megabytes == pytest.approx(2.0)
    assert "2.0 MB" in doctor("--no-test") and str(folder) in doctor("--no-test")


def test_a_cache_that_cannot_be_used_is_told_with_what_to_do(monkeypatch):
    monkeypatch.setattr(health, "CACHE_FOLDER", None)
    monkeypatch.setattr("fowt_env.warmup.CACHE_FOLDER", None)
    assert not health.cache_state().usable
    assert "FOWT_CACHE_DIR" in doctor("--no-test")


def test_help_of_the_command_line_does_not_wait_for_numba():
    code = "import sys, fowt_env.cli; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ)
    assert done.stdout.strip() == "False", done.stderr
