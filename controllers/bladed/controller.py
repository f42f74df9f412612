"""Runs any library with the Bladed interface as a controller: dll:PATH[,INPUT_FILE][,KEY=VALUE...].

The library is loaded in a process of its own for every run (bladed/process.py), so that instances share no
state, and a crash or an endless loop fails the run. Its working folder is that of INPUT_FILE, or the current
folder. As in OpenFAST the first call has status 0, the others 1 and the last -1; a command takes effect from
the time of its call on.
"""

from dataclasses import dataclass
from pathlib import Path

from fowt_env.control import check_control_dt
from fowt_env.controllers.bladed.elf import check_library
from fowt_env.controllers.bladed.process import LibraryFailure, LibraryProcess
from fowt_env.controllers.bladed.records import END, START, STEP
from fowt_env.controllers.bladed.swap import INFORMATION, Swap
from fowt_env.descriptions.checks import check_number, check_one_of, parse_names, parse_number
from fowt_env.errors import ControllerError, InputError, unknown

DLL_PREFIX = "dll:"
SYMBOL = "DISCON"  # name of the function, as DLL_ProcName of OpenFAST
PITCH = ("collective", "individual")
# root name of the library's outputs in the folder of the run; ROSCO cuts the extension that OpenFAST gives it
ROOT = "fowt.SrvD"
TIME_LIMIT = 5.0  # s of one call
START_LIMIT = 60.0  # s of loading and of the first call, which may read files
MOST_MESSAGES = 100  # different messages of a run that are kept
LONGEST_SHOWN = 1000  # characters of a library's output in an error, the last ones
KEYS = ("symbol", "pitch", "limit")


@dataclass(frozen=True)
class BladedLibrary:
    """Names a library with the Bladed interface; called with (turbine, control_dt), returns its controller.

    path        shared library (.so), 64-bit
    input_file  INFILE of its calls, usually a DISCON.IN; "": none
    symbol      name of its function
    pitch       "collective", or "individual" for a command to each blade (scenes with pitch="individual")
    limit       time limit of a call, s; the first call may take a minute, or the limit if longer
    Raises: InputError for values out of range, missing files, and files that cannot be such a library.
    """

    path: str
    input_file: str = ""
    symbol: str = SYMBOL
    pitch: str = PITCH[0]
    limit: float = TIME_LIMIT

    def __post_init__(self):
        check_one_of("pitch", self.pitch, PITCH)
        check_number("limit", self.limit, 0.0, low_open=True, allowed="a positive number of seconds")
        check_library(Path(self.path), self.symbol)
        if self.input_file and not Path(self.input_file).is_file():
            raise InputError(f"input file {self.input_file!r} of {self.path!r}: there is no such file")

    @property
    def files(self) -> list[Path]:
        """Return the files that define the controller: the library and its input file."""
        return [Path(name).absolute() for name in (self.path, self.input_file) if name]

    def start(self, turbine, control_dt):
        """Return (LibraryProcess, Swap) of a new run, before the first call. Raises: LibraryFailure."""
        path, *files = self.files
        process = LibraryProcess(path, self.symbol, files[0].parent if files else Path.cwd(), START_LIMIT)
        names = (str(files[0]) if files else "", str(process.folder / ROOT))
        return process, Swap(process.memory, turbine, control_dt, *names, self.pitch == PITCH[1])

    def __call__(self, turbine, control_dt):
        """Return the controller for a turbine and a control period (s)."""
        return BladedController(self, turbine, control_dt)


def named_library(name: str) -> BladedLibrary:
    """Return the BladedLibrary of a name "dll:PATH[,INPUT_FILE][,KEY=VALUE...]", KEY: symbol, pitch, limit.

    Raises: InputError for an unusable name.
    """
    path, *rest = parse_names(name.removeprefix(DLL_PREFIX)) or [""]
    files, settings = [], {}
    for part in rest:
        key, sign, value = part.partition("=")
        if not sign:
            files.append(part)
        elif key not in KEYS:
            raise unknown(f"key of {name!r}:", key, KEYS)
        else:
            number = parse_number(value) if key == "limit" else None
            settings[key] = value if number is None else number
    if len(files) > 1 or not path:
        raise InputError(f"controller {name!r}: must be {DLL_PREFIX}PATH[,INPUT_FILE][,KEY=VALUE...]")
    return BladedLibrary(path, *files, **settings)


def call_error(name, why, time):
    """Return the ControllerError of a failed call of a controller called name at a time, s."""
    return ControllerError(
        f"controller {name!r} failed at t = {time:.3f} s: {why}", controller=name, time=time, returned=None
    )


class BladedController:
    """Runs a BladedLibrary in a process of its own; each reset() starts a new process."""

    information, declared = INFORMATION, False  # a reading that there is not in a run is a record of 0

    def __init__(self, library, turbine, control_dt):
        self.library, self.turbine, self.control_dt = library, turbine, check_control_dt(control_dt)
        self.name = f"{DLL_PREFIX}{library.path}"
        self.individual = library.pitch == PITCH[1]
        self._process = self._swap = None
        self._first = None  # (time, command) of the call in reset()
        self._messages, self._printed = {}, ""

    def __reduce__(self):
        return type(self), (self.library, self.turbine, self.control_dt)  # without the running library

    @property
    def console_output(self) -> str:
        """Return the messages of the library in this run, and after the run what it printed."""
        lines = [f"t = {time:.3f} s: {message}" for message, time in self._messages.items()]
        return "\n".join([*lines, *filter(None, [self._printed.strip()])])

    def reset(self, measurement):
        """Start the library in a new process and make the first call. Raises: ControllerError."""
        self.finish()
        self._messages, self._printed = {}, ""
        try:
            self._process, self._swap = self.library.start(self.turbine, self.control_dt)
        except LibraryFailure as error:
            raise call_error(self.name, str(error), float(measurement.time)) from error
        self._first = (measurement.time, self._call(START, measurement))

    def act(self, measurement):
        """Return (generator torque, blade pitch) or, with individual pitch, (torque, pitch of each blade).

        At the time of reset() this is the command of the first call. Raises: ControllerError with the
        library's message if the call fails.
        """
        first, self._first = self._first, None
        if first is not None and first[0] == measurement.time:
            return first[1]
        return self._call(STEP, measurement)

    def _call(self, status, measurement):
        swap, time, limit = self._swap, float(measurement.time), self.library.limit
        swap.fill(status, measurement)
        try:
            self._process.call(max(START_LIMIT, limit) if status == START else limit)
        except LibraryFailure as error:
            raise self._stopped(str(error), time) from error
        if swap.failure:
            if swap.failure < 0:
                raise self._stopped(f"its code is {swap.failure}: {swap.message or 'no message'}", time)
            self._keep(swap.message, time)
        if refusal := swap.refusal():
            raise self._stopped(refusal, time)
        return swap.demands()

    def _keep(self, message, time):
        if len(self._messages) < MOST_MESSAGES:
            self._messages.setdefault(message, time)

    def _stopped(self, why, time):
        """Return the ControllerError of a failed call with the library's output, after ending its process."""
        process, self._process = self._process, None
        self._printed = process.end()
        shown = " ".join(self.console_output.split())[-LONGEST_SHOWN:]
        return call_error(self.name, f"{why}; its output: {shown}" if shown else why, time)

    def finish(self) -> None:
        """Make the last call, with status -1, and end the process; a failure becomes a part of the output."""
        process, self._process = self._process, None
        if process is None:
            return
        swap = self._swap
        if process.waits:  # not after an interrupted call
            time = float(swap.records[1])
            swap.records[0] = END
            swap.clear()
            try:
                process.call(self.library.limit)
            except LibraryFailure as error:
                self._keep(f"last call: {error}", time)
            else:
                if swap.failure:
                    self._keep(f"last call: code {swap.failure}: {swap.message}", time)
        self._printed = process.end()
