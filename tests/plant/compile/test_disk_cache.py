"""The kernel cache: made where it is missing, done without where it cannot be, right where old or shared."""

import json
import os
import pickle
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest
from copied_code import LOOKS, copied_code, edit

from fowt_env.layout import PACKAGE, module_path
from fowt_env.plant.compile import disk_cache
from fowt_env.plant.compile.decorators import KEEP_CACHES, MARKER, PLANT
from fowt_env.plant.compile.disk_cache import SharedCacheFile
from fowt_env.plant.compile.notice import compilation_reported
from fowt_env.plant.compile.sources import read_source

ROOT = PACKAGE.parent
SMALL = """
from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.hydro.waves import ramp_factor

@entry
def factor(time, ramp):  # kernels are kept as others call them, not as Python does
    return ramp_factor(time, ramp)

print(factor(1.0, 4.0))
"""
HITS = "print(sum(ramp_factor.stats.cache_hits.values()))\n"
WHERE = "from fowt_env.plant.compile.decorators import CACHE_FOLDER; print(CACHE_FOLDER)\n"
DAY = 86400.0
DECAY = """
import sys
from fowt_env import build_scene, simulate
from fowt_env.plant.compile.notice import compilation_reported
said = []
with compilation_reported(said.append):
    frame = simulate(build_scene(), None, duration=2.0, initial={"start": "zero", "PtfmPitch": 5.0})
print(frame.to_numpy().tobytes().hex()[-4000:], int(bool(said)))
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


def kernel_folder(place, number, days, mark=True):
    """A folder that looks like one of older sources, untouched for some days."""
    folder = place / f"{number:016x}"
    folder.mkdir(parents=True)
    (folder / "content").write_text("")
    if mark:
        (folder / MARKER).write_text("")
    os.utime(folder, (time.time() - days * DAY,) * 2)
    return folder


def test_a_missing_folder_is_made_and_used(tmp_path):
    folder = tmp_path / "a" / "cache"
    folder.parent.mkdir()
    numba_told = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"}
    factor, used = output(start(SMALL + WHERE, folder, **numba_told))
    assert factor == "0.25"
    assert Path(used).parent == folder / "kernels"
    assert list(Path(used).rglob("*.nbi"))


def test_folders_of_older_sources_go_but_those_in_use_and_what_this_package_did_not_make(tmp_path):
    """Beneath the user's cache folder where no other is named. In use: touched within a day."""
    place = tmp_path / "cache" / "fowt_env" / "kernels"
    kept = [kernel_folder(place, number, 0.5) for number in range(6)]
    gone = [kernel_folder(place, number, 10.0) for number in range(6, 9)]
    kept += [kernel_folder(place, 20, 100.0, mark=False), kernel_folder(place / "of mine", 1, 100.0)]
    kept += [kernel_folder(place.parent, 2, 90.0), kernel_folder(tmp_path / "elsewhere", 0, 2.0)]
    kept.append(kernel_folder(place, 21, 300.0).rename(place / "a name of mine"))
    (place / f"{22:016x}").symlink_to(tmp_path / "elsewhere" / f"{0:016x}")
    variables = {"FOWT_CACHE_DIR": "", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    _, used = output(start(SMALL + WHERE, tmp_path / "unused", **variables))
    assert Path(used).parent == place and len(kept) > KEEP_CACHES
    assert all((path / "content").exists() for path in kept) and not any(path.exists() for path in gone)
    assert (place / f"{22:016x}").is_symlink()


def test_the_newest_folders_of_older_sources_stay_for_a_month(tmp_path):
    place = tmp_path / "cache" / "kernels"
    days = [2.0, 3.0, 4.0, 5.0, 6.0, 40.0]
    folders = [kernel_folder(place, number, age) for number, age in enumerate(days)]
    output(start(WHERE, tmp_path / "cache"))
    assert [folder.exists() for folder in folders] == [True] * KEEP_CACHES + [False, False]


def test_each_kernel_that_is_compiled_is_counted_once():
    def double(x):
        return 2.0 * x

    double.__module__ = "fowt_env.not_on_disk"
    said, compiled = [], numba.njit(double)
    with compilation_reported(said.append):
        assert compiled(1.0) == 2.0 and compiled(1) == 2.0
    assert said == [1, 2]
    with compilation_reported(said.append):
        assert compiled(2.0) == 4.0
    assert len(said) == 2


@pytest.mark.nightly
def test_where_no_folder_can_be_made_kernels_are_compiled_in_each_process(tmp_path):
    """Beneath a file, which stops even the superuser; and for a user without a home, as in a container."""
    (tmp_path / "file").write_text("")
    variables = {"FOWT_CACHE_DIR": str(tmp_path / "file" / "cache")}
    assert output(start(SMALL + WHERE, tmp_path / "cache", **variables)) == ["0.25", "None"]
    nobody = "import os, pwd\ndel os.environ['HOME']\ndel pwd.getpwuid\npwd.getpwuid = {}.__getitem__\n"
    variables = {"FOWT_CACHE_DIR": "", "XDG_CACHE_HOME": "", "FOWT_CONFIG_DIR": "", "XDG_CONFIG_HOME": ""}
    key = "from fowt_env.training.rl.checkpoint_signature import _key; print(_key())\n"
    code = nobody + SMALL + WHERE + key
    assert output(start(code, tmp_path / "cache", **variables)) == ["0.25", "None", "None"]


@pytest.mark.parametrize(
    ("given", "meant"),
    [("~/fowt cache", "home/fowt cache"), ("fowt cache", "fowt cache"), ("", "home/.cache/fowt_env")],
)
def test_the_home_folder_is_found_where_no_shell_has_put_it(given, meant, tmp_path):
    variables = {"FOWT_CACHE_DIR": given, "XDG_CACHE_HOME": "relative", "HOME": str(tmp_path / "home")}
    code = "from fowt_env.folders import cache_root; print(cache_root())"
    assert " ".join(output(start(code, tmp_path / "cache", **variables))) == str(tmp_path / meant)
    assert not list(tmp_path.iterdir())


class Mark:
    """Makes a folder when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


# These run as another user than the one whose folder it is: the superuser gives the files away, and who is
# not believes to be the next. Nothing of this depends on who runs the tests.
OTHER = 54321


def run_as_another(code, place, **variables):
    """(lines, stderr) of a program that finds the files of a place to be somebody else's."""
    if os.geteuid() == 0:
        for path in (place, *place.rglob("*")):
            os.chown(path, OTHER, -1)
    else:
        code = f"import os; os.geteuid = lambda: {os.geteuid() + 1}\n" + code
    process = start(code, place.parent / "unused", **variables)
    stdout, stderr = process.communicate(timeout=300)
    assert process.returncode == 0, stderr
    return stdout.split(), stderr


@pytest.mark.parametrize(
    "whose", ["kernels", *(pytest.param(whose, marks=pytest.mark.nightly) for whose in ("sources", "files"))]
)
def test_no_code_of_another_user_is_read(whose, tmp_path):
    folder, mark = tmp_path / "cache", tmp_path / "mark"
    _, used = output(start(SMALL + WHERE, folder))
    for path in Path(used).rglob("*.nb[ic]"):
        path.write_bytes(pickle.dumps(Mark(mark)))
    (index,) = Path(used).rglob("waves.ramp*.nbi")
    pickle.loads(index.read_bytes())
    mark.rmdir()  # it works
    places = {"kernels": folder / "kernels", "sources": index.parent, "files": index}
    lines, stderr = run_as_another(SMALL + WHERE, places[whose], FOWT_CACHE_DIR=str(folder))
    assert not mark.exists()
    if whose == "files" and os.geteuid() == 0:  # their folder is ours: they are replaced
        assert lines == ["0.25", used] and stderr == ""
    else:
        assert lines == ["0.25", "None"]
        assert stderr.count("belongs to user") == 1 and "Set FOWT_CACHE_DIR" in stderr


@pytest.mark.parametrize(
    "fault", ["inner 0o702", pytest.param("outer 0o1777", marks=pytest.mark.nightly), "link"]
)
def test_a_folder_that_others_can_write_or_a_link_is_not_used(fault, tmp_path):
    (used,) = output(start(WHERE, tmp_path / "cache"))
    place, said = Path(used) if "inner" in fault else Path(used).parent, "is a symbolic link"
    if fault == "link":
        place.rename(tmp_path / "elsewhere")
        place.symlink_to(tmp_path / "elsewhere")
    else:
        mode = int(fault.split()[1], 8)
        place.chmod(mode)
        said = f"{place} can be written by others (mode {mode:04o})"
    process = start(WHERE, tmp_path / "cache")
    stdout, stderr = process.communicate(timeout=300)
    assert stdout.split() == ["None"] and said in stderr and stderr.count("Warning") == 1


def test_folders_and_files_are_private_and_read_again_whatever_the_umask(tmp_path):
    folder, code = tmp_path / "new" / "cache", "import os; os.umask(0)\n" + SMALL + HITS
    assert output(start(code, tmp_path / "unused", FOWT_CACHE_DIR=str(folder))) == ["0.25", "0"]
    paths = [folder.parent, *folder.parent.rglob("*")]
    assert any(path.suffix == ".nbc" for path in paths)
    assert not any(path.stat().st_mode & 0o077 for path in paths)
    assert output(start(code, tmp_path / "unused", FOWT_CACHE_DIR=str(folder))) == ["0.25", "1"]


@pytest.mark.parametrize("ending", ["nbi", pytest.param("nbc", marks=pytest.mark.nightly)])
def test_a_file_that_others_can_write_is_not_read(ending, tmp_path):
    output(start(SMALL, tmp_path / "cache"))
    (path,) = (tmp_path / "cache").rglob(f"waves.ramp*.{ending}")
    path.chmod(0o666)
    assert output(start(SMALL + HITS, tmp_path / "cache")) == ["0.25", "0"]
    assert path.stat().st_mode & 0o777 == 0o600
    assert output(start(SMALL + HITS, tmp_path / "cache")) == ["0.25", "1"]


@pytest.mark.nightly
def test_a_folder_that_is_read_only_is_read(tmp_path):
    """As one that root has filled for all: what is there is used, and what is not is compiled."""
    output(start(SMALL, tmp_path / "cache"))
    folders = [path for path in (tmp_path / "cache").rglob("*") if path.is_dir()]
    before = {path: path.stat().st_mtime_ns for path in folders}
    locked = (
        "import os\nreal = os.mkdir, os.open\n"
        "def refuse(path, *rest, **more): raise PermissionError(13, 'read only', str(path))\n"
        "def reading(path, flags, *rest, **more):\n"
        "    if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT): refuse(path)\n"
        "    return real[1](path, flags, *rest, **more)\n"
        "os.mkdir = os.utime = os.replace = os.unlink = os.rmdir = refuse\nos.open = reading\n"
    )
    more = (
        "from fowt_env.plant.state import add, NO_LOAD\n"
        "@entry\ndef total(load):\n    return add(load, load).fx\n"
        "print(total(NO_LOAD))\n"
    )
    assert output(start(locked + SMALL + HITS + more, tmp_path / "cache")) == ["0.25", "1", "0.0"]
    assert before == {path: path.stat().st_mtime_ns for path in folders}


LAW = """
from fowt_env.plant.compile.decorators import control_kernel, entry, kernel
from gains import GAIN, wanted_pitch
import gains

@kernel
def own_helper(speed):
    return wanted_pitch(speed) + 100.0 * GAIN

@entry
def total(values):
    return values[0] + own_helper(0.0)

@control_kernel
def law(parameters, memory, measurement, command):
    command[0] = gains.GAIN
    command[1] = own_helper(measurement[0])
"""
GAINS = (
    "from fowt_env.plant.compile.decorators import kernel\nGAIN = {}\n"
    "@kernel\ndef wanted_pitch(speed):\n    return {}\n"
)
CALL_LAW = """
import numpy as np
from fowt_env.control import call_law
from law import law, total
four = [np.zeros(2) for _ in range(4)]
call_law(law, *four)
print(*four[3], total(four[0]))
"""


def test_code_of_a_user_is_what_it_says_after_an_edit_of_another_file(tmp_path):
    """Helpers, entries and laws, and numbers of other modules."""
    (tmp_path / "law.py").write_text(LAW)
    for gain, pitch in ((1.0, 0.25), (2.0, 0.25), (2.0, 0.75)):
        (tmp_path / "gains.py").write_text(GAINS.format(gain, pitch))
        expected = [f"{gain}", f"{100.0 * gain + pitch}", f"{100.0 * gain + pitch}"]
        variables = {
            "PYTHONDONTWRITEBYTECODE": "1",  # whose .pyc has a time of whole seconds
            "FOWT_CACHE_DIR": os.environ.get("FOWT_CACHE_DIR", ""),  # where our own laws are compiled already
        }
        assert output(start(CALL_LAW, tmp_path / "unused", **variables)) == expected


def apply(function, value):
    """function(value), for the test below."""
    return function(value)


def test_what_is_compiled_into_one_of_ours_for_a_users_function_is_not_kept(tmp_path):
    """But for a law it is, which is an address to it."""
    compiled = numba.njit(apply)
    compiled._cache = disk_cache.KernelCache(apply, tmp_path)
    helper = numba.njit(lambda x: x + 1.0)
    assert compiled(helper, 1.0) == 2.0 and compiled((helper, helper)[0], 2.0) == 3.0
    assert not list(tmp_path.rglob("*.nb?"))
    law = numba.cfunc("float64(float64)")(lambda x: x + 2.0)
    assert compiled(law, 1.0) == 3.0
    assert len(list(tmp_path.rglob("*.nbc"))) == 1


def test_another_way_of_numba_to_keep_code_is_noticed(monkeypatch, tmp_path):
    monkeypatch.setattr(disk_cache.caching, "IndexDataCacheFile", lambda **given: object())
    monkeypatch.setattr(disk_cache.numba, "__version__", "9.9.9")
    with pytest.raises(ImportError, match="numba 9.9.9"):
        disk_cache.KernelCache(kernel_folder, tmp_path)


PARTS = """
from fowt_env.plant.compile.decorators import entry, kernel, separate_kernel

@kernel
def doubled(x):
    return 2.0 * x

@separate_kernel
def inner(x):
    return doubled(x) + 1.0

@separate_kernel
def outer(x):
    return inner(x) * 10.0

@entry
def whole(x):
    return outer(x) + inner(x)

@entry
def batch(x):
    return whole(x) + 1.0

@entry
def batches(x):
    return batch(x) + 1.0
"""
CALL_PARTS = """
from fowt_env.plant import parts
{}
print(parts.whole(1.0), *(sum(f.stats.cache_hits.values()) for f in (parts.whole, parts.outer, parts.inner)))
"""


def test_a_separate_kernel_is_loaded_or_compiled_before_code_that_calls_it_by_name(tmp_path):
    code = copied_code(tmp_path)
    (code / "fowt_env" / "plant" / "parts.py").write_text(PARTS)

    def called(first=""):
        return output(start(CALL_PARTS.format(first), tmp_path / "cache", root=code))

    assert called() == ["33.0", "0", "0", "0"]
    assert called() == ["33.0", "1", "1", "1"]
    for lost in ("inner", "outer"):
        for path in (tmp_path / "cache").rglob(f"parts.{lost}*.nbc"):
            path.unlink()
        hits = [str(int(name != lost)) for name in ("whole", "outer", "inner")]
        assert called("parts.doubled(3)") == ["33.0", *hits]  # numba has numbered other functions first
        assert called() == ["33.0", "1", "1", "1"]


@pytest.mark.nightly
def test_code_compiled_with_an_entry_from_disk_loads_the_kernels_that_the_entry_calls_by_name(tmp_path):
    """As a batch of environments after an environment: each here in a process of its own."""
    code = copied_code(tmp_path)
    (code / "fowt_env" / "plant" / "parts.py").write_text(PARTS)
    for name, result in (("whole", 33), ("batch", 34), ("batches", 35), ("batches", 35), ("batch", 34)):
        program = f"from fowt_env.plant import parts\nprint(parts.{name}(1.0))\n"
        assert output(start(program, tmp_path / "cache", root=code)) == [f"{result}.0"]


@pytest.mark.nightly
def test_kernels_outside_the_plant_are_kept_until_what_they_import_changes(tmp_path):
    """Their sources do not shape the name of the folder."""
    code = copied_code(tmp_path)
    (code / "fowt_env" / "training" / "numbers.py").write_text("GAIN = 1.0\n")
    (code / "fowt_env" / "training" / "study.py").write_text(
        "from fowt_env.plant.compile.decorators import entry\nfrom fowt_env.training.numbers import GAIN\n"
        "@entry\ndef amplified(x):\n    return GAIN * x\n"
    )
    program = (
        "from fowt_env.training.study import amplified as f\n"
        "print(f(2.0), sum(f.stats.cache_hits.values()))\n"
    )
    for expected in (["2.0", "0"], ["2.0", "1"]):
        assert output(start(program, tmp_path / "cache", code)) == expected
    with (code / "fowt_env" / "training" / "cli" / "app.py").open("a") as text:
        text.write("\n# an edit of what is not compiled\n")
    assert output(start(program, tmp_path / "cache", code)) == ["2.0", "1"]
    (code / "fowt_env" / "training" / "numbers.py").write_text("GAIN = 10.0\n")
    for expected in (["20.0", "0"], ["20.0", "1"]):
        assert output(start(program, tmp_path / "cache", code)) == expected
    assert len(list((tmp_path / "cache" / "kernels").iterdir())) == 1


KEYS = """
import re
from fowt_env.layout import FOLDERS, PACKAGE, installed_path
from fowt_env.plant.compile.decorators import CACHE_FOLDER, PLANT, _stamp
compiled = re.compile("^@(|inlined_|shared_|separate_|control_)kernel$|^@(|parallel_)entry$", re.MULTILINE)
for room in (PACKAGE, *FOLDERS.values()):
    for path in room.rglob("*.py"):
        if PLANT not in path.parents and compiled.search(path.read_text()):
            print(installed_path(path).relative_to(PACKAGE).as_posix(), _stamp(str(path)))
print("folder", CACHE_FOLDER.name)
print("loaded")
"""


def keys(code, cache):
    """{kernels' file: hash of what they depend on outside the plant}, and what became of one of the plant."""
    words = output(start(f"{SMALL}{KEYS}{HITS}", cache, code))[1:]
    return dict(zip(words[::2], words[1::2], strict=True))


@pytest.mark.nightly
def test_an_edit_of_a_text_or_a_plot_compiles_nothing(tmp_path):
    code, cache = copied_code(tmp_path), tmp_path / "cache"
    before = keys(code, cache)
    assert {"envs/episode.py", "envs/rewards.py", "run/simulation.py"} < set(before)
    assert before["loaded"] == "0"
    for folder in LOOKS:
        edit(code / folder)
    rewards = code / "fowt_env" / "envs" / "rewards.py"
    for path in (code / "fowt_env" / "plant" / "hydro" / "waves.py", rewards):  # functions move, texts change
        text = path.read_text().replace('"""', '"""Other words.\n\n\n', 1)
        path.write_text(text.replace('):\n    """', '):\n    # a comment\n    """Also here. '))
    assert keys(code, cache) == before | {"loaded": "1"}
    edit(rewards)  # and of a reward what uses it
    after = keys(code, cache)
    changed = {name for name in before if after[name] != before[name]} - {"loaded"}
    assert {"envs/rewards.py", "envs/episode.py"} <= changed
    assert not {"folder", "run/simulation.py", "controllers/pi.py"} & changed


@pytest.mark.parametrize(
    ("before", "after", "same"),
    [
        ('"""A."""\ndef f(x):\n    """F."""\n    return x', "# note\n\ndef f(x):\n    return (x)", True),
        ("class A(T):\n    x: Annotated[float, 'm']", "class A(T):\n    'A.'\n    x: float  # m", True),
        ("class A(T):\n    x: Annotated[int, 'm']", "class A(T):\n    x: Annotated[float, 'm']", False),
        ("def f(x):\n    return x + 1", "def f(x):\n    return x + 2", False),
        ("A = 'text'", "A = 'other'", False),
        ("def f():\n    return 'text'", "def f():\n    return 'other'", False),
    ],
)
def test_the_hash_of_a_source_is_that_of_its_code(before, after, same, tmp_path):
    hashes = []
    for number, text in enumerate((before, after)):
        path = tmp_path / f"{number}.py"
        path.write_text(text)
        hashes.append(read_source(path).code)
    assert (hashes[0] == hashes[1]) is same


@pytest.mark.nightly
def test_a_broken_list_of_parsed_sources_is_made_anew_and_one_of_others_is_not_read(tmp_path):
    """A wrong hash in it would have kernels of other code loaded."""
    (used,) = output(start(WHERE, tmp_path / "cache"))
    (kept,) = (tmp_path / "cache" / "sources").iterdir()
    sound = json.loads(kept.read_bytes())
    wrong = json.dumps({key: ["0" * 32, *rest] for key, (_, *rest) in sound.items()})
    for content, mode in (("{", 0o600), ('{"a": 1}', 0o600), (wrong, 0o666)):
        kept.write_text(content)
        kept.chmod(mode)
        assert output(start(WHERE, tmp_path / "cache")) == [used]
        assert json.loads(kept.read_bytes()) == sound and kept.stat().st_mode & 0o777 == 0o600


def test_functions_of_one_name_in_a_module_are_kept_apart(tmp_path):
    """Numba tells them apart by their lines, which change with every text above them."""
    kept = []
    for factor in (2.0, 3.0):
        scope = {"__name__": __name__}
        exec(compile(f"def scaled(x):\n    return {factor} * x", __file__, "exec"), scope)
        compiled = numba.njit(scope["scaled"])
        compiled._cache = disk_cache.KernelCache(scope["scaled"], tmp_path)
        kept.append(compiled(1.0))
    assert kept == [2.0, 3.0] and len(list(tmp_path.rglob("*.nbi"))) == 2


def test_kernels_of_other_sources_of_the_plant_are_never_used(tmp_path):
    """Numba alone would: it watches the file of the function, and not those of what it calls."""
    code = copied_code(tmp_path)
    (code / "fowt_env" / "extra.py").write_text(
        "from fowt_env.plant.compile.decorators import kernel\nfrom fowt_env.plant.state import add\n"
        "@kernel\ndef twice(load):\n    return add(load, load).fx\n"
    )
    program = (
        "from fowt_env.extra import twice\nfrom fowt_env.plant.state import NO_LOAD\n"
        "print(twice(NO_LOAD._replace(fx=1.0)))\n"
    )
    assert output(start(program, tmp_path / "cache", code)) == ["2.0"]
    state = code / "fowt_env" / "plant" / "state.py"
    text = state.read_text()
    assert "a.fx + b.fx" in text
    state.write_text(text.replace("a.fx + b.fx", "a.fx - b.fx"))
    assert output(start(program, tmp_path / "cache", code)) == ["0.0"]
    state.write_text(text)
    assert output(start(program, tmp_path / "cache", code)) == ["2.0"]
    assert len(list((tmp_path / "cache" / "kernels").iterdir())) == 2


def test_the_plant_imports_nothing_of_this_project_that_could_be_compiled_into_it():
    names = {name for path in PLANT.rglob("*.py") for name in read_source(path).top}
    modules = {name for name in names if module_path(name).with_suffix(".py").is_file()}
    outside = {name for name in modules if not name.startswith("fowt_env.plant.")}
    # what raises errors, finds folders and keeps tables is Python's alone: numba could not compile it
    assert outside == {"fowt_env.errors", "fowt_env.folders", "fowt_env.caches", "fowt_env.layout"}


@pytest.mark.nightly
def test_broken_files_are_compiled_anew(tmp_path):
    folder = tmp_path / "cache"
    assert output(start(SMALL, folder)) == ["0.25"]
    for ending, content in (("nbi", b""), ("nbi", b"\x80\x04broken"), ("nbc", bytes(3000))):
        files = list(folder.rglob(f"*.{ending}"))
        for path in files:
            path.write_bytes(content)
        assert files and output(start(SMALL, folder)) == ["0.25"], (ending, content[:10])
        written = [path.read_bytes() for path in files if path.stem.startswith("waves.ramp")]
        assert written and content not in written, (ending, content[:10])


def test_without_space_for_machine_code_kernels_work_all_the_same(tmp_path):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"
    assert output(start(limit + SMALL, tmp_path / "cache")) == ["0.25"]
    assert not list((tmp_path / "cache").rglob("*.nbc"))


KEEPER = """
import pathlib, sys
from fowt_env.plant.compile.disk_cache import SharedCacheFile
file = SharedCacheFile(sys.argv[1], "function", "stamp")
ready = pathlib.Path(sys.argv[2])
(ready / sys.argv[3]).touch()
while len(list(ready.iterdir())) < 3:
    pass
for number in range(100):
    file.save((sys.argv[3], number), f"code of {sys.argv[3]} {number}")
"""


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_two_processes_that_compile_at_once_give_the_same_bits_as_one_that_loads(tmp_path):
    folder = tmp_path / "cache"
    together = [start(DECAY, folder) for _ in range(2)]
    (one, said_one), (other, said_other) = (output(process) for process in together)
    loaded, said = output(start(DECAY, folder))
    assert one == other == loaded
    assert (said_one, said_other, said) == ("1", "1", "0")
