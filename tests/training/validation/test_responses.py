"""Fits of motions in small waves and of free decays, on signals whose answers are known."""

import numpy as np
import pytest

from fowt_env.training.validation.responses import fitted, modal_rates
from fowt_env.training.validation.validate import validate_cases

TIME = np.arange(100.0, 700.0, 0.1)


def test_amplitudes_are_exact_beside_modes_that_the_start_has_left():
    omega = np.array([0.3, 0.7, 1.1])
    amplitude = np.array([1.0 + 0.5j, -0.2j, 0.01])
    value = (amplitude * np.exp(1j * np.outer(TIME, omega))).real.sum(axis=1)
    slow = 2.0 * np.exp(-0.004 * (TIME - TIME[0])) * np.cos(0.05 * TIME + 1.0)
    found = fitted(TIME, value + slow + 3.0, omega, [0.004 + 0.05j])
    assert found == pytest.approx(amplitude, abs=1e-9)


def test_rates_of_two_decaying_modes_are_found_from_three_signals():
    rates = np.array([0.002 + 0.06j, 0.08 + 0.8j])
    draw = np.random.default_rng(1)

    def signal():
        parts = ((draw.normal(), draw.normal()) for _ in rates)
        return sum(
            size * np.exp(-rate.real * (TIME - TIME[0])) * np.cos(rate.imag * TIME + angle)
            for rate, (size, angle) in zip(rates, parts, strict=True)
        )

    values = np.column_stack([signal() for _ in range(3)])
    found = modal_rates(TIME, values, [0.0 + 0.058j, 0.05 + 0.75j])
    assert found == pytest.approx(rates, rel=1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("platform", "exceptions"),
    # surge of the barge all but vanishes at 0.6 rad/s, between two steep slopes
    [
        pytest.param("nrel5mw_oc4_semi", (), marks=pytest.mark.nightly),
        ("nrel5mw_iti_barge", ("PtfmSurge per metre of wave at 0.6 rad/s",)),
    ],
)
def test_periods_and_responses_are_those_of_the_frequency_domain_within_1_percent(platform, exceptions):
    study = validate_cases(["periods", "responses"], platform=platform)
    assert len(study.rows) >= 36
    for row in study.rows:
        assert row.allowed == 1.0
        assert row.verdict == "met" or row.quantity in exceptions, f"{row.quantity}: {row.error:.3g} %"
