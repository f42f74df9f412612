"""fowt model campbell: a table on the screen, the same figures in a file, and a plot."""

import numpy as np
import pandas as pd
import pytest
from command_line import fowt

from fowt_env.analysis.campbell import campbell
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")


def test_the_file_holds_the_frequencies_of_the_analysis_in_hz_over_rpm(tmp_path):
    table, picture = tmp_path / "campbell.csv", tmp_path / "campbell.png"
    stdout, _ = fowt(
        "model", "campbell", "iea15_volturnus_s", "--speeds", "0:9:3", "--pitch", "5", "--tower", "modes",
        "--generator", "fixed", "--out", str(table), "--plot", str(picture),
    )  # fmt: skip
    rows = pd.read_csv(table)
    assert rows["RotSpeed_[rpm]"].tolist() == pytest.approx([0.0, 3.0, 6.0, 9.0])
    found = campbell(
        read_platform("iea15_volturnus_s"), read_turbine("iea15"), np.radians([0.0, 18.0, 36.0, 54.0]),
        tower="modes", generator="fixed", blade_pitch=np.radians(5.0),
    )  # fmt: skip
    for mode, values in found.frequency.items():
        assert rows[f"{mode}_[Hz]"].to_numpy() == pytest.approx(values, rel=1e-8)
        assert rows[f"{mode}, damping_[%]"].to_numpy() == pytest.approx(100.0 * found.damping[mode], rel=1e-8)
    assert picture.stat().st_size > 10_000
    assert "first flapwise, regressive" in stdout and "9 rpm" in stdout
    assert "3P" in stdout and "Resonances" in stdout


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("iea15_volturnus_s", "--blades", "bend"), ("unknown blades 'bend'", "modes2")),
        (("iea15_volturnus_s", "--speeds", "3:1"), ("speeds",)),
        (("liu_1_50",), ("shaft = 'torsion'", "[shaft_torsion]")),
        (("iea15_volturnus_s", "--out", "table.txt"), (".csv",)),
    ],
)
def test_what_cannot_be_computed_ends_with_a_message(arguments, words):
    _, stderr = fowt("model", "campbell", *arguments, code=2)
    assert all(word in stderr for word in words), stderr
