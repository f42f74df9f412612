"""[tower.modes] of platform files: read beside the file, and checked to the last value."""

import re

import pytest

from fowt_env.descriptions.files import DATA
from fowt_env.descriptions.platform import read_platform
from fowt_env.errors import InputError
from fowt_env.training.evaluation.plant_perturbation import plant_settings

SPAR = (DATA / "platforms" / "oc3_hywind.toml").read_text()
TABLE = (DATA / "platforms" / "oc3_hywind_tower.csv").read_text()


def written(folder, key=None, line="", table=None):
    """Path of a copy of OC3-Hywind's file with another line for a key, and a distribution of its own."""
    text = SPAR
    if key is not None:
        text, count = re.subn(rf"(?m)^{key} = (\[\n(.*\n)*?\]|.*)[^\n]*$", line, text, count=1)
        assert count == 1
    if table is not None:
        (folder / "oc3_hywind_tower.csv").write_text(table)
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def test_the_distribution_lies_beside_the_file_or_among_the_built_in_ones(tmp_path):
    builtin = read_platform("oc3_hywind").tower.modes
    assert read_platform(written(tmp_path)).tower.modes == builtin
    assert builtin.mass_density[0] == 4667.0 and builtin.fore_aft_stiffness[-1] == 8.9488e10
    assert builtin.fore_aft[1] == (42.5859, -18.6419, -20.357, -23.2686, 20.6816)
    heavier = read_platform(written(tmp_path, table=TABLE.replace("0,4667,", "0,4700,", 1))).tower.modes
    assert heavier.mass_density[0] == 4700.0


@pytest.mark.parametrize(
    "name", ["oc3_hywind", "oc3_hywind_openfast", "iea15_volturnus_s", "nrel5mw_oc4_semi"]
)
def test_the_distribution_has_the_mass_of_the_tower(name):
    tower = read_platform(name).tower
    assert tower.modes.mass(tower.top_height - tower.base_height) == pytest.approx(tower.mass, rel=2e-8)


WRONG = {
    "a shape that is not 1 at the top": (
        "side_side", "side_side = [[0.8, 0.2, 0.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.0, 0.0]]",
        ("side_side.1: adds up to 1.1; must be 1",),
    ),
    "a shape of four coefficients": (
        "fore_aft", "fore_aft = [[1.0, 0.0, 0.0, 0.0]]", ("fore_aft.1.5 is missing",),
    ),
    "three modes": (
        "fore_aft", f"fore_aft = {[[1.0, 0.0, 0.0, 0.0, 0.0]] * 3}", ("has 3 shapes; must be 1 or 2",),
    ),
    "damping of one mode": (
        "side_side_damping", "side_side_damping = [0.01]", ("side_side_damping: has 1 entries; must be 2",),
    ),
    "damping in percent": (
        "fore_aft_damping", "fore_aft_damping = [1.0, 1.0]", ("fore_aft_damping.1 = 1.0", ">= 0 and < 1"),
    ),
    "a key that is not known": ("elements", "nodes = 20", ("nodes: unknown key",)),
    "no element": ("elements", "elements = 0", ("elements = 0: must be a whole number >= 1 and <= 999",)),
    "a file that is not there": (
        "distribution", 'distribution = "nowhere.csv"', ("tower file", "nowhere.csv", "does not exist"),
    ),
    "a mass of its own": (
        "elements", "top_mass = 1e5", ("modes.distribution: has a mass of 349718 kg", "within 1%"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("key, line, words", WRONG.values(), ids=WRONG)
def test_a_wrong_value_is_named_with_what_is_allowed(tmp_path, key, line, words):
    with pytest.raises(InputError) as caught:
        read_platform(written(tmp_path, key, line))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("0.2,4034.76", "0.1,4034.76", "line 6: height_fraction = 0.1: must increase"),
        ("1,1953.87", "0.99,1953.87", "goes from 0 to 0.99; must go from 0 to 1"),
        ("0.5,3170.4,", "0.5,-1,", "line 9: mass_density = -1: must be"),
        ("2.60897e+11,2.60897e+11", "2.60897e+11,0", "side_side_stiffness = 0: must be"),
        ("mass_density", "mass", "columns are height_fraction, mass,"),
    ],
)
def test_a_wrong_distribution_is_named_by_its_line(tmp_path, old, new, words):
    with pytest.raises(InputError, match=re.escape(words)):
        read_platform(written(tmp_path, table=TABLE.replace(old, new, 1)))


def test_a_heavier_tower_of_a_perturbed_plant_is_heavier_in_its_modes_too():
    base = read_platform("iea15_volturnus_s").tower
    tower = plant_settings({"upper_mass": 1.05}, "iea15_volturnus_s")["platform"].tower
    assert tower.mass == pytest.approx(1.05 * base.mass)
    height = tower.top_height - tower.base_height
    assert tower.modes.mass(height) == pytest.approx(1.05 * base.modes.mass(height), rel=1e-12)
    assert tower.modes.fore_aft_stiffness == base.modes.fore_aft_stiffness
