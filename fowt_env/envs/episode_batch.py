"""One control period of many environments as one compiled call, on one thread or several."""

from contextlib import contextmanager
from math import isfinite

import numba
import numpy as np

from fowt_env.envs.episode import act
from fowt_env.plant.compile.decorators import entry, kernel, parallel_entry


@kernel
def first_unusable(actions, active):
    """Index of the first active row of actions (n, actions) that is not finite, or -1."""
    for i in range(actions.shape[0]):
        for k in range(actions.shape[1]):
            if active[i] and not isfinite(actions[i, k]):
                return i
    return -1


@entry
def act_some(handles, baseline_law, estimator_law, actions, active, statuses, rewards, first, last):
    """One control period of the active environments first <= i < last, see act_all."""
    for i in range(first, last):
        if active[i]:
            statuses[i], rewards[i] = act(handles[i], baseline_law, estimator_law, actions[i])


@entry
def act_all(handles, baseline_law, estimator_law, actions, active, statuses, rewards):
    """One control period of each active environment under its row of actions, on this thread.

    handles: list of n Handles of one type. Fills statuses (n,) and rewards (n,). Returns -1, or the index of
    the first active environment whose action is not finite; then nothing was moved.
    """
    bad = first_unusable(actions, active)
    if bad < 0:
        act_some(handles, baseline_law, estimator_law, actions, active, statuses, rewards, 0, len(handles))
    return bad


@parallel_entry
def act_all_parallel(handles, baseline_law, estimator_law, actions, active, statuses, rewards, parts):
    """As act_all, in as many parts, side by side, as there are threads to run them."""
    bad = first_unusable(actions, active)
    if bad < 0:
        n = len(handles)
        for part in numba.prange(parts):
            k = np.int64(part)  # prange counts unsigned
            act_some(
                handles,
                baseline_law,
                estimator_law,
                actions,
                active,
                statuses,
                rewards,
                k * n // parts,
                (k + 1) * n // parts,
            )
    return bad


@contextmanager
def thread_limit(threads):
    """Within the block, compiled loops use this many threads; afterwards as many as before."""
    previous = numba.get_num_threads()
    if threads == previous:  # set_num_threads takes microseconds
        yield
        return
    numba.set_num_threads(threads)
    try:
        yield
    finally:
        numba.set_num_threads(previous)
