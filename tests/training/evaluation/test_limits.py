"""Limits of a suite: where each is held, not decided or exceeded."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.training.evaluation.bootstrap import LEAST_SEEDS
from fowt_env.training.evaluation.carried import CARRIED, missing_part
from fowt_env.training.evaluation.cases import Case, Limits, Score, ScoreTerm, SetPoint, read_suite
from fowt_env.training.evaluation.evaluate import COLUMNS
from fowt_env.training.evaluation.leaderboard import leaderboard
from fowt_env.training.evaluation.limits import EXCEEDED, HELD, UNDECIDED, Decision, allowed_range
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.evaluation.run_case import REFERENCE

SHAFT, ENERGY, SPEED = "RotTorq_DEL_[kN-m]", "GenPwr_capped_mean_[kW]", "RotSpeed_mean_[rpm]"
TRAVEL = "blade_pitch_travel_[deg/s]"


def board(ratios, metric=SHAFT, base=1.0, weights=None, score=None, **limits):
    """The entry of a law whose metric is a ratio {case: one per seed} of the reference's, which is `base`."""
    rows = []
    for case, values in ratios.items():
        for seed, value in enumerate(values):
            for who in (REFERENCE, "x"):
                row = dict.fromkeys(COLUMNS, np.nan) | dict.fromkeys(METRICS, base)
                row |= {"controller": who, "case": case, "seed": seed, "status": "ok", "reason": ""}
                row |= {} if weights is None else {"weight_[-]": weights[case]}
                if who != REFERENCE:
                    row |= {"status": "tripped"} if value is None else {metric: base * value}
                rows.append(row)
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    return leaderboard(table, score=score, limits=Limits(**limits))["controllers"][0]


def states(entry):
    return {each["case"]: each["state"] for each in entry["limits"]}


QUIET = [1.09, 1.1, 1.11, 1.1]
WIDE = [0.9, 1.4, 1.0, 1.1]  # its mean is within 1.25, its bound is not
BAD = [1.3, 1.31, 1.29, 1.3]


def test_a_limit_is_decided_in_each_case_by_the_mean_and_by_its_bound():
    entry = board({"a": QUIET, "b": WIDE, "c": BAD}, case_relative={SHAFT: (1.25,)})
    assert states(entry) == {"a": HELD, "b": UNDECIDED, "c": EXCEEDED}
    assert entry["held"] is False and len(entry["beyond"]) == len(entry["undecided"]) == 1
    (text,) = entry["beyond"]
    assert text.startswith("shaft-torque DEL over gspi_oc3 = 1.3 [1.2") and "in c" in text
    assert "in b" in entry["undecided"][0] and "in a" not in entry["undecided"][0]
    held = board({"a": QUIET, "b": QUIET}, case_relative={SHAFT: (1.25,)})
    assert held["held"] is True and not held["beyond"] and not held["undecided"]
    assert board({"a": QUIET})["held"] is None  # no limit


def test_a_mean_over_the_cases_hides_none_of_them():
    ratios = {"a": [0.5, 0.51, 0.5, 0.49], "b": BAD}
    weights = {"a": 0.9, "b": 0.1}
    assert states(board(ratios, relative={SHAFT: 1.25}, weights=weights))[""] == HELD
    assert states(board(ratios, case_relative={SHAFT: (1.25,)}, weights=weights))["b"] == EXCEEDED


def test_a_bound_is_one_sided_and_few_seeds_have_none():
    found = board({"a": WIDE}, case_relative={SHAFT: (1.25,)})["limits"][0]
    both = board({"a": WIDE}, case_relative={SHAFT: (1.25,)})["metrics"][SHAFT]
    assert found["value"] == pytest.approx(both["mean"]) and both["low"] < found["low"] < 1.0
    assert found["high"] < both["high"]  # of 95 % on one side, not 97.5 %
    few = board({"a": QUIET[: LEAST_SEEDS - 1]}, case_relative={SHAFT: (1.25,)})
    assert states(few) == {"a": UNDECIDED} and few["held"] is False and not few["undecided"]
    assert states(board({"a": [1.3]}, case_relative={SHAFT: (1.25,)})) == {"a": EXCEEDED}


def test_scatter_and_a_single_bad_seed_protect_from_no_limit():
    bad = [1.0] * 7 + [2.5]  # one of eight
    found = board({"a": bad}, case_relative={SHAFT: (1.25,)})["limits"][0]
    assert found["low"] < 1.25 < found["value"] and found["state"] == EXCEEDED


def test_a_single_number_limits_what_is_worse_and_two_limit_both_sides():
    assert allowed_range(SHAFT, (1.25,)) == (-np.inf, 1.25)
    assert allowed_range(ENERGY, (0.99,)) == (0.99, np.inf)
    less = [0.97, 0.971, 0.969, 0.97]
    assert states(board({"a": less}, ENERGY, case_relative={ENERGY: (0.99,)})) == {"a": EXCEEDED}
    assert states(board({"a": QUIET}, ENERGY, case_relative={ENERGY: (0.99,)})) == {"a": HELD}
    entry = board({"a": less}, SPEED, case_relative={SPEED: (0.995, 1.005)})
    assert "allowed 0.995 to 1.005" in entry["beyond"][0]
    assert "allowed at least 0.99" in board({"a": less}, ENERGY, case_relative={ENERGY: (0.99,)})["beyond"][0]


@pytest.mark.parametrize(
    ("base", "ratio", "state"),
    [
        (12.1, 1.004, HELD), (12.1, 0.996, HELD), (12.1, 1.006, EXCEEDED), (12.1, 0.994, EXCEEDED),
        # lulls in which the reference is 1 % slow: 0.5 % more than that is allowed, to either side
        (11.979, 1.0, HELD), (11.979, 1.024, HELD), (11.979, 0.996, HELD), (11.979, 0.994, EXCEEDED),
        (11.979, 1.026, EXCEEDED),
    ],
)  # fmt: skip
def test_a_set_point_is_held_as_well_as_by_the_reference_and_half_a_percent(base, ratio, state):
    seeds = ratio + 1e-5 * np.array([0.0, 1.0, -1.0, 0.0])
    entry = board({"a": seeds}, SPEED, base, set_point={SPEED: SetPoint(rated=12.1, within=0.005)})
    assert states(entry) == {"a": state}


def test_a_limit_of_each_run_and_one_of_the_mean_of_a_case_are_in_their_own_unit():
    entry = board({"a": [1.0, 1.0, 1.0, 1.3], "b": [1.0] * 4}, base=5000.0, run={SHAFT: 6000.0})
    assert states(entry) == {"": EXCEEDED}
    assert entry["beyond"] == ["shaft-torque DEL (kN-m) = 6500, allowed 6000"]
    entry = board({"a": [1.01] * 4, "b": [1.0] * 4}, base=5000.0, case={SHAFT: 5025.0})
    assert states(entry) == {"a": EXCEEDED, "b": HELD}
    entry = board({"a": [1.0] * 4}, ENERGY, 5000.0, case={ENERGY: 5025.0})  # at most, though more is better
    assert states(entry) == {"a": HELD}
    assert states(board({"a": [1.0] * 4}, lifetime={SHAFT: 1.1})) == {"": HELD}


def test_lost_runs_are_not_counted_and_a_metric_that_a_run_lacks_is_beyond():
    rules = {"case_relative": {SHAFT: (1.25,)}}
    assert states(board({"a": [*QUIET, None], "b": [None] * 4}, **rules)) == {"a": HELD}
    assert states(board({"a": [*QUIET, np.nan]}, **rules)) == {"a": EXCEEDED}


def test_a_score_is_the_worse_of_lifetime_and_mean_of_winds_where_the_suite_says_so():
    frequent, rare = [0.5, 0.6, 0.55, 0.45], [1.4, 1.5, 1.45, 1.6]
    ratios, weights = {"a": frequent, "b": rare}, {"a": 0.9, "b": 0.1}

    def score(by):
        term = (ScoreTerm(metric=TRAVEL, weight=1.0),)
        rule = Score(baseline="gspi_oc3", term=term, by=by)
        return board(ratios, TRAVEL, weights=weights, score=rule)["score"]

    found = score("worse")
    lifetime, winds = 0.9 * np.mean(frequent) + 0.1 * np.mean(rare), np.mean([*frequent, *rare])
    assert found["lifetime"]["mean"] == pytest.approx(lifetime)
    assert found["winds"]["mean"] == found["mean"] == pytest.approx(winds)
    for each in (found, found["winds"], found["lifetime"]):
        assert each["low"] < each["mean"] < each["high"]
    assert score("lifetime")["mean"] == found["lifetime"]["mean"] != score("winds")["mean"]


@pytest.mark.parametrize(
    ("value", "allowed", "excess"),
    [
        (1.5, (-np.inf, 1.25), 0.2), (1.2, (-np.inf, 1.25), 0.0), (0.9, (0.99, np.inf), 0.09 / 0.99),
        (1.0, (0.99, np.inf), 0.0), (0.9, (0.995, 1.005), 0.095 / 0.995), (2.0, (-np.inf, 0.0), 2.0),
    ],
)  # fmt: skip
def test_an_excess_is_a_fraction_of_the_limit(value, allowed, excess):
    nan = float("nan")
    assert Decision(SHAFT, "", "", value, nan, nan, *allowed).excess == pytest.approx(excess)


HEAD = """
version = 1
description = "d"
source = "s"
wind = "rotor-averaged"
duration = 100.0
{options}
[[case]]
name = "a"
wind = 16.0
"""


@pytest.mark.parametrize("metric", CARRIED)
def test_a_suite_scores_and_limits_only_loads_that_its_scenes_carry(metric, tmp_path):
    option, values = CARRIED[metric]
    path = tmp_path / "mine.toml"
    score = f'[score]\nbaseline = "pi"\n[[score.term]]\nmetric = "{metric}"\nweight = 1.0\n'
    limit = f'[limits.case_relative]\n"{metric}" = 1.25\n'
    for text, key in ((score, "score"), (limit, "limits")):
        path.write_text(HEAD.format(options="") + text)
        with pytest.raises(InputError) as error:
            read_suite(path)
        for word in (key, metric, "case 'a'", option, repr(values[-1]), "rigid_loads"):
            assert word in str(error.value)
        path.write_text(HEAD.format(options="rigid_loads = true") + text)
        read_suite(path)
        path.write_text(HEAD.format(options=f'options = {{{option} = "{values[-1]}"}}') + text)
        read_suite(path)


def test_a_fidelity_carries_the_loads_of_its_parts_and_an_option_overrides_it():
    elastic = {"fidelity": "elastic"}
    for metric, (option, values) in CARRIED.items():
        case = Case("a", 16.0, options=elastic)
        assert (missing_part(metric, case) is None) == (option != "mooring")
        rigid = Case("a", 16.0, options=elastic | {option: "catenary" if option == "mooring" else "rigid"})
        assert missing_part(metric, rigid) == (option, rigid.options[option], values)
    assert missing_part("RotSpeed_std_[rpm]", Case("a", 16.0)) is None
    with pytest.raises(InputError, match="elastc.*elastic"):
        missing_part(SHAFT, Case("a", 16.0, options={"fidelity": "elastc"}))


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (f'"{SPEED}" = 1.01', "[least, most]"),
        (f'"{SHAFT}" = [1.2, 0.9]', "a number or [least, most]"),
        (f'"{SHAFT}" = -1.0', "case_relative"),
        ('"RotTorc_DEL_[kN-m]" = 1.2', "'RotTorq_DEL_[kN-m]'"),
    ],
)
def test_a_wrong_limit_is_refused_with_its_key(line, message, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(HEAD.format(options="rigid_loads = true") + f"[limits.case_relative]\n{line}\n")
    with pytest.raises(InputError) as error:
        read_suite(path)
    assert message in str(error.value)


def test_limits_of_a_case_and_set_points_scale_with_the_turbine():
    large = read_suite("above_rated_elastic", "iea15_volturnus_s").limits
    own = read_suite("above_rated_elastic").limits
    assert large.case["GenPwr_mean_[kW]"] == pytest.approx(3.0 * own.case["GenPwr_mean_[kW]"], rel=1e-3)
    assert large.set_point[SPEED].rated == pytest.approx(7.56, rel=1e-2)
    assert large.set_point[SPEED].within == own.set_point[SPEED].within
    assert large.case_relative == own.case_relative
