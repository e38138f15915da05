"""Which worker runs which variant: those of one home go to one worker in turn."""

from collections import deque
from collections.abc import Hashable, Iterable

from fleet2d.studies.record import Task


class Schedule:
    """Tasks in groups that share a home; a worker stays with a group until it is empty.

    A worker without a group takes the largest that nobody works on, else the last task of the
    largest group, so that all are busy to the end.

    Example:
        >>> tasks = [Task(i, i, "", home) for i, home in enumerate("aabbb")]
        >>> schedule = Schedule(tasks)
        >>> [schedule.take("first").number, schedule.take("second").number]
        [2, 0]
    """

    def __init__(self, tasks: Iterable[Task]) -> None:
        """Take the tasks in."""
        self._groups: dict[str, deque[Task]] = {}
        self._owners: dict[Hashable, str] = {}
        for task in tasks:
            self._groups.setdefault(task.home, deque()).append(task)

    def __len__(self) -> int:
        """Return the number of tasks that nobody took."""
        return sum(map(len, self._groups.values()))

    def __bool__(self) -> bool:
        """Return whether there are tasks left."""
        return bool(self._groups)

    def take(self, worker: Hashable) -> Task | None:
        """Return the next task for a worker; None if there is none left."""
        if not self._groups:
            return None
        home = self._owners.get(worker)
        if home in self._groups:
            return self._pop(home, first=True)
        owned = set(self._owners.values())
        free = [home for home in self._groups if home not in owned]
        chosen = max(free or self._groups, key=lambda home: len(self._groups[home]))
        self._owners[worker] = chosen
        return self._pop(chosen, first=bool(free))

    def put_back(self, task: Task) -> None:
        """Let a task be taken again, next of its home."""
        group = self._groups.pop(task.home, deque())
        group.appendleft(task)
        self._groups = {task.home: group, **self._groups}

    def leave(self, worker: Hashable) -> None:
        """Give up what a worker had begun with: it is gone."""
        self._owners.pop(worker, None)

    def _pop(self, home: str, *, first: bool) -> Task:
        group = self._groups[home]
        task = group.popleft() if first else group.pop()
        if not group:
            del self._groups[home]
        return task
