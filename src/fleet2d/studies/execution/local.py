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
from fleet2d.studies.execution.pipe import receive, send
from fleet2d.studies.execution.worker import BROKEN, READY
from fleet2d.studies.executors import (
    AHEAD,
    MOST_STARTS,
    Event,
    FinishedTask,
    LostTask,
    TaskSchedule,
    WorkerJob,
    WorkerTask,
    retry,
)

MEMORY_SHARE = 0.8  # share of the machine's memory that all workers may use together

_numbers = itertools.count()


@dataclass(eq=False)
class _Worker:
    """A worker process, as the driver knows it.

    Attributes:
        process: The process.
        number: Its number, by which the schedule knows it.
        tasks: Its tasks; it is running the first.
        is_ready: Whether it is set up.
        is_full: Whether it uses so much memory that it must be replaced.
    """

    process: "subprocess.Popen[bytes]"
    number: int = field(default_factory=lambda: next(_numbers))
    tasks: deque[WorkerTask] = field(default_factory=deque)
    is_ready: bool = False
    is_full: bool = False

    def close(self) -> int:
        """Wait for the end of the process; return its exit code."""
        code = self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            with suppress(OSError):
                if stream is not None:
                    stream.close()
        return code

    def send(self, message: Any) -> None:
        """Send a message. An error is ignored: `_listen` reports a worker that has ended."""
        assert self.process.stdin is not None
        with suppress(OSError):
            send(self.process.stdin, message)


class LocalExecutor:
    """Runs tasks in worker processes, each of which runs many tasks.

    Args:
        workers: The number of processes.
        memory_mb: Memory beyond which a process is replaced between two tasks [MB]; None: an equal
            share of 80 % of the machine's memory.
    """

    def __init__(self, workers: int, memory_mb: float | None = None) -> None:
        """Create the executor; workers start with `run`."""
        self.workers = workers
        self._limit_mb = memory_mb or MEMORY_SHARE * _memory_mb() / workers
        self._messages: queue.SimpleQueue[tuple[_Worker, Any]] = queue.SimpleQueue()
        self._crew: list[_Worker] = []
        self._failed_starts = 0

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        """Yield an event for each task as it ends; closing the iterator ends all work.

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
                    worker.tasks.popleft()
                    worker.is_full = rss_mb > self._limit_mb
                    yield FinishedTask(task, payload, attempts.get(task.number, 0) + 1)
                self._hand_out(worker, tasks)
        finally:
            self._stop()

    def _start(self, job: WorkerJob) -> None:
        process = subprocess.Popen(
            [sys.executable, "-m", "fleet2d.studies.execution.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C reaches the driver only, which ends the workers
            env={
                "OPENBLAS_NUM_THREADS": "1",  # there is a worker for each core
                **os.environ,
                "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            },
        )
        worker = _Worker(process)
        self._crew.append(worker)
        threading.Thread(target=self._listen, args=(worker,), daemon=True).start()
        worker.send((os.getcwd(), list(sys.path)))  # noqa: PTH109 - a text is sent
        worker.send(job)

    def _listen(self, worker: _Worker) -> None:
        """Queue the messages of a worker, and None when it has ended."""
        assert worker.process.stdout is not None
        try:
            while True:
                message = receive(worker.process.stdout)
                self._messages.put((worker, message))
        except (EOFError, OSError, ValueError):
            self._messages.put((worker, None))

    def _hand_out(self, worker: _Worker, tasks: TaskSchedule) -> None:
        if worker not in self._crew or not worker.is_ready:
            return
        if worker.is_full:
            if not worker.tasks:
                worker.send(None)  # ends it; `_replace` starts another
            return
        while len(worker.tasks) < AHEAD and (task := tasks.take(worker.number)) is not None:
            worker.tasks.append(task)
            worker.send(task)

    def _replace(
        self, worker: _Worker, job: WorkerJob, tasks: TaskSchedule, attempts: dict[int, int]
    ) -> Iterator[LostTask]:
        """Replace a worker that has ended; the task that it was running is run again."""
        code = worker.close()
        self._crew.remove(worker)
        tasks.leave(worker.number)
        if not worker.is_ready:
            self._failed_starts += 1
            if self._failed_starts >= MOST_STARTS:
                raise InputError(
                    f"workers end before they are ready (exit code {code}): see their output"
                )
        running, *pending = worker.tasks or [None]
        for task in reversed(pending):
            if task is not None:
                tasks.put_back(task)
        if running is not None:
            lost = retry(running, attempts, tasks, f"the worker process ended ({_cause(code)})")
            if lost is not None:
                yield lost
        if tasks or any(worker.tasks for worker in self._crew):
            self._start(job)

    def _stop(self) -> None:
        """End all workers at once; none of their tasks is needed."""
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
