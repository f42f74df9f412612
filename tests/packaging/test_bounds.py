"""The versions that pyproject.toml allows: the lowest of each work together, the pinned ones are allowed."""

import ast
import json
import os
import sys
import tomllib
from pathlib import Path

import pytest
from distributions import installed, repository, run, wheel_of
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
    for requirement in CORE + EXTRAS:
        if requirement.name != "fowt-env":  # this project itself
            version = pinned[canonicalize_name(requirement.name)]
            assert version in requirement.specifier, f"constraints.txt: {version} is not {requirement}"


@pytest.mark.parametrize("name", ["numba", "llvmlite"])
def test_what_private_parts_are_used_of_is_bounded_above(name):
    (found,) = [requirement for requirement in CORE if requirement.name == name]
    assert any(one.operator == "<" for one in found.specifier)


SOURCES = ("fowt_env", "controllers", "training")
APART = (  # of an extra, of a clone
    "training/live/page.py", "training/rl/", "fowt_env/realtime/fmu_slave.py", "training/studies/",
    "training/validation/reference/",
)  # fmt: skip


def test_every_library_that_is_imported_at_the_top_of_a_module_is_declared():
    """The others are imported where they are used, and belong to extras."""
    declared = {canonicalize_name(requirement.name) for requirement in CORE}
    known = {*sys.stdlib_module_names, *declared, "fowt_env", "pydantic_core"}  # pydantic has the last
    missing = set()
    for path in (path for folder in SOURCES for path in (ROOT / folder).rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Import | ast.ImportFrom) and not place.startswith(APART):
                named = [node.module] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
                missing |= {f"{place}: {name}" for name in named if name.partition(".")[0] not in known}
    assert not missing


@pytest.mark.nightly
def test_the_lowest_declared_versions_run_what_users_run_first(tmp_path, record_property):
    """Every direct dependency at its lower bound, theirs as pip chooses."""
    versions = [f"{requirement.name}=={lowest(requirement)}" for requirement in CORE]
    python = installed(tmp_path, "--only-binary=:all:", *versions)
    listed = json.loads(run(python, "-m", "pip", "list", "--format", "json"))
    found = {canonicalize_name(package["name"]): package["version"] for package in listed}
    record_property("installed", " ".join(f"{name} {version}" for name, version in sorted(found.items())))
    for requirement in CORE:
        assert Version(found[canonicalize_name(requirement.name)]) == Version(lowest(requirement))

    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment["FOWT_CACHE_DIR"] = str(tmp_path / "cache")
    options = {"cwd": tmp_path, "env": environment}
    wheel = wheel_of(repository(tmp_path / "sources"), tmp_path / "wheel")
    run(python, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", wheel)
    assert str(tmp_path / "venv") in run(python, "-c", SMOKE, **options)
    for words in COMMANDS:
        run(python, "-c", "from fowt_env.training.cli.app import main; main()", *words.split(), **options)
    assert (tmp_path / "run.parquet").stat().st_size > 0
    assert "gspi_oc3" in (tmp_path / "results" / "results.csv").read_text()
