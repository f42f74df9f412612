"""Locates the sources of this package: in a checkout, two of its packages are folders next to fowt_env.

Once installed, all packages are inside fowt_env; a source file is therefore identified by its installed path.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

PACKAGE = Path(__file__).absolute().parent


def _folder(name):
    """Return the folder of the package fowt_env.<name>: inside fowt_env, or next to it in a checkout."""
    inside = PACKAGE / name
    return inside if inside.is_dir() else PACKAGE.parent / name


FOLDERS = {name: _folder(name) for name in ("controllers", "training")}


def check_packages():
    """Raise ImportError if Python does not find one of FOLDERS, or finds that of another copy of fowt_env.

    Also on Windows, which lacks the locks, signals and process ids that files and runs are protected with.
    """
    if sys.platform == "win32":
        raise ImportError("fowt_env needs Linux or macOS: on Windows install it in WSL 2 (`wsl --install`)")
    for name, folder in FOLDERS.items():
        spec = find_spec(f"fowt_env.{name}")
        location = None if spec is None else spec.origin and Path(spec.origin).parent
        if location is not None and location.resolve() == folder.resolve():
            continue
        reason = f"has no fowt_env.{name}" if location is None else f"takes fowt_env.{name} from {location}"
        fault = f"fowt_env is in {PACKAGE}, but {sys.executable} {reason}"
        if (PACKAGE.parent / "pyproject.toml").is_file():
            raise ImportError(
                f"{fault}: this checkout is not installed there. Run"
                f' `"{sys.executable}" -m pip install --editable "{PACKAGE.parent}"`,'
                " or `make test` in the checkout, which sets up .venv"
            )
        raise ImportError(f"{fault}: this installation is incomplete. Install it again")


def link_packages(folder):
    """Create a folder of links in which fowt_env looks as installed, for tools that read its sources."""
    package = Path(folder, PACKAGE.name)
    package.mkdir(parents=True, exist_ok=True)
    for path in (*PACKAGE.iterdir(), *FOLDERS.values()):
        if not (package / path.name).exists():
            (package / path.name).symlink_to(path)


def installed_path(path):
    """Return the installed path of a source file of this package; None for any other file."""
    for name, folder in FOLDERS.items():
        if path.is_relative_to(folder):
            return PACKAGE / name / path.relative_to(folder)
    return path if path.is_relative_to(PACKAGE) else None


def module_path(name):
    """Return the path, without .py, of a module of this package from its dotted name."""
    _, *parts = name.split(".")
    folder = FOLDERS.get(parts[0]) if parts else None
    return PACKAGE.joinpath(*parts) if folder is None else folder.joinpath(*parts[1:])
