"""The recipes for conda and for a container install what pyproject.toml names."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: the extra `train` is missing")

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE = yaml.safe_load((ROOT / ".conda" / "recipe.yaml").read_text())
CONTAINER = (ROOT / ".container" / "Containerfile").read_text()


def test_the_conda_recipe_has_the_version_and_the_requirements_of_the_package():
    assert RECIPE["context"]["version"] == PROJECT["version"]
    wanted = {r.name: r.specifier for r in map(Requirement, PROJECT["dependencies"])}
    wanted["python"] = SpecifierSet(PROJECT["requires-python"])
    asked = [line.partition(" ") for line in RECIPE["requirements"]["run"] if not line.startswith("__")]
    assert {name: SpecifierSet(bounds) for name, _, bounds in asked} == wanted


def test_the_conda_recipe_makes_the_command_and_tests_it():
    scripts = [f"{name} = {target}" for name, target in PROJECT["scripts"].items()]
    assert RECIPE["build"]["python"]["entry_points"] == scripts
    assert RECIPE["about"]["license"] == PROJECT["license"]
    assert RECIPE["about"]["license_file"] == PROJECT["license-files"]
    assert {"script": ["fowt doctor"]} in RECIPE["tests"]


def test_the_container_has_a_python_and_extras_that_the_package_declares():
    from fowt_env.warmup import PACKED

    (version,) = re.findall(r"^FROM python:([\d.]+)", CONTAINER, re.M)
    assert SpecifierSet(PROJECT["requires-python"]).contains(version)
    (extras,) = re.findall(r"\[([\w,]+)\]\"", CONTAINER)
    assert set(extras.split(",")) <= set(PROJECT["optional-dependencies"])
    assert f"fowt warmup --kinds {','.join(PACKED)}\n" in CONTAINER
