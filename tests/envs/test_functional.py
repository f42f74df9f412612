"""The functional environment: the steps of the ordinary one, without hidden state."""

import pickle

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from fowt_env.envs import FowtEnv
from fowt_env.envs.functional import FowtFuncEnv
from fowt_env.errors import InputError

QUICK = {"rotor": "table", "wave_components": 10, "wind": 18.0, "duration": 8.0, "reward": "score"}
ACTIONS = np.random.default_rng(1).uniform(-0.1, 0.1, (20, 2))


@pytest.fixture(scope="module")
def env():
    return FowtFuncEnv(**QUICK)


def same(one, other):
    assert np.array_equal(one.observation, other.observation)
    assert one[2:] == other[2:] and one.snapshot.running == other.snapshot.running
    for a, b in zip(one.snapshot.arrays, other.snapshot.arrays, strict=True):
        assert np.array_equal(a, b) if a is not None else b is None


def test_its_transitions_are_the_steps_of_the_ordinary_environment(env):
    ordinary, state = FowtEnv(**QUICK), env.initial(5)
    observation, info = ordinary.reset(seed=5)
    assert np.array_equal(env.observation(state), observation)
    assert env.state_info(state)["sampled"] == info["sampled"]
    for action in ACTIONS:
        after = env.transition(state, action)
        observation, reward, terminated, truncated, info = ordinary.step(action)
        assert np.array_equal(env.observation(after), observation)
        assert env.reward(state, action, after) == reward
        assert env.terminal(after) == (terminated or truncated)
        assert env.transition_info(state, action, after) == info
        state = after


def test_a_state_gives_the_same_next_state_whatever_was_done_in_between(env):
    rng = np.random.default_rng(3)
    start, elsewhere = env.initial(rng), env.initial(rng)  # in another weather
    copy = pickle.loads(pickle.dumps(start))
    first = env.transition(env.transition(start, ACTIONS[0]), ACTIONS[1])
    env.transition(elsewhere, ACTIONS[2])
    env.transition(start, ACTIONS[3])
    same(env.transition(env.transition(start, ACTIONS[0]), ACTIONS[1]), first)
    same(start, copy)  # no transition has changed it
    again = env.initial(np.random.default_rng(3))  # scratch arrays differ, what follows does not
    for action in ACTIONS[:2]:
        again = env.transition(again, action)
    assert np.array_equal(again.observation, first.observation) and again.reward == first.reward


def test_a_state_cannot_be_written_to(env):
    state = env.transition(env.initial(1), ACTIONS[0])
    for array in (state.observation, *state.snapshot.arrays):
        assert array is None or not array.flags.writeable
    other = env.initial(2, {"weather_seed": 9})
    assert env.state_info(other)["sampled"]["weather_seed"] == 9


def test_an_episode_ends_and_does_not_go_on(env):
    state = env.initial(1)
    for _ in range(80):
        assert not env.terminal(state)
        state = env.transition(state, (0.0, 0.0))
    assert env.terminal(state) and state.truncated and not state.terminated
    with pytest.raises(ResetNeeded):
        env.transition(state, (0.0, 0.0))
    with pytest.raises(InputError, match="rng = -1"):
        env.initial(-1)
