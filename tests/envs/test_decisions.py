"""Decisions that leave the operating point of a baseline alone: washout and authority."""

from math import exp, sqrt

import numpy as np
import pytest

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs.actions import ActionMode
from fowt_env.envs.decisions import Decisions, DecisionSettings, authority_of, wind_entry
from fowt_env.envs.observations import entries
from fowt_env.errors import InputError

DT = 0.1
WIND = (0, 15.0, 0.0)  # where the estimated wind is in an observation, m/s per unit, centre


def shaped(**changes):
    settings = DecisionSettings(hold=2, history=0, **changes)
    wind = None if settings.authority is None else WIND
    decisions = Decisions(1, settings, DT, wind)
    decisions.restart([18.0 / 15.0], np.zeros(2))
    return decisions


def test_a_constant_decision_comes_to_nothing_through_the_washout():
    decisions = shaped(washout=20.0, smoothing=0.0)
    actions = np.array([decisions.smooth([0.8, -0.3]) for _ in range(3000)])
    time = DT * np.arange(3000)
    expected = np.exp(-time / 20.0)[:, None] * [0.8, -0.3]
    assert np.abs(actions - expected).max() < 1e-12
    assert np.abs(actions[-1]).max() < 1e-6


def test_the_sum_of_what_is_applied_is_bounded_whatever_is_decided():
    """Also of decisions that gain by the clipping at +-1: up all the time, down for moments."""
    decisions = shaped(washout=20.0, smoothing=0.0)
    bound = 1.0 / (1.0 - exp(-DT / 20.0))
    total, largest = 0.0, 0.0
    for i in range(20000):
        decision = -1.0 if i % 40 == 0 else 1.0
        total += decisions.smooth(np.full(2, decision))[0]
        largest = max(largest, abs(total))
    assert 0.5 * bound < largest <= bound * (1.0 + 1e-9)


def test_washout_and_authority_are_their_plain_formulas():
    rng = np.random.default_rng(0)
    decisions = shaped(washout=15.0, smoothing=0.4, authority=(0.2, 1.5), authority_time=30.0)
    mean, variance = np.float64(np.float32(18.0 / 15.0)) * 15.0, 0.0
    smoothed = low_pass = 0.0
    seen = []
    for period in range(600):
        if period % 2 == 0 and period:
            wind = np.float32((18.0 + 2.0 * np.sin(0.05 * period) + 0.1 * rng.normal()) / 15.0)
            decisions.append([wind])
            deviation = 15.0 * np.float64(wind) - mean
            mean += (1.0 - exp(-0.2 / 30.0)) * deviation
            variance += (1.0 - exp(-0.2 / 30.0)) * (deviation**2 - variance)
        decision = rng.uniform(-1.0, 1.0)
        smoothed += (1.0 - exp(-DT / 0.4)) * (decision - smoothed)
        share = min(max((sqrt(variance) - 0.2) / 1.3, 0.0), 1.0)
        action = min(max(share * smoothed - low_pass, -1.0), 1.0)
        low_pass += (1.0 - exp(-DT / 15.0)) * action
        seen.append(share)
        assert decisions.smooth(np.full(2, decision)) == pytest.approx([action, action], abs=1e-12)
    assert seen[0] == 0.0 < seen[-1] < 1.0


def test_nothing_is_added_in_a_wind_that_does_not_move():
    decisions = shaped(authority=(0.3, 0.9))
    rng = np.random.default_rng(1)
    for _ in range(500):
        decisions.append([(18.0 + 0.2 * rng.normal()) / 15.0])
        assert np.all(decisions.smooth(rng.uniform(-1.0, 1.0, 2)) == 0.0)


def test_without_either_the_action_is_the_smoothed_decision_alone():
    plain, other = Decisions(1, DecisionSettings(history=0), DT), shaped(authority=(1e-9, 1e-8))
    other.data.wind[1] = 1.0
    decision = [0.4, -0.2]
    for _ in range(20):
        assert np.abs(plain.smooth(decision) - other.smooth(decision)).max() < 1e-15


def state(decisions):
    return [decisions.data.smoothed.tolist(), decisions.data.lasting.tolist(), decisions.data.wind.tolist()]


def test_a_restart_forgets_what_was_applied_and_how_the_wind_moved():
    decisions = shaped(washout=10.0, authority=(0.1, 0.2))
    first = state(decisions)
    for wind in (14.0, 22.0, 15.0):
        decisions.append([wind / 15.0])
        decisions.smooth(np.ones(2))
    assert authority_of(decisions.constants, decisions.data) == 1.0 and state(decisions) != first
    decisions.restart([18.0 / 15.0], np.zeros(2))
    assert state(decisions) == first and authority_of(decisions.constants, decisions.data) == 0.0


def test_the_estimated_wind_is_found_among_what_is_observed():
    turbine = read_turbine(read_platform("oc3_hywind").turbine)
    observed = entries(("rotor_speed", "estimated_wind"), turbine, ())
    settings = DecisionSettings(authority=[0.3, 0.9])
    assert settings.authority == (0.3, 0.9)
    assert wind_entry(settings, ActionMode.RESIDUAL, observed) == (1, 15.0, 0.0)
    assert wind_entry(DecisionSettings(), ActionMode.DIRECT, observed) is None
    assert wind_entry(DecisionSettings(washout=9.0), ActionMode.RESIDUAL, observed) is None
    with pytest.raises(InputError, match="needs the channel 'estimated_wind' in the observation"):
        wind_entry(settings, ActionMode.RESIDUAL, observed[:1])
    with pytest.raises(InputError, match="decisions.authority = .*needs the action mode 'residual'"):
        wind_entry(settings, ActionMode.SETPOINT, observed)
    with pytest.raises(InputError, match="decisions.washout = 9.0: needs the action mode 'residual'"):
        wind_entry(DecisionSettings(washout=9.0), ActionMode.DIRECT, observed)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"washout": -1.0}, r"decisions.washout = -1.0: must be in \[0, 10000\] s"),
        ({"washout": "long"}, "decisions.washout = 'long'"),
        ({"authority_time": 0.0}, r"decisions.authority_time = 0.0: must be in \[1, 10000\] s"),
        ({"authority": (0.9, 0.3)}, r"decisions.authority = \(0.9, 0.3\): must be a pair \(low, high\)"),
        ({"authority": 0.3}, "decisions.authority = 0.3: must be a pair"),
        ({"authority": (0.1, float("nan"))}, "decisions.authority = .*must be a pair"),
    ],
)
def test_settings_out_of_range_are_named(changes, message):
    with pytest.raises(InputError, match=message):
        DecisionSettings(**changes)
