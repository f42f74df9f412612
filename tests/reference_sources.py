"""The stored reference data: what made each file, and its SHA-256.

`python tests/reference_sources.py` writes tests/reference/sha256.txt anew, after a file was made anew on
purpose. The makers are the rows of a table of CONTRIBUTING.md.
"""

import hashlib
import re
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
HASHES = ROOT / "tests" / "reference" / "sha256.txt"
DECKS = ROOT / "tests" / "reference" / "decks"  # whose files.csv has the hashes of files and sources
FOLDERS = ("tests/reference", "training/validation/reference")


def stored_files():
    """Paths, from the root, of all data in the folders of references; the decks have a list of their own."""
    paths = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    kept = [
        path
        for path in paths
        if path.suffix not in (".py", ".pyc", ".md") and path != HASHES and DECKS not in path.parents
    ]
    return sorted(path.relative_to(ROOT).as_posix() for path in kept)


def sha256(name):
    """SHA-256 of a file, its path from the root."""
    return hashlib.sha256((ROOT / name).read_bytes()).hexdigest()


def hashes():
    """{path: SHA-256} as they are stored."""
    return dict(line.split()[::-1] for line in HASHES.read_text().splitlines())


def makers():
    """[(patterns of paths, maker or "", the rest of the row)] of the table of CONTRIBUTING.md."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = re.search(r"\| stored data \|.*?\n\n", text, re.S)[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.strip().split("\n")[2:]]
    return [
        (re.findall(r"`([^`]+)`", data), maker.strip("`") if "`" in maker else "", source)
        for data, maker, source in rows
    ]


def maker_of(name):
    """Row of `makers` that a file belongs to. Raises: ValueError where it is none or several."""
    rows = [row for row in makers() if any(PurePosixPath(name).match(pattern) for pattern in row[0])]
    if len(rows) != 1:
        raise ValueError(f"{name} belongs to {len(rows)} rows of the table of stored data in CONTRIBUTING.md")
    return rows[0]


if __name__ == "__main__":
    HASHES.write_text("".join(f"{sha256(name)}  {name}\n" for name in stored_files()))
