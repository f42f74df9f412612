"""For commands that say by themselves that kernels are compiled, the one long wait that a user meets."""

from contextlib import contextmanager

import numba
from numba.core import event

from fowt_env.plant.compile.decorators import CACHE_FOLDER
from fowt_env.plant.compile.notice import COMPILING_MESSAGE, own, told_otherwise


class _Once(event.Listener):
    """Calls say(COMPILING_MESSAGE) when the first kernel of this project has to be compiled.

    Kernels read from disk do not count, nor do numba's own helpers, which it never stores.
    """

    def __init__(self, say):
        self.say = say

    def on_start(self, event):
        if self.say is not None and own(event):
            say, self.say = self.say, None
            say(COMPILING_MESSAGE)

    def on_end(self, event):
        """Nothing to tell."""


@contextmanager
def compilation_announced(say):
    """Within the block, the first kernel that has to be compiled makes say(text) be called, once.

    Nothing else is printed about it there, and nothing at all for None.
    """
    listener = _Once(say)
    event.register("numba:compile", listener)
    try:
        with told_otherwise():
            yield
    finally:
        event.unregister("numba:compile", listener)


def kernels_compiled():
    """True if this version's kernels are on disk already, for at least one kind of scene."""
    if numba.config.DISABLE_JIT:
        return True
    return CACHE_FOLDER is not None and any(CACHE_FOLDER.rglob("*.nbi"))
