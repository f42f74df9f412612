"""Snapshots: a run goes on from one as if nothing had happened."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError

QUICK = {"rotor": "table", "wave_components": 20}


def quick(**settings):
    return FowtEnv(**(QUICK | settings))


def actions(n, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 2))


def record(env, given):
    """Bytes of everything that the steps under the given actions return."""
    parts = []
    for action in given:
        observation, reward, terminated, truncated, info = env.step(action)
        parts.append((observation.tobytes(), reward, terminated, truncated, str(info)))
    return parts


@pytest.mark.parametrize(
    "settings",
    [
        {"action_mode": "direct"},
        {"action_mode": "setpoint"},
        {"action_mode": "residual"},
        {"action_mode": "direct", "fidelity": "fast"},  # Adams-Bashforth: past derivatives carry over
    ],
)
def test_continuing_after_restore_is_the_uninterrupted_run_bit_for_bit(settings):
    env, other = quick(**settings), quick(**settings)
    env.reset(seed=3)
    record(env, actions(7, seed=1))
    saved = env.get_state()
    expected = record(env, actions(25))
    env.set_state(saved)
    assert record(env, actions(25)) == expected
    env.reset(seed=99)  # other weather in between
    env.set_state(saved)
    assert record(env, actions(25)) == expected
    other.set_state(saved)  # an environment that was never reset
    assert record(other, actions(25)) == expected
    assert other.measurement() == env.measurement() and other.channels() == env.channels()


@pytest.mark.slow  # a kind of scene that nothing else compiles
@pytest.mark.nightly
def test_wake_states_are_part_of_a_snapshot():
    settings = {"rotor": "bem", "dynamic_inflow": True}
    env = quick(**settings, wind=18.0, sea="still")
    env.reset(seed=0)
    record(env, actions(3))
    saved = env.get_state()
    expected = record(env, actions(4))
    env.reset(seed=5)
    env.set_state(saved)
    assert record(env, actions(4)) == expected


def test_a_snapshot_stays_as_it_is_and_survives_pickling():
    env = quick()
    env.reset(seed=3)
    saved = env.get_state()
    copied = pickle.loads(pickle.dumps(saved))
    expected = record(env, actions(10))
    for snapshot in (saved, copied, saved):
        env.set_state(snapshot)
        assert record(env, actions(10)) == expected


def test_the_next_episode_after_restore_is_the_same_too():
    env = quick()
    env.reset(seed=3)
    saved = env.get_state()
    first, info = env.reset()
    env.reset()
    env.set_state(saved)
    again, info_again = env.reset()
    assert np.array_equal(first, again) and info == info_again
    assert env.np_random_seed == 3


def test_an_ended_episode_stays_ended():
    env = quick(duration=0.2)
    env.reset(seed=0)
    running = env.get_state()
    record(env, actions(2))
    ended = env.get_state()
    env.set_state(running)
    record(env, actions(1))
    env.set_state(ended)
    with pytest.raises(ResetNeeded):
        env.step((0.0, 0.0))


def test_snapshots_of_other_settings_are_refused():
    env = quick()
    with pytest.raises(ResetNeeded):
        env.get_state()
    env.reset(seed=0)
    saved = env.get_state()
    for settings in (
        {"action_mode": "setpoint"},
        {"duration": 60.0},
        {"observation": ("surge",)},
        {"dt": 0.05},
    ):
        with pytest.raises(InputError, match="state: is of an environment with another"):
            quick(**settings).set_state(saved)
    with pytest.raises(InputError, match="must be what get_state"):
        env.set_state({"x": 0.0})


def test_a_snapshot_is_of_the_same_kind_in_every_process():
    code = "from fowt_env.envs import FowtEnv; print(*FowtEnv(rotor='bem', wave_components=20)._kind)"
    root = Path(__file__).resolve().parents[2]
    kinds = {
        subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": seed}, cwd=root,
            capture_output=True, text=True, check=True,
        ).stdout
        for seed in ("1", "2")
    }  # fmt: skip
    assert len(kinds) == 1
