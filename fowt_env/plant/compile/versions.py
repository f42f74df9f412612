"""Checks the version numbers of installed packages before they are imported."""

from typing import NamedTuple

from packaging.specifiers import SpecifierSet

NUMBA = ">=0.68,<0.69"  # the kernels use interfaces that may change in any minor version


class Package(NamedTuple):
    """Describes an installed or missing distribution and its required version."""

    name: str
    version: str | None  # None: not installed
    needed: str = ""  # accepted versions, as in ">=2.0,<3"; "" for any

    @property
    def fits(self) -> bool:
        """Return whether the package is installed in an accepted version."""
        return self.version is not None and SpecifierSet(self.needed).contains(self.version, prereleases=True)

    @property
    def advice(self) -> str:
        """Return the problem and the pip command that solves it, for a package that does not fit."""
        if self.version is None:
            problem = "is not installed"
        else:
            lowest = SpecifierSet(
                ",".join(str(bound) for bound in SpecifierSet(self.needed) if ">" in str(bound))
            )
            old = not lowest.contains(self.version, prereleases=True)
            problem = f"{self.version} is too {'old' if old else 'new'}"
        return f"{self.name} {problem}: pip install '{self.name}{self.needed}'"


def check_numba(version: str) -> None:
    """Raise ImportError for a version of numba that cannot compile the kernels."""
    package = Package("numba", version, NUMBA)
    if not package.fits:
        raise ImportError(f"{package.advice} (required by the kernels of fowt_env)")
