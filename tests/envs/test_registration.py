"""How Gymnasium learns of the environments."""

import subprocess
import sys
from pathlib import Path

import pytest

import fowt_env

pytestmark = pytest.mark.installation

ROOT = Path(fowt_env.__file__).resolve().parent.parent
NAME = "fowt_env/OC3Hywind-v1"


def python(code, *options):
    """What a fresh Python prints."""
    done = subprocess.run(
        [sys.executable, *options, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "warn" not in done.stderr.lower(), done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("imports", ["fowt_env, gymnasium", "gymnasium, fowt_env"])
def test_import_registers_and_loads_no_environment(imports):
    code = f"import sys, {imports}; spec = gymnasium.spec({NAME!r})\n"
    code += "print(spec.entry_point, 'fowt_env.envs' in sys.modules)"
    assert python(code) == "fowt_env.envs:FowtEnv False"


def test_a_name_with_the_module_needs_no_import():
    code = f"import gymnasium; env = gymnasium.make('fowt_env:{NAME}', wind=None); print(env.spec.id)"
    assert python(code) == NAME


def test_registering_twice_is_silent():
    code = "from fowt_env.registration import register_environments as r; r(); r(); print('done')"
    assert python(code) == "done"


def test_python_starts_without_a_line_of_this_project():
    code = "import sys; print(any(name.startswith('fowt') for name in sys.modules))"
    assert python(code) == "False"


@pytest.mark.parametrize("name", ["controllers", "training"])
def test_modules_of_a_user_s_folder_do_not_hide_the_installed_ones(tmp_path, name):
    (tmp_path / "controllers.py").write_text("raise RuntimeError('a file of the user')")
    (tmp_path / "training").mkdir()
    (tmp_path / "training" / "__init__.py").write_text("raise RuntimeError('a folder of the user')")
    code = f"import fowt_env.{name} as package; print(package.__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.strip() == f"fowt_env.{name}", done.stderr


@pytest.mark.parametrize("name", ["controllers", "training"])
def test_no_module_has_two_names(name):
    done = subprocess.run([sys.executable, "-c", f"import {name}"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 1 and f"this package is fowt_env.{name}" in done.stderr
