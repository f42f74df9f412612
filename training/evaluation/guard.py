"""Isolates a run from the code of its controller: exits, time limits, unprintable messages."""

import faulthandler
import os
import signal
import threading
import time
from contextlib import contextmanager, suppress

from fowt_env.errors import ControllerError, ControllerInputError, SimulationStopped

LONGEST_REASON = 500  # characters
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # sent from outside: they end the evaluation
AGAIN = 1.0  # s between repetitions of TimeLimit, for code that catches the exception
GRACE = 5.0  # s after the time limit at which a worker blocked in C code is ended
LIMIT_CODE = 1  # exit code of a worker ended after GRACE

_traceback_file = None  # in a worker: file for the output of faulthandler


class TimeLimit(KeyboardInterrupt):
    """Raised in a run that exceeds its time limit.

    Not an Exception, so that `except Exception` in a controller does not catch it; a KeyboardInterrupt, to
    which simulate attaches the rows so far.
    """


def as_worker():
    """Let faulthandler end this process if a run exceeds its limit by GRACE seconds."""
    global _traceback_file
    if _traceback_file is None:
        _traceback_file = open(os.devnull, "w")  # noqa: SIM115 (for as long as the process lives)


def attempt(function, limit=None):
    """Return (function(), None), or (None, its exception), including SystemExit and KeyboardInterrupt.

    limit: seconds of wall clock after which TimeLimit is raised in the function. The limit applies to Python
    code of the main thread; C code that never returns is ended only in a worker, with the worker. The working
    folder is restored.
    Raises: the exception of a handler of SIGNALS (Ctrl-C: KeyboardInterrupt), even if the function caught it.
    """
    folder = os.path.abspath(os.curdir)
    with _noted_signals() as raised:
        try:
            with _time_limit(limit):
                outcome = function(), None
        except BaseException as error:
            outcome = None, error
        with suppress(OSError):  # the function may have removed it
            os.chdir(folder)
    if raised:
        raise raised[0]
    return outcome


@contextmanager
def _noted_signals():
    """Yield a list of the exceptions that handlers of SIGNALS raise during the block."""
    raised, handlers = [], {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in SIGNALS}

    def note(number, frame):
        try:
            handlers[number](number, frame)
        except BaseException as error:
            raised.append(error)
            raise

    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, note)
    try:
        yield raised
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


@contextmanager
def _time_limit(seconds):
    """Raise TimeLimit in the block after some seconds, and again every AGAIN seconds; None: never."""
    if seconds is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    armed = [True]

    def late(number, frame):
        if armed:
            raise TimeLimit(time_limit_reason(seconds))

    rest, period = signal.getitimer(signal.ITIMER_REAL)  # an alarm of the program, restored below
    began = time.monotonic()
    handler = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    if _traceback_file is not None:  # runs in a C thread, so it also ends C code that holds the GIL
        faulthandler.dump_traceback_later(seconds + GRACE, exit=True, file=_traceback_file)
    try:
        try:
            yield
        finally:
            armed.clear()
    finally:
        if _traceback_file is not None:
            faulthandler.cancel_dump_traceback_later()
        signal.setitimer(
            signal.ITIMER_REAL, max(1e-3, rest + began - time.monotonic()) if rest else 0.0, period
        )
        signal.signal(signal.SIGALRM, signal.SIG_DFL if handler is None else handler)


def time_limit_reason(seconds):
    """Return the reason of failure of a run that exceeded a time limit in seconds."""
    return f"time limit: more than {seconds:g} s of wall clock"


def reason_of(error):
    """Return why a run failed, in a printable line of at most LONGEST_REASON characters."""

    def message():
        text = str(error.reason if isinstance(error, SimulationStopped) else error)
        if isinstance(error, SimulationStopped | TimeLimit | ControllerError | ControllerInputError):
            return printable(text)
        return printable(f"{type(error).__name__}: {text}" if text else type(error).__name__)

    text, failure = attempt(message)
    return text if failure is None else f"{type(error).__name__}: its message cannot be read"


def printable(text):
    """Return a text as one line of at most LONGEST_REASON characters, unprintable characters escaped."""
    words = " ".join(text[: 2 * LONGEST_REASON].split())
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in words)
    if len(line) > LONGEST_REASON or len(text) > 2 * LONGEST_REASON:
        line = line[: LONGEST_REASON - 4] + " ..."
    return line
