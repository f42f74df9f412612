"""What users are told while kernels are compiled, wherever they call from, and a slower collector meanwhile.

It goes to stderr: a line at the start, one at the end, and between them a line that counts, which a terminal
has drawn over every REDRAW seconds and a log, a pipe or a notebook gets every REPEAT seconds. The
environment variable FOWT_QUIET and set_quiet switch it off.
"""

import atexit
import gc
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager, suppress

from numba.core import event

COMPILING_MESSAGE = "compiling kernels (first run of this kind of scene only, 5 s to 1 min) ..."
NAME = "fowt_env: "
DELAY = 1.0  # s of compiling after which the user is told: a kernel or two take less
PAUSE = 2.0  # s without compiling after which it counts as ended
REDRAW = 0.2  # s between counts on a terminal
REPEAT = 15.0  # s between counts where lines stay
# While kernels are compiled numba makes millions of objects that stay, over which Python's collector goes
# again and again: a seventh of the time at its usual threshold of some hundreds.
COLLECT_AFTER = 200_000


def own(compiled):
    """Return whether an event of numba is about a kernel of this project, not one of numba's or a user's."""
    return (compiled.data["dispatcher"].py_func.__module__ or "").startswith("fowt_env.")


def _redraws(stream):
    """Return whether a line can be written over: not in rich's live displays, which wait for its end."""
    if type(stream).__name__ == "FileProxy":
        return False
    with suppress(Exception):
        return stream.isatty()
    return False


class Notice(event.Listener):
    """Listens to numba, under whose lock for compiling it is called: by one thread at a time."""

    def __init__(self):
        self.quiet = False  # by set_quiet
        self.counters = []  # of the contexts in which somebody else says it
        self.depth = 0  # of kernels that are being compiled for kernels
        self.count = 0  # compiled since `_begin`
        self.spent = 0.0  # s, by those at the top
        self.started = self.ended = 0.0  # of the last one at the top
        self.thread = None
        self.stop = threading.Event()
        self.writing = threading.Lock()
        self.drawn = 0  # characters of the line that counts
        self.thresholds = None

    def on_start(self, compiled):
        """Note that numba begins with a kernel."""
        if not own(compiled):
            return
        self.depth += 1
        if self.depth > 1:
            return
        self.started = time.monotonic()
        found = gc.get_threshold()
        if 0 < found[0] < COLLECT_AFTER:
            self.thresholds = found
            gc.set_threshold(COLLECT_AFTER, *found[1:])
        if self.thread is None or not self.thread.is_alive():  # it does not live on in a fork
            self._begin()

    def on_end(self, compiled):
        """Note that numba has ended with a kernel, or failed."""
        if not own(compiled):
            return
        self.count += 1
        self.depth -= 1
        for counter in self.counters:
            counter()
        if self.depth > 0:
            return
        self.ended = time.monotonic()
        self.spent += self.ended - self.started
        if self.thresholds is not None:
            gc.set_threshold(*self.thresholds)
            self.thresholds = None
        with self.writing:
            self._erase()  # the next thing on the terminal may be the user's own

    def _begin(self):
        self.count, self.spent = 0, 0.0
        if self.quiet or self.counters or os.environ.get("FOWT_QUIET", "0") not in ("", "0"):
            return
        if multiprocessing.parent_process() is not None:  # which says it
            return
        self.stop.clear()
        self.thread = threading.Thread(target=self._watch, name="fowt_env compiling", daemon=True)
        self.thread.start()

    def _watch(self):
        """Tell the user, from a thread of its own: half the wait is one call of LLVM's."""
        told = None  # s of compiling at the last line that stays
        while not self.stop.wait(REDRAW):
            now = time.monotonic()
            working = self.depth > 0
            spent = self.spent + (now - self.started if working else 0.0)
            if told is None:
                if spent >= DELAY and not self.counters:
                    told = spent
                    self._write(f"{NAME}{COMPILING_MESSAGE}\n")
            elif working and _redraws(sys.stderr):
                self._draw(f"{NAME}{self.count} kernels compiled, {spent:.0f} s ")
            elif working and spent >= told + REPEAT:
                told = spent
                self._write(f"{NAME}{self.count} kernels compiled, {spent:.0f} s ...\n")
            if not working and now - self.ended > PAUSE:
                break
        if told is not None:
            self._write(f"{NAME}{self.count} kernels compiled in {self.spent:.0f} s\n")

    def _write(self, text):
        with self.writing:
            self._erase()
            self._put(text)

    def _draw(self, text):
        with self.writing:
            if self.depth > 0:
                self._put("\r" + text.ljust(self.drawn))
                self.drawn = len(text)

    def _erase(self):
        if self.drawn:
            self._put("\r" + " " * self.drawn + "\r")
            self.drawn = 0

    @staticmethod
    def _put(text):
        with suppress(Exception):  # no stderr, or one that is closed: nothing to fail for
            sys.stderr.write(text)
            sys.stderr.flush()

    def close(self):
        """End the thread: at the interpreter's end one that writes could stop it."""
        self.stop.set()
        if self.thread is not None and self.thread.is_alive():
            self.thread.join(2.0)


NOTICE = Notice()
event.register("numba:compile", NOTICE)
atexit.register(NOTICE.close)


def set_quiet(quiet: bool = True) -> None:
    """Silence this process while it compiles kernels (quiet), as the variable FOWT_QUIET=1 does, or not."""
    NOTICE.quiet = bool(quiet)


@contextmanager
def compilation_reported(said: Callable[[int], object]):
    """Return a context without prints, in which each compiled kernel calls said(kernels compiled so far)."""
    count = 0

    def counter():
        nonlocal count
        count += 1
        said(count)

    NOTICE.counters.append(counter)
    try:
        yield
    finally:
        NOTICE.counters.remove(counter)
