"""A board from its first submission to its page, on a small suite."""

import json
import shutil
from dataclasses import replace

import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.training.board.folder import Board, write_secret_seeds
from fowt_env.training.board.judge import _unordered, check_figures, judge
from fowt_env.training.board.page import FIGURES, board_rows, cell, escaped, ratio_text, write_board
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.results import read_row, run_content, run_file, write_run
from fowt_env.training.evaluation.seeds import DRAWN, drawn_seeds

SUITE = """
version = 3
description = "short winds"
source = "none"
wind = "rotor-averaged"
seeds = [1]
duration = 30.0
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
call_limit = 5.0

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
HASH = "0123456789abcdef0123456789abcdef01234567"


def submit(folder, name, controller, source=None, **card):
    """Write a submission of this name straight into a board's folder."""
    here = folder / "submissions" / name
    shutil.rmtree(here, ignore_errors=True)
    here.mkdir(parents=True)
    card = {"name": name, "author": "<b>A</b>", "licence": "MIT", "controller": controller} | card
    (here / "card.toml").write_text("".join(f"{key} = {value!r}\n" for key, value in card.items()))
    if source is not None:
        (here / "mine.py").write_text(source)


def submit_mine(folder, source=MINE, **card):
    given = {"information": ["generator_speed", "blade_pitch"], "url": "javascript:alert(1)"} | card
    submit(folder, "mine", "mine.py:Mine", source, **given)


def made_board(folder, seeds="[1, 2, 3, 4]", suite=SUITE):
    (folder / "suites").mkdir()
    (folder / "suites" / "short.toml").write_text(suite)
    (folder / "board.toml").write_text(BOARD.replace("[1, 2, 3, 4]", seeds))
    submit(folder, "gspi_oc3", "gspi_oc3")
    submit_mine(folder)
    return Board(folder)


@pytest.fixture(scope="module", autouse=True)
def _own_cache(tmp_path_factory):
    """Submissions keep their kernels in a folder of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FOWT_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    return made_board(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="module")
def judged(board, tmp_path_factory):
    folder = tmp_path_factory.mktemp("organiser")
    write_secret_seeds(folder / "seeds.txt", 1)
    return judge(board, 1, folder / "seeds.txt", folder / "runs", trust_code=True)


def test_code_runs_only_where_it_is_trusted(board):
    with pytest.raises(InputError, match="submissions mine: contain code"):
        judge(board)
    with pytest.raises(InputError, match="jobs = 100000: .* use at most that many"):
        judge(board, 100000, trust_code=True)


def test_runs_of_secret_seeds_lie_outside_of_the_board(board, tmp_path):
    write_secret_seeds(tmp_path / "seeds.txt", 1)
    with pytest.raises(InputError, match="must be outside"):
        judge(board, 1, tmp_path / "seeds.txt", board.folder / "private", trust_code=True)
    with pytest.raises(InputError, match="need a folder"):
        judge(board, 1, tmp_path / "seeds.txt", trust_code=True)


def test_page_table_and_history(board, judged):
    page, table, history = write_board(judged)
    frame = pd.read_csv(table)
    assert list(frame["rank"]) == [1, 2]
    assert set(frame["name"]) == {"gspi_oc3", "mine"}
    frame = frame.set_index("name")
    assert frame.loc["gspi_oc3", "rotor speed"] == 1.0 and frame.loc["gspi_oc3", "score"] == 1.0
    assert frame["score_secret"].notna().all()
    assert set(frame["information"]) == {"rotor and blades"}
    assert 0.0 < frame.loc["mine", "slowest_call_[s]"] < 5.0
    assert pd.isna(frame.loc["gspi_oc3", "slowest_call_[s]"])
    text = page.read_text()
    assert "<b>A</b>" not in text and "&lt;b&gt;A&lt;/b&gt;" in text
    assert "javascript:alert" not in text
    assert judged.seeds_hash in text and "1, 2, 3, 4, which are for development" in text
    secret = set(judged.secret["short"]["seed"])
    assert len(secret) == 1 and all(seed in DRAWN for seed in secret)
    for seed in map(str, secret):
        assert seed not in text and seed not in history.read_text() and seed not in table.read_text()
    for name in ("http://", "https://", "<script"):
        assert name not in text
    assert "script-src 'none'" in text and "unsafe" not in text.partition("</head>")[0]
    for number in range(len(FIGURES)):  # each metric is explained where its heading asks for it
        assert text.count(f'popovertarget="metric-{number}"') == 1
        assert text.count(f'popover id="metric-{number}"') == 1
    before = pd.read_csv(history)
    write_board(judged)
    assert len(pd.read_csv(history)) == len(before) == 2 and set(before["seeds"]) == {"listed"}
    write_board(replace(judged, drawn="0a1b"))  # of other seeds: another judging
    assert list(pd.read_csv(history)["seeds"]) == ["listed", "listed", "0a1b", "0a1b"]
    title, headings, rows = board_rows(board.folder)
    assert len(rows) == 2 and len(rows[0]) == len(headings)
    with pytest.raises(InputError, match="unknown regime"):
        board_rows(board.folder, "gusts")


def test_a_ratio_is_called_better_or_worse_by_its_metric_and_only_if_significant():
    speed, energy = FIGURES["rotor speed"], FIGURES["energy"]
    assert ratio_text(0.8, speed, False) == "0.800"
    assert "better" in ratio_text(0.8, speed, True) and "0.800 * ✓" in ratio_text(0.8, speed, True)
    assert "worse" in ratio_text(0.8, energy, True) and "better" in ratio_text(1.2, energy, True)


def test_texts_of_a_card_are_shown_as_what_they_are():
    assert escaped("a\x00b\u202ec <i>\n") == "a\\x00b\\u202ec &lt;i&gt; "
    assert [cell(text) for text in ("=1+1", " @x", "A. B", "\u202e=1")] == [
        "'=1+1", "' @x", "A. B", "\\u202e=1",
    ]  # fmt: skip


def test_figures_that_are_not_those_of_the_series_are_refused(board, judged):
    """What a results folder says of itself counts for nothing."""
    folder = board.folder / "runs" / "short-v3-exact"
    path = next(folder.glob("runs/mine.*/ntm_14_seed2.parquet"))
    row = read_row(path)
    assert path == run_file(folder / "runs", row["controller"], "ntm_14", 2)
    table = pd.DataFrame([row])
    check_figures(table, folder, board.suite("short"))
    shown = pd.read_parquet(path)
    shown["RotSpeed_[rpm]"] *= 1.001
    try:
        write_run(run_content(shown, row), path)
        with pytest.raises(InputError, match="from the time series"):
            check_figures(table, folder, board.suite("short"))
        left = judge(board, trust_code=True)
        assert "from the time series" in left.left_out["mine, short"]
        assert set(left.public["short"]["controller"]) == {"reference", "gspi_oc3"}
    finally:
        shown["RotSpeed_[rpm]"] /= 1.001
        write_run(run_content(shown, row), path)


def test_secret_runs_come_in_an_order_that_nobody_knows():
    """Of 51 cases the one of the file comes by chance less often than once in 10**66 judgings."""
    suite, seeds = read_suite("dlc"), tuple(range(2**62, 2**62 + 12))
    mixed = _unordered(suite, seeds)
    assert sorted(mixed.seeds) == list(seeds)
    assert {case.name for case in mixed.cases} == {case.name for case in suite.cases}
    assert [case.name for case in mixed.cases] != [case.name for case in suite.cases]
    assert all(seed in seeds for case in mixed.cases for seed in case.seeds or ())


# ------------------------------------------------------------------------ what a stored run is of

RAISING = MINE.replace("        return", "        raise RuntimeError('never worked')\n        return")
ONE_CASE = SUITE.replace("[14, 18]", "[18]").partition("[site]")[0] + SUITE[SUITE.index("[score]") :]
CHANGES = {
    "a byte": lambda folder: submit_mine(folder, RAISING),
    "its card": lambda folder: submit_mine(folder, information=["generator_speed"]),
    "a limit": lambda folder: (folder / "board.toml").write_text(
        (folder / "board.toml").read_text().replace("call_limit = 5.0", "call_limit = 1e-9")
    ),
}


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A board that was judged."""
    board = made_board(tmp_path_factory.mktemp("first"), "[1]", ONE_CASE)
    status = judge(board, trust_code=True).public["short"].set_index("controller")["status"]
    assert dict(status) == {"reference": "ok", "gspi_oc3": "ok", "mine": "ok"}
    return board.folder


@pytest.mark.parametrize(
    "change",
    [
        "a byte",
        *(pytest.param(change, marks=pytest.mark.nightly) for change in ("its card", "a limit")),
    ],
)
def test_what_was_changed_is_run_again(first, tmp_path, change):
    """A submission that never works keeps no rank of the one whose name it has; neither do a card's words."""
    folder = tmp_path / "board"
    shutil.copytree(first, folder)
    CHANGES[change](folder)
    table = judge(Board(folder), trust_code=True).public["short"].set_index("controller")
    assert dict(table["status"]) == {"reference": "ok", "gspi_oc3": "ok", "mine": "failed"}
    reason = table.loc["mine", "reason"]
    told = {
        "a byte": "raised RuntimeError",
        "its card": "raised ControllerError",
        "a limit": "longer than 1e-09",
    }
    assert told[change] in reason and "never worked" not in reason
    assert len(list(folder.glob("runs/*/runs/mine.*"))) == 2  # what was made before is kept, and not shown


def test_seeds_drawn_from_a_hash_replace_those_that_are_listed(first, tmp_path):
    folder = tmp_path / "board"
    shutil.copytree(first, folder)
    shutil.rmtree(folder / "submissions" / "mine")
    judged = judge(Board(folder), draw_seeds=HASH)
    assert tuple(judged.public["short"]["seed"].unique()) == drawn_seeds(HASH, "short", 3, 1)
    manifest = folder / "runs" / f"short-v3-exact-{HASH[:12]}" / "manifest.json"
    assert json.loads(manifest.read_text())["suite"]["drawn"]["hash"] == HASH
    text = write_board(judged)[0].read_text()
    assert f"1 public seeds per suite, drawn from <code>{HASH}</code>" in text


# ---------------------------------------------------------------- one that is not sound, and the others


def test_what_cannot_be_run_is_left_out_and_named(first, tmp_path):
    folder = tmp_path / "board"
    shutil.copytree(first, folder)
    shutil.rmtree(folder / "submissions" / "mine")
    shutil.rmtree(folder / "runs")
    (folder / "submissions" / ".half-77").mkdir()
    (folder / "submissions" / "copied").mkdir()
    submit(folder, "gspi-oc3", "pi")
    submit(folder, "other", "pi")
    (folder / "submissions" / "other").rename(folder / "submissions" / "renamed")
    submit(folder, "deaf", "mine.py:Mine", MINE, information=["wave_elevation"])  # no sensor shows it
    (folder / "suites" / "short.toml").write_text(
        ONE_CASE.replace('source = "none"', 'source = "none"\nsensors = "standard"', 1)
    )
    judged = judge(Board(folder), trust_code=True)
    assert set(judged.left_out) == {"copied", "gspi-oc3", "renamed", "deaf, short"}
    assert "no card.toml" in judged.left_out["copied"] and "only in '_'" in judged.left_out["gspi-oc3"]
    assert "'other'" in judged.left_out["renamed"] and "wave_elevation" in judged.left_out["deaf, short"]


def test_a_board_without_its_baseline_is_refused_before_anything_runs(first, tmp_path):
    folder = tmp_path / "board"
    shutil.copytree(first, folder)
    (folder / "submissions" / "gspi_oc3" / "card.toml").unlink()
    shutil.rmtree(folder / "runs")
    with pytest.raises(InputError, match="unknown baseline among the submissions 'gspi_oc3'.*no card.toml"):
        judge(Board(folder), trust_code=True)
    assert not (folder / "runs").exists()
