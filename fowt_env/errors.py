"""The errors that users meet. Each message names the key, the value and what is allowed."""

import difflib
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any


class InputError(ValueError):
    """A description, option or argument that cannot be used; raised before anything runs."""


class KeywordError(InputError, TypeError):
    """An InputError for a keyword that a function does not have, for which Python raises a TypeError.

    Libraries that try keywords, as TorchRL does with `frameskip`, know its wording and leave the keyword out.
    """


class ControllerInputError(InputError):
    """An InputError that a controller raised while it was prepared, reset or asked: it alone is at fault."""


class SimulationStopped(RuntimeError):
    """A run that cannot go on (capsize, non-finite state).

    Attributes: reason (str), time (s), frame (the rows up to the stop, or None).
    """

    def __init__(self, message: str, reason: str, time: float, frame: Any = None) -> None:
        super().__init__(message)
        self.reason = reason
        self.time = time
        self.frame = frame


class PlantWarning(UserWarning):
    """A run whose loads were less accurate than they are meant to be, as DataFrame.attrs["events"] counts.

    Also a platform whose file has what can hardly be meant.
    """


def level_outside() -> int:
    """Return the stacklevel by which the caller's warnings name the first line outside of this package."""
    own = __name__.partition(".")[0]
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == own:
        level, frame = level + 1, frame.f_back
    return level


_said: set[object] = set()  # keys
_muted = ContextVar("muted", default=False)


def warn_once(key: object, text: str) -> None:
    """Warn (PlantWarning), where the first line outside of this package is, once per key and process."""
    if key in _said or _muted.get():
        return
    _said.add(key)
    warnings.warn(text, PlantWarning, stacklevel=level_outside())


@contextmanager
def muted() -> Iterator[None]:
    """Return a context in which warn_once says nothing, and says it when it is asked to outside."""
    token = _muted.set(True)
    try:
        yield
    finally:
        _muted.reset(token)


MOST_LISTED, NEAREST = 30, 5  # names that are all listed; how many are where there are more


def unknown(kind: str, name: object, known: Iterable[object], command: str | None = None) -> InputError:
    """Return the InputError for a name that is not known, with the nearest known one as a suggestion.

    Of more than MOST_LISTED names it lists the NEAREST, their number, and the command that prints them all.
    """
    return InputError(f"unknown {kind} {name!r}.{_nearest(name, known, command)}")


def unknown_keyword(function: str, name: str, known: Iterable[object]) -> KeywordError:
    """Return the KeywordError for a keyword that a function does not have, with the nearest known one."""
    return KeywordError(f"{function}() got an unexpected keyword argument {name!r}.{_nearest(name, known)}")


def nearest(name: object, known: Iterable[object], most: int, cutoff: float = 0.6) -> list[str]:
    """Return the known names that are most like one, whatever their case, the nearest first."""
    lowered = {str(k).lower(): str(k) for k in known}
    return [lowered[k] for k in difflib.get_close_matches(str(name).lower(), lowered, n=most, cutoff=cutoff)]


def did_you_mean(name: object, known: Iterable[object], most: int = 1) -> str:
    """Return " Did you mean 'a' or 'b'?" with known names like an unknown one; "" where there is none."""
    near = nearest(name, known, most)
    return f" Did you mean {' or '.join(map(repr, near))}?" if near else ""


def _nearest(name: object, known: Iterable[object], command: str | None = None) -> str:
    """Return the end of a message on an unknown name: which known ones are near it."""
    names = sorted(str(k) for k in known)
    hint = did_you_mean(name, names)
    if len(names) <= MOST_LISTED:
        return f"{hint} Known: {', '.join(names)}"
    near = ", ".join(nearest(name, names, NEAREST, cutoff=0.0))
    all_of_them = "" if command is None else f"; all: {command}"
    return f"{hint} Nearest of {len(names)}: {near}{all_of_them}"


class ControllerError(RuntimeError):
    """A controller that did not return two finite numbers.

    Attributes: controller (its name), time (s), returned (what it gave back).
    """

    def __init__(self, message: str, controller: str, time: float, returned: object) -> None:
        super().__init__(message)
        self.controller = controller
        self.time = time
        self.returned = returned
