"""Which versions of other packages will do: by their numbers alone, before anything of theirs is used."""

from typing import NamedTuple

from packaging.specifiers import SpecifierSet

NUMBA = ">=0.68,<0.69"  # with which the kernels compile: it is used beyond what it promises to keep


class Package(NamedTuple):
    """An installed or missing distribution."""

    name: str
    version: str | None  # None: not installed
    needed: str = ""  # which versions will do, as in ">=2.0,<3"; "" for any

    @property
    def fits(self) -> bool:
        """Return whether it is installed, in a version that will do."""
        return self.version is not None and SpecifierSet(self.needed).contains(self.version, prereleases=True)

    @property
    def advice(self) -> str:
        """Return what is wrong with it and what to do, for one that does not fit."""
        if self.version is None:
            found = "is not installed"
        else:
            lowest = SpecifierSet(
                ",".join(str(bound) for bound in SpecifierSet(self.needed) if ">" in str(bound))
            )
            old = not lowest.contains(self.version, prereleases=True)
            found = f"{self.version} is too {'old' if old else 'new'}"
        return f"{self.name} {found}: pip install '{self.name}{self.needed}'"


def check_numba(version: str) -> None:
    """Raise ImportError, in one line, for a numba that cannot compile the kernels."""
    package = Package("numba", version, NUMBA)
    if not package.fits:
        raise ImportError(f"{package.advice} (fowt_env's kernels compile with no other)")
