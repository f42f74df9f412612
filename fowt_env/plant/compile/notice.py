"""Reports to the user that kernels are being compiled, and makes garbage collection less frequent meanwhile.

The report goes to stderr: a line at the start, a line at the end, and in between the number of kernels
compiled so far, redrawn every REDRAW seconds on a terminal and printed every REPEAT seconds to a log, a pipe
or a notebook. The environment variable FOWT_QUIET and set_quiet switch the report off.
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

COMPILING_MESSAGE = "compiling kernels (first run of this kind of scene only, 10 s to 2 min) ..."
NAME = "fowt_env: "
DELAY = 1.0  # s of compiling before the first line: a kernel or two take less
PAUSE = 2.0  # s without compiling after which compilation counts as finished
REDRAW = 0.2  # s between counts on a terminal
REPEAT = 15.0  # s between counts where lines cannot be overwritten
# While compiling, numba allocates millions of long-lived objects, which Python's collector scans again and
# again: a seventh of the compile time at its default threshold of some hundreds.
COLLECT_AFTER = 200_000


def own(compiled):
    """Return whether a compile event of numba concerns a kernel of this project."""
    return (compiled.data["dispatcher"].py_func.__module__ or "").startswith("fowt_env.")


def _redraws(stream):
    """Return whether a stream can overwrite a line; rich's live displays cannot, they print whole lines."""
    if type(stream).__name__ == "FileProxy":
        return False
    with suppress(Exception):
        return stream.isatty()
    return False


class Notice(event.Listener):
    """Listens to numba's compile events; the compiler lock admits one thread at a time."""

    def __init__(self):
        self.quiet = False  # set by set_quiet
        self.counters = []  # callbacks of active compilation_reported contexts, which report instead
        self.depth = 0  # nesting: a kernel is compiled while its caller is
        self.count = 0  # kernels compiled since `_begin`
        self.spent = 0.0  # s, in outermost compilations
        self.started = self.ended = 0.0  # of the last outermost compilation
        self.thread = None
        self.stop = threading.Event()
        self.writing = threading.Lock()
        self.drawn = 0  # characters of the drawn line
        self.thresholds = None

    def on_start(self, compiled):
        """Record that numba starts to compile a kernel."""
        if not own(compiled):
            return
        self.depth += 1
        if self.depth > 1:
            return
        self.started = time.monotonic()
        current = gc.get_threshold()
        if 0 < current[0] < COLLECT_AFTER:
            self.thresholds = current
            gc.set_threshold(COLLECT_AFTER, *current[1:])
        if self.thread is None or not self.thread.is_alive():  # a forked process has no thread
            self._begin()

    def on_end(self, compiled):
        """Record that numba has compiled a kernel, or failed to."""
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
            self._erase()  # the user may print next

    def _begin(self):
        self.count, self.spent = 0, 0.0
        if self.quiet or self.counters or os.environ.get("FOWT_QUIET", "0") not in ("", "0"):
            return
        if multiprocessing.parent_process() is not None:  # the parent reports
            return
        self.stop.clear()
        self.thread = threading.Thread(target=self._watch, name="fowt_env compiling", daemon=True)
        self.thread.start()

    def _watch(self):
        """Write the report from a separate thread: half of the compile time is a single call of LLVM."""
        reported = None  # s of compiling at the last line that stays
        while not self.stop.wait(REDRAW):
            now = time.monotonic()
            working = self.depth > 0
            spent = self.spent + (now - self.started if working else 0.0)
            if reported is None:
                if spent >= DELAY and not self.counters:
                    reported = spent
                    self._write(f"{NAME}{COMPILING_MESSAGE}\n")
            elif working and _redraws(sys.stderr):
                self._draw(f"{NAME}{self.count} kernels compiled, {spent:.0f} s ")
            elif working and spent >= reported + REPEAT:
                reported = spent
                self._write(f"{NAME}{self.count} kernels compiled, {spent:.0f} s ...\n")
            if not working and now - self.ended > PAUSE:
                break
        if reported is not None:
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
        with suppress(Exception):  # a missing or closed stderr must not stop the run
            sys.stderr.write(text)
            sys.stderr.flush()

    def close(self):
        """Stop the reporting thread: a write during interpreter shutdown could hang."""
        self.stop.set()
        if self.thread is not None and self.thread.is_alive():
            self.thread.join(2.0)


NOTICE = Notice()
event.register("numba:compile", NOTICE)
atexit.register(NOTICE.close)


def set_quiet(quiet: bool = True) -> None:
    """Switch the compile messages of this process off (quiet, as FOWT_QUIET=1 does) or on."""
    NOTICE.quiet = bool(quiet)


@contextmanager
def compilation_reported(said: Callable[[int], object]):
    """Return a context that prints nothing and calls said(count) after each of count compiled kernels."""
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
