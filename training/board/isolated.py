"""A controller in a process of its own, which is given its readings and nothing else.

The process has a copy of the submission's folder, an empty home folder, none of the caller's environment
variables but those in KEPT, and a limit of memory. Its answers are two numbers or a text of fixed form:
they are
not unpickled, so that nothing which it sends runs code here. It starts anew for every run, so that nothing
carries over from one run to the next. It is no jail: it may read whatever this user may read, and open
connections
(docs: what a board cannot detect).
"""

import os
import pickle
import resource
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fowt_env.control import CheckedController
from fowt_env.errors import ControllerError

KEPT = ("PATH", "LANG", "LC_ALL", "PYTHONPATH", "NUMBA_DISABLE_JIT")
LENGTH = struct.Struct("<q")
COMMAND = struct.Struct("<dd")
OK, ERROR = b"k", b"e"
LONGEST_ANSWER = 4096  # bytes
START, PREPARE, RESET, ACT = "start", "prepare", "reset", "act"


@dataclass(frozen=True)
class TimeLimits:
    """Wall-clock seconds and memory that a controller has. A call beyond its limit ends the run as failed."""

    start: float = 120.0  # s, to import and make it; kernels may be compiled
    prepare: float = 300.0  # s
    call: float = 0.1  # s, one call of act() or reset()
    memory: float = 4e9  # bytes of address space


@dataclass(frozen=True)
class IsolatedFactory:
    """Makes controllers of a Python file, each in a process of its own; can be sent to worker processes."""

    folder: str
    file: str
    attribute: str
    name: str
    information: tuple[str, ...]
    preview_times: tuple[float, ...]
    limits: TimeLimits

    def __call__(self, turbine: Any, control_dt: float) -> "CheckedController":
        """The controller for a turbine and control period (s)."""
        return CheckedController(IsolatedController(self, turbine, control_dt), self.name)


class IsolatedController:
    """What the simulator sees of a controller that runs in another process.

    Raises: ControllerError where the process ends, fails, or takes longer than its limits.
    """

    def __init__(self, factory: IsolatedFactory, turbine: Any, control_dt: float) -> None:
        self.factory, self.turbine, self.control_dt = factory, turbine, control_dt
        self.name, self.information = factory.name, factory.information
        self.preview_times = factory.preview_times
        self.slowest = 0.0  # s, of the calls of act()
        self.known: Any = None
        self.process: _Process | None = None

    def prepare(self, scene: Any) -> None:
        """Keep what is known of the plant for the process, which starts at reset()."""
        self.known = scene

    def reset(self, measurement: Any) -> None:
        """A new process, prepared and reset."""
        self.close()
        limits = self.factory.limits
        self.process = _Process(self.factory)
        self._ask(START, (self.factory, self.turbine, self.control_dt), limits.start)
        self._ask(PREPARE, self.known, limits.prepare)
        self._ask(RESET, measurement, limits.prepare)

    def act(self, measurement: Any) -> tuple[float, float]:
        """(generator torque N m, blade pitch rad) as the process answers."""
        began = time.perf_counter()
        answer = self._ask(ACT, measurement, self.factory.limits.call, float(measurement.time))
        self.slowest = max(self.slowest, time.perf_counter() - began)
        if len(answer) != COMMAND.size:
            raise self._fault("its process sent no pair of numbers")
        return COMMAND.unpack(answer)

    def _ask(self, what, content, limit, moment=0.0):
        assert self.process is not None
        try:
            kind, answer = self.process.ask(pickle.dumps((what, content)), limit)
        except TimeoutError:
            self.close()
            raise self._fault(f"{what}() took longer than {limit:g} s", moment) from None
        except (OSError, EOFError):
            self.close()
            raise self._fault(f"its process ended in {what}()", moment) from None
        if kind != OK:
            self.close()
            text = answer.decode("utf-8", "replace")
            raise self._fault(f"{what}() raised {text}", moment)
        return answer

    def _fault(self, why, moment=0.0):
        return ControllerError(f"controller {self.name!r}: {why}", self.name, moment, None)

    def close(self) -> None:
        """End the process, if there is one."""
        if self.process is not None:
            self.process.close()
            self.process = None

    def __del__(self) -> None:
        with suppress(Exception):
            self.close()


class _Process:
    """A started process with two pipes of its own, beside stdout and stderr, which go nowhere."""

    def __init__(self, factory):
        self.folder = tempfile.mkdtemp(prefix="fowt-submission-")
        work = Path(self.folder, "work")
        shutil.copytree(factory.folder, work, ignore=shutil.ignore_patterns("__pycache__"))
        theirs_in, self.to = os.pipe()
        self.back, theirs_out = os.pipe()
        environment = {key: os.environ[key] for key in KEPT if key in os.environ}
        # kernels that it compiles are kept apart from those that this process runs
        environment |= {
            "HOME": self.folder,
            "FOWT_CACHE_DIR": str(_cache_folder(factory)),
            "OMP_NUM_THREADS": "1",
        }
        memory = int(factory.limits.memory)
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(theirs_in), str(theirs_out)],
                pass_fds=(theirs_in, theirs_out),
                cwd=work,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # so that what it starts itself ends with it
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (memory, memory)),
            )
        finally:
            os.close(theirs_in)
            os.close(theirs_out)

    def ask(self, content, limit):
        """(OK or ERROR, bytes) of its answer. Raises: TimeoutError after `limit` s; OSError, EOFError."""
        deadline = time.monotonic() + limit
        _write(self.to, LENGTH.pack(len(content)) + content)
        head = self._read(1 + LENGTH.size, deadline)
        (length,) = LENGTH.unpack(head[1:])
        if not 0 <= length <= LONGEST_ANSWER or head[:1] not in (OK, ERROR):
            raise EOFError
        return head[:1], self._read(length, deadline)

    def _read(self, count, deadline):
        found = b""
        while len(found) < count:
            left = deadline - time.monotonic()
            if left <= 0.0 or not select.select([self.back], [], [], left)[0]:
                raise TimeoutError
            part = os.read(self.back, count - len(found))
            if not part:
                raise EOFError
            found += part
        return found

    def close(self):
        """Kill it and whatever it started, and remove its folder."""
        for handle in (self.to, self.back):
            with suppress(OSError):
                os.close(handle)
        with suppress(OSError):
            os.killpg(self.process.pid, 9)
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def _cache_folder(factory):
    """Folder of the kernels that a submission compiles: beside those of this user, one for each name."""
    from fowt_env.folders import cache_root

    root = cache_root()
    return (Path(tempfile.gettempdir()) if root is None else root) / "submissions" / factory.name


def _write(handle, content):
    while content:
        content = content[os.write(handle, content) :]


# ------------------------------------------------------------------------------- in the other process


def serve(incoming: int, outgoing: int) -> None:
    """Answer what comes in until the pipe is closed: the main loop of the other process."""
    controller = None
    with os.fdopen(incoming, "rb", buffering=0) as source:
        while head := source.read(LENGTH.size):
            what, content = pickle.loads(_all_of(source, LENGTH.unpack(head)[0]))
            try:
                controller, answer = _done(what, content, controller)
                kind = OK
            except BaseException as error:  # SystemExit too: the run is told why it fails
                own = error.__cause__ if isinstance(error, ControllerError) else None  # the controller's
                error = error if own is None else own
                kind, answer = ERROR, f"{type(error).__name__}: {error}".encode()[:LONGEST_ANSWER]
            _write(outgoing, kind + LENGTH.pack(len(answer)) + answer)


def _all_of(source, count):
    content = b""
    while len(content) < count:
        content += source.read(count - len(content))
    return content


def _done(what, content, controller):
    """(controller, answer) of one request."""
    if what == START:
        return _made(*content), b""
    if what == PREPARE:
        controller.prepare(content)
    elif what == RESET:
        controller.reset(content)
    else:
        return controller, COMMAND.pack(*controller.act(content))
    return controller, b""


def _made(factory, turbine, control_dt):
    """The controller that the file in the working folder makes."""
    from fowt_env.control import make

    sys.path.insert(0, os.getcwd())
    module = factory.file.removesuffix(".py")
    return make(f"{module}:{factory.attribute}", turbine, control_dt)


if __name__ == "__main__":
    serve(int(sys.argv[1]), int(sys.argv[2]))
