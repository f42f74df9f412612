"""The commands of scores: what they print and write, and clear refusals."""

import pandas as pd
import pytest
from typer.testing import CliRunner

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")

from fowt_env.files.tables import write_table  # noqa: E402
from fowt_env.training.cli.app import app  # noqa: E402
from fowt_env.training.cli.console import EXIT_INPUT
from fowt_env.training.evaluation.evaluate import COLUMNS  # noqa: E402
from fowt_env.training.reports.scores import FIGURES  # noqa: E402


def call(*arguments):
    return CliRunner().invoke(app, ["dev", "scores", *map(str, arguments)])


@pytest.fixture
def results(tmp_path):
    """A results folder of gspi_oc3 and two agents at 0.7 and 0.75 of its every figure."""
    rows = []
    for case in ("ntm_14", "ntm_18"):
        for seed in (1, 2, 3, 4):
            for name, ratio in (("gspi_oc3", 1.0), ("a", 0.7), ("b", 0.75)):
                row = dict.fromkeys(COLUMNS, 0.0) | {"controller": name, "case": case, "seed": seed}
                row |= {"weight_[-]": float("nan"), "status": "ok"}
                rows.append(row | {figure.metric: ratio * (1.0 + seed) for figure in FIGURES})
    write_table(pd.DataFrame(rows, columns=list(COLUMNS)), tmp_path / "results.csv")
    return tmp_path


def test_rivals_prints_the_table_that_it_writes(results):
    done = call("baselines", results, "--against", "gspi_oc3", "--group", "g=a,b", "--out", results / "s")
    assert done.exit_code == 0, done.output
    assert "| rotor-speed std | 0.725 first |" in done.output and "| `g` |  | 16 | 0 |" in done.output
    assert done.output.count("No interval: ") == 1  # of two training seeds
    assert (results / "s.md").read_text().strip() in done.output
    table = pd.read_csv(results / "s.csv")
    assert set(table["agent"]) == {"g"} and (table["ratio"] - 0.725).abs().max() < 1e-12
    assert list(pd.read_csv(results / "s_counts.csv")["agent"]) == ["g", "gspi_oc3"]


def test_cases_scores_each_kind_and_bound_draws_its_picture(results):
    done = call("cases", results, "--figures", "power std")
    assert done.exit_code == 0 and "| ntm | 0.700 [0.700, 0.700] | 0.750 [0.750, 0.750] |" in done.output
    done = call("bound", results, "--plot", results / "bound.png")
    assert done.exit_code == 0, done.output
    assert "| fraction of the performance limit | limit | 14 m/s | 18 m/s |" in done.output
    assert (results / "bound.png").stat().st_size > 10_000


def test_gust_draws_its_picture_of_each_controller(tmp_path):
    words = ("--controllers", "pi,gspi_oc3", "--wind", "18", "--sea", "none", "--start", "2", "--end", "10")
    done = call("gust", tmp_path / "gust.png", *words)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "gust.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("baselines", "{}", "--against", "gspi"), "unknown controller of the evaluation 'gspi'"),
        (("baselines", "{}", "--group", "g"), "must be NAME=LABEL,LABEL"),
        (("baselines", "{}", "--group", "g=a", "--group", "g=b"), "used twice"),
        (("baselines", "nowhere"), "results 'nowhere' does not exist"),
        (("cases", "{}", "--figures", "power"), "unknown figure 'power'"),
        (("bound", "{}", "--bound", "nowhere.csv"), "no such file"),
        (("gust", "x.png", "--start", "300"), "start = 300 s"),
    ],
)
def test_what_cannot_be_scored_is_refused_with_its_reason(results, arguments, message):
    done = call(*(word.format(results) for word in arguments))
    assert done.exit_code == EXIT_INPUT and message in done.output
