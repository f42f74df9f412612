"""A checkout that is not installed says what to do; one that is has all its packages."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import fowt_env.controllers
import fowt_env.training
from fowt_env.layout import FOLDERS, PACKAGE, installed_path, module_path

ROOT = Path(__file__).resolve().parents[2]


def refusal(folder, *options):
    """Return stderr of a fresh Python that imports the copy of fowt_env in a folder."""
    variables = os.environ | {"PYTHONPATH": str(folder)}
    command = [sys.executable, *options, "-c", "import fowt_env"]
    done = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True)
    assert done.returncode == 1
    return done.stderr


def package(folder):
    """Return the folder with what of fowt_env is read before its packages are asked for."""
    (folder / "fowt_env").mkdir()
    for name in ("__init__.py", "layout.py"):
        shutil.copy(PACKAGE / name, folder / "fowt_env")
    return folder


def checkout(folder):
    """Return the folder with that, and beside it what a checkout has."""
    for name in FOLDERS:
        (folder / name).mkdir()
    (folder / "pyproject.toml").touch()
    return package(folder)


def test_these_tests_run_the_packages_of_their_own_checkout():
    assert Path(fowt_env.__file__).parent == ROOT / "fowt_env"
    assert Path(fowt_env.controllers.__file__).parent == ROOT / "controllers"
    assert Path(fowt_env.training.__file__).parent == ROOT / "training"


def test_a_checkout_that_is_not_installed_says_how_to_install_it(tmp_path):
    text = refusal(checkout(tmp_path), "-S")  # without site-packages
    assert "has no fowt_env.controllers" in text
    assert f'-m pip install --editable "{tmp_path}"' in text and "make test" in text


def test_another_checkout_is_not_mixed_with_the_one_that_is_installed(tmp_path):
    """As by pytest in one, with the environment of the other."""
    text = refusal(checkout(tmp_path))
    assert f"takes fowt_env.controllers from {FOLDERS['controllers']}" in text
    assert f'-m pip install --editable "{tmp_path}"' in text


def test_an_installation_without_a_package_says_that_it_is_incomplete(tmp_path):
    text = refusal(package(tmp_path), "-S")
    assert "is incomplete" in text and "has no fowt_env.controllers" in text and "Install it again" in text


def test_a_source_has_one_path_once_installed_and_a_module_one_source():
    law = FOLDERS["controllers"] / "lqr" / "law.py"
    assert module_path("fowt_env.controllers.lqr.law").with_suffix(".py") == law and law.is_file()
    assert installed_path(law) == PACKAGE / "controllers" / "lqr" / "law.py"
    assert module_path("fowt_env.plant.state") == PACKAGE / "plant" / "state"
    assert installed_path(PACKAGE / "plant" / "state.py") == PACKAGE / "plant" / "state.py"
    assert module_path("fowt_env") == PACKAGE and installed_path(ROOT / "tests" / "conftest.py") is None


def test_windows_is_refused_with_what_to_install_instead(tmp_path):
    folder = package(tmp_path)
    (folder / "sitecustomize.py").write_text("import sys; sys.platform = 'win32'")
    assert "needs Linux or macOS: on Windows install it in WSL 2" in refusal(folder)
