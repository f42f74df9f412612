"""Which versions of other packages will do: by their numbers alone, before anything of theirs is used."""

import re
from typing import NamedTuple

NUMBA = ">=0.68,<0.69"  # with which the kernels compile: it is used beyond what it promises to keep


class Package(NamedTuple):
    """An installed or missing distribution."""

    name: str
    version: str | None  # None: not installed
    needed: str = ""  # which versions will do, as in ">=2.0,<3"; "" for any

    @property
    def fits(self) -> bool:
        """Whether it is installed, in a version that will do."""
        return self.version is not None and satisfies(self.version, self.needed)

    @property
    def advice(self) -> str:
        """What is wrong with it and what to do, for one that does not fit."""
        if self.version is None:
            found = "is not installed"
        else:
            found = f"{self.version} is too {'old' if _too_old(self.version, self.needed) else 'new'}"
        return f"{self.name} {found}: pip install '{self.name}{self.needed}'"


def _release(version):
    """Numbers of a version such as 2.13.0rc1+cpu: [2, 13, 0], without zeros at the end."""
    numbers = [int(part) for part in re.match(r"(?:v?\d+!)?v?([\d.]*)", version)[1].split(".") if part]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return numbers


_HOLDS = {
    ">=": lambda version, bound: version >= bound,
    "<=": lambda version, bound: version <= bound,
    ">": lambda version, bound: version > bound,
    "<": lambda version, bound: version < bound,
    "==": lambda version, bound: version == bound,
    "!=": lambda version, bound: version != bound,
}


def _failing(version, needed):
    """Signs of the bounds that a version does not keep; those of other kinds count as kept."""
    bounds = re.findall(r"(>=|<=|==|!=|>|<)\s*([\w.+!*]+)", needed)
    return [
        sign
        for sign, bound in bounds
        if "*" not in bound and not _HOLDS[sign](_release(version), _release(bound))
    ]


def satisfies(version: str, needed: str) -> bool:
    """Whether a version is within bounds such as ">=2.0,<3", by its numbers alone."""
    return not _failing(version, needed)


def _too_old(version, needed):
    """Whether a version that is out of bounds lies below them."""
    lower = re.findall(r"(?:>=|>|==)\s*([\w.+!]+)", needed)
    return any(_release(version) < _release(bound) for bound in lower)


def check_numba(version: str) -> None:
    """Raises: ImportError, in one line, for a numba that cannot compile the kernels."""
    package = Package("numba", version, NUMBA)
    if not package.fits:
        raise ImportError(f"{package.advice} (fowt_env's kernels compile with no other)")
