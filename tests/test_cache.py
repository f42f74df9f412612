"""The kernel cache: made where it is missing, done without where it cannot be, right where old or shared."""

import ast
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest

import fowt_env
from fowt_env.jit import KEEP_CACHES, kernel_sources
from fowt_env.kernel_cache import SharedCacheFile
from fowt_env.warmup import COMPILING_MESSAGE, compilation_announced

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


def test_folders_of_older_sources_go_but_the_newest_and_those_in_use(tmp_path):
    """Beneath the user's cache folder where no other is named. In use: touched within a day."""
    place = tmp_path / "cache" / "fowt_env"
    now = time.time()
    for number in range(8):
        (place / f"{number}").mkdir(parents=True)
        days = 0.5 if number < 2 else 1.0 + number
        os.utime(place / f"{number}", (now - 86400.0 * days,) * 2)
    variables = {"FOWT_CACHE_DIR": "", "XDG_CACHE_HOME": str(place.parent)}
    _, used, _ = output(start(SMALL + WHERE, tmp_path / "unused", **variables))
    assert Path(used).parent == place
    left = {path.name for path in place.iterdir()} - {Path(used).name}
    assert left == {"0", "1", "2", "3"} and len(left) == KEEP_CACHES


def test_the_first_kernel_that_is_compiled_is_announced_once():
    def double(x):
        return 2.0 * x

    double.__module__ = "fowt_env.not_on_disk"
    said, compiled = [], numba.njit(double)
    with compilation_announced(said.append):
        assert compiled(1.0) == 2.0 and compiled(1) == 2.0
    assert said == [COMPILING_MESSAGE]
    with compilation_announced(said.append):
        assert compiled(2.0) == 4.0
    assert len(said) == 1


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


def _module_files():
    """{module name: path} of the kernel packages."""
    files = {}
    for path in (*ROOT.glob("fowt_env/**/*.py"), *ROOT.glob("controllers/**/*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return files


def _imported_at_the_top(path, files):
    """Names of files' modules that a source imports outside its functions."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom):
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            found |= {name if name in files else node.module for name in names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found & set(files)


def test_every_source_that_a_kernel_can_see_is_in_the_key_of_the_cache():
    files = _module_files()
    compiled = re.compile(r"^ *@(\w*kernel|\w*entry|overload|intrinsic)\b|\b(njit|cfunc)\(", re.MULTILINE)
    waiting = [name for name, path in files.items() if compiled.search(path.read_text())]
    seen = set()
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += _imported_at_the_top(files[name], files)
    assert len(seen) > 50
    missing = {files[name] for name in seen} - set(kernel_sources())
    assert not missing
    assert {path.name for path in set(files.values()) - set(kernel_sources())} >= {"cli_plot.py", "plots.py"}


def test_broken_files_are_compiled_anew(tmp_path):
    folder = tmp_path / "cache"
    assert output(start(SMALL, folder)) == ["0.25"]
    for ending in ("nbi", "nbc"):
        for content in (b"", b"\x80\x04broken", bytes(3000)):
            files = list(folder.rglob(f"*.{ending}"))
            for path in files:
                path.write_bytes(content)
            assert files and output(start(SMALL, folder)) == ["0.25"], (ending, content[:10])
            written = [path.read_bytes() for path in files if path.stem.startswith("waves.ramp")]
            assert written and content not in written, (ending, content[:10])
    assert output(start(SMALL, folder)) == ["0.25"]


def test_without_room_for_machine_code_kernels_work_all_the_same(tmp_path):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"
    assert output(start(limit + SMALL, tmp_path / "cache")) == ["0.25"]
    assert not list((tmp_path / "cache").rglob("*.nbc"))


KEEPER = """
import pathlib, sys
from fowt_env.kernel_cache import SharedCacheFile
file = SharedCacheFile(sys.argv[1], "function", "stamp")
ready = pathlib.Path(sys.argv[2])
(ready / sys.argv[3]).touch()
while len(list(ready.iterdir())) < 3:
    pass
for number in range(100):
    file.save((sys.argv[3], number), f"code of {sys.argv[3]} {number}")
"""


def test_processes_that_keep_code_at_once_keep_all_of_it_under_the_right_keys(tmp_path):
    """Of these 300 entries numba's own file was seen to lose 27 and to have 6 under another's key."""
    ready = tmp_path / "ready"  # where each says that it can begin
    ready.mkdir()
    variables = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", KEEPER, tmp_path, ready]
    keepers = [subprocess.Popen([*map(str, command), name], env=variables) for name in "abc"]
    assert [keeper.wait(timeout=300) for keeper in keepers] == [0, 0, 0]
    file = SharedCacheFile(str(tmp_path), "function", "stamp")
    for name in "abc":
        assert all(file.load((name, number)) == f"code of {name} {number}" for number in range(100))


@pytest.mark.slow
def test_two_processes_that_compile_at_once_give_the_same_bits_as_one_that_loads(tmp_path):
    folder = tmp_path / "cache"
    together = [start(DECAY, folder) for _ in range(2)]
    (one, said_one), (other, said_other) = (output(process) for process in together)
    loaded, said = output(start(DECAY, folder))
    assert one == other == loaded
    assert (said_one, said_other, said) == ("1", "1", "0")
