"""A controller in a separate process, which receives its readings and nothing else.

The process has a copy of the submission's folder, an empty home folder, a copy of the kernels that it
compiled beforehand, only the environment variables in KEPT, and limits of memory, files, processes and
processor time. A supervisor (supervisor.py) ends what it leaves behind. Its answers are two numbers or the
name of an exception, and are not unpickled, so that they cannot run code here. It is restarted for every run.
It is no sandbox: it can read what this user can read, and open connections, unless it is started in a
container (docs/guides/leaderboard.md).
"""

import builtins
import hashlib
import json
import os
import pickle
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from fowt_env.control import CheckedController
from fowt_env.errors import ControllerError, InputError
from fowt_env.folders import cache_root, make_private
from fowt_env.training.board import supervisor

LARGEST_FOLDER = 50e6  # bytes of a submission
COMPILED = "__pycache__"  # of its files: neither hashed nor copied
KEPT = ("PATH", "LANG", "LC_ALL", "PYTHONPATH", "NUMBA_DISABLE_JIT")
LENGTH = struct.Struct("<q")
COMMAND = struct.Struct("<dd")
OK, ERROR = b"k", b"e"
LONGEST_ANSWER = 100  # bytes
START, PREPARE, RESET, ACT = "start", "prepare", "reset", "act"
FOLDER = "{folder}"  # in `within`: the process's folder
LIMITS = {"FSIZE": 2 * 10**8, "NPROC": 256, "NOFILE": 256, "CORE": 0}  # bytes; on top of the user's; files
PATIENCE = 10.0  # s for the supervisor to end
WARM_UP = 1.0  # s of simulated time in which a submission compiles its kernels
# reported names of exceptions: a name chosen by a submission could contain a message
KNOWN_ERRORS = {name for name, kind in vars(builtins).items() if isinstance(kind, type)} | {
    "ControllerError", "InputError", "LinAlgError",
}  # fmt: skip


def files_of(folder: Path | str) -> list[Path]:
    """Return the sorted files of a submission's folder. Raises: InputError for links and large folders."""
    folder, found = Path(folder), []
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise InputError(f"submission {str(folder)!r}: {str(path)!r} is a link or no plain file")
        if path.is_file() and COMPILED not in path.relative_to(folder).parts:
            found.append(path)
    size = sum(path.stat().st_size for path in found)
    if size > LARGEST_FOLDER:
        raise InputError(
            f"submission {str(folder)!r}: {size / 1e6:.0f} MB: must be at most {LARGEST_FOLDER / 1e6:.0f} MB"
        )
    return found


def digest_of(folder: Path | str) -> str:
    """Return the SHA-256 of the names, lengths and contents of a submission's files."""
    digest = hashlib.sha256()
    for path in files_of(folder):
        content = path.read_bytes()
        name = path.relative_to(folder).as_posix().encode("utf-8", "surrogateescape")
        digest.update(b"%d %d " % (len(name), len(content)) + name + content)
    return digest.hexdigest()


def copy_files(folder: Path | str, place: Path | str) -> None:
    """Copy a submission's folder to a new folder; links stay links."""
    shutil.copytree(folder, place, symlinks=True, ignore=shutil.ignore_patterns(COMPILED))


@dataclass(frozen=True)
class ProcessLimits:
    """Limits of a controller. A call that exceeds one fails the run."""

    start: float = 120.0  # s, to import and make it; kernels may be compiled
    prepare: float = 300.0  # s
    call: float = 0.1  # s, one call of act()
    memory: float = 4e9  # bytes of address space
    processor: float = 7200.0  # s of processor time of a run


@dataclass(frozen=True)
class IsolatedFactory:
    """Makes controllers of a Python file, each in a separate process; can be sent to worker processes."""

    folder: str
    file: str
    attribute: str
    name: str
    information: tuple[str, ...]
    preview_times: tuple[float, ...]
    limits: ProcessLimits = ProcessLimits()
    digest: str = ""  # of the folder's files, checked when a run begins; "": not checked
    within: tuple[str, ...] = ()  # command that starts the process, such as a container's
    kernels: str = ""  # folder of compiled kernels, copied for each process; "": none
    keeps: bool = False  # whether `kernels` is replaced by those of the process
    log: str = ""  # file for the slowest call of each run; "": none

    @property
    def content_key(self) -> str:
        """Hash of all that affects its runs besides the sources of this package."""
        parts = (
            *(self.digest, self.file, self.attribute, self.name, self.information, self.preview_times),
            *(asdict(self.limits), self.within),
        )
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    def __call__(self, turbine: Any, control_dt: float) -> "CheckedController":
        """Return the controller for a turbine and control period (s)."""
        return CheckedController(IsolatedController(self, turbine, control_dt), self.name)


class IsolatedController:
    """The simulator's side of a controller that runs in another process, started anew by each reset().

    Raises: ControllerError if the process ends, fails, or exceeds its limits; InputError if the submission's
    files do not match its digest.
    """

    def __init__(self, factory: IsolatedFactory, turbine: Any, control_dt: float) -> None:
        self.factory, self.turbine, self.control_dt = factory, turbine, control_dt
        self.name, self.information = factory.name, factory.information
        self.preview_times = factory.preview_times
        self.slowest = 0.0  # s, of the calls of act()
        self.known: Any = None
        self.folder: Path | None = None  # of the process
        self.process: Any = None

    def prepare(self, scene: Any) -> None:
        """Store the nominal scene for the process, which starts at reset()."""
        self.known = scene

    def reset(self, measurement: Any) -> None:
        """Start a new process, and prepare and reset its controller."""
        self.close()
        factory, limits = self.factory, self.factory.limits
        supervisor.prctl(supervisor.DUMPABLE, 0)  # hide the weather in this process's memory from others
        self.folder = Path(tempfile.mkdtemp(prefix="fowt-submission-"))
        try:
            self._start(self.folder)
        except BaseException:
            self.close()
            raise
        self._ask(START, (factory.file, factory.attribute, self.turbine, self.control_dt), limits.start)
        self._ask(PREPARE, self.known, limits.prepare)
        self._ask(RESET, measurement, limits.prepare)

    def act(self, measurement: Any) -> tuple[float, float]:
        """Return (generator torque N m, blade pitch rad) from the process."""
        moment = float(measurement.time)
        answer = self._ask(ACT, measurement, self.factory.limits.call, moment)
        if len(answer) != COMMAND.size:
            self.close()
            raise self._fault("its process sent no pair of numbers", moment)
        return COMMAND.unpack(answer)

    def _start(self, folder):
        factory, work, kernels = self.factory, folder / "work", folder / "cache"
        copy_files(factory.folder, work)
        if factory.digest and digest_of(work) != factory.digest:
            raise InputError(f"submission {factory.name!r}: its files have changed since it was read")
        if factory.kernels and os.path.isdir(factory.kernels):
            shutil.copytree(factory.kernels, kernels, symlinks=True)
        kernels.mkdir(mode=0o700, exist_ok=True)
        environment = {key: os.environ[key] for key in KEPT if key in os.environ}
        environment |= {"HOME": str(folder), "TMPDIR": str(folder), "FOWT_CACHE_DIR": str(kernels)}
        environment |= {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
        limits = LIMITS | {"AS": int(factory.limits.memory), "CPU": int(factory.limits.processor)}
        within = [part.replace(FOLDER, str(folder)) for part in factory.within]
        watched = [str(os.getpid()), str(folder), json.dumps(limits), *within]
        self.process = subprocess.Popen(
            [sys.executable, "-I", "-S", supervisor.__file__, *watched, sys.executable, "-m", __name__],
            bufsize=0,
            cwd=work,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.set_blocking(self.process.stdin.fileno(), False)

    def _ask(self, what, content, limit, moment=0.0):
        """Return the answer of the process, as bytes. Raises: ControllerError, once the process is ended."""
        content, began = pickle.dumps((what, content)), time.perf_counter()
        try:
            kind, answer = self._exchange(LENGTH.pack(len(content)) + content, time.monotonic() + limit)
        except TimeoutError:
            why = f"{what}() took longer than {limit:g} s"
        except (OSError, EOFError):
            why = f"its process ended in {what}()"
        else:
            name = answer.decode("ascii", "replace")
            why = f"{what}() raised {name if name in KNOWN_ERRORS else 'an exception of its own'}"
            why = None if kind == OK else why
        if what == ACT:
            self.slowest = max(self.slowest, time.perf_counter() - began)
        if why is None:
            return answer
        self.close()
        raise self._fault(why, moment)

    def _exchange(self, content, deadline):
        """Return (OK or ERROR, answer) to a request. Raises: TimeoutError, OSError, EOFError."""
        to, back = self.process.stdin.fileno(), self.process.stdout.fileno()

        def wait(*handles):
            left = deadline - time.monotonic()
            if left <= 0.0 or not any(select.select(*handles, [], left)):
                raise TimeoutError

        def read(count):
            found = b""
            while len(found) < count:
                wait([back], [])
                part = os.read(back, count - len(found))
                if not part:
                    raise EOFError
                found += part
            return found

        content = memoryview(content)
        while content:
            wait([], [to])
            with suppress(BlockingIOError):
                content = content[os.write(to, content) :]
        kind, (length,) = read(1), LENGTH.unpack(read(LENGTH.size))
        if not 0 <= length <= LONGEST_ANSWER or kind not in (OK, ERROR):
            raise EOFError
        return kind, read(length)

    def _fault(self, why, moment):
        return ControllerError(f"controller {self.name!r}: {why}", self.name, moment, None)

    def close(self) -> None:
        """End the process and its children, if there are any, keep its kernels, and log its slowest call."""
        process, folder, factory = self.process, self.folder, self.factory
        self.process = self.folder = None
        if process is not None:
            with suppress(OSError):
                process.stdin.close()
            process.stdout.close()
            process.terminate()
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if factory.keeps:
                shutil.rmtree(factory.kernels, ignore_errors=True)
                with suppress(OSError):
                    shutil.move(folder / "cache", factory.kernels)
            if factory.log and self.slowest:
                with open(factory.log, "a", encoding="utf-8") as file:
                    file.write(f"{self.name},{factory.content_key},{self.slowest:.6f}\n")
            self.slowest = 0.0
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)

    def __del__(self) -> None:
        with suppress(Exception):
            self.close()


def warmed_up(factory: IsolatedFactory, scenes: Any, key: str) -> IsolatedFactory:
    """Return the factory with kernels that it compiled in short runs of scenes without weather.

    Runs of the board begin with copies of these, so that they cannot exchange data.
    scenes: called for the scenes if needed; key: identifies these scenes and the plant.
    """
    root = cache_root()
    if root is None:
        return factory
    name = hashlib.sha256(f"{factory.content_key}/{key}".encode()).hexdigest()[:24]
    place = root / "submissions" / name
    if not place.is_dir():
        import fowt_env

        make_private(place.parent)
        # renamed once it is complete, so that an interrupted one is repeated
        unfinished = Path(tempfile.mkdtemp(prefix=f"{name}-", dir=place.parent))
        limits = replace(factory.limits, call=factory.limits.start)  # the first act() compiles too
        compiling = replace(factory, kernels=str(unfinished), keeps=True, log="", limits=limits)
        try:
            for scene in scenes():
                with suppress(ControllerError, InputError):  # its judged runs will fail with the reason
                    fowt_env.simulate(scene, compiling, duration=WARM_UP)
            unfinished.rename(place)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    return replace(factory, kernels=str(place))


def serve() -> None:
    """Answer requests from standard input until it is closed: the main loop of the other process.

    Standard input and output are redirected to the null device, since a controller may print.
    """
    incoming, outgoing, nothing = os.dup(0), os.dup(1), os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    os.dup2(nothing, 1)
    controller = None
    with os.fdopen(incoming, "rb") as source:
        while head := source.read(LENGTH.size):
            what, content = pickle.loads(source.read(*LENGTH.unpack(head)))
            try:
                controller, answer = _done(what, content, controller)
                kind = OK
            except BaseException as error:  # including SystemExit: the run fails with its name
                own = error.__cause__ if isinstance(error, ControllerError) else None  # the controller's
                kind, answer = ERROR, type(error if own is None else own).__name__.encode()[:LONGEST_ANSWER]
            content = kind + LENGTH.pack(len(answer)) + answer
            while content:
                content = content[os.write(outgoing, content) :]


def _done(what, content, controller):
    """Return (controller, answer) of one request."""
    if what == START:
        from fowt_env.control import make

        file, attribute, turbine, control_dt = content
        sys.path.insert(0, os.getcwd())
        return make(f"{file.removesuffix('.py')}:{attribute}", turbine, control_dt), b""
    if what == ACT:
        return controller, COMMAND.pack(*controller.act(content))
    getattr(controller, what)(content)  # prepare or reset
    return controller, b""


if __name__ == "__main__":
    serve()
