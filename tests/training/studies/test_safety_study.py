"""Agents with and without the safety layer: their figures are those of every other run."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from fowt_env.envs import FowtEnv, SafetyLayer
from fowt_env.training.studies.safety_study import CARELESS, Careless, episode_figures

QUICK = {"rotor": "table", "wave_components": 10, "duration": 30.0}
EPISODE = {"wind": 18.0, "sea": None, "weather_seed": 1001}


def test_no_torque_and_flat_blades_fail_in_overspeed_unless_the_layer_takes_over():
    agent = Careless(CARELESS[1])
    alone, guarded = (
        episode_figures(agent, wrap(FowtEnv("above_rated", action_mode="direct", **QUICK)), EPISODE)
        for wrap in (lambda env: env, SafetyLayer)
    )
    assert alone["failed"] == 1.0 and alone["overspeed_[%]"] >= 30.0 and alone["guarded_[%]"] == 0.0
    assert guarded["failed"] == 0.0 and guarded["overspeed_[%]"] < 30.0 and guarded["guarded_[%]"] > 10.0


def test_figures_are_of_the_motions_of_every_control_period():
    env = FowtEnv("above_rated", action_mode="direct", **QUICK)
    agent = Careless(CARELESS[0])
    found = episode_figures(agent, env, EPISODE)
    observation, _ = env.reset(seed=0, options=EPISODE | {"offsets": {}})
    agent.reset(env, observation)
    seen = [env.measurement()]
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(agent.act(observation))
        seen.append(env.measurement())
        over = terminated or truncated
    speed = np.array([m.rotor_speed for m in seen]) / env.scene.turbine.rated_rotor_speed
    tilt = np.degrees([m.platform_pitch for m in seen])
    assert found["rotor_speed_std_[%]"] == pytest.approx(100.0 * speed.std(), rel=1e-9)
    assert found["platform_pitch_std_[deg]"] == pytest.approx(tilt.std(), rel=1e-9)
    assert found["overspeed_[%]"] == pytest.approx(100.0 * (speed.max() - 1.0), rel=1e-9)
