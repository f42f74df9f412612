"""Means, intervals and paired differences on tables whose answers are known."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from training.bootstrap import interval, resample_weights
from training.cases import Score, Term
from training.evaluate import COLUMNS
from training.leaderboard import case_means, leaderboard
from training.metrics import METRICS

STD = "RotSpeed_std_[rpm]"


def table(figures):
    """Table of {(controller, case, seed): value of every metric, or None for a failed run}."""
    rows = []
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
    figure = entry(leaderboard(table(figures)), "pi")["metrics"][STD]
    assert figure["mean"] == pytest.approx(2.0) and figure["worst"] == 3.0


def test_paired_differences_are_sharper_than_the_means_they_come_from():
    board = leaderboard(table(noisy({"pi": 0.0, "x": 0.5}, 3, range(6))))
    assert board["baseline"] == "pi"
    mean, gap = entry(board, "x")["metrics"][STD], entry(board, "x")["difference"][STD]
    assert gap["mean"] == pytest.approx(0.5, abs=0.05) and gap["low"] > 0.4 and gap["high"] < 0.6
    assert mean["high"] - mean["low"] > 10.0 * (gap["high"] - gap["low"])
    assert gap["pairs"] == 18 and gap["percent"] == pytest.approx(100.0 * gap["mean"] / 11.0, rel=0.1)
    own = entry(board, "pi")["difference"][STD]
    assert own["mean"] == own["low"] == own["high"] == 0.0


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    for seeds in (3, 6, 20):
        trials = 2000
        values = np.random.default_rng(seeds).normal(size=(seeds, trials))
        resampled = case_means(values, resample_weights(seeds, 1000))
        low, high = interval(values.mean(axis=0), resampled, seeds)
        covered = np.mean((low <= 0.0) & (high >= 0.0))
        assert 0.92 <= covered <= 0.97, (seeds, covered)


def test_a_failed_run_leaves_its_pair_out_and_is_counted():
    figures = {("pi", "a", 1): 1.0, ("pi", "a", 2): 5.0, ("x", "a", 1): 2.0, ("x", "a", 2): None}
    found = entry(leaderboard(table(figures)), "x")
    assert found["failed"] == 1 and found["runs"] == 2
    assert found["difference"][STD]["mean"] == pytest.approx(1.0) and found["difference"][STD]["pairs"] == 1
    assert found["difference"][STD]["percent"] == pytest.approx(100.0)  # of the baseline's same run


def test_a_share_of_what_rounding_left_of_nothing_is_not_given():
    figures = {("pi", "a", 1): 1e-143, ("x", "a", 1): 0.01, ("pi", "a", 2): 3e-320, ("x", "a", 2): 0.01}
    gap = entry(leaderboard(table(figures)), "x")["difference"][STD]
    assert gap["mean"] == pytest.approx(0.01) and not np.isfinite(np.float64(gap["percent"] or np.nan))


def test_a_controller_without_a_finished_run_has_no_figures_and_harms_no_other():
    figures = {("pi", "a", 1): 1.0, ("pi", "a", 2): 3.0, ("x", "a", 1): None, ("x", "a", 2): None}
    board = leaderboard(table(figures))
    assert np.isnan(entry(board, "x")["metrics"][STD]["mean"])
    assert entry(board, "pi")["metrics"][STD]["mean"] == pytest.approx(2.0)


def test_one_seed_has_no_interval():
    figure = entry(leaderboard(table({("pi", "a", 1): 1.0})), "pi")["metrics"][STD]
    assert figure["mean"] == 1.0 and np.isnan(figure["low"]) and np.isnan(figure["high"])


def test_the_baseline_is_gspi_oc3_then_pi_then_the_first_unless_named():
    def base(names, **options):
        return leaderboard(table({(name, "a", 1): 1.0 for name in names}), **options)["baseline"]

    assert base(["x", "pi", "gspi_oc3"]) == "gspi_oc3"
    assert base(["x", "pi"]) == "pi"
    assert base(["parked", "x", "y"]) == "x"
    assert base(["x", "pi"], baseline="x") == "x"
    with pytest.raises(InputError, match="'pi'"):
        base(["x", "pi"], baseline="pie")


def test_the_same_table_gives_the_same_intervals():
    figures = noisy({"pi": 0.0, "x": 0.5}, 2, range(4))
    assert leaderboard(table(figures)) == leaderboard(table(figures))


def test_resamples_without_a_value_are_left_out():
    values = np.array([[1.0], [np.nan], [3.0]])
    means = case_means(values, np.array([[1.0, 1.0, 1.0], [0.0, 3.0, 0.0], [3.0, 0.0, 0.0]]))
    assert means[0, 0] == 2.0 and np.isnan(means[1, 0]) and means[2, 0] == 1.0
    assert resample_weights(3, 100).sum(axis=1).tolist() == [3.0] * 100


def scored(x, limits=None, power=None):
    rule = Score(
        baseline="pi",
        term=(Term(metric=STD, weight=3.0), Term(metric="PtfmPitch_std_[deg]", weight=1.0)),
        power=power,
        limits=limits or {},
    )
    frame = table({("pi", "a", 1): 2.0, ("pi", "a", 2): 2.0, ("x", "a", 1): 2.0, ("x", "a", 2): 2.0})
    for name, value in x.items():
        frame.loc[frame["controller"] == "x", name] = value
    board = leaderboard(frame, score=rule)
    return entry(board, "pi")["score"], entry(board, "x")["score"]


def test_a_score_is_the_weighted_mean_ratio_to_the_baseline_over_relative_power():
    base, score = scored({STD: 1.0, "PtfmPitch_std_[deg]": 4.0})
    assert base["mean"] == 1.0 and score["mean"] == pytest.approx((3.0 * 0.5 + 1.0 * 2.0) / 4.0)
    _, score = scored({STD: 1.0, "GenPwr_mean_[kW]": 1.0}, power="GenPwr_mean_[kW]")
    assert score["mean"] == pytest.approx((3.0 * 0.5 + 1.0) / 4.0 / 0.5)


def test_a_passed_limit_makes_a_score_invalid_and_says_which():
    limits = {"rotor_speed_beyond_[s]": 2.0}
    assert scored({}, limits)[1]["valid"]
    _, score = scored({"rotor_speed_beyond_[s]": 2.5}, limits)
    assert not score["valid"] and "rotor_speed_beyond" in score["why"]


def test_a_score_needs_its_baseline_and_all_runs():
    rule = Score(baseline="gspi_oc3", term=(Term(metric=STD, weight=1.0),))
    board = leaderboard(table({("pi", "a", 1): 1.0}), score=rule)
    assert entry(board, "pi")["score"]["mean"] is None and "gspi_oc3" in entry(board, "pi")["score"]["why"]
