import numpy as np
import pandas as pd
import pytest

import fowt_env
from fowt_env.cli_arguments import parse_wind
from fowt_env.errors import InputError
from fowt_env.openfast_files import read_uniform_wind, write_outb
from fowt_env.outputs import read_table, write_table
from fowt_env.weather.wind import build_wind, wind_at, wind_now

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
    frame = fowt_env.simulate(fowt_env.build_scene(wind=parse_wind(str(path)), rotor="table"), duration=2.0)
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
        parse_wind(str(tmp_path / "none.wnd"))


@pytest.fixture(scope="module")
def run():
    return fowt_env.simulate(fowt_env.build_scene(wind=18.0, rotor="table"), duration=5.0)


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


def test_outb_is_for_time_series_alone(tmp_path):
    with pytest.raises(InputError, match="must end with .csv or .parquet"):
        read_table(tmp_path / "run.outb")
    with pytest.raises(InputError, match="first column"):
        write_outb(pd.DataFrame({"a": [1.0]}), tmp_path / "a.outb")
