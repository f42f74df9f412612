"""A copy of the sources, for the tests that edit them."""

from pathlib import Path

import fowt_env

ROOT = Path(fowt_env.__file__).resolve().parent.parent
PACKAGES = ("fowt_env", "controllers", "training")
LOOKS = ("fowt_env/visual", "training/cli", "training/reports")  # what people read and look at
SUFFIXES = {".py", ".toml", ".csv"}


def copied_code(folder):
    """Folder with a copy of the sources and of descriptions, inside a folder."""
    code = folder / "code"
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*")):
        if path.suffix not in SUFFIXES or "reference" in path.relative_to(ROOT).parts:
            continue
        copy = code / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    for package in PACKAGES[1:]:
        if not (code / "fowt_env" / package).exists():
            (code / "fowt_env" / package).symlink_to(code / package, target_is_directory=True)
    return code


def edit(place):
    """Add a line of code to a source, or to every one beneath a folder."""
    sources = [place] if place.is_file() else list(place.rglob("*.py"))
    assert sources, f"{place}: no source"
    for path in sources:
        path.write_text(path.read_text(encoding="utf-8") + "\n_EDITED = True\n", encoding="utf-8")
