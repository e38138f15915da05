"""Worker processes on this machine."""

import itertools
import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from fleet2d.errors import InputError
from fleet2d.studies.execution import Event, Finished, Lost, lose
from fleet2d.studies.jobs import Job
from fleet2d.studies.pipe import receive, send
from fleet2d.studies.record import Task
from fleet2d.studies.schedule import Schedule
from fleet2d.studies.worker import BROKEN, READY

AHEAD = 2  # tasks that a worker holds, so that it never waits for the next
MEMORY_SHARE = 0.8  # of the machine's memory that workers may hold together
MOST_STARTS = 3  # of a worker that ends before it can work

_numbers = itertools.count()


@dataclass(eq=False)
class _Worker:
    """A worker process, as the driver knows it.

    Attributes:
        process: The process.
        tasks: The tasks that it holds; it is running the first.
        is_ready: Whether it is set up.
        is_full: Whether it holds so much memory that it is to be replaced.
    """

    process: "subprocess.Popen[bytes]"
    number: int = field(default_factory=lambda: next(_numbers))
    tasks: deque[Task] = field(default_factory=deque)
    is_ready: bool = False
    is_full: bool = False

    def close(self) -> int:
        """Wait until the process is gone; return its exit code."""
        code = self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            with suppress(OSError):
                if stream is not None:
                    stream.close()
        return code

    def send(self, message: Any) -> None:
        """Send a message; a worker that is gone is noticed elsewhere."""
        assert self.process.stdin is not None
        with suppress(OSError):
            send(self.process.stdin, message)


class LocalExecutor:
    """Runs tasks in processes of their own, which stay alive from one task to the next.

    Args:
        workers: How many processes.
        memory_mb: What a process may hold before it is replaced between two tasks [MB]; None: its
            share of most of the machine's memory.
    """

    def __init__(self, workers: int, memory_mb: float | None = None) -> None:
        """Start nothing yet."""
        self.workers = workers
        self._limit_mb = memory_mb or MEMORY_SHARE * _memory_mb() / workers
        self._messages: queue.SimpleQueue[tuple[_Worker, Any]] = queue.SimpleQueue()
        self._crew: list[_Worker] = []
        self._failed_starts = 0

    @property
    def process_ids(self) -> list[int]:
        """The ids of the worker processes."""
        return [worker.process.pid for worker in self._crew]

    def run(self, job: Job, tasks: Schedule) -> Generator[Event]:
        """Yield what becomes of each task as it is known; closing the iterator ends all work.

        Raises:
            InputError: Workers can't be set up.
        """
        attempts: dict[int, int] = {}
        try:
            for _ in range(min(self.workers, len(tasks))):
                self._start(job)
            while tasks or any(worker.tasks for worker in self._crew):
                worker, message = self._messages.get()
                if worker not in self._crew:
                    continue  # of an earlier call
                if message is None:
                    yield from self._replace(worker, job, tasks, attempts)
                elif message[0] == BROKEN:
                    raise InputError(f"a worker can't be set up:\n{message[1]}")
                elif message[0] == READY:
                    worker.is_ready, self._failed_starts = True, 0
                else:
                    task, payload, rss_mb = message[1]
                    yield self._finished(worker, task, payload, rss_mb, attempts)
                self._hand_out(worker, tasks)
        finally:
            self._stop()

    def _start(self, job: Job) -> None:
        process = subprocess.Popen(
            [sys.executable, "-m", "fleet2d.studies.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for the driver, which ends the workers
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        worker = _Worker(process)
        self._crew.append(worker)
        threading.Thread(target=self._listen, args=(worker,), daemon=True).start()
        worker.send((os.getcwd(), list(sys.path)))  # noqa: PTH109 - a text is sent
        worker.send(job)

    def _listen(self, worker: _Worker) -> None:
        """Pass on what a worker says; None when it is gone."""
        assert worker.process.stdout is not None
        try:
            while True:
                message = receive(worker.process.stdout)
                self._messages.put((worker, message))
        except (EOFError, OSError, ValueError):
            self._messages.put((worker, None))

    def _hand_out(self, worker: _Worker, tasks: Schedule) -> None:
        if worker not in self._crew or not worker.is_ready:
            return
        if worker.is_full:
            if not worker.tasks:
                worker.send(None)  # ends it; its place is filled when it is gone
            return
        while len(worker.tasks) < AHEAD and (task := tasks.take(worker.number)) is not None:
            worker.tasks.append(task)
            worker.send(task)

    def _finished(
        self, worker: _Worker, task: Task, payload: bytes, rss_mb: float, attempts: dict[int, int]
    ) -> Finished:
        worker.tasks.popleft()
        worker.is_full = rss_mb > self._limit_mb
        return Finished(task, payload, attempts.get(task.number, 0) + 1)

    def _replace(
        self, worker: _Worker, job: Job, tasks: Schedule, attempts: dict[int, int]
    ) -> Iterator[Lost]:
        """Fill the place of a worker that is gone; what it was running is run again."""
        code = worker.close()
        self._crew.remove(worker)
        tasks.leave(worker.number)
        if not worker.is_ready:
            self._failed_starts += 1
            if self._failed_starts >= MOST_STARTS:
                raise InputError(
                    f"workers end before they can work (exit code {code}): see what they print"
                )
        running, *waiting = worker.tasks or [None]
        for task in reversed(waiting):
            if task is not None:
                tasks.put_back(task)
        if running is not None:
            lost = lose(running, attempts, tasks, f"the worker process ended ({_cause(code)})")
            if lost is not None:
                yield lost
        if tasks or any(other.tasks for other in self._crew):
            self._start(job)

    def _stop(self) -> None:
        """End all workers at once; nothing that they hold is needed."""
        for worker in self._crew:
            with suppress(OSError):
                worker.process.kill()
        for worker in self._crew:
            worker.close()
        self._crew = []


def _cause(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _memory_mb() -> float:
    """Return the memory of this machine [MB]."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e6
    except (ValueError, OSError, AttributeError):  # not on every system
        return 8000.0
