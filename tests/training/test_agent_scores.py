"""Scores of agents against rivals on tables whose answers are known."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from training.agent_scores import FIGURES, agent_scores, interquartile_mean, interval


def table(ratios):
    """An evaluation in which the agent's every figure is a ratio of the rival's, one per seed."""
    rows = []
    for seed, ratio in enumerate(ratios):
        for name, factor in (("rival", 1.0), ("agent", ratio)):
            figures = {figure: factor * (seed + 1.0) for figure in FIGURES}
            rows.append({"controller": name, "case": "ntm_18", "seed": seed, "status": "ok"} | figures)
    return pd.DataFrame(rows)


def test_the_interquartile_mean_leaves_out_a_quarter_at_each_end():
    assert interquartile_mean(np.array([100.0, 1.0, 2.0, -50.0])) == 1.5


def test_ratios_are_taken_run_by_run_and_the_interval_holds_the_mean():
    ratios = np.random.default_rng(1).normal(0.8, 0.05, 40)
    scores = agent_scores(table(ratios), ["rival"])
    assert list(scores["figure"]) == list(FIGURES)
    assert scores["ratio"].to_numpy() == pytest.approx(interquartile_mean(ratios))
    assert (scores["low"] < scores["ratio"]).all() and (scores["ratio"] < scores["high"]).all()
    assert (scores["high"] - scores["low"] < 0.06).all()


def test_the_interval_of_equal_runs_is_a_point():
    assert interval(np.full(9, 0.7), np.random.default_rng(0)) == pytest.approx((0.7, 0.7))


def test_failed_runs_are_counted_and_left_out():
    runs = table([0.5, 0.5, 0.5])
    last = (runs["controller"] == "agent") & (runs["seed"] == 2)
    runs.loc[last, ["status", *FIGURES]] = ["failed"] + [np.nan] * len(FIGURES)
    scores = agent_scores(runs, ["rival"])
    assert (scores["runs"] == 2).all() and (scores["failed"] == 1).all()
    with pytest.raises(InputError, match="unknown controller of the evaluation 'rivla'"):
        agent_scores(runs, ["rivla"])
