"""Executors: they run the tasks of a study in this process, in others, or on a cluster."""

import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Generator, Hashable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from types import ModuleType
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from fleet2d.errors import InputError
from fleet2d.runtime.memory import peak_memory_mb, rare_collections

TASKS_PER_WORKER = 2  # tasks of a worker: one runs, one waits, so that it is never idle
MAX_ATTEMPTS = 3  # of a task whose worker dies each time
MAX_STARTS = 3  # of a worker that ends before it is ready
MEMORY_SHARE = 0.8  # share of the machine's memory that all workers may use together


@dataclass(frozen=True, slots=True)
class WorkerTask:
    """A variant to run.

    Attributes:
        number: Its number in results.
        index: Its index in the design.
        identity: Its identity when it was planned.
        home: The same for variants that can share a home.
    """

    number: int
    index: int
    identity: str
    home: str = ""


class WorkerJob(Protocol):
    """A function that workers receive once and call for each task; it can be pickled."""

    def __call__(self, task: WorkerTask) -> Any:
        """Do a task; return its results, which can be pickled."""
        ...


class TaskSchedule:
    """Tasks in groups that share a home; a worker stays with a group until it is empty.

    A worker without a group gets the largest that no other worker has, else the last task of the
    largest group, so that all workers are busy to the end.

    Example:
        >>> tasks = [WorkerTask(i, i, "", home) for i, home in enumerate("aabbb")]
        >>> schedule = TaskSchedule(tasks)
        >>> [schedule.take("first").number, schedule.take("second").number]
        [2, 0]
    """

    def __init__(self, tasks: Iterable[WorkerTask] = ()) -> None:
        """Group tasks by home."""
        self._groups: dict[str, deque[WorkerTask]] = {}
        self._owners: dict[Hashable, str] = {}
        for task in tasks:
            self.add(task)

    def add(self, task: WorkerTask) -> None:
        """Add a task to the group of its home."""
        self._groups.setdefault(task.home, deque()).append(task)

    def on_end(self) -> None:
        """Note that a task has ended, with results or without."""

    def __len__(self) -> int:
        """Return the number of tasks that no worker has."""
        return sum(map(len, self._groups.values()))

    def __bool__(self) -> bool:
        """Return whether there are more tasks."""
        return bool(self._groups)

    def take(self, worker: Hashable) -> WorkerTask | None:
        """Return the next task for a worker; None if there are no more."""
        if not self._groups:
            return None
        home = self._owners.get(worker)
        if home in self._groups:
            return self._pop(home, first=True)
        owned = set(self._owners.values())
        free = [home for home in self._groups if home not in owned]
        largest = max(free or self._groups, key=lambda home: len(self._groups[home]))
        self._owners[worker] = largest
        return self._pop(largest, first=bool(free))

    def put_back(self, task: WorkerTask) -> None:
        """Return a task to the front of the group of its home."""
        group = self._groups.pop(task.home, deque())
        group.appendleft(task)
        self._groups = {task.home: group, **self._groups}

    def leave(self, worker: Hashable) -> None:
        """Free the group of a worker that has ended."""
        self._owners.pop(worker, None)

    def _pop(self, home: str, *, first: bool) -> WorkerTask:
        group = self._groups[home]
        task = group.popleft() if first else group.pop()
        if not group:
            del self._groups[home]
        return task


class FinishedTask(NamedTuple):
    """A finished task with its results."""

    task: WorkerTask
    payload: Any
    attempts: int


class LostTask(NamedTuple):
    """A task without results, as its worker died in each attempt; with the reason."""

    task: WorkerTask
    reason: str
    attempts: int


Event = FinishedTask | LostTask


class Executor(Protocol):
    """Runs tasks somewhere."""

    @property
    def workers(self) -> int:
        """How many tasks run at a time."""
        ...

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        """Yield an event for each task as it ends; closing the iterator ends all work."""
        ...


class SerialExecutor:
    """Runs tasks in this process, one after the other: for debuggers and profilers."""

    workers = 1

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        """Yield an event for each task."""
        while (task := tasks.take(self)) is not None:
            yield FinishedTask(task, job(task), 1)


class Ready:
    """The message of a worker that is set up."""


class Broken(NamedTuple):
    """The message of a worker that can't be set up, with the traceback."""

    trace: str


class Done(NamedTuple):
    """The message of a worker that has done its first task, with its memory [MB]."""

    payload: Any
    rss_mb: float = 0.0


class Died(NamedTuple):
    """What the driver notes about a worker that has ended, with the reason."""

    reason: str


@dataclass(eq=False)
class Worker:
    """A worker, as the driver knows it.

    Attributes:
        tasks: Its tasks; it is running the first.
        is_ready: Whether it is set up. Until then it gets no tasks.
        is_full: Whether it uses so much memory that it must be replaced.
    """

    tasks: deque[WorkerTask] = field(default_factory=deque, init=False)
    is_ready: bool = field(default=False, init=False)
    is_full: bool = field(default=False, init=False)


AnyWorker = TypeVar("AnyWorker", bound=Worker)


class CrewExecutor(ABC, Generic[AnyWorker]):
    """Base class of executors with several workers, each of which runs many tasks and may die.

    Attributes:
        memory_mb: Memory beyond which a worker is replaced between two tasks [MB].
    """

    memory_mb = math.inf

    def __init__(self) -> None:
        """Create the executor; workers start with `run`."""
        self._crew: list[AnyWorker] = []
        self._failed_starts = 0
        self._attempts: dict[int, int] = {}  # that failed, by the number of the task

    @property
    @abstractmethod
    def workers(self) -> int:
        """The largest number of workers at present."""

    @abstractmethod
    def _start(self, job: Any) -> AnyWorker:
        """Start a worker."""

    @abstractmethod
    def _send(self, worker: AnyWorker, task: WorkerTask) -> None:
        """Send a task to a worker. Errors are ignored: `_messages` reports a dead worker."""

    @abstractmethod
    def _messages(self) -> Iterator[tuple[AnyWorker, Ready | Broken | Done | Died]]:
        """Wait for messages from workers, at most one from each."""

    @abstractmethod
    def _end(self, workers: list[AnyWorker]) -> None:
        """End workers at once; none of their tasks is needed."""

    def run(self, job: Any, tasks: TaskSchedule) -> Generator[Event]:
        """Yield an event for each task as it ends; closing the iterator ends all work.

        Raises:
            InputError: Workers can't be set up.
        """
        self._attempts = {}
        try:
            while tasks or any(worker.tasks for worker in self._crew):
                self._fill(job, tasks)
                for worker, message in self._messages():
                    event = self._handle(worker, message, tasks)
                    if event is not None:
                        yield event
        finally:
            self._end(self._crew)
            self._crew = []

    def _fill(self, job: Any, tasks: TaskSchedule) -> None:
        """Hand tasks to workers that are ready, and start workers for the others."""
        full = [worker for worker in self._crew if worker.is_full and not worker.tasks]
        self._end(full)
        for worker in full:
            self._crew.remove(worker)
            tasks.leave(worker)
        for worker in self._crew:
            while worker.is_ready and not worker.is_full and len(worker.tasks) < TASKS_PER_WORKER:
                task = tasks.take(worker)
                if task is None:
                    break
                worker.tasks.append(task)
                self._send(worker, task)
        if (most := self.workers - len(self._crew)) > 0:
            starting = sum(not worker.is_ready for worker in self._crew)
            self._crew += [self._start(job) for _ in range(min(most, len(tasks) - starting))]

    def _handle(
        self, worker: AnyWorker, message: Ready | Broken | Done | Died, tasks: TaskSchedule
    ) -> Event | None:
        """Process the message of a worker; return the event of a task that has ended."""
        match message:
            case Ready():
                worker.is_ready = True
                self._failed_starts = 0
            case Broken(trace):
                raise InputError(f"a worker can't be set up:\n{trace}")
            case Done(payload, rss_mb):
                task = worker.tasks.popleft()
                worker.is_full = rss_mb > self.memory_mb
                return FinishedTask(task, payload, self._attempts.get(task.number, 0) + 1)
            case Died(reason):
                return self._replace(worker, reason, tasks)
        return None

    def _replace(self, worker: AnyWorker, reason: str, tasks: TaskSchedule) -> LostTask | None:
        """Drop a dead worker; return the task that it ran if that was the last attempt."""
        self._crew.remove(worker)
        tasks.leave(worker)
        if not worker.is_ready:
            self._failed_starts += 1
            if self._failed_starts >= MAX_STARTS * self.workers:
                raise InputError(f"workers end before they are ready: {reason}; see their output")
        while len(worker.tasks) > 1:
            tasks.put_back(worker.tasks.pop())
        for task in worker.tasks:
            self._attempts[task.number] = self._attempts.get(task.number, 0) + 1
            if self._attempts[task.number] == MAX_ATTEMPTS:
                text = f"{reason} in each of {MAX_ATTEMPTS} attempts"
                return LostTask(task, text, MAX_ATTEMPTS)
            tasks.put_back(task)
        return None


@dataclass(eq=False)
class LocalWorker(Worker):
    """A worker process and the driver's end of the pipe to it."""

    process: multiprocessing.process.BaseProcess
    connection: "Connection[Any, Any]"


class LocalExecutor(CrewExecutor[LocalWorker]):
    """Runs tasks in worker processes on this machine.

    Each has a pipe of its own. A `concurrent.futures.ProcessPoolExecutor` would share one among
    all, and wait for ever for a worker that was killed while it sent its results.

    Args:
        workers: The number of processes.
        memory_mb: Memory beyond which a process is replaced between two tasks [MB]; None: an equal
            share of 80 % of the machine's memory.
    """

    workers = 0

    def __init__(self, workers: int, memory_mb: float | None = None) -> None:
        """Create the executor; workers start with `run`."""
        super().__init__()
        self.workers = workers
        self.memory_mb = memory_mb or MEMORY_SHARE * _memory_mb() / workers

    def _start(self, job: WorkerJob) -> LocalWorker:
        context = multiprocessing.get_context("spawn")
        connection, other_end = context.Pipe()
        process = context.Process(target=_work, args=(pickle.dumps(job), other_end))
        with _worker_environment():
            process.start()
        other_end.close()  # the end of the process ends the pipe
        return LocalWorker(process, connection)

    def _send(self, worker: LocalWorker, task: WorkerTask) -> None:
        with suppress(OSError):
            worker.connection.send(task)

    def _messages(self) -> Iterator[tuple[LocalWorker, Ready | Broken | Done | Died]]:
        worker_of = {worker.connection: worker for worker in self._crew}
        for connection in wait(list(worker_of)):
            worker = worker_of[connection]  # type: ignore[index]
            try:
                message = worker.connection.recv()
            except (EOFError, OSError):
                self._end([worker])
                code = worker.process.exitcode
                cause = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
                message = Died(f"the worker process ended ({cause})")
            yield worker, message

    def _end(self, workers: list[LocalWorker]) -> None:
        for worker in workers:
            worker.process.kill()
        for worker in workers:
            worker.process.join()
            worker.connection.close()


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


def _work(job: bytes, connection: "Connection[Any, Any]") -> None:
    """Run the tasks that arrive: the main function of a worker process."""
    os.dup2(2, 1)  # what components print must not mix with the output of the command
    threading.Thread(target=_end_with_driver, daemon=True).start()
    with suppress(EOFError, OSError):  # the driver has ended
        try:
            with rare_collections():  # of the modules that the job needs
                function: WorkerJob = pickle.loads(job)  # noqa: S301 - from our own driver
        except BaseException:  # noqa: BLE001 - imports may raise anything
            connection.send(Broken(traceback.format_exc()))
            return
        connection.send(Ready())
        while True:
            task = connection.recv()
            payload = function(task)
            connection.send(Done(payload, peak_memory_mb() or 0.0))


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
