"""Reads the requirements of this package from its metadata, and the installed versions."""

import platform
import re
from importlib import metadata

from packaging.requirements import Requirement

from fowt_env.errors import InputError
from fowt_env.plant.compile.versions import NUMBA, Package

DISTRIBUTION = "fowt-env"


def _package(name, needed=""):
    try:
        return Package(name, metadata.version(name), needed)
    except metadata.PackageNotFoundError:
        return Package(name, None, needed)


def installed(name: str) -> bool:
    """Return whether a distribution is installed, in any version."""
    return _package(name).version is not None


def requirements() -> dict[str, list[Package]]:
    """Return {extra or "": [Package]} of the installed package, without [dev].

    Raises: InputError if the package is imported from a folder and not installed.
    """
    try:
        lines = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        raise InputError(f"{DISTRIBUTION} is not installed here: pip install -e . in its folder") from None
    packages: dict[str, list[Package]] = {}
    for requirement in map(Requirement, lines):
        extra = re.search('extra == "(.+?)"', str(requirement.marker))
        key = extra.group(1) if extra else ""
        if key != "dev" and requirement.name != DISTRIBUTION:
            packages.setdefault(key, []).append(_package(requirement.name, str(requirement.specifier)))
    return packages


def versions() -> list[Package]:
    """Return the versions of this package, Python and the required packages."""
    from fowt_env import __version__

    try:
        needed = requirements().get("", [])
        pythons = metadata.metadata(DISTRIBUTION).get("Requires-Python", "")
    except (InputError, metadata.PackageNotFoundError):
        names = ("numpy", "scipy", "numba", "llvmlite", "gymnasium", "pandas")
        needed, pythons = [_package(name) for name in names], ""
    needed = [_package("numba", NUMBA) if package.name == "numba" else package for package in needed]
    python = Package("Python", platform.python_version(), pythons)
    return [Package(DISTRIBUTION, __version__), python, *needed]


def optional_parts() -> dict[str, list[Package]]:
    """Return {extra: [Package]} of all extras, installed or not."""
    return {extra: packages for extra, packages in sorted(requirements().items()) if extra}
