"""Environments in threads and in processes of every kind: the bits of one after the other."""

import multiprocessing
import threading

import numpy as np
import pytest

from fowt_env.envs import FowtEnv, FowtVectorEnv

QUICK = {"rotor": "table", "wave_components": 20, "duration": 4.0}
SEEDS = (1, 2, 3, 4)


def make():
    return FowtEnv(**QUICK)


def episode(seed):
    """(steps, observation, reward, ended) of an episode with random actions, as one array."""
    env = make()
    observation, _ = env.reset(seed=seed)
    rows = [[*observation, 0.0, 0.0]]
    for action in np.random.default_rng(seed).uniform(-1.0, 1.0, (40, 2)):
        observation, reward, terminated, truncated, _ = env.step(action)
        rows.append([*observation, reward, terminated or truncated])
        if rows[-1][-1]:
            break
    return np.array(rows)


@pytest.fixture(scope="module")
def serial():
    return [episode(seed) for seed in SEEDS]


def same(found, expected):
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.shape == other.shape and one.shape[0] > 20
        np.testing.assert_array_equal(one, other)


def test_threads_that_each_step_their_own_give_the_bits_of_one_after_the_other(serial):
    found = [None] * len(SEEDS)
    together = threading.Barrier(len(SEEDS))

    def work(place):
        together.wait()
        found[place] = episode(SEEDS[place])

    workers = [threading.Thread(target=work, args=(place,)) for place in range(len(SEEDS))]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    same(found, serial)


def test_threads_that_each_step_their_own_batch_give_the_bits_of_one_after_the_other():
    def rewards(seed):
        batch = FowtVectorEnv(3, threads=1, **QUICK)
        batch.reset(seed=seed)
        actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (30, 3, 2))
        return np.array([batch.step(action)[1] for action in actions])

    found = {}
    workers = [threading.Thread(target=lambda s=seed: found.update({s: rewards(s)})) for seed in SEEDS]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for seed in SEEDS:
        np.testing.assert_array_equal(found[seed], rewards(seed))


@pytest.mark.parametrize("method", ["fork", "spawn", pytest.param("forkserver", marks=pytest.mark.nightly)])
def test_processes_of_every_kind_give_the_bits_of_this_one(serial, method):
    """Forked ones have this process's kernels and environments, the others nothing."""
    with multiprocessing.get_context(method).Pool(2) as pool:
        same(pool.map(episode, SEEDS, chunksize=1), serial)


def test_an_environment_goes_on_in_a_forked_process_as_it_does_here():
    env = make()
    env.reset(seed=5)
    env.step(np.zeros(2))
    receiver, sender = multiprocessing.Pipe(duplex=False)

    def work():
        sender.send([env.step(np.full(2, 0.3))[0] for _ in range(10)])

    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    there = receiver.recv()
    process.join()
    here = [env.step(np.full(2, 0.3))[0] for _ in range(10)]
    np.testing.assert_array_equal(there, here)


@pytest.mark.parametrize("method", ["fork", pytest.param("spawn", marks=pytest.mark.nightly)])
def test_stable_baselines3_s_processes_give_the_bits_of_its_dummy(method):
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env", reason="needs stable_baselines3")
    plain = vec_env.DummyVecEnv([make] * 2)
    apart = vec_env.SubprocVecEnv([make] * 2, start_method=method)
    try:
        for env in (plain, apart):
            env.seed(4)
        np.testing.assert_array_equal(apart.reset(), plain.reset())
        for action in np.random.default_rng(0).uniform(-1.0, 1.0, (60, 2, 2)):
            (seen, rewards, ended, _), expected = apart.step(action), plain.step(action)
            for one, other in zip((seen, rewards.astype(np.float32), ended), expected[:3], strict=True):
                np.testing.assert_array_equal(one, other)  # the dummy keeps rewards in single precision
    finally:
        apart.close()


@pytest.mark.nightly
def test_gymnasium_s_processes_give_the_bits_of_its_serial_environments():
    from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

    plain, apart = SyncVectorEnv([make] * 2), AsyncVectorEnv([make] * 2, context="spawn")
    try:
        np.testing.assert_array_equal(apart.reset(seed=2)[0], plain.reset(seed=2)[0])
        for action in np.random.default_rng(0).uniform(-1.0, 1.0, (30, 2, 2)).astype(np.float32):
            got, expected = apart.step(action), plain.step(action)
            for one, other in zip(got[:4], expected[:4], strict=True):
                np.testing.assert_array_equal(one, other)
    finally:
        apart.close()
