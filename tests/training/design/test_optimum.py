"""The clairvoyant optimum of one run: its linear model, its steps, its limits and its files."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize

from fowt_env.errors import InputError
from fowt_env.training.design import optimum as module
from fowt_env.training.design.optimum import OPTIMUM, Replay, Search, box_step, optimum
from fowt_env.training.design.score_model import RunScore
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate

SEED, DURATION, SKIP = 1001, 40.0, 12.0


@pytest.fixture(scope="module")
def suite():
    whole = read_suite("above_rated")
    return replace(whole, cases=whole.cases[:1], duration=DURATION, skip=SKIP)


@pytest.fixture(scope="module")
def runs(suite):
    return evaluate(["gspi_oc3"], suite, seeds=(SEED,)).set_index("controller")


@pytest.fixture
def search(suite, runs):
    def score(columns):
        return RunScore(suite.score, runs.loc["reference"], columns, 5000.0, (suite.limits,))

    return Search(suite.cases[0], SEED, score, DURATION, SKIP, start="gspi_oc3")


@pytest.mark.parametrize("seed", range(20))
def test_a_bounded_step_is_the_minimum(seed):
    random = np.random.default_rng(seed)
    root = random.normal(size=(2, 2))
    curved, slope = root @ root.T + 0.1 * np.eye(2), random.normal(size=2)
    low, high = -random.uniform(0.05, 1.0, 2), random.uniform(0.05, 1.0, 2)
    found, free = box_step(curved, slope, low, high)
    best = minimize(
        lambda x: 0.5 * x @ curved @ x + slope @ x, np.zeros(2), bounds=list(zip(low, high, strict=True)),
        jac=lambda x: curved @ x + slope,
    )  # fmt: skip
    np.testing.assert_allclose(found, best.x, atol=1e-5)
    np.testing.assert_array_equal(free, (found > low + 1e-9) & (found < high - 1e-9))


def test_the_first_run_is_that_of_the_controller(search, runs):
    """Metrics as of evaluate, to the last bit."""
    figures = search.figures()
    for name in search.score.terms:
        assert figures[name] == runs.loc["gspi_oc3", name]


def test_a_small_step_changes_the_score_as_the_linear_model_says(search):
    steps = search._linearised()
    offsets, gains = search._backward(*steps)
    f, curved, q = steps
    small = 0.01
    z, linear = np.zeros(16), 0.0
    for k in range(len(f)):
        both = np.r_[z, small * offsets[k] + gains[k] @ z]
        linear += q[k] @ both + 0.5 * both @ curved[k] @ both
        z = f[k] @ both
    run = search._run(search._policy(small, offsets, gains))
    assert linear < 0.0
    assert run.total - search.best.total == pytest.approx(linear, rel=0.1)


@pytest.mark.filterwarnings("ignore::fowt_env.errors.PlantWarning")
def test_iterations_reduce_the_score_within_ranges_and_rates(search):
    totals = [search.best.total]
    for _ in range(3):
        assert search.improve()
        totals.append(search.best.total)
    assert np.all(np.diff(totals) < 0.0) and totals[-1] < 0.9 * totals[0]
    commands = search.commands
    assert commands.shape == (400, 2)
    assert (commands >= search.low - 1e-9).all() and (commands <= search.high + 1e-9).all()
    changes = np.abs(np.diff(commands[search.first - 1 :], axis=0))
    assert (changes <= search.rate * (1.0 + 1e-9)).all()


def test_the_replayed_commands_have_the_score_in_an_evaluation(search, suite):
    search.improve()
    replay = Replay(search.commands, 0.1)
    row = evaluate({OPTIMUM: replay}, suite, seeds=(SEED,), reference=False).iloc[0]
    for name, value in search.figures().items():
        if name in row:
            assert row[name] == pytest.approx(value, rel=1e-9)


def test_a_search_continues_from_its_files(tmp_path, monkeypatch, suite):
    monkeypatch.setattr(module, "chosen_cases", lambda *_: suite)
    monkeypatch.setattr(module, "SETTLED", -1.0)
    settings = {"suite": "above_rated", "start": "gspi_oc3"}
    results, first = optimum("ntm_12", [SEED], tmp_path, iterations=1, **settings)
    assert set(results["controller"]) == {"gspi_oc3", "reference", OPTIMUM}
    _, history = optimum("ntm_12", [SEED], tmp_path, iterations=2, **settings)
    assert list(history["iteration"]) == [0, 1, 2]
    assert history["total"].is_monotonic_decreasing
    pd.testing.assert_frame_equal(history.iloc[:2], first, check_dtype=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"commands_ntm_12_{SEED}.npz", "history.csv", "results.csv",
    ]  # fmt: skip


@pytest.mark.nightly
def test_what_has_no_optimum_is_named(tmp_path, suite):
    with pytest.raises(InputError, match=r"seeds = \[1\]: must be 1000 or more"):
        optimum("ntm_12", [1], tmp_path)
    with pytest.raises(InputError, match="has no score to minimise"):
        optimum(None, [1001], tmp_path, suite="gusts")
    elastic = read_suite("above_rated_elastic").cases[0]
    with pytest.raises(InputError, match="of a rigid turbine with collective pitch"):
        Search(elastic, SEED, None, DURATION, SKIP)
