"""What users install: the built files hold everything, and a bare environment runs the README's example.

Needs a package index for the dependencies of the empty environment, as `pip install fowt-env` does.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {"fowt_env": "fowt_env", "controllers": "fowt_env/controllers", "training": "fowt_env/training"}
LEFT_OUT = ("fowt_env/training/studies/", "fowt_env/training/validation/reference/")  # of a clone alone
SHIPPED = {  # one of each kind of file that is no source
    "fowt_env/py.typed",
    "fowt_env/data/sea_states.toml",
    "fowt_env/data/turbines/nrel5mw/polars/NACA64_A17.csv",
    "fowt_env/controllers/tuned.toml",
    "fowt_env/controllers/policy/agents/ppo_lqr.npz",
    "fowt_env/training/design/data/linear_bound.csv",
    "fowt_env/training/evaluation/suites/above_rated.toml",
    "fowt_env/training/reports/page/page.html",
    "fowt_env/training/rl/ppo.yml",
}
pytestmark = pytest.mark.slow


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """(sdist, wheel) built from a copy of the sources, the wheel out of the sdist."""
    folder = tmp_path_factory.mktemp("build")
    source = folder / "source"
    leave = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=leave, symlinks=True)
    for path in ROOT.iterdir():
        if path.is_file() and not path.name.startswith("."):
            shutil.copy(path, source)
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder / "dist", source)
    (sdist,) = (folder / "dist").glob("*.tar.gz")
    (wheel,) = (folder / "dist").glob("*.whl")
    return sdist, wheel


def package_files():
    """Paths of the package's files, code and data, as they are installed: its links as folders."""
    return {
        f"{place}/{path.relative_to(ROOT / folder).as_posix()}"
        for folder, place in PACKAGES.items()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }


def test_sdist_and_wheel_hold_the_package_without_the_studies_and_the_licence(built):
    sdist, wheel = built
    with tarfile.open(sdist) as archive:
        in_sdist = {name.partition("/")[2] for name in archive.getnames()}
    in_wheel = set(zipfile.ZipFile(wheel).namelist())
    wanted = {path for path in package_files() if not path.startswith(LEFT_OUT)}
    assert wanted < package_files()
    assert wanted - in_sdist == set()
    assert {path for path in in_wheel if ".dist-info/" not in path} == wanted
    tops = {path.partition("/")[0] for path in in_wheel}
    assert len(tops) == 2 and "fowt_env" in tops  # and what pip needs to know of it
    assert SHIPPED <= in_wheel
    assert any(name.endswith("LICENSE") for name in in_wheel)
    assert not any(name.endswith(".pth") or ".data/" in name for name in in_wheel)


def readme_example(duration):
    """The program under "Ten lines" with another duration."""
    section = (ROOT / "README.md").read_text().partition("## Ten lines")[2]
    code = re.search(r"```python\n(.*?)```", section, re.S).group(1)
    assert code.count("duration=600.0") == 1
    return code.replace("duration=600.0", f"duration={duration}")


def test_the_wheel_runs_the_readme_example_in_an_empty_environment_without_torch(built, tmp_path):
    _, wheel = built
    run(sys.executable, "-m", "venv", tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment["FOWT_CACHE_DIR"] = str(tmp_path / "cache")
    options = {"cwd": tmp_path, "env": environment}
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
    for command in ("paper", "benchmark stability"):
        words = [tmp_path / "venv" / "bin" / "fowt", *command.split()]
        done = subprocess.run(words, capture_output=True, text=True, **options)
        (line,) = done.stderr.splitlines()
        assert done.returncode == 2 and f"fowt {command}: needs a clone" in line
