import struct

import numpy as np
import pandas as pd
import pytest

import fowt_env
from fowt_env.descriptions.wind import wind_of
from fowt_env.descriptions.wind_files import read_uniform_wind
from fowt_env.errors import InputError
from fowt_env.files.openfast import read_out, read_outb, write_outb
from fowt_env.files.tables import read_table, write_table
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.training.evaluation.metrics import damage_equivalent_load
from fowt_env.weather.wind import build_wind

ROTOR = {
    "reference_height": 90.0,
    "rotor_diameter": 126.0,
    "shear_exponent": 0.2,
    "seed": 0,
    "duration": 100.0,
}
STILL = "0.0  12.0  0.0  0.0  0.0  0.0  0.0  0.0\n"


def write(folder, text):
    path = folder / "wind.wnd"
    path.write_text(text)
    return path


def blowing(path, t, y, z):
    """(u, v, w) that a scene of the OC3 rotor has at a time and point of a wind file."""
    series = build_wind(read_uniform_wind(path), **ROTOR)
    return wind_at(t, 0.0, y, z, wind_now(t, series), series, None)


def inflow_wind(row, y, z, height=90.0, length=126.0):
    """(u, v, w) by the equations in the head of OpenFAST's IfW_UniformWind.f90, at x = 0."""
    _, speed, direction, vertical, h_shear, exponent, v_shear, gust = row
    delta = np.radians(direction)
    flow = speed * (
        (z / height) ** exponent + h_shear / length * y * np.cos(delta) + v_shear / length * (z - height)
    )
    flow += gust
    return flow * np.cos(delta), -flow * np.sin(delta), vertical


@pytest.mark.parametrize(
    "row",
    [
        (0.0, 12.0, 0.0, 0.7, 0.0, 0.2, 0.0, 0.0),
        (0.0, 12.0, 25.0, -0.4, 0.0, 0.14, 0.0, 0.0),
        (0.0, 15.0, 0.0, 0.0, 0.12, 0.2, -0.3, 0.0),
        (0.0, 10.0, -40.0, 0.0, 0.0, 0.0, 0.0, 3.0),
    ],
)
def test_the_wind_of_a_row_is_that_of_inflow_wind_over_the_rotor(tmp_path, row):
    path = write(tmp_path, "! a header\n" + " ".join(map(str, row)) + "\n")
    for y, z in ((0.0, 90.0), (40.0, 120.0), (-55.0, 45.0)):
        np.testing.assert_allclose(blowing(path, 30.0, y, z), inflow_wind(row, y, z), atol=1e-12)


def test_a_turning_wind_keeps_its_speed_between_the_rows(tmp_path):
    rows = [
        (0.0, 12.0, 0.0, 0, 0, 0, 0, 0),
        (10.0, 14.0, 60.0, 0, 0, 0, 0, 0),
        (50.0, 14.0, 60.0, 0, 0, 0, 0, 0),
    ]
    path = write(tmp_path, "\n".join(", ".join(map(str, row)) for row in rows))
    for t in (0.0, 2.6, 5.07, 9.9, 30.0, 80.0):
        share = min(t / 10.0, 1.0)
        expected = inflow_wind((t, 12.0 + 2.0 * share, 60.0 * share, 0, 0, 0, 0, 0), 0.0, 90.0)
        np.testing.assert_allclose(
            blowing(path, t, 0.0, 90.0), expected, atol=1e-3
        )  # (1 deg)^2 / 8 of 14 m/s


def test_a_wind_file_is_an_argument_of_the_command_line_and_drives_a_scene(tmp_path):
    path = write(tmp_path, "! time speed ...\n" + STILL + "100.0 12.0 0 0 0 0 0 0 ! the end\n")
    path = path.rename(tmp_path / "wind.hh")
    frame = fowt_env.simulate(
        fowt_env.build_scene(wind=wind_of(str(path)), rotor="table", fidelity="reference"), duration=2.0
    )
    np.testing.assert_allclose(frame["Wind1VelX_[m/s]"], 12.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows"),
        ("! only a header\n", "no rows"),
        ("0 12 0 0 0 0 0\n", "line 1 has 7 columns"),
        (STILL + "1 x 0 0 0 0 0 0\n", "line 2.*numbers only"),
        (STILL + "1 nan 0 0 0 0 0 0\n", "line 2.*finite"),
        (STILL + STILL, "times that increase"),
        (STILL + "1 12 0 0 0 0.2 0 0\n", "exponent .* varies"),
        ("0 12 0 0 0 0.2 0 3\n", "gust"),
        ("0 12 10 0 0.1 0 0 0\n", "linear shear"),
        ("0 12 180 0 0 0 0 0\n", "from behind"),
        ("0 12 0 0 0 0 0 0\n1 12 1e300 0 0 0 0 0\n", "full turn"),
    ],
)
def test_wind_files_that_a_series_cannot_hold_are_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_uniform_wind(write(tmp_path, text))


def test_a_missing_wind_file_is_named(tmp_path):
    with pytest.raises(InputError, match="none.wnd"):
        wind_of(str(tmp_path / "none.wnd"))


@pytest.fixture(scope="module")
def run():
    return fowt_env.simulate(
        fowt_env.build_scene(wind=18.0, rotor="table", fidelity="reference"), duration=5.0
    )


@pytest.fixture(scope="module")
def loaded_run():
    """In turbulence and waves, with cycles to count."""
    wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
    sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 10.0}
    scene = fowt_env.build_scene(wind=wind, sea=sea, seed=1, fidelity="standard")
    return fowt_env.simulate(scene, controller="pi", duration=200.0)


def test_openfast_s_own_reader_finds_every_channel_bit_for_bit(run, tmp_path):
    reader = pytest.importorskip("openfast_io.FAST_output_reader", reason="openfast_io is not installed")
    path = write_table(run, tmp_path / "run.outb")
    data, info, _ = reader.load_binary_output(str(path))
    columns = [f"{a}_[{b}]" for a, b in zip(info["attribute_names"], info["attribute_units"], strict=True)]
    assert columns == list(run.columns)
    np.testing.assert_array_equal(data[:, 1:], run.to_numpy()[:, 1:])
    np.testing.assert_allclose(data[:, 0], run["Time_[s]"], atol=1e-12)
    frame = reader.FASTOutputFile(str(path)).toDataFrame()
    np.testing.assert_array_equal(frame["RotSpeed_[rpm]"], run["RotSpeed_[rpm]"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda run: run.iloc[:1], "two rows"),
        (lambda run: run.drop(index=7), "evenly spaced"),
        (lambda run: run.drop(columns="Time_[s]"), "first column"),
        (lambda run: run.rename(columns={"RotSpeed_[rpm]": "RotorSpeedMean_[rpm]"}), "RotorSpeedMean"),
        (lambda run: run.rename(columns={"RotSpeed_[rpm]": "RotSpeed"}), "NAME_"),
    ],
)
def test_frames_that_the_format_has_no_room_for_are_refused_and_leave_no_file(run, tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        write_table(change(run), tmp_path / "run.outb")
    assert list(tmp_path.iterdir()) == []


def packed(frame, file_id, length=10):
    """Content of a .outb file whose values are packed into 16 bits."""
    values = frame.to_numpy()
    time, data = values[:, 0], values[:, 1:]
    low, high = data.min(axis=0), data.max(axis=0)
    slope = np.where(high > low, 65535.0 / np.maximum(high - low, 1e-30), 1.0).astype("<f4")
    offset = (-32768.0 - low * slope).astype("<f4")
    head = struct.pack("<h", file_id) + (struct.pack("<h", length) if file_id == 4 else b"")
    head += struct.pack("<ii", data.shape[1], len(time))
    if file_id == 1:
        times = np.round((time - time[0]) * 1000.0).astype("<i4")
        head += struct.pack("<dd", 1000.0, -1000.0 * time[0])
    else:
        head += struct.pack("<dd", time[0], time[1] - time[0])
    head += slope.tobytes() + offset.tobytes() + struct.pack("<i", 5) + b"a run"
    names, units = zip(*(column[:-1].split("_[") for column in frame.columns), strict=True)
    words = "".join(word.ljust(length) for word in (*names, *(f"({unit})" for unit in units)))
    head += words.encode() + (times.tobytes() if file_id == 1 else b"")
    return head + np.clip(np.round(data * slope + offset), -32768, 32767).astype("<i2").tobytes()


def test_reading_gives_back_the_run_that_was_written(run, tmp_path):
    frame = read_outb(write_table(run, tmp_path / "run.outb"))
    assert list(frame.columns) == list(run.columns)
    np.testing.assert_array_equal(frame.iloc[:, 1:], run.iloc[:, 1:])
    np.testing.assert_allclose(frame["Time_[s]"], run["Time_[s]"], rtol=0.0, atol=1e-12)


def test_what_is_not_a_number_is_written_and_read_as_such(run, tmp_path):
    broken = run.copy()
    broken.loc[3, "RotSpeed_[rpm]"] = np.nan
    frame = read_outb(write_table(broken, tmp_path / "run.outb"))
    np.testing.assert_array_equal(frame["RotSpeed_[rpm]"], broken["RotSpeed_[rpm]"])


@pytest.mark.parametrize(("file_id", "length"), [(1, 10), (2, 10), (4, 10), (4, 16)])
def test_packed_files_are_read_as_openfast_s_own_reader_reads_them(loaded_run, tmp_path, file_id, length):
    run = loaded_run
    reader = pytest.importorskip("openfast_io.FAST_output_reader", reason="openfast_io is not installed")
    path = tmp_path / "run.outb"
    path.write_bytes(packed(run, file_id, length))
    frame = read_outb(path)
    data, info, _ = reader.load_binary_output(str(path))
    columns = [f"{a}_[{b}]" for a, b in zip(info["attribute_names"], info["attribute_units"], strict=True)]
    assert list(frame.columns) == columns == list(run.columns)
    np.testing.assert_array_equal(frame.to_numpy(), data)
    span = run.max() - run.min()
    slope = (65535.0 / span).where(span > 0.0, 1.0)
    # half a step of 16 bits, and the single precision of the offset that values far from zero need
    rounding = (0.51 + 2.0**-23 * (65536.0 + slope * run.abs().max())) / slope
    assert ((frame - run).abs().max() <= rounding).all()


HEAD = 2 + 4 + 4 + 16 + 4 + 8  # bytes of a file of write_outb before its names; 8: "fowt_env"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: b"", "FileID: 1 x 2 bytes are needed, 0 are left, before byte 0 of 0"),
        (lambda content: b"\x07" + content[1:], "FileID is 7: must be 1, 2, 3 or 4"),
        (lambda content: content[:-1], "rows of .* channels take .* bytes, .* are left"),
        (lambda content: content + b"\0", "rows of .* channels take .* bytes, .* are left"),
        (lambda content: content[:2] + b"\xff\xff\xff\x7f" + content[6:], "channel names: .* are needed"),
        (lambda content: content[:2] + b"\xff\xff\xff\xff" + content[6:], "number of channels is -1"),
        (lambda content: content[:6] + b"\xff\xff\xff\x7f" + content[10:], "2147483647 rows"),
        (lambda content: content[:6] + bytes(4) + content[10:], "number of time steps is 0"),
        (lambda content: content[:18] + struct.pack("<d", np.nan) + content[26:], "step nan s"),
        (lambda content: content[:10] + struct.pack("<d", 1e300) + content[18:], "finite and increase"),
        (lambda content: content[:26] + b"\xff\xff\xff\x7f" + content[30:], "description: .* are needed"),
        (lambda content: content[:HEAD] + b"\x80" + content[HEAD + 1 :], "names must be printable ASCII"),
        (
            lambda content: content[: HEAD + 10] + content[HEAD + 20 : HEAD + 30] + content[HEAD + 20 :],
            "occurs twice",
        ),
    ],
)
def test_broken_output_files_are_refused_with_the_place(run, tmp_path, change, message):
    path = write_table(run, tmp_path / "run.outb")
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(InputError, match=rf"run\.outb.*{message}"):
        read_outb(path)


@pytest.mark.parametrize("change", [(10, 1000.0), (26, 1.0)])
def test_a_packed_file_without_scale_is_refused(run, tmp_path, change):
    content = packed(run, 1)
    place, value = change
    form = "<d" if place == 10 else "<f"
    broken = content[:place] + struct.pack(form, 0.0) + content[place + struct.calcsize(form) :]
    path = tmp_path / "run.outb"
    path.write_bytes(broken)
    with pytest.raises(InputError, match="no slope zero"):
        read_outb(path)


def test_units_in_square_brackets_are_read_as_map_writes_them(tmp_path):
    path = tmp_path / "model.out"
    path.write_text("head\n\nTime\tRotSpeed\tT[1]\n(s)\t(rpm)\t[N]\n0.0\t12.1\t9.0E5\n0.1\t12.2\t9.1E5\n")
    frame = read_out(path)
    assert list(frame.columns) == ["Time_[s]", "RotSpeed_[rpm]", "T[1]_[N]"]
    assert frame["T[1]_[N]"].tolist() == [9e5, 9.1e5]


@pytest.mark.parametrize("path", ["none.outb", ".", "a" * 300, "a\0b"])
def test_an_output_file_that_is_none_is_named(tmp_path, path):
    with pytest.raises(InputError, match="outb file"):
        read_outb(tmp_path / path)


def test_pcrunch_finds_the_same_statistics_and_loads_in_our_file(loaded_run, tmp_path):
    run = loaded_run
    pcrunch = pytest.importorskip("pCrunch", reason="pCrunch is not installed")
    from pCrunch.openfast_readers import OpenFASTBinary

    channel, exponent = "TwrBsMyt_[kN-m]", 4
    output = OpenFASTBinary(write_table(run, tmp_path / "run.outb"))
    assert output.channels == [column.split("_[")[0] for column in run.columns]
    found = pd.DataFrame(output.summary_stats())
    for column in run.columns:
        theirs, ours = found[column.split("_[")[0]], run[column]
        expected = (ours.min(), ours.max(), ours.std(ddof=0), ours.mean(), ours.median())
        got = theirs[["min", "max", "std", "mean", "median"]]
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9 * (1.0 + ours.abs().max()))
    fatigue = pcrunch.FatigueParams(slope=exponent, bins=10_000)
    theirs = fatigue.compute_del(output["TwrBsMyt"], output.elapsed_time)
    length = run["Time_[s]"].iloc[-1] - run["Time_[s]"].iloc[0]
    assert theirs == pytest.approx(damage_equivalent_load(run[channel], length, exponent), rel=0.02)


def test_outb_is_for_time_series_alone(tmp_path):
    with pytest.raises(InputError, match="must end with .csv or .parquet"):
        read_table(tmp_path / "run.outb")
    with pytest.raises(InputError, match="first column"):
        write_outb(pd.DataFrame({"a": [1.0]}), tmp_path / "a.outb")
