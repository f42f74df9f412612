"""Copies of environments, by copy.deepcopy and pickle: the same bits from there on, and nothing shared."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from episodes import DEGRADED, NAME, QUICK, WATCHED, actions
from gymnasium.vector import AsyncVectorEnv

from fowt_env.envs import FowtEnv, FowtVectorEnv, SafetyLayer

WAYS = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}
ways = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)


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
        pytest.param({"action_mode": "setpoint"}, marks=pytest.mark.nightly),
        {"action_mode": "residual", "baseline": "lqr", "sensors": DEGRADED},
        pytest.param({"task": "shutdown"}, marks=pytest.mark.nightly),
        pytest.param(WATCHED, marks=pytest.mark.nightly),
        {"guard": {"overspeed": 1.01, "calm": 1.0}},
    ],
)
def test_a_copy_in_mid_episode_goes_on_bit_for_bit(settings, way):
    settings = dict(settings)
    guard = settings.pop("guard", None)
    env = gymnasium.make(NAME, **(QUICK | settings))
    if guard:
        env = SafetyLayer(env, **guard)
    env.reset(seed=3)
    for action in actions(20, seed=1):
        env.step(action)
    assert guard is None or env.guarded_periods
    env.action_space.seed(4)
    other, third = way(env), way(env)
    expected = record(env, actions(25))
    assert record(other, actions(25)) == expected  # after the original has moved: nothing is shared
    assert record(third, actions(25)) == expected
    assert third.spec.id == NAME and third.unwrapped.get_state().kind == env.unwrapped.get_state().kind


@ways
def test_copies_before_the_first_reset_and_after_the_end(way):
    env, batch = FowtEnv(**QUICK, duration=0.2), FowtVectorEnv(2, **QUICK)
    fresh = way(env)
    fresh.reset(seed=2)
    env.reset(seed=2)
    assert np.array_equal(fresh.step((0.1, 0.2))[0], env.step((0.1, 0.2))[0])
    assert np.array_equal(way(batch).reset(seed=1)[0], batch.reset(seed=1)[0])
    env.step((0.1, 0.2))
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"end of its duration\) at 0\.2 s"):
        way(env).step((0.1, 0.2))
    env.close(), batch.close()
    for closed in (env, batch):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError):
            way(closed).reset()


@ways
def test_a_batch_and_its_copy_go_on_alike_through_resets(way):
    env = gymnasium.make_vec(NAME, num_envs=3, duration=2.0, **QUICK)
    env.reset(seed=1)
    for row in actions(15, 3, seed=1):
        env.step(row)
    other = way(env)
    given = actions(30, 3)  # beyond the end of the episodes

    def rows(batch):
        return [(o.tobytes(), r.tobytes(), t.tobytes(), str(i)) for o, r, _, t, i in map(batch.step, given)]

    expected = rows(env)
    assert rows(other) == expected
    assert any("True" in str(np.frombuffer(row[2], dtype=bool)) for row in expected)


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
