"""Reward terms: limits, ranges and signs."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import fowt_env
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs import FowtEnv
from fowt_env.envs.rewards import (
    AT_MARGIN,
    N_TERMS,
    REWARD_TERMS,
    TermIndex,
    build_scales,
    check_weights,
    fill_terms,
    platform_motion_term,
    power_shortfall_term,
    power_term,
    rotor_speed_term,
    tolerance,
    travel_term,
    weight_array,
    weighted_sum,
)
from fowt_env.errors import InputError
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure

TURBINE = read_turbine("nrel5mw")
SCALES = build_scales(TURBINE, 0.1)
RATED = TURBINE.rated_rotor_speed
RATED_TORQUE = TURBINE.torque_law.rated_torque
REST = np.array([0.05, RATED])


def ranking_tool():
    """docs/tools/reward_ranking.py as a module."""
    path = Path(__file__).resolve().parents[2] / "docs" / "tools" / "reward_ranking.py"
    spec = importlib.util.spec_from_file_location("reward_ranking", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def terms_of(now, before, reference=REST, failed=False):
    terms = np.full(N_TERMS, np.nan)
    fill_terms(now, before, reference, failed, SCALES, terms)
    return terms


def at_rated():
    m = np.zeros(N_MEASUREMENTS)
    m[Measure.ROTOR_SPEED] = RATED
    m[Measure.GENERATOR_TORQUE] = RATED_TORQUE
    m[Measure.PLATFORM_PITCH] = REST[0]
    m[Measure.BLADE_PITCH] = 0.2
    return m


def test_tolerance_is_one_inside_falls_to_a_tenth_one_margin_outside_and_is_none_of_what_is_not_finite():
    assert tolerance(0.0, (-1.0, 1.0), 0.5) == tolerance(1.0, (-1.0, 1.0), 0.5) == 1.0
    assert tolerance(1.5, (-1.0, 1.0), 0.5) == pytest.approx(AT_MARGIN, rel=1e-14)
    assert tolerance(-1.5, (-1.0, 1.0), 0.5) == pytest.approx(AT_MARGIN, rel=1e-14)
    assert tolerance(1.0001, (-1.0, 1.0), 0.0) == 0.0
    values = np.array([tolerance(x, (0.0, 1.0), 0.5) for x in np.linspace(1.0, 3.0, 200)])
    assert np.all(np.diff(values) < 0.0) and np.all((values >= 0.0) & (values <= 1.0))
    assert [tolerance(x, (-1.0, 1.0), 0.5) for x in (np.nan, np.inf, -np.inf)] == [0.0] * 3


@pytest.mark.parametrize("failed", [False, True])
def test_rated_operation_at_rest_earns_every_term_and_failure_costs_one(failed):
    m = at_rated()
    best = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0])  # but that of a rotor at rest
    best[TermIndex.FAILURE] = -1.0 * failed
    # rated torque times rated speed is rated power to the digits that the turbine file prints
    np.testing.assert_allclose(terms_of(m, m, failed=failed), best, atol=1e-5)


def test_power_term_is_the_share_below_rated_and_falls_above():
    for share in (0.0, 0.3, 0.9):
        assert power_term(RATED * share, RATED_TORQUE, SCALES) == pytest.approx(share, abs=1e-6)
    assert power_term(RATED, 1.2 * RATED_TORQUE, SCALES) == pytest.approx(AT_MARGIN, rel=1e-4)
    assert power_term(RATED, -RATED_TORQUE, SCALES) == 0.0


def test_power_shortfall_is_what_is_lacking_and_more_than_rated_counts_nothing():
    for share, expected in ((0.0, -1.0), (0.3, -0.7), (0.98, -0.02), (1.1, 0.0)):
        assert power_shortfall_term(RATED * share, RATED_TORQUE, SCALES) == pytest.approx(expected, abs=1e-6)
    assert power_shortfall_term(RATED, -RATED_TORQUE, SCALES) == -1.0


def test_rotor_speed_term_is_flat_from_the_steady_speed_to_rated():
    slow = 0.7 * RATED
    for speed in (slow, 0.85 * RATED, RATED):
        assert rotor_speed_term(speed, slow, SCALES) == 1.0
    assert rotor_speed_term(0.5 * RATED, slow, SCALES) == pytest.approx(AT_MARGIN, rel=1e-12)
    assert rotor_speed_term(1.2 * RATED, slow, SCALES) == pytest.approx(AT_MARGIN, rel=1e-12)
    assert rotor_speed_term(0.9 * RATED, RATED, SCALES) < 1.0


def test_platform_motion_term_is_constant_along_a_free_oscillation_of_thirty_seconds():
    amplitude, omega = np.radians(2.0), 2.0 * np.pi / 30.0
    values = [
        platform_motion_term(0.05 + amplitude * np.sin(p), amplitude * omega * np.cos(p), 0.05)
        for p in np.linspace(0.0, 6.0, 20)
    ]
    assert np.ptp(values) < 1e-12
    assert platform_motion_term(0.05 + np.radians(5.0), 0.0, 0.05) == pytest.approx(AT_MARGIN, rel=1e-12)


def test_travel_terms_cost_one_at_the_rate_limit():
    most = TURBINE.pitch_drive.rate_limit * 0.1
    assert travel_term(0.1, 0.1 + most, SCALES.max_pitch_increment) == pytest.approx(-1.0, rel=1e-12)
    assert travel_term(0.1, 0.1 - 0.5 * most, SCALES.max_pitch_increment) == pytest.approx(-0.5, rel=1e-12)
    assert travel_term(0.0, 1e9, SCALES.max_torque_increment) == -1.0
    assert travel_term(0.3, 0.3, SCALES.max_pitch_increment) == 0.0


def test_terms_stay_in_their_ranges_whatever_is_measured():
    rng = np.random.default_rng(5)
    size = np.array([1e-3, 1.0, 10.0, 1e5, 1e9, 1e300])
    low = np.array([term.low for term in REWARD_TERMS.values()])
    high = np.array([term.high for term in REWARD_TERMS.values()])
    for _ in range(2000):
        now, before = rng.normal(size=(2, N_MEASUREMENTS)) * rng.choice(size, (2, N_MEASUREMENTS))
        terms = terms_of(now, before, rng.normal(size=2), bool(rng.integers(2)))
        assert np.all((terms >= low) & (terms <= high)), terms


def test_every_term_has_a_weight_in_the_sum():
    rng = np.random.default_rng(1)
    terms = rng.normal(size=N_TERMS)
    weights = dict(zip(REWARD_TERMS, rng.uniform(size=N_TERMS).tolist(), strict=True))
    expected = sum(weights[name] * terms[TermIndex[name.upper()]] for name in REWARD_TERMS)
    assert weighted_sum(weight_array(weights), terms) == pytest.approx(expected, rel=1e-14)
    assert np.array_equal(weight_array({"power": 2.0}), [2.0] + [0.0] * (N_TERMS - 1))


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ({"powr": 1.0}, "Did you mean 'power'"),
        ({"power": -1.0}, "power = -1.0: must be a finite number >= 0"),
        ({"power": float("nan")}, "must be a finite number >= 0"),
        ({"power": "1"}, "must be a finite number >= 0"),
        ({"power": True}, "must be a finite number >= 0"),
    ],
)
def test_bad_weights_name_the_term_and_the_range(weights, message):
    with pytest.raises(InputError, match=message):
        check_weights("reward", weights)


def test_the_default_weights_rank_controllers_as_their_metrics_do():
    """By the geometric mean of the metrics' ratios; with all weights 1 the same runs are ranked otherwise."""
    tool = ranking_tool()
    table = tool.ranking()
    overall = np.log(table[list(tool.METRICS)]).mean(axis=1)
    assert list(table.index) == list(overall.sort_values().index)
    assert table.index[0] == "lqr"
    gaps = -np.diff(table["reward"])
    assert gaps.min() > 0.1  # of some 9 that perfection is paid
    page = (Path(__file__).resolve().parents[2] / "docs" / "results" / "rewards.md").read_text()
    assert tool.markdown(table) in page, tool.markdown(table)
    even = tool.ranking(("lqr", "pi_unscheduled", "gspi_oc3"), {name: 1.0 for name in REWARD_TERMS})
    assert even.index[0] == "pi_unscheduled"


def test_the_ranking_pays_what_a_step_of_the_environment_pays():
    tool = ranking_tool()
    env = FowtEnv(action_mode="residual", baseline="lqr", duration=20.0)
    wind, sea = {"kind": "ntm", "speed": 18.0, "class": "B"}, {"kind": "jonswap", "Hs": 3.5, "Tp": 8.6}
    env.reset(options={"wind": wind, "sea": sea, "weather_seed": 5, "offsets": {}})
    rewards = [env.step((0.0, 0.0))[1] for _ in range(200)]
    frame = fowt_env.simulate(env.scene, controller="lqr", duration=20.0)
    terms = tool.reward_terms(frame, env.scene)
    # the rows have the angular velocity about y, where a measurement has the derivative of the Euler angle
    np.testing.assert_allclose(terms @ weight_array(env.task.weights), rewards, rtol=5e-4)
