"""Tables of the command line: every figure stands in full, at 80 columns and in a pipe."""

import json

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import fowt_env
from fowt_env.display import number_text
from fowt_env.training.cli import app as cli
from fowt_env.training.cli import tables
from fowt_env.training.cli.simulate import _print_channels


@pytest.fixture(params=[80, None], ids=["80 columns", "a pipe"])
def width(request, monkeypatch):
    """80, or None for a pipe: what the tables of this test are printed to."""
    monkeypatch.delenv("COLUMNS", raising=False)
    if request.param:
        monkeypatch.setenv("COLUMNS", str(request.param))
    return request.param


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


def test_a_frame_is_printed_with_every_figure_in_full(width, capsys):
    rng = np.random.default_rng(1)  # of figures that take long to write: -0.01234, -567800
    values = -rng.uniform(1.0, 9.0, (3, 11)) * 10.0 ** rng.integers(-3, 6, (3, 11))
    frame = pd.DataFrame(values, columns=["wind_[m/s]", "period_[s]", "damping_ratio_[-]", *"abcdefgh"])
    frame.insert(1, "mode", ["surge", "platform_pitch", "heave"])
    frame["runs"] = [1234567, 3, 4]
    tables.show(frame, "modes")
    wanted = [np.format_float_positional(float(f"{value:.4g}"), trim="-") for value in values.ravel()]
    assert_whole(capsys.readouterr().out, [*wanted, "1234567", *frame["mode"]], width)


def test_list_breaks_texts_between_words_and_nowhere_else(width):
    from fowt_env.controllers import CONTROLLERS, information

    printed = printed_by("list", "controllers")
    wanted = [word for name in CONTROLLERS for word in (name, CONTROLLERS[name].__doc__.split()[0])]
    assert_whole(printed, wanted, width)
    found = json.loads(printed_by("list", "controllers", "--json"))
    used = {row["name"]: row["measurements and models"].split(", ") for row in found}
    assert used == {name: list(information(name)) for name in CONTROLLERS}


def test_a_constant_has_no_deviation_and_a_small_one_is_not_lost(monkeypatch):
    constant = 43.09355 * np.ones(4) + 7e-15 * np.array([1.0, -1.0, 1.0, 0.0])
    small = 12.1 + 1e-6 * np.array([1.0, -1.0, 1.0, -1.0])
    frame = pd.DataFrame({"GenTq_[kN-m]": constant, "RotSpeed_[rpm]": small, "GenTqLim_[-]": 0.0})
    assert 0.0 < frame["GenTq_[kN-m]"].std(ddof=0) < 1e-13
    monkeypatch.setattr(fowt_env, "simulate", lambda *a, **k: frame)
    rows = {words[0]: words[2:] for words in map(str.split, printed_by("simulate").splitlines()) if words}
    assert rows["GenTq"] == ["43.09", "0", "43.09", "43.09"]
    assert rows["RotSpeed"] == ["12.1", "1e-06", "12.1", "12.1"]


HEADINGS, ROWS = ["name", "mean_speed_[rpm]", "n"], [["a", 1.5, 7]]


@pytest.mark.parametrize(
    ("columns", "headings", "rows", "options", "expected"),
    [
        (  # headings are in one line where they fit, are wrapped, and then columns are parted into blocks
            *(40, ["name", "mean speed"], [["a", 1.5], ["bcdef", -22]], {}),
            ["name   mean speed", "─" * 17, "a             1.5", "bcdef         -22"],
        ),
        (
            14,
            HEADINGS,
            ROWS,
            {},
            ["       mean", "      speed", "name  [rpm]  n", "─" * 14, "a       1.5  7"],
        ),
        (
            *(12, HEADINGS, ROWS, {}),
            [
                "       mean",
                "      speed",
                "name  [rpm]",
                "─" * 11,
                "a       1.5",
                "",
                "name  n",
                "─" * 7,
                "a     7",
            ],
        ),
        (  # every block has the first columns and at least one more
            *(5, list("abc"), [["case", "name", "-0.1234"]], {"keys": 2, "left": (0, 1)}),
            ["a     b           c", "─" * 19, "case  name  -0.1234"],
        ),
        (  # prose is broken between words
            *(18, ["n", "text", "v"], [["x", "one two three", 1.5], ["y", "four", 2]], {"prose": (1,)}),
            ["n  text          v", "─" * 18, "x  one two     1.5", "   three", "y  four          2"],
        ),
        (
            40,
            ["[red]"],
            [["[bold]x[/bold]"]],
            {"title": "[dim]t"},
            ["[dim]t", "[red]", "─" * 14, "[bold]x[/bold]"],
        ),
    ],
)
def test_a_table_is_fitted_to_the_terminal(columns, headings, rows, options, expected, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(columns))
    tables.print_table(headings, rows, **options)
    assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == expected


def test_whole_numbers_are_whole_and_others_have_four_digits():
    assert [number_text(x) for x in (19792.4, -198650.0, 1.5e9, 1e5)] == [
        "19790",
        "-198600",
        "1.5e+09",
        "100000",
    ]
    texts = [number_text(x) for x in (1234567, np.int64(1234567), 1234.567, -0.0, float("nan"), "a")]
    assert texts == ["1234567", "1234567", "1235", "0", "nan", "a"]


def test_rounding_errors_in_the_statistics_of_a_run_are_printed_as_zero(capsys):
    run = pd.DataFrame({"BldPitch1_[deg]": [4.4e-10, 8.0], "GenTq_[kN-m]": [43.1, 43.1 + 1e-12]})
    _print_channels(run, "run")
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["BldPitch1", "[deg]", "4", "4", "0", "8"] in rows
    assert ["GenTq", "[kN-m]", "43.1", "0", "43.1", "43.1"] in rows
