"""How Gymnasium learns of the environments."""

import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest
from episodes import NAME
from fresh_python import ROOT, fresh_python

from fowt_env.descriptions.platform import platform_names
from fowt_env.registration import ENVIRONMENTS, LADDER, STEPS

pytestmark = pytest.mark.installation


@pytest.mark.parametrize(
    ("imports", "loaded"),
    [
        ("fowt_env, gymnasium", False),
        ("gymnasium, fowt_env", False),
        ("gymnasium, fowt_env, fowt_env.envs", True),
        ("fowt_env.envs, fowt_env, gymnasium", True),
    ],
)
def test_import_registers_once_and_loads_no_environment(imports, loaded):
    code = f"import sys, warnings; warnings.simplefilter('error'); import {imports}\n"
    code += "from fowt_env.registration import register_environments; register_environments()\n"
    code += f"print(gymnasium.spec({NAME!r}).entry_point, 'fowt_env.envs' in sys.modules)"
    assert fresh_python(code) == f"fowt_env.envs:FowtEnv {loaded}"


def test_a_name_with_the_module_needs_no_import():
    code = f"import gymnasium; env = gymnasium.make('fowt_env:{NAME}', wind=None); print(env.spec.id)"
    assert fresh_python(code) == NAME


@pytest.mark.parametrize(("name", "settings"), ENVIRONMENTS.items())
def test_names_make_environments_of_their_platform_and_reward(name, settings):
    spec = gymnasium.spec(name)
    assert spec.kwargs == settings and settings.get("platform", "oc3_hywind") in platform_names()
    newest = max(other for other in ENVIRONMENTS if other.startswith(name[:-1]))
    assert (settings.get("reward") == "score") == (name == newest)
    assert gymnasium.spec(NAME).entry_point == spec.entry_point


@pytest.mark.parametrize("name", LADDER)
def test_names_of_the_ladder_say_how_many_steps_an_episode_has(name):
    spec = gymnasium.spec(name)
    period = 0.1 * spec.kwargs["decisions"]["hold"]
    assert spec.max_episode_steps == STEPS == round(spec.kwargs["duration"] / period)


def test_gymnasium_warns_of_the_older_version_of_a_name():
    with pytest.warns(DeprecationWarning, match="OC3Hywind-v1 is out of date.*`v2`"):
        gymnasium.make("fowt_env/OC3Hywind-v1", wind=18.0)


def test_python_starts_without_a_line_of_this_project():
    code = "import sys; print(any(name.startswith('fowt') for name in sys.modules))"
    assert fresh_python(code) == "False"


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
    "command": "",
    "help": (
        "import sys; from fowt_env.training.cli.app import main; sys.argv = ['fowt', 'evaluate', '--help']\n"
        "try: main()\nexcept SystemExit as end: print('done' if not end.code else end)"
    ),
}


@pytest.mark.parametrize(
    "use",
    [pytest.param(use, marks=pytest.mark.nightly) if use in ("import", "simulate") else use for use in USES],
)
def test_modules_of_a_user_s_folder_do_not_hide_the_installed_ones(tmp_path, use):
    (tmp_path / "controllers.py").write_text(LAW)
    (tmp_path / "training").mkdir()
    (tmp_path / "training" / "__init__.py").write_text("raise RuntimeError('a folder of the user')")
    command = [Path(sys.executable).with_name("fowt"), "list", "controllers"]
    if use != "command":
        command = [sys.executable, "-c", USES[use]]
    elif not command[0].exists():
        pytest.skip("the command is not installed beside this Python")
    variables = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=variables, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert done.returncode == 0, done.stderr
    assert use == "command" or done.stdout.strip().splitlines()[-1] == "done"


def test_what_is_installed_has_one_name_alone(tmp_path):
    """Also where it is installed editable: nothing of a clone but fowt_env can be imported."""
    names = "('controllers', 'training', 'tests')"
    code = f"from importlib.util import find_spec; print([name for name in {names} if find_spec(name)])"
    assert fresh_python(code, cwd=tmp_path, PYTHONPATH="") == "[]"


@pytest.mark.parametrize("name", ["controllers", "training"])
def test_no_module_has_two_names(name):
    done = subprocess.run([sys.executable, "-c", f"import {name}"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 1 and f"this package is fowt_env.{name}" in done.stderr
