"""What users are told while kernels are compiled: on stderr, once, and nothing where nothing is compiled."""

import gc
import io
import os
import subprocess
import sys
import time
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from fowt_env.plant.compile import notice
from fowt_env.plant.compile.notice import COLLECT_AFTER, COMPILING_MESSAGE, Notice, compilation_reported


def kernel(module="fowt_env.plant.of_a_test"):
    """What numba's events say of a kernel."""

    def function():
        """Nothing."""

    function.__module__ = module
    return SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=function)})


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self):
        return True


@pytest.fixture
def watched(monkeypatch):
    """compile(seconds, times=1, told=Notice()) -> text on stderr when it has ended, with short pauses."""
    monkeypatch.setattr(notice, "DELAY", 0.05)
    monkeypatch.setattr(notice, "PAUSE", 0.1)
    monkeypatch.setattr(notice, "REDRAW", 0.01)
    monkeypatch.delenv("FOWT_QUIET", raising=False)

    def compile(seconds, times=1, told=None, stream=None, module="fowt_env.plant.of_a_test"):
        told, stream = told or Notice(), io.StringIO() if stream is None else stream
        monkeypatch.setattr(sys, "stderr", stream)
        for _ in range(times):
            told.on_start(kernel(module))
            told.on_start(kernel(module))
            time.sleep(seconds)
            told.on_end(kernel(module))
            told.on_end(kernel(module))
        if told.thread is not None:
            told.thread.join(5.0)
            assert not told.thread.is_alive()
        return stream.getvalue()

    return compile


def test_two_lines_where_kernels_of_ours_take_long_and_none_otherwise(watched):
    lines = watched(0.2, times=3).splitlines()
    assert lines[0] == f"fowt_env: {COMPILING_MESSAGE}"
    assert len(lines) == 2 and lines[1].startswith("fowt_env: 6 kernels compiled in ")
    told = Notice()
    assert watched(0.001) == "" == watched(0.2, told=told, module="numba.np.arraymath") and told.count == 0


def test_a_terminal_counts_between_them_and_is_left_clean(watched):
    text = watched(0.2, stream=Terminal())
    shown = text.split("\r")
    assert any("kernels compiled, 0 s" in part for part in shown)
    *_, erased, last = shown
    assert last.startswith("fowt_env: 2 kernels compiled in")
    assert erased.strip() == "" and len(erased) >= len("fowt_env: 0 kernels compiled, 0 s")


def test_a_log_gets_a_line_now_and_then_so_that_a_long_wait_does_not_look_hung(watched, monkeypatch):
    monkeypatch.setattr(notice, "REPEAT", 0.1)
    first, *between, last = watched(0.5).splitlines()
    assert first == f"fowt_env: {COMPILING_MESSAGE}"
    assert 2 <= len(between) <= 5 and all("kernels compiled, 0 s ..." in line for line in between)
    assert last.startswith("fowt_env: 2 kernels compiled in")


def test_a_live_display_that_waits_for_whole_lines_gets_no_counting(watched):
    class FileProxy(Terminal):
        """As rich calls what it puts in place of stderr."""

    assert "\r" not in watched(0.2, stream=FileProxy())


@pytest.mark.parametrize("how", ["variable", "function", "worker", "context"])
def test_it_can_be_silenced(watched, monkeypatch, how):
    told = Notice()
    monkeypatch.setattr(notice, "NOTICE", told)
    if how == "variable":
        monkeypatch.setenv("FOWT_QUIET", "1")
    elif how == "function":
        notice.set_quiet()
    elif how == "worker":
        monkeypatch.setattr(notice.multiprocessing, "parent_process", lambda: object())
    with compilation_reported(lambda count: None) if how == "context" else nullcontext():
        assert watched(0.2, told=told) == ""
    assert told.thread is None


def test_the_collector_is_as_before_once_nothing_is_compiled(monkeypatch):
    monkeypatch.setenv("FOWT_QUIET", "1")
    told, before = Notice(), gc.get_threshold()
    told.on_start(kernel())
    assert gc.get_threshold()[0] == COLLECT_AFTER
    told.on_start(kernel())
    told.on_end(kernel())
    assert gc.get_threshold()[0] == COLLECT_AFTER
    told.on_end(kernel())
    assert gc.get_threshold() == before


def test_a_broken_stderr_ends_nothing(watched):
    stream = io.StringIO()
    stream.close()
    told = Notice()
    with pytest.raises(ValueError, match="closed file"):  # of the test's own reading, at the end
        watched(0.2, told=told, stream=stream)
    assert told.count == 2


COMPILES = """
import sys, time
import fowt_env
from fowt_env.plant.compile import notice
from fowt_env.plant.hydro.waves import ramp_factor
notice.DELAY = 0.0
notice.REDRAW = 0.001
ramp_factor(1.0, 4.0)
assert "rich" not in sys.modules
"""


def test_a_process_that_compiles_says_so_on_stderr_and_one_that_loads_is_silent(tmp_path):
    """The end is told at the interpreter's end where that comes before the pause."""
    environment = {key: value for key, value in os.environ.items() if key != "FOWT_QUIET"}
    environment["FOWT_CACHE_DIR"] = str(tmp_path)
    runs = [
        subprocess.run(
            [sys.executable, "-c", COMPILES], env=environment, capture_output=True, text=True, check=True
        )
        for _ in range(2)
    ]
    assert COMPILING_MESSAGE in runs[0].stderr and "kernels compiled in" in runs[0].stderr
    assert [run.stdout for run in runs] == ["", ""] and runs[1].stderr == ""
