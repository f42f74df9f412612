"""Measures of the comparison on signals whose answers are known."""

import numpy as np
import pytest

from fowt_env.errors import InputError
from fowt_env.training.validation.signal_errors import (
    band_energy,
    decay_decrement,
    decay_period,
    harmonics,
    normalised_rms,
    recovery,
    ringing,
)

TIME = np.linspace(0.0, 200.0, 2001)


def decay(period, decrement, centre):
    return centre + 3.0 * np.exp(-decrement * TIME / period) * np.cos(2.0 * np.pi * TIME / period)


@pytest.mark.parametrize(("period", "decrement"), [(30.0, 0.3), (8.0, 0.05)])
def test_period_and_decrement_of_a_damped_cosine_are_found(period, decrement):
    value = decay(period, decrement, 0.7)
    assert decay_period(TIME, value, 0.7) == pytest.approx(period, rel=1e-4)
    for cycle in (2, 3):
        assert decay_decrement(TIME, value, 0.7, cycle) == pytest.approx(decrement, rel=2e-3)


def test_a_record_of_too_few_cycles_is_refused():
    with pytest.raises(InputError, match="9 are needed"):
        decay_period(TIME, decay(120.0, 0.1, 0.0), 0.0)


def test_an_overshoot_that_fades_exponentially_has_its_size_and_time_constant():
    after = np.maximum(TIME - 20.0, 0.0)
    value = 5.0 - (TIME > 20.0) * (2.0 + 0.8 * np.exp(-after / 7.0))  # falls beyond its new level
    before, last, overshoot, time = recovery(TIME, value, 20.0, 150.0)
    assert (before, last) == pytest.approx((5.0, 3.0), abs=1e-6)
    assert (overshoot, time) == pytest.approx((-0.8, 7.0), rel=0.02)  # a sample after the step


def test_harmonics_are_exact_beside_a_slow_transient():
    time, omega = np.linspace(0.0, 200.0, 2001)[:-1], 2.0 * np.pi / 5.0
    value = 2.0 * np.cos(omega * time + 0.4) + 0.01 * np.cos(2.0 * omega * time - 1.0)
    slow = 3.0 * np.exp(-time / 100.0) * np.cos(2.0 * np.pi * time / 124.0) + 7.0
    found = harmonics(time, value + slow, omega)
    assert found[0] == pytest.approx(2.0 * np.exp(0.4j), abs=1e-3)
    assert found[1] == pytest.approx(0.01 * np.exp(-1j), abs=2e-4)


def test_band_energy_is_the_variance_of_the_components_inside():
    value = 2.0 * np.sin(2.0 * np.pi * 0.1 * TIME) + 0.5 * np.sin(2.0 * np.pi * 0.3 * TIME)
    assert band_energy(TIME, value, 0.08, 0.12) == pytest.approx(2.0, rel=2e-3)
    assert band_energy(TIME, value, 0.25, 0.35) == pytest.approx(0.125, rel=2e-3)
    assert band_energy(TIME, value, 0.4, 0.6) < 1e-6


def test_normalised_rms_of_a_shifted_copy_is_the_shift_over_the_deviation():
    value = np.random.default_rng(1).standard_normal(1000)
    assert normalised_rms(value, value) == 0.0
    assert normalised_rms(value + 0.3, value) == pytest.approx(0.3 / value.std())


@pytest.mark.parametrize(("frequency", "ratio"), [(0.518, 0.006), (0.37, 0.03)])
def test_frequency_and_damping_of_a_ringing_tower_are_found_beside_its_slow_motion(frequency, ratio):
    time = TIME[TIME < 20.0]
    omega = 2.0 * np.pi * frequency
    value = 0.2 * np.exp(-ratio * omega * time) * np.cos(omega * time + 0.3)
    slow = decay(28.0, 0.2, 0.1)[: len(time)]
    assert ringing(time, value + slow, 0.2, 1.0) == pytest.approx((frequency, ratio), rel=2e-3)
