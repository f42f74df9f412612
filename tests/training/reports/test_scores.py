"""Scores of agents against baselines on tables whose answers are known."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.training.evaluation.evaluate import COLUMNS
from fowt_env.training.evaluation.failures import PENALTY
from fowt_env.training.evaluation.metrics import METRICS, mean_exponent
from fowt_env.training.reports.scores import (
    COUNTS,
    FIGURES,
    PAST_ANY,
    Figure,
    agent_counts,
    agent_scores,
    by_kind,
    figures_named,
    inputs,
    kind_of,
    kinds_markdown,
    scores_markdown,
)


def table(agents, cases=("ntm_18",)):
    """An evaluation of {agent: ratios, one per seed} beside a baseline, by case and seed."""
    rows = []
    seeds = len(next(iter(agents.values())))
    for c, case in enumerate(cases):
        for seed in range(seeds):
            for name, ratios in {"base": [1.0] * seeds, **agents}.items():
                row = dict.fromkeys(COLUMNS, 0.0) | {"weight_[-]": np.nan}
                row |= {"controller": name, "case": case, "seed": seed, "status": "ok", "reason": ""}
                rows.append(row | {figure.metric: ratios[seed] * (c + seed + 1.0) for figure in FIGURES})
    return pd.DataFrame(rows, columns=list(COLUMNS))


def fail(runs, controller, seed):
    at = (runs["controller"] == controller) & (runs["seed"] == seed)
    runs.loc[at, ["status", *METRICS]] = ["failed"] + [np.nan] * len(METRICS)


def test_identical_runs_have_ratio_one_with_an_interval_without_width():
    scores = agent_scores(table({"agent": [1.0] * 4}, ("ntm_14", "ntm_18")), ["base"])
    assert (scores[["ratio", "low", "high"]] == 1.0).all(axis=None)
    assert (scores["pairs"] == 8).all()
    verdicts = dict(zip(scores["figure"], scores["verdict"], strict=True))
    assert verdicts["blade-pitch travel"] == "met" and verdicts["rotor-speed std"] == "missed*"


def test_ratios_are_taken_run_by_run_and_the_interval_holds_the_mean():
    ratios = np.random.default_rng(1).normal(0.8, 0.05, 40)
    scores = agent_scores(table({"agent": ratios}), ["base"])
    assert list(scores["figure"]) == [figure.name for figure in FIGURES]
    weights = np.arange(1.0, 41.0)  # the baseline's figures
    for _, row in scores.iterrows():
        p = mean_exponent(row["metric"])
        expected = (np.mean((ratios * weights) ** p) / np.mean(weights**p)) ** (1.0 / p)
        assert row["ratio"] == pytest.approx(expected)
    assert (scores["low"] < scores["ratio"]).all() and (scores["ratio"] < scores["high"]).all()
    assert (scores["high"] - scores["low"] < 0.08).all()


def test_a_group_is_scored_over_all_its_training_seeds():
    agents = {
        name: [mean, mean + 0.01, mean - 0.01, mean]
        for name, mean in (("a", 0.7), ("b", 0.8), ("c", 0.9), ("e", 0.75), ("d", 0.5))
    }
    scores = agent_scores(table(agents), ["base"], {"all": ["a", "b", "c", "e"]})
    assert set(scores["agent"]) == {"all", "d"}
    whole = scores[scores["agent"] == "all"].iloc[0]
    singles = [agent_scores(table(agents), ["base"], agents=[k]).iloc[0]["ratio"] for k in "abce"]
    assert whole["ratio"] == pytest.approx(np.mean(singles))
    assert (whole["runs"], whole["pairs"], whole["training_seeds"]) == (16, 16, 4)
    one = agent_scores(table(agents), ["base"], agents=["b"]).iloc[0]
    assert whole["high"] - whole["low"] > 3.0 * (one["high"] - one["low"])


def test_ratios_over_fewer_than_four_seeds_have_no_interval_and_the_text_says_so_once():
    agents = {name: [0.5, 0.6, 0.5, 0.6] for name in "abc"}
    for runs, groups in ((table({"a": [0.5, 0.6, 0.5]}), {}), (table(agents), {"all": ["a", "b", "c"]})):
        scores = agent_scores(runs, ["base"], groups)
        assert np.isfinite(scores["ratio"]).all() and scores[["low", "high"]].isna().all(axis=None)
        assert not scores["verdict"].str.contains("*", regex=False).any()
        text = scores_markdown(scores, agent_counts(runs, ["base"], groups))
        assert "[" not in text and text.count("No interval: ") == 1
        assert kinds_markdown(*by_kind(runs, "base", groups)).count("No interval: ") == 1
    single = agent_scores(table(agents), ["base"], agents=["a"])
    assert np.isfinite(single[["low", "high"]]).all(axis=None)
    assert "No interval" not in scores_markdown(single, agent_counts(table(agents), ["base"], agents=["a"]))


def test_ratios_of_deviations_have_intervals_above_zero_however_they_scatter():
    scores = agent_scores(table({"agent": [0.001, 0.5, 3.0, 0.01]}), ["base"]).set_index("figure")
    negative = {"energy", "largest power"}  # power may be drawn from the grid
    assert (scores["low"].drop(list(negative)) > 0.0).all()
    assert scores.loc["energy", "low"] < 0.0


def test_an_agent_with_a_failed_run_reaches_no_aim():
    runs = table({"agent": [0.5] * 5, "other": [0.5] * 5})
    fail(runs, "agent", 2)
    scores = agent_scores(runs, ["base"]).set_index(["agent", "figure"])["verdict"]
    assert set(scores["agent"]) == {"failed"} and scores["other", "rotor-speed std"] == "then*"


def test_failed_runs_are_counted_and_cost_a_multiple_of_the_baselines_figures():
    runs = table({"agent": [0.5, 0.5, 0.5]})
    fail(runs, "agent", 2)
    scores, counts = agent_scores(runs, ["base"]), agent_counts(runs, ["base"])
    assert (scores["pairs"] == 3).all() and (scores["runs"] == 3).all() and (scores["failed"] == 1).all()
    travel = scores.set_index("figure").loc["blade-pitch travel"]
    assert travel["ratio"] == pytest.approx((0.5 + 1.0 + PENALTY * 3.0) / 6.0)  # not 0.5, of the others
    assert scores.set_index("figure").loc["energy", "ratio"] == pytest.approx(
        (0.5 + 1.0 + 3.0 / PENALTY) / 6.0
    )
    other = table({"agent": [0.5, 0.5, 0.5], "sandbag": [5.0, 5.0, 5.0]})
    fail(other, "agent", 2)
    beside = agent_scores(other, ["base"], agents=["agent"]).reset_index(drop=True)
    pd.testing.assert_frame_equal(beside, scores, check_exact=True)
    assert list(counts["agent"]) == ["agent", "base"] and list(counts["failed"]) == [1, 0]
    assert list(counts["verdict"]) == ["missed", "met"]
    fail(runs, "base", 1)  # a run that the baseline lost has no ratio
    assert (agent_scores(runs, ["base"])["pairs"] == 2).all()
    for name in ("agent", "base"):
        for seed in range(3):
            fail(runs, name, seed)
    with pytest.raises(InputError, match="no run of both has a value"):
        agent_scores(runs, ["base"])


def test_a_passed_constraint_is_a_miss_even_once():
    runs = table({"agent": [0.5, 0.5]})
    runs.loc[(runs["controller"] == "agent") & (runs["seed"] == 1), "rotor_speed_violations_[-]"] = 3.0
    counts = agent_counts(runs, ["base"]).set_index("agent")
    assert counts.loc["agent", "rotor past 130 %"] == 1 and counts.loc["agent", "verdict"] == "missed"
    assert counts.loc["agent", PAST_ANY] == 1 and set(COUNTS.values()) <= set(METRICS)


def test_each_controller_stands_with_its_inputs():
    assert inputs("gspi_oc3") == "measured"
    assert inputs("lqr") == "measured, plant_model"
    assert inputs("rosco_float") == "measured, wind_speed, plant_model"
    assert inputs("policy:ppo_lqr") == "measured, plant_model"
    assert inputs("mpc_preview") == "measured, plant_model, wind_preview"
    assert inputs("my_module:Mine") == inputs("policy:gone.npz") == inputs("mine") == ""


def test_a_baseline_at_zero_gives_no_ratio_and_the_pairs_say_so():
    runs = table({"agent": [0.5, 0.5]})
    runs.loc[runs["controller"] == "base", "blade_pitch_travel_[deg/s]"] = 0.0
    scores = agent_scores(runs, ["base"]).set_index("figure")
    assert scores.loc["blade-pitch travel", "pairs"] == 0 and scores.loc["power std", "pairs"] == 2
    assert np.isnan(scores.loc["blade-pitch travel", "ratio"])
    assert scores.loc["blade-pitch travel", "verdict"] == ""


def test_verdicts_name_the_aim_that_is_reached_and_whether_that_is_sure():
    down, up = Figure("x", "x", 0.8, 0.6), Figure("p", "p", 0.995, more=True)
    assert down.verdict(0.55, (True, True)) == "then*"
    assert down.verdict(0.55, (True, False)) == "then, first*"
    assert down.verdict(0.55, (False, False)) == down.verdict(0.55) == "then"
    assert down.verdict(0.7, (True, False)) == "first*" and down.verdict(0.7, (False, True)) == "first"
    assert down.verdict(0.9, (False, True)) == "missed" and down.verdict(0.9, (True, True)) == "missed*"
    assert up.verdict(1.0, (True,)) == "met*" and up.verdict(1.0, (False,)) == "met"
    assert up.verdict(0.9, (True,)) == "missed*" and up.verdict(0.9, (False,)) == "missed"
    assert down.verdict(np.nan, (True, True)) == "" and down.verdict(0.5, (True, True), failed=1) == "failed"


def test_a_star_needs_a_p_value_that_stands_the_correction_for_all_aims():
    # one figure just below its aim, sure by itself; the others are at chance level
    runs = table({"agent": [1.0, 1.01, 0.99, 1.005, 0.995, 1.0]})
    factors = np.array([0.975, 0.98, 0.985, 0.99, 1.0, 0.985])
    travel = "blade_pitch_travel_[deg/s]"
    base = runs.loc[runs["controller"] == "base", travel].to_numpy()
    runs.loc[runs["controller"] == "agent", travel] = base * factors
    found = agent_scores(runs, ["base"]).set_index("figure").loc["blade-pitch travel"]
    assert 0.005 < found["p_first"] < 0.05 and found["high"] < 1.0
    assert found["holm_first"] > 0.05 and found["verdict"] == "met"
    only = [figure for figure in FIGURES if figure.metric == travel]
    alone = agent_scores(runs, ["base"], figures=only).iloc[0]
    assert alone["holm_first"] == alone["p_first"] == found["p_first"] and alone["verdict"] == "met*"


def test_cases_count_by_their_share_of_the_lifetime():
    runs = table({"agent": [0.5] * 4}, ("ntm_12", "ntm_24"))
    worse = (runs["controller"] == "agent") & (runs["case"] == "ntm_24")
    runs.loc[worse, list(METRICS)] *= 4.0  # twice the baseline's
    base = runs[runs["controller"] == "base"].groupby("case")["blade_pitch_travel_[deg/s]"].mean()
    for share in (0.0, 0.25, 1.0):
        runs["weight_[-]"] = np.where(runs["case"] == "ntm_24", share, 1.0 - share)
        ratio = agent_scores(runs, ["base"]).set_index("figure").loc["blade-pitch travel", "ratio"]
        low, high = base["ntm_12"] * (1.0 - share), base["ntm_24"] * share
        assert ratio == pytest.approx((0.5 * low + 2.0 * high) / (low + high))


def test_kinds_of_cases_are_scored_apart_and_a_kind_that_failed_has_no_ratio():
    runs = table({"agent": [0.5, 0.6]}, ("soft_14", "soft_18", "stiff_14"))
    for name in ("agent", "base"):
        runs.loc[(runs["controller"] == name) & (runs["case"] == "stiff_14"), ["status", *METRICS]] = [
            "failed", *[np.nan] * len(METRICS)
        ]  # fmt: skip
    scores, counts = by_kind(runs, "base")
    soft = scores[scores["kind"] == "soft"]
    assert (soft["pairs"] == 4).all() and soft["ratio"].between(0.55, 0.6).all()
    assert scores.loc[scores["kind"] == "stiff", "ratio"].isna().all()
    text = kinds_markdown(scores, counts, ["rotor-speed std"])
    assert "| stiff | - |" in text and "| stiff | 2 / 0 of 2 | 2 / 0 of 2 |" in text
    every, _ = by_kind(runs, "base", each=True)
    assert list(dict.fromkeys(every["kind"])) == ["soft_14", "soft_18", "stiff_14"]
    assert [kind_of(name) for name in ("ntm_18", "ntm_11_4", "eog_rated", "ss_5")] == [
        "ntm", "ntm", "eog_rated", "ss"
    ]  # fmt: skip


def test_wrong_names_and_groups_are_refused():
    runs = table({"agent": [0.5, 0.5]})
    with pytest.raises(InputError, match="unknown controller of the evaluation 'rivla'"):
        agent_scores(runs, ["rivla"])
    for groups in ({"agent": ["agent"]}, {"g": ["agent", "agent"]}, {"g": []}):
        with pytest.raises(InputError, match="needs a name that no controller has"):
            agent_scores(runs, ["base"], groups)
    with pytest.raises(InputError, match="unknown figure 'rotor'"):
        figures_named(["rotor"])


def test_any_metric_may_be_a_figure_without_an_aim():
    runs = table({"agent": [0.5, 0.6]})
    runs["PtfmPitch_max_[deg]"] = runs["PtfmPitch_std_[deg]"]
    scores, _ = by_kind(runs, "base", figures=figures_named(["PtfmPitch_max_[deg]", "power std"]))
    assert list(scores["figure"]) == ["PtfmPitch_max_[deg]", "power std"]
    assert scores["ratio"].between(0.55, 0.6).all() and list(scores["verdict"]) == ["", "met"]


def test_the_text_has_a_table_per_baseline_and_one_of_failures():
    runs = table({"agent": [0.5, 0.6, 0.5]})
    text = scores_markdown(agent_scores(runs, ["base"]), agent_counts(runs, ["base"]))
    assert "| over `base` | `agent` |" in text and text.count("\n|---|") == 2
    assert "| rotor-speed std | 0.5" in text and "then" in text
