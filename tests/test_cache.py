"""The kernel cache: made where it is missing, done without where it cannot be, right where old or shared."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import fowt_env

ROOT = Path(fowt_env.__file__).resolve().parent.parent
REGISTRATION = ROOT / "fowt_env_registration.py"
SMALL = "from fowt_env.weather.waves import ramp_factor; print(ramp_factor(1.0, 4.0))\n"
WHERE = "import numba; from fowt_env.jit import CACHE_FOLDER as f; print(f, numba.config.CACHE_DIR)\n"
DECAY = """
import sys
from fowt_env import build_scene, simulate
from fowt_env.warmup import compilation_announced
said = []
with compilation_announced(said.append):
    frame = simulate(build_scene(), None, duration=2.0, start="zero", initial={"PtfmPitch": 5.0})
print(frame.to_numpy().tobytes().hex()[-4000:], len(said))
"""


def start(code, folder, root=ROOT, **environment):
    """A fresh Python at work on the code, with its kernel cache in the folder."""
    variables = os.environ | {"FOWT_CACHE_DIR": str(folder), "PYTHONPATH": str(root)} | environment
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, "-c", code], env=variables, cwd=folder.parent, stdout=pipe, stderr=pipe, text=True
    )


def output(process):
    """Lines that it printed, once it has ended well."""
    stdout, stderr = process.communicate(timeout=900)
    assert process.returncode == 0, stderr
    return stdout.split()


def test_a_missing_folder_is_made_and_used(tmp_path):
    folder = tmp_path / "a" / "cache"
    folder.parent.mkdir()
    factor, used, given = output(start(SMALL + WHERE, folder))
    assert factor == "0.25"
    assert used == given and Path(used).parent == folder
    assert list(Path(used).rglob("*.nbi"))


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path):
    """It lies beneath a file, which stops even the superuser."""
    (tmp_path / "file").write_text("")
    folder = tmp_path / "file" / "cache"
    process = start(SMALL + WHERE, tmp_path / "cache", TMPDIR=str(tmp_path))
    assert output(process)[1].startswith(str(tmp_path / "cache"))
    variables = {"FOWT_CACHE_DIR": str(folder), "TMPDIR": str(tmp_path)}
    factor, used, own = output(start(SMALL + WHERE, tmp_path / "cache", **variables))
    assert (factor, used) == ("0.25", "None")
    assert Path(own).parent == tmp_path and Path(own).name.startswith("fowt_env_")
    assert not Path(own).exists()  # gone with its process


def test_kernels_of_other_sources_are_never_used(tmp_path):
    """Numba alone would: it watches the file of the function, and not those of what it calls."""
    code = tmp_path / "code"
    for path in (*ROOT.glob("fowt_env/**/*.py"), *ROOT.glob("controllers/**/*.py"), REGISTRATION):
        copy = code / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (code / "fowt_env" / "extra.py").write_text(
        "from fowt_env.jit import kernel\nfrom fowt_env.state import add\n"
        "@kernel\ndef twice(load):\n    return add(load, load).fx\n"
    )
    program = (
        "from fowt_env.extra import twice\nfrom fowt_env.state import NO_LOAD\n"
        "print(twice(NO_LOAD._replace(fx=1.0)))\n"
    )
    assert output(start(program, tmp_path / "cache", code)) == ["2.0"]
    state = code / "fowt_env" / "state.py"
    text = state.read_text()
    assert "a.fx + b.fx" in text
    state.write_text(text.replace("a.fx + b.fx", "a.fx - b.fx"))
    assert output(start(program, tmp_path / "cache", code)) == ["0.0"]
    state.write_text(text)
    assert output(start(program, tmp_path / "cache", code)) == ["2.0"]
    assert len(list((tmp_path / "cache").iterdir())) == 2


@pytest.mark.slow
def test_two_processes_that_compile_at_once_give_the_same_bits_as_one_that_loads(tmp_path):
    folder = tmp_path / "cache"
    together = [start(DECAY, folder) for _ in range(2)]
    (one, said_one), (other, said_other) = (output(process) for process in together)
    loaded, said = output(start(DECAY, folder))
    assert one == other == loaded
    assert (said_one, said_other, said) == ("1", "1", "0")
