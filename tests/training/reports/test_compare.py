"""Two runs compared: each difference that is put into a run is found, with its size, and no other."""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import fowt

from fowt_env.errors import InputError
from fowt_env.files.tables import read_series, write_table
from fowt_env.training.evaluation.metrics import damage_equivalent_load
from fowt_env.training.reports.compare import compare, exponent_of, plot_comparison

STEP, LENGTH = 0.1, 400.0
TIME = "Time_[s]"
CHANNELS = {  # channel: (mean, largest deviation, frequencies in Hz)
    "Wind1VelX_[m/s]": (18.0, 1.0, (0.007, 0.013, 0.031, 0.11)),
    "Wave1Elev_[m]": (0.0, 2.0, (0.083, 0.1, 0.127)),
    "RotSpeed_[rpm]": (12.1, 0.6, (0.007, 0.03)),
    "BldPitch1_[deg]": (14.0, 2.0, (0.007, 0.03)),
    "GenPwr_[kW]": (5000.0, 200.0, (0.007, 0.03)),
    "PtfmPitch_[deg]": (2.5, 1.0, (0.03, 0.1)),
    "TwrBsMyt_[kN-m]": (60e3, 9e3, (0.03, 0.1)),
    "RootMyc1_[kN-m]": (5e3, 1e3, (0.03, 0.2)),
    "FAIRTEN1_[kN]": (700.0, 20.0, (0.008, 0.1)),
}


def waves(time, size, frequencies, seed=0):
    """Sum of cosines with drawn phases."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(frequencies))
    parts = [np.cos(2.0 * np.pi * f * time + p) for f, p in zip(frequencies, phases, strict=True)]
    return size * np.sum(parts, axis=0) / len(parts)


def run(step=STEP, shift=0.0, start=0.0):
    """A run of all CHANNELS, later by `shift` s."""
    time = start + step * np.arange(round((LENGTH - start) / step) + 1)
    columns = {name: mean + waves(time - shift, *rest) for name, (mean, *rest) in CHANNELS.items()}
    return pd.DataFrame({TIME: time} | columns)


def changed(column, function):
    """The run with one column replaced by a function of (time, values)."""
    frame = run()
    frame[column] = function(frame[TIME].to_numpy(), frame[column].to_numpy())
    return frame


def late(seconds, name):
    mean, *rest = CHANNELS[name]
    return lambda time, value: mean + waves(time - seconds, *rest)


def test_a_run_does_not_differ_from_itself_and_its_figures_are_its_own():
    result = compare(run(), run())
    assert result.notes == [] and result.only == ([], []) and result.window == (0.0, LENGTH)
    rows = {row.channel: row for row in result.rows}
    assert list(rows) == [name.partition("_[")[0] for name in CHANNELS]
    values = run()["TwrBsMyt_[kN-m]"]
    row = rows["TwrBsMyt"]
    assert row.mean == row.mean_other == pytest.approx(values.mean())
    assert row.std == pytest.approx(np.std(values)) and row.lag == 0.0
    assert row.del_1hz == row.del_1hz_other == damage_equivalent_load(values, LENGTH, 4.0)
    assert row.correlation == pytest.approx(1.0) and row.coherence == pytest.approx(1.0)
    assert np.isnan(rows["PtfmPitch"].del_1hz)
    table = result.table()
    assert (table["std_difference_[%]"] == 0.0).all()


def test_a_slow_drift_has_no_lag_behind_itself():
    frame = run()
    frame["PtfmSurge_[m]"] = 20.0 * np.exp(-frame[TIME] / 150.0)
    (row,) = compare(frame, frame, channels=("PtfmSurge",)).rows
    assert row.lag == 0.0 and row.correlation == pytest.approx(1.0)


FOUND = [  # column, change of the first run, channels and words of the only note
    ("BldPitch1_[deg]", late(0.3, "BldPitch1_[deg]"), "comes 0.3 s later", "pitch drive"),
    ("Wave1Elev_[m]", late(-0.5, "Wave1Elev_[m]"), "comes 0.5 s earlier", "wave series"),
    ("GenPwr_[kW]", lambda t, x: 1e-3 * x, "a factor of 1000", "units"),
    ("RotSpeed_[rpm]", lambda t, x: x * 0.10471975511965977, "rpm and rad/s", "units"),
    ("PtfmPitch_[deg]", lambda t, x: -x, "opposite sign", "convention"),
    ("PtfmPitch_[deg]", lambda t, x: x + 1.0, "another mean", "mooring stiffness"),
    ("PtfmPitch_[deg]", lambda t, x: x + 8.0 * np.exp(-t / 12.0), "first quarter", "--from"),
    ("TwrBsMyt_[kN-m]", lambda t, x: x + 4e3 * np.cos(3.0 * t), "above 0.25 Hz", "flexible tower"),
    ("RootMyc1_[kN-m]", lambda t, x: x + 600.0 * np.cos(4.0 * t), "above 0.25 Hz", "flexible blades"),
    ("FAIRTEN1_[kN]", lambda t, x: x + 6.0 * np.cos(0.6 * t), "0.04 to 0.25 Hz", "MoorDyn"),
    ("PtfmPitch_[deg]", lambda t, x: x + 0.4 * np.cos(0.05 * t), "below 0.04 Hz", "second-order"),
    ("GenPwr_[kW]", lambda t, x: x / 0.944, "another mean", "efficiency"),
    ("Wind1VelX_[m/s]", lambda t, x: 18.0 + 1.2 * (x - 18.0), "another deviation", "rotor average"),
    ("Wave1Elev_[m]", lambda t, x: waves(t, 2.0, (0.083, 0.1, 0.127), 5), "another series", "phases"),
    ("BldPitch1_[deg]", lambda t, x: 0.0 * x, "second run only", "degree of freedom"),
    ("TwrBsMyt_[kN-m]", lambda t, x: x + np.nan, "not finite", "failed"),
]  # fmt: skip


@pytest.mark.parametrize(("column", "change", "what", "why"), FOUND)
def test_a_difference_is_found_with_its_usual_cause_and_no_other_channel_has_one(column, change, what, why):
    result = compare(changed(column, change), run())
    assert {name for name, _ in result.notes} == {column.partition("_[")[0]}
    assert any(what in text and why in text for _, text in result.notes), result.notes


def test_a_control_that_follows_a_late_rotor_speed_is_not_the_cause():
    frame = changed("BldPitch1_[deg]", late(0.2, "BldPitch1_[deg]"))
    frame["RotSpeed_[rpm]"] = late(0.2, "RotSpeed_[rpm]")(frame[TIME].to_numpy(), None)
    assert compare(frame, run()).notes == [
        ("BldPitch1", "comes later as the rotor speed does: the cause is in the plant or the wind")
    ]


def test_in_other_waves_no_lag_is_told_and_statistics_are():
    frame = changed("Wave1Elev_[m]", lambda t, x: waves(t, 2.0, (0.083, 0.1, 0.127), 5))
    frame["PtfmPitch_[deg]"] = late(2.0, "PtfmPitch_[deg]")(frame[TIME].to_numpy(), None)
    frame["TwrBsMyt_[kN-m]"] *= 1.1
    notes = dict(compare(frame, run()).notes)
    assert set(notes) == {"Wave1Elev", "TwrBsMyt"}
    frame["Wave1Elev_[m]"] = run()["Wave1Elev_[m]"]
    notes = dict(compare(frame, run()).notes)
    assert set(notes) == {"PtfmPitch", "TwrBsMyt"} and "natural frequency" in notes["PtfmPitch"]


def test_a_lag_that_is_small_against_the_period_of_a_motion_is_no_note():
    late_pitch = changed("PtfmPitch_[deg]", late(0.2, "PtfmPitch_[deg]"))  # 0.6 % of its period
    assert compare(late_pitch, run()).notes == []


def test_the_lag_of_everything_with_the_weather_is_one_note():
    notes = dict(compare(run(shift=2.0), run()).notes)
    assert any("align these first" in text for text in notes.values())
    inputs = [name for name, text in notes.items() if "comes 2 s later" in text]
    assert inputs == ["Wind1VelX, Wave1Elev"] and len(notes) == 2


@pytest.mark.parametrize("steps", [(0.1, 0.025), (0.05, 0.08)])
def test_runs_of_other_steps_are_compared_on_the_larger_one(steps):
    result = compare(run(steps[0], shift=1.0), run(steps[1]))
    assert result.steps == pytest.approx(steps)
    time, *_ = result.pairs["RotSpeed_[rpm]"]
    assert time[1] - time[0] == pytest.approx(max(steps))
    for row in result.rows:
        assert row.lag == pytest.approx(1.0, abs=0.02) and row.correlation > 0.99, row.channel


def test_the_low_pass_keeps_what_the_larger_step_can_show_and_removes_what_it_cannot():
    fine = run(0.01)
    fine["RotSpeed_[rpm]"] += 5.0 * np.cos(2.0 * np.pi * 9.9 * fine[TIME])  # seen as 0.1 Hz at 0.1 s
    _, first, second = compare(run(), fine).pairs["RotSpeed_[rpm]"]
    assert np.abs(first - second)[50:-50].max() < 0.01


def test_times_units_and_names_are_those_in_common():
    other = run(start=50.0)
    other = other.rename(columns={"PtfmPitch_[deg]": "PtfmRDyi_[deg]"})
    other["TwrBsMyt_[N-m]"] = 1e3 * other.pop("TwrBsMyt_[kN-m]")
    other["OoPDefl1_[m]"] = 1.0
    result = compare(run(), other, start=20.0, end=300.0)
    assert result.window == (50.0, 300.0)
    assert result.notes == [] and result.only == ([], ["OoPDefl1"])
    assert [row.channel for row in compare(run(), other, channels=("RotSpeed",)).rows] == ["RotSpeed"]


@pytest.mark.parametrize(
    ("change", "arguments", "message"),
    [
        ({}, {"start": 399.0}, "from 399 to 400 s: fewer than 16 common rows; the runs cover 0 to 400 s"),
        ({}, {"channels": ("RotSped",)}, "'RotSpeed'"),
        (lambda name: name if name == TIME else f"{name} of B", {}, "no channel"),
        (lambda name: name.replace("Time", "Tiem"), {}, "the second run: needs a column"),
    ],
)
def test_runs_that_cannot_be_compared_are_refused(change, arguments, message):
    with pytest.raises(InputError, match=message.replace("[", r"\[")):
        compare(run(), run().rename(columns=change or {}), **arguments)


def test_the_exponent_is_that_of_the_material():
    cases = {
        ("RootMyc1", "kN-m"): 10.0, ("Spn4MLxb1", "kN-m"): 10.0, ("TwrBsMyt", "kN-m"): 4.0,
        ("RotTorq", "kN-m"): 4.0, ("LSSTipMys", "kN-m"): 4.0, ("FAIRTEN2", "kN"): 3.0,
        ("Fair3Ten", "kN"): 3.0,
    }  # fmt: skip
    assert {case: exponent_of(*case) for case in cases} == cases
    for name, unit in (("GenTq", "kN-m"), ("HydroFxi", "kN"), ("RtFldFxh", "kN"), ("PtfmPitch", "deg")):
        assert np.isnan(exponent_of(name, unit))


def test_the_command_prints_the_table_and_the_notes_and_writes_both_files(tmp_path):
    paths = [tmp_path / "mine.outb", tmp_path / "theirs.csv"]
    write_table(changed("BldPitch1_[deg]", late(0.3, "BldPitch1_[deg]")), paths[0])
    write_table(run(), paths[1])
    table, plot = tmp_path / "table.csv", tmp_path / "plot.png"
    words = ["compare", *map(str, paths), "--from", "50", "--out", str(table), "--plot", str(plot)]
    stdout, stderr = fowt(*words)
    assert "1: mine, 2: theirs; 50 to 400 s, steps 0.1 and 0.1 s" in stdout
    assert "1. BldPitch1: comes 0.3 s later in the first run" in stdout
    assert len(pd.read_csv(table)) == len(CHANNELS) and plot.read_bytes().startswith(b"\x89PNG")
    assert "table.csv" in stderr and "plot.png" in stderr
    fowt("compare", str(paths[0]), str(tmp_path / "none.outb"), code=2)
    write_table(run().rename(columns={TIME: "Tiem_[s]"}), paths[1])
    assert "theirs.csv': needs a column 'Time_[s]'" in fowt("compare", *map(str, paths), code=2)[1]


def test_the_plot_has_both_series_and_their_spectra():
    figure = plot_comparison(compare(run(), run()), ("a", "b"), channels=("RotSpeed", "PtfmPitch"))
    assert [len(axes.lines) for axes in figure.axes] == [2, 2, 2, 2]
    time, values = figure.axes[0].lines[1].get_data()
    np.testing.assert_allclose(values, run()["RotSpeed_[rpm]"])


PUBLIC = importlib.util.find_spec("pCrunch")


@pytest.mark.skipif(PUBLIC is None, reason="pCrunch, whose files of FAST are read, is not installed")
def test_the_text_and_the_binary_output_of_one_run_of_fast_agree():
    folder = Path(PUBLIC.origin).parent / "test" / "data"
    if not (folder / "AOC_WSt.out").is_file():
        pytest.skip("this pCrunch comes without its files")
    result = compare(read_series(folder / "AOC_WSt.outb"), read_series(folder / "AOC_WSt.out"))
    assert len(result.rows) > 20 and result.notes == [] and result.only == ([], [])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing\n", "no line begins with Time"),
        ("Time RotSpeed\n(s)\n0 1\n", "line 2: 1 units of 2 channels"),
        ("Time RotSpeed\n(s) (rpm)\n0 1\n0.1\n", "line 4: 1 values of 2 channels"),
        ("Time RotSpeed\n(s) (rpm)\n0 x\n", "line 3: could not convert"),
        ("Time RotSpeed RotSpeed\n(s) (rpm) (rpm)\n0 1 1\n", "occurs twice"),
    ],
)
def test_a_broken_text_output_is_refused_with_its_line(text, message, tmp_path):
    path = tmp_path / "run.out"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_series(path)
