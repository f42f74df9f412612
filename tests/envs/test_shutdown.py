"""The task shutdown: the baseline operates until the signal, from when the agent's figures count."""

import numpy as np
import pytest

from fowt_env.control import make
from fowt_env.envs import TASKS, FowtEnv
from fowt_env.errors import InputError
from fowt_env.run.simulation import simulate

SHORT = {"task": "shutdown", "duration": 60.0, "reward": {}}
DRAWN = {"wind": 16.0, "sea": None, "offsets": {}, "shutdown": 12.0}


@pytest.fixture(scope="module")
def env():
    return FowtEnv(**SHORT)


def since(env, observation):
    """The channel time_since_shutdown, s."""
    index = [entry.name for entry in env.observed].index("time_since_shutdown")
    return float(observation[index]) * env.observed[index].scale


def test_until_the_signal_the_turbine_is_operated_as_simulate_does(env):
    observation, info = env.reset(options=DRAWN)
    assert info["time"] == pytest.approx(12.0) and since(env, observation) == 0.0
    assert info["saturated_actions"] == info["torque_limited"] == 0
    frame = simulate(env.scene, make("pi", env.scene.turbine, 0.1), duration=12.0)
    for channel in ("RotSpeed_[rpm]", "PtfmPitch_[deg]", "BldPitch1_[deg]"):
        assert env.channels()[channel.partition("_[")[0]] == frame[channel].iloc[-1], channel


def test_the_time_since_the_signal_is_seen_and_the_episode_ends_at_its_duration(env):
    env.reset(options=DRAWN)
    truncated = terminated = False
    steps = 0
    while not (truncated or terminated):
        observation, _, terminated, truncated, info = env.step([-1.0, 1.0])
        steps += 1
    assert truncated and steps == 480 and info["time"] == pytest.approx(60.0)
    assert since(env, observation) == pytest.approx(48.0, abs=1e-3)


def test_a_rotor_that_stands_is_paid_more_than_one_that_turns(env):
    """Against the sum of the documented terms with the task's weights."""
    totals = {}
    for name, action in {"feather": [-1.0, 1.0], "hold": None}.items():
        env.reset(options=DRAWN)
        total, terminated, truncated = 0.0, False, False
        while not (terminated or truncated):
            chosen = env.unwrapped.view().action.copy() if action is None else action
            _, reward, terminated, truncated, info = env.step(chosen)
            weights = TASKS["shutdown"].weights
            paid = sum(weights.get(key.removeprefix("reward/"), 0.0) * value
                       for key, value in info.items() if key.startswith("reward/"))  # fmt: skip
            assert reward == pytest.approx(paid, rel=1e-12, abs=1e-12)
            total += reward
        totals[name] = total
        if name == "feather":
            assert env.measurement().rotor_speed < 0.1 * env.scene.turbine.rated_rotor_speed
    assert totals["feather"] > totals["hold"] + 300.0


def test_the_signal_is_drawn_and_replayed(env):
    first, info = env.reset(seed=4)
    low, high = TASKS["shutdown"].shutdown
    assert low <= info["sampled"]["shutdown"] <= high
    np.testing.assert_array_equal(first, env.reset(options=info["sampled"])[0])


def test_other_tasks_draw_as_before_and_have_no_signal():
    assert all(task.shutdown is None for name, task in TASKS.items() if name != "shutdown")
    with pytest.raises(InputError, match="time_since_shutdown.*needs a task with shutdown"):
        FowtEnv("steady", observation=("time_since_shutdown",))
