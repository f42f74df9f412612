"""Requirements of this package, from its metadata, and the installed versions."""

import platform
import re

from packaging.requirements import Requirement

from fowt_env.errors import InputError
from fowt_env.plant.compile.versions import NUMBA, Package

DISTRIBUTION = "fowt-env"


def _found(name, needed=""):
    from importlib import metadata

    try:
        return Package(name, metadata.version(name), needed)
    except metadata.PackageNotFoundError:
        return Package(name, None, needed)


def requirements() -> dict[str, list[Package]]:
    """Return {extra or "": [Package]} of the installed package, without [dev].

    Raises: InputError if the package runs from a folder and was never installed.
    """
    from importlib import metadata

    try:
        lines = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        raise InputError(f"{DISTRIBUTION} is not installed here: pip install -e . in its folder") from None
    found: dict[str, list[Package]] = {}
    for line in lines:
        wanted = Requirement(line)
        extra = re.search('extra == "(.+?)"', str(wanted.marker))
        key = extra.group(1) if extra else ""
        if key != "dev" and wanted.name != DISTRIBUTION:
            found.setdefault(key, []).append(_found(wanted.name, str(wanted.specifier)))
    return found


def installed(name: str) -> bool:
    """Return whether a distribution is installed, in any version."""
    return _found(name).version is not None


def _python() -> Package:
    """Return this Python, with the versions that the package supports."""
    from importlib import metadata

    try:
        needed = metadata.metadata(DISTRIBUTION).get("Requires-Python", "")
    except metadata.PackageNotFoundError:
        needed = ""
    return Package("Python", platform.python_version(), needed)


def versions() -> list[Package]:
    """Return Python, this package and its required packages."""
    from fowt_env import __version__

    try:
        needed = requirements().get("", [])
    except InputError:
        needed = [_found(name) for name in ("numpy", "scipy", "numba", "gymnasium", "pandas")]
    needed = [_found("numba", NUMBA) if package.name == "numba" else package for package in needed]
    head = [Package(DISTRIBUTION, __version__), _python()]
    return [*head, *needed, _found("llvmlite")]


def optional_parts() -> dict[str, list[Package]]:
    """Return {extra: [Package]}: the packages of each extra, installed or not."""
    return {extra: packages for extra, packages in sorted(requirements().items()) if extra}
