"""Defines the errors and warnings of the package; messages name the key, the value and what is allowed."""

import difflib
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any


class InputError(ValueError):
    """Reports a description, option or argument that cannot be used; raised before anything runs."""


class KeywordError(InputError, TypeError):
    """Reports a keyword that a function does not have; also a TypeError, as Python raises.

    Libraries that try keywords, as TorchRL does with `frameskip`, match the wording and omit the keyword.
    """


class ControllerInputError(InputError):
    """Reports an InputError that a controller raised in prepare(), reset() or act()."""


class SimulationStopped(RuntimeError):
    """Reports a run that cannot continue (capsize, non-finite state).

    Attributes: reason (str), time (s), frame (the rows up to the stop, or None).
    """

    def __init__(self, message: str, reason: str, time: float, frame: Any = None) -> None:
        super().__init__(message)
        self.reason = reason
        self.time = time
        self.frame = frame


class PlantWarning(UserWarning):
    """Warns of a run whose loads were less accurate than intended (see DataFrame.attrs["events"]).

    Also of implausible values in the file of a platform.
    """


def level_outside() -> int:
    """Return the stacklevel with which a warning of the caller names the first line outside this package."""
    package = __name__.partition(".")[0]
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        level, frame = level + 1, frame.f_back
    return level


_issued: set[object] = set()  # keys
_muted = ContextVar("muted", default=False)


def warn_once(key: object, text: str) -> None:
    """Issue a PlantWarning at the first line outside this package, once per key and process."""
    if key in _issued or _muted.get():
        return
    _issued.add(key)
    warnings.warn(text, PlantWarning, stacklevel=level_outside())


@contextmanager
def muted() -> Iterator[None]:
    """Return a context in which warn_once does nothing; the same warning can still be issued later."""
    token = _muted.set(True)
    try:
        yield
    finally:
        _muted.reset(token)


MOST_LISTED, NEAREST = 30, 5  # most names listed in full by a message; number listed otherwise


def unknown(kind: str, name: object, known: Iterable[object], command: str | None = None) -> InputError:
    """Return the InputError for an unknown name, with the nearest known name as a suggestion.

    For more than MOST_LISTED names the message lists the NEAREST, the total and the command that prints all.
    """
    return InputError(f"unknown {kind} {name!r}.{_nearest(name, known, command)}")


def unknown_keyword(function: str, name: str, known: Iterable[object]) -> KeywordError:
    """Return the KeywordError for a keyword that a function does not have, with the nearest known keyword."""
    return KeywordError(f"{function}() got an unexpected keyword argument {name!r}.{_nearest(name, known)}")


def nearest(name: object, known: Iterable[object], most: int, cutoff: float = 0.6) -> list[str]:
    """Return the known names most similar to a name, ignoring case, the nearest first.

    Names that begin with it, if it has three or more letters, come before, the shortest first: for a name
    that is cut short difflib prefers another short one.
    """
    lowered, typed = {str(k).lower(): str(k) for k in known}, str(name).lower()
    begun = sorted((k for k in lowered if len(typed) > 2 and k.startswith(typed)), key=len)
    alike = difflib.get_close_matches(typed, lowered, n=most, cutoff=cutoff)
    return [lowered[k] for k in dict.fromkeys([*begun, *alike])][:most]


def did_you_mean(name: object, known: Iterable[object], most: int = 1) -> str:
    """Return " Did you mean 'a' or 'b'?" with the known names similar to an unknown one; "" without any."""
    near = nearest(name, known, most)
    return f" Did you mean {' or '.join(map(repr, near))}?" if near else ""


def _nearest(name: object, known: Iterable[object], command: str | None = None) -> str:
    """Return the end of a message about an unknown name: the suggestion and the known or nearest names."""
    names = sorted(str(k) for k in known)
    hint = did_you_mean(name, names)
    if len(names) <= MOST_LISTED:
        return f"{hint} Known: {', '.join(names)}"
    near = ", ".join(nearest(name, names, NEAREST, cutoff=0.0))
    all_of_them = "" if command is None else f"; all: {command}"
    return f"{hint} Nearest of {len(names)}: {near}{all_of_them}"


class ControllerError(RuntimeError):
    """Reports a controller that failed, read undeclared information or did not return finite numbers.

    Attributes: controller (its name), time (s), returned (the value that act() returned).
    """

    def __init__(self, message: str, controller: str, time: float, returned: object) -> None:
        super().__init__(message)
        self.controller = controller
        self.time = time
        self.returned = returned
