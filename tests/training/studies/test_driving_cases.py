"""Driving runs of a load table beside OpenFAST's: decks, names, extremes of all blades, limits by part."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.files.tables import write_table
from fowt_env.training.studies import driving_cases
from fowt_env.training.studies.driving_cases import COLUMNS, compared, matrix_of, named, table, within

SEMI = "iea15_volturnus_s"
DECKS = Path(__file__).parents[2] / "reference" / "decks"

TIME = np.arange(0.0, 120.0, 0.1)


def series(**columns):
    return pd.DataFrame({"Time_[s]": TIME} | columns)


@pytest.fixture
def folder(tmp_path):
    """A driving run whose first blade and line differ by known factors; the transient is far off."""
    place = tmp_path / "01_case"
    place.mkdir()
    wave, start = np.sin(0.5 * TIME), np.where(TIME < 20.0, 1e3, 0.0)
    here = {f"RootMyc{i}_[kN-m]": (100.0 + 10.0 * i * wave) + start for i in (1, 2, 3)}
    theirs = here | {"RootMyc3_[kN-m]": 100.0 + 40.0 * wave}
    write_table(series(**here, **{"FAIRTEN1_[kN]": 800.0 + 50.0 * wave}), place / "run.outb")
    write_table(series(**theirs, **{"T[1]_[N]": 1e3 * (800.0 + 40.0 * wave)}), place / "model.outb")
    return place


def test_extremes_are_over_the_blades_and_fatigue_loads_their_mean(folder):
    figures = pd.DataFrame(compared(folder, 20.0), columns=list(COLUMNS)).set_index("channel")
    blade, line = figures.loc["RootMyc"], figures.loc["FAIRTEN1"]
    assert blade["largest"] == pytest.approx(130.0, rel=1e-3) and blade["largest_other"] == pytest.approx(
        140.0, rel=1e-3
    )
    assert blade["largest_%"] == pytest.approx(-100.0 / 14.0, rel=2e-2)
    assert blade["smallest_%"] == pytest.approx(100.0 / 14.0, rel=2e-2)  # of the largest magnitude
    assert blade["DEL_%"] == pytest.approx(100.0 * (60.0 / 70.0 - 1.0), rel=1e-2)
    assert line["unit"] == "kN" and line["largest_%"] == pytest.approx(1000.0 / 840.0, rel=1e-2)
    assert line["DEL_%"] == pytest.approx(25.0, rel=1e-2)
    inside = {(part, key): (found, count) for part, key, _, found, count, *_ in within(figures.reset_index())}
    assert inside["fairlead", "largest_%"] == (1, 1) and inside["fairlead", "DEL_%"] == (0, 1)
    assert inside["blade root", "largest_%"] == (0, 1)


def test_a_run_that_ended_within_the_transient_is_named(folder, capsys, tmp_path):
    table(tmp_path, skip=20.0, out_path=tmp_path / "figures.csv")
    assert len(pd.read_csv(tmp_path / "figures.csv")) == 2
    write_table(series(**{"RotSpeed_[rpm]": TIME}).iloc[:50], folder / "model.outb")
    table(tmp_path, skip=20.0)
    assert "01_case: " in capsys.readouterr().out


def test_tensions_of_map_have_the_names_here():
    assert list(named(pd.DataFrame({"T[2]_[N]": [1.0], "T_a[2]_[N]": [1.0]}))) == [
        "FAIRTEN2_[N]",
        "T_a[2]_[N]",
    ]


def test_the_table_has_the_options_of_the_deck():
    spar, site = matrix_of("oc3_hywind", "1.3,6.1", 600.0, 240.0)
    assert site.design.transient == 240.0 and {load.duration for load in spar.cases} == {840.0}
    assert {load.case.options["strip_axis"] for load in spar.cases} == {"undisplaced"}
    assert {load.case.options["fidelity"] for load in spar.cases} == {"elastic"}
    assert {load.case.sensors for load in spar.cases} == {"exact"}
    few, _ = matrix_of("oc3_hywind", "1.3,6.1", 600.0, 240.0, ["dlc1.3_u24", "dlc6.1"])
    assert {load.dlc for load in few.cases} == {"1.3", "6.1"} and few.cases[0].wind_speed == 24.0
    with pytest.raises(InputError, match="conditions = 'dlc9': must be beginnings of dlc1.3_u"):
        matrix_of("oc3_hywind", "1.3", 600.0, 240.0, ["dlc9"])
    semi, _ = matrix_of(SEMI, "1.3", 600.0, 240.0)
    options = semi.cases[0].case.options
    assert options["skewed_wake"] and options["shaft"] == "rigid" and "strip_axis" not in options


def test_the_deck_has_waves_wind_and_a_controller_for_the_runs_to_set(tmp_path):
    root = tmp_path / "decks" / SEMI
    shutil.copytree(DECKS / "IEA-15-240-RWT" / "OpenFAST", root / "OpenFAST")
    shutil.copytree(DECKS / "ROSCO", root / "rosco_v2.10_deck")
    path = driving_cases.write_base_deck(root.parent, SEMI, tmp_path / "deck")

    def value(part, key):
        return re.search(rf"^(\S+) +{key}$", (path.parent / part).read_text(), re.M)[1]

    assert [value("model.fst", key) for key in ("CompInflow", "CompAero", "CompServo")] == ["1", "2", "1"]
    assert value("HD.dat", "ExctnMod") == "1" and value("ED.dat", "FlapDOF2") == "True"
    assert re.search(r"^2\s+DBEMT_Mod", (path.parent / "AD.dat").read_text(), re.M)


def test_openfast_runs_once_in_each_folder_and_a_failure_is_told(folder, tmp_path):
    program = tmp_path / "openfast"
    program.write_text("#!/bin/sh\necho ran >> log\n[ -f bad ] || echo terminated normally\n")
    program.chmod(0o755)
    (folder / "model.fst").write_text("")
    for _ in range(2):
        driving_cases.openfast(tmp_path, str(program))
    assert (folder / "log").read_text() == "ran\n"
    other = tmp_path / "02_case"
    other.mkdir()
    for name in ("model.fst", "bad"):
        (other / name).write_text("")
    with pytest.raises(InputError, match="1 runs of OpenFAST failed"):
        driving_cases.openfast(tmp_path, str(program))
    assert not (other / driving_cases.DONE).exists()
