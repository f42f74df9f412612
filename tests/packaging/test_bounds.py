"""The versions that pyproject.toml allows: the lowest of each work together, the pinned ones are allowed."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CORE = [Requirement(text) for text in PROJECT["dependencies"]]
EXTRAS = [Requirement(text) for extra in PROJECT["optional-dependencies"].values() for text in extra]

# Steady wind over still water, in which an environment compiles fastest of what has a rotor.
SMOKE = """
from gymnasium.utils.env_checker import check_env

import fowt_env.controllers, fowt_env.training
from fowt_env.envs import FowtEnv

check_env(FowtEnv("steady"), skip_render_check=True)
print(fowt_env.__file__)
"""
COMMANDS = (  # the last two share one kind of scene, and write a parquet file and a results folder
    "--help",
    "evaluate --help",
    "list",
    "list controllers",
    "doctor --no-test",
    "simulate --wind 18 --duration 5 --out run.parquet",
    "evaluate --controllers gspi_oc3 --cases steady_18 --duration 60 --skip 10 --out results",
)


def lowest(requirement):
    """The lowest version that a requirement allows, as text."""
    (bound,) = (one.version for one in requirement.specifier if one.operator in (">=", "=="))
    return bound


def test_the_pinned_versions_are_within_the_declared_bounds():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = dict(line.split("==") for line in lines if "==" in line and not line.startswith("#"))
    pinned = {canonicalize_name(name): version for name, version in pinned.items()}
    left_out = {"fowt-env", "hipersim"}  # this project itself; not among what the tests install
    for requirement in CORE + EXTRAS:
        if requirement.name not in left_out:
            version = pinned[canonicalize_name(requirement.name)]
            assert version in requirement.specifier, f"constraints.txt: {version} is not {requirement}"


def test_numba_is_bounded_above_as_its_private_parts_are_used():
    (numba,) = [requirement for requirement in CORE if requirement.name == "numba"]
    assert any(one.operator == "<" for one in numba.specifier)


def index_reached(python, folder):
    """Whether pip can fetch a package that every index has: a bound that is not to be had is no excuse."""
    probe = [python, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", folder / "probe", "pip"]
    return subprocess.run(probe, capture_output=True).returncode == 0


@pytest.mark.slow
@pytest.mark.nightly
def test_the_lowest_declared_versions_run_what_users_run_first(tmp_path, record_property):
    """Every direct dependency at its lower bound, theirs as pip chooses; the checkout is not installed."""
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    python = tmp_path / "venv" / "bin" / "python"
    versions = [f"{requirement.name}=={lowest(requirement)}" for requirement in CORE]
    command = [python, "-m", "pip", "install", "--quiet", "--only-binary=:all:", *versions]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode and not index_reached(python, tmp_path):
        pytest.skip("no package index: pip finds no version of itself there either")
    assert done.returncode == 0, done.stderr[-3000:]
    listed = json.loads(run(python, "-m", "pip", "list", "--format", "json"))
    found = {canonicalize_name(package["name"]): package["version"] for package in listed}
    record_property("installed", " ".join(f"{name} {version}" for name, version in sorted(found.items())))
    for requirement in CORE:
        assert Version(found[canonicalize_name(requirement.name)]) == Version(lowest(requirement))

    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment |= {"PYTHONPATH": str(ROOT), "FOWT_CACHE_DIR": str(tmp_path / "cache")}
    options = {"cwd": tmp_path, "env": environment}
    assert str(ROOT) in run(python, "-c", SMOKE, **options)
    for words in COMMANDS:
        run(python, "-c", "from fowt_env.training.cli.app import main; main()", *words.split(), **options)
    assert (tmp_path / "run.parquet").stat().st_size > 0
    assert "gspi_oc3" in (tmp_path / "results" / "results.csv").read_text()


def run(*command, **options):
    """What a command printed; it must end well."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout
