"""Lifetime means, p-values and crossed intervals on values whose answers are known."""

import numpy as np
import pytest

from fowt_env.training.evaluation.bootstrap import (
    case_means,
    crossed_ratio,
    holm,
    interval,
    lifetime_means,
    p_values,
    resample_weights,
)

ALIKE = np.ones(20)


def crossed(values, resamples=10_000, positive=False, exponent=1.0):
    """(estimate, low, high) of values (training seeds, cases, weather seeds) over a baseline of ones."""
    values = np.asarray(values)
    base, shares = np.ones(values.shape[1:]), ALIKE[: values.shape[1]]
    found = crossed_ratio(values, base, shares, exponent, resamples, positive)
    return found.value, found.low, found.high


def test_a_lifetime_mean_is_the_powers_mean_by_the_shares_of_the_cases():
    values = np.random.default_rng(0).uniform(1.0, 3.0, (3, 5, 3))
    shares, exponents = np.array([0.5, 0.3, 0.2]), np.array([1.0, 2.0, 4.0])
    found = lifetime_means(values, np.ones((1, 5)), shares, exponents)[0]
    for metric, p in enumerate(exponents):  # the slow twin, in words
        damage = 0.0
        for case, share in enumerate(shares):
            damage += share * sum(x**p for x in values[case, :, metric]) / 5
        assert found[metric] == pytest.approx(damage ** (1.0 / p))
    drawn = np.array([[2.0, 0.0, 1.0, 1.0, 1.0]])
    copies = values[:, [0, 0, 2, 3, 4]]
    expected = lifetime_means(copies, np.ones((1, 5)), shares, exponents)
    assert lifetime_means(values, drawn, shares, exponents) == pytest.approx(expected)


def test_the_share_of_a_case_without_a_figure_goes_to_the_others():
    values = np.array([[[1.0, np.nan]], [[3.0, 7.0]], [[5.0, np.nan]]])
    one, shares = np.ones((1, 1)), np.array([0.5, 0.25, 0.25])
    assert lifetime_means(values, one, shares, np.ones(2))[0].tolist() == [2.5, 7.0]
    nothing = np.full((2, 1, 1), np.nan)
    assert np.isnan(lifetime_means(nothing, one, shares[:2], np.ones(1))).all()
    only = np.array([0.0, 1.0, 0.0])  # a case without a share counts for nothing
    assert lifetime_means(values, one, only, np.ones(2))[0].tolist() == [3.0, 7.0]


def test_a_p_value_is_below_005_where_the_95_percent_interval_leaves_the_value_out():
    rng = np.random.default_rng(2)
    values = rng.normal(size=(6, 300)) + rng.uniform(-2.0, 2.0, 300)
    estimate, resampled = values.mean(axis=0), case_means(values, resample_weights(6, 2000))
    low, high = interval(estimate, resampled, 6)
    p = p_values([(resampled - estimate, 6)], -estimate)
    outside = (low > 0.0) | (high < 0.0)
    assert ((p < 0.05) == outside).all() and 30 < outside.sum() < 270
    assert p_values([(resampled - estimate, 6)], np.zeros(300)) == pytest.approx(1.0)
    assert np.isnan(p_values([], -estimate)).all()


def test_p_values_of_a_true_hypothesis_are_below_a_level_about_as_often_as_it_says():
    values = np.random.default_rng(3).normal(size=(6, 3000))
    estimate = values.mean(axis=0)
    p = p_values([(case_means(values, resample_weights(6, 1000)) - estimate, 6)], -estimate)
    for level in (0.2, 0.05, 0.01):  # within two deviations of 3000 draws
        spread = np.sqrt(level * (1.0 - level) / 3000)
        assert np.mean(p < level) == pytest.approx(level, abs=2.0 * spread)


def test_holm_s_correction_worked_by_hand():
    # Holm 1979: 0.01, 0.02, 0.03, 0.04 times 4, 3, 2, 1, and none below the one before it
    assert holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.5, np.nan, 0.9]) == pytest.approx([1.0, np.nan, 1.0], nan_ok=True)
    assert len(holm([])) == 0


def test_a_crossed_p_value_goes_with_its_interval_and_a_ratio_is_of_powers():
    rng = np.random.default_rng(4)
    own, base = rng.uniform(0.5, 1.0, (4, 3, 6)), rng.uniform(1.0, 2.0, (3, 6))
    shares = np.array([0.6, 0.3, 0.1])
    found = crossed_ratio(own, base, shares, 4.0, positive=True)
    means = [(shares @ (x**4).mean(axis=-1)) ** 0.25 for x in (*own, base)]
    assert found.value == pytest.approx(np.mean(means[:-1]) / means[-1])
    assert found.p_value(1.001 * found.high) < 0.05 < found.p_value(0.999 * found.high)
    assert found.p_value(0.999 * found.low) < 0.05 < found.p_value(1.001 * found.low)
    assert found.p_value(found.value) == 1.0 and np.isnan(
        crossed_ratio(own[:1, :, :1], base[:, :1], shares).low
    )


def test_one_seed_of_each_kind_has_no_interval_and_no_value_no_estimate():
    estimate, low, high = crossed(np.array([[[1.0], [3.0]]]), 200)
    assert estimate == 2.0 and np.isnan(low) and np.isnan(high)
    assert np.isnan(crossed(np.full((2, 2, 2), np.nan), 200)).all()


@pytest.mark.parametrize(("members", "seeds"), [(1, 3), (3, 1), (3, 6), (6, 3), (2, 2)])
def test_fewer_than_four_seeds_of_either_kind_have_no_interval(members, seeds):
    values = np.random.default_rng(0).normal(1.0, 0.1, (members, 2, seeds))
    estimate, low, high = crossed(values, 200)
    assert estimate == pytest.approx(1.0, abs=0.2) and np.isnan(low) and np.isnan(high)
    whole = np.random.default_rng(0).normal(1.0, 0.1, (max(members, 4), 2, max(seeds, 4)))
    assert np.isfinite(crossed(whole, 200)).all()


def test_the_interval_of_positive_values_stays_above_zero_and_that_of_counts_ends_there():
    scattered = np.array([[[0.001, 0.5, 3.0, 0.01, 0.02]]])
    assert crossed(scattered, 500)[1] < 0.0 < crossed(scattered, 500, positive=True)[1]
    with_zero = np.array([[[0.0, 5.0, 0.0, 1.0, 30.0]]])
    assert crossed(with_zero, 500, positive=True)[1] == 0.0
    for draws, positive in (
        ([[0.0], [2.0]] * 9, True),
        ([[0.1], [3.0]] * 9, True),
        ([[0.1], [3.0]] * 9, False),
    ):
        low, high = interval(np.array([1.0]), np.array(draws), 4, positive)
        assert (low[0] == 0.0) == (draws[0][0] == 0.0) and (low[0] < 0.0) == (not positive) and high[0] > 2.0


def test_training_seeds_widen_the_interval_by_what_they_differ():
    rng = np.random.default_rng(1)
    weather = rng.normal(1.0, 0.02, (1, 7, 6)).repeat(4, axis=0)
    alike, apart = weather, weather + np.array([-0.1, 0.0, 0.1, 0.0])[:, None, None]
    single, same, other = (crossed(values, 2000) for values in (weather[:1], alike, apart))
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
        if positive:
            _, low, high = crossed(np.exp(0.2 * values), 300, positive=True)
            held += low <= np.exp(0.02 * (training**2 + weather**2 + 0.09)) <= high
        else:
            _, low, high = crossed(values, 300)
            held += low <= 0.0 <= high
    assert 0.92 <= held / trials <= 0.995
