"""A board from its first submission to its page, on a small suite."""

import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.training.board.folder import Board
from fowt_env.training.board.judge import check_figures, judge
from fowt_env.training.board.page import FIGURES, board_rows, ratio_text, write_board
from fowt_env.training.evaluation.results import read_row, run_file, write_run

SUITE = """
version = 3
description = "short winds"
source = "none"
wind = "rotor-averaged"
seeds = [1]
duration = 40.0
skip = 10.0

[[case]]
name = "ntm_{speed}"
speed = [14, 18]
wind = {kind = "ntm", class = "B"}

[site]
A = 11.284
k = 2.0
source = "none"

[score]
baseline = "gspi_oc3"

[[score.term]]
metric = "RotSpeed_std_[rpm]"
weight = 1.0
"""
BOARD = """
title = "A <small> board"
seeds = [1, 2, 3, 4]

[[regime]]
name = "winds"
suites = ["short"]
"""
MINE = """
class Mine:
    def __init__(self, turbine, control_dt):
        self.torque = turbine.torque_law.rated_torque
    def reset(self, measurement):
        self.pitch = measurement.blade_pitch
    def act(self, measurement):
        return self.torque, self.pitch + 0.02 * (measurement.generator_speed - 122.9)
"""


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    folder = tmp_path_factory.mktemp("board")
    (folder / "suites").mkdir()
    (folder / "suites" / "short.toml").write_text(SUITE)
    (folder / "board.toml").write_text(BOARD)
    for name, controller in (("gspi_oc3", "gspi_oc3"), ("mine", "mine.py:Mine")):
        card = {"name": name, "author": "<b>A</b>", "licence": "MIT", "controller": controller}
        here = folder / "submissions" / name
        here.mkdir(parents=True)
        text = "".join(f"{key} = {value!r}\n" for key, value in card.items())
        if name == "mine":
            text += "information = ['generator_speed', 'blade_pitch']\nurl = 'javascript:alert(1)'\n"
            (here / "mine.py").write_text(MINE)
        (here / "card.toml").write_text(text)
    return Board(folder)


@pytest.fixture(scope="module")
def judged(board, tmp_path_factory):
    folder = tmp_path_factory.mktemp("organiser")
    (folder / "seeds.txt").write_text("1001\n1002\n1003\n1004\n")
    return judge(board, 1, folder / "seeds.txt", folder / "runs", trust_code=True)


def test_code_runs_only_where_it_is_trusted(board):
    with pytest.raises(InputError, match="submissions mine: hold Python code"):
        judge(board)


def test_runs_of_secret_seeds_lie_outside_of_the_board(board, tmp_path):
    (tmp_path / "seeds.txt").write_text("1001\n")
    with pytest.raises(InputError, match="must lie outside"):
        judge(board, 1, tmp_path / "seeds.txt", board.folder / "private", trust_code=True)
    with pytest.raises(InputError, match="need a folder"):
        judge(board, 1, tmp_path / "seeds.txt", trust_code=True)


def test_page_table_and_history(board, judged):
    page, table, history = write_board(judged)
    frame = pd.read_csv(table)
    assert list(frame["rank"]) == [1, 2]
    assert set(frame["name"]) == {"gspi_oc3", "mine"}
    base = frame.set_index("name").loc["gspi_oc3"]
    assert base["rotor speed"] == 1.0 and base["score"] == 1.0
    assert frame["score_secret"].notna().all()
    assert set(frame["information"]) == {"rotor and blades"}
    text = page.read_text()
    assert "<b>A</b>" not in text and "&lt;b&gt;A&lt;/b&gt;" in text
    assert "javascript:alert" not in text
    assert judged.seeds_hash in text
    assert "1003" not in text and "1003" not in history.read_text()
    for name in ("http://", "https://", "<script"):
        assert name not in text
    assert "script-src 'none'" in text and "unsafe" not in text.partition("</head>")[0]
    for number in range(len(FIGURES)):  # each metric is explained where its heading asks for it
        assert text.count(f'popovertarget="metric-{number}"') == 1
        assert text.count(f'popover id="metric-{number}"') == 1
    before = pd.read_csv(history)
    write_board(judged)
    assert len(pd.read_csv(history)) == len(before) == 2
    title, headings, rows = board_rows(board.folder)
    assert len(rows) == 2 and len(rows[0]) == len(headings)
    with pytest.raises(InputError, match="unknown regime"):
        board_rows(board.folder, "gusts")


def test_a_ratio_is_called_better_or_worse_by_its_metric_and_only_if_significant():
    speed, energy = FIGURES["rotor speed"], FIGURES["energy"]
    assert ratio_text(0.8, speed, False) == "0.800"
    assert "better" in ratio_text(0.8, speed, True) and "0.800 * ✓" in ratio_text(0.8, speed, True)
    assert "worse" in ratio_text(0.8, energy, True) and "better" in ratio_text(1.2, energy, True)


def test_figures_that_are_not_those_of_the_series_are_refused(board, judged):
    """What a results folder says of itself counts for nothing."""
    folder = board.folder / "runs" / "short-v3-exact"
    path = run_file(folder / "runs", "mine", "ntm_14", 2)
    row = read_row(path)
    table = pd.DataFrame([row])
    check_figures(table, folder, board.suite("short"))
    shown = pd.read_parquet(path)
    shown["RotSpeed_[rpm]"] *= 1.001
    try:
        write_run(shown, row, path)
        with pytest.raises(InputError, match="from its series"):
            check_figures(table, folder, board.suite("short"))
    finally:
        shown["RotSpeed_[rpm]"] /= 1.001
        write_run(shown, row, path)
