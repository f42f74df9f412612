"""How Gymnasium learns of the environments."""

import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest

import fowt_env
from fowt_env.descriptions.platform import platform_names
from fowt_env.registration import OTHER_PLATFORMS

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


@pytest.mark.parametrize(("name", "platform"), OTHER_PLATFORMS.items())
def test_names_of_other_platforms_make_environments_of_them(name, platform):
    spec = gymnasium.spec(name)
    assert spec.kwargs == {"platform": platform} and platform in platform_names()
    assert gymnasium.spec(NAME).entry_point == spec.entry_point


def test_registering_twice_is_silent():
    code = "from fowt_env.registration import register_environments as r; r(); r(); print('done')"
    assert python(code) == "done"


def test_python_starts_without_a_line_of_this_project():
    code = "import sys; print(any(name.startswith('fowt') for name in sys.modules))"
    assert python(code) == "False"


LAW = """
class Law:
    def reset(self, measurement):
        pass

    def act(self, measurement):
        return 4e4, 0.2
"""
USES = {
    "import": "import fowt_env.controllers, fowt_env.training; print('done')",
    "simulate": (
        "import fowt_env; scene = fowt_env.build_scene()\n"
        "print('done' if len(fowt_env.simulate(scene, controller='pi', duration=0.1)) == 2 else 'short')"
    ),
    "user's controller": (
        "import fowt_env; scene = fowt_env.build_scene()\n"
        "run = fowt_env.simulate(scene, controller='controllers:Law', duration=0.2)\n"
        "print('done' if run['GenTq_[kN-m]'].iloc[-1] > 0.0 else run)"
    ),
    "help": (
        "import sys; from fowt_env.training.cli.app import main; sys.argv = ['fowt', 'evaluate', '--help']\n"
        "try: main()\nexcept SystemExit as end: print('done' if not end.code else end)"
    ),
}


def in_users_folder(folder, *command):
    """Last line of what a command prints in a folder with a controllers.py and a training/ of the user's."""
    (folder / "controllers.py").write_text(LAW)
    (folder / "training").mkdir()
    (folder / "training" / "__init__.py").write_text("raise RuntimeError('a folder of the user')")
    variables = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=variables, capture_output=True, text=True, cwd=folder, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip().splitlines()[-1]


@pytest.mark.parametrize("use", USES)
def test_modules_of_a_user_s_folder_do_not_hide_the_installed_ones(tmp_path, use):
    assert in_users_folder(tmp_path, sys.executable, "-c", USES[use]) == "done"


def test_nor_do_they_for_the_installed_command(tmp_path):
    fowt = Path(sys.executable).with_name("fowt")
    if not fowt.exists():
        pytest.skip("the command is not installed beside this Python")
    assert in_users_folder(tmp_path, str(fowt), "list", "controllers")


def test_what_is_installed_has_one_name_alone(tmp_path):
    """Also where it is installed editable: nothing of a clone but fowt_env can be imported."""
    names = "('controllers', 'training', 'tests')"
    code = f"from importlib.util import find_spec; print([name for name in {names} if find_spec(name)])"
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=variables, capture_output=True, text=True, cwd=tmp_path
    )
    assert done.stdout.strip() == "[]", done.stderr


@pytest.mark.parametrize("name", ["controllers", "training"])
def test_no_module_has_two_names(name):
    done = subprocess.run([sys.executable, "-c", f"import {name}"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 1 and f"this package is fowt_env.{name}" in done.stderr
