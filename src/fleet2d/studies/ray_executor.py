"""Workers on a Ray cluster: a running one, or one that is started on this machine."""

import itertools
import os
import sys
from collections import deque
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from fleet2d.errors import InputError, extra
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

LOOK_EVERY_S = 5.0  # for new and lost nodes

_numbers = itertools.count()


@dataclass(eq=False)
class _WorkerActor:
    """A worker on the cluster, as the driver knows it.

    Attributes:
        handle: Ray's handle of the actor.
        start: A reference that is ready once the worker is set up. Until then it gets no tasks, as
            it may wait for a core that never comes.
        number: Its number, by which the schedule knows it.
        tasks: Its tasks with the references of their results; it is running the first.
        is_ready: Whether it is set up.
    """

    handle: Any
    start: Any
    number: int = field(default_factory=lambda: next(_numbers))
    tasks: deque[tuple[WorkerTask, Any]] = field(default_factory=deque)
    is_ready: bool = False


class RayExecutor:
    """Runs tasks on a Ray cluster, one worker a core.

    It joins the cluster at RAY_ADDRESS or on this machine; if there is none, it starts one here.
    The tasks of a worker or node that dies are run again elsewhere.

    Args:
        workers: The largest number of workers; None: one for each core of the cluster.
        address: The address of the cluster; None: Ray looks for one.
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
        self._crew: list[_WorkerActor] = []
        self._failed_starts = 0

    @property
    def workers(self) -> int:
        """The number of workers: the cores that the cluster has now, or fewer."""
        cores = int(self._ray.cluster_resources().get("CPU", 0))
        return max(1, min(cores, self._most or cores))

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        """Yield an event for each task as it ends; closing the iterator ends all work.

        Raises:
            InputError: Workers can't be set up.
        """
        attempts: dict[int, int] = {}
        job_reference = self._ray.put(job)
        try:
            while tasks or any(actor.tasks for actor in self._crew):
                self._fill(job_reference, tasks)
                awaited = {
                    actor.tasks[0][1] if actor.is_ready else actor.start: actor
                    for actor in self._crew
                    if actor.tasks or not actor.is_ready
                }
                references, _ = self._ray.wait(list(awaited), timeout=LOOK_EVERY_S)
                for reference in references:
                    actor = awaited[reference]
                    if actor.is_ready:
                        yield from self._take(actor, tasks, attempts)
                    else:
                        self._begin(actor)
        finally:
            self._stop()

    def _fill(self, job_reference: Any, tasks: TaskSchedule) -> None:
        """Start workers for free cores, and hand tasks to those that are ready."""
        cores = self.workers
        for actor in [actor for actor in self._crew if not actor.is_ready]:
            if len(self._crew) > cores:  # the cluster lost the core that it waits for
                self._ray.kill(actor.handle)
                self._crew.remove(actor)
        for _ in range(min(cores, len(self._crew) + len(tasks)) - len(self._crew)):
            handle = _worker_class(self._ray).remote([job_reference])
            self._crew.append(_WorkerActor(handle, handle.is_up.remote()))
        for actor in self._crew:
            while actor.is_ready and len(actor.tasks) < AHEAD:
                task = tasks.take(actor.number)
                if task is None:
                    break
                actor.tasks.append((task, actor.handle.run.remote(task)))

    def _begin(self, actor: _WorkerActor) -> None:
        """Mark a worker as ready, or drop it if its set-up failed."""
        try:
            self._ray.get(actor.start)
            actor.is_ready, self._failed_starts = True, 0
        except self._ray.exceptions.RayError as error:
            self._crew.remove(actor)
            self._failed_starts += 1
            if self._failed_starts > MOST_STARTS * self.workers:
                raise InputError(f"workers end before they are ready: {error}") from error

    def _take(
        self, actor: _WorkerActor, tasks: TaskSchedule, attempts: dict[int, int]
    ) -> Generator[Event]:
        """Yield the event of the first task of a worker."""
        task, reference = actor.tasks.popleft()
        try:
            payload = self._ray.get(reference)
        except self._ray.exceptions.RayActorError as error:
            yield from self._replace(actor, task, tasks, attempts, error)
        else:
            yield FinishedTask(task, payload, attempts.get(task.number, 0) + 1)

    def _replace(
        self,
        actor: _WorkerActor,
        running: WorkerTask,
        tasks: TaskSchedule,
        attempts: dict[int, int],
        error: Exception,
    ) -> Generator[LostTask]:
        """Drop a worker that has ended; its tasks are run elsewhere."""
        self._crew.remove(actor)
        tasks.leave(actor.number)
        for task, _ in reversed(actor.tasks):
            tasks.put_back(task)
        lost = retry(running, attempts, tasks, f"the worker is gone ({type(error).__name__})")
        if lost is not None:
            yield lost

    def _stop(self) -> None:
        """End all workers at once, and the cluster if this executor started it."""
        for actor in self._crew:
            with suppress(Exception):  # the cluster may be in any state
                self._ray.kill(actor.handle)
        self._crew = []
        if not self._was_joined:
            self._ray.shutdown()


class RayWorker:
    """A worker on the cluster: it calls a job for each task."""

    def __init__(self, job_reference: list[Any]) -> None:
        """Fetch the job."""
        self._job: WorkerJob = _ray().get(job_reference[0])

    def is_up(self) -> bool:
        """Return True; Ray calls it once the worker is set up."""
        return True

    def run(self, task: WorkerTask) -> bytes:
        """Run a task; return its results as bytes."""
        return self._job(task)


def _worker_class(ray: Any) -> Any:
    """Return the class of workers; Ray never restarts them, as the driver retries their tasks."""
    return ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(RayWorker)


def _join(ray: Any, address: str | None) -> None:
    # Workers on this machine import the same modules as this process.
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
    with extra("ray", "this needs Ray"):
        import ray
    return ray
