"""Threads of compiled loops over many environments."""

import numba
import pytest

from fowt_env.envs.episode_batch import thread_limit


def test_the_number_of_threads_is_that_asked_for_within_the_block_alone():
    before = numba.get_num_threads()
    for threads in {1, before}:
        with thread_limit(threads):
            assert numba.get_num_threads() == threads
        assert numba.get_num_threads() == before
    with pytest.raises(ZeroDivisionError), thread_limit(1):
        raise ZeroDivisionError
    assert numba.get_num_threads() == before
