"""Copies of environments, by copy.deepcopy and pickle: the same bits from there on, and nothing shared."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv

from fowt_env.envs import FowtEnv, FowtVectorEnv, SafetyLayer

NAME = "fowt_env/OC3Hywind-v1"
QUICK = {"rotor": "table", "wave_components": 20}
WAYS = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}
ways = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)


def actions(n, *shape, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (n, *shape))


def record(env, given):
    """All that the steps return, then a new episode, which shows the generator, and a sample of actions."""
    parts = []
    for action in given:
        observation, *rest = env.step(action)
        parts.append((observation.tobytes(), str(rest)))
    observation, info = env.reset()
    parts.append((observation.tobytes(), str(info), env.action_space.sample().tobytes()))
    return parts


@ways
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"action_mode": "setpoint"},
        {"action_mode": "residual", "baseline": "lqr", "sensors": {"noise": 0.02, "delay": 2}},
        {"task": "shutdown"},
    ],
)
def test_a_copy_in_mid_episode_goes_on_bit_for_bit(settings, way):
    env = gymnasium.make(NAME, **(QUICK | settings))
    env.reset(seed=3)
    for action in actions(7, 2, seed=1):
        env.step(action)
    env.action_space.seed(4)
    other = way(env)
    third = way(env)
    expected = record(env, actions(25, 2))
    assert record(other, actions(25, 2)) == expected  # after the original has moved: nothing is shared
    assert record(third, actions(25, 2)) == expected
    assert third.spec.id == NAME and third.unwrapped.get_state().kind == env.unwrapped.get_state().kind


@ways
def test_moving_a_copy_leaves_the_original(way):
    env, alone = FowtEnv(**QUICK), FowtEnv(**QUICK)
    env.reset(seed=3)
    alone.reset(seed=3)
    for one in (env, alone):
        one.action_space.seed(4)
    other = way(env)
    record(other, actions(9, 2, seed=5))
    assert record(env, actions(9, 2)) == record(alone, actions(9, 2))


@ways
def test_copies_before_the_first_reset_and_after_the_end(way):
    env = FowtEnv(**QUICK, duration=0.2)
    fresh = way(env)
    fresh.reset(seed=2)
    env.reset(seed=2)
    assert np.array_equal(fresh.step((0.1, 0.2))[0], env.step((0.1, 0.2))[0])
    env.step((0.1, 0.2))
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"end of its duration\) at 0\.2 s"):
        way(env).step((0.1, 0.2))
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        way(env).reset()


@ways
def test_a_batch_and_its_copy_go_on_alike_through_resets(way):
    env = gymnasium.make_vec(NAME, num_envs=3, duration=2.0, **QUICK)
    env.reset(seed=1)
    for row in actions(15, 3, 2, seed=1):
        env.step(row)
    other = way(env)
    given = actions(30, 3, 2)  # beyond the end of the episodes

    def rows(batch):
        return [(o.tobytes(), r.tobytes(), t.tobytes(), str(i)) for o, r, _, t, i in map(batch.step, given)]

    expected = rows(env)
    assert rows(other) == expected
    assert any("True" in str(np.frombuffer(row[2], dtype=bool)) for row in expected)


@ways
def test_a_batch_can_be_copied_before_its_first_reset_and_when_closed(way):
    env = FowtVectorEnv(2, **QUICK)
    first, _ = way(env).reset(seed=1)
    assert np.array_equal(first, env.reset(seed=1)[0])
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        way(env).step(np.zeros((2, 2)))


def test_pictures_of_a_copy_are_those_of_the_original():
    pytest.importorskip("pygame")
    env = gymnasium.make(NAME, render_mode="rgb_array", **QUICK)
    env.reset(seed=1)
    env.step(np.zeros(2, dtype=np.float32))
    other = copy.deepcopy(env)
    assert np.array_equal(other.render(), env.render())


def test_scenes_are_shared_by_deepcopy_and_survive_pickling():
    env = FowtEnv(**QUICK)
    env.reset(seed=1)
    assert copy.deepcopy(env).scene is env.scene
    assert pickle.loads(pickle.dumps(env.scene)).wind == env.scene.wind
    assert copy.deepcopy(env.scene).sea == env.scene.sea


@ways
def test_a_guarded_environment_can_be_copied(way):
    env = SafetyLayer(FowtEnv(**QUICK), overspeed=1.01, calm=1.0)
    env.reset(seed=3)
    env.action_space.seed(4)
    for action in actions(20, 2, seed=1):
        env.step(action)
    assert env.guarded_periods
    other = way(env)
    assert record(other, actions(20, 2)) == record(env, actions(20, 2))


class Growing:
    """A reward with a memory of its own."""

    def __init__(self):
        self.calls = 0

    def __call__(self, info, measurement):
        self.calls += 1
        return float(self.calls)


@ways
def test_a_reward_function_is_copied_with_its_memory(way):
    env = FowtEnv(**QUICK, reward=Growing())
    env.reset(seed=1)
    env.step((0.0, 0.0))
    other = way(env)
    assert [other.step((0.0, 0.0))[1] for _ in range(2)] == [2.0, 3.0]
    assert env.step((0.0, 0.0))[1] == 2.0


@pytest.mark.slow
def test_an_environment_crosses_to_other_processes():
    cloudpickle = pytest.importorskip("cloudpickle")
    env = FowtEnv(**QUICK, reward=lambda info, measurement: measurement.rotor_speed)
    env.reset(seed=1)
    there = cloudpickle.loads(cloudpickle.dumps(env))
    assert there.step((0.0, 0.0))[1] == env.step((0.0, 0.0))[1]
    batch = AsyncVectorEnv([lambda: copy.deepcopy(env)] * 2)  # which closes one that it makes to look at
    try:
        observations, _ = batch.reset(seed=[4, 4])
        assert np.array_equal(observations[0], env.reset(seed=4)[0])
        assert np.array_equal(observations[0], observations[1])
    finally:
        batch.close()
