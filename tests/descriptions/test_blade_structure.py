"""[blade_structure] and [shaft_torsion] of turbine files: read beside the file, checked to the last value."""

import re

import numpy as np
import pytest

from fowt_env.descriptions.files import DATA
from fowt_env.descriptions.turbine import read_turbine, turbine_file
from fowt_env.errors import InputError

FILE = turbine_file("nrel5mw_openfast").read_text()
TABLE = (DATA / "turbines" / "nrel5mw" / "blade_structure.csv").read_text()


def written(folder, old="", new="", table=None):
    """Path of a copy of a turbine file with a text replaced, and a distribution of its own."""
    assert old in FILE
    text = FILE.replace(old, new, 1)
    if table is not None:
        (folder / "nrel5mw").mkdir()
        (folder / "nrel5mw" / "blade_structure.csv").write_text(table)
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def test_the_distribution_lies_beside_the_file_or_among_the_built_in_ones(tmp_path):
    builtin = read_turbine("nrel5mw_openfast").blade_structure
    assert np.array_equal(read_turbine(written(tmp_path)).blade_structure.mass_density, builtin.mass_density)
    assert builtin.flapwise_stiffness[0] == 1.811e10 and builtin.edgewise_stiffness[-1] == 5.01e6
    assert builtin.structural_twist[0] == pytest.approx(np.radians(13.308), rel=1e-12)
    assert builtin.flap_2[2] == -15.5349 and builtin.flap_tuner == (1.0, 1.0) and builtin.tip_mass == 0.0
    assert builtin.damping_ratio == pytest.approx((0.00477465,) * 3, rel=1e-12)
    stiffer = read_turbine(written(tmp_path, table=TABLE.replace("1.811e+10", "1.9e+10", 1))).blade_structure
    assert stiffer.flapwise_stiffness[0] == 1.9e10 and stiffer.flapwise_stiffness[1] == 1.811e10


@pytest.mark.parametrize("name, near", [("iea15", 1e-9), ("nrel5mw", 6e-4), ("nrel5mw_tilted", 1e-9)])
def test_the_distribution_has_the_mass_and_moments_of_the_blade(name, near):
    turbine = read_turbine(name)
    rotor = turbine.rotor
    lumps = turbine.blade_structure.lumps(rotor.hub_radius, rotor.tip_radius)
    span = lumps.radius - rotor.hub_radius
    moments = [rotor.blade_mass, rotor.blade_first_moment, rotor.blade_second_moment]
    assert [lumps.mass @ span**power for power in range(3)] == pytest.approx(moments, rel=near)


def test_the_shaft_of_the_5_mw_turbine_is_as_stiff_as_published():
    """NREL/TP-500-38060, Table 5-1: 867,637,000 N m/rad and 6,215,000 N m/(rad/s)."""
    for name in ("nrel5mw", "nrel5mw_openfast", "nrel5mw_tilted"):
        assert read_turbine(name).shaft_torsion.model_dump() == {"stiffness": 867637e3, "damping": 6215e3}
    assert read_turbine("liu_1_50").shaft_torsion is None


WRONG = {
    "a shape that is not 1 at the tip": (
        "flap_1 = [0.0622,", "flap_1 = [0.1622,", "blade_structure: flap_1: adds up to 1.1; must be 1",
    ),
    "a shape of four coefficients": (
        "edge_1 = [0.3627, ", "edge_1 = [", "blade_structure.edge_1.5 is missing",
    ),
    "no damping of the second mode": (
        "percent = [0.477465, 0.477465, 0.477465]", "percent = [0.477465, 0.477465]",
        "blade_structure.damping_ratio_percent.3 is missing",
    ),
    "a damping above critical": (
        "percent = [0.477465,", "percent = [110.0,",
        "blade_structure.damping_ratio_percent.1 = 110.0: must be a number >= 0 and < 1",
    ),
    "no element": (
        "elements = 17", "elements = 0", "blade_structure.elements = 0: must be a whole number >= 1",
    ),
    "a key that is not known": ("elements = 17", "nodes = 17", "blade_structure.nodes: unknown key"),
    "a tuner of zero": (
        "elements = 17", "flap_tuner = [1, 0.0]", "blade_structure.flap_tuner.2 = 0.0: must be a number > 0",
    ),
    "a file that is not there": ("nrel5mw/blade_structure", "nowhere", "nowhere.csv' does not exist"),
    "a mass of its own": (
        "elements = 17", "elements = 17\ntip_mass = 200.0",
        "makes blade_mass = 17736.6 with tip_mass; must be the rotor's 17536.6 within 1%",
    ),
    "a shaft without stiffness": (
        "stiffness = 867637000.0", "stiffness = 0.0", "shaft_torsion.stiffness = 0.0: must be a number > 0",
    ),
    "a shaft that drives itself": (
        "damping = 6215000.0", "damping = -1.0", "shaft_torsion.damping = -1.0: must be a number >= 0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("old, new, words", WRONG.values(), ids=WRONG)
def test_a_wrong_value_is_named_with_what_is_allowed(tmp_path, old, new, words):
    with pytest.raises(InputError, match=re.escape(words)):
        read_turbine(written(tmp_path, old, new))


def test_the_mass_of_the_blades_is_needed(tmp_path):
    path = written(tmp_path)
    path.write_text(re.sub(r"(?m)^blade_(mass|first|second).*$", "", path.read_text()))
    with pytest.raises(InputError, match=r"rotor.blade_mass: is missing; \[blade_structure\] needs"):
        read_turbine(path)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("\n0.01951,", "\n0.001,", "line 6: span_fraction = 0.001: must increase"),
        ("\n1,0,", "\n0.999,0,", "goes from 0 to 0.999; must go from 0 to 1"),
        ("mass_density,", "mass,", "columns are span_fraction, structural_twist_deg, mass,"),
        (",1.811e+10,", ",-1,", "line 4: flapwise_stiffness = -1: must be"),
        (",5010000", ",0", "edgewise_stiffness = 0: must be"),
        ("13.308,", "190,", "structural_twist_deg = 190: must be a number >= -180 and <= 180"),
    ],
)
def test_a_wrong_distribution_is_named_by_its_line(tmp_path, old, new, words):
    assert old in TABLE
    with pytest.raises(InputError, match=re.escape(words)):
        read_turbine(written(tmp_path, table=TABLE.replace(old, new, 1)))


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"span_fraction": [0.0, 1.0]}, "need the same length, at least 2; got [2, 49,"),
        ({"mass_density": np.zeros(49)}, "mass_density.1 = 0: must be > 0 and <= 1e+09"),
        ({"span_fraction": np.linspace(0.0, 0.9, 49)}, "span_fraction: goes from 0 to 0.9; must increase"),
    ],
)
def test_a_structure_made_in_python_is_checked_too(changes, words):
    structure = read_turbine("nrel5mw").blade_structure
    values = {name: getattr(structure, name) for name in type(structure).model_fields} | changes
    with pytest.raises(ValueError, match=re.escape(words)):
        type(structure)(**values)
