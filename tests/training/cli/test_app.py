import json
import re
import shlex
import subprocess
import sys
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
import typer
from command_line import fowt
from typer.testing import CliRunner

import fowt_env
from fowt_env.descriptions.checks import parse_numbers
from fowt_env.descriptions.sea_state import sea_of
from fowt_env.descriptions.wind import wind_of
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.training.cli import console
from fowt_env.training.cli.app import app
from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.cli.console import GROUPS, output

SHORT = ("--duration", "10", "--wind", "18")


@pytest.mark.installation
def test_simulate_prints_statistics_and_writes_what_simulate_returns(tmp_path):
    out, plot = tmp_path / "run.csv", tmp_path / "run.png"
    stdout, stderr = fowt("simulate", *SHORT, "--seed", "4", "--out", str(out), "--plot", str(plot))
    assert "PtfmPitch [deg]" in stdout and "run.csv" in stderr
    scene = fowt_env.build_scene("oc3_hywind", wind=18.0, sea=None, seed=4, fidelity="standard")
    expected = fowt_env.simulate(scene, controller="pi", duration=10.0)
    np.testing.assert_allclose(pd.read_csv(out), expected, rtol=1e-9, atol=1e-12)
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_a_plot_of_an_unknown_kind_is_refused_before_the_run(monkeypatch):
    monkeypatch.setattr(fowt_env, "simulate", Mock())
    done = CliRunner().invoke(app, ["simulate", *SHORT, "--plot", "run.xyz"])
    assert done.exit_code == 2 and "unknown extension" in done.output
    assert not fowt_env.simulate.called


def test_a_run_at_the_generator_s_limits_or_past_the_overspeed_says_so(tmp_path, monkeypatch):
    (tmp_path / "runaway.py").write_text(
        "class Off:\n    def reset(self, m): pass\n    def act(self, m): return 0.0, 0.0\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    stderr = fowt("simulate", "--wind", "18", "--duration", "20", "--controller", "runaway:Off")[1]
    assert "rate limit for 13.9 % of the run" in stderr  # 28 of 201 rows: from 43.1 kN m to zero
    assert "above the turbine's overspeed of 15.73 rpm" in stderr
    quiet = fowt("simulate", *SHORT)[1]
    assert "overspeed" not in quiet and "rate limit" not in quiet


def test_a_run_with_harmful_rare_events_says_so_in_one_line():
    arguments = ["simulate", "--wind", "none", "--controller", "none", "--start", "zero", "--duration", "1"]
    quiet = fowt(*arguments, "--initial", "PtfmHeave=-60")  # under water: counted, and as accurate as ever
    assert "Warning" not in quiet[1]
    arguments = ["simulate", "--wind", "10", "--controller", "none", "--fidelity", "fast", "--duration", "1"]
    result = fowt(*arguments, "--initial", "PtfmRVzi=10")
    (line,) = (line for line in result[1].splitlines() if line.startswith("Warning"))
    assert line.startswith("Warning: oc3_hywind: ROTOR_TABLE_CLAMPED") and line.endswith("fast yaw")


def test_initial_values_a_locked_rotor_and_a_wind_series_reach_the_run(tmp_path):
    out, series = tmp_path / "run.csv", tmp_path / "wind.csv"
    words = "simulate --wind none --controller none --start zero --duration 5 --initial PtfmSurge=10 --out"
    fowt(*words.split(), str(out))
    frame = pd.read_csv(out)
    assert frame["PtfmSurge_[m]"].iloc[0] == 10.0
    assert (frame["RotSpeed_[rpm]"] == 0.0).all()
    series.write_text("time,speed\n0,15\n10,17\n")
    fowt("simulate", "--wind", str(series), "--duration", "10", "--out", str(out))
    frame = pd.read_csv(out)
    np.testing.assert_allclose(frame["Wind1VelX_[m/s]"], 15.0 + 0.2 * frame["Time_[s]"], rtol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("simulate", "--windd", "18"), ""),
        (("simulate", "--platform", "oc3_hywnd"), "oc3_hywind"),
        (("simulate", "--platform", "no/such/file.toml"), "no/such/file.toml"),
        (("simulate", "--wind", "breezy"), "breezy"),
        (("simulate", "--wind", "missing.csv"), "missing.csv"),
        (("simulate", "--wind", "{broken"), "JSON"),
        (("simulate", "--wind", "-3"), "-3"),
        (("simulate", "--sea", "jonswap:x:10"), "jonswap"),
        (("simulate", "--sea", "paper_wnd_wave"), "paper_wind_wave"),
        (("simulate", "--controller", "pie"), "'pi'"),
        (("simulate", "--dt", "0.03"), "0.03"),
        (("simulate", "--initial", "PtfmSurge"), "KEY=VALUE"),
        (("simulate", "--option", "surfac=swl"), "surface"),
        (("simulate", "--rotor", "bemm"), "bem"),
        (("simulate", "--out", "run.xls"), "run.xls"),
        (("evaluate", "--cases", "above_ratted"), "above_rated"),
        (("evaluate", "--cases", "ntm_81"), "'ntm_8'? Nearest of"),
        (("evaluate", "--suite", "above_ratted"), "above_rated"),
        (("evaluate", "--suite", "above_rated", "--cases", "ntm_13"), "ntm_12"),
        (("evaluate", "--controllers", "pie"), "'pi'"),
        (("evaluate", "--controllers", "pi", "--baseline", "pi_lnd"), "pi"),
        (("evaluate", "--engine", "rai"), "ray"),
        (("evaluate", "--seeds", "1.5"), "whole numbers"),
        (("evaluate", "--skip", "700"), "skip = 700"),
        (("model", "trim", "--winds", "24:4:1"), "START:STOP[:STEP]"),
        (("model", "trim", "--winds", ""), "winds"),
        (("list", "platfroms"), "platforms"),
    ],
)
def test_a_user_error_is_one_clear_line_and_exit_code_2(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, stderr = fowt(*arguments, code=2)
    line = stderr.strip().splitlines()[-1]
    assert (line.startswith("Error:") or not message) and message in line
    assert not [path for path in tmp_path.rglob("*") if path.suffix in (".csv", ".parquet", ".xls")]


def test_a_stopped_run_gives_its_reason_and_its_rows_and_an_interrupted_one_no_file(tmp_path, monkeypatch):
    rows = pd.DataFrame({"Time_[s]": [0.0, 0.1], "PtfmPitch_[deg]": [0.5, 89.5]})
    stopped = SimulationStopped("stopped at t = 0.100 s: capsize", "capsize", 0.1, rows)
    for error, code, said in ((KeyboardInterrupt, 130, "interrupted"), (stopped, 1, "capsize")):
        monkeypatch.setattr(fowt_env, "simulate", Mock(side_effect=error))
        _, stderr = fowt("simulate", *SHORT, "--out", str(tmp_path / "run.csv"), code=code)
        assert said in stderr and (tmp_path / "run.csv").exists() is (code == 1)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "run.csv"), rows)


def test_an_interrupted_evaluation_says_where_its_rows_are(tmp_path, monkeypatch):
    import fowt_env.training.evaluation.evaluate

    real, calls = fowt_env.training.evaluation.evaluate.score, []

    def second_is_interrupted(run):
        calls.append(run)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(run)

    monkeypatch.setattr(fowt_env.training.evaluation.evaluate, "score", second_is_interrupted)
    words = "evaluate --cases steady_16 --seeds 1,2 --duration 10 --skip 2 --out"
    _, stderr = fowt(*words.split(), str(tmp_path), code=130)
    assert "1 finished" in stderr
    assert len(pd.read_csv(tmp_path / "results.csv")) == 1


@pytest.mark.installation
def test_evaluate_writes_table_runs_and_plots(tmp_path):
    words = "evaluate --controllers pi,pi_land --cases steady_16,ntm_18 --duration 15 --skip 5 --out"
    stdout, _ = fowt(*words.split(), str(tmp_path))
    assert "pi_land" in stdout and "ntm_18" in stdout
    assert "tension" in stdout and "…" not in stdout  # piped output keeps every column whole
    table = pd.read_csv(tmp_path / "results.csv")
    assert table[["controller", "case"]].values.tolist() == [
        ["pi", "steady_16"], ["pi_land", "steady_16"], ["pi", "ntm_18"], ["pi_land", "ntm_18"],
    ]  # fmt: skip
    assert (table["status"] == "ok").all() and len(pd.read_csv(tmp_path / "summary.csv")) == 4
    pictures = sorted(path.name for path in tmp_path.glob("*.png"))
    assert pictures == [
        "boxes.png", "metrics.png", "pareto.png", "spectra_ntm_18.png", "spectra_steady_16.png",
        "timeseries_ntm_18.png", "timeseries_steady_16.png", "trade.png",
    ]  # fmt: skip
    assert all(path.stat().st_size > 10_000 for path in tmp_path.glob("*.png"))
    assert len(list((tmp_path / "runs").rglob("*.parquet"))) == 4


BREAKS_DOWN = """
class BreaksDown:
    def reset(self, measurement):
        self.command = measurement.generator_torque, measurement.blade_pitch
    def act(self, measurement):
        if measurement.time > 8.0:
            raise ZeroDivisionError("it broke down")
        return self.command
class Degrees(BreaksDown):
    def act(self, measurement):
        return self.command[0], 57.3 * self.command[1]
class Unmade(BreaksDown):
    def __init__(self):
        self.gain = 1.0 + "a"  # Unmade
class Unprepared(BreaksDown):
    def prepare(self, scene):
        self.rated = scene.turbine.rated_sped  # Unprepared
class Misread(BreaksDown):
    def act(self, measurement):
        return 0.0, measurement.generator_sped  # Misread
"""


@pytest.fixture
def laws(tmp_path, monkeypatch):
    """The source of laws that break down, in the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken_law.py").write_text(BREAKS_DOWN)
    monkeypatch.delitem(sys.modules, "broken_law", raising=False)


@pytest.mark.nightly
def test_evaluate_says_which_runs_failed_and_why_and_scores_the_others(tmp_path, laws):
    words = "evaluate --controllers pi,broken_law:BreaksDown,broken_law:Degrees --cases ntm_18 --seeds 1,2,3"
    stdout, stderr = fowt(*words.split(), "--duration", "15", "--skip", "5", "--out", "out")
    assert "failed: broken_law:BreaksDown, ntm_18, seed 1: " in stderr and "it broke down" in stderr
    assert "0/3" in stdout and "3/3" in stdout
    assert stderr.count("controller 'broken_law:Degrees': commanded blade pitch") == 1
    table = pd.read_csv(tmp_path / "out" / "results.csv").set_index("controller")
    assert table["status"]["broken_law:BreaksDown"].tolist() == ["failed"] * 3
    assert table["status"]["pi"].tolist() == ["ok"] * 3 and (table["RotSpeed_mean_[rpm]"]["pi"] > 5.0).all()
    for name in ("pareto", "metrics", "boxes", "timeseries_ntm_18", "spectra_ntm_18"):
        assert (tmp_path / "out" / f"{name}.png").is_file()


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("Unmade", "raised TypeError when it was made, broken_law.py line {}: unsupported operand"),
        ("Unprepared", "raised AttributeError in prepare(), broken_law.py line {}: "),
        (
            "Misread",
            "raised AttributeError in act() at t = 0.000 s, broken_law.py line {}: a measurement has",
        ),
    ],
)
def test_an_error_in_a_law_is_one_line_with_its_place_in_simulate_and_in_evaluate(law, words, laws):
    line = 1 + next(i for i, text in enumerate(BREAKS_DOWN.split("\n")) if f"# {law}" in text)
    said = f"controller 'broken_law:{law}' {words.format(line)}"
    calm = ("--duration", "5", "--out")
    _, stderr = fowt("simulate", "--controller", f"broken_law:{law}", "--wind", "16", *calm, "x.csv", code=1)
    assert said in stderr and "Traceback" not in stderr
    words = ("--controllers", f"broken_law:{law}", "--cases", "steady_16", "--skip", "1", "--no-plot")
    _, stderr = fowt("evaluate", *words, *calm, "out")
    assert said in stderr


def test_a_law_whose_module_cannot_be_read_is_one_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "unreadable_law.py").write_text("import math\nx = mth.pi\n")
    _, stderr = fowt("simulate", "--controller", "unreadable_law:Law", "--duration", "5", code=1)
    assert "raised NameError when it was imported, unreadable_law.py line 2: name 'mth'" in stderr


def test_evaluate_without_matplotlib_has_its_tables_and_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    words = ("--controllers", "pi", "--cases", "steady_16", "--duration", "15", "--skip", "5")
    _, stderr = fowt("evaluate", *words, "--out", str(tmp_path))
    assert "no plots: " in stderr and 'pip install "fowt-env[plot]"' in stderr
    assert len(pd.read_csv(tmp_path / "results.csv")) == 1


def test_evaluate_takes_a_suite_of_the_users_own_compares_and_resumes(tmp_path):
    suite = tmp_path / "mine.toml"
    suite.write_text(
        'version = 2\ndescription = "d"\nsource = "s"\nwind = "rotor-averaged"\nseeds = [1, 2, 3]\n'
        'duration = 15.0\nskip = 5.0\n[[case]]\nname = "gusty"\nwind = {kind = "ntm", speed = 18.0}\n'
    )
    out = tmp_path / "out"
    words = f"evaluate --controllers pi,pi_land --no-plot --suite {suite} --out {out}"
    arguments = words.split()
    stdout, _ = fowt(*arguments)
    assert "suite mine 2" in stdout and "difference from pi" in stdout
    assert stdout.count("3 seeds: no interval") == 1
    board = json.loads((out / "leaderboard.json").read_text())
    assert board["suite"]["version"] == 2 and board["seeds"] == [1, 2, 3] and board["baseline"] == "pi"
    assert [entry["controller"] for entry in board["controllers"]] == ["pi", "pi_land"]
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}
    assert len(before) == 6
    again, _ = fowt(*arguments, "--baseline", "pi_land")
    assert "difference from pi_land" in again
    assert before == {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}
    _, stderr = fowt(*arguments, "--duration", "20", code=2)
    assert "--out" in stderr


def test_trim_prints_the_operating_points_of_trim(tmp_path):
    out = tmp_path / "steady.csv"
    stdout, _ = fowt("model", "trim", "--winds", "8,18", "--out", str(out))
    assert "RotThrust" in stdout
    table = pd.read_csv(out)
    assert table["Wind_[m/s]"].tolist() == [8.0, 18.0]
    point = fowt_env.trim(fowt_env.build_scene("oc3_hywind", wind=18.0), platform="floating")
    assert table["RotThrust_[kN]"][1] == pytest.approx(point["RotThrust"], rel=1e-9)


@pytest.mark.installation
def test_list_names_everything_that_the_other_commands_take():
    assert fowt("--version")[0].strip() == fowt_env.__version__
    stdout, _ = fowt("list")
    assert "platforms" in stdout and "--platform" in stdout
    stdout, _ = fowt("list", "all")
    for name in ("oc3_hywind", "paper_wind_wave", "pi_land", "above_rated", "ntm_18"):
        assert name in stdout
    assert "oc3_hywind" not in fowt("list", "controllers")[0]


@pytest.mark.installation
def test_every_command_has_examples_that_can_be_parsed():
    root = typer.main.get_command(app)
    commands, missing, seen = [("fowt", root)], [], 0
    while commands:
        name, command = commands.pop()
        inner = getattr(command, "commands", {})
        commands += [(f"{name} {key}", each) for key, each in inner.items() if not each.hidden]
        examples = re.findall(r"\[cyan\](fowt .*?)\[/cyan\]", command.epilog or "", re.S)
        if not inner and not examples:
            missing.append(name)
        assert not re.search(r"[^\n]\n[^\n]", f"{command.help}\n\n{command.epilog or ''}"), name  # wraps
        for example in examples:
            words, called = shlex.split(example)[1:], root
            while hasattr(called, "commands"):
                called = called.commands[words.pop(0)]
            called.make_context(called.name, words)  # raises where an option or argument is none
            seen += 1
    assert not missing and seen > 60


def test_help_fits_one_screen_and_has_every_command_in_a_group():
    result = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80", "NO_COLOR": "1"})
    lines = result.stdout.splitlines()
    assert len(lines) <= 38 and max(map(len, lines)) <= 80
    heads = ("fowt ", " ", *(f"{group} " for group in GROUPS))
    assert all(not line or line.startswith(heads) for line in lines)  # no description wraps
    root = typer.main.get_command(app)
    grouped = [name for names in GROUPS.values() for name in names]
    assert len(set(grouped)) == len(grouped) and set(root.commands) <= set(grouped)
    listed = [re.search(rf"(^| ) {name}  ", result.stdout, re.M) for name in root.commands]
    assert all(listed)


def test_fewer_than_twenty_commands_are_at_the_first_level_and_fowt_alone_says_what_is_next():
    assert len(typer.main.get_command(app).commands) < 20
    stdout, _ = fowt()
    lines = stdout.splitlines()
    assert len(lines) <= 8 and all(line.startswith("fowt ") for line in lines[:-1])
    assert "fowt simulate" in lines[0] and "fowt --help" in stdout and "fowt warmup" in stdout


@pytest.mark.parametrize(("former", "present"), console.MOVED.items())
def test_a_former_name_of_a_command_is_answered_with_its_present_one(former, present):
    stdout, stderr = fowt(*former.split(), "--out", "x.csv", code=2)
    assert f"fowt {former} is now called fowt {present}" in " ".join(stderr.split()) and stdout == ""
    fowt(*present.split(), "--help")


def test_what_reads_only_the_first_lines_of_a_list_is_no_error():
    code = "import sys; from fowt_env.training.cli.app import main; main()"
    command = f"{shlex.quote(sys.executable)} -c '{code}' list metrics | head -1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.stdout.startswith("metrics") and "Error" not in done.stderr


# ------------------------------------------------------------------ where files go


@pytest.mark.parametrize(
    "words",
    [
        ("simulate", "--duration", "1", "--plot", "{}/new/run.png"),
        ("simulate", "--duration", "1", "--out", "{}/new/run.csv"),
        ("model", "trim", "--winds", "18", "--out", "{}/new/trim.csv"),
        ("model", "linearize", "--winds", "18", "--out", "{}/new/deeper"),
        ("design", "bound", "--wind", "18", "--plot", "{}/new/bound.png"),
        ("evaluate", "--controllers", "pi", "--cases", "steady_16", "--out", "{}/new/deeper"),
        ("connect", "export-policy", "run", "--out", "{}/new/p.npz"),
        ("dev", "animate", "{}/new/gust.gif"),
    ],
)
def test_no_folder_is_made_outside_of_the_working_folder(words, tmp_path, monkeypatch):
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    _, stderr = fowt(*(word.format(tmp_path) for word in words), code=2)
    assert f"there is no folder '{tmp_path}/new'; create it first" in stderr
    assert [path.name for path in tmp_path.iterdir()] == ["work"] and not list((tmp_path / "work").iterdir())


def test_a_folder_made_in_the_working_folder_is_announced(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, stderr = fowt("simulate", "--duration", "1", "--out", "a/b/run.csv")
    assert "created the folder a/b" in stderr and len(pd.read_csv("a/b/run.csv")) == 11
    assert "created the folder" not in fowt("simulate", "--duration", "1", "--out", "a/b/run.csv")[1]
    _, stderr = fowt("evaluate", "--controllers", "pie", "--out", "c", code=2)
    assert "created the folder" not in stderr
    assert output(str(tmp_path.parent / "results"), folder=True)  # the last part may be new anywhere
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"--out 'file/run.csv': cannot be written: 'file' is a file"):
        output("file/run.csv")


def test_without_a_terminal_progress_is_a_line_now_and_then(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 11.0, 12.0, 25.0])
    monkeypatch.setattr(console.time, "monotonic", lambda: next(clock))
    with console.progress_bar("training", None, every=10.0) as update:
        for done in (1, 2, 3, 4):
            update(done, 8, f"step {done}")
    assert capsys.readouterr().err.splitlines() == ["11 s, 25 %: step 2", "25 s, 50 %: step 4"]


# ------------------------------------------------------------------ what users type


@pytest.mark.parametrize(
    ("parse", "text", "expected"),
    [
        (wind_of, "18", 18.0),
        (wind_of, "0", 0.0),
        (wind_of, "none", None),
        (wind_of, "ntm:18:B", {"kind": "ntm", "speed": 18.0, "class": "B"}),
        (wind_of, "eog:11.4", {"kind": "eog", "speed": 11.4}),
        (wind_of, '{"kind": "steady", "speed": 9}', {"kind": "steady", "speed": 9}),
        (sea_of, "none", None),
        (sea_of, "paper_wind_wave", "paper_wind_wave"),
        (sea_of, "jonswap:7.5:10:3.3", {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0, "gamma": 3.3}),
        (sea_of, "regular:3:5", {"kind": "regular", "H": 3.0, "T": 5.0}),
        (sea_of, '{"kind": "still"}', {"kind": "still"}),
    ],
)
def test_winds_and_seas_are_read_from_texts(parse, text, expected):
    assert parse(text) == expected


@pytest.mark.parametrize("text", ["nan", "inf", "", "ntm", "ntm:fast", "ntm:18:B:1", "18 m/s"])
def test_wind_texts_that_mean_nothing_are_refused(text):
    with pytest.raises(InputError, match="wind"):
        wind_of(text)


def test_a_wind_series_needs_two_columns_of_numbers(tmp_path):
    path = tmp_path / "wind.csv"
    refused = {
        "a,b,c\n1,2,3\n": "it has a, b, c",
        "time,speed\n0,9\n1,fast\n": "speed = 'fast' in row 2: both columns must hold numbers only",
        "time\n1\n": "needs columns time and speed",
    }
    for content, words in refused.items():
        path.write_text(content)
        with pytest.raises(InputError, match=f"wind series.*{words}"):
            wind_of(str(path))


def test_numbers_and_pairs():
    assert parse_numbers("4:24:0.1", "winds")[-1] == pytest.approx(24.0)
    assert parse_numbers("8,11.4", "winds") == [8.0, 11.4]
    assert parse_numbers("1:4", "seeds") == [1.0, 2.0, 3.0, 4.0]
    pairs = {"a": 1.5, "b": True, "c": "swl", "d": "x=y"}
    assert parse_pairs(["a=1.5", "b=true", "c=swl", "d=x=y"], "option") == pairs
    for text in ("", "a", "1:", "1:2:", "1:2:3:4", "1:2:0", "2:1:1", "0:1:1e-9"):
        with pytest.raises(InputError):
            parse_numbers(text, "winds")
