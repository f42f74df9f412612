import copy
import json

import numpy as np
import pandas as pd
import pytest

from fowt_env.training.board.page import FIGURES
from fowt_env.training.cli import scores as scores_command
from fowt_env.training.design import sweeps
from fowt_env.training.evaluation.evaluate import COLUMNS
from fowt_env.training.evaluation.leaderboard import SHOWN, leaderboard
from fowt_env.training.evaluation.metric_names import SHORT
from fowt_env.training.evaluation.metrics import METRICS, PAID
from fowt_env.training.reports.evaluation_plots import evaluation_plots
from fowt_env.training.reports.scores import figures_named
from fowt_env.training.reports.terminal import (
    LEADERBOARD,
    LEADERBOARD_DROPS,
    PRINTED_METRICS,
    leaderboard_rows,
    summary_rows,
)
from fowt_env.training.studies import rosco_differences

POWER = "GenPwr_max_[kW]"
COMPARED = [figure.metric for figure in figures_named(scores_command.FIGURES.split(","))]


def means():
    """Two summary rows, the second of them without a successful run."""
    rows = [
        {"controller": name, "case": "ntm_18", "runs": 3, "failed": failed, "tripped": 0, "lost_power": lost}
        for name, failed, lost in (("pi", 0, 0), ("x", 1, 2))
    ]
    frame = pd.DataFrame(rows)
    for name in METRICS:
        frame[name] = [1234.5678, float("nan")]
    return frame


@pytest.mark.parametrize("width", [80, 100, 200])
def test_printed_rows_fit_the_width_and_say_what_failed(width):
    headings, rows, failed = summary_rows(means(), width)
    assert width < 200 or len(headings) == 3 + len(PRINTED_METRICS)
    assert failed == [0, 3] and rows[0][2] == "3/3" and rows[1][2] == "0/3"
    assert set(rows[1][3:]) == {"-"}
    columns = zip(headings, *rows, strict=True)
    assert (
        sum(2 + max(len(line) for text in column for line in text.split("\n")) for column in columns) <= width
    )


def board(seeds, pi="ok", x="failed", factor=1.0, lost=None, baseline=None):
    """Leaderboard of pi and of x (status of their runs) over one case.

    x has `factor` times the figures of pi, and no run of the seed `lost`.
    """
    rows = [
        dict.fromkeys(COLUMNS, share * (1.0 + 0.1 * seed))
        | {"controller": name, "case": "calm", "seed": seed, "status": status, "reason": ""}
        for seed in seeds
        for name, status, share in (("pi", pi, 1.0), ("x", "failed" if seed == lost else x, factor))
    ]
    return leaderboard(pd.DataFrame(rows), baseline)


def test_the_leaderboard_says_how_many_runs_went_well_and_of_which_seeds():
    title, headings, rows, remarks = leaderboard_rows(board([1, 2, 3, 6, 8, 9]))
    assert title == (
        "1 case, seeds 1 to 3, 6, 8, 9: means [95 % interval], paired difference from pi (* significant)"
    )
    (pi, x) = (dict(zip(headings, row, strict=True)) for row in rows)
    assert (pi["runs"], x["runs"]) == ("6/6", "0/6, 6 failed")
    assert set(row for heading, row in x.items() if "\n" in heading) == {"-"}  # nothing made up
    assert remarks == ["runs lost by x: 6 failed: not in these means; ranked last"]


def test_a_row_has_means_with_intervals_and_differences_to_the_baseline():
    both = board([1, 2, 3, 4, 5], x="ok", factor=0.5)
    _, headings, (pi, x), _ = leaderboard_rows(both)
    place = {heading.replace("\n", " "): number for number, heading in enumerate(headings)}
    speed = both["controllers"][1]["metrics"]["RotSpeed_std_[rpm]"]
    wanted = f"{speed['mean']:.3f} [{speed['low']:.3f}, {speed['high']:.3f}] -50.0%*"
    assert x[place["rotor speed std rpm"]] == wanted and speed["mean"] == pytest.approx(
        0.5 * np.sqrt(np.mean((1.0 + 0.1 * np.arange(1, 6)) ** 2))  # of deviations the squares are averaged
    )
    assert not any("%" in text or "*" in text for text in pi)  # the baseline has none to itself


def test_one_name_has_one_figure_and_one_unit_in_all_tables():
    """The maximum power is the mean of the maxima of the runs, in the metric's own unit."""
    both = board([1, 2, 9], x="ok", factor=1e3)
    _, headings, (_, x), _ = leaderboard_rows(both)
    place = {heading.replace("\n", " "): number for number, heading in enumerate(headings)}
    assert x[place["maximum power kW"]] == "1400" == f"{both['controllers'][1]['metrics'][POWER]['mean']:.0f}"
    for heading, metric, *_ in (*LEADERBOARD, *PRINTED_METRICS):
        unit = metric.rpartition("_[")[2][:-1].replace("m/s^2", "m/s²")
        assert heading.split("\n")[-1].replace(" ", "") == unit.replace("-", "")
    assert SHORT[POWER] == "maximum power"


def test_whatever_shows_the_rotor_speed_shows_what_was_paid_for_it():
    shown = {
        "printed": [name for _, name, *_ in PRINTED_METRICS], "leaderboard": [m for _, m, *_ in LEADERBOARD],
        "page": SHORT, "notebook": SHOWN.values(), "board": FIGURES.values(), "scores": COMPARED,
        "sweeps": sweeps.SHOWN, "rosco": rosco_differences.SHOWN.values(),
    }  # fmt: skip
    for where, metrics in shown.items():
        assert {"RotSpeed_std_[rpm]", *PAID} <= set(metrics), where
    assert not set(PAID) & set(LEADERBOARD_DROPS)


def test_few_seeds_have_neither_interval_nor_star_and_the_remark_says_so_once():
    for seeds, words in (([1], "seed 1:"), ([1, 2, 4], "seeds 1, 2, 4:")):
        title, _, rows, remarks = leaderboard_rows(board(seeds, x="ok"))
        assert words in title and "[" not in title and "*" not in title
        assert not any("[" in text or "*" in text for row in rows for text in row)
        count = "1 seed" if len(seeds) == 1 else "3 seeds"
        assert remarks == [f"{count}: no interval (needs 4)"]
    assert leaderboard_rows(board([1, 2, 3, 4], x="ok"))[3] == []


def test_a_controller_that_failed_in_bad_weather_is_not_said_to_be_better_and_its_row_says_failed():
    both = board([1, 2, 3, 4, 5], x="ok", factor=0.5)
    _, headings, (_, row), _ = leaderboard_rows(both)
    assert sum("-50.0%*" in text for text in row) == 8
    lost = board([1, 2, 3, 4, 5], x="ok", factor=0.5, lost=5)
    _, headings, (_, row), remarks = leaderboard_rows(lost)
    assert row[headings.index("runs")] == "4/5, 1 failed"
    assert not any("*" in text for text in row) and sum("-50.0% " in text for text in row) == 8
    assert remarks[0] == "runs lost by x: 1 failed: not in these means; ranked last"


def test_a_baseline_that_failed_is_said_to_have():
    _, _, _, remarks = leaderboard_rows(board([1, 2, 3, 4, 5], x="ok", lost=5, baseline="x"))
    assert remarks[-1] == "differences from x are over the runs that the baseline did not lose"
    title, _, _, remarks = leaderboard_rows(board([1, 2], pi="failed"))
    assert "difference" not in title
    assert remarks[-1] == "no paired differences: every controller has runs that failed or lost power"


def test_a_narrow_terminal_loses_columns_of_the_leaderboard_in_order():
    wide, narrow = (leaderboard_rows(board([1, 2]), width)[1] for width in (300, 60))
    assert len(wide) - len(narrow) == len(LEADERBOARD_DROPS) and set(narrow) < set(wide)


def test_a_score_beyond_a_limit_stands_in_brackets_and_none_is_a_dash():
    scored = copy.deepcopy(board([1, 2]))
    nan = float("nan")
    score = {"lifetime": {"mean": 0.9, "low": nan, "high": nan}, "valid": False}
    score["winds"] = {"mean": 1.1, "low": 1.0, "high": 1.3}
    limits = [{"state": state} for state in ("exceeded", "held", "not decided", "exceeded")]
    changes = {"score": score, "held": False, "limits": limits, "undecided": ["speed = 1"]}
    scored["controllers"][0] |= changes
    _, headings, rows, remarks = leaderboard_rows(scored)
    lifetime, winds, state = map(headings.index, ("score\nlifetime", "score\nwinds", "limits"))
    assert [row[lifetime] for row in rows] == ["(0.900)", "-"]
    assert [row[winds] for row in rows] == ["(1.100 [1.000, 1.300])", "-"]
    assert [row[state] for row in rows] == ["2 exceeded, 1 not decided", "-"]
    assert "pi has limits not decided: speed = 1" in remarks
    scored["controllers"][0]["limits"] = [{"state": "held"}]
    assert leaderboard_rows(scored)[2][0][state] == "held"


def test_of_runs_that_all_failed_there_is_nothing_to_plot(tmp_path):
    (tmp_path / "manifest.json").write_text(json.dumps({"cases": {"calm": {}}}))
    table = pd.DataFrame([{"controller": "x", "case": "calm", "seed": 1, "status": "failed"}])
    assert evaluation_plots(table, {}, tmp_path) == [] and len(list(tmp_path.iterdir())) == 1


def test_the_limit_at_own_spending_is_a_column_where_it_is_known():
    plain, limited = (
        leaderboard_rows(board([1, 2]), 300, each) for each in (None, {"x": "1.07 (1.02 to 1.12)"})
    )
    assert "of its\nlimit" not in plain[1]
    place = limited[1].index("of its\nlimit")
    texts = {row[0]: row[place] for row in limited[2]}
    assert texts.pop("x") == "1.07 (1.02 to 1.12)" and set(texts.values()) == {"-"}
