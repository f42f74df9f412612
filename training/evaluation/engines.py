"""Engines of an evaluation: this process, worker processes, or a Ray cluster.

Every engine yields (index, outcome of the function) as tasks end, in any order, with identical bits.
"""

import itertools
import multiprocessing
import os
import pickle
import signal
import threading
import time
import traceback
from collections import Counter, deque
from contextlib import contextmanager, suppress
from multiprocessing import connection

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
WINDOW = 4  # Ray tasks handed out per processor
ATTEMPTS = 3  # workers that die on a task before the task is given up
PATIENCE = 10.0  # s that a worker has to end after its last task
NO_WORKERS = (
    f"worker processes died {ATTEMPTS} times (out of memory, killed, or started by a program without"
    " `if __name__ == '__main__':`); {} runs are left: the same command continues with them"
)
LONGEST_REASON = 200  # characters of what Ray says
DONE, RAISED, UNREADABLE = "done", "raised", "unreadable"  # kinds of a worker's answers


class WorkersLost(RuntimeError):
    """Worker processes that cannot be started; finished tasks are kept."""


def outcomes(function, tasks, jobs=1, engine="processes", address=None, limit=None, lost=None):
    """Yield (index, function(task)) for every task as it ends.

    engine   "processes": this process for jobs = 1, else that many spawned ones; "ray": a Ray cluster
             at the address, or a local one of `jobs` workers
    limit    time limit of a task, s: after a worker's death later than this the task is not tried again
    lost     lost(task, reason) is the outcome of a task on which workers die; None: RuntimeError
    Raises: InputError for an unknown engine, jobs < 1, tasks that cannot be sent, or a Ray that does not
    start; WorkersLost if workers cannot be started.
    """
    if engine not in ENGINES:
        raise unknown("engine", engine, ENGINES)
    check_whole_number("jobs", jobs, 1)
    if address is not None and engine != "ray":
        raise InputError(f"address = {address!r}: needs the engine 'ray'")
    if not tasks:
        return
    if engine == "ray":
        yield from _ray(function, tasks, jobs, address, lost or _raise_lost)
        return
    first = 0
    if jobs == 1 or not kernels_compiled():
        # one process fills the kernel cache, instead of every worker compiling the same
        first = len(tasks) if jobs == 1 else 1
        for index, task in enumerate(tasks[:first]):
            yield index, function(task)
    if first < len(tasks):
        yield from _processes(function, tasks, range(first, len(tasks)), jobs, limit, lost or _raise_lost)


def _raise_lost(task, reason):
    raise RuntimeError(reason)


def _sendable(tasks, jobs):
    """Return the pickled tasks. Raises: InputError."""
    packed, error = attempt(lambda: [pickle.dumps(task) for task in tasks])
    if error is not None:
        raise InputError(
            f"jobs = {jobs}: a controller or case cannot be sent to a worker process ({reason_of(error)});"
            " use jobs=1"
        ) from error
    return packed


def _processes(function, tasks, indices, jobs, limit, lost):
    """Yield outcomes from worker processes; after a worker's death its task is tried again."""
    packed = _sendable(tasks, jobs)
    queue, workers, unborn = _Queue(indices), [], 0
    try:
        while queue.left or any(worker.at_work for worker in workers):
            for worker in workers:
                if worker.ready and not worker.at_work:
                    worker.give(queue.next(any(other.at_work for other in workers)), packed)
            wanted = min(jobs, queue.left + sum(worker.at_work for worker in workers))
            workers += [_Worker(function) for _ in range(wanted - len(workers))]
            for worker in _heard(workers):
                answer, index = worker.answer(), worker.index
                if answer is None:
                    workers.remove(worker)
                    code = worker.end()
                    reason = queue.reason(index, code, time.monotonic() - worker.began, limit)
                    if reason is not None:
                        yield index, lost(tasks[index], reason)
                    unborn += not worker.ready
                    if unborn == ATTEMPTS:
                        left = queue.left + sum(other.at_work for other in workers)
                        raise WorkersLost(NO_WORKERS.format(left))
                elif worker.ready:
                    worker.index = None
                    yield index, _outcome(answer, tasks[index], lost)
                else:
                    worker.ready, unborn = True, 0
    except BaseException:
        for worker in workers:
            worker.process.kill()
        raise
    finally:
        for worker in workers:
            worker.pipe.close()
        for worker in workers:
            worker.end(PATIENCE)


class _Queue:
    """Indices of the waiting tasks, and how often workers died on each."""

    def __init__(self, indices):
        self.waiting, self.alone, self.deaths = deque(indices), deque(), Counter()

    @property
    def left(self):
        """Number of waiting tasks."""
        return len(self.waiting) + len(self.alone)

    def next(self, busy):
        """Return the next index, or None. The last try of a task waits until no other worker is busy."""
        if self.waiting:
            return self.waiting.popleft()
        return self.alone.popleft() if self.alone and not busy else None

    def reason(self, index, code, seconds, limit):
        """Return why a task is lost on which a worker died; None if it is tried again, or without a task."""
        if index is None:
            return None
        if limit is not None and code == LIMIT_CODE and seconds >= limit + GRACE:
            return time_limit_reason(limit)
        self.deaths[index] += 1
        if self.deaths[index] == ATTEMPTS:
            ending = f"exit code {code}" if code >= 0 else f"signal {-code} ({signal.strsignal(-code)})"
            return f"its worker process ended {self.deaths[index]} times, the last time alone, with {ending}"
        (self.alone if self.deaths[index] == ATTEMPTS - 1 else self.waiting).append(index)
        return None


def _heard(workers):
    """Wait until workers have answered or ended, and return these."""
    handles = {handle: worker for worker in workers for handle in (worker.pipe, worker.process.sentinel)}
    return {handles[handle]: None for handle in connection.wait(list(handles))}


class _Worker:
    """A process that does one task after the other."""

    def __init__(self, function):
        context = multiprocessing.get_context("spawn")  # forking a process that runs numba threads is unsafe
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, os.getpid(), function))
        self.process.start()
        theirs.close()
        self.ready, self.index, self.began = False, None, 0.0

    @property
    def at_work(self):
        """Whether it has a task."""
        return self.index is not None

    def give(self, index, packed):
        """Send the worker a task (None: none); `_heard` finds out if it has died."""
        self.index, self.began = index, time.monotonic()
        if index is not None:
            with suppress(OSError):
                self.pipe.send_bytes(packed[index])

    def answer(self):
        """Return the bytes that it has sent, or None if it has ended."""
        try:
            return self.pipe.recv_bytes() if self.pipe.poll() else None
        except (EOFError, OSError):
            return None

    def end(self, patience=1.0):
        """Return the exit code of its process, which is killed after `patience` seconds."""
        self.process.join(patience)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        return self.process.exitcode


def _work(pipe, parent, function):
    """Do tasks from a pipe until it is closed."""
    _start_worker(parent)
    pipe.send_bytes(b"ready")
    while True:
        try:
            packed = pipe.recv_bytes()
        except EOFError:
            return
        pipe.send_bytes(_answer(function, packed))


def _answer(function, packed):
    """Return the pickled (DONE, outcome), (RAISED, exception) or (UNREADABLE, reason) of a pickled task."""
    task, error = attempt(lambda: pickle.loads(packed))
    if error is not None:
        return pickle.dumps((UNREADABLE, f"cannot be sent to a worker process: {reason_of(error)}"))
    try:
        return pickle.dumps((DONE, function(task)))
    except Exception as error:
        error.add_note("".join(traceback.format_exception(error)))
        content, failure = attempt(lambda: pickle.dumps((RAISED, error)))
        if failure is None and attempt(lambda: pickle.loads(content))[1] is None:
            return content
        return pickle.dumps((RAISED, RuntimeError(reason_of(error))))


def _outcome(answer, task, lost):
    """Return the outcome of a task from its _answer. Raises: the exception of the function."""
    kind, value = pickle.loads(answer)
    if kind == RAISED:
        raise value
    return value if kind == DONE else lost(task, value)


def _start_worker(parent):
    """Leave Ctrl-C to the parent process, and end when it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    as_worker()

    def watch():
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)  # else the workers of a killed parent wait forever

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def session(engine, jobs=1, address=None):
    """Stay connected to Ray during a block, so that its evaluations share warm workers.

    Does nothing for other engines, or if this process is connected already.
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
    _start(ray, options)
    try:
        yield
    finally:
        ray.shutdown()


def _start(ray, options):
    """Connect to Ray. Raises: InputError in one line for any error of Ray."""
    try:
        ray.init(log_to_driver=False, logging_level="error", **options)
    except Exception as error:
        attempt(ray.shutdown)  # a part of it may have started
        what = f"no cluster at {options['address']!r}" if "address" in options else "Ray does not start"
        reason = " ".join(str(error).split())[:LONGEST_REASON]
        raise InputError(
            f"engine = 'ray': {what} ({type(error).__name__}: {reason}); without Ray: engine 'processes'"
        ) from None


def _ray_module():
    """Return the module of Ray. Raises: InputError if it is not installed."""
    try:
        import ray
    except ImportError:
        raise InputError("engine = 'ray': Ray is not installed: pip install 'fowt-env[ray]'") from None
    return ray


def _answer_of_ray(function, packed):
    """Return _answer of a pickled task, pickled here since arrays that Ray sends are read-only."""
    as_worker()
    return _answer(function, packed)


def _ray(function, tasks, jobs, address, lost):
    """Yield outcomes of Ray tasks; Ray repeats a task whose worker dies."""
    ray = _ray_module()
    _sendable(tasks, jobs)
    deaths = (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError)
    with session("ray", jobs, address):
        # arguments are small and the code is installed on every node: only results travel far
        remote = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_answer_of_ray)
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
                index = waiting.pop(reference)
                try:
                    answer = ray.get(reference)
                except deaths as error:
                    reason = f"its worker process ended {ATTEMPTS} times: {reason_of(error)}"
                    yield index, lost(tasks[index], reason)
                else:
                    yield index, _outcome(answer, tasks[index], lost)
