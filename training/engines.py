"""Where the runs of an evaluation are done: here, in worker processes, or on a Ray cluster.

Every engine yields (index, what the function returns) as runs end, in any order; the function is the same
for all, so are its bits.
"""

import itertools
import multiprocessing
import os
import pickle
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from fowt_env.errors import InputError, unknown
from fowt_env.warmup import kernels_compiled

ENGINES = ("processes", "ray")
NICENESS = "RAY_worker_niceness"  # environment variable by which Ray is told how nice its workers are
WINDOW = 4  # Ray tasks handed out per processor
ATTEMPTS = 3  # pools or Ray tries of one run before a worker that dies on it is taken as its own doing


def outcomes(function, tasks, jobs=1, engine="processes", address=None):
    """Yield (index, function(task)) for every task as it ends.

    engine   "processes": this process for jobs = 1, else that many spawned ones; "ray": a Ray cluster
             at the address, or a local one of `jobs` workers
    Raises: InputError for an unknown engine, jobs < 1, or tasks that cannot be sent.
    """
    if engine not in ENGINES:
        raise unknown("engine", engine, ENGINES)
    if jobs < 1:
        raise InputError(f"jobs = {jobs}: must be at least 1")
    if address is not None and engine != "ray":
        raise InputError(f"address = {address!r}: needs the engine 'ray'")
    if not tasks:
        return
    if engine == "ray":
        yield from _ray(function, tasks, jobs, address)
        return
    jobs = min(jobs, len(tasks))
    first = 0
    if jobs == 1 or not kernels_compiled():
        # one process fills the kernel cache, instead of every worker compiling the same
        first = len(tasks) if jobs == 1 else 1
        for index, task in enumerate(tasks[:first]):
            yield index, function(task)
    if first < len(tasks):
        yield from _processes(function, tasks, range(first, len(tasks)), jobs)


def _sendable(tasks, jobs):
    try:
        pickle.dumps(tasks)
    except Exception as error:
        raise InputError(
            f"jobs = {jobs}: a controller or case cannot be sent to a worker process ({error}); use jobs=1"
        ) from error


def _processes(function, tasks, indices, jobs):
    """Yield outcomes from worker processes; a worker that dies costs its runs another try."""
    _sendable(tasks, jobs)
    left = list(indices)
    for attempt in range(ATTEMPTS):
        try:
            for index, outcome in _pool(function, tasks, left, jobs if attempt < ATTEMPTS - 1 else 1):
                left.remove(index)
                yield index, outcome
            return
        except BrokenProcessPool:
            continue
    raise RuntimeError(
        f"worker processes died {ATTEMPTS} times (out of memory, killed, or started by a program without"
        f" `if __name__ == '__main__':`); {len(left)} runs are left: the same command goes on with them"
    )


def _pool(function, tasks, indices, jobs):
    """Yield outcomes of one pool; its workers are stopped if the caller is interrupted."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")  # forking a process that runs numba threads is unsafe
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start_worker, initargs=(os.getpid(),))
    try:
        futures = {pool.submit(function, tasks[index]): index for index in indices}
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    pool.shutdown()


def _start_worker(parent):
    """Leave Ctrl-C to the parent, which alone decides what is saved, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch():
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)  # a killed parent leaves its workers waiting for ever

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def session(engine, jobs=1, address=None):
    """Context that stays connected to Ray, so that several evaluations inside share its warm workers.

    Does nothing for other engines, nor where this process is connected already.
    Raises: InputError where Ray is not installed.
    """
    if engine != "ray":
        yield
        return
    ray = _ray_module()
    if ray.is_initialized():
        yield
        return
    if address:
        options = {"address": address}
    else:
        options = {"num_cpus": jobs, "include_dashboard": False}
        if NICENESS not in os.environ:  # Ray's own choice, 15, waits for whatever else the machine does
            options["_system_config"] = {"worker_niceness": 0}
    ray.init(log_to_driver=False, logging_level="error", **options)
    try:
        yield
    finally:
        ray.shutdown()


def _ray_module():
    """Ray. Raises: InputError where it is not installed."""
    try:
        import ray
    except ImportError:
        raise InputError("engine = 'ray': Ray is not installed: pip install 'fowt-env[ray]'") from None
    return ray


def _unpacked(function, packed):
    """function(task) of a pickled task: Ray's own way of sending would leave its arrays read-only."""
    return function(pickle.loads(packed))


def _ray(function, tasks, jobs, address):
    """Yield outcomes of Ray tasks; Ray itself tries a task again whose worker dies."""
    ray = _ray_module()
    _sendable(tasks, jobs)
    with session("ray", jobs, address):
        # arguments are small and the code is installed on every node: only results travel far
        remote = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_unpacked)
        # enough to keep every worker busy; all at once would make each wait look through all of them
        window = WINDOW * max(1, int(ray.cluster_resources().get("CPU", jobs)))
        waiting, left = {}, iter(enumerate(tasks))
        while True:
            for index, task in itertools.islice(left, window - len(waiting)):
                waiting[remote.remote(function, ray.cloudpickle.dumps(task))] = index
            if not waiting:
                return
            done, _ = ray.wait(list(waiting), num_returns=1)
            for reference in done:
                yield waiting.pop(reference), ray.get(reference)
