"""A copy of the sources as they are installed, for the tests that edit them."""

from fowt_env.layout import FOLDERS, PACKAGE, installed_path

SOURCES = (PACKAGE, *FOLDERS.values())
LOOKS = ("fowt_env/visual", "fowt_env/training/cli", "fowt_env/training/reports")  # what people look at
SUFFIXES = {".py", ".toml", ".csv"}


def copied_code(folder):
    """Return a folder, inside this one, that has fowt_env with a copy of sources and descriptions."""
    code = folder / "code"
    for path in {path for source in SOURCES for path in source.rglob("*")}:
        place = installed_path(path).relative_to(PACKAGE.parent)
        if path.suffix in SUFFIXES and "reference" not in place.parts:
            copy = code / place
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes())
    return code


def edit(place):
    """Add a line of code to a source, or to every one beneath a folder."""
    sources = [place] if place.is_file() else list(place.rglob("*.py"))
    assert sources, f"{place}: no source"
    for path in sources:
        path.write_text(path.read_text(encoding="utf-8") + "\n_EDITED = True\n", encoding="utf-8")
