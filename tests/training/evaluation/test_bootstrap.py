"""Interquartile means and crossed intervals on values whose answers are known."""

import numpy as np
import pytest

from fowt_env.training.evaluation.bootstrap import crossed_estimate, interquartile_mean, interval


def test_the_interquartile_mean_leaves_out_a_quarter_at_each_end():
    assert interquartile_mean([100.0, 1.0, 2.0, -50.0]) == 1.5


def test_a_value_on_a_quartile_counts_in_part():
    # of five values the middle half is 2.5: the third, and three quarters of the second and the fourth
    assert interquartile_mean([10.0, 0.0, 1.0, 3.0, 2.0]) == pytest.approx((0.75 * 1 + 2 + 0.75 * 3) / 2.5)
    assert interquartile_mean([7.0]) == 7.0


def test_a_weight_is_as_many_copies_of_its_value():
    values = np.random.default_rng(0).normal(size=7)
    weights = np.array([[1, 1, 1, 1, 1, 1, 1], [0, 3, 0, 2, 1, 1, 0], [0, 0, 7, 0, 0, 0, 0]], dtype=float)
    found = interquartile_mean(values, weights)
    for mean, copies in zip(found, weights.astype(int), strict=True):
        assert mean == pytest.approx(interquartile_mean(np.repeat(values, copies)))
    assert found[2] == values[2]


def test_equal_values_have_an_interval_without_width():
    for positive in (False, True):
        found = crossed_estimate(np.full((4, 2, 5), 0.7), 200, positive)
        assert found == pytest.approx((0.7, 0.7, 0.7))


def test_one_seed_of_each_kind_has_no_interval_and_no_value_no_estimate():
    estimate, low, high = crossed_estimate(np.array([[[1.0], [3.0]]]), 200)
    assert estimate == 2.0 and np.isnan(low) and np.isnan(high)
    assert np.isnan(crossed_estimate(np.full((2, 2, 2), np.nan), 200)).all()


@pytest.mark.parametrize(("members", "seeds"), [(1, 3), (3, 1), (3, 6), (6, 3), (2, 2)])
def test_fewer_than_four_seeds_of_either_kind_have_no_interval(members, seeds):
    values = np.random.default_rng(0).normal(1.0, 0.1, (members, 2, seeds))
    estimate, low, high = crossed_estimate(values, 200)
    assert estimate == pytest.approx(1.0, abs=0.2) and np.isnan(low) and np.isnan(high)
    whole = np.random.default_rng(0).normal(1.0, 0.1, (max(members, 4), 2, max(seeds, 4)))
    assert np.isfinite(crossed_estimate(whole, 200)).all()


def test_a_seed_without_any_value_is_none_of_the_four():
    values = np.random.default_rng(0).normal(1.0, 0.1, (1, 2, 4))
    values[:, :, 3] = np.nan
    assert np.isnan(crossed_estimate(values, 200)[1])
    values[0, 0, 2], values[0, 1, 3] = np.nan, 1.0  # with one in some case it is
    assert np.isfinite(crossed_estimate(values, 200)).all()


def test_the_interval_of_positive_values_stays_above_zero_and_that_of_counts_ends_there():
    scattered = np.array([[[0.001, 0.5, 3.0, 0.01, 0.02]]])
    assert crossed_estimate(scattered, 500)[1] < 0.0 < crossed_estimate(scattered, 500, positive=True)[1]
    with_zero = np.array([[[0.0, 5.0, 0.0, 1.0, 30.0]]])
    assert crossed_estimate(with_zero, 500, positive=True)[1] == 0.0
    for draws, positive in (
        ([[0.0], [2.0]] * 9, True),
        ([[0.1], [3.0]] * 9, True),
        ([[0.1], [3.0]] * 9, False),
    ):
        low, high = interval(np.array([1.0]), np.array(draws), 4, positive)
        assert (low[0] == 0.0) == (draws[0][0] == 0.0) and (low[0] < 0.0) == (not positive) and high[0] > 2.0


def test_the_ends_of_a_positive_interval_are_as_many_times_above_and_below_as_its_logarithm_says():
    values = np.exp(np.random.default_rng(5).normal(size=(400, 1)))
    low, high = interval(np.array([1.0]), values, 6, positive=True)
    below, above = interval(np.array([0.0]), np.log(values), 6)
    assert (low[0], high[0]) == pytest.approx((np.exp(below[0]), np.exp(above[0])))


def test_training_seeds_widen_the_interval_by_what_they_differ():
    rng = np.random.default_rng(1)
    weather = rng.normal(1.0, 0.02, (1, 7, 6)).repeat(4, axis=0)
    alike, apart = weather, weather + np.array([-0.1, 0.0, 0.1, 0.0])[:, None, None]
    single, same, other = (crossed_estimate(values, 2000) for values in (weather[:1], alike, apart))
    assert same == pytest.approx(single, abs=2e-3)
    assert other[2] - other[1] > 5.0 * (same[2] - same[1])


@pytest.mark.parametrize(
    ("members", "seeds", "training", "weather"),
    [(1, 6, 0.0, 1.0), (4, 6, 1.0, 1.0), (4, 6, 1.0, 0.3), (4, 6, 0.3, 1.0), (4, 4, 1.0, 1.0)],
)
@pytest.mark.parametrize("positive", [False, True])
def test_crossed_intervals_hold_the_truth_at_least_as_often_as_they_say(
    members, seeds, training, weather, positive
):
    rng, trials, held = np.random.default_rng(members + seeds), 300, 0
    for _ in range(trials):
        values = (
            training * rng.normal(size=(members, 1, 1))
            + weather * rng.normal(size=(1, 1, seeds))
            + 0.3 * rng.normal(size=(members, 7, seeds))
        )
        if positive:  # ratios about one, whose interquartile mean is near their median
            _, low, high = crossed_estimate(np.exp(0.2 * values), 300, positive=True)
            held += low <= 1.0 <= high
        else:
            _, low, high = crossed_estimate(values, 300)
            held += low <= 0.0 <= high
    assert 0.92 <= held / trials <= 0.995
