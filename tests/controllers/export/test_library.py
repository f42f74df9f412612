"""Libraries that run a controller in a Python process: the same commands, and no process is left behind."""

import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from bladed_host import Library, changed, needs_compiler, series

from fowt_env import build_scene, simulate
from fowt_env.controllers.bladed.records import NUMBER
from fowt_env.controllers.export import library
from fowt_env.controllers.export.library import export_library, hosted
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError

pytestmark = needs_compiler
TURBINE = read_turbine("nrel5mw")
OWN = '''
import os, sys, time

class Own:
    """Holds the torque, follows the speed; writes its process number; fails, hangs or leaves on demand."""

    def __init__(self):
        with open("pid", "w") as file:
            file.write(str(os.getpid()))

    def reset(self, m):
        self.torque = m.generator_torque

    def act(self, m):
        if m.time > 1.05:
            {late}
        return self.torque, 0.1 * m.rotor_speed
'''


def running(pid):
    """Return whether a process runs (a child that has ended and is not yet waited for does not)."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().split()[2] != "Z"
    except FileNotFoundError:
        return False


def wait_for_end(pid):
    until = time.monotonic() + 10.0
    while running(pid) and time.monotonic() < until:
        time.sleep(0.02)
    assert not running(pid)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Return a function that builds the library of Own, with what it does after a second."""
    monkeypatch.chdir(tmp_path)

    def build(name, late="pass"):
        (tmp_path / f"{name}.py").write_text(OWN.replace("{late}", late))
        monkeypatch.syspath_prepend(tmp_path)
        path = tmp_path / f"lib{name}.so"
        assert export_library(f"{name}:Own", path) == "Python"
        return path

    return build


def pid_of(folder):
    return int((folder / "pid").read_text())


def test_the_process_commands_as_here_and_ends_with_the_run(own, tmp_path):
    arrays = series(TURBINE, instants=25)
    path = own("plain")
    here = hosted("plain:Own", "oc3_hywind", 0.1)
    expected = [here.call(swap) for swap in arrays]
    there = Library(path)
    answers = [there.call(swap) for swap in arrays]
    assert answers == [tuple(row) for row in np.array(expected, dtype=np.float32).tolist()]
    pid = pid_of(tmp_path)
    assert pid != os.getpid() and running(pid)
    began = time.monotonic()
    there.call(changed(arrays[-1], status=-1))
    assert not running(pid) and time.monotonic() - began < 4.0  # s, by itself: killed after 5 s


@pytest.mark.nightly
def test_a_library_runs_again_and_its_process_ends_when_it_is_unloaded(own, tmp_path):
    arrays, there = series(TURBINE, instants=2), Library(own("plain"))
    first, pid = there.call(arrays[0]), pid_of(tmp_path)
    there.call(changed(arrays[1], status=-1))
    assert there.call(arrays[0]) == first and pid_of(tmp_path) != pid
    there.close()
    wait_for_end(pid_of(tmp_path))


@pytest.mark.slow
def test_a_library_controls_the_plant_of_this_package_as_its_law_does(tmp_path):
    scene = build_scene("oc3_hywind", wind=16.0, sea="paper_wind_wave", duration=700.0)
    export_library("floating_feedback", tmp_path / "libff.so")
    export_library("gspi_oc3", tmp_path / "libgspi.so", python=True)
    # the feedback reads an integral in place of the velocity
    for name, law, allowed in (("libgspi", "gspi_oc3", 1e-5), ("libff", "floating_feedback", 0.2)):
        there = simulate(scene, controller=f"dll:{tmp_path / name}.so", duration=30.0)
        here = simulate(scene, controller=law, duration=30.0)
        for channel in ("RotSpeed_[rpm]", "BldPitch1_[deg]", "GenTq_[kN-m]", "PtfmPitch_[deg]"):
            np.testing.assert_allclose(there[channel], here[channel], rtol=0.0, atol=allowed)


@pytest.mark.slow
def test_an_error_of_the_controller_ends_the_run_with_its_words(own, tmp_path):
    arrays = series(TURBINE, instants=25)
    there = Library(own("failing", "raise ValueError('no such wind')"))
    for swap in arrays[:11]:
        there.call(swap)
    with pytest.raises(RuntimeError, match="ValueError.*no such wind"):
        there.call(arrays[11])
    wait_for_end(pid_of(tmp_path))
    with pytest.raises(RuntimeError, match="the first call must have 0"):
        there.call(arrays[12])


@pytest.mark.nightly
def test_a_controller_that_leaves_or_hangs_is_a_message_and_no_endless_wait(own, tmp_path, monkeypatch):
    arrays = series(TURBINE, instants=25)
    times = ("-DLONGEST_START=900.0", "-DLONGEST_STEP=0.5", "-DLONGEST_END=0.2")
    monkeypatch.setattr(library, "READY", built_bridge(tmp_path, *times))
    for name, late, words in (
        ("leaving", "os._exit(3)", "process has ended"),
        ("hanging", "__import__('ctypes').PyDLL(None).sleep(40)", "does not answer in time"),  # with the GIL
    ):
        there = Library(own(name, late))
        for swap in arrays[:11]:
            there.call(swap)
        began = time.monotonic()
        with pytest.raises(RuntimeError, match=words):
            there.call(arrays[11])
        assert not running(pid_of(tmp_path)) and time.monotonic() - began < 20.0


HOST = """
import sys, time
sys.path[:0] = {path}
from bladed_host import Library, series
from fowt_env.descriptions.turbine import read_turbine
one = Library({library!r})
for swap in series(read_turbine("nrel5mw"), instants={calls}):
    one.call(swap)
    print("called", flush=True)
time.sleep(60)
"""


@pytest.mark.slow
@pytest.mark.parametrize("hangs", (pytest.param(False, marks=pytest.mark.nightly), True))
def test_the_process_ends_with_a_host_that_is_killed(hangs, own, tmp_path):
    path = own("orphan", "while True: pass")
    code = HOST.format(path=sys.path, library=str(path), calls=12 if hangs else 3)
    host = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        for _ in range(11 if hangs else 3):
            assert host.stdout.readline() == "called\n"
        pid = pid_of(tmp_path)
        time.sleep(0.3)
        assert running(pid)
    finally:
        host.send_signal(signal.SIGKILL)
        host.wait()
    wait_for_end(pid)


@pytest.mark.nightly
def test_what_cannot_be_started_is_said_at_the_first_call(own, tmp_path, monkeypatch):
    path = own("gone")
    (tmp_path / "gone.py").unlink()
    with pytest.raises(RuntimeError, match="cannot import 'gone'"):
        Library(path).call(series(TURBINE, instants=1)[0])
    monkeypatch.setattr(sys, "executable", "/no/such/python")
    with pytest.raises(RuntimeError, match="cannot start /no/such/python|process has ended"):
        Library(own("pythonless")).call(series(TURBINE, instants=1)[0])


def built_bridge(folder, *options):
    """Return the path of bridge.c built in a folder, as a wheel has it, without a warning."""
    path = folder / "bridge.so"
    source, strict = library.TEMPLATES / "bridge.c", ("-pedantic", "-Wconversion", "-Werror")
    assert library.compile_c([source], path, (*library.SHARED, *strict, *options)) == ""
    return path


def test_a_ready_bridge_needs_no_compiler(own, tmp_path, monkeypatch):
    arrays, by_compiler = series(TURBINE, instants=3), Library(own("plain"))
    expected = [by_compiler.call(swap) for swap in arrays]
    monkeypatch.setattr(library, "READY", built_bridge(tmp_path))
    monkeypatch.setenv("CC", "/no/such/compiler")
    there = Library(own("plain"))
    assert [there.call(swap) for swap in arrays] == expected


def test_records_have_the_numbers_of_the_bladed_interface():
    found = dict(re.findall(r"RECORD_(\w+) = (\d+)", (library.TEMPLATES / "records.h").read_text()))
    assert len(found) > 20
    assert {name.lower(): int(text) for name, text in found.items()}.items() <= NUMBER.items()


def test_settings_that_are_too_long_for_the_library_are_refused(tmp_path):
    bridge = built_bridge(tmp_path).read_bytes()
    assert len(library.with_settings(bridge, "t", "p", "{}")) == len(bridge)
    with pytest.raises(InputError, match="take 9002 bytes: at most 8192"):
        library.with_settings(bridge, "", "", "x" * 8999)


def test_a_missing_or_failing_compiler_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/no/such/compiler")
    with pytest.raises(InputError, match="'/no/such/compiler' does not start"):
        export_library("pi", tmp_path / "libpi.so")
    monkeypatch.setenv("CC", "")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(library.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="install gcc or clang, or pip install ziglang"):
        export_library("pi", tmp_path / "libpi.so")
    assert list(tmp_path.iterdir()) == []


def test_files_of_a_controller_are_kept_as_absolute_paths(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings = library.settings_of("design:mine.json", "hulls/spar.toml", 0.1)
    assert settings["controller"] == f"design:{tmp_path}/mine.json"
    assert settings["platform"] == f"{tmp_path}/hulls/spar.toml" and settings["folder"] == str(tmp_path)
    assert library.settings_of("policy:ppo_lqr", "oc3_hywind", 0.1)["controller"] == "policy:ppo_lqr"
