"""Runs a command under limits and ends all processes that it leaves behind.

    python supervisor.py PARENT FOLDER LIMITS COMMAND...

It uses the standard library only, so that it starts in some 20 ms and has no secrets in memory. Processes
whose parent has ended become its children, so that none escapes by leaving its session. If PARENT, a process
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

PDEATHSIG, DUMPABLE, SUBREAPER = 1, 4, 36  # of prctl, which only Linux has
# a separate signal: a parent with threads keeps its process id until the last of them has ended
PARENT_ENDED = signal.SIGHUP


def prctl(option: int, value: int) -> None:
    """Set an attribute of this process if the system supports it."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def children() -> list[int]:
    """Return the process ids of the children of this process; [] without /proc."""
    found, me = [], os.getpid()
    with suppress(OSError):
        for name in filter(str.isdigit, os.listdir("/proc")):
            with suppress(OSError, ValueError), open(f"/proc/{name}/stat", "rb") as file:
                if int(file.read().rpartition(b")")[2].split()[1]) == me:
                    found.append(int(name))
    return found


def tasks() -> int:
    """Return the number of this user's threads."""
    count = 0
    with suppress(OSError):
        for name in filter(str.isdigit, os.listdir("/proc")):
            with suppress(OSError):
                if os.stat(f"/proc/{name}").st_uid == os.getuid():
                    count += len(os.listdir(f"/proc/{name}/task"))
    return count


def limit(limits: dict[str, int]) -> None:
    """Set {name of resource: value}; NPROC, which counts all threads of the user, on top of those running."""
    for name, value in limits.items():
        number = getattr(resource, f"RLIMIT_{name}", None)
        if number is not None:
            value += tasks() if name == "NPROC" else 0
            most = resource.getrlimit(number)[1]
            value = value if most == resource.RLIM_INFINITY else min(value, most)
            with suppress(ValueError, OSError):
                resource.setrlimit(number, (value, value))


def supervise(parent: int, folder: str, limits: dict[str, int], command: list[str]) -> None:
    """Run the command until it or the parent ends, or this process is terminated; then end what is left."""
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
                os.wait()  # grandchildren become children of this process, and are ended in the next round
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
    os.dup2(nothing, 0)  # so that the other end notices when the command closes its pipes
    os.dup2(nothing, 1)
    if os.getppid() != parent:
        end()
    while os.wait()[0] != first:
        pass
    end()


if __name__ == "__main__":
    supervise(int(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3]), sys.argv[4:])
