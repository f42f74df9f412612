"""Units of files: what they are worth, and that no other module spells them out."""

import re
from pathlib import Path

import pytest

import fowt_env
from fowt_env.descriptions import units
from fowt_env.descriptions.turbine import read_turbine

ROOT = Path(fowt_env.__file__).resolve().parent.parent
FACTOR = re.compile(r"\bpi\s*/\s*(180|30)\b|\bpi\s*/\s*60\b|\b(180|30|60)(\.0)?\s*/\s*\(?(np\.|math\.)?pi\b")
OWN = ("fowt_env/plant", "fowt_env/envs")  # layers below and beside, whose kernels freeze their own factors
SOURCES = [
    path
    for top in ("fowt_env", "controllers", "training", "docs/tools")
    for path in sorted((ROOT / top).rglob("*.py"))
    if not str(path.relative_to(ROOT)).startswith((*OWN, "fowt_env/descriptions/units.py"))
]


def test_a_figure_times_its_unit_is_si():
    assert 60.0 * units.RPM == pytest.approx(2.0 * 3.141592653589793, rel=1e-15)  # one turn a second
    assert 360.0 * units.DEGREE == pytest.approx(2.0 * 3.141592653589793, rel=1e-15)
    assert read_turbine("nrel5mw").rated_rotor_speed / units.RPM == pytest.approx(12.1, rel=1e-15)


def test_no_other_module_spells_out_a_unit():
    assert len(SOURCES) > 150
    found = [str(path) for path in SOURCES if FACTOR.search(path.read_text(encoding="utf-8"))]
    assert not found
