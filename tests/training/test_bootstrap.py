"""Interquartile means and crossed intervals on values whose answers are known."""

import numpy as np
import pytest

from training.bootstrap import crossed_estimate, interquartile_mean


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
    assert crossed_estimate(np.full((3, 2, 4), 0.7), 200) == pytest.approx((0.7, 0.7, 0.7))


def test_one_seed_of_each_kind_has_no_interval_and_no_value_no_estimate():
    estimate, low, high = crossed_estimate(np.array([[[1.0], [3.0]]]), 200)
    assert estimate == 2.0 and np.isnan(low) and np.isnan(high)
    assert np.isnan(crossed_estimate(np.full((2, 2, 2), np.nan), 200)).all()


def test_training_seeds_widen_the_interval_by_what_they_differ():
    rng = np.random.default_rng(1)
    weather = rng.normal(1.0, 0.02, (1, 7, 6)).repeat(3, axis=0)
    alike, apart = weather, weather + np.array([-0.1, 0.0, 0.1])[:, None, None]
    single, same, other = (crossed_estimate(values, 2000) for values in (weather[:1], alike, apart))
    assert same == pytest.approx(single, abs=2e-3)
    assert other[2] - other[1] > 5.0 * (same[2] - same[1])


@pytest.mark.parametrize(
    ("members", "seeds", "training", "weather"),
    [(1, 6, 0.0, 1.0), (3, 6, 1.0, 1.0), (3, 6, 1.0, 0.3), (3, 6, 0.3, 1.0), (3, 3, 1.0, 1.0)],
)
def test_crossed_intervals_hold_the_truth_at_least_as_often_as_they_say(members, seeds, training, weather):
    rng, trials, held = np.random.default_rng(members + seeds), 300, 0
    for _ in range(trials):
        values = (
            training * rng.normal(size=(members, 1, 1))
            + weather * rng.normal(size=(1, 1, seeds))
            + 0.3 * rng.normal(size=(members, 7, seeds))
        )
        _, low, high = crossed_estimate(values, 300)
        held += low <= 0.0 <= high
    assert 0.92 <= held / trials <= 0.995
