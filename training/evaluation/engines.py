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
ATTEMPTS = 3  # tries of one run before a worker that dies on it is taken as its own doing
PATIENCE = 10.0  # s that a worker has to end after its last task
NO_WORKERS = (
    f"worker processes died {ATTEMPTS} times (out of memory, killed, or started by a program without"
    " `if __name__ == '__main__':`); {} runs are left: the same command continues with them"
)
LONGEST_REASON = 200  # characters of what Ray says
DONE, RAISED, UNREADABLE = "done", "raised", "unreadable"  # what an answer of a worker is


class WorkersLost(RuntimeError):
    """Worker processes that cannot be started; what was done before is kept."""


def outcomes(function, tasks, jobs=1, engine="processes", address=None, limit=None, lost=None):
    """Yield (index, function(task)) for every task as it ends.

    engine   "processes": this process for jobs = 1, else that many spawned ones; "ray": a Ray cluster
             at the address, or a local one of `jobs` workers
    limit    seconds that a task should take at most: a worker that dies later on it is not tried again
    lost     lost(task, reason) is the outcome of a task on which workers die; None: RuntimeError
    Raises: InputError for an unknown engine, jobs < 1, tasks that cannot be sent, or a Ray that does not
    start; WorkersLost where workers cannot be started.
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
    """Pickles of the tasks. Raises: InputError."""
    packed, error = attempt(lambda: [pickle.dumps(task) for task in tasks])
    if error is not None:
        raise InputError(
            f"jobs = {jobs}: a controller or case cannot be sent to a worker process ({reason_of(error)});"
            " use jobs=1"
        ) from error
    return packed


def _processes(function, tasks, indices, jobs, limit, lost):
    """Yield outcomes from worker processes; one that dies costs its own task another try."""
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
    """Indices of the tasks that no worker has, and how often workers died on each."""

    def __init__(self, indices):
        self.waiting, self.alone, self.deaths = deque(indices), deque(), Counter()

    @property
    def left(self):
        """How many there are."""
        return len(self.waiting) + len(self.alone)

    def next(self, busy):
        """The next one, or None. The last try of a task waits until no other worker is busy."""
        if self.waiting:
            return self.waiting.popleft()
        return self.alone.popleft() if self.alone and not busy else None

    def reason(self, index, code, seconds, limit):
        """Why a task (None: there was none) failed on which a worker died; None where it is tried again."""
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
    """Workers that have answered or ended, once there are any."""
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
        """Send it a task (None: none); where it has died meanwhile, its end will be heard."""
        self.index, self.began = index, time.monotonic()
        if index is not None:
            with suppress(OSError):
                self.pipe.send_bytes(packed[index])

    def answer(self):
        """Bytes that it has sent, or None if it has ended."""
        try:
            return self.pipe.recv_bytes() if self.pipe.poll() else None
        except (EOFError, OSError):
            return None

    def end(self, patience=1.0):
        """Exit code of its process, which is killed if it does not end by itself."""
        self.process.join(patience)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        return self.process.exitcode


def _work(pipe, parent, function):
    """Do tasks as they come, until the pipe is closed."""
    _start_worker(parent)
    pipe.send_bytes(b"ready")
    while True:
        try:
            packed = pipe.recv_bytes()
        except EOFError:
            return
        pipe.send_bytes(_answer(function, packed))


def _answer(function, packed):
    """Pickle of what came of a pickled task: (DONE, outcome), (RAISED, exception) or (UNREADABLE, reason)."""
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
    """Outcome of a task whose _answer this is. Raises: what the function raised."""
    kind, value = pickle.loads(answer)
    if kind == RAISED:
        raise value
    return value if kind == DONE else lost(task, value)


def _start_worker(parent):
    """Leave Ctrl-C to the parent, which alone decides what is saved, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    as_worker()

    def watch():
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)  # a killed parent leaves its workers waiting for ever

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def session(engine, jobs=1, address=None):
    """Context that stays connected to Ray, so that several evaluations inside share its warm workers.

    Does nothing for other engines, nor where this process is connected already.
    Raises: InputError where Ray is not installed, does not start or cannot be reached.
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
    _start(ray, options)
    try:
        yield
    finally:
        ray.shutdown()


def _start(ray, options):
    """Connect to Ray. Raises: InputError in one line, whatever Ray raises and says."""
    try:
        ray.init(log_to_driver=False, logging_level="error", **options)
    except Exception as error:
        attempt(ray.shutdown)  # of what has been started of it
        what = f"no cluster at {options['address']!r}" if "address" in options else "Ray does not start"
        reason = " ".join(str(error).split())[:LONGEST_REASON]
        raise InputError(
            f"engine = 'ray': {what} ({type(error).__name__}: {reason}); without Ray: engine 'processes'"
        ) from None


def _ray_module():
    """Ray. Raises: InputError where it is not installed."""
    try:
        import ray
    except ImportError:
        raise InputError("engine = 'ray': Ray is not installed: pip install 'fowt-env[ray]'") from None
    return ray


def _answer_of_ray(function, packed):
    """_answer of a pickled task: Ray's own way of sending would leave its arrays read-only."""
    as_worker()
    return _answer(function, packed)


def _ray(function, tasks, jobs, address, lost):
    """Yield outcomes of Ray tasks; Ray itself tries a task again whose worker dies."""
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
