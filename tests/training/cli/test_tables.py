"""Tables of the command line: every figure stands in full, at 80 columns and in a pipe, in every command."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from typer.testing import CliRunner

import fowt_env
from fowt_env.training.cli import app as cli
from fowt_env.training.cli import tables as cli_tables
from fowt_env.training.cli.evaluate import _print_evaluation
from fowt_env.training.cli.simulate import TRIM_CHANNELS

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


def texts_of(frame):
    """The texts of all figures of a DataFrame."""
    return [f"{value:.4g}" for value in frame.select_dtypes("number").to_numpy().ravel()]


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


# ------------------------------------------------------------------ the commands, with figures that are given


def simulate_command(monkeypatch, tmp_path):
    channels = ["Wind1VelX_[m/s]", "RotSpeed_[rpm]", "GenPwr_[kW]", "PtfmPitch_[deg]", "GenTq_[kN-m]"]
    frame = frame_of(channels, 4)
    frame["GenTqLim_[-]"] = 0.0
    monkeypatch.setattr(fowt_env, "simulate", lambda *a, **k: frame)
    wanted = [f(frame[name]) for name in channels for f in (np.mean, np.std, np.min, np.max)]
    return ["simulate"], [f"{value:.4g}" for value in wanted]


def trim_command(monkeypatch, tmp_path):
    points = frame_of(TRIM_CHANNELS, 2)
    rows = iter(points.to_dict("records"))
    monkeypatch.setattr(fowt_env, "trim", lambda *a, **k: next(rows))
    return ["trim", "--winds", "8,18"], texts_of(points)


def linearize_command(monkeypatch, tmp_path):
    from fowt_env.training.design import sweeps

    modes = frame_of(["wind_[m/s]", "period_[s]", "damping_ratio_[-]", *"abcdefgh"], 3)
    modes.insert(1, "mode", ["surge", "platform_pitch", "heave"])
    zeros = frame_of(["wind_[m/s]", "real_[rad/s]", "imag_[rad/s]"], 2)
    monkeypatch.setattr(sweeps, "models_over", lambda *a: {18.0: SimpleNamespace(pitch_rests=False)})
    monkeypatch.setattr(sweeps, "mode_table", lambda models: modes)
    monkeypatch.setattr(sweeps, "zero_table", lambda models: zeros)
    return ["linearize", "--winds", "18"], texts_of(modes) + texts_of(zeros)


def design_pi_command(monkeypatch, tmp_path):
    from fowt_env.controllers.design import pi as pi_design
    from fowt_env.training.design import sweeps

    names = ["wind_[m/s]", "blade_pitch_[deg]", "slope_[1/s2]", "KP_[s]", "KI_[-]", "omega_[rad/s]"]
    table = frame_of([*names, "zeta_[-]", "platform_zeta_[-]", "platform_omega_[rad/s]"], 3)
    found = SimpleNamespace(table=table.to_dict("records"), KP=1.0, KI=1.0, gain_schedule_pitch=1.0)
    monkeypatch.setattr(sweeps, "models_over", lambda *a: {})
    monkeypatch.setattr(pi_design, "design_pi", lambda *a: found)
    return ["design", "pi", "--winds", "18"], texts_of(table)


def design_bound_command(monkeypatch, tmp_path):
    from fowt_env.training.design import linear_bound

    names = ["speed_ratio_[-]", "pitch_ratio_[-]", "travel_ratio_[-]", "power_ratio_[-]", "torque_std_[%]"]
    table = frame_of(["wind_[m/s]", "share_[-]", *names, "RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]"], 5)
    table.insert(1, "information", list(linear_bound.INFORMATION)[:1] * 5)
    monkeypatch.setattr(linear_bound, "bound_table", lambda *a, **k: table)
    return ["design", "bound", "--wind", "18"], texts_of(table)


def design_front_command(monkeypatch, tmp_path):
    from fowt_env.files import tables
    from fowt_env.training.design import linear_bound

    table = frame_of(["wind_[m/s]", *linear_bound.RATIOS, "of_bound_[-]", "of_measured_[-]"], 3)
    table.insert(1, "variant", ["{'pitch_rate': 8.0}", "{'pitch_rate': 80.0}", "default"])
    monkeypatch.setattr(tables, "read_table", lambda path: table)
    monkeypatch.setattr(linear_bound, "ratio_table", lambda *a: table)
    return ["design", "front", "--runs", "a.csv", "--bound", "b.csv"], texts_of(table)


def design_lqr_command(monkeypatch, tmp_path):
    from fowt_env.training.design import sweeps

    table = frame_of(sweeps.SHOWN, 2, case=["ntm_18"] * 2, variant=["gspi_oc3", "{'pitch_rate': 8.0}"])
    monkeypatch.setattr(sweeps, "sweep", lambda *a, **k: table)
    return ["design", "lqr-sweep"], texts_of(table)


def validate_command(monkeypatch, tmp_path):
    from fowt_env.training.validation import comparison, validate
    from fowt_env.training.validation import report as validation_report

    study = comparison.Study()
    for number in range(123):
        study.add(
            "second harmonic, position instantaneous, surface instantaneous" * 2, str(number), "m", 1, 1
        )
    monkeypatch.setattr(validate, "validate_cases", lambda *a, **k: study)
    monkeypatch.setattr(validation_report, "write_validation_report", lambda *a: [])
    return ["validate"], ["123", "reported"]


def paper_command(monkeypatch, tmp_path):
    from fowt_env.training.studies.paper import load_cases
    from fowt_env.training.studies.paper import report as paper_report

    table = frame_of(["mean", "std", "min", "max"], 2, case=["LC5"] * 2)
    table.insert(1, "channel", ["PtfmSurge_[m]", "PtfmPitch_[deg]"])
    monkeypatch.setattr(load_cases, "run_paper", lambda *a: SimpleNamespace(runs=[1], claims=[]))
    monkeypatch.setattr(load_cases, "statistics", lambda runs: table)
    monkeypatch.setattr(paper_report, "write_paper_report", lambda *a: [])
    return ["paper", "LC5"], texts_of(table)


def benchmark_speed_command(monkeypatch, tmp_path):
    from fowt_env.training.benchmarks import speed as benchmark

    kinds = list(benchmark.TIMED_SCENES)[:8]
    table = frame_of(["step_us", "loop_us", "simulate_x", "seconds"], 8, kind=kinds, absent=[""] * 8)
    monkeypatch.setattr(benchmark, "speed", lambda *a, **k: table)
    return ["benchmark", "speed", "--out", str(tmp_path / "speed.csv")], texts_of(table)


def benchmark_accuracy_command(monkeypatch, tmp_path):
    from fowt_env.training.benchmarks import accuracy as benchmark_accuracy

    name = "rotor as a table, midpoint, 0.05 s, waves by bands, one call in two, and more words of this kind"
    row = {"variant": name, "worst": 0.0123, "worst_of": "PtfmPitch_[deg]", "front": True}
    row |= {"real_time_factor": 30412.4, "kernel_factor": 123456.4}
    monkeypatch.setattr(benchmark_accuracy, "accuracy", lambda *a, **k: None)
    monkeypatch.setattr(benchmark_accuracy, "accuracy_summary", lambda table: pd.DataFrame([row]))
    return ["benchmark", "accuracy", "--no-plot"], ["0.0123", "30412", "123456"]


def benchmark_evaluation_command(monkeypatch, tmp_path):
    from fowt_env.training.benchmarks import evaluation as benchmark_evaluation

    table = frame_of([f"a_rather_long_name_{i}_ms" for i in range(9)], 2, case=["ntm_18", "ntm_20"])
    table["runs"] = [1234567, 3]
    monkeypatch.setattr(benchmark_evaluation, "evaluation_cost", lambda *a: table)
    words = ["benchmark", "evaluation", "--out", str(tmp_path / "e.csv")]
    return words, [*texts_of(table.drop(columns="runs")), "1234567"]


COMMANDS = (
    simulate_command, trim_command, linearize_command, design_pi_command, design_bound_command,
    design_front_command, design_lqr_command, validate_command, paper_command, benchmark_speed_command,
    benchmark_accuracy_command, benchmark_evaluation_command,
)  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.__name__)
def test_a_command_prints_every_figure_in_full(command, width, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    words, wanted = command(monkeypatch, tmp_path)
    long_text = command in (validate_command, benchmark_accuracy_command)  # wider than any terminal by itself
    assert_whole(printed_by(*words), wanted, None if long_text else width)


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
    sources = Path(fowt_env.__file__).parent.rglob("*.py")
    assert not [path.name for path in sources if "rich.table" in path.read_text(encoding="utf-8")]
