"""Measures the speed of environments: single, native batch, and Gymnasium batches, in one run."""

import time
from collections import Counter
from functools import partial
from itertools import cycle

import numba
import numpy as np
import pandas as pd
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.envs.episode_batch import act_all, thread_limit
from fowt_env.plant.compile.decorators import parallel_entry
from fowt_env.training.benchmarks.speed import header, multiply_adds

SIZES = (1, 16, 256, 4096)
THREADS = (1, 2)
HOLD = np.zeros(2)  # residual mode: baseline alone, so that no episode fails
ROUND = 1e-3  # s


def timed(action, seconds):
    """Return the time of a call, s: the minimum over rounds too short for most interruptions."""
    action()
    begin = time.perf_counter()
    action()
    once = time.perf_counter() - begin
    calls = max(1, round(ROUND / max(once, 1e-7)))
    best, end = np.inf, time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter()
        for _ in range(calls):
            action()
        best = min(best, (time.perf_counter() - begin) / calls)
    return best


@parallel_entry
def multiply_adds_side_by_side(parts, n, results):
    """Fill results (parts,) with calibrations of n multiply-adds each, on all allowed threads."""
    for part in numba.prange(parts):
        results[part] = multiply_adds(n, 0.999, 0.1)


def ceiling(threads, seconds):
    """Return the ideal speed-up of a number of threads over one thread, measured without shared data."""
    results, times = np.zeros(threads), []
    for number in (1, threads):
        with thread_limit(number):
            times.append(timed(partial(multiply_adds_side_by_side, number, 300_000, results), seconds))
    return threads * times[0] / times[1]


def arrays_of(part):
    """Yield the arrays of a NamedTuple and of its parts."""
    for value in part:
        if isinstance(value, np.ndarray):
            yield value
        elif isinstance(value, tuple):
            yield from arrays_of(value)


def own_bytes(envs):
    """Return the mean size of the arrays that an environment does not share with others, bytes."""
    arrays = [{id(a): a.nbytes for a in (*arrays_of(env._config), *arrays_of(env._episode))} for env in envs]
    holders = Counter(key for of_env in arrays for key in of_env)
    return sum(n for of_env in arrays for key, n in of_env.items() if holders[key] == 1) / len(envs)


def single_costs(env, seconds):
    """Return {step_us, physics_us, overhead_us, get_state_us, set_state_us, reset_ms} of one environment.

    physics: the compiled call for a batch of 16, over 16; overhead: the rest of a step; resets draw new
    weather and offsets, with all trims cached.
    """
    few = 16
    batch = FowtVectorEnv(few, threads=1, **env)
    batch.reset(seed=0)
    arguments = (
        batch._handles, batch._baseline_law, batch._estimator_law, np.zeros((few, 2)),
        np.ones(few, dtype=bool), batch._statuses, batch._rewards,
    )  # fmt: skip
    physics = timed(lambda: act_all(*arguments), seconds) / few
    single = batch.envs[0].twin()
    single.reset(seed=0)
    state = single.get_state()
    get, put = timed(single.get_state, seconds), timed(lambda: single.set_state(state), seconds)

    def replay():  # always from the same state: the episode never ends
        single.set_state(state)
        for _ in range(100):
            single.step(HOLD)

    step = timed(replay, seconds) / 100
    for seed in range(60):  # compute the trims of the drawn winds, once per process
        single.reset(seed=seed)
    seeds = cycle(range(60))
    reset = timed(lambda: single.reset(seed=next(seeds)), seconds)
    return {
        "step_us": step * 1e6, "physics_us": physics * 1e6, "overhead_us": (step - physics) * 1e6,
        "get_state_us": get * 1e6, "set_state_us": put * 1e6, "reset_ms": reset * 1e3,
    }  # fmt: skip


def row_of(kind, n, threads, per_step, memory=np.nan, reset=np.nan, one=np.nan, most=np.nan):
    """Return a row from the time of a step of all n environments, s; one: on one thread, most: ceiling."""
    return {
        "kind": kind, "envs": n, "threads": threads, "env_steps_per_s": n / per_step,
        "us_per_env_step": per_step / n * 1e6, "times_one_thread": one / per_step, "ceiling": most,
        "reset_ms_per_env": reset * 1e3, "memory_kB_per_env": memory,
    }  # fmt: skip


def native_rows(settings, sizes, threads, seconds):
    """Return rows of FowtVectorEnv for each size and number of threads."""
    rows = []
    for n in sizes:
        batch = FowtVectorEnv(n, threads=1, **settings)
        begin = time.perf_counter()
        batch.reset(seed=0)
        reset = (time.perf_counter() - begin) / n
        memory = own_bytes(batch.envs) / 1024.0 if n > 1 else np.nan
        one = np.nan
        for number in sorted({min(number, n) for number in threads}):
            batch.threads = number
            per_step = timed(partial(batch.step, np.zeros((n, 2))), seconds)
            one = per_step if number == 1 else one
            most = ceiling(number, 0.2 * seconds)
            rows.append(row_of("FowtVectorEnv", n, number, per_step, memory, reset, one, most))
    return rows


def gymnasium_rows(settings, n, seconds):
    """Return rows of Gymnasium's vector environments of n single environments."""
    model, rows = FowtEnv(**settings), []
    model.reset(seed=0)
    model.step(HOLD)  # compile before processes fork
    for kind, threads in ((AsyncVectorEnv, "processes"), (SyncVectorEnv, 1)):
        envs = kind([model.twin] * n)
        envs.reset(seed=0)
        per_step = timed(partial(envs.step, np.zeros((n, 2), dtype=np.float32)), seconds)
        rows.append(row_of(kind.__name__, n, threads, per_step))
        envs.close()
    return rows


def benchmark_envs(
    fidelity="standard", sizes=SIZES, threads=THREADS, seconds=1.0, gymnasium_envs=16, **settings
):
    """Return (table, single): DataFrame of env steps per second, and costs of a single environment.

    An env step is one control period (0.1 s) of the task above_rated in residual mode without residual.
    seconds: per measurement. The first reset of a size includes trims that are not cached yet.
    """
    settings = {"fidelity": fidelity, "action_mode": "residual"} | settings
    rows = gymnasium_rows(settings, gymnasium_envs, seconds)  # first: fork before threads are started
    single = single_costs(settings, seconds)
    rows = [row_of("FowtEnv", 1, 1, single["step_us"] * 1e-6, reset=single["reset_ms"] * 1e-3), *rows]
    rows += native_rows(settings, sizes, threads, seconds)
    return pd.DataFrame(rows), single


if __name__ == "__main__":
    print("\n".join(header()))
    for level in ("standard", "fast"):
        table, single = benchmark_envs(level, seconds=0.5)
        print(f"fidelity = {level!r}; single:", {key: round(value, 2) for key, value in single.items()})
        print(table.round(2).to_string(index=False))
