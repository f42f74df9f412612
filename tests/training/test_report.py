import pandas as pd
import pytest

from training.metrics import METRICS
from training.report import DROPPED_FIRST, HEADLINE, summary_rows


def means():
    """Two summary rows, the second of them without a successful run."""
    rows = [
        {"controller": name, "case": "ntm_18", "runs": 3, "failed": failed}
        for name, failed in (("pi", 0), ("x", 3))
    ]
    frame = pd.DataFrame(rows)
    for name in METRICS:
        frame[name] = [1234.5678, float("nan")]
    return frame


def test_headline_and_dropped_columns_are_metrics():
    names = [name for _, name, _ in HEADLINE]
    assert set(names) <= set(METRICS) and set(DROPPED_FIRST) < set(names)


@pytest.mark.parametrize("width", [80, 100, 200])
def test_printed_rows_fit_the_width_and_say_what_failed(width):
    headings, rows, failed = summary_rows(means(), width)
    assert failed == [0, 3] and rows[0][2] == "3/3" and rows[1][2] == "0/3"
    assert set(rows[1][3:]) == {"-"}
    columns = zip(headings, *rows, strict=True)
    assert (
        sum(2 + max(len(line) for text in column for line in text.split("\n")) for column in columns) <= width
    )


def test_a_wide_terminal_gets_every_column():
    assert len(summary_rows(means(), 200)[0]) == 3 + len(HEADLINE)
