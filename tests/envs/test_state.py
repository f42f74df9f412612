"""Snapshots: a run goes on from one as if nothing had happened."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from episodes import BOX, DEGRADED, INDIVIDUAL, ON_LQR, WATCHED, actions, quick, record
from gymnasium.error import ResetNeeded

from fowt_env.errors import InputError

WAKE = {"rotor": "bem", "dynamic_inflow": True, "wind": 18.0, "sea": "still"}  # compiled here alone


@pytest.mark.parametrize(
    "settings",
    [
        {"action_mode": "direct"},
        {"action_mode": "setpoint"},
        {"action_mode": "residual"},
        # Adams-Bashforth: past derivatives carry over
        pytest.param({"action_mode": "direct", "fidelity": "fast"}, marks=pytest.mark.nightly),
        ON_LQR,
        ON_LQR | {"sensors": DEGRADED},
        {"task": "shutdown", "duration": 60.0},
        pytest.param(INDIVIDUAL, marks=pytest.mark.nightly),
        pytest.param(WATCHED, marks=pytest.mark.nightly),
        pytest.param(BOX, marks=pytest.mark.nightly),
        pytest.param(WAKE, marks=pytest.mark.nightly),
    ],
)
def test_continuing_after_restore_is_the_uninterrupted_run_bit_for_bit(settings):
    env, other = quick(**settings), quick(**settings)
    size = env.action_space.shape[0] // 2
    first, then = (actions(n, size, seed=n).reshape(n, -1) for n in (7, 25))
    env.reset(seed=3)
    record(env, first)
    saved = env.get_state()
    copied = pickle.loads(pickle.dumps(saved))
    expected = record(env, then)
    env.set_state(saved)
    assert record(env, then) == expected
    env.reset(seed=99)  # other weather in between
    env.set_state(copied)
    assert record(env, then) == expected
    other.set_state(saved)  # an environment that was never reset
    assert record(other, then) == expected
    assert str(other.measurement()) == str(env.measurement()) and other.channels() == env.channels()


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
        {"sensors": {"noise": 0.03}},
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
