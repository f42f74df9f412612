"""The figures that other turbines are scaled by are those of the built-in file."""

from fowt_env.descriptions import nrel5mw
from fowt_env.descriptions.turbine import read_turbine


def test_the_figures_are_those_of_the_turbine_s_file():
    turbine = read_turbine("nrel5mw")
    assert nrel5mw.CUT_IN == turbine.cut_in_wind_speed
    assert nrel5mw.RATED_WIND == turbine.rated_wind_speed
    assert nrel5mw.CUT_OUT == turbine.cut_out_wind_speed
    assert nrel5mw.ROTOR_SPEED == turbine.rated_rotor_speed
    assert nrel5mw.GENERATOR_SPEED == turbine.torque_law.rated_speed
    assert nrel5mw.TORQUE == turbine.torque_law.rated_torque
    assert nrel5mw.PITCH_RATE == turbine.pitch_drive.rate_limit
    assert nrel5mw.TIP_RADIUS == turbine.rotor.tip_radius
    assert nrel5mw.HUB_HEIGHT == turbine.rotor.hub_height
