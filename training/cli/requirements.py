"""What this package needs of others, as its metadata has it, and whether what is installed will do."""

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
    """{extra or "": [Package]} of the installed package; those of [dev] are for its developers.

    Raises: InputError where the package runs from a folder and was never installed.
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
    """Whether a distribution is installed, in any version."""
    return _found(name).version is not None


def _python() -> Package:
    """This Python, beside the versions that the package is tested with."""
    from importlib import metadata

    try:
        needed = metadata.metadata(DISTRIBUTION).get("Requires-Python", "")
    except metadata.PackageNotFoundError:
        needed = ""
    return Package("Python", platform.python_version(), needed)


def versions() -> list[Package]:
    """Python, this package and what it cannot do without."""
    from fowt_env import __version__

    try:
        needed = requirements().get("", [])
    except InputError:
        needed = [_found(name) for name in ("numpy", "scipy", "numba", "gymnasium", "pandas")]
    needed = [_found("numba", NUMBA) if package.name == "numba" else package for package in needed]
    head = [Package(DISTRIBUTION, __version__), _python()]
    return [*head, *needed, _found("llvmlite")]


def optional_parts() -> dict[str, list[Package]]:
    """{extra: [Package]}: what each extra of the package would bring, installed or not."""
    return {extra: packages for extra, packages in sorted(requirements().items()) if extra}
