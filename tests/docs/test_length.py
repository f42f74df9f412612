"""The manual is short enough to be read: docs/tools/words.py says what counts."""

import importlib.util

import pytest
from doc_pages import DOCS

SPEC = importlib.util.spec_from_file_location("words", DOCS / "tools" / "words.py")
TOOL = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(TOOL)


def test_the_manual_has_at_most_the_words_that_it_may_have():
    counts = {page: TOOL.words((DOCS / page).read_text(encoding="utf-8")) for page in TOOL.pages()}
    assert len(counts) > 20 and 20_000 < sum(counts.values()) <= TOOL.LIMIT == 30_000, counts


def test_the_manual_is_what_is_written_by_hand():
    pages = TOOL.pages()
    assert {"index.md", "explanation/theory.md", "reference/suites.md", "guides/faq.md"} < set(pages)
    assert not [page for page in pages if page.startswith(("results/", "reference/api/", "joss/", "tools/"))]
    assert "reference/cli.md" not in pages


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("two words", 2),
        ("| a | 1.5 m |\n|---|---|", 3),
        ("- *word*, `code`: $a + b$ end", 3),
        ("[a link](../to/a/page.md#there) on", 3),
        ("before\n```\nnot counted\n```\nafter", 2),
        ("before\n$$\na = b\n$$\nafter", 2),
        ("before\n<!-- from the code: x -->\n| made |\n<!-- end -->\nafter", 2),
        ("before <!-- a comment --> after", 2),
    ],
)
def test_programs_formulas_comments_and_generated_tables_are_no_words(text, count):
    assert TOOL.words(text) == count


def test_the_readme_is_a_page_and_a_half():
    lines = (DOCS.parent / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 105 and sum(map(len, lines)) <= 9_500
