"""Counts the words of the manual: `python docs/tools/words.py` prints them, page by page.

The manual is what a person writes and a reader reads through: index, tutorials, guides, explanation and
reference. Not counted: docs/results (dated tables), docs/reference/cli.md and docs/reference/api (generated),
tables between the marks of reference_pages.py (generated), programs and outputs in fences, formulas, comments
and the targets of links. A word is what stands between blanks and has a letter or a digit: cells of other
tables count, and names in backquotes too.
"""

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
LIMIT = 30_000
FOLDERS = ("tutorials", "guides", "explanation", "reference")
GENERATED = ("reference/cli.md", "reference/api/")
TABLES = r"<!-- from the code: \w+ -->\n.*?<!-- end -->"
FORMULAS = r"\$\$.*?\$\$|\$[^$\n]+\$"
LEFT_OUT = re.compile(rf"{TABLES}|<!--.*?-->|^ *```.*?^ *```$|{FORMULAS}|(?<=\])\([^)\s]+\)", re.S | re.M)
WORD = re.compile(r"\S*[^\W_]\S*")


def pages():
    """Paths of the manual's pages below docs/, as texts."""
    paths = [DOCS / "index.md", *(path for name in FOLDERS for path in (DOCS / name).rglob("*.md"))]
    names = (path.relative_to(DOCS).as_posix() for path in paths)
    return sorted(name for name in names if not name.startswith(GENERATED))


def words(text):
    """Number of words of a page's text."""
    return len(WORD.findall(LEFT_OUT.sub(" ", text)))


def main():
    """Print the words of each page, the longest first, and their sum."""
    counts = {page: words((DOCS / page).read_text(encoding="utf-8")) for page in pages()}
    for page, count in sorted(counts.items(), key=lambda item: -item[1]):
        print(f"{count:7,}  docs/{page}")
    print(f"{sum(counts.values()):7,}  of {LIMIT:,} at most")


if __name__ == "__main__":
    main()
