"""Isolation of a run from the code of its controller: exits, time limits, unprintable messages."""

import faulthandler
import os
import signal
import threading
import time
from contextlib import contextmanager, suppress

from fowt_env.errors import ControllerError, ControllerInputError, SimulationStopped

LONGEST_REASON = 500  # characters
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # from outside: they end the evaluation
AGAIN = 1.0  # s between repetitions of TimeLimit, for code that catches it
GRACE = 5.0  # s after the limit at which a worker in C code is ended
LIMIT_CODE = 1  # exit code of such a worker

_last_words = None  # in a worker: file for the output of faulthandler


class TimeLimit(KeyboardInterrupt):
    """A run that took too long.

    No Exception, so that a controller does not catch it with its own errors, but a KeyboardInterrupt, to
    which simulate attaches the rows so far.
    """


def as_worker():
    """Let faulthandler end this process if a run exceeds its limit by GRACE seconds."""
    global _last_words
    if _last_words is None:
        _last_words = open(os.devnull, "w")  # noqa: SIM115 (for as long as the process lives)


def attempt(function, limit=None):
    """Return (function(), None), or (None, its exception), including SystemExit and KeyboardInterrupt.

    limit: seconds of wall clock after which TimeLimit is raised in the function. It works in Python code of
    the main thread; C code that never returns is ended in a worker only, with the worker. The working folder
    is restored.
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
    if _last_words is not None:  # its thread needs no Python, so it ends C code that holds the GIL
        faulthandler.dump_traceback_later(seconds + GRACE, exit=True, file=_last_words)
    try:
        try:
            yield
        finally:
            armed.clear()
    finally:
        if _last_words is not None:
            faulthandler.cancel_dump_traceback_later()
        signal.setitimer(
            signal.ITIMER_REAL, max(1e-3, rest + began - time.monotonic()) if rest else 0.0, period
        )
        signal.signal(signal.SIGALRM, signal.SIG_DFL if handler is None else handler)


def time_limit_reason(seconds):
    """Return the reason of a run that took longer than some seconds."""
    return f"time limit: more than {seconds:g} s of wall clock"


def reason_of(error):
    """Return the reason of a failed run, in a printable line of at most LONGEST_REASON characters."""

    def said():
        text = str(error.reason if isinstance(error, SimulationStopped) else error)
        if isinstance(error, SimulationStopped | TimeLimit | ControllerError | ControllerInputError):
            return printable(text)
        return printable(f"{type(error).__name__}: {text}" if text else type(error).__name__)

    text, failure = attempt(said)
    return text if failure is None else f"{type(error).__name__}: its message cannot be read"


def printable(text):
    """Return a text in one line of at most LONGEST_REASON characters, unprintable ones escaped."""
    words = " ".join(text[: 2 * LONGEST_REASON].split())
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in words)
    if len(line) > LONGEST_REASON or len(text) > 2 * LONGEST_REASON:
        line = line[: LONGEST_REASON - 4] + " ..."
    return line
