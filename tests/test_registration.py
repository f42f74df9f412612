"""Gymnasium finds the environment without an import of fowt_env."""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

import fowt_env_registration

pytestmark = pytest.mark.installation

ROOT = Path(fowt_env_registration.__file__).parent
NAME = "fowt_env/OC3Hywind-v1"


def python(code, *options):
    """What a fresh Python prints."""
    done = subprocess.run(
        [sys.executable, *options, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "warn" not in done.stderr.lower(), done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("order", ["before", "after"])
def test_hook_registers_whether_gymnasium_is_imported_before_or_after(order):
    hook = "import fowt_env_registration as r; r.register_with_gymnasium(); r.register_with_gymnasium()\n"
    use = "import gymnasium\n"
    # -S: without the installed .pth file
    path = "import sys; sys.path[:0] = " + repr([str(ROOT), *(p for p in sys.path if p)]) + "\n"
    code = path + (hook + use if order == "before" else use + hook)
    code += f"print(gymnasium.spec({NAME!r}).entry_point, 'fowt_env' in sys.modules)"
    assert python(code, "-S") == "fowt_env.envs:FowtEnv False"


def test_registration_that_fails_warns_once_and_leaves_gymnasium_to_others():
    code = (
        "import sys; sys.path[:0] = " + repr([str(ROOT), *(p for p in sys.path if p)]) + "\n"
        "import warnings, fowt_env_registration as r; r.register_with_gymnasium()\n"
        "r.ENVIRONMENTS = None\n"
        "with warnings.catch_warnings(record=True) as said:\n    import gymnasium\n"
        "text = [str(w.message) for w in said if 'fowt_env' in str(w.message)]\n"
        "print(len(text), gymnasium.spec('CartPole-v1').id)"
    )
    assert python(code, "-S") == "1 CartPole-v1"


@pytest.mark.parametrize("content", ["def broken(:", "raise RuntimeError('broken')", "", "import nothing"])
def test_a_broken_file_says_nothing_at_each_start_of_python(content, tmp_path):
    (tmp_path / "fowt_env_registration.py").write_text(content)
    line = (ROOT / "fowt_env_registration.pth").read_text()
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); exec({line!r})"
    done = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_registering_twice_is_silent():
    code = "import fowt_env_registration as r; r.register_envs(); r.register_envs(); print('done')"
    assert python(code) == "done"


def test_installed_package_registers_by_itself():
    try:
        distribution("fowt-env")
    except PackageNotFoundError:
        pytest.skip("fowt-env is not installed in this environment: pip install -e .")
    assert python(f"import gymnasium; print(gymnasium.spec({NAME!r}).id)") == NAME


def test_starting_python_costs_nothing_heavy():
    code = (
        "import sys; sys.path.insert(0, ''); before = set(sys.modules); import fowt_env_registration as r;"
        " r.register_with_gymnasium(); print(set(sys.modules) - before)"
    )
    assert python(code, "-S") == "{'fowt_env_registration'}"
