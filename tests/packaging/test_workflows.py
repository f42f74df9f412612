"""The workflows of the repository's host: they are valid, and what they call and name exists."""

import re
import tomllib
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: the extra `train` is missing")

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
TARGETS = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M))


def read(path):
    """A workflow as a mapping; `on` is a truth value to YAML 1.1."""
    workflow = yaml.safe_load(path.read_text())
    return workflow | {"on": workflow.pop(True)}


def steps(workflow):
    return [step for job in workflow["jobs"].values() for step in job["steps"]]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_may_only_read_and_calls_what_exists(path):
    workflow = read(path)
    assert workflow["permissions"] == {"contents": "read"}
    for step in steps(workflow):
        assert ("uses" in step) != ("run" in step), step
        called = set(re.findall(r"\bmake ([\w-]+)", step.get("run", "")))
        assert called <= TARGETS, called - TARGETS


def test_each_declared_python_is_tested_on_every_change():
    quick = read(ROOT / ".github/workflows/tests.yml")["jobs"]["quick"]
    tested = quick["strategy"]["matrix"]["python-version"]
    declared = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    assert tested == declared
    bounds = PROJECT["requires-python"].replace(" ", "")
    last = int(declared[-1].partition(".")[2])
    assert bounds == f">={declared[0]},<3.{last + 1}"


def test_slow_tests_run_every_night():
    nightly = read(ROOT / ".github/workflows/nightly.yml")
    assert "schedule" in nightly["on"]
    assert any("make test-all" in step.get("run", "") for step in steps(nightly))


def test_the_release_notes_begin_with_the_version_of_the_package():
    versions = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.M)
    released = versions[1] if versions[0] == "Unreleased" else versions[0]
    assert released == PROJECT["version"]
    assert f"version: {released}\n" in (ROOT / "CITATION.cff").read_text()
    assert f'__version__ = "{released}"' in (ROOT / "fowt_env" / "__init__.py").read_text()
