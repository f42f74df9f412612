"""Advances many environments by one control period in one compiled call, on one or several threads."""

from contextlib import contextmanager
from math import isfinite

import numba
import numpy as np

from fowt_env.envs.episode import act
from fowt_env.plant.compile.decorators import entry, kernel, parallel_entry


@kernel
def first_unusable(actions, active):
    """Return the index of the first active row of actions (n, actions) that is not finite, or -1."""
    for i in range(actions.shape[0]):
        for k in range(actions.shape[1]):
            if active[i] and not isfinite(actions[i, k]):
                return i
    return -1


@entry
def act_some(handles, baseline_law, estimator_law, actions, active, statuses, rewards, first, last):
    """Advance the active environments first <= i < last by one control period, see act_all."""
    for i in range(first, last):
        if active[i]:
            statuses[i], rewards[i] = act(handles[i], baseline_law, estimator_law, actions[i])


@entry
def act_all(handles, baseline_law, estimator_law, actions, active, statuses, rewards):
    """Advance each active environment by one control period under its row of actions, on this thread.

    handles: list of n Handles of one type. Fills statuses (n,) and rewards (n,). Returns -1, or the index of
    the first active environment whose action is not finite; no environment is then advanced.
    """
    bad = first_unusable(actions, active)
    if bad < 0:
        act_some(handles, baseline_law, estimator_law, actions, active, statuses, rewards, 0, len(handles))
    return bad


@parallel_entry
def act_all_parallel(handles, baseline_law, estimator_law, actions, active, statuses, rewards, parts):
    """Advance as act_all, with the environments split into `parts` that run in parallel threads."""
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
    """Set the number of threads of compiled loops within the block and restore it afterwards."""
    previous = numba.get_num_threads()
    if threads == previous:  # set_num_threads takes microseconds
        yield
        return
    numba.set_num_threads(threads)
    try:
        yield
    finally:
        numba.set_num_threads(previous)
