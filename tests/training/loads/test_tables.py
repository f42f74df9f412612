"""The tables of a design load table: assembled, as CSV, as spreadsheets of IEA-22's layout."""

import numpy as np
import openpyxl
import pandas as pd
import pytest
from load_runs import SCENE, frame_of, load_case, run_of, small_table

from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.loads.extrapolation import form_load
from fowt_env.training.loads.records import FinishedRun
from fowt_env.training.loads.site import climate_of, read_site
from fowt_env.training.loads.spreadsheet import ANGLES, write_spreadsheets
from fowt_env.training.loads.statistics import EXPONENTS, run_statistics
from fowt_env.training.loads.tables import (
    absent_part,
    driving_runs,
    family_of,
    joined,
    load_tables,
    meaning_of,
    write_csv,
)

MOMENT = "TwrBsMyt_[kN-m]"


@pytest.fixture(scope="module")
def results():
    return load_tables(*small_table(), exponents=(3, 4, 10))


def test_every_part_of_the_table_is_there(results):
    assert results.controllers == ("pi", "lqr") and results.baseline == "pi" and not results.lost
    loads = {(row.column, row.side, row.controller): row for row in results.extremes}
    assert loads[MOMENT, "max", "pi"].factored > loads[MOMENT, "max", "lqr"].factored
    assert {row.exponent for row in results.lifetime} == {3, 4, 10}
    fatigue = {(row.column, row.exponent, row.controller): row for row in results.lifetime}
    assert fatigue[MOMENT, 4, "lqr"].ratio == pytest.approx(0.8, rel=1e-3)  # the scale of its loads
    assert [case.key for case, _ in results.ended] == [("pi", "dlc1.3_u12", 2)]
    # the extrapolated load is that of one condition, with the factor of 1.1
    found = results.extrapolations["pi", MOMENT, "max"]
    assert found.low < found.value < found.high and found.governing == "dlc1.2_u16"
    extrapolated = [row for row in results.extremes if row.characteristic == "extrapolated"]
    row = next(row for row in extrapolated if row.column.endswith("kN-m]"))
    at = results.extrapolations[row.controller, row.column, row.side]
    assert row.value == at.value and row.name == at.governing and row.factor == 1.25


def test_hours_of_lost_runs_go_to_the_other_seeds():
    cases, finished = small_table()
    lost = ("pi", "dlc1.2_u8", 3)
    finished[lost] = FinishedRun(*lost, "failed", "broke")
    runs, gone, _ = joined(cases, finished)
    own = [c for c, _ in runs if (c.controller, c.name, c.dlc) == ("pi", "dlc1.2_u8", "1.2")]
    assert len(own) == 3 and sum(case.hours_per_year for case in own) == pytest.approx(2000.0)
    assert {case.key for case, _ in gone} == {lost} and len(gone) == 2  # of DLC 1.1 and 1.2
    other = [c for c, _ in runs if (c.controller, c.name, c.dlc) == ("lqr", "dlc1.2_u8", "1.2")]
    assert [case.hours_per_year for case in other] == [500.0] * 4
    del finished[lost]
    assert joined(cases, finished)[1] == [(case, None) for case in cases if case.key == lost]


def test_runs_that_a_trip_ended_have_no_part_in_the_extrapolation():
    """The loads of a stop are no peaks of production."""
    cases, finished = small_table()
    key = ("pi", "dlc1.2_u16", 3)
    case = next(each for each in cases if each.key == key)
    finished[key] = FinishedRun(*key, "tripped", statistics=run_of(case, 50.0)[1])
    found = load_tables(cases, finished)
    del finished[key]
    without = load_tables(cases, finished)
    for each, other in zip(found.extrapolations.values(), without.extrapolations.values(), strict=True):
        assert (each.value, each.low, each.high) == (other.value, other.low, other.high)
    assert key in {ended.key for ended, _ in found.ended}


def test_loads_by_inverse_form_need_runs_in_the_severe_sea():
    cases, finished = small_table()
    climate = climate_of(read_site("norway_5"), SCENE.turbine)
    assert load_tables(cases, finished, climate=climate).forms == {}
    for wind in (8.0, 12.0, 16.0):
        for seed in (1, 2, 3, 4):
            about = {"wind_speed": wind, "Hs": 9.0, "seed": seed, "controller": "pi"}
            case = load_case("1.6", f"dlc1.6_u{wind:g}", **about)
            cases.append(case)
            statistics = run_of(case, 4.0)[1]
            finished[case.key] = FinishedRun(*case.key, "ok", statistics=statistics)
    found = load_tables(cases, finished, climate=climate)
    assert set(found.forms) == set(found.extrapolations)
    load, wind, Hs = found.forms["pi", MOMENT, "max"]
    usual, severe = (
        [each.value(MOMENT, "max") for case, each in found.runs if (case.controller, case.dlc) == ("pi", dlc)]
        for dlc in ("1.2", "1.6")
    )
    # the load grows with Hs from 3 to 9 m, and the 50-year sea lies between or beyond
    assert load > max(severe) > max(usual) and 4.0 < wind < 20.0 and Hs > 6.0
    own = [(c, e) for c, e in found.runs if c.controller == "pi" and c.dlc in ("1.1", "1.6")]
    assert found.forms["pi", MOMENT, "max"] == form_load(own, MOMENT, "max", climate)


def test_a_table_without_runs_is_refused():
    with pytest.raises(InputError, match="no run has statistics"):
        load_tables([load_case()], {})


def test_channels_have_a_part_a_meaning_and_what_the_plant_lacks():
    assert family_of(MOMENT) == "tower base" and family_of("TwrBsMxyt_[kN-m]") == "tower base"
    assert family_of("RootMxc2_[kN-m]") == "blade root 2" and family_of("FAIRTEN3_[kN]") == "mooring"
    assert family_of("TwrBsMxt/TwrBsMyt@30_[kN-m]") == "tower base"
    assert family_of("HydroFxi_[N]") == ""
    assert meaning_of("TwrBsMxyt_[kN-m]") == "resultant of TwrBsMxt and TwrBsMyt"
    rigid, bending = (
        Case("a"),
        Case("b", options={"tower": "modes", "blades": "modes2", "mooring": "dynamic"}),
    )
    expected = {
        MOMENT: "rigid tower", "RootMyc1_[kN-m]": "rigid blades", "LSSTipMys_[kN-m]": "rigid blades",
        "RotTorq_[kN-m]": "rigid shaft", "FAIRTEN1_[kN]": "quasi-static lines", "PtfmPitch_[deg]": "",
    }  # fmt: skip
    for column, text in expected.items():
        assert absent_part(column, rigid) == text
        assert absent_part(column, bending) == ("rigid shaft" if "Torq" in column else "")


def test_driving_runs_are_those_that_drive_most_loads(results):
    chosen = driving_runs(results, 3)
    assert len(chosen) == 3 and len({case.key for case in chosen}) == 3
    wins = {}
    for row in results.extremes:
        if "@" not in row.column and "_[kN" in row.column and family_of(row.column):
            wins[row.name, row.seed] = wins.get((row.name, row.seed), 0) + 1
    assert (chosen[0].name, chosen[0].seed) == max(wins, key=wins.get)


def test_csv_files_have_every_row(results, tmp_path):
    paths = {path.stem: path for path in write_csv(tmp_path, results)}
    ultimate = pd.read_csv(paths["ultimate"])
    assert len(ultimate) == len(results.extremes)
    row = ultimate[(ultimate["channel"] == MOMENT) & (ultimate["side"] == "max")].iloc[0]
    assert row["not_for_design"] == "rigid tower" and "Wind1VelX_[m/s]" in row["simultaneous"]
    assert len(pd.read_csv(paths["fatigue"])) == len(results.lifetime)
    assert len(pd.read_csv(paths["runs"])) == len(results.cases)
    assert len(pd.read_csv(paths["constraints"])) == len(results.flags)
    assert len(pd.read_csv(paths["extrapolation"])) == len(results.extrapolations)


@pytest.mark.nightly
def test_other_limits_of_constraints_need_no_other_runs():
    cases, finished = small_table()
    wide = load_tables(cases, finished, limits={"platform pitch": 1e3, "overspeed": None})
    before, after = (
        {flag.name: flag for _, flag, _ in each.flags} for each in (load_tables(cases, finished), wide)
    )
    assert before["platform pitch"].exceeded and not after["platform pitch"].exceeded
    assert after["platform pitch"].limit == 1e3 and after["overspeed"].limit is None
    assert after["air gap"] == before["air gap"]


def test_spreadsheets_have_the_layout_of_iea_22(results, tmp_path):
    """Headings, sensors, directions and units as in outputs/04_design_loads of IEA-22-280-RWT (57979ec)."""
    paths = {path.stem.partition("DLB_")[2]: path for path in write_spreadsheets(tmp_path, "oc3", results)}
    extreme = pd.read_excel(paths["directional_extreme_loads"])
    assert list(extreme.columns) == ["sensor_name", "angle", "sensor_unit", "group", "value"]
    tower = extreme[extreme["sensor_name"] == "Tower base bending moment"].set_index("angle")
    assert list(tower.index) == list(ANGLES) == list(range(-150, 181, 30))
    assert set(extreme["sensor_unit"]) == {"kNm"} and (extreme["value"] >= 0.0).all()
    loads = {(row.column, row.side): row for row in results.extremes if row.controller == "pi"}
    assert tower.loc[90, "value"] == pytest.approx(loads[MOMENT, "max"].factored, rel=1e-12)
    assert tower.loc[0, "value"] == pytest.approx(loads["TwrBsMxt_[kN-m]", "max"].factored, rel=1e-12)
    assert tower.loc[-90, "value"] == pytest.approx(max(-loads[MOMENT, "min"].factored, 0.0))
    fatigue = pd.read_excel(paths["directional_equivalent_loads"])
    assert list(fatigue.columns) == ["sensor_name", "angle", "m", "sensor_unit", "value"]
    assert sorted(set(fatigue["m"])) == list(EXPONENTS)
    own = fatigue[(fatigue["sensor_name"] == "Tower base bending moment") & (fatigue["m"] == 4)]
    own = own.set_index("angle")["value"]
    expected = next(
        row.value
        for row in results.lifetime
        if (row.column, row.exponent, row.controller) == (MOMENT, 4, "pi")
    )
    assert own[90] == pytest.approx(expected, rel=1e-12) and own[90] == own[-90] and own[30] == own[-150]
    book = openpyxl.load_workbook(paths["directional_extreme_loads_blade_full"])
    assert book.sheetnames == ["Blade 1 node 1"]
    rows = list(book["Blade 1 node 1"].iter_rows(values_only=True))
    assert rows[0] == ("angle", "Fx", "Fy", "Fz", "Mx", "My", "Mz", "group") and len(rows) == 13
    with pytest.raises(InputError, match="controller = 'x': must be one of pi, lqr"):
        write_spreadsheets(tmp_path, "oc3", results, "x")


def test_blade_rows_are_the_factored_loads_of_the_driving_run(results, tmp_path):
    *_, path = write_spreadsheets(tmp_path, "oc3", results)
    rows = {row[0]: row for row in openpyxl.load_workbook(path)["Blade 1 node 1"].iter_rows(values_only=True)}
    row = next(
        row
        for row in results.extremes
        if (row.column, row.side, row.controller) == ("RootMxc1_[kN-m]", "max", "pi")
    )
    assert rows[0][4] == pytest.approx(row.factor * row.at["RootMxc1_[kN-m]"], rel=1e-12)
    assert rows[0][5] == pytest.approx(row.factor * row.at["RootMyc1_[kN-m]"], rel=1e-12)
    assert rows[0][1] is None  # this run has no forces of the root
    assert rows[0][7] == f"DLC{row.dlc.replace('.', '')}_{row.name}"


def test_channels_that_a_run_lacks_are_left_out():
    cases, finished = small_table()
    short = run_statistics(frame_of(1).drop(columns="FAIRTEN2_[kN]"), SCENE, 0.0)
    key = cases[-1].key
    finished[key] = FinishedRun(*key, "ok", statistics=short)
    found = load_tables(cases, finished)
    assert not any(row.column == "FAIRTEN2_[kN]" for row in found.extremes)
    assert any(row.column == "FAIRTEN1_[kN]" for row in found.extremes)
    assert np.isfinite([row.factored for row in found.extremes]).all()


def test_load_cases_for_fatigue_alone_have_the_sheet_of_fatigue(tmp_path):
    cases, finished = small_table()
    alone = load_tables([case for case in cases if case.analysis == "fatigue"], finished)
    (path,) = write_spreadsheets(tmp_path, "oc3", alone)
    assert "equivalent_loads" in path.name


def test_extrapolated_loads_alone_have_no_spreadsheet_of_directions(tmp_path):
    cases, finished = small_table()
    alone = load_tables([case for case in cases if case.dlc == "1.1"], finished)
    assert alone.extremes
    assert write_spreadsheets(tmp_path, "oc3", alone) == []
