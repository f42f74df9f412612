"""Runs the tasks of an evaluation in this process, in worker processes, or on a Ray cluster.

Every engine yields (index, outcome of the function) as tasks end, in any order, with bit-identical results.
"""

import itertools
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections import Counter, deque
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.errors import InputError, unknown
from fowt_env.plant.compile.decorators import kernels_compiled
from fowt_env.training.evaluation.guard import (
    GRACE,
    LIMIT_CODE,
    as_worker,
    attempt,
    reason_of,
    time_limit_reason,
)

ENGINES = ("processes", "ray")
NICENESS = "RAY_worker_niceness"  # environment variable that sets the niceness of Ray's workers
WINDOW = 4  # Ray tasks submitted per processor
ATTEMPTS = 3  # deaths of workers after which a task is abandoned
PATIENCE = 10.0  # s in which a worker must end after its last task
NO_WORKERS = (
    f"worker processes died {ATTEMPTS} times (out of memory, killed, or started by a program without"
    " `if __name__ == '__main__':`); {} runs are left: repeat the command to continue"
)
LONGEST_REASON = 200  # characters of Ray's error message
SPAWN = multiprocessing.get_context("spawn")  # forking a process that runs numba threads is unsafe


class WorkersLost(RuntimeError):
    """Raised if worker processes cannot be started; finished tasks are kept."""


def outcomes(function, tasks, jobs=1, engine="processes", address=None, limit=None, lost=None):
    """Yield (index, function(task)) for every task as it ends.

    engine   "processes": this process for jobs = 1, else as many spawned processes; "ray": a Ray
             cluster at the address, or a local cluster of `jobs` workers
    limit    time limit of a task, s: the task is not repeated if its worker dies after this time
    lost     lost(task, reason) is the outcome of a task during which workers die; None: RuntimeError
    Raises: InputError for an unknown engine, jobs < 1, tasks that cannot be pickled, or if Ray does not
    start; WorkersLost if workers cannot be started.
    """
    check_engine(jobs, engine, address)
    if not tasks:
        return
    if engine == "ray":
        yield from _ray(function, tasks, jobs, address, lost or _raise_lost)
        return
    # one process fills the kernel cache, so that not every worker compiles the same kernels
    first = len(tasks) if jobs == 1 else int(not kernels_compiled())
    for index, task in enumerate(tasks[:first]):
        yield index, function(task)
    if first < len(tasks):
        yield from _processes(function, tasks, range(first, len(tasks)), jobs, limit, lost or _raise_lost)


def check_engine(jobs, engine, address):
    """Raise InputError for an unknown engine, jobs < 1, or an address without Ray."""
    if engine not in ENGINES:
        raise unknown("engine", engine, ENGINES)
    check_whole_number("jobs", jobs, 1)
    if address is not None and engine != "ray":
        raise InputError(f"address = {address!r}: needs the engine 'ray'")


def _raise_lost(task, reason):
    raise RuntimeError(reason)


def _sendable(tasks, jobs):
    """Return the pickled tasks. Raises: InputError for a task that cannot be pickled."""
    packed, error = attempt(lambda: [pickle.dumps(task) for task in tasks])
    if error is not None:
        raise InputError(
            f"jobs = {jobs}: a controller or case cannot be sent to a worker process ({reason_of(error)});"
            " use jobs=1"
        ) from error
    return packed


def _processes(function, tasks, indices, jobs, limit, lost):
    """Yield outcomes from worker processes; tasks running when a worker dies are repeated, one at a time."""
    packed = _sendable(tasks, jobs)
    waiting, suspects, deaths, unborn = deque(indices), deque(), Counter(), 0
    while waiting or suspects:
        queue, most = (suspects, 1) if suspects else (waiting, jobs)
        begun, running, patience = SPAWN.Event(), {}, 0.0
        pool = ProcessPoolExecutor(min(most, len(queue)), SPAWN, _start_worker, (os.getpid(), begun))
        try:
            with suppress(BrokenProcessPool):
                while queue or running:
                    while queue and len(running) < most:
                        future = pool.submit(_answer, function, packed[queue[0]])
                        running[future] = queue.popleft(), time.monotonic()
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        outcome, reason = future.result()
                        index, _ = running.pop(future)
                        yield index, outcome if reason is None else lost(tasks[index], reason)
            patience = PATIENCE
        finally:
            codes = _end(pool, patience)
        unborn = 0 if begun.is_set() or not running else unborn + 1
        if unborn == ATTEMPTS:
            raise WorkersLost(NO_WORKERS.format(len(waiting) + len(suspects) + len(running)))
        for index, began in running.values():
            deaths[index] += begun.is_set()
            if limit is not None and LIMIT_CODE in codes and time.monotonic() - began >= limit + GRACE:
                yield index, lost(tasks[index], time_limit_reason(limit))
            elif deaths[index] == ATTEMPTS:
                code = codes[0]
                ending = f"exit code {code}" if code >= 0 else f"signal {-code} ({signal.strsignal(-code)})"
                reason = f"its worker process ended {ATTEMPTS} times, the last time alone, with {ending}"
                yield index, lost(tasks[index], reason)
            else:
                suspects.append(index)


def _end(pool, patience):
    """End the workers of a pool, kill them after `patience` seconds, and return their exit codes."""
    processes = list(pool._processes.values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.join(patience)
        process.kill()
    deadline = time.monotonic() + PATIENCE
    while any(process.exitcode is None for process in processes) and time.monotonic() < deadline:
        time.sleep(0.01)  # the pool's own thread reads it, too: of two, the second has none for a moment
    return [-signal.SIGKILL if process.exitcode is None else process.exitcode for process in processes]


def _start_worker(parent, begun):
    """Ignore Ctrl-C, which the parent process handles, and end this worker when the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    begun.set()

    def watch():
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)  # otherwise the workers of a killed parent wait forever

    threading.Thread(target=watch, daemon=True).start()


def _answer(function, packed):
    """Return (outcome, None) of a pickled task in a worker, or (None, why it cannot be unpickled)."""
    as_worker()
    task, error = attempt(lambda: pickle.loads(packed))
    if error is not None:
        return None, f"cannot be sent to a worker process: {reason_of(error)}"
    return function(task), None


@contextmanager
def session(engine, jobs=1, address=None):
    """Keep the connection to Ray during a block, so that the evaluations in the block share warm workers.

    Does nothing for other engines, or if this process is already connected.
    Raises: InputError if Ray is not installed, does not start or cannot be reached.
    """
    ray = _ray_module() if engine == "ray" else None
    if ray is None or ray.is_initialized():
        yield
        return
    if address:
        options = {"address": address}
    else:
        options = {"num_cpus": jobs, "include_dashboard": False}
        if NICENESS not in os.environ:  # Ray's default, 15, yields to any other process
            options["_system_config"] = {"worker_niceness": 0}
    try:
        ray.init(log_to_driver=False, logging_level="error", **options)
    except Exception as error:
        attempt(ray.shutdown)  # Ray may have started partly
        what = f"no cluster at {address!r}" if address else "Ray does not start"
        reason = " ".join(str(error).split())[:LONGEST_REASON]
        raise InputError(
            f"engine = 'ray': {what} ({type(error).__name__}: {reason}); without Ray: engine 'processes'"
        ) from None
    try:
        yield
    finally:
        ray.shutdown()


def _ray_module():
    """Return the module of Ray. Raises: InputError if it is not installed."""
    try:
        import ray
    except ImportError:
        raise InputError("engine = 'ray': Ray is not installed: pip install 'fowt-env[ray]'") from None
    return ray


def _ray(function, tasks, jobs, address, lost):
    """Yield outcomes of Ray tasks; Ray repeats a task whose worker dies."""
    ray = _ray_module()
    _sendable(tasks, jobs)
    deaths = (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError)
    with session("ray", jobs, address):
        # arguments are small and the code is installed on every node: only results are large
        remote = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_answer)
        # enough to keep every worker busy; with all tasks submitted, each wait would scan all of them
        window = WINDOW * max(1, int(ray.cluster_resources().get("CPU", jobs)))
        waiting, left = {}, iter(enumerate(tasks))
        while True:
            for index, task in itertools.islice(left, window - len(waiting)):
                # pickled here, since arrays that Ray sends are read-only
                waiting[remote.remote(function, ray.cloudpickle.dumps(task))] = index
            if not waiting:
                return
            for reference in ray.wait(list(waiting), num_returns=1)[0]:
                index = waiting.pop(reference)
                try:
                    outcome, reason = ray.get(reference)
                except deaths as error:
                    reason = f"its worker process ended {ATTEMPTS} times: {reason_of(error)}"
                except ray.exceptions.RayTaskError as error:
                    raise error.cause from None
                yield index, outcome if reason is None else lost(tasks[index], reason)
