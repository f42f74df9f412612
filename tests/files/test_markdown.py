"""The one writer of markdown tables."""

import pytest

from fowt_env.files.markdown import markdown_table

ROWS = [("a", 1), ("longer", 22.5)]


def test_cells_stand_as_they_are_or_in_columns_of_one_width():
    assert markdown_table(("x", "y"), ROWS) == "| x | y |\n|---|---|\n| a | 1 |\n| longer | 22.5 |"
    assert markdown_table(("x", "y"), ROWS, aligned=True) == (
        "| x      | y    |\n|--------|------|\n| a      | 1    |\n| longer | 22.5 |"
    )


@pytest.mark.parametrize("aligned", [False, True])
def test_a_bar_in_a_cell_ends_no_column(aligned):
    lines = markdown_table(("|x|", "y"), [("a|b", 1)], aligned).splitlines()
    assert lines[0].replace("\\|", "").count("|") == lines[2].replace("\\|", "").count("|") == 3
    assert len(set(map(len, lines))) == 1 or not aligned
