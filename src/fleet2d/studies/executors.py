"""Tasks on executors of `concurrent.futures`: in this process, in others, or on a cluster."""

import itertools
import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing.connection import Connection
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, Protocol

from fleet2d.errors import ComponentError, InputError
from fleet2d.runtime.memory import keep_free_memory, peak_memory_mb, rare_collections

# The number of attempts at a task whose worker dies each time.
MAX_ATTEMPTS = 3
MAX_BATCH = 100  # tasks that a worker gets at once
BATCH_S = 1.0  # time after which a worker returns its results so far
MEMORY_SHARE = 0.8  # share of the machine's memory that all workers may use together


@dataclass(frozen=True, slots=True)
class WorkerTask:
    """A variant to run.

    Attributes:
        number: Its number in results.
        index: Its index in the design.
        identity: Its identity when it was planned.
        home: A key that variants share if they can share a home.
    """

    number: int
    index: int
    identity: str
    home: str = ""


class WorkerJob(Protocol):
    """A function that workers receive once and call for each task; it can be pickled."""

    def __call__(self, task: Any, /) -> Any:
        """Do a task; return its results, which can be pickled."""
        ...


def by_home(tasks: Iterable[WorkerTask]) -> list[tuple[int, Iterator[WorkerTask]]]:
    """Return groups of tasks that share a home, as a queue takes them."""
    groups: dict[str, list[WorkerTask]] = {}
    for task in tasks:
        groups.setdefault(task.home, []).append(task)
    return [(len(group), iter(group)) for group in groups.values()]


class TaskQueue:
    """Tasks that wait, in groups that share a home, so that a worker builds it once.

    Example:
        >>> tasks = by_home(WorkerTask(i, i, "", home) for i, home in enumerate("abab"))
        >>> [task.number for task in TaskQueue(tasks).take(2)]
        [0, 2]
    """

    def __init__(self, groups: Iterable[tuple[int, Iterator[WorkerTask]]] = ()) -> None:
        """Hold the number of tasks of each home, and the tasks, which may be made when taken."""
        self._groups = deque(groups)
        self._waiting = sum(count for count, _ in self._groups)
        self._alone = deque[WorkerTask]()

    def __bool__(self) -> bool:
        """Return whether tasks wait."""
        return bool(self._groups or self._alone)

    def take(self, workers: int) -> list[WorkerTask]:
        """Remove some tasks: at most a worker's share of all that wait.

        They are of one home, or of several homes with all of their tasks.
        """
        if self._alone:
            return [self._alone.popleft()]
        share = min(math.ceil(self._waiting / workers), MAX_BATCH)
        count, group = self._groups.popleft()
        taken = list(itertools.islice(group, share))
        if len(taken) < count:
            self._groups.appendleft((count - len(taken), group))
        while self._groups and len(taken) + self._groups[0][0] <= share:
            taken += self._groups.popleft()[1]
        self._waiting -= len(taken)
        return taken

    def put_back(self, tasks: Collection[WorkerTask]) -> None:
        """Put tasks that were taken together back at the front of the queue."""
        if tasks:
            self._groups.appendleft((len(tasks), iter(tasks)))
            self._waiting += len(tasks)

    def put_back_alone(self, task: WorkerTask) -> None:
        """Put back a task that may have killed its worker: it is taken without others."""
        self._alone.append(task)


class TaskEnd(NamedTuple):
    """A task that has ended.

    Attributes:
        task: The task.
        attempts: The number of times it was run.
        payload: Its results; None if the task is lost.
        loss: The reason if its worker died in each attempt; None if there are results.
    """

    task: Any
    attempts: int
    payload: Any = None
    loss: str | None = None


@dataclass(frozen=True)
class Crew:
    """An executor and the settings of its calls.

    Attributes:
        executor: The executor.
        workers: How many calls it gets at a time.
        batch_s: The time after which a call returns its results so far [s]; further calls do the
            rest.
        plans: A folder for the homes that workers build, each once; None: each worker builds its
            own.
    """

    executor: Executor
    workers: int = 1
    batch_s: float = BATCH_S
    plans: Path | None = None


def run_tasks(crew: Crew, job: WorkerJob, queue: TaskQueue) -> Generator[list[TaskEnd]]:
    """Yield tasks that have ended, some at a time, or none after a while.

    If a worker dies, the tasks of its call are called again, each alone. Closing the iterator
    cancels calls that have not begun.

    Raises:
        InputError: Workers can't be set up.
        ComponentError: The executor is broken.
    """
    content = pickle.dumps(job)
    attempts = Counter[int]()
    running: dict[Future[list[Any]], list[WorkerTask]] = {}
    try:
        while queue or running:
            while queue and len(running) < crew.workers:
                batch = queue.take(crew.workers)
                attempts.update(task.number for task in batch)
                running[_submitted(crew, content, batch)] = batch
            ended, _ = wait(running, BATCH_S, FIRST_COMPLETED)
            yield [
                end
                for future in ended
                for end in _ends(future, running.pop(future), attempts, queue)
            ]
    finally:
        for future in running:
            future.cancel()


def _submitted(crew: Crew, content: bytes, batch: list[WorkerTask]) -> "Future[list[Any]]":
    try:
        return crew.executor.submit(run_batch, content, batch, crew.batch_s, crew.plans)
    except BrokenExecutor as error:
        raise ComponentError(
            f"the executor is broken: {error}; with a new one the same study goes on"
        ) from error


def _ends(
    future: "Future[list[Any]]", batch: list[WorkerTask], attempts: Counter[int], queue: TaskQueue
) -> Iterator[TaskEnd]:
    """Yield the tasks of a call that have ended; the others go back to the queue."""
    error = future.exception()
    if error is None:
        payloads = future.result()
        rest = batch[len(payloads) :]
        attempts.subtract(task.number for task in rest)
        queue.put_back(rest)
        for task, payload in zip(batch, payloads, strict=False):
            yield TaskEnd(task, attempts.pop(task.number), payload)
        return
    if not isinstance(error, Exception) or isinstance(error, InputError):
        raise error
    last_line = (str(error).strip().splitlines() or [type(error).__name__])[-1]
    for task in batch:
        if attempts[task.number] < MAX_ATTEMPTS:
            queue.put_back_alone(task)
        else:
            loss = f"{last_line} in each of {MAX_ATTEMPTS} attempts"
            yield TaskEnd(task, MAX_ATTEMPTS, loss=loss)


def run_batch(
    content: bytes, tasks: Sequence[WorkerTask], seconds: float, plans: Path | None
) -> list[Any]:
    """Do tasks in a worker until the time is over; return their results, one at least.

    Args:
        content: The job, pickled.
        tasks: The tasks.
        seconds: The time after which no task is begun.
        plans: The folder for homes, as in `Crew`.

    Raises:
        InputError: The job can't be loaded.
    """
    from fleet2d.floorplan.plan import HOME_FOLDER  # the driver doesn't need it

    job = _loaded(content)
    end_s = time.monotonic() + seconds
    results = []
    keep_free_memory()
    with HOME_FOLDER.within(plans), rare_collections():
        for task in tasks:
            results.append(job(task))
            if time.monotonic() >= end_s:
                break
    return results


@lru_cache(maxsize=1)
def _loaded(content: bytes) -> WorkerJob:
    """Return a job, which a worker loads once.

    Raises:
        InputError: It can't be loaded.
    """
    try:
        with rare_collections():  # the job imports many modules
            job: WorkerJob = pickle.loads(content)  # noqa: S301 - from our own driver
    except Exception as error:
        raise InputError(f"a worker can't be set up:\n{traceback.format_exc()}") from error
    return job


class SerialExecutor(Executor):
    """Calls functions in this process, one after the other: for debuggers and profilers."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Call a function; return its result in a future. An error is raised here."""
        future: Future[Any] = Future()
        future.set_result(function(*args, **kwargs))
        return future


class LocalExecutor(ThreadPoolExecutor):
    """Calls functions in worker processes on this machine, each with a thread that waits for it.

    Each process has a pipe of its own. A `ProcessPoolExecutor` would share one among all, and wait
    for ever for a worker that was killed while it sent its results.

    Args:
        workers: The number of processes.
        memory_mb: Memory beyond which a process is replaced between two calls [MB]; None: an equal
            share of 80 % of the machine's memory.
    """

    def __init__(self, workers: int, memory_mb: float | None = None) -> None:
        """Create the executor; processes start with the first calls."""
        super().__init__(workers, "fleet2d-worker")
        self._memory_mb = memory_mb
        self._lock = threading.Lock()
        self._is_open = True
        self._processes: list[_WorkerProcess] = []
        self._idle: list[_WorkerProcess] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Call a function in a worker process; the future raises an error if the process dies."""
        return super().submit(self._call, function, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes at once."""
        with self._lock:
            self._is_open = False
            for process in self._processes:
                process.kill()
        super().shutdown(wait, cancel_futures=True)

    def _call(self, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        with self._lock:
            if not self._is_open:
                raise RuntimeError("the executor is closed")
            process = self._idle.pop() if self._idle else self._start()
        try:
            is_result, content, memory_mb = process.call(function, args, kwargs)
        except (EOFError, OSError):
            self._end(process)
            raise RuntimeError(f"the worker process ended ({process.cause})") from None
        most_mb = self._memory_mb or MEMORY_SHARE * _memory_mb() / len(self._processes)
        if memory_mb > most_mb:
            self._end(process)
        else:
            self._idle.append(process)
        if is_result:
            return content
        raise content

    def _start(self) -> "_WorkerProcess":
        process = _WorkerProcess()
        self._processes.append(process)
        return process

    def _end(self, process: "_WorkerProcess") -> None:
        process.kill()
        with self._lock, suppress(ValueError):  # another thread may have closed it
            self._processes.remove(process)


class _WorkerProcess:
    """A worker process, and the driver's end of the pipe to it."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, other_end = context.Pipe()
        self._process = context.Process(target=_work, args=(other_end,))
        with _worker_environment():
            self._process.start()
        other_end.close()  # so that the pipe ends with the process
        self._is_ready = False

    @property
    def cause(self) -> str:
        """The signal or exit code with which the process ended."""
        code = self._process.exitcode
        return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"

    def call(self, function: Callable[..., Any], args: Any, kwargs: Any) -> tuple[bool, Any, float]:
        """Call a function; return whether it succeeded, its result or error, and the memory [MB].

        Raises:
            EOFError: The process has ended.
            InputError: It ended before it was ready.
        """
        try:
            if not self._is_ready:
                self._connection.recv()
                self._is_ready = True
        except EOFError:
            self.kill()
            raise InputError(
                f"workers end before they are ready ({self.cause}): see their output"
            ) from None
        self._connection.send((function, args, kwargs))
        answer: tuple[bool, Any, float] = self._connection.recv()
        return answer

    def kill(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()


@contextmanager
def _worker_environment() -> Iterator[None]:
    """Start processes that ignore Ctrl-C and don't run the user's script again.

    Ctrl-C is for the driver, which ends its workers. `spawn` would import the main module, which
    may start a study itself.
    """
    main = sys.modules["__main__"]
    threads = os.environ.get("OPENBLAS_NUM_THREADS")
    sys.modules["__main__"] = ModuleType("__main__")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # there is a worker for each core
    signals = hasattr(signal, "pthread_sigmask") and signal.pthread_sigmask(
        signal.SIG_BLOCK, {signal.SIGINT}
    )
    try:
        yield
    finally:
        if signals is not False:
            signal.pthread_sigmask(signal.SIG_SETMASK, signals)
        if threads is None:
            del os.environ["OPENBLAS_NUM_THREADS"]
        sys.modules["__main__"] = main


def _work(connection: "Connection[Any, Any]") -> None:
    """Do the calls that arrive: the main function of a worker process."""
    os.dup2(2, 1)  # what components print must not mix with the output of the command
    threading.Thread(target=_end_with_driver, daemon=True).start()
    with suppress(EOFError, OSError):  # the driver has ended
        connection.send("ready")
        while True:
            function, args, kwargs = connection.recv()
            try:
                answer = (True, function(*args, **kwargs))
            except Exception as error:  # noqa: BLE001 - raised again in the driver
                answer = (False, portable(error))
            connection.send((*answer, peak_memory_mb() or 0.0))


def portable(error: Exception) -> Exception:
    """Return an error if it can be pickled, else one with its class and text."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - our own
    except Exception:  # noqa: BLE001 - errors of users may do anything
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _end_with_driver() -> None:
    driver = multiprocessing.parent_process()
    assert driver is not None
    driver.join()
    os._exit(0)


def _memory_mb() -> float:
    """Return the memory of this machine [MB]."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e6
    except (ValueError, OSError, AttributeError):  # not on every system
        return 8000.0


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1
