"""Means, intervals and paired differences on tables whose answers are known."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import Limits, Score, ScoreTerm
from fowt_env.training.evaluation.evaluate import COLUMNS, summary
from fowt_env.training.evaluation.failures import PENALTY
from fowt_env.training.evaluation.leaderboard import leaderboard
from fowt_env.training.evaluation.metrics import METRICS, never_negative
from fowt_env.training.evaluation.run_case import REFERENCE

TRAVEL = "blade_pitch_travel_[deg/s]"  # a plain mean over the lifetime, of which less is better
SPEED_SCORE = Score(baseline="pi", term=(ScoreTerm(metric=TRAVEL, weight=1.0),))


def table(figures, reference=None):
    """Table of {(controller, case, seed): value of every metric, or None for a failed run}.

    reference: the controller whose figures the reference has, too.
    """
    rows = []
    theirs = {(REFERENCE, *key): value for (name, *key), value in figures.items() if name == reference}
    figures = figures | theirs
    for (controller, case, seed), value in figures.items():
        row = dict.fromkeys(COLUMNS, np.nan) | {"controller": controller, "case": case, "seed": seed}
        row |= {"status": "ok" if value is not None else "failed", "reason": ""}
        rows.append(row | (dict.fromkeys(METRICS, value) if value is not None else {}))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def noisy(controllers, cases, seeds, random_seed=0, spread=1.0):
    """Figures with a common part per seed, as paired runs have, and an offset per controller and case."""
    rng = np.random.default_rng(random_seed)
    common = {seed: rng.normal() for seed in seeds}
    return {
        (name, f"c{c}", seed): 10.0 + c + offset + common[seed] + spread * 0.01 * rng.normal()
        for c in range(cases)
        for seed in seeds
        for name, offset in controllers.items()
    }


def entry(board, name):
    return next(item for item in board["controllers"] if item["controller"] == name)


def test_means_count_every_case_alike_however_many_seeds_it_has():
    figures = {("pi", "a", seed): 1.0 for seed in range(5)} | {("pi", "b", 0): 3.0}
    figure = entry(leaderboard(table(figures)), "pi")["metrics"][TRAVEL]
    assert figure["mean"] == pytest.approx(2.0) and figure["worst"] == 3.0


def test_means_by_case_are_those_of_a_leaderboard_of_the_case():
    """A mean of standard deviations or fatigue loads has one value, in whichever table it stands."""
    runs = table({("pi", "a", 1): 1.0, ("pi", "a", 2): 3.0, ("pi", "a", 3): None})
    means, metrics = summary(runs).iloc[0], entry(leaderboard(runs), "pi")["metrics"]
    assert {name: means[name] for name in METRICS} == pytest.approx(
        {name: metrics[name]["mean"] for name in METRICS}
    )
    assert means["RotSpeed_std_[rpm]"] == pytest.approx(5.0**0.5) and means[TRAVEL] == pytest.approx(2.0)


def test_an_interval_is_that_of_the_mean_over_cases_whose_seeds_are_drawn_together():
    values = dict(enumerate([10.0, 11.0, 9.5, 12.0, 10.5]))
    shifts = {"a": 0.0, "b": 0.0, "c": 9.0}  # their mean is 3, their median 0, their greatest 9
    one, three = (
        entry(
            leaderboard(table({("pi", case, s): values[s] + shifts[case] for case in cases for s in values})),
            "pi",
        )
        for cases in ("a", "abc")
    )
    for key in ("mean", "low", "high", "seed_low", "seed_high"):
        name = "RotSpeed_mean_[rpm]"
        assert three["metrics"][name][key] == pytest.approx(one["metrics"][name][key] + 3.0)
    assert three["cases"]["c"]["metrics"][TRAVEL]["worst"] == three["metrics"][TRAVEL]["worst"] == 21.0


def test_paired_differences_are_sharper_than_the_means_they_come_from():
    board = leaderboard(table(noisy({"pi": 0.0, "x": 0.5}, 3, range(6))))
    assert board["baseline"] == "pi"
    mean, gap = entry(board, "x")["metrics"][TRAVEL], entry(board, "x")["difference"][TRAVEL]
    assert gap["mean"] == pytest.approx(0.5, abs=0.05) and gap["low"] > 0.4 and gap["high"] < 0.6
    assert mean["high"] - mean["low"] > 10.0 * (gap["high"] - gap["low"])
    assert gap["pairs"] == 18 and gap["percent"] == pytest.approx(100.0 * gap["mean"] / 11.0, rel=0.1)
    own = entry(board, "pi")["difference"][TRAVEL]
    assert own["mean"] == own["low"] == own["high"] == 0.0


def test_fewer_than_four_seeds_have_no_interval_and_no_verdict():
    for seeds, there in ((1, False), (2, False), (3, False), (4, True)):
        runs = table(noisy({"pi": 0.0, "x": 0.5}, 2, range(seeds)), "pi")
        board = leaderboard(runs, score=SPEED_SCORE)
        x = entry(board, "x")
        for figure in (x["metrics"][TRAVEL], x["difference"][TRAVEL], x["score"]):
            assert np.isfinite(figure["mean"])
            assert np.isfinite([figure["low"], figure["high"]]).tolist() == [there, there]
        assert x["difference"][TRAVEL]["percent"] > 0.0 and board["interval"]["least_seeds"] == 4


SCATTERED = dict(enumerate([0.001, 0.5, 3.0, 0.01]))


def test_figures_that_cannot_be_negative_have_intervals_above_zero_and_so_has_their_score():
    values = SCATTERED
    found = entry(leaderboard(table({("pi", "a", seed): v for seed, v in values.items()})), "pi")["metrics"]
    never = [name for name in METRICS if never_negative(name)]
    assert {TRAVEL, "blade_pitch_travel_[deg/s]", "actuator_duty_[%]", "TwrBsMyt_DEL_[kN-m]"} <= set(never)
    assert not {"RotSpeed_mean_[rpm]", "overspeed_[%]", "PtfmPitch_min_[deg]", "energy_[kWh]"} & set(never)
    assert all(0.0 < found[name]["low"] < found[name]["mean"] < found[name]["high"] for name in never)
    assert all(found[name]["low"] < 0.0 for name in METRICS if name not in never)
    figures = {(name, "a", s): v if name == "x" else 1.0 for s, v in values.items() for name in ("x", "pi")}
    score = entry(leaderboard(table(figures, "pi"), score=SPEED_SCORE), "x")["score"]
    assert 0.0 < score["low"] < score["mean"] < score["high"]


def test_whatever_is_not_ok_counts_as_failed():
    frame = table({("pi", "a", 1): 1.0, ("pi", "a", 2): None})
    frame.loc[1, "status"] = "timeout"
    found = entry(leaderboard(frame), "pi")
    assert found["failed"] == 1 and found["metrics"][TRAVEL]["mean"] == 1.0  # of those that went well


def test_the_range_over_the_seeds_is_that_of_the_means_over_all_cases():
    figures = {("pi", "a", 1): 1.0, ("pi", "a", 2): 5.0, ("pi", "b", 1): 2.0, ("pi", "b", 2): 2.0}
    figures["pi", "b", 3] = 100.0  # of a seed that case a lacks
    figure = entry(leaderboard(table(figures)), "pi")["metrics"][TRAVEL]
    assert (figure["seed_low"], figure["seed_high"]) == (1.5, 3.5)


def test_a_controller_with_a_failed_run_stands_last_with_the_figures_of_the_others():
    figures = {("bad", "a", seed): 0.5 for seed in range(4)} | {("bad", "b", seed): 0.5 for seed in range(4)}
    figures |= {key: 1.0 for key in [(name, c, s) for name in ("pi", "x") for c in "ab" for s in range(4)]}
    figures["bad", "b", 3] = None
    board = leaderboard(table(figures))
    assert [item["controller"] for item in board["controllers"]] == ["pi", "x", "bad"]
    bad = entry(board, "bad")
    assert (bad["failed"], bad["lost"], bad["runs"], bad["metrics"][TRAVEL]["mean"]) == (1, 1, 8, 0.5)
    assert bad["difference"][TRAVEL]["mean"] == -0.5 and np.isnan(bad["difference"][TRAVEL]["p"])
    assert bad["difference"][TRAVEL]["pairs"] == 7 and bad["cases"]["b"]["failed"] == 1
    assert np.isfinite(entry(board, "x")["difference"][TRAVEL]["p"])
    assert entry(board, "x")["difference"][TRAVEL]["percent"] == 0.0


def test_pairs_are_of_the_runs_that_both_have():
    figures = {("x", "a", 1): 1.0, ("y", "a", 1): 2.0, ("y", "a", 2): 7.0}
    gap = entry(leaderboard(table(figures), baseline="x"), "y")["difference"][TRAVEL]
    assert gap["mean"] == pytest.approx(1.0) and gap["pairs"] == 1
    assert gap["percent"] == pytest.approx(100.0)  # of the baseline's same run


def test_a_share_of_what_rounding_left_of_nothing_is_not_given():
    figures = {("pi", "a", 1): 1e-143, ("x", "a", 1): 0.01, ("pi", "a", 2): 3e-320, ("x", "a", 2): 0.01}
    gap = entry(leaderboard(table(figures)), "x")["difference"][TRAVEL]
    assert gap["mean"] == pytest.approx(0.01) and not np.isfinite(np.float64(gap["percent"] or np.nan))


def test_a_controller_without_a_finished_run_has_no_figures_and_harms_no_other():
    figures = {("pi", "a", 1): 1.0, ("pi", "a", 2): 3.0, ("x", "a", 1): None, ("x", "a", 2): None}
    board = leaderboard(table(figures))
    for part in (entry(board, "x"), entry(board, "x")["cases"]["a"]):
        assert np.isnan([value for figure in part["metrics"].values() for value in figure.values()]).all()
        assert np.isnan(part["difference"][TRAVEL]["mean"])
    assert entry(board, "pi")["metrics"][TRAVEL]["mean"] == pytest.approx(2.0)


def test_the_baseline_is_gspi_oc3_then_pi_then_the_first_that_did_not_fail_unless_named():
    def base(failed, names=("x", "y", "gspi_oc3", "pi"), **options):
        figures = {(name, "a", 1): None if name in failed else 1.0 for name in names}
        return leaderboard(table(figures | {(names[-1], "b", 1): 1.0}), **options)["baseline"]

    assert base([]) == "gspi_oc3" and base(["gspi_oc3"]) == "pi" and base([], ["x", "pi"]) == "pi"
    assert base(["gspi_oc3", "pi"]) == "x" and base(["x"], ("x", "y")) == "y"
    assert base([], ["parked", "x", "y"]) == "x" and base(["x", "y"], ("x", "y")) is None
    assert base(["x"], baseline="x") == "x"
    with pytest.raises(InputError, match="'pi'"):
        base([], ["x", "pi"], baseline="pie")


def scored(x, power=None):
    rule = Score(
        baseline="pi",
        term=(ScoreTerm(metric=TRAVEL, weight=3.0), ScoreTerm(metric="PtfmPitch_std_[deg]", weight=1.0)),
        power=power,
    )
    frame = table({("pi", "a", 1): 2.0, ("pi", "a", 2): 2.0, ("x", "a", 1): 2.0, ("x", "a", 2): 2.0}, "pi")
    for name, value in x.items():
        frame.loc[frame["controller"] == "x", name] = value
    board = leaderboard(frame, score=rule, limits=Limits())
    return entry(board, "pi")["score"], entry(board, "x")["score"]


def test_a_score_is_the_weighted_mean_ratio_to_the_baseline_over_relative_power():
    base, score = scored({TRAVEL: 1.0, "PtfmPitch_std_[deg]": 4.0})
    assert base["mean"] == 1.0 and score["mean"] == pytest.approx((3.0 * 0.5 + 1.0 * 2.0) / 4.0)
    _, score = scored({TRAVEL: 1.0, "GenPwr_mean_[kW]": 1.0}, power="GenPwr_mean_[kW]")
    assert score["mean"] == pytest.approx((3.0 * 0.5 + 1.0) / 4.0 / 0.5)


def test_one_run_beyond_a_limit_is_enough_however_low_the_mean():
    frame = table({("pi", "a", seed): 1.0 for seed in range(6)}, "pi")
    frame.loc[3, "rotor_speed_above_limit_[s]"] = 2.5  # the mean is 1.25
    rules = {"score": SPEED_SCORE, "limits": Limits(run={"rotor_speed_above_limit_[s]": 2.0})}
    score = entry(leaderboard(frame, **rules), "pi")["score"]
    assert not score["valid"] and score["why"] == "time above 1.3 times rated speed (s) = 2.5, allowed 2"
    frame.loc[3, "rotor_speed_above_limit_[s]"] = 2.0
    assert entry(leaderboard(frame, **rules), "pi")["score"]["valid"]
    frame["rotor_speed_above_limit_[s]"] = np.nan  # what runs do not say is not within it
    assert not entry(leaderboard(frame, **rules), "pi")["score"]["valid"]


def test_a_suites_score_is_the_ratio_of_the_means_over_the_cases():
    base = {("pi", "a", 1): 1.0, ("pi", "a", 2): 3.0, ("pi", "b", 1): 5.0}
    own = {("x", "a", 1): 1.0, ("x", "a", 2): 1.0, ("x", "b", 1): 7.0}
    score = entry(leaderboard(table(base | own, "pi"), score=SPEED_SCORE), "x")["score"]
    # (1 + 7) / (2 + 5); not the mean of the cases' ratios, nor of the runs', nor the worst case
    assert score["mean"] == pytest.approx(8.0 / 7.0)
    # of a run that the reference lacks nothing is counted
    more = table(base | own | {("x", "b", 2): 60.0}, "pi")
    score = entry(leaderboard(more, score=SPEED_SCORE), "x")["score"]
    assert score["mean"] == pytest.approx(8.0 / 7.0)


def test_a_score_needs_its_reference_and_is_not_valid_without_all_runs():
    rule = Score(baseline="gspi_oc3", term=(ScoreTerm(metric=TRAVEL, weight=1.0),))
    board = leaderboard(table({("gspi_oc3", "a", 1): 1.0}), score=rule)
    found = entry(board, "gspi_oc3")["score"]
    assert found["mean"] is None and "reference" in found["why"] and "gspi_oc3" in found["why"]
    figures = {(name, "a", seed): 1.0 for name in ("pi", "x", REFERENCE) for seed in (1, 2)}
    board = leaderboard(table(figures | {("x", "a", 2): None, ("pi", "a", 1): None}), score=SPEED_SCORE)
    for name in ("pi", "x"):  # the baseline as an entry is one like any other
        score = entry(board, name)["score"]
        assert score["mean"] == (1.0 + PENALTY) / 2.0
        assert not score["valid"] and score["why"] == "1 run failed"


def test_ranks_are_by_scores_and_without_scores_there_are_none():
    figures = {(name, "a", seed): value for name, value in (("pi", 2.0), ("x", 1.0)) for seed in range(4)}
    for runs, rule, ranks in (
        (table(figures, "pi"), SPEED_SCORE, [1, 2]),
        (table(figures), None, [None, None]),
        (table(figures), SPEED_SCORE, [None, None]),  # no reference
    ):
        board = leaderboard(runs, score=rule)
        assert [item["rank"] for item in board["controllers"]] == ranks
        assert (">rank</th>" in board._repr_html_()) == (ranks[0] is not None)
        order = ["x", "pi"] if ranks[0] else ["pi", "x"]
        assert [item["controller"] for item in board["controllers"]] == order


def test_the_reference_is_no_entry_and_no_baseline():
    board = leaderboard(table({("x", "a", 1): 1.0, ("y", "b", 2): 1.0}, "x"))
    assert [item["controller"] for item in board["controllers"]] == ["x", "y"] and board["baseline"] == "x"
