"""Steps that are decisions: the environment against a plain loop over its control periods."""

import numpy as np
import pytest

from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.envs.decisions import DecisionSettings
from fowt_env.errors import InputError

QUICK = {"rotor": "table", "wave_components": 10, "wind": 18.0, "duration": 8.0}


def plain_features(seen):
    """Newest observation, then each change, one number at a time."""
    features = list(seen[0])
    for newer, older in zip(seen[:-1], seen[1:], strict=True):
        features += [np.float32(a - b) for a, b in zip(newer, older, strict=True)]
    return np.array(features, dtype=np.float32)


@pytest.mark.parametrize("mode", ["residual", "direct"])
def test_a_decision_is_its_control_periods_one_by_one(mode):
    settings = {"hold": 4, "smoothing": 0.3, "history": 3}
    env = FowtEnv(action_mode=mode, decisions=settings, **QUICK)
    features, _ = env.reset(seed=5)
    single = FowtEnv(action_mode=mode, **QUICK)
    observation, _ = single.reset(seed=5)
    seen = [observation] * 4
    action = np.array(single.last_action)
    rng = np.random.default_rng(1)
    share = 1.0 - np.exp(-0.1 / 0.3)
    for step in range(20):
        assert np.array_equal(features, plain_features(seen)) and features in env.observation_space
        decision = rng.uniform(-0.3, 0.3, 2)
        features, reward, terminated, truncated, info = env.step(decision)
        total, terms = 0.0, []
        for _ in range(4):
            action = action + share * (decision - action)
            observation, one, *_, last = single.step(action)
            total += one
            terms.append(last["reward/rotor_speed"])
        seen = [observation, *seen[:-1]]
        assert reward == pytest.approx(total / 4, rel=1e-13)
        assert info["reward/rotor_speed"] == pytest.approx(np.mean(terms), rel=1e-13)
        assert info["time"] == last["time"] and not terminated and truncated == (step == 19)


def test_an_episode_that_fails_within_a_decision_is_paid_up_to_its_failure_only():
    env = FowtEnv(action_mode="direct", reward="score", decisions={"hold": 40, "smoothing": 0.0}, **QUICK)
    env.reset(seed=0)
    rewards, terminated = [], False
    while not terminated:
        _, reward, terminated, truncated, info = env.step((-1.0, -1.0))
        rewards.append(reward)
        assert not truncated
    assert "overspeed" in info["termination"] and info["time"] < 4.0 * len(rewards) - 0.05
    assert all(0.0 <= reward <= 1.0 for reward in rewards)


@pytest.mark.parametrize("shaping", [{}, {"washout": 4.0, "authority": (0.01, 0.3), "authority_time": 3.0}])
def test_the_state_of_a_batch_goes_on_in_another(shaping):
    settings = DecisionSettings(hold=2, smoothing=0.5, history=2, **shaping)
    given = QUICK | {"action_mode": "residual", "observation": ("rotor_speed", "estimated_wind")}
    one, other = (FowtVectorEnv(2, "SameStep", 1, decisions=settings, **given) for _ in range(2))
    one.reset(seed=1)
    actions = np.random.default_rng(0).uniform(-0.2, 0.2, (60, 2, 2))
    for action in actions[:9]:
        features = one.step(action)[0]
    state = one.get_state()
    expected = [one.step(action) for action in actions[9:]]
    other.reset(seed=3)
    other.set_state(state)
    assert np.array_equal(other.observations, features)
    for action, want in zip(actions[9:], expected, strict=True):
        got = other.step(action)
        assert all(np.array_equal(a, b) for a, b in zip(got[:4], want[:4], strict=True))
    assert any(want[3].any() for want in expected)  # through the end of an episode


def test_features_are_scaled_by_the_values_given():
    given = QUICK | {"action_mode": "residual", "observation": ("rotor_speed", "platform_pitch_rate")}
    given |= {"decisions": {"hold": 2, "history": 1}}
    plain, scaled = FowtEnv(**given), FowtEnv(**given, normalise={"rotor_speed": (1.2, 0.02, 0.001)})
    plain.reset(seed=3), scaled.reset(seed=3)
    for _ in range(10):
        raw, seen = plain.step((0.3, -0.2))[0].astype(float), scaled.step((0.3, -0.2))[0]
    entry = plain.observed[0]
    speed, change = raw[0] * entry.scale + entry.centre, raw[2] * entry.scale
    expected = [(speed - 1.2) / 0.02, raw[1], change / 0.001, raw[3]]
    assert seen == pytest.approx(np.clip(expected, -10.0, 10.0), rel=1e-4)
    assert abs(seen[2]) > 0.05


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"decisions": {"hold": 3}}, "the period of a decision = 0.3 s does not divide duration"),
        ({"decisions": {"hlod": 3}}, "unknown key of decisions 'hlod'.*Did you mean 'hold'"),
        ({"decisions": 5}, "decisions = 5: must be DecisionSettings, a mapping"),
        ({"normalise": {"rotor_speed": (0, 1, 1)}}, "normalise: needs decisions"),
        ({"decisions": {}, "normalise": {"rotor": (0, 1, 1)}}, "unknown entry of normalise 'rotor'"),
        ({"decisions": {}, "normalise": {"rotor_speed": (0, 1)}}, "must be .centre, scale, change."),
        ({"decisions": {}, "normalise": {"rotor_speed": (0, 0, 1)}}, "with scale, change > 0"),
        (
            {"decisions": {}, "action_mode": "residual", "baseline": "mpc"},
            "is not compiled: needs decisions=None",
        ),
    ],
)
def test_wrong_settings_of_decisions_are_named(settings, message):
    with pytest.raises(InputError, match=message):
        FowtEnv(**QUICK | settings)


def test_a_single_control_period_is_refused():
    env = FowtEnv(decisions={}, **QUICK)
    env.reset(seed=0)
    with pytest.raises(InputError, match="needs decisions=None"):
        env.step_physical(4e4, 0.2)
