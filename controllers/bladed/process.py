"""Runs a library with the Bladed interface in a process of its own, with a time limit for every call."""

import mmap
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path

from fowt_env.controllers.bladed import library as program

MISSING = "cannot open shared object file"  # of the loader, for a library that another one needs
END_LIMIT = 5.0  # s in which the process must end once it is told to
LONGEST_PRINTED = 20_000  # bytes of what a library prints that are kept, the last ones
UNBUFFERED = {"GFORTRAN_UNBUFFERED_PRECONNECTED": "y"}  # so that a crash loses no line that Fortran printed


class LibraryFailure(Exception):
    """Raised if a library cannot be loaded, ends its process, or exceeds the time limit of a call."""


class LibraryProcess:
    """Holds a process that has loaded a private copy of a library, and the memory shared with it.

    folder: working folder of the process; limit: s, to load the library. The copy protects a run from a new
    version of the file; a library that needs others beside its file is loaded from its own place.
    Raises: LibraryFailure if the library cannot be loaded.
    """

    def __init__(self, path, symbol, folder, limit):
        self.folder = Path(tempfile.mkdtemp(prefix="fowt_dll_"))  # the copy, and outputs of the library
        self._printed, copy = self.folder / "printed.txt", self.folder / path.name
        memory = os.memfd_create("fowt_dll")
        requests, own_requests = os.pipe()
        own_answers, answers = os.pipe()
        shared = (memory, requests, answers)
        self._requests, self._answers = own_requests, own_answers
        self.waits = False  # whether the process waits for a request
        try:
            os.ftruncate(memory, program.MEMORY_SIZE)
            self.memory = mmap.mmap(memory, program.MEMORY_SIZE)
            shutil.copyfile(path, copy)
            words = [program.__file__, str(copy), str(path), symbol, *map(str, shared)]
            with open(self._printed, "wb") as printed:
                self._process = subprocess.Popen(
                    [sys.executable, "-I", "-S", *words],
                    stdin=subprocess.DEVNULL,
                    stdout=printed,
                    stderr=subprocess.STDOUT,
                    cwd=folder,
                    env=os.environ | UNBUFFERED,
                    pass_fds=shared,
                    start_new_session=True,  # Ctrl-C ends the run, and the run ends the library
                )
        finally:
            for descriptor in shared:
                os.close(descriptor)
        self._end = weakref.finalize(self, _end, self._process, (own_requests, own_answers), self.folder)
        self._poll = select.poll()
        self._poll.register(own_answers, select.POLLIN)
        try:
            self._wait(limit, "loading")
        except BaseException:
            self._end()
            raise

    def call(self, limit):
        """Call the library on the shared memory. Raises: LibraryFailure after `limit` seconds, or a crash."""
        with suppress(BrokenPipeError):
            os.write(self._requests, program.CALL)
        self._wait(limit, "a call")

    def _wait(self, limit, what):
        self.waits = False  # if an exception leaves it so, the process is killed
        if not self._poll.poll(1e3 * limit):
            raise LibraryFailure(f"{what} took longer than {limit:g} s")
        answer = os.read(self._answers, 1)
        if not answer:
            raise LibraryFailure(f"{what} ended its process {self._ending()}")
        if answer != program.DONE:
            reason = program.text_at(self.memory, program.MESSAGE_AT, program.MESSAGE_SIZE)
            if MISSING in reason:  # libraries of wheels have theirs in a folder beside them
                reason += ". It needs this library: name it where it was installed, not a copy of it"
            raise LibraryFailure(f"cannot be loaded: {reason}")
        self.waits = True

    def _ending(self):
        """Return how the process ended."""
        try:
            code = self._process.wait(END_LIMIT)
        except subprocess.TimeoutExpired:
            return "in part: it closed the pipe to the simulator"
        if code < 0:
            return f"by {signal.Signals(-code).name} ({signal.strsignal(-code)})"
        return f"with exit code {code} (exit, or STOP in Fortran)"

    def end(self):
        """End the process and return what it printed; later calls return ""."""
        if not self._end.alive:
            return ""
        if self.waits:  # the library may then write its files
            with suppress(BrokenPipeError):
                os.write(self._requests, program.QUIT)
                self._poll.poll(1e3 * END_LIMIT)  # until the end of the process closes the pipe
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(END_LIMIT)
        with open(self._printed, "rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - LONGEST_PRINTED))
            printed = file.read().decode(errors="replace")
        self._end()
        return printed


def _end(process, descriptors, folder):
    """Kill a process with those that it started, and remove its folder."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    for descriptor in descriptors:
        os.close(descriptor)
    shutil.rmtree(folder, ignore_errors=True)
