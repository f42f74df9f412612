"""Tables of the command line: every figure stands in full, at 80 columns and in a pipe, in every command."""

import json

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from typer.testing import CliRunner

import fowt_env
from fowt_env.layout import FOLDERS, PACKAGE
from fowt_env.training.cli import app as cli
from fowt_env.training.cli import console
from fowt_env.training.cli import tables as cli_tables
from fowt_env.training.cli.evaluate import _print_evaluation

WIDTHS = {"80 columns": {"COLUMNS": "80"}, "a pipe": {}}


@pytest.fixture(params=WIDTHS)
def width(request, monkeypatch):
    """80, or None for a pipe: what the tables of this test are printed to."""
    monkeypatch.delenv("COLUMNS", raising=False)
    for key, value in WIDTHS[request.param].items():
        monkeypatch.setenv(key, value)
    return 80 if request.param == "80 columns" else None


def frame_of(columns, rows, **texts):
    """DataFrame of texts and of figures that take long to write: -0.01234, 5.678e+05, ..."""
    rng = np.random.default_rng(1)
    sizes = 10.0 ** rng.integers(-3, 6, (rows, len(columns)))
    values = pd.DataFrame(-rng.uniform(1.0, 9.0, sizes.shape) * sizes, columns=columns)
    return pd.concat([pd.DataFrame(texts, index=range(rows)), values], axis=1)


def assert_whole(printed, wanted, width):
    """Every text is there, nothing is cut, and no line is wider than the terminal."""
    words = printed.split()
    assert not [text for text in wanted if text not in words]
    assert "…" not in printed
    assert width is None or max(map(len, printed.splitlines())) <= width


def printed_by(*words):
    done = CliRunner().invoke(cli.app, list(words))
    assert done.exit_code == 0, done.output + repr(done.exception)
    return done.stdout


# ------------------------------------------------------------------ what commands print


def test_a_frame_is_printed_with_every_figure_in_full(width, capsys):
    table = frame_of(["wind_[m/s]", "period_[s]", "damping_ratio_[-]", *"abcdefgh"], 3)
    table.insert(1, "mode", ["surge", "platform_pitch", "heave"])
    table["runs"] = [1234567, 3, 4]
    console.show(table, "modes")
    wanted = [f"{value:.4g}" for value in table.select_dtypes(float).to_numpy().ravel()]
    assert_whole(capsys.readouterr().out, [*wanted, "1234567", *table["mode"]], width)


def test_evaluate_prints_every_figure_of_what_it_shows_in_full(width, capsys):
    from fowt_env.training.evaluation.evaluate import COLUMNS, summary
    from fowt_env.training.evaluation.leaderboard import leaderboard
    from fowt_env.training.reports.terminal import leaderboard_rows, summary_rows

    rng = np.random.default_rng(0)
    rows = [
        {name: rng.uniform(100.0, 1000.0) for name in COLUMNS}  # no wider than what is measured
        | {"controller": name, "case": f"ntm_{wind}", "seed": seed}
        | {"status": "ok", "reason": "", "events": ""}
        for name in ("pi", "policy:runs/a_long_name_of_a_run/best.npz")
        for wind in (12, 18)
        for seed in range(5)
    ]
    table = pd.DataFrame(rows)
    means, board = summary(table), leaderboard(table)
    _print_evaluation(table, means, board)
    printed = capsys.readouterr().out
    wanted = [*summary_rows(means, width or 999)[1], *leaderboard_rows(board, width or 999)[2]]
    assert_whole(printed, " ".join(" ".join(row) for row in wanted).split(), None)
    title = next(line for line in printed.splitlines() if line.startswith("2 cases"))
    assert width is None or max(len(line) for line in printed.splitlines() if line != title) <= width


def test_list_breaks_texts_between_words_and_nowhere_else(width):
    from fowt_env.controllers import CONTROLLERS, information

    printed = printed_by("list", "controllers")
    wanted = [word for name in CONTROLLERS for word in (name, CONTROLLERS[name].__doc__.split()[0])]
    assert_whole(printed, wanted, width)
    found = json.loads(printed_by("list", "controllers", "--json"))
    used = {row["name"]: row["measurements and models"].split(", ") for row in found}
    assert used == {name: list(information(name)) for name in CONTROLLERS}


def test_a_path_in_prose_is_broken_after_a_slash_and_nothing_is_lost(monkeypatch, capsys):
    rows = [["x", "see OpenFAST/r-test_of_a_long_name now"]]
    lines = lines_of(monkeypatch, capsys, 20, ["n", "source"], rows, prose=(1,))
    assert lines[2:] == ["x  see OpenFAST/", "   r-test_of_a_long_", "   name now"]


def test_a_constant_has_no_deviation_and_a_small_one_is_not_lost(monkeypatch):
    constant = 43.09355 * np.ones(4) + 7e-15 * np.array([1.0, -1.0, 1.0, 0.0])
    small = 12.1 + 1e-6 * np.array([1.0, -1.0, 1.0, -1.0])
    frame = pd.DataFrame({"GenTq_[kN-m]": constant, "RotSpeed_[rpm]": small, "GenTqLim_[-]": 0.0})
    assert 0.0 < frame["GenTq_[kN-m]"].std(ddof=0) < 1e-13
    monkeypatch.setattr(fowt_env, "simulate", lambda *a, **k: frame)
    rows = {words[0]: words[2:] for words in map(str.split, printed_by("simulate").splitlines()) if words}
    assert rows["GenTq"] == ["43.09", "0", "43.09", "43.09"]
    assert rows["RotSpeed"] == ["12.1", "1e-06", "12.1", "12.1"]


# ------------------------------------------------------------------ the writer itself


def lines_of(monkeypatch, capsys, columns, headings, rows, **options):
    monkeypatch.setenv("COLUMNS", str(columns))
    cli_tables.print_table(Console(), headings, rows, **options)
    return capsys.readouterr().out.splitlines()


def test_a_table_that_fits_has_its_headings_in_one_line(monkeypatch, capsys):
    lines = lines_of(monkeypatch, capsys, 40, ["name", "mean speed"], [["a", "1.5"], ["bcdef", "-22"]])
    assert lines == ["name   mean speed", "─" * 17, "a             1.5", "bcdef         -22"]


def test_headings_are_wrapped_before_columns_are_parted_into_blocks(monkeypatch, capsys):
    headings, rows = ["name", "mean_speed_[rpm]", "n"], [["a", "1.5", "7"]]
    lines = lines_of(monkeypatch, capsys, 14, headings, rows)
    assert lines == ["       mean", "      speed", "name  [rpm]  n", "─" * 14, "a       1.5  7"]
    lines = lines_of(monkeypatch, capsys, 12, headings, rows)
    assert lines[3:] == ["─" * 11, "a       1.5", "", "name  n", "─" * 7, "a     7"]


def test_every_block_has_the_first_columns_and_at_least_one_more(monkeypatch, capsys):
    headings, rows = list("abcd"), [["case", "name", "1.234e+05", "-0.1234"]]
    lines = lines_of(monkeypatch, capsys, 5, headings, rows, keys=2, left=(0, 1))
    assert [line.split() for line in lines if "case" in line] == [rows[0][:3], rows[0][:2] + rows[0][3:]]


def test_prose_is_broken_between_words_where_a_line_is_too_long(monkeypatch, capsys):
    rows = [["x", "one two three", "1.5"], ["y", "four", "2"]]
    lines = lines_of(monkeypatch, capsys, 18, ["n", "text", "v"], rows, prose=(1,))
    assert lines[2:] == ["x  one two  1.5", "   three", "y  four       2"]


def test_markup_in_names_is_printed_as_it_is(monkeypatch, capsys):
    lines = lines_of(monkeypatch, capsys, 40, ["[red]"], [["[bold]x[/bold]"]], title="[dim]t")
    assert lines[0] == "[dim]t" and lines[1] == "[red]" and lines[3] == "[bold]x[/bold]"


def test_whole_numbers_are_whole_and_others_have_four_digits():
    texts = [cli_tables.figure(x) for x in (1234567, np.int64(1234567), 1234.567, -0.0, float("nan"), "a")]
    assert texts == ["1234567", "1234567", "1235", "0", "nan", "a"]


def test_no_module_makes_tables_of_its_own():
    sources = [path for folder in (PACKAGE, *FOLDERS.values()) for path in folder.rglob("*.py")]
    texts = {path: path.read_text(encoding="utf-8") for path in sources}
    assert not [path for path, text in texts.items() if "rich.table" in text]
    assert not [path for path, text in texts.items() if ".to_string(" in text and path.parent.name == "cli"]
