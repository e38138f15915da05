"""What every executor offers: tasks in, and what becomes of each out."""

import os
from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

from fleet2d.studies.jobs import Job
from fleet2d.studies.record import Task
from fleet2d.studies.schedule import Schedule

MOST_ATTEMPTS = 3  # of a task during which its worker dies


@dataclass(frozen=True)
class Finished:
    """A task that was done, and the bytes that came of it."""

    task: Task
    payload: bytes
    attempts: int


@dataclass(frozen=True)
class Lost:
    """A task that is given up, for its worker died each time; and why."""

    task: Task
    reason: str
    attempts: int


Event = Finished | Lost


class Executor(Protocol):
    """Runs tasks somewhere."""

    @property
    def workers(self) -> int:
        """How many tasks run at a time."""
        ...

    def run(self, job: Job, tasks: Schedule) -> Generator[Event]:
        """Yield what becomes of each task as it is known; closing the iterator ends all work."""
        ...


class SerialExecutor:
    """Runs tasks in this process, one after the other: for debuggers and profilers."""

    workers = 1

    def run(self, job: Job, tasks: Schedule) -> Generator[Event]:
        """Yield what becomes of each task."""
        while (task := tasks.take(self)) is not None:
            yield Finished(task, job(task), 1)


def lose(task: Task, attempts: dict[int, int], tasks: Schedule, reason: str) -> Lost | None:
    """Let a task whose worker died be run again, or give it up after some attempts."""
    attempts[task.number] = attempts.get(task.number, 0) + 1
    if attempts[task.number] < MOST_ATTEMPTS:
        tasks.put_back(task)
        return None
    return Lost(task, f"{reason} in each of {MOST_ATTEMPTS} attempts", MOST_ATTEMPTS)


def cores() -> int:
    """Return how many cores this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1
