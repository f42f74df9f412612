"""Driving runs of a load table beside OpenFAST's: names, extremes of all blades, limits by part."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.files.tables import write_table
from fowt_env.training.studies.driving_cases import COLUMNS, compared, main, named, within

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
    table = pd.DataFrame(compared(folder, 20.0), columns=list(COLUMNS)).set_index("channel")
    blade, line = table.loc["RootMyc"], table.loc["FAIRTEN1"]
    assert blade["largest"] == pytest.approx(130.0, rel=1e-3) and blade["largest_other"] == pytest.approx(
        140.0, rel=1e-3
    )
    assert blade["largest_%"] == pytest.approx(-100.0 / 14.0, rel=2e-2)
    assert blade["smallest_%"] == pytest.approx(100.0 / 14.0, rel=2e-2)  # of the largest magnitude
    assert blade["DEL_%"] == pytest.approx(100.0 * (60.0 / 70.0 - 1.0), rel=1e-2)
    assert line["unit"] == "kN" and line["largest_%"] == pytest.approx(1000.0 / 840.0, rel=1e-2)
    assert line["DEL_%"] == pytest.approx(25.0, rel=1e-2)
    inside = {(part, key): (found, count) for part, key, _, found, count, *_ in within(table.reset_index())}
    assert inside["fairlead", "largest_%"] == (1, 1) and inside["fairlead", "DEL_%"] == (0, 1)
    assert inside["blade root", "largest_%"] == (0, 1)


def test_a_run_that_ended_within_the_transient_is_named(folder, capsys, tmp_path):
    main(tmp_path, skip=20.0, out_path=tmp_path / "figures.csv")
    assert len(pd.read_csv(tmp_path / "figures.csv")) == 2
    write_table(series(**{"RotSpeed_[rpm]": TIME}).iloc[:50], folder / "model.outb")
    main(tmp_path, skip=20.0)
    assert "01_case: " in capsys.readouterr().out


def test_tensions_of_map_have_the_names_here():
    assert list(named(pd.DataFrame({"T[2]_[N]": [1.0], "T_a[2]_[N]": [1.0]}))) == [
        "FAIRTEN2_[N]",
        "T_a[2]_[N]",
    ]
