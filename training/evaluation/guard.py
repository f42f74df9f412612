"""Other people's code, run so that it ends no more than its own run: exits, time limits, odd messages."""

import faulthandler
import os
import signal
import threading
import time
from contextlib import contextmanager, suppress

from fowt_env.errors import ControllerError, ControllerInputError, SimulationStopped

LONGEST_REASON = 500  # characters
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # from outside: they end more than a run
AGAIN = 1.0  # s until code that swallowed the time limit meets it again
GRACE = 5.0  # s after the limit at which a worker ends that has not come back to Python
LIMIT_CODE = 1  # exit code of such a worker
REASON_LIMIT = 5.0  # s that the making of a message may take

_last_words = None  # in a worker: file for what faulthandler writes


class TimeLimit(KeyboardInterrupt):
    """A run that took too long.

    No Exception, so that a controller does not catch it with its own errors; a KeyboardInterrupt, with which
    simulate hands out the rows so far.
    """


def as_worker():
    """Let this process be ended where a run in it goes on for GRACE seconds after its limit."""
    global _last_words
    if _last_words is None:
        _last_words = open(os.devnull, "w")  # noqa: SIM115 (for as long as the process lives)


def attempt(function, limit=None):
    """(function(), None), or (None, what it raised), SystemExit and KeyboardInterrupt included.

    limit: seconds of wall clock after which TimeLimit is raised in the function. Heard by the main thread
    alone, and where Python runs: code of C that never returns is ended in a worker only, and the worker
    with it. The working folder is afterwards what it was.
    Raises: what the handler of a signal from outside raised meanwhile (Ctrl-C: KeyboardInterrupt), whatever
    the function made of that.
    """
    folder = os.path.abspath(os.curdir)
    with _noted_signals() as raised:
        try:
            with _time_limit(limit):
                outcome = function(), None
        except BaseException as error:
            outcome = None, error
        with suppress(OSError):  # one that the function has removed
            os.chdir(folder)
    if raised:
        raise raised[0]
    return outcome


@contextmanager
def _noted_signals():
    """Yields a list, which gets what a handler of one of SIGNALS raises."""
    raised, handlers = [], {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in SIGNALS}
        handlers = {number: handler for number, handler in handlers.items() if callable(handler)}

    def note(number, frame):
        try:
            handlers[number](number, frame)
        except BaseException as error:
            raised.append(error)
            raise

    for number in handlers:
        signal.signal(number, note)
    try:
        yield raised
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


@contextmanager
def _time_limit(seconds):
    """Raise TimeLimit in the block after so many seconds, and again every AGAIN seconds; None: never."""
    if seconds is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    armed = [True]

    def late(number, frame):
        if armed:
            raise TimeLimit(time_limit_reason(seconds))

    rest, period = signal.getitimer(signal.ITIMER_REAL)  # somebody else's alarm
    began = time.monotonic()
    handler = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    if _last_words is not None:  # a thread without Python: it ends what holds the interpreter's lock, too
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
    """Why a run failed that took longer than so many seconds."""
    return f"time limit: more than {seconds:g} s of wall clock"


def reason_of(error):
    """One printable line of at most LONGEST_REASON characters that says why a run failed."""

    def said():
        if isinstance(error, SimulationStopped):
            return printable(str(error.reason))
        text = str(error)
        if isinstance(error, TimeLimit | ControllerError | ControllerInputError):
            return printable(text)
        return printable(f"{type(error).__name__}: {text}" if text else type(error).__name__)

    text, failure = attempt(said, REASON_LIMIT)
    if failure is None:
        return text
    return printable(f"{type(error).__name__}, whose message cannot be read ({type(failure).__name__})")


def printable(text):
    """A text in one line of at most LONGEST_REASON characters; what cannot be printed as its escape."""
    words = " ".join(text[: 2 * LONGEST_REASON].split())
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in words)
    if len(line) > LONGEST_REASON or len(text) > 2 * LONGEST_REASON:
        line = line[: LONGEST_REASON - 4] + " ..."
    return line
