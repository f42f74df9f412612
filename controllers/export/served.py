"""Runs a controller for a library that was built by library.py, until the library closes the connection.

Started by the library as `python -m fowt_env.controllers.export.served SETTINGS` with a socket as standard
input; SETTINGS is JSON with controller, platform, control_dt and the folder of the export, in which the
controller runs. A request is the number of records (int32) and the records (float32); an answer a code
(int32, 0 or -1), four numbers (float64: torque, pitch of each blade) and a message.
"""

import json
import os
import select
import signal
import socket
import struct
import sys
import threading
import time

import numpy as np

MESSAGE = 1000  # bytes
GRACE = 2.0  # s, after the last call or the end of the host
ANSWER = struct.Struct(f"=i4d{MESSAGE}s")


def serve(connection, settings):
    """Answer the requests on a socket until it is closed."""
    hosted = error = None
    try:
        from fowt_env.controllers.export.library import hosted as prepare

        os.chdir(settings["folder"])
        hosted = prepare(settings["controller"], settings["platform"], settings["control_dt"])
    except Exception as failure:  # shown by the host, as the answer to its first request
        error = failure
    while (size := _receive(connection, 4)) is not None:
        count = struct.unpack("=i", size)[0]
        request = _receive(connection, 4 * count)
        if request is None:
            return
        command = (0.0,) * 4
        if error is None:
            try:
                command = hosted.call(np.frombuffer(request, dtype=np.float32))
            except Exception as failure:
                error = failure
        text = b"" if error is None else f"{type(error).__name__}: {error}".encode()[: MESSAGE - 1]
        connection.sendall(ANSWER.pack(-1 if text else 0, *command, text))


def _receive(connection, size):
    """Return the next bytes of a socket; None if it is closed."""
    parts = b""
    while len(parts) < size:
        part = connection.recv(size - len(parts))
        if not part:
            return None
        parts += part
    return parts


def _end_with(connection):
    """Wait until the other end of a socket is closed; end this process unless the controller soon ends it."""
    poll = select.poll()
    poll.register(connection, select.POLLRDHUP | select.POLLHUP)
    poll.poll()
    time.sleep(GRACE)
    os._exit(0)


def main():
    """Run the module as a program."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the host's terminal: the host decides
    connection = socket.socket(fileno=os.dup(0))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    threading.Thread(target=_end_with, args=(connection,), daemon=True).start()
    serve(connection, json.loads(sys.argv[1]))


if __name__ == "__main__":
    main()
