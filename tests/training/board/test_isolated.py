"""Controllers in a process of their own: the same commands, nothing but what they declare, nothing left."""

import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from bladed_library import built, needs_gcc

import fowt_env
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import ControllerError, InputError
from fowt_env.training.board.isolated import IsolatedFactory, ProcessLimits, digest_of, warmed_up
from fowt_env.training.board.judge import inputs_of
from fowt_env.training.board.submission import read_submission

SOUND = """
class Mine:
    def __init__(self, turbine, control_dt):
        self.rated = turbine.rated_rotor_speed * turbine.drivetrain.gear_ratio
        self.torque = turbine.torque_law.rated_torque

    def reset(self, measurement):
        self.integral = measurement.blade_pitch

    def act(self, measurement):
        error = measurement.generator_speed - self.rated
        self.integral += 1e-4 * error
        return self.torque, self.integral + 5e-3 * error
"""
LINE, RESET = "error = measurement.generator_speed - self.rated", "self.integral = measurement.blade_pitch"


def factory(folder, source, information=("generator_speed", "blade_pitch"), within=(), **limits):
    folder.mkdir(exist_ok=True)
    (folder / "mine.py").write_text(source)
    limits = ProcessLimits(**{"call": 2.0, **limits})  # a machine that is busy answers late
    return IsolatedFactory(str(folder), "mine:Mine", "mine", information, (), limits, within=within)


def run(controller, duration=20.0, sensors=None):
    scene = fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="reference")
    return fowt_env.simulate(scene, controller, duration, sensors=sensors)


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Folder in which this test's processes have theirs, and no other test's."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


def test_commands_are_those_of_the_same_controller_here(tmp_path):
    there = run(factory(tmp_path, "print('a word')\n" + SOUND))
    scope = {}
    exec(SOUND, scope)
    here = run(scope["Mine"])
    assert (there["BldPitch1_[deg]"] == here["BldPitch1_[deg]"]).all()
    assert there["BldPitch1_[deg]"].std() > 0.0


@pytest.mark.nightly
@needs_gcc
def test_a_library_of_a_submission_runs_as_it_does_here_and_its_crash_ends_its_run_alone(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    library = built(folder)
    card = 'name = "mine"\nauthor = "A"\nlicence = "MIT"\ncontroller = "discon.so,mode.IN"\n'
    (folder / "card.toml").write_text(card)
    (folder / "mode.IN").write_text("law")
    found = read_submission(folder)
    assert found.kind == "library" and "yaw" in inputs_of(found, read_turbine("nrel5mw"))
    made = found.controller(ProcessLimits(call=2.0))
    here, there = run(f"dll:{library}", 5.0, "standard"), run(made, 5.0, "standard")  # sensors lack readings
    assert np.array_equal(there.to_numpy(), here.to_numpy())
    (folder / "mode.IN").write_text("crash")
    with pytest.raises(ControllerError, match="raised LibraryFailure"):
        run(read_submission(folder).controller(ProcessLimits(call=2.0)), 5.0)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("raise ValueError('4611686018427387905')", r"act\(\) raised ValueError$"),
        pytest.param(
            "raise type('Seed_4611', (Exception,), {})()",
            "raised a custom exception$",
            marks=pytest.mark.nightly,
        ),
        pytest.param("import os; os._exit(3)", "its process ended in act", marks=pytest.mark.nightly),
        ("import time; time.sleep(60)", "act.. took longer than 3 s"),
        pytest.param("raise SystemExit(0)", "raised SystemExit", marks=pytest.mark.nightly),
        pytest.param("return 1.0, float('nan')", "raised ControllerError$", marks=pytest.mark.nightly),
        pytest.param("bytearray(10**11)", "raised MemoryError", marks=pytest.mark.nightly),
        pytest.param(
            "import os; os.truncate(os.open('full', os.O_RDWR | os.O_CREAT), 3 * 10**8)",
            "raised OSError",
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_what_a_controller_does_ends_its_run_alone_and_its_words_are_not_kept(tmp_path, body, words):
    with pytest.raises(ControllerError, match=words):
        run(factory(tmp_path, SOUND.replace(LINE, body), call=3.0))


def test_a_controller_does_not_see_what_the_caller_holds(tmp_path, monkeypatch):
    monkeypatch.setenv("SECRET_SEEDS", "41")
    probe = """
        import os, sys
        parent = open(f"/proc/{os.getppid()}/cmdline").read() + os.readlink(f"/proc/{os.getppid()}/cwd")
        seen = " ".join([*os.environ, *sys.argv, os.getcwd(), os.path.expanduser("~"), parent])
        assert "SECRET_SEEDS" not in seen and "pytest" not in seen and seen.count("fowt-submission-") >= 4
"""
    with pytest.raises(ControllerError, match="raised KeyError"):
        run(factory(tmp_path, SOUND.replace(LINE, probe.strip("\n").strip() + "\n        raise KeyError")))


def test_a_process_starts_anew_for_each_run_and_leaves_nothing(tmp_path, temporary):
    """Neither in its folder nor in that of its kernels, nor anything of the judge's own."""
    left = (
        "import os; left = [os.environ['FOWT_CACHE_DIR'] + '/left', 'left', os.path.expanduser('~/left')]\n"
    )
    source = SOUND.replace(RESET, f"{RESET}; {left}        assert not any(map(os.path.exists, left))\n"
                           "        for path in left: open(path, 'w').close()")  # fmt: skip
    submission = tmp_path / "submission"
    made = factory(submission, source)
    run(made, 2.0)
    run(made, 2.0)
    assert not (submission / "left").exists() and not list(temporary.iterdir())


@pytest.mark.nightly
def test_kernels_come_from_a_run_without_weather_and_are_those_of_each_run(tmp_path, monkeypatch):
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path / "cache"))
    source = SOUND.replace(RESET, f"""{RESET}
        import os
        path = os.environ["FOWT_CACHE_DIR"] + "/count"
        count = len(open(path).read()) if os.path.exists(path) else 0
        open(path, "a").write("x")
        assert count == self.expected""")  # fmt: skip
    submission = tmp_path / "submission"
    quiet = fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="reference")
    made = warmed_up(factory(submission, source.replace("self.expected", "0")), lambda: [quiet], "a")
    kept = Path(made.kernels)
    assert (kept / "count").read_text() == "x" and kept.is_relative_to(tmp_path / "cache" / "submissions")
    (submission / "mine.py").write_text(source.replace("self.expected", "1"))
    for _ in range(2):  # each begins with what the first left, and leaves nothing
        run(made, 2.0)
    assert (kept / "count").read_text() == "x"
    assert warmed_up(made, pytest.fail, "a").kernels == made.kernels


@pytest.mark.nightly
def test_kernels_may_take_long_to_compile_in_the_first_call_of_act(tmp_path, monkeypatch):
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path / "cache"))
    source = SOUND.replace(
        LINE,
        f"""import os, time
        kernel = os.environ["FOWT_CACHE_DIR"] + "/kernel"
        if not os.path.exists(kernel):
            time.sleep(3.0)
            open(kernel, "w").close()
        {LINE}""",
    )
    submission = tmp_path / "submission"
    made = factory(submission, source, call=2.0)
    with pytest.raises(ControllerError, match="took longer than 2 s"):
        run(made, 1.0)
    quiet = fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="reference")
    run(warmed_up(made, lambda: [quiet], "a"), 1.0)


def test_a_first_run_for_kernels_that_is_interrupted_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path))
    made, asked = factory(tmp_path, SOUND), []

    def interrupted():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        warmed_up(made, interrupted, "a")
    assert not list((tmp_path / "submissions").iterdir())
    for _ in range(2):
        kept = warmed_up(made, lambda: asked.append("scenes") or [], "a").kernels
    assert asked == ["scenes"] and [kept] == [str(path) for path in (tmp_path / "submissions").iterdir()]


@pytest.mark.nightly
def test_the_slowest_call_is_noted_where_it_is_the_one_beyond_the_limit(tmp_path):
    log = tmp_path / "log.csv"
    made = factory(tmp_path, SOUND.replace(LINE, "import time; time.sleep(60)"), call=1.5)
    with pytest.raises(ControllerError, match="took longer than 1.5 s"):
        run(replace(made, log=str(log)))
    (line,) = log.read_text().splitlines()
    assert 1.5 <= float(line.rpartition(",")[2]) < 5.0


@pytest.mark.nightly
def test_a_process_that_reads_no_more_does_not_hold_the_judge(tmp_path):
    """The scene is larger than a pipe, and the answer to the first request is there before it is asked."""
    source = """
import os, struct, time
for handle in range(3, 9):
    try:
        os.write(handle, b"k" + struct.pack("<q", 0))
    except OSError:
        pass
time.sleep(600)
"""
    made = factory(tmp_path, source, ("generator_speed", "plant_model"), prepare=1.0, start=60.0)
    began = time.monotonic()
    with pytest.raises(ControllerError, match=r"prepare\(\) took longer than 1 s"):
        run(made)
    assert time.monotonic() - began < 60.0


DAEMON = """
import os, subprocess, sys
subprocess.Popen([sys.executable, "-S", "-c", "import os, time\\nif os.fork(): os._exit(0)\\n"
                  "open(%r, 'w').write(str(os.getpid()))\\ntime.sleep(600)"], start_new_session=True)
while not (os.path.exists(%r) and open(%r).read()):
    pass
"""


def gone(pid, patience=20.0):
    """Whether a process ends within some seconds."""
    ends = time.monotonic() + patience
    while time.monotonic() < ends:
        with suppress(OSError), open(f"/proc/{pid}/stat") as file:
            if file.read().rpartition(")")[2].split()[0] != "Z":
                time.sleep(0.05)
                continue
        return True
    return False


def test_what_a_controller_starts_ends_with_its_run(tmp_path):
    note = str(tmp_path / "pid")
    run(factory(tmp_path, DAEMON % (note, note, note) + SOUND), 1.0)
    assert gone(int(Path(note).read_text()))


@pytest.mark.nightly
def test_what_a_controller_starts_ends_with_a_judge_that_is_killed(tmp_path, temporary):
    note, submission = str(tmp_path / "pid"), tmp_path / "submission"
    submission.mkdir()
    (submission / "mine.py").write_text(DAEMON % (note, note, note) + "while True: pass\n")
    program = (  # of threads and memory, which a judge takes time to give back
        "import threading, time, numpy\n"
        "memory = numpy.ones(3 * 10**8)\n"
        "for _ in range(8): threading.Thread(target=time.sleep, args=(600.0,), daemon=True).start()\n"
        "from fowt_env.training.board.isolated import IsolatedController, IsolatedFactory\n"
        f"made = IsolatedFactory({str(submission)!r}, 'mine:Mine', 'mine', (), ())\n"
        "IsolatedController(made, None, 0.1).reset(None)\n"
    )
    judge = subprocess.Popen([sys.executable, "-c", program])
    try:
        while not (Path(note).exists() and Path(note).read_text()):
            assert judge.poll() is None
            assert len(list(temporary.iterdir())) <= 1
            time.sleep(0.05)
    finally:
        judge.send_signal(signal.SIGKILL)
        judge.wait()
    assert gone(int(Path(note).read_text()))
    ends = time.monotonic() + 20.0
    while list(temporary.iterdir()) and time.monotonic() < ends:
        time.sleep(0.05)
    assert not list(temporary.iterdir())


def test_files_that_have_changed_since_they_were_read_are_not_run(tmp_path):
    made = factory(tmp_path, SOUND)
    made = IsolatedFactory(**{**vars(made), "digest": digest_of(tmp_path)})
    run(made, 1.0)
    (tmp_path / "mine.py").write_text(SOUND + "#")
    with pytest.raises(InputError, match="files have changed"):
        run(made, 1.0)


@pytest.mark.nightly
def test_a_process_is_started_by_the_command_of_a_container(tmp_path):
    """The command stands before that of Python and is told the folder of the process."""
    script = tmp_path / "box"
    script.write_text('#!/bin/sh\necho "$1" > "$(dirname "$0")/told"\nshift\nexec "$@"\n')
    script.chmod(0o700)
    submission = tmp_path / "submission"
    run(factory(submission, SOUND, within=(str(script), "in {folder}")), 1.0)
    assert (tmp_path / "told").read_text().startswith("in /") and "fowt-sub" in (
        tmp_path / "told"
    ).read_text()


def usable(program):
    """Whether bubblewrap is installed here and may make a container at all."""
    try:
        subprocess.run([program, "--unshare-all", "--ro-bind", "/", "/", "true"], check=True, timeout=60)
    except (OSError, subprocess.SubprocessError):
        return False
    return True


def bubblewrap():
    """The command of docs/guides/leaderboard.md with this installation's folders."""
    page = (Path(fowt_env.__file__).resolve().parents[1] / "docs" / "guides" / "leaderboard.md").read_text()
    command = shlex.split(re.search(r'--within "(bwrap .*?)"', page, re.DOTALL).group(1).replace("\\\n", " "))
    place = command.index("$VIRTUAL_ENV") - 1
    packages = {str(Path(part.__file__).resolve().parents[1]) for part in (fowt_env, numba)}
    folders = {sys.prefix, sys.base_prefix, *packages}
    command[place : place + 3] = [
        word for folder in sorted(folders) for word in ("--ro-bind", folder, folder)
    ]
    return tuple(command)


@pytest.mark.slow
def test_the_described_container_hides_files_processes_and_the_network(tmp_path):
    within = bubblewrap()
    if not usable(within[0]):
        pytest.skip("bubblewrap is not installed, or may not be used here")
    secret = tmp_path / "seeds.txt"
    secret.write_text("4611686018427387905")
    submission = tmp_path / "submission"
    probe = f"""
        import os, socket
        numbers = [name for name in os.listdir("/proc") if name.isdigit()]
        assert not os.path.exists({str(secret)!r}) and not os.path.exists({str(submission)!r})
        assert len(numbers) <= 3 and {str(os.getpid())!r} not in numbers
        assert [name for _, name in socket.if_nameindex()] in ([], ["lo"])
        open("own", "w").write("may be written")
        raise KeyError"""
    with pytest.raises(ControllerError, match="raised KeyError"):
        run(factory(submission, SOUND.replace(LINE, probe.strip()), within=within), 1.0)
