"""Requirements of this package, from its metadata, and the installed versions."""

import platform
import re
from importlib import metadata

from packaging.requirements import Requirement

from fowt_env.errors import InputError
from fowt_env.plant.compile.versions import NUMBA, Package

DISTRIBUTION = "fowt-env"


def _found(name, needed=""):
    try:
        return Package(name, metadata.version(name), needed)
    except metadata.PackageNotFoundError:
        return Package(name, None, needed)


def installed(name: str) -> bool:
    """Return whether a distribution is installed, in any version."""
    return _found(name).version is not None


def requirements() -> dict[str, list[Package]]:
    """Return {extra or "": [Package]} of the installed package, without [dev].

    Raises: InputError if the package runs from a folder and was never installed.
    """
    try:
        lines = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        raise InputError(f"{DISTRIBUTION} is not installed here: pip install -e . in its folder") from None
    found: dict[str, list[Package]] = {}
    for wanted in map(Requirement, lines):
        extra = re.search('extra == "(.+?)"', str(wanted.marker))
        key = extra.group(1) if extra else ""
        if key != "dev" and wanted.name != DISTRIBUTION:
            found.setdefault(key, []).append(_found(wanted.name, str(wanted.specifier)))
    return found


def versions() -> list[Package]:
    """Return Python, this package and its required packages."""
    from fowt_env import __version__

    try:
        needed = requirements().get("", [])
        pythons = metadata.metadata(DISTRIBUTION).get("Requires-Python", "")
    except (InputError, metadata.PackageNotFoundError):
        needed, pythons = [_found(name) for name in ("numpy", "scipy", "numba", "gymnasium", "pandas")], ""
    needed = [_found("numba", NUMBA) if package.name == "numba" else package for package in needed]
    python = Package("Python", platform.python_version(), pythons)
    return [Package(DISTRIBUTION, __version__), python, *needed, _found("llvmlite")]


def optional_parts() -> dict[str, list[Package]]:
    """Return {extra: [Package]}: the packages of each extra, installed or not."""
    return {extra: packages for extra, packages in sorted(requirements().items()) if extra}
