"""Loads a library with the Bladed interface and calls it, in this process or as a program of its own.

As a program, which bladed/process.py starts, it answers calls until it is told to end: a crash or an endless
loop of the library ends this process alone. It imports the standard library alone, to start quickly.

    python library.py COPY ORIGINAL SYMBOL MEMORY REQUESTS ANSWERS

The last three are file descriptors: the memory shared with the other process, and a pipe in each direction.
"""

import ctypes
import mmap
import os
import select
import sys
import threading

RECORDS = 4096  # float32 entries: more than OpenFAST's 3300, as libraries may write beyond the last record
MESSAGE_SIZE = 8197  # bytes of MESSAGE and of OUTNAME, with the final zero, as in OpenFAST v5
OUTPUT_NAME_SIZE = 300 * 2 * 21 + 1
INPUT_FILE_SIZE = 4097
FAILURE_AT = 4 * RECORDS  # offsets into the memory: avrSWAP, aviFAIL, MESSAGE, OUTNAME, INFILE
MESSAGE_AT = FAILURE_AT + 8
OUTPUT_NAME_AT = MESSAGE_AT + MESSAGE_SIZE
INPUT_FILE_AT = OUTPUT_NAME_AT + OUTPUT_NAME_SIZE
MEMORY_SIZE = INPUT_FILE_AT + INPUT_FILE_SIZE
CALL, QUIT = b"c", b"q"  # requests
DONE, FAILED = b"d", b"f"  # answers; FAILED: the library cannot be loaded, with the reason in MESSAGE
LINE_BUFFERED = 1  # _IOLBF of setvbuf, Linux


class Library:
    """Holds a loaded library and the memory of its five arguments.

    memory: writable buffer of MEMORY_SIZE bytes. Raises: OSError if the file cannot be loaded, AttributeError
    if it lacks the symbol.
    """

    def __init__(self, path, symbol, memory):
        library = ctypes.CDLL(path)
        self.handle = library._handle
        self._function = getattr(library, symbol)
        self._function.argtypes = [ctypes.c_void_p] * 5
        self._function.restype = None
        self._memory = ctypes.c_char.from_buffer(memory)  # keeps the buffer where it is
        start = ctypes.addressof(self._memory)
        offsets = (0, FAILURE_AT, INPUT_FILE_AT, OUTPUT_NAME_AT, MESSAGE_AT)  # in the order of the arguments
        self._arguments = tuple(start + offset for offset in offsets)

    def call(self):
        """Call the library on its memory."""
        self._function(*self._arguments)


def text_at(memory, start, size):
    """Return the text that ends with a zero byte in `size` bytes of memory, one line."""
    content = bytes(memory[start : start + size]).partition(b"\0")[0]
    return " ".join(content.decode("utf-8", "replace").split())


def put_text(memory, start, size, content):
    """Write bytes and zeros into `size` bytes of memory. Raises: ValueError if they do not fit."""
    if len(content) >= size:
        raise ValueError(f"{len(content)} bytes: must be fewer than {size}")
    memory[start : start + size] = content.ljust(size, b"\0")


def serve(copy, original, symbol, memory, requests, answers):
    """Answer calls until QUIT; end at once if the other process ends."""
    shared = mmap.mmap(int(memory), MEMORY_SIZE)
    requests, answers = int(requests), int(answers)
    ending = threading.Event()
    threading.Thread(target=_watch, args=(requests, ending), daemon=True).start()
    c = ctypes.CDLL(None)
    c.setvbuf(ctypes.c_void_p.in_dll(c, "stdout"), None, LINE_BUFFERED, 0)  # so that a crash loses no line
    try:
        try:
            library = Library(copy, symbol, shared)
        except OSError:  # it may need libraries beside the original
            library = Library(original, symbol, shared)
    except (OSError, AttributeError) as error:
        put_text(shared, MESSAGE_AT, MESSAGE_SIZE, str(error).encode()[: MESSAGE_SIZE - 1])
        os.write(answers, FAILED)
        return
    os.write(answers, DONE)
    while os.read(requests, 1) == CALL:
        library.call()
        os.write(answers, DONE)
    ending.set()


def _watch(requests, ending):
    """End this process, even inside the library, once the other end of the pipe is closed."""
    poll = select.poll()
    poll.register(requests, 0)  # reports the closing alone
    poll.poll()
    if not ending.is_set():
        os._exit(1)


if __name__ == "__main__":
    serve(*sys.argv[1:])
