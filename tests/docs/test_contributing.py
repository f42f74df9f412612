"""CONTRIBUTING.md says where things are: a row for each folder, and a file for each question."""

import re

from doc_pages import DOCS, defined

ROOT = DOCS.parent
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PROGRAMS = "training/studies/"  # one row for all beneath it
QUOTED = re.compile(r"`([^`]+)`")


def table(heading):
    """Cells of the rows of the table whose first heading this is."""
    lines = TEXT.partition(f"| {heading} |")[2].splitlines()[2:]
    rows = lines[: lines.index("")]
    assert rows, heading
    return [[cell.strip() for cell in row.strip("| ").split(" | ")] for row in rows]


PLACES = [place for cells in table("place") for place in QUOTED.findall(cells[0])]
QUESTIONS = {cells[0]: cells[1:] for cells in table("where is, or how do I")}


def source_folders():
    """Folders of the packages that hold sources, and tests/."""
    for package in ("fowt_env", "controllers", "training"):
        for path in (ROOT / package).rglob("*.py"):
            folder = path.relative_to(ROOT).parent.as_posix() + "/"
            yield PROGRAMS if folder.startswith(PROGRAMS) else folder
    yield "tests/"


def test_every_folder_and_every_file_beside_them_has_one_row():
    files = {path.relative_to(ROOT).as_posix() for path in (ROOT / "fowt_env").glob("[!_]*.py")}
    # what lies in these two, but for the first lines of packages, has rows of its own
    needed = files | set(source_folders()) - {"fowt_env/", "training/", "training/validation/reference/"}
    assert needed <= set(PLACES), needed - set(PLACES)
    assert len(PLACES) == len(set(PLACES))


def test_folders_without_a_row_hold_no_source_of_their_own():
    """Of training/ and of the reference series, whose program is beside them."""
    assert {path.name for path in (ROOT / "training").glob("*.py")} == {"__init__.py"}
    assert "training/validation/reference/" in TEXT


def test_places_and_answers_are_there():
    """An answer is one file of a folder in the first table; what to look for is defined in that file."""
    wrong = [p for p in PLACES if not ((ROOT / p).is_dir() if p.endswith("/") else (ROOT / p).is_file())]
    for question, (file, names) in QUESTIONS.items():
        (path,), sought = QUOTED.findall(file), set(QUOTED.findall(names))
        found = defined(ROOT / path) if (ROOT / path).is_file() else set()
        if not sought or sought - found or f"{path.rpartition('/')[0]}/" not in {*PLACES, "fowt_env/"}:
            wrong.append(f"{question}: {path}: {sought - found}")
    assert not wrong
