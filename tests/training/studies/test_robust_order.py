"""The variations of the robustness table, and its ranks, without runs of the whole table."""

import pytest

from fowt_env import build_scene
from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import mean_speed, read_suite
from fowt_env.training.studies.robust_order import UNCHANGED, VARIATIONS, rank_correlation, varied


def test_each_variation_changes_what_its_name_says_and_keeps_the_winds():
    plain = varied("above_rated", UNCHANGED)
    whole = read_suite("above_rated").cases
    assert list(plain.cases) == [case for case in whole if mean_speed(case) in (12.0, 14.0, 18.0, 22.0)]
    cases = {name: varied("above_rated", name).cases for name in VARIATIONS}
    assert all(len(each) == 4 for each in cases.values())
    assert len({str(each) for each in cases.values()}) == len(VARIATIONS)
    assert cases["exact sensors"][0].sensors == "exact" != plain.cases[0].sensors
    assert cases["drag -10 %"][0].shift.factors == {"drag": 0.9}
    assert cases["dynamic inflow"][0].options == plain.cases[0].options | {"dynamic_inflow": True}
    assert cases["elastic"][0].options == plain.cases[0].options | {"fidelity": "elastic"}
    assert [case.wind["speed"] for case in cases["extreme turbulence"]] == [12.0, 14.0, 18.0, 22.0]
    assert [case.wind["speed"] for case in cases["iea15_volturnus_s"]] == [11.0, 13.0, 17.0, 21.0]


@pytest.mark.parametrize("name", ["extreme turbulence", "Kaimal at a point"])
def test_the_winds_of_a_variation_are_accepted_and_differ(name):
    plain, other = (
        build_scene("oc3_hywind", wind=varied("above_rated", each).cases[2].wind, seed=3, duration=60.0)
        for each in (UNCHANGED, name)
    )
    mine, theirs = (scene.model.aero.wind for scene in (plain, other))
    assert str(mine) != str(theirs)


def test_the_rank_correlation_is_that_of_the_order():
    scores = {"a": 0.5, "b": 0.7, "c": 0.9}
    assert rank_correlation(scores, {"a": 1.0, "b": 2.0, "c": 3.0}) == pytest.approx(1.0)
    assert rank_correlation(scores, {"a": 3.0, "b": 2.0, "c": 1.0}) == pytest.approx(-1.0)
    assert rank_correlation(scores, {"a": 1.0, "b": 3.0, "c": 2.0}) == pytest.approx(0.5)


def test_winds_without_a_case_are_named():
    with pytest.raises(InputError, match=r"winds = \[13.0\]: suite 'above_rated' has no case"):
        varied("above_rated", UNCHANGED, (13.0,))
