"""The table of power, thrust, tilt and surge, read back by FLORIS."""

import numpy as np
import pytest
from command_line import fowt
from floris import FlorisModel

import fowt_env
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.training.loads.farm_table import performance_table, tilt_of, write_floris

WINDS, HS, TP = (8.0, 12.0, 18.0), (0.0, 4.0), (8.0, 12.0)


@pytest.fixture(scope="module")
def table():
    return performance_table("oc3_hywind", "pi", WINDS, HS, TP, duration=120.0, skip=40.0)


def row(table, wind, height, period):
    """Return one row of the table."""
    frame = table.frame
    found = frame[(frame["wind_m_s"] == wind) & (frame["Hs_m"] == height) & (frame["Tp_s"] == period)]
    assert len(found) == 1
    return found.iloc[0]


def test_still_water_is_the_steady_operating_point(table):
    for wind in WINDS:
        point = fowt_env.trim(fowt_env.build_scene("oc3_hywind", wind=wind))
        found = row(table, wind, 0.0, 8.0)
        assert found["power_kW"] == pytest.approx(point["GenPwr"], rel=2e-3)
        assert found["tilt_deg"] == pytest.approx(
            point["PtfmPitch"], abs=0.02
        )  # the 5 MW shaft is level here
        assert found["surge_m"] == pytest.approx(point["PtfmSurge"], abs=0.1)
        pressure = 0.5 * 1.225 * np.pi * 63.0**2 * wind**2
        assert found["Ct"] == pytest.approx(point["RtFldFxh"] / pressure, rel=2e-3)
        assert found["Cp"] == pytest.approx(1e3 * point["GenPwr"] / (pressure * wind), rel=2e-3)
        assert found.drop("Tp_s").equals(row(table, wind, 0.0, 12.0).drop("Tp_s"))


def test_the_tilt_is_that_of_the_shaft_plus_the_platform():
    assert tilt_of(read_turbine("iea15"), 2.5) == pytest.approx(8.5)  # a shaft tilt of 6 deg


def test_waves_change_the_mean(table):
    """The power of a moving rotor in steady wind below rated is above that of one at rest (v^3)."""
    assert row(table, 8.0, 4.0, 12.0)["power_kW"] > row(table, 8.0, 0.0, 12.0)["power_kW"]
    assert row(table, 8.0, 4.0, 12.0)["power_kW"] != row(table, 8.0, 4.0, 8.0)["power_kW"]


def test_floris_reads_back_every_entry(table, tmp_path):
    about, data, _ = write_floris(tmp_path, table)
    model = FlorisModel("defaults")
    rows = list(table.frame.itertuples(index=False))
    winds = np.array([each.wind_m_s for each in rows])
    model.set(
        layout_x=[0.0], layout_y=[0.0], turbine_type=[about.stem], turbine_library_path=tmp_path,
        wind_speeds=winds, wind_directions=np.full(len(rows), 270.0), wind_shear=0.0,
        turbulence_intensities=np.full(len(rows), 0.06), reference_wind_height=table.hub_height,
        multidim_conditions={"Tp": [r.Tp_s for r in rows], "Hs": [r.Hs_m for r in rows]},
    )  # fmt: skip
    model.run()
    power, thrust = model.get_turbine_powers()[:, 0], model.get_turbine_thrust_coefficients()[:, 0]
    # the file has ten digits; the mean over FLORIS's rotor grid is the wind to the last bits
    np.testing.assert_allclose(power, [1e3 * r.power_kW for r in rows], rtol=1e-6)
    np.testing.assert_allclose(thrust, [r.Ct for r in rows], rtol=1e-6)
    tilt = model.core.farm.turbine_map[0].floating_tilt_table
    np.testing.assert_allclose(tilt["wind_speed"], WINDS)
    np.testing.assert_allclose(tilt["tilt"], [row(table, w, 0.0, 8.0)["tilt_deg"] for w in WINDS], rtol=1e-6)


def test_power_is_zero_outside_the_winds(table, tmp_path):
    _, data, _ = write_floris(tmp_path, table)
    values = np.genfromtxt(data, delimiter=",", names=True)
    outside = (values["ws"] < 8.0) | (values["ws"] > 18.0)
    assert not values["power"][outside].any() and not values["thrust_coefficient"][outside].any()
    assert outside.sum() == 4 * len(HS) * len(TP)


def test_wrong_arguments_are_named():
    for arguments, message in (
        (((8.0,), HS, TP), "winds = .*two or more increasing"),
        (((8.0, 30.0), HS, TP), r"winds = 30.*\[3, 25\]"),
        ((WINDS, (-1.0,), TP), "Hs = -1"),
        ((WINDS, HS, (0.0,)), "Tp = 0"),
    ):
        with pytest.raises(InputError, match=message):
            performance_table("oc3_hywind", "pi", *arguments, duration=20.0, skip=10.0)


def test_the_command_writes_the_files(tmp_path):
    out = tmp_path / "x"
    options = ("--winds", "8,12", "--hs", "0", "--tp", "10", "--duration", "20", "--out", out)
    fowt("model", "table", "oc3_hywind", *options)
    assert sorted(path.name for path in out.iterdir()) == [
        "oc3_hywind.csv", "oc3_hywind.yaml", "oc3_hywind_Tp_Hs.csv",
    ]  # fmt: skip
