"""The command fowt loads: the matrix first, a small table from end to end, and bad options."""

import re

import pytest
from command_line import fowt
from small_deck import write_deck

from fowt_env.files.tables import read_table
from fowt_env.training.loads.records import read_run
from fowt_env.training.loads.site import FOLDER

SHORT = ("--seeds", "1", "--hours", "0.05", "--wind", "rotor-averaged", "--controllers", "pi,pi_land")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The path of a site with 20 s of transient and one bin for each 2 m/s."""
    text = (FOLDER / "norway_5.toml").read_text(encoding="utf-8")
    path = tmp_path_factory.mktemp("site") / "short.toml"
    path.write_text(text.replace("[design]", "[design]\ntransient = 20.0"), encoding="utf-8")
    return str(path)


def test_a_dry_run_prints_the_matrix_what_is_left_out_and_the_time(tmp_path, site):
    folder = tmp_path / "out"
    text, _ = fowt("loads", "--site", site, *SHORT, "--dlc", "1.3,2.5,6.3", "--dry-run", "--out", str(folder))
    assert re.search(r"1\.3 +Production, extreme turbulence +ultimate +1\.35 +11 +22 +1\.2", text)
    assert re.search(
        r"6\.3 +Parked, 1-year wind and sea, extreme yaw error +ultimate +1\.35 +5 +5 +0\.3", text
    )
    assert "No model of converter and grid voltage." in text
    assert "27 runs, 2 h simulated" in text
    assert re.search(
        r"expected: \d+ s with 1 process \(times real time: pi [\d,]+, pi_land [\d,]+, parked", text
    )
    assert not folder.exists()


def test_a_table_of_two_controllers_is_run_from_end_to_end(tmp_path, site):
    folder = tmp_path / "out"
    arguments = ("loads", "--site", site, *SHORT, "--dlc", "2.3", "--out", str(folder), "--driving", "1")
    _, errors = fowt(*arguments)
    assert "6 ok: runs in" in errors
    ultimate = read_table(folder / "tables" / "ultimate.csv")
    assert set(ultimate["controller"]) == {"pi", "pi_land"} and set(ultimate["dlc"]) == {2.3}
    (driving,) = (folder / "driving").iterdir()
    assert {path.name for path in driving.iterdir()} == {"README.md", "run.outb", "waves.Elev", "wind.wnd"}
    assert (folder / "loads.html").stat().st_size > 1_000_000  # with plotly.js
    assert (folder / "tables" / "oc3_hywind_DLB_directional_extreme_loads.xlsx").is_file()
    runs = sorted(folder.glob("runs/*/*.zip"))
    assert [path.parent.name for path in runs] == ["pi"] * 3 + ["pi_land"] * 3
    speeds = {read_run(path).statistics.value("GenTq_[kN-m]", "min") for path in runs}
    assert speeds == {0.0}  # the grid was lost in each run
    before = {path: path.stat().st_mtime_ns for path in runs}
    fowt(*arguments)
    assert {path: path.stat().st_mtime_ns for path in runs} == before
    fowt(*arguments, "--hours", "0.1")  # events have their own length
    assert {path: path.stat().st_mtime_ns for path in runs} == before
    wrong = ("loads", "--site", "norway_5", *SHORT, "--dlc", "2.3", "--out", str(folder))
    _, errors = fowt(*wrong, code=2)
    assert "was made with another case 'dlc2.3_u9.4_grid_loss" in errors


def test_the_plot_of_a_site_is_written_with_its_extremes(tmp_path):
    pytest.importorskip("matplotlib")
    text, _ = fowt("loads", "--site", "gulf_of_maine", "--plot-site", str(tmp_path / "site.png"))
    assert (tmp_path / "site.png").stat().st_size > 10_000
    assert re.search(r"50 years +50 +10\.68 +14\.2", text)


@pytest.mark.parametrize(("option", "value", "message"), [
    ("--site", "nowhere", "unknown site 'nowhere'"),
    ("--dlc", "1.9", "unknown design load case '1.9'"),
    ("--seeds", "0", "seeds = 0: must be a whole number in"),
    ("--sample", "500", "--sample chooses the hours of a century: only with --century"),
    ("--controllers", "pj", "pj"),
    ("--baseline", "rosco", "baseline among --controllers"),
    ("--wind", "steady", "unknown wind 'steady'"),
    ("--flood", "1e5:0:0", "--flood '1e5:0:0': must be MASS:X:Y:Z, in kg and m"),
    ("--fidelity", "fine", "unknown fidelity 'fine'"),
])  # fmt: skip
def test_bad_options_are_refused_before_anything_runs(tmp_path, option, value, message):
    folder = tmp_path / "out"
    _, errors = fowt("loads", *SHORT, "--out", str(folder), option, value, code=2)
    assert message in errors and not folder.exists()


def test_a_deck_that_is_missing_is_refused(tmp_path):
    _, errors = fowt("loads", str(tmp_path / "none.fst"), "--out", str(tmp_path / "out"), code=2)
    assert "none.fst" in errors


@pytest.mark.parametrize(
    "option, value, message", [("--hours", "-1", "hours = -1.0"), ("--dlc", "6.9", "'6.9'")]
)
def test_a_refused_option_leaves_nothing_of_a_deck(tmp_path, site, option, value, message):
    deck, out = write_deck(tmp_path / "deck"), tmp_path / "out"
    _, errors = fowt("loads", str(deck), "--site", site, option, value, "--out", str(out), code=2)
    assert message in errors and not out.exists()


def test_a_century_is_announced_sampled_and_resumed(tmp_path, site):
    folder = tmp_path / "out"
    command = (
        *("loads", "--site", site, "--controllers", "pi", "--century", "0.0008", "--out", str(folder)),
        *("--return-period", "0.0002"),
    )
    text, _ = fowt(*command, "--dry-run")
    assert re.search(r"0\.0008 years: 6 h of production .* 6 h are simulated", text)
    assert not folder.exists()
    _, notes = fowt(*command)
    assert "6 h simulated" in notes
    table = read_table(folder / "century" / "pi" / "century.csv")
    assert table["value"].notna().all() and len(table) > 20
    _, notes = fowt(*command)
    assert "0 h simulated" in notes


@pytest.mark.parametrize("options, message", [
    (("--dlc", "1.1"), "--dlc is for the load cases"),
    (("--flood", "1e6:0:0:-60"), "--flood is for the load cases"),
    (("--controllers", "ipc"), "'ipc': commands the pitch of each blade, and the scene has one pitch"),
])  # fmt: skip
def test_a_century_refuses_what_it_cannot_use_before_it_runs(tmp_path, site, options, message):
    command = ("loads", "--site", site, "--century", "0.001", "--out", str(tmp_path / "out"))
    _, text = fowt(*command, *options, code=2)
    assert re.search(message, " ".join(text.split()))
    assert not (tmp_path / "out").exists()
