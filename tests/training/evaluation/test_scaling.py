"""Suites on another platform: winds, limits and starts in terms of its turbine."""

import pytest

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import all_cases, mean_speed, named_cases, read_suite, suite_names
from fowt_env.training.evaluation.scaling import Scaling

LARGER = "oc3_froude_10mw"  # rated 12.59, cut-out 27.60 m/s


@pytest.fixture(scope="module")
def scaling():
    return Scaling(read_turbine("nrel5mw"), read_turbine(LARGER))


@pytest.mark.parametrize("name", suite_names())
def test_every_suite_can_be_run_on_every_platform(name):
    ours, theirs = read_suite(name), read_suite(name, LARGER)
    assert {case.platform for case in theirs.cases} == {LARGER}
    assert len(theirs.cases) == len(ours.cases)
    assert read_suite(name, "oc3_hywind").cases == ours.cases


def test_winds_above_rated_stay_above_rated_and_up_to_cut_out():
    turbine = read_turbine(LARGER)
    speeds = [mean_speed(case) for case in read_suite("above_rated", LARGER).cases]
    assert speeds == [13.0, 15.0, 17.0, 19.0, 21.0, 23.0, 25.0]
    assert turbine.rated_wind_speed < min(speeds) and max(speeds) <= turbine.cut_out_wind_speed


def test_marked_winds_are_those_of_the_turbine(scaling):
    turbine = scaling.new
    assert scaling.wind(11.4) == turbine.rated_wind_speed
    assert scaling.wind(25.0) == turbine.cut_out_wind_speed
    assert scaling.wind(13.4) == pytest.approx(turbine.rated_wind_speed + 2.0, abs=0.01)
    assert scaling.wind(50.0) == 50.0  # a storm on a parked turbine
    below = [scaling.wind(float(speed)) for speed in (4, 6, 8, 10)]
    assert below == sorted(set(below)) and max(below) < turbine.rated_wind_speed


def test_limits_are_those_of_the_turbine():
    ours, theirs = read_suite("above_rated").limits, read_suite("above_rated", LARGER).limits
    assert theirs.run["GenPwr_max_[kW]"] == pytest.approx(2.0 * ours.run["GenPwr_max_[kW]"], rel=1e-3)
    old, new = (read_turbine(name).torque_law.rated_torque for name in ("nrel5mw", LARGER))
    name = "torque_travel_[kN-m/s]"
    assert theirs.lifetime[name] == pytest.approx(ours.lifetime[name] * new / old)
    assert theirs.relative == ours.relative
    assert read_suite("settling", LARGER).limits.run == read_suite("settling").limits.run  # per cent, degrees


def test_a_start_is_displaced_from_the_platforms_own_trim():
    for ours, theirs in zip(read_suite("settling").cases, read_suite("settling", LARGER).cases, strict=True):
        assert ours.initial and ours.displaced is None
        assert theirs.initial is None and theirs.displaced == {"PtfmPitch": 0.5}
        assert theirs.name == f"settling_{mean_speed(theirs):g}"


def test_with_the_same_turbine_the_winds_stay():
    ours, theirs = read_suite("gusts"), read_suite("gusts", "oc3_hywind_openfast")
    assert [case.wind for case in theirs.cases] == [case.wind for case in ours.cases]


def test_cases_are_named_after_their_winds():
    assert [case.name for case in named_cases("ntm_13", LARGER)] == ["ntm_13"]
    with pytest.raises(InputError, match="ntm_12"):
        named_cases("ntm_12", LARGER)
    assert len(all_cases(LARGER)) <= len(all_cases())


def test_a_start_of_another_platform_alone_is_refused(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'version = 1\ndescription = "d"\nsource = "s"\nwind = "rotor-averaged"\nturbine = "nrel5mw"\n'
        "duration = 100.0\n[[case]]\nname = 'one'\nwind = 18.0\ninitial = {PtfmPitch = 3.0}\n"
    )
    read_suite(path)
    with pytest.raises(InputError, match=r"case 'one': initial.*displaced"):
        read_suite(path, LARGER)
