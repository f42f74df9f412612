"""Estimated channels, and baselines that need the scene: lqr and preview under the residual."""

import numpy as np
import pytest
from episodes import ESTIMATES, NTM, ON_LQR, actions, quick
from laws import Delegate

from fowt_env import build_scene
from fowt_env.controllers import make
from fowt_env.run.simulation import simulate


def test_the_estimated_wind_follows_the_wind_under_actions_of_any_kind():
    env = quick(**ON_LQR | {"action_mode": "direct", "baseline": "pi", "duration": 200.0})
    env.reset(seed=1)
    guide = make("gspi_oc3", env.scene.turbine, 0.1)
    guide.reset(env.measurement())
    seen = []
    for _ in range(2000):
        torque, blade_pitch = guide.act(env.measurement())
        observation, *_ = env.step_physical(torque, blade_pitch)
        seen.append(observation)
    seen = np.array(seen)[300:]
    estimated, wind = 15.0 * seen[:, 2], 15.0 * seen[:, -1]
    assert np.corrcoef(estimated, wind)[0, 1] > 0.9
    assert np.std(estimated - wind) < 0.5 * np.std(wind)
    assert abs(np.mean(estimated - wind)) < 0.5


def test_without_estimated_channels_there_is_no_estimator_and_with_them_the_plant_is_the_same():
    plain = quick(wind=NTM, action_mode="residual", observation=("rotor_speed",))
    watched = quick(wind=NTM, action_mode="residual", observation=("rotor_speed", *ESTIMATES))
    assert plain._estimator is None and plain.view().estimate is None and watched._estimator is not None
    plain.reset(seed=2), watched.reset(seed=2)
    for action in actions(40, reach=1.1):
        one, reward, *_ = plain.step(action)
        other, same_reward, *_ = watched.step(action)
        assert one[0] == other[0] and reward == same_reward
    assert np.array_equal(plain.view().state, watched.view().state)


def test_what_is_added_to_lqr_stays_in_force():
    """One kick of the blade-pitch command is still there in the next one: lqr goes on from it."""
    kicked, calm = (quick(**ON_LQR) for _ in range(2))
    kicked.reset(seed=4), calm.reset(seed=4)
    kicked.step([0.0, 1.0]), calm.step([0.0, 0.0])
    kick = kicked.view().in_force[1] - calm.view().in_force[1]
    assert kick == pytest.approx(np.radians(kicked.task.residual_pitch), rel=1e-9)
    kicked.step([0.0, 0.0]), calm.step([0.0, 0.0])
    assert 0.9 * kick < kicked.view().in_force[1] - calm.view().in_force[1] < kick


def test_lqr_alone_reads_the_command_in_force_as_its_own_last_one():
    """simulate hands the law the command in force; from Python act() keeps it: the same bits."""
    scene = build_scene("oc3_hywind", wind=18.0, rotor="table", fidelity="standard", duration=30.0)
    frame = simulate(scene, "lqr", duration=30.0)
    assert frame.equals(simulate(scene, Delegate(scene.turbine, 0.1, "lqr"), duration=30.0))
