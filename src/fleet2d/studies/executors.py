"""Executors: they run the tasks of a study in this process, in others, or on a cluster."""

import os
from collections import deque
from collections.abc import Generator, Hashable, Iterable
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
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

    def __call__(self, task: WorkerTask) -> bytes:
        """Do a task; return its results as bytes."""
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

    def __init__(self, tasks: Iterable[WorkerTask]) -> None:
        """Group tasks by home."""
        self._groups: dict[str, deque[WorkerTask]] = {}
        self._owners: dict[Hashable, str] = {}
        for task in tasks:
            self._groups.setdefault(task.home, deque()).append(task)

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
        """Free the group of a worker that is gone."""
        self._owners.pop(worker, None)

    def _pop(self, home: str, *, first: bool) -> WorkerTask:
        group = self._groups[home]
        task = group.popleft() if first else group.pop()
        if not group:
            del self._groups[home]
        return task


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
