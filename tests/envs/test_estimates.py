"""Estimated channels, and baselines that need the scene: lqr and preview under the residual."""

import numpy as np
import pytest

from fowt_env.controllers import make
from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.run.simulation import simulate

QUICK = {"rotor": "table", "wave_components": 20, "wind": {"kind": "ntm", "speed": 18.0, "class": "B"}}
ESTIMATES = ("estimated_wind", "estimated_platform", "estimated_waves")
NAMES = ("rotor_speed", "blade_pitch", *ESTIMATES, "wind_speed")
ON_LQR = {"action_mode": "residual", "baseline": "lqr", "observation": NAMES}


def actions(steps, n=None, seed=0):
    return np.random.default_rng(seed).uniform(-1.1, 1.1, (steps, 2) if n is None else (steps, n, 2))


def test_the_estimated_wind_follows_the_wind_under_actions_of_any_kind():
    env = FowtEnv(action_mode="direct", observation=NAMES, duration=200.0, **QUICK)
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
    plain = FowtEnv(action_mode="residual", observation=("rotor_speed",), **QUICK)
    watched = FowtEnv(action_mode="residual", observation=("rotor_speed", *ESTIMATES), **QUICK)
    assert plain._estimator is None and plain.view().estimate is None and watched._estimator is not None
    plain.reset(seed=2), watched.reset(seed=2)
    for action in actions(40):
        one, reward, *_ = plain.step(action)
        other, same_reward, *_ = watched.step(action)
        assert one[0] == other[0] and reward == same_reward
    assert np.array_equal(plain.view().state, watched.view().state)


def test_residual_on_lqr_without_residual_is_simulate_with_lqr_bit_for_bit():
    env = FowtEnv(duration=20.0, **ON_LQR, **QUICK)
    env.reset(seed=3)
    for _ in range(200):
        env.step(np.zeros(2))
    run = env.get_state()
    env.reset(seed=3)
    x, u = env.view().state.copy(), env.view().in_force.copy()
    law = make("lqr", env.scene.turbine, 0.1)
    law.prepare(env.scene)
    law.reset(env.measurement())
    for _ in range(200):
        env.step_physical(*law.act(env.measurement()))
    assert np.array_equal(env.view().state, run.arrays[0])
    assert np.array_equal(env.view().in_force, run.arrays[1])
    assert not np.array_equal(env.view().state, x) and not np.array_equal(env.view().in_force, u)


def test_what_is_added_to_lqr_stays_in_force():
    """One kick of the blade-pitch command is still there in the next one: lqr goes on from it."""
    kicked, calm = (FowtEnv(**ON_LQR, **QUICK) for _ in range(2))
    kicked.reset(seed=4), calm.reset(seed=4)
    kicked.step([0.0, 1.0]), calm.step([0.0, 0.0])
    kick = kicked.view().in_force[1] - calm.view().in_force[1]
    assert kick == pytest.approx(np.radians(kicked.task.residual_pitch), rel=1e-9)
    kicked.step([0.0, 0.0]), calm.step([0.0, 0.0])
    assert 0.9 * kick < kicked.view().in_force[1] - calm.view().in_force[1] < kick


@pytest.mark.parametrize("settings", [ON_LQR, {"action_mode": "direct", "observation": NAMES}])
def test_the_batch_with_estimates_is_the_single_environment_bit_for_bit(settings):
    n, steps = 2, 25
    batch = FowtVectorEnv(n, threads=1, **settings, **QUICK)
    single = FowtEnv(**settings, **QUICK)
    given = actions(steps, n)
    first = batch.reset(seed=5)[0]
    seen = [batch.step(row)[0] for row in given]
    for i in range(n):
        assert np.array_equal(first[i], single.reset(seed=5 + i)[0])
        for k in range(steps):
            assert np.array_equal(seen[k][i], single.step(given[k, i])[0])


def test_a_snapshot_holds_baseline_and_estimate_for_an_environment_that_was_never_reset():
    env, other = FowtEnv(**ON_LQR, **QUICK), FowtEnv(**ON_LQR, **QUICK)
    env.reset(seed=6)
    for action in actions(10):
        env.step(action)
    saved = env.get_state()
    expected = [env.step(action)[0] for action in actions(20, seed=1)]
    other.set_state(saved)
    for action, observation in zip(actions(20, seed=1), expected, strict=True):
        assert np.array_equal(other.step(action)[0], observation)


def test_a_preview_baseline_is_told_the_wind_of_its_own_episode():
    """Its parameters hold the coming wind: those of the construction would be another episode's."""
    env = FowtEnv(action_mode="residual", baseline="preview", duration=20.0, **QUICK)
    for seed in (7, 8):
        env.reset(seed=seed)
        law = make("preview", env.scene.turbine, 0.1)
        law.prepare(env.scene)
        assert np.array_equal(env._config.parameters, law.parameters)


def test_gymnasium_accepts_the_estimates():
    from gymnasium.utils.env_checker import check_env

    check_env(FowtEnv(**ON_LQR, **QUICK, duration=20.0), skip_render_check=True)


def test_lqr_alone_reads_the_command_in_force_as_its_own_last_one():
    """simulate hands the law the command in force; from Python act() keeps it: the same bits."""
    from fowt_env import build_scene

    scene = build_scene("oc3_hywind", wind=18.0, rotor="table", fidelity="standard", duration=30.0)
    frame = simulate(scene, "lqr", duration=30.0)

    class Wrapped:
        def __init__(self, turbine, control_dt):
            self.law = make("lqr", turbine, control_dt)
            self.information = self.law.information
            self.prepare, self.reset = self.law.prepare, self.law.reset

        def act(self, measurement):
            return self.law.act(measurement)

    assert frame.equals(simulate(scene, Wrapped, duration=30.0))
