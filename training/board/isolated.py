"""Runs a controller in a separate process, which receives only the controller's readings.

The process has a copy of the submission's folder, an empty home folder, a copy of its precompiled kernels,
only the environment variables in KEPT, and limits of memory, files, processes and processor time. A
supervisor (supervisor.py) ends remaining child processes. Answers are two numbers or the name of an
exception and are not unpickled, so that they cannot execute code here. Every run starts a new process.
The process is not a sandbox: unless started in a container (docs/guides/leaderboard.md), it has this user's
access to files and network.
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
from fowt_env.controllers.bladed.controller import DLL_PREFIX
from fowt_env.errors import ControllerError, InputError
from fowt_env.folders import cache_root, make_private
from fowt_env.training.board import supervisor

LARGEST_FOLDER = 50e6  # bytes of a submission
COMPILED = "__pycache__"  # folder name: neither hashed nor copied
KEPT = ("PATH", "LANG", "LC_ALL", "PYTHONPATH", "NUMBA_DISABLE_JIT")
LENGTH = struct.Struct("<q")
COMMAND = struct.Struct("<dd")
OK, ERROR = b"k", b"e"
LONGEST_ANSWER = 100  # bytes
START, PREPARE, RESET, ACT = "start", "prepare", "reset", "act"
FOLDER = "{folder}"  # in `within`: replaced by the process's folder
LIMITS = {"FSIZE": 2 * 10**8, "NPROC": 256, "NOFILE": 256, "CORE": 0}  # bytes; added to the user's; files
PATIENCE = 10.0  # s allowed for the supervisor to end
WARM_UP = 1.0  # s of simulated time, in which a submission compiles its kernels
# names of exceptions that are reported: names defined by a submission could carry data
KNOWN_ERRORS = {name for name, kind in vars(builtins).items() if isinstance(kind, type)} | {
    "ControllerError", "InputError", "LibraryFailure", "LinAlgError",
}  # fmt: skip


def files_of(folder: Path | str) -> list[Path]:
    """Return the sorted files of a submission's folder. Raises: InputError for links and large folders."""
    folder, files = Path(folder), []
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise InputError(f"submission {str(folder)!r}: {str(path)!r} is a link or a special file")
        if path.is_file() and COMPILED not in path.relative_to(folder).parts:
            files.append(path)
    size = sum(path.stat().st_size for path in files)
    if size > LARGEST_FOLDER:
        raise InputError(
            f"submission {str(folder)!r}: {size / 1e6:.0f} MB: must be at most {LARGEST_FOLDER / 1e6:.0f} MB"
        )
    return files


def digest_of(folder: Path | str) -> str:
    """Return the SHA-256 of the names, lengths and contents of a submission's files."""
    digest = hashlib.sha256()
    for path in files_of(folder):
        content = path.read_bytes()
        name = path.relative_to(folder).as_posix().encode("utf-8", "surrogateescape")
        digest.update(b"%d %d " % (len(name), len(content)) + name + content)
    return digest.hexdigest()


def copy_files(folder: Path | str, place: Path | str) -> None:
    """Copy a submission's folder to a new folder, with links as links."""
    shutil.copytree(folder, place, symlinks=True, ignore=shutil.ignore_patterns(COMPILED))


@dataclass(frozen=True)
class ProcessLimits:
    """Defines limits of a controller; the run fails if a call exceeds a limit."""

    start: float = 120.0  # s, to import and create the controller; kernels may be compiled
    prepare: float = 300.0  # s
    call: float = 0.1  # s, one call of act()
    memory: float = 4e9  # bytes of address space
    processor: float = 7200.0  # s of processor time of a run


@dataclass(frozen=True)
class IsolatedFactory:
    """Creates controllers from files of a folder, each in a separate process; can be pickled."""

    folder: str
    controller: str  # "module:Name" or "dll:FILE.so" in the folder, for fowt_env.control.make
    name: str
    information: tuple[str, ...]
    preview_times: tuple[float, ...]
    limits: ProcessLimits = ProcessLimits()
    digest: str = ""  # of the folder's files, checked at the start of a run; "": not checked
    within: tuple[str, ...] = ()  # command that starts the process, e.g. in a container
    kernels: str = ""  # folder of compiled kernels, copied for each process; "": no copy
    keeps: bool = False  # whether to replace `kernels` by the kernels of the process
    log: str = ""  # file for the slowest call of each run; "": no log

    @property
    def content_key(self) -> str:
        """Return the hash of all that affects its runs except the sources of this package."""
        parts = (
            *(self.digest, self.controller, self.name, self.information, self.preview_times),
            *(asdict(self.limits), self.within),
        )
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    def __call__(self, turbine: Any, control_dt: float) -> "CheckedController":
        """Return the controller for a turbine and control period (s)."""
        return CheckedController(IsolatedController(self, turbine, control_dt), self.name)


class IsolatedController:
    """Represents, in the simulator, a controller in another process; each reset() starts a new process.

    Raises: ControllerError if the process ends, fails, or exceeds its limits; InputError if the submission's
    files do not match the digest.
    """

    def __init__(self, factory: IsolatedFactory, turbine: Any, control_dt: float) -> None:
        self.factory, self.turbine, self.control_dt = factory, turbine, control_dt
        self.name, self.information = factory.name, factory.information
        self.preview_times = factory.preview_times
        self.declared = not factory.controller.startswith(DLL_PREFIX)
        self.slowest = 0.0  # s, slowest call of act()
        self.known: Any = None
        self.folder: Path | None = None  # of the process
        self.process: Any = None

    def prepare(self, scene: Any) -> None:
        """Store the nominal scene for the process, which starts at reset()."""
        self.known = scene

    def reset(self, measurement: Any) -> None:
        """Start a new process; prepare and reset its controller."""
        self.close()
        factory, limits = self.factory, self.factory.limits
        supervisor.prctl(supervisor.DUMPABLE, 0)  # other processes cannot read the weather in memory
        self.folder = Path(tempfile.mkdtemp(prefix="fowt-submission-"))
        try:
            self._start(self.folder)
        except BaseException:
            self.close()
            raise
        self._ask(START, (factory.controller, self.turbine, self.control_dt), limits.start)
        self._ask(PREPARE, self.known, limits.prepare)
        self._ask(RESET, measurement, limits.prepare)

    def act(self, measurement: Any) -> tuple[float, float]:
        """Return (generator torque N m, blade pitch rad) from the process."""
        moment = float(measurement.time)
        answer = self._ask(ACT, measurement, self.factory.limits.call, moment)
        if len(answer) != COMMAND.size:
            self.close()
            raise self._fault("its process did not return two numbers", moment)
        return COMMAND.unpack(answer)

    def _start(self, folder):
        factory, work, kernels = self.factory, folder / "work", folder / "cache"
        copy_files(factory.folder, work)
        if factory.digest and digest_of(work) != factory.digest:
            raise InputError(f"submission {factory.name!r}: its files have changed since they were read")
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
        """Return the answer of the process, as bytes. Raises: ControllerError, after ending the process."""
        content, began, why = pickle.dumps((what, content)), time.perf_counter(), None
        try:
            kind, answer = self._exchange(LENGTH.pack(len(content)) + content, time.monotonic() + limit)
        except TimeoutError:
            why = f"{what}() took longer than {limit:g} s"
        except (OSError, EOFError):
            why = f"its process ended in {what}()"
        else:
            if kind == ERROR:
                name = answer.decode("ascii", "replace")
                why = f"{what}() raised {name if name in KNOWN_ERRORS else 'a custom exception'}"
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
            received = b""
            while len(received) < count:
                wait([back], [])
                part = os.read(back, count - len(received))
                if not part:
                    raise EOFError
                received += part
            return received

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
        """End the process (if any) with its children, keep its kernels, and log its slowest call."""
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
    """Return the factory with kernels compiled in short runs of scenes without weather.

    Every run of the board starts with a copy of these kernels, so that runs cannot exchange data.
    scenes: function that returns the scenes, called if needed; key: identifies the scenes and the plant.
    """
    root = cache_root()
    if root is None:
        return factory
    name = hashlib.sha256(f"{factory.content_key}/{key}".encode()).hexdigest()[:24]
    target = root / "submissions" / name
    if not target.is_dir():
        import fowt_env

        make_private(target.parent)
        # renamed when complete, so that an interrupted compilation is repeated
        unfinished = Path(tempfile.mkdtemp(prefix=f"{name}-", dir=target.parent))
        limits = replace(factory.limits, call=factory.limits.start)  # the first act() also compiles
        compiling = replace(factory, kernels=str(unfinished), keeps=True, log="", limits=limits)
        try:
            for scene in scenes():
                with suppress(ControllerError, InputError):  # its runs on the board will fail with the reason
                    fowt_env.simulate(scene, compiling, duration=WARM_UP)
            unfinished.rename(target)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    return replace(factory, kernels=str(target))


def serve() -> None:
    """Answer requests from standard input until its end: the main loop of the other process.

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
    """Execute a request and return (controller, answer)."""
    if what == START:
        from fowt_env.control import make

        sys.path.insert(0, os.getcwd())
        return make(*content), b""
    if what == ACT:
        return controller, COMMAND.pack(*controller.act(content))
    getattr(controller, what)(content)  # prepare or reset
    return controller, b""


if __name__ == "__main__":
    serve()
