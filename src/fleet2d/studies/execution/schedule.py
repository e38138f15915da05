"""The order in which workers run tasks: those of one home go to one worker in turn."""

from collections import deque
from collections.abc import Hashable, Iterable

from fleet2d.studies.data.record import WorkerTask


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
