"""Runs a command under resource limits and ends all processes that the command leaves behind.

    python supervisor.py PARENT FOLDER LIMITS COMMAND...

The supervisor uses only the standard library, so that it starts in about 20 ms and has no secrets in memory.
Orphaned processes become its children, so that none escapes by starting a new session. If PARENT, a process
id, has ended too, FOLDER is removed. LIMITS: {name of resource: value} as JSON.
"""

import ctypes
import json
import os
import resource
import shutil
import signal
import sys
from contextlib import suppress

PDEATHSIG, DUMPABLE, SUBREAPER = 1, 4, 36  # options of prctl (Linux only)
# a separate signal: a parent with threads keeps its process id until the last of them has ended
PARENT_ENDED = signal.SIGHUP


def prctl(option: int, value: int) -> None:
    """Set an attribute of this process if the system supports it."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def children() -> list[int]:
    """Return the process ids of the children of this process; [] without /proc."""
    ids, me = [], os.getpid()
    with suppress(OSError):
        for name in filter(str.isdigit, os.listdir("/proc")):
            with suppress(OSError, ValueError), open(f"/proc/{name}/stat", "rb") as file:
                if int(file.read().rpartition(b")")[2].split()[1]) == me:
                    ids.append(int(name))
    return ids


def tasks() -> int:
    """Return the number of running threads of this user."""
    count = 0
    with suppress(OSError):
        for name in filter(str.isdigit, os.listdir("/proc")):
            with suppress(OSError):
                if os.stat(f"/proc/{name}").st_uid == os.getuid():
                    count += len(os.listdir(f"/proc/{name}/task"))
    return count


def limit(limits: dict[str, int]) -> None:
    """Set resource limits {name: value}; NPROC is increased by the running threads of the user."""
    for name, value in limits.items():
        number = getattr(resource, f"RLIMIT_{name}", None)
        if number is not None:
            value += tasks() if name == "NPROC" else 0
            most = resource.getrlimit(number)[1]
            value = value if most == resource.RLIM_INFINITY else min(value, most)
            with suppress(ValueError, OSError):
                resource.setrlimit(number, (value, value))


def supervise(parent: int, folder: str, limits: dict[str, int], command: list[str]) -> None:
    """Run the command until it or the parent ends, or this process is terminated; end all descendants."""
    prctl(SUBREAPER, 1)
    prctl(PDEATHSIG, PARENT_ENDED)
    first = 0

    def end(number=0, _=None):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        while True:
            with suppress(OSError):
                os.killpg(first, signal.SIGKILL)
            for child in children():
                with suppress(OSError):
                    os.kill(child, signal.SIGKILL)
            try:
                os.wait()  # grandchildren become children of this process; killed in the next iteration
            except ChildProcessError:
                break
        if number == PARENT_ENDED or os.getppid() != parent:
            shutil.rmtree(folder, ignore_errors=True)
        os._exit(0)

    first = os.fork()
    if first == 0:
        try:
            os.setsid()
            prctl(PDEATHSIG, signal.SIGKILL)
            limit(limits)
            os.execvp(command[0], command)
        finally:
            os._exit(127)
    signal.signal(signal.SIGTERM, end)
    signal.signal(PARENT_ENDED, end)
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)  # so that the parent detects when the command closes its pipes
    os.dup2(nothing, 1)
    if os.getppid() != parent:
        end()
    while os.wait()[0] != first:
        pass
    end()


if __name__ == "__main__":
    supervise(int(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3]), sys.argv[4:])
