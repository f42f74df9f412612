"""The rotor's table of coefficients against the loads that the turbine's trims have."""

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.analysis.trim import trim
from fowt_env.controllers.mpc.model import _loads_at
from fowt_env.controllers.mpc.rotor_table import rotor_table
from fowt_env.descriptions.turbine import read_turbine

TABLE = rotor_table(read_turbine("nrel5mw"), 1.225)


def loads(*at):
    """rotor_loads at wind, rotor speed and blade pitch."""
    found = np.empty(8)
    _loads_at(*at, TABLE, found)
    return found


@pytest.mark.parametrize("wind", [9.0, 13.0, 20.0])
def test_loads_are_those_of_the_trim(wind):
    """Within what shear, the leaning platform and the grid of the table do: 4 %."""
    point = trim(build_scene("oc3_hywind", wind=wind, fidelity="standard"), platform="fixed")
    found = loads(wind, point["RotSpeed"] * np.pi / 30.0, np.radians(point["BldPitch1"]))
    assert found[0] == pytest.approx(1e3 * point["RotThrust"], rel=0.04)
    assert found[4] == pytest.approx(1e3 * point["RotTorq"], rel=0.04)


@pytest.mark.parametrize("wind", [9.0, 13.0, 20.0])
def test_slopes_are_differences_of_the_loads(wind):
    at = np.array([wind, 1.25, 0.02 * (wind - 9.0)])
    for i, width in enumerate([0.5, 0.04, 0.02]):
        change = np.zeros(3)
        change[i] = width
        slope = (loads(*(at + change)) - loads(*(at - change))) / (2.0 * width)
        assert loads(*at)[[1 + i, 5 + i]] == pytest.approx(
            slope[[0, 4]], rel=0.1, abs=0.01 * abs(slope).max()
        )


def test_a_turbine_that_is_read_again_has_the_same_table():
    """Each scene reads its turbine: designs whose key is the table's identity are then computed once."""
    table = rotor_table(read_turbine("nrel5mw"), 1.225)
    assert rotor_table(read_turbine("nrel5mw"), 1.225) is table
    assert rotor_table(read_turbine("nrel5mw"), 1.2) is not table
    assert rotor_table(read_turbine("iea15"), 1.225) is not table
