"""The ladder of tasks: what its easiest survives, and that every rung starts and pays a reward in [0, 1]."""

import gymnasium
import numpy as np
import pytest
from episodes import ladder

from fowt_env.envs import FowtVectorEnv
from fowt_env.registration import EASY, STEPS


def test_random_actions_survive_easy_in_twenty_of_twenty_episodes():
    env = FowtVectorEnv(20, "Disabled", threads=1, **EASY)
    env.reset(seed=list(range(20)))
    rng = np.random.default_rng(0)
    for step in range(STEPS):
        _, rewards, terminated, truncated, _ = env.step(rng.uniform(-1.0, 1.0, (20, 2)))
        assert not terminated.any() and truncated.all() == (step == STEPS - 1)
        assert np.all((rewards >= 0.0) & (rewards <= 1.0))


def test_what_easy_observes_is_of_order_one():
    env = FowtVectorEnv(8, "Disabled", threads=1, **EASY)
    env.reset(seed=3)
    seen = np.array([env.step(np.zeros((8, 2)))[0] for _ in range(STEPS)])
    spread = np.sqrt((seen**2).mean(axis=(0, 1)))
    moved = [i for i in range(len(spread)) if spread[i] > 0.0]  # previous actions are zero
    assert len(moved) == 14 and np.all(spread[moved] > 0.05) and np.all(spread[moved] < 3.0)
    assert np.abs(seen).max() < 10.0  # nothing is clipped


@pytest.mark.slow
@pytest.mark.parametrize("name", ladder())
def test_every_rung_runs_alone_and_in_a_batch_with_the_same_bits(name):
    single, batch = gymnasium.make(name), gymnasium.make_vec(name, num_envs=2)
    single.reset(seed=7), batch.reset(seed=[7, 8])
    action = np.full(single.action_space.shape, 0.1, dtype=np.float32)
    for _ in range(40):
        observation, reward, terminated, truncated, info = single.step(action)
        observations, rewards, *_ = batch.step([action, action])
        assert np.array_equal(observations[0], observation) and rewards[0] == reward
        assert 0.0 <= reward <= 1.0 and info["cost"] >= 0.0 and not truncated
        if terminated:
            break


def test_a_batch_made_by_name_ends_episodes_at_the_number_of_steps():
    env = gymnasium.make_vec("fowt_env/OC3HywindEasy-v0", num_envs=2, duration=10.0, max_episode_steps=3)
    env.reset(seed=0)
    ends = [env.step(np.zeros((2, 2)))[3].tolist() for _ in range(3)]
    assert ends == [[False, False], [False, False], [True, True]]
