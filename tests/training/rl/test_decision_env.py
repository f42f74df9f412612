"""Decisions: the vector environment against a plain loop over one environment."""

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("stable_baselines3")

from fowt_env.envs import FowtEnv
from fowt_env.envs.decisions import Decisions, DecisionSettings
from fowt_env.errors import InputError
from fowt_env.training.evaluation.metrics import turbine_metrics
from fowt_env.training.rl import decision_env
from fowt_env.training.rl.decision_env import DecisionVecEnv, ValidationVecEnv
from fowt_env.training.rl.sb3_env import FowtSB3VecEnv

QUICK = {"rotor": "table", "wave_components": 10, "wind": 18.0, "duration": 8.0}


def plain_features(seen):
    """Newest observation, then each change, one number at a time."""
    features = list(seen[0])
    for newer, older in zip(seen[:-1], seen[1:], strict=True):
        features += [np.float32(a - b) for a, b in zip(newer, older, strict=True)]
    return np.array(features, dtype=np.float32)


@pytest.mark.parametrize("mode", ["residual", "direct"])
def test_a_decision_is_its_control_periods_one_by_one(mode):
    settings = DecisionSettings(hold=4, smoothing=0.3, history=3)
    env = DecisionVecEnv(FowtSB3VecEnv(1, threads=1, action_mode=mode, **QUICK), settings)
    env.seed(5)
    features = env.reset()
    single = FowtEnv(action_mode=mode, **QUICK)
    observation, _ = single.reset(seed=5)
    seen = [observation] * 4
    action = np.array(single.last_action)
    rng = np.random.default_rng(1)
    share = 1.0 - np.exp(-0.1 / 0.3)
    for _ in range(19):
        assert np.array_equal(features[0], plain_features(seen))
        decision = rng.uniform(-0.3, 0.3, 2).astype(np.float32)
        features, rewards, dones, _ = env.step(decision[None])
        total = 0.0
        for _ in range(4):
            action = action + share * (np.float64(decision) - action)
            observation, reward, terminated, truncated, _ = single.step(action)
            total += float(np.float32(reward))
        seen = [observation, *seen[:-1]]
        assert rewards[0] == np.float32(total / 4)
        assert not (dones[0] or terminated or truncated)
    features, _, dones, infos = env.step(decision[None])
    for _ in range(4):
        action = action + share * (np.float64(decision) - action)
        observation, *_ = single.step(action)
    assert dones[0] and infos[0]["TimeLimit.truncated"]
    assert np.array_equal(infos[0]["terminal_observation"], plain_features([observation, *seen[:-1]]))
    assert np.all(features[0, len(observation) :] == 0.0)


def test_an_episode_that_fails_within_a_decision_is_paid_up_to_its_failure_only():
    settings = DecisionSettings(hold=50, smoothing=0.0, history=1)
    base = FowtSB3VecEnv(2, threads=1, action_mode="direct", reward={"failure": 50.0}, **QUICK)
    env = DecisionVecEnv(base, settings)
    env.seed(0)
    env.reset()
    held = np.array(base.env.envs[1].last_action)
    rewards, dones = None, np.zeros(2, dtype=bool)
    for _ in range(3):
        if not dones[0]:
            _, rewards, dones, infos = env.step(np.array([[-1.0, -1.0], held]))
    assert dones.tolist() == [True, False] and "overspeed" in infos[0]["termination"]
    assert rewards[0] < 0.0 < rewards[1]
    assert base.env.envs[0].view().measurement[0] > 0.0  # the next episode has begun


@pytest.mark.parametrize("shaping", [{}, {"washout": 4.0, "authority": (0.01, 0.3), "authority_time": 3.0}])
def test_the_state_of_a_batch_goes_on_in_another(shaping):
    settings = DecisionSettings(hold=2, smoothing=0.5, history=2, **shaping)
    given = QUICK | {"action_mode": "residual", "observation": ("rotor_speed", "estimated_wind")}
    one, other = (DecisionVecEnv(FowtSB3VecEnv(2, threads=1, **given), settings) for _ in range(2))
    one.seed(1)
    one.reset()
    actions = np.random.default_rng(0).uniform(-0.2, 0.2, (60, 2, 2))
    for action in actions[:9]:
        features = one.step(action)[0]
    state = one.get_state()
    expected = [one.step(action) for action in actions[9:]]
    other.reset()
    assert np.array_equal(other.set_state(state), features)
    for action, want in zip(actions[9:], expected, strict=True):
        got = other.step(action)
        assert all(np.array_equal(a, b) for a, b in zip(got[:3], want[:3], strict=True))
    assert any(want[2].any() for want in expected)  # through the end of an episode


def test_the_figures_of_validation_are_the_metrics_of_its_episodes():
    sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 10.0}
    episodes = [
        {"wind": {"kind": "ntm", "speed": speed, "class": "B"}, "sea": sea, "weather_seed": 1001}
        for speed in (14.0, 20.0)
    ]
    skip, dt = 5.0, 0.1
    settings = {name: value for name, value in QUICK.items() if name != "wind"} | {"duration": 20.0}
    settings |= {"action_mode": "residual", "baseline": "gspi_oc3"}
    env = ValidationVecEnv(episodes, skip, threads=1, **settings)
    env.reset()
    rows = [[], []]
    for _ in range(200):
        env.step(np.zeros((2, 2)))
        for row, one in zip(rows, env.env.envs, strict=True):
            row.append(one.channels())
    figures = env.figures()
    names = {
        "rotor_speed_std_[rpm]": "RotSpeed_std_[rpm]",
        "platform_pitch_std_[deg]": "PtfmPitch_std_[deg]",
        "blade_pitch_travel_[deg/s]": "blade_pitch_travel_[deg/s]",
        "shaft_power_mean_[kW]": "GenPwr_mean_[kW]",
        "shaft_power_std_[kW]": "GenPwr_std_[kW]",
        "torque_travel_[kN-m/s]": "torque_travel_[kN-m/s]",
    }
    others = {"shaft_torque_DEL_[kN-m]", "capped_power_mean_[kW]", "failed"}
    late = {"rotor_speed_offset_[%]", "blade_pitch_swing_[deg]"}  # of the time after 300 s
    assert {*names, *others, *late} == set(figures)
    assert all(np.all(np.isnan(figures[name])) for name in late)
    for i, one in enumerate(env.env.envs):
        columns = [channel.column for channel in one.scene.channels]
        # the first row is of the end of the first period; after the last step the next episode has begun
        frame = pd.DataFrame(rows[i][round(skip / dt) : -1]).set_axis(columns, axis=1)
        found = turbine_metrics(frame, one.scene.turbine)
        losses = one.scene.turbine.drivetrain.generator_efficiency
        for name, metric in names.items():
            factor = losses if name.startswith("shaft_power") else 1.0
            assert factor * figures[name][i] == pytest.approx(found[metric], rel=1e-12), name
        # the shaft's acceleration is that between control periods, and its bearing losses are left out
        assert figures["shaft_torque_DEL_[kN-m]"][i] == pytest.approx(found["RotTorq_DEL_[kN-m]"], rel=0.05)
        power = frame["GenPwr_[kW]"].to_numpy() / losses
        capped = np.minimum(power, 1e-3 * one.scene.turbine.torque_law.rated_power).mean()
        assert figures["capped_power_mean_[kW]"][i] == pytest.approx(capped, rel=1e-12)


def test_rest_in_steady_wind_is_judged_after_300_s(monkeypatch):
    monkeypatch.setattr(decision_env, "SETTLED_AFTER", 5.0)
    monkeypatch.setattr(decision_env, "SWING_AFTER", 6.0)
    env = ValidationVecEnv([{"wind": 18.0, "weather_seed": 1001}], 1.0, threads=1, **QUICK)
    env.reset()
    turbine = env.env.envs[0].scene.turbine
    env._clock = len(env._record)
    time = 0.1 * np.arange(env._clock)
    env._record[:] = 0.0
    env._record[:, 0, 0] = turbine.rated_rotor_speed * np.where(
        time < 5.0, 1.2, 0.997 + 0.01 * (-1.0) ** np.arange(80)
    )
    env._record[:, 0, 2] = np.where(time < 6.0, 0.1, 0.001 * np.sin(20.0 * time))
    figures = env.figures()
    assert figures["rotor_speed_offset_[%]"] == pytest.approx([0.3], abs=0.05)
    assert figures["blade_pitch_swing_[deg]"] == pytest.approx([np.rad2deg(0.002)], rel=0.05)


def test_restarting_one_row_leaves_the_others():
    decisions = Decisions(2, 1, DecisionSettings(history=2), 0.1)
    for value in (1.0, 2.0, 4.0):
        decisions.append(np.full((2, 1), value))
    decisions.restart(0, np.array([7.0]), np.array([0.1, 0.2]))
    assert decisions.features().tolist() == [[7.0, 0.0, 0.0], [4.0, 2.0, 1.0]]


@pytest.mark.parametrize("changes", [{"hold": 0}, {"history": -1}, {"smoothing": -0.1}, {"hold": 2.0}])
def test_settings_out_of_range_are_named(changes):
    with pytest.raises(InputError, match=f"decisions.{next(iter(changes))} = "):
        DecisionSettings(**changes)
