"""The glossary names files that exist, names that are defined in them, and units in one spelling."""

from doc_pages import DOCS, defined

ROOT = DOCS.parent
HEADINGS = ["word", "meaning", "unit", "name", "file"]
UNITS = {"-", "m", "m2", "s", "rad", "kg", "kg m", "kg m2", "N", "N m", "m/s", "m/s2", "rad/s", "deg/s"}


def rows():
    """{word: {heading: cell}} of all tables of the page."""
    found = {}
    for line in (DOCS / "reference/glossary.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("| ") and not line.startswith("| word "):
            cells = [cell.strip() for cell in line.strip("|").split(" | ")]
            assert len(cells) == len(HEADINGS), line
            assert cells[0] not in found, f"{cells[0]} is there twice"
            found[cells[0]] = dict(zip(HEADINGS, cells, strict=True))
    return found


ROWS = rows()


def test_a_word_is_defined_where_the_glossary_says():
    wrong = [] if len(ROWS) >= 60 else ["words are missing"]
    for word, row in ROWS.items():
        name, file = row["name"].strip("`"), ROOT / row["file"].strip("`")
        quoted = row["name"] == f"`{name}`" and row["file"] == f"`{file.relative_to(ROOT).as_posix()}`"
        if not (quoted and file.is_file() and name in defined(file)):
            wrong.append(f"{word}: {row['name']} in {row['file']}")
    assert not wrong


def test_units_have_one_spelling():
    units = {word: row["unit"].split(", ") for word, row in ROWS.items()}
    wrong = [word for word, found in units.items() if set(found) - UNITS or len(set(found)) < len(found)]
    wrong += [word for word, row in ROWS.items() if not row["meaning"] or row["meaning"].endswith(".")]
    assert not wrong
