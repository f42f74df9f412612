"""Telling that kernels are being compiled: the one long wait that a user meets, and only once."""

from contextlib import contextmanager

import numba
from numba.core import event

from fowt_env.plant.compile.decorators import CACHE_FOLDER

COMPILING_MESSAGE = "compiling kernels (first run of this kind of scene only, 5 s to 1 min) ..."


class _Once(event.Listener):
    """Calls say(COMPILING_MESSAGE) when the first kernel of this project has to be compiled.

    Kernels read from disk do not count, nor do numba's own helpers, which it never stores.
    """

    def __init__(self, say):
        self.say = say

    def on_start(self, event):
        module = event.data["dispatcher"].py_func.__module__ or ""
        if self.say is not None and module.startswith("fowt_env."):
            say, self.say = self.say, None
            say(COMPILING_MESSAGE)

    def on_end(self, event):
        """Nothing to tell."""


@contextmanager
def compilation_announced(say):
    """Within the block, the first kernel that has to be compiled makes say(text) be called, once."""
    listener = _Once(say)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)


def kernels_compiled():
    """True if this version's kernels are on disk already, for at least one kind of scene."""
    if numba.config.DISABLE_JIT:
        return True
    return CACHE_FOLDER is not None and any(CACHE_FOLDER.rglob("*.nbi"))
