"""fowt doctor: what it finds, what it says about what is missing, and when it fails."""

import os
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from command_line import fowt

import fowt_env
from fowt_env.plant.compile import decorators
from fowt_env.plant.compile.versions import NUMBA, Package, check_numba
from fowt_env.training.cli import health, requirements

REQUIRES = [
    "numpy>=2.0",
    'matplotlib>=3.8; extra == "plot"',
    'fowt-no-such-package>=1; extra == "magic"',
    'fowt-env[plot,train]; extra == "dev"',
    'pytest>=8; extra == "dev"',
]


def doctor(*arguments, code=0):
    return fowt("doctor", *arguments, code=code)[0]


def test_the_self_test_gives_its_figures_and_fails_with_code_1_on_a_wrong_one(monkeypatch):
    stdout = doctor()
    assert "passed" in stdout and "expected" in stdout and "60 s simulated in" in stdout
    moved = health.reference_run()
    moved["RotSpeed_[rpm]"] *= 1.002
    monkeypatch.setattr(health, "reference_run", lambda: moved)
    stdout = doctor(code=1)
    assert "FAILED" in stdout and "2.0e-03" in stdout


def test_a_missing_part_is_told_with_how_to_install_it(monkeypatch):
    named = [package.name for package in requirements.versions()]
    assert len(named) == len(set(named)) and {"numba", "llvmlite"} < set(named)
    monkeypatch.setattr(metadata, "requires", lambda name: REQUIRES)
    assert {package.name: package.version for package in requirements.versions()}["numpy"] == np.__version__
    assert set(requirements.optional_parts()) == {"plot", "magic"}
    stdout = doctor("--no-test")
    (line,) = (line for line in stdout.splitlines() if "magic" in line)
    assert "missing" in line and 'pip install "fowt-env[magic]"' in line
    (line,) = (line for line in stdout.splitlines() if "matplotlib" in line)
    assert "installed" in line and "pip install" not in line


def test_a_folder_that_was_never_installed_is_no_failure(monkeypatch):
    def absent(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", absent)
    assert "pip install -e ." in doctor("--no-test")


def test_the_cache_is_measured_and_other_versions_counted(tmp_path, monkeypatch):
    folder = tmp_path / "this"
    (folder / "loads").mkdir(parents=True)
    (folder / "loads" / "kernel.nbi").write_bytes(b"0" * 2_000_000)
    for name in ("0123456789abcdef", "somebody's"):
        (tmp_path / name).mkdir()
        (tmp_path / name / decorators.MARKER).touch()
    monkeypatch.setattr(health, "CACHE_FOLDER", folder)
    monkeypatch.setattr(decorators, "CACHE_FOLDER", folder)
    text = f"{folder}: 2.0 MB of compiled kernels, 1 folders of other versions"
    assert health.cache_state() == (text, "") and text in doctor("--no-test")


def test_a_cache_that_cannot_be_used_or_written_is_told_with_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr(health, "CACHE_FOLDER", tmp_path)
    monkeypatch.setattr(health.os, "access", lambda path, mode: False)
    assert "read only" in doctor("--no-test")
    for module in (health, decorators):
        monkeypatch.setattr(module, "CACHE_FOLDER", None)
    assert "FOWT_CACHE_DIR to a writable folder" in doctor("--no-test")


@pytest.mark.parametrize(
    ("found", "word"), [("0.61.0", "old"), ("0.67.1rc1", "old"), ("0.69.0", "new"), ("1.0", "new")]
)
def test_a_numba_that_cannot_compile_the_kernels_is_told_before_it_is_tried(found, word, monkeypatch):
    """Whatever the metadata says, which may be that of an older checkout."""
    real = metadata.version
    monkeypatch.setattr(metadata, "requires", lambda name: ["numba>=0.1"])
    monkeypatch.setattr(metadata, "version", lambda name: found if name == "numba" else real(name))
    monkeypatch.setitem(sys.modules, "fowt_env.training.cli.health", None)  # whose import ends the program
    monkeypatch.delattr("fowt_env.training.cli.health")
    stdout = doctor(code=1)
    assert f"numba {found} is too {word}: pip install 'numba{NUMBA}'" in stdout
    with pytest.raises(ImportError, match=f"numba {found} is too {word}"):
        check_numba(found)


def test_the_kernels_of_another_numba_are_not_even_tried():
    code = "import numba; numba.__version__ = '0.61.0'\nimport fowt_env.plant.state"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ)
    assert done.stderr.splitlines()[-1].startswith("ImportError: numba 0.61.0 is too old: pip install")


def test_a_requirement_that_is_not_met_is_told_and_fails(monkeypatch):
    asked = ["numpy<3,>=99.0", "scipy>=1", 'matplotlib<2; extra == "plot"']
    monkeypatch.setattr(metadata, "requires", lambda name: asked)
    stdout = doctor(code=1)
    assert f"numpy {metadata.version('numpy')} is too old: pip install 'numpy<3,>=99.0'" in stdout
    assert "scipy " in stdout and "scipy is" not in stdout
    (line,) = (line for line in stdout.splitlines() if "matplotlib" in line)
    assert "required: <2" in line and 'pip install "fowt-env[plot]"' in line


def test_what_numba_itself_refuses_is_told_in_a_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "fowt_env.training.cli.health", None)
    monkeypatch.delattr("fowt_env.training.cli.health")
    stdout = doctor(code=1)
    assert "Traceback" not in stdout and "fowt_env.training.cli.health" in stdout.splitlines()[-1]


@pytest.mark.parametrize(
    ("version", "needed", "fits"),
    [
        ("1.26.4", ">=2.0", False), ("2.13.0+cpu", "==2.13.0", True), ("2.0.dev3", "<2,>=1.0", False),
        ("0.68.10", ">=0.68,<0.69", True), ("3.1", "", True),
    ],
)  # fmt: skip
def test_versions_are_compared_by_their_numbers(version, needed, fits):
    assert Package("package", version, needed).fits is fits


def test_the_bounds_of_numba_are_those_of_the_metadata():
    with open(Path(fowt_env.__file__).parent.parent / "pyproject.toml", "rb") as file:
        needed = tomllib.load(file)["project"]["dependencies"]
    assert f"numba{NUMBA}" in needed


def test_help_of_the_command_line_does_not_wait_for_numba():
    code = "import sys, fowt_env.training.cli.app; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ)
    assert done.stdout.strip() == "False", done.stderr
