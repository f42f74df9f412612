"""What users install: each form of the sources gives the same wheel, and that runs without them.

The bare environment needs a package index for its dependencies, as `pip install fowt-env` does.
"""

import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from distributions import FORMS, repository, run, sources, wheel_of

from fowt_env.training.evaluation.provenance import controller_code, plant_code

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {"fowt_env": "fowt_env", "controllers": "fowt_env/controllers", "training": "fowt_env/training"}
# of a clone alone, and packs of kernels, which a release adds
LEFT_OUT = ("fowt_env/training/studies/", "fowt_env/training/validation/reference/", "fowt_env/kernels/")
SHIPPED = {  # one of each kind of file that is no source
    "fowt_env/py.typed",
    "fowt_env/data/sea_states.toml",
    "fowt_env/data/turbines/nrel5mw/polars/NACA64_A17.csv",
    "fowt_env/controllers/tuned.toml",
    "fowt_env/controllers/export/c/lqr.c",
    "fowt_env/controllers/policy/agents/ppo_lqr.npz",
    "fowt_env/training/design/data/linear_bound.csv",
    "fowt_env/training/evaluation/suites/above_rated.toml",
    "fowt_env/training/reports/page/page.html",
    "fowt_env/training/rl/ppo.yml",
}
READY = {"fowt_env/controllers/export/c/bridge.so"}  # what setup.py builds
pytestmark = pytest.mark.slow


class Built(dict):
    """{form: (sources, wheel)}, each made where it is first asked for."""

    def __init__(self, folder):
        self.folder, self.origin = folder, repository(folder / "origin")

    def __missing__(self, form):
        place = sources(form, self.origin, self.folder)
        self[form] = place, wheel_of(place, self.folder / "wheels" / form)
        return self[form]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return Built(tmp_path_factory.mktemp("built"))


def package_files():
    """Return the paths of the package's files, code and data, as they are installed."""
    return {
        f"{place}/{path.relative_to(ROOT / folder).as_posix()}"
        for folder, place in PACKAGES.items()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }


NIGHTLY = ("tar", "zip")


@pytest.mark.parametrize(
    "form", [pytest.param(form, marks=pytest.mark.nightly if form in NIGHTLY else ()) for form in FORMS]
)
def test_each_form_of_the_sources_gives_a_wheel_with_the_package_without_the_studies(form, built):
    in_wheel = set(zipfile.ZipFile(built[form][1]).namelist())
    wanted = {path for path in package_files() if not path.startswith(LEFT_OUT)}
    assert wanted < package_files() and wanted >= SHIPPED
    assert {path for path in in_wheel if ".dist-info/" not in path} == wanted | READY
    tops = {path.partition("/")[0] for path in in_wheel}
    assert len(tops) == 2 and "fowt_env" in tops  # and what pip needs to know of it
    assert any(name.endswith("LICENSE") for name in in_wheel)
    assert not any(name.endswith(".pth") or ".data/" in name for name in in_wheel)


def test_the_sdist_has_the_pages_and_the_versions_that_they_name_and_no_tests(built):
    with tarfile.open(built["sdist"][0]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"constraints.txt", "docs/index.md", "examples/01_simulate.py", "CHANGELOG.md"} <= names
    assert not [name for name in names if name.startswith(("tests", "docs/joss", "training/studies"))]


def test_sources_without_a_package_are_not_built(built, tmp_path):
    """As a ZIP of symbolic links had, which installed without a word."""
    place = tmp_path / "sources"
    sources("zip", built.origin, tmp_path)
    zipfile.ZipFile(tmp_path / "archive.zip").extractall(place)
    (place / "controllers").rename(tmp_path / "controllers")
    (place / "controllers").write_text("../controllers")
    with pytest.raises(AssertionError, match="the sources are incomplete: without controllers"):
        wheel_of(place, tmp_path / "wheel")


CODES = """
import fowt_env.controllers, fowt_env.training
from fowt_env.training.evaluation.provenance import controller_code, plant_code
print(fowt_env.__file__, fowt_env.controllers.__file__)
print(plant_code(), *(controller_code(name)["code"] for name in ("pi", "policy:ppo_lqr")))
"""


@pytest.mark.nightly
@pytest.mark.parametrize("form", (*FORMS, "editable"))
def test_each_form_runs_the_self_test_and_an_agent_where_the_sources_are_not(form, built, tmp_path):
    """On the libraries of these tests, and with their kernels, which the same sources have."""
    run(sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    (own,) = (tmp_path / "venv" / "lib").glob("python*/site-packages")
    libraries = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    (own / "libraries.pth").write_text("\n".join(libraries))
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps")
    what = ("--editable", built["clone"][0]) if form == "editable" else (built[form][1],)
    run(*pip, "--no-build-isolation", "--ignore-installed", *what)
    variables = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    options = {"cwd": tmp_path, "env": variables}
    places, codes = run(python, "-c", CODES, **options).splitlines()
    assert places.count(str(built["clone"][0] if form == "editable" else tmp_path)) == 2
    assert codes.split() == [plant_code(), *(controller_code(c)["code"] for c in ("pi", "policy:ppo_lqr"))]
    fowt = tmp_path / "venv" / "bin" / "fowt"
    run(fowt, "doctor", **options)
    words = ("--controller", "policy:ppo_lqr", "--wind", "18", "--duration", "20", "--out", "run.csv")
    run(fowt, "simulate", *words, **options)
    assert (tmp_path / "run.csv").stat().st_size > 1e4


def readme_example(duration):
    """The program under "Ten lines" with another duration."""
    section = (ROOT / "README.md").read_text().partition("## Ten lines")[2]
    code = re.search(r"```python\n(.*?)```", section, re.S).group(1)
    assert code.count("duration=600.0") == 1
    return code.replace("duration=600.0", f"duration={duration}")


@pytest.mark.nightly
def test_the_wheel_runs_the_readme_example_in_an_empty_environment_without_torch(built, tmp_path):
    _, wheel = built["sdist"]
    run(sys.executable, "-m", "venv", tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    options = {"cwd": tmp_path, "env": environment}  # and the kernels that other tests have compiled
    pip = (python, "-m", "pip", "install", "--quiet", "--constraint", ROOT / "constraints.txt")
    run(*pip, wheel, **options)
    program = readme_example(5.0) + (
        "import importlib.util, gymnasium\n"
        "assert importlib.util.find_spec('torch') is None\n"
        "assert len(df) == 51, len(df)\n"
        "print(fowt_env.__file__, gymnasium.spec('fowt_env/OC3Hywind-v1').id)\n"
    )
    text = run(python, "-c", program, **options)
    assert "PtfmPitch_[deg]" in text and f"{tmp_path / 'venv'}" in text and "OC3Hywind-v1" in text
    text = run(tmp_path / "venv" / "bin" / "fowt", "doctor", "--no-test", **options)
    assert "missing" in text and 'pip install "fowt-env[plot]"' in text
    name = "fowt_env:fowt_env/OC3Hywind-v1"
    program = f"import gymnasium; print(gymnasium.make({name!r}, task='steady').spec.id)"
    assert run(python, "-c", program, **options).strip() == "fowt_env/OC3Hywind-v1"
    for command in ("dev paper", "dev benchmark stability"):
        words = [tmp_path / "venv" / "bin" / "fowt", *command.split()]
        done = subprocess.run(words, capture_output=True, text=True, **options)
        (line,) = done.stderr.splitlines()
        assert done.returncode == 2 and f"fowt {command}: needs a clone" in line
