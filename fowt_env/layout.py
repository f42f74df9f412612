"""Where the sources of this package lie: in a checkout, two of its packages are folders beside it.

Once installed, all of them lie inside it. So a source is known by the path that it has once installed.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

PACKAGE = Path(__file__).absolute().parent


def _folder(name):
    """Return the folder of the package fowt_env.<name>: in this one, or beside it in a checkout."""
    inside = PACKAGE / name
    return inside if inside.is_dir() else PACKAGE.parent / name


FOLDERS = {name: _folder(name) for name in ("controllers", "training")}


def check_packages():
    """Raise ImportError where Python finds none of FOLDERS, or those of another copy of this package."""
    for name, folder in FOLDERS.items():
        spec = find_spec(f"fowt_env.{name}")
        place = None if spec is None else spec.origin and Path(spec.origin).parent
        if place is not None and place.resolve() == folder.resolve():
            continue
        found = f"has no fowt_env.{name}" if place is None else f"takes fowt_env.{name} from {place}"
        fault = f"fowt_env is in {PACKAGE}, but {sys.executable} {found}"
        if (PACKAGE.parent / "pyproject.toml").is_file():
            raise ImportError(
                f"{fault}: this checkout is not installed there. Run"
                f' `"{sys.executable}" -m pip install --editable "{PACKAGE.parent}"`,'
                " or `make test` in the checkout, which sets up .venv"
            )
        raise ImportError(f"{fault}: this installation is incomplete. Install it again")


def link_packages(folder):
    """Make a folder with links in which fowt_env lies as once installed, for tools that read its sources."""
    place = Path(folder, PACKAGE.name)
    place.mkdir(parents=True, exist_ok=True)
    for path in (*PACKAGE.iterdir(), *FOLDERS.values()):
        if not (place / path.name).exists():
            (place / path.name).symlink_to(path)


def installed_path(path):
    """Return the path that a source of this package has once installed; None for any other file."""
    for name, folder in FOLDERS.items():
        if path.is_relative_to(folder):
            return PACKAGE / name / path.relative_to(folder)
    return path if path.is_relative_to(PACKAGE) else None


def module_path(name):
    """Return the path of a module of this package, by its dotted name, without the ending .py."""
    _, *parts = name.split(".")
    folder = FOLDERS.get(parts[0]) if parts else None
    return PACKAGE.joinpath(*parts) if folder is None else folder.joinpath(*parts[1:])
