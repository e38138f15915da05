"""Workers on a Ray cluster: one that runs already, or one that is started here."""

import itertools
import os
import sys
from collections import deque
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from fleet2d.errors import InputError
from fleet2d.studies.execution import Event, Finished, Lost, lose
from fleet2d.studies.jobs import Job
from fleet2d.studies.record import Task
from fleet2d.studies.schedule import Schedule

AHEAD = 2  # tasks that a worker holds, so that it never waits for the next
LOOK_EVERY_S = 5.0  # for nodes that came or went
MOST_STARTS = 3  # of a worker that ends before it can work

_numbers = itertools.count()


@dataclass(eq=False)
class _Actor:
    """A worker on the cluster, as the driver knows it.

    Attributes:
        handle: Ray's.
        start: A reference that is there once it is set up; until then it is given no tasks, for
            it may wait for a core that never comes.
        tasks: The tasks that it holds with their references; it is running the first.
        is_ready: Whether it is set up.
    """

    handle: Any
    start: Any
    number: int = field(default_factory=lambda: next(_numbers))
    tasks: deque[tuple[Task, Any]] = field(default_factory=deque)
    is_ready: bool = False


class RayExecutor:
    """Runs tasks on a Ray cluster, one worker a core.

    A cluster that runs is joined, by RAY_ADDRESS or the one on this machine; else one is started
    here. A worker or a node that dies loses what it was running, which is run again elsewhere.

    Args:
        workers: How many workers at most; None: one for each core of the cluster.
        address: The cluster's; None: as Ray finds it.
    """

    def __init__(self, workers: int | None = None, address: str | None = None) -> None:
        """Join the cluster, or start one.

        Raises:
            InputError: Ray is not installed, or the cluster can't be reached.
        """
        self._ray = _ray()
        self._was_joined = self._ray.is_initialized()
        if not self._was_joined:
            _join(self._ray, address)
        self._most = workers
        self._crew: list[_Actor] = []
        self._failed_starts = 0

    @property
    def workers(self) -> int:
        """How many workers there are to be: the cores of the cluster as it is now, or fewer."""
        cores = int(self._ray.cluster_resources().get("CPU", 0))
        return max(1, min(cores, self._most or cores))

    def run(self, job: Job, tasks: Schedule) -> Generator[Event]:
        """Yield what becomes of each task as it is known; closing the iterator ends all work.

        Raises:
            InputError: Workers can't be set up.
        """
        attempts: dict[int, int] = {}
        shared = self._ray.put(job)
        try:
            while tasks or any(actor.tasks for actor in self._crew):
                self._fill(shared, tasks)
                awaited = {
                    actor.tasks[0][1] if actor.is_ready else actor.start: actor
                    for actor in self._crew
                    if actor.tasks or not actor.is_ready
                }
                ready, _ = self._ray.wait(list(awaited), timeout=LOOK_EVERY_S)
                for reference in ready:
                    actor = awaited[reference]
                    if actor.is_ready:
                        yield from self._take(actor, tasks, attempts)
                    else:
                        self._begin(actor)
        finally:
            self._stop()

    def _fill(self, shared: Any, tasks: Schedule) -> None:
        """Start workers for cores that have none, and give those that are up something to do."""
        cores = self.workers
        for actor in [actor for actor in self._crew if not actor.is_ready]:
            if len(self._crew) > cores:  # the core that it was meant for is gone
                self._ray.kill(actor.handle)
                self._crew.remove(actor)
        for _ in range(min(cores, len(self._crew) + len(tasks)) - len(self._crew)):
            handle = _worker_class(self._ray).remote([shared])
            self._crew.append(_Actor(handle, handle.is_up.remote()))
        for actor in self._crew:
            while actor.is_ready and len(actor.tasks) < AHEAD:
                task = tasks.take(actor.number)
                if task is None:
                    break
                actor.tasks.append((task, actor.handle.run.remote(task)))

    def _begin(self, actor: _Actor) -> None:
        """Take in that a worker is set up, or that it could not be."""
        try:
            self._ray.get(actor.start)
            actor.is_ready, self._failed_starts = True, 0
        except self._ray.exceptions.RayError as error:
            self._crew.remove(actor)
            self._failed_starts += 1
            if self._failed_starts > MOST_STARTS * self.workers:
                raise InputError(f"workers end before they can work: {error}") from error

    def _take(self, actor: _Actor, tasks: Schedule, attempts: dict[int, int]) -> Generator[Event]:
        """Yield what became of the first task of a worker."""
        task, reference = actor.tasks.popleft()
        try:
            payload = self._ray.get(reference)
        except self._ray.exceptions.RayActorError as error:
            yield from self._replace(actor, task, tasks, attempts, error)
        else:
            yield Finished(task, payload, attempts.get(task.number, 0) + 1)

    def _replace(
        self,
        actor: _Actor,
        running: Task,
        tasks: Schedule,
        attempts: dict[int, int],
        error: Exception,
    ) -> Generator[Lost]:
        """Let go of a worker that is gone; what it held is run elsewhere."""
        self._crew.remove(actor)
        tasks.leave(actor.number)
        for task, _ in reversed(actor.tasks):
            tasks.put_back(task)
        lost = lose(running, attempts, tasks, f"the worker is gone ({type(error).__name__})")
        if lost is not None:
            yield lost

    def _stop(self) -> None:
        """End all workers at once; leave a cluster as it was found."""
        for actor in self._crew:
            with suppress(Exception):  # whatever state the cluster is in
                self._ray.kill(actor.handle)
        self._crew = []
        if not self._was_joined:
            self._ray.shutdown()


class Worker:
    """What runs on the cluster: a job, called for each task."""

    def __init__(self, shared: list[Any]) -> None:
        """Fetch the job."""
        self._job: Job = _ray().get(shared[0])

    def is_up(self) -> bool:
        """Return that it is set up."""
        return True

    def run(self, task: Task) -> bytes:
        """Do a task."""
        return self._job(task)


def _worker_class(ray: Any) -> Any:
    """Return the class of workers: never restarted by Ray, for the driver knows what they held."""
    return ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(Worker)


def _join(ray: Any, address: str | None) -> None:
    # Workers on this machine find what this process finds.
    paths = os.pathsep.join(filter(None, sys.path))
    options: dict[str, Any] = {
        "address": address,
        "runtime_env": {"env_vars": {"PYTHONPATH": paths}},
        "log_to_driver": False,
        "logging_level": "ERROR",
    }
    try:
        ray.init(**options)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise InputError(
            f"the Ray cluster can't be joined: {error}; RAY_ADDRESS names it, and without it one"
            " is started here"
        ) from error


def _ray() -> Any:
    try:
        import ray
    except ImportError:
        raise InputError('this needs Ray: pip install "fleet2d[ray]"') from None
    return ray
