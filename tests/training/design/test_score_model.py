"""The quadratic model of a run's score: slopes by differences, bounds from above, and limits."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.training.design.score_model import RunScore
from fowt_env.training.evaluation.cases import Limits, Score, read_suite
from fowt_env.training.evaluation.metrics import METRICS, metrics

TIME = 0.1 * np.arange(3001)
COLUMNS = (
    "RotSpeed_[rpm]", "PtfmPitch_[deg]", "PtfmSurge_[m]", "BldPitch1_[deg]", "RotTorq_[kN-m]",
    "TwrBsMyt_[kN-m]", "FAIRTEN1_[kN]", "FAIRTEN2_[kN]", "GenPwr_[kW]", "GenTq_[kN-m]",
)  # fmt: skip
STRICT = Limits(
    lifetime={"torque_travel_[kN-m/s]": 0.2},
    relative={"RotTorq_DEL_[kN-m]": 0.5},
    run={"GenPwr_max_[kW]": 5400.0},
    set_point={"RotSpeed_mean_[rpm]": {"rated": 12.1, "within": 0.001}},
)


def series(seed):
    """(rows, len(COLUMNS)) of smooth random channels about usual values."""
    random = np.random.default_rng(seed)
    middle = np.array([12.0, 3.0, 8.0, 12.0, 4000.0, 40000.0, 900.0, 700.0, 5000.0, 43.0])
    size = np.array([0.8, 0.6, 2.0, 1.0, 400.0, 9000.0, 30.0, 20.0, 400.0, 0.6])
    waves = sum(
        np.sin(2.0 * np.pi * f * TIME[:, None] + random.uniform(0.0, 6.3, 10)) * random.normal(size=10)
        for f in (0.011, 0.031, 0.05, 0.09, 0.13)
    )
    return middle + size * waves / 2.0


@pytest.fixture(scope="module")
def rows():
    return series(1)


@pytest.fixture(scope="module")
def reference():
    frame = pd.DataFrame(series(2), columns=list(COLUMNS)).assign(**{"Time_[s]": TIME})
    return metrics(frame)


def scored(score, reference, limits=()):
    made = RunScore(score, reference, COLUMNS, 5000.0, limits)
    return made, [COLUMNS.index(name) for name in made.columns]


@pytest.fixture(scope="module")
def headline(reference):
    return scored(read_suite("above_rated").score, reference)


def test_metrics_are_those_of_an_evaluation(rows, reference, headline):
    score, places = headline
    frame = pd.DataFrame(rows, columns=list(COLUMNS)).assign(**{"Time_[s]": TIME})
    expected = metrics(frame)
    for name in (*score.terms, score.power):
        assert score.metric(name, TIME, rows[:, places]) == pytest.approx(expected[name], rel=1e-12)
    ratios = [expected[name] / reference[name] for name in score.terms]
    assert len(ratios) == 6 and set(score.terms) <= set(METRICS)
    assert score.score(TIME, rows[:, places]) == pytest.approx(
        np.mean(ratios) * reference[score.power] / expected[score.power]
    )


def change(seed, place, count):
    """A smooth change of one column."""
    random = np.random.default_rng(seed)
    shape = sum(np.sin(2.0 * np.pi * f * TIME + random.uniform(0.0, 6.3)) for f in (0.02, 0.045, 0.08))
    moved = np.zeros((TIME.size, count))
    moved[:, place] = shape
    return moved


def expected_change(model, moved):
    """(linear, quadratic) parts of a Model under a change of the rows."""
    steps = np.diff(moved, axis=0)
    linear = np.sum(model.rows * moved) + np.sum(model.steps * steps)
    curved = np.sum(model.row_curvature * moved**2) + np.sum(model.step_curvature * steps**2)
    return linear, 0.5 * curved


@pytest.mark.parametrize("limits", [(), (STRICT,)], ids=["score", "limits"])
def test_slopes_are_differences_of_the_score(rows, reference, limits):
    score, places = scored(read_suite("above_rated").score, reference, limits)
    at = rows[:, places]
    model = score.model(TIME, at)
    for place, name in enumerate(score.columns):
        moved = np.zeros_like(at)
        moved[:, place] = 1e-4 * (at[:, place] - at[:, place].mean() + 0.3 * np.std(at[:, place]))
        found = (score.total(TIME, at + moved) - score.total(TIME, at - moved)) / 2.0
        linear = expected_change(model, moved)[0]
        # travel has a kink where an increment is zero; a load its soft maxima
        tolerance = 0.1 if "Pitch1" in name or "Torq" in name or "Bs" in name or "FAIR" in name else 0.01
        if name.startswith("FAIRTEN") and found == 0.0:  # not the worst line
            assert linear == 0.0
            continue
        assert linear == pytest.approx(found, rel=tolerance, abs=1e-9), name
    assert (model.row_curvature >= 0.0).all() and (model.step_curvature >= 0.0).all()


def test_deviation_and_travel_are_bounded_from_above(rows, reference):
    for metric, column in (("RotSpeed_std_[rpm]", 0), ("blade_pitch_travel_[deg/s]", 0)):
        score, places = scored(
            Score(baseline="gspi_oc3", term=({"metric": metric, "weight": 1.0},)), reference
        )
        at = rows[:, places]
        model, now = score.model(TIME, at), score.score(TIME, at)
        for seed in range(5):
            moved = np.std(at) * change(seed, column, at.shape[1])
            parts = expected_change(model, moved)
            assert score.score(TIME, at + moved) <= now + sum(parts) + 2e-3 * now


def test_limits_are_penalties_of_their_excess(rows, reference):
    score, places = scored(read_suite("above_rated").score, reference, (STRICT,))
    at = rows[:, places]
    excess = score.excess(TIME, at)
    travel = score.metric("torque_travel_[kN-m/s]", TIME, at)
    assert excess["torque_travel_[kN-m/s]"] == pytest.approx(travel / 0.2 - 1.0)
    assert score.total(TIME, at) > score.score(TIME, at) + 100.0 * max(excess.values()) ** 2
    held, kept = scored(read_suite("above_rated").score, reference)
    assert held.total(TIME, rows[:, kept]) == held.score(TIME, rows[:, kept]) and not held.bounds


def test_terms_without_a_channel_are_named(reference):
    score = read_suite("above_rated_elastic").score
    with pytest.raises(InputError, match="score term 'RootMyb_DEL_\\[kN-m\\]': the run has no such channel"):
        RunScore(score, reference, COLUMNS, 5000.0)
