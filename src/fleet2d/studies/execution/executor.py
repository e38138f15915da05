"""The interface of executors: they take tasks, and yield an event for each."""

import os
from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

from fleet2d.studies.data.record import WorkerTask
from fleet2d.studies.execution.jobs import WorkerJob
from fleet2d.studies.execution.schedule import TaskSchedule

AHEAD = 2  # tasks of a worker: one runs, one waits, so that it is never idle
MOST_ATTEMPTS = 3  # of a task whose worker dies each time
MOST_STARTS = 3  # of workers that end before they are ready


@dataclass(frozen=True)
class FinishedTask:
    """A finished task with its results as bytes."""

    task: WorkerTask
    payload: bytes
    attempts: int


@dataclass(frozen=True)
class LostTask:
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


def retry(
    task: WorkerTask, attempts: dict[int, int], tasks: TaskSchedule, reason: str
) -> LostTask | None:
    """Schedule a task again whose worker died; after some attempts return it as lost."""
    attempts[task.number] = attempts.get(task.number, 0) + 1
    if attempts[task.number] < MOST_ATTEMPTS:
        tasks.put_back(task)
        return None
    return LostTask(task, f"{reason} in each of {MOST_ATTEMPTS} attempts", MOST_ATTEMPTS)


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1
