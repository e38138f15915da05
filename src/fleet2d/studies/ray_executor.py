"""Workers on a Ray cluster: a running one, or one that is started on this machine."""

import os
import sys
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from fleet2d.errors import InputError, extra
from fleet2d.studies.executors import (
    Broken,
    CrewExecutor,
    Died,
    Done,
    Event,
    Ready,
    TaskSchedule,
    Worker,
    WorkerJob,
    WorkerTask,
)

LOOK_EVERY_S = 5.0  # for new and lost nodes


@dataclass(eq=False)
class RayWorker(Worker):
    """A worker on the cluster, as the driver knows it.

    Attributes:
        handle: Ray's handle of the actor.
        start: A reference that is ready once the worker is set up. Until then it gets no tasks, as
            it may wait for a core that never becomes free.
        references: References of the results of its tasks.
    """

    handle: Any
    start: Any
    references: deque[Any] = field(default_factory=deque)


class RayExecutor(CrewExecutor[RayWorker]):
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
        super().__init__()
        self._ray = _ray()
        self._was_joined = self._ray.is_initialized()
        if not self._was_joined:
            _join(self._ray, address)
        self._most = workers

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
        try:
            yield from super().run(self._ray.put(job), tasks)
        finally:
            if not self._was_joined:
                self._ray.shutdown()

    def _fill(self, job: Any, tasks: TaskSchedule) -> None:
        for worker in [worker for worker in self._crew if not worker.is_ready]:
            if len(self._crew) > self.workers:  # the cluster lost the core that it waits for
                self._end([worker])
                self._crew.remove(worker)
        super()._fill(job, tasks)

    def _start(self, job: Any) -> RayWorker:
        # Ray never restarts workers, as the driver retries their tasks.
        worker_class = self._ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(_RemoteJob)
        handle = worker_class.remote([job])
        return RayWorker(handle, handle.start.remote())

    def _send(self, worker: RayWorker, task: WorkerTask) -> None:
        worker.references.append(worker.handle.run.remote(task))

    def _messages(self) -> Iterator[tuple[RayWorker, Ready | Broken | Done | Died]]:
        awaited = {
            worker.references[0] if worker.is_ready else worker.start: worker
            for worker in self._crew
            if worker.references or not worker.is_ready
        }
        errors = self._ray.exceptions
        for reference in self._ray.wait(list(awaited), timeout=LOOK_EVERY_S)[0]:
            worker = awaited[reference]
            expected = errors.RayActorError if worker.is_ready else errors.RayError
            try:
                message = self._ray.get(reference)
            except expected as error:
                message = Died(f"the worker is gone ({type(error).__name__})")
            if worker.is_ready:
                worker.references.popleft()
            yield worker, message

    def _end(self, workers: list[RayWorker]) -> None:
        for worker in workers:
            with suppress(Exception):  # the cluster may be in any state
                self._ray.kill(worker.handle)


class _RemoteJob:
    """A worker on the cluster: it calls a job for each task."""

    def __init__(self, job_reference: list[Any]) -> None:
        """Fetch the job."""
        self._job: WorkerJob = _ray().get(job_reference[0])

    def start(self) -> Ready:
        """Return that the worker is set up."""
        return Ready()

    def run(self, task: WorkerTask) -> Done:
        """Run a task."""
        return Done(self._job(task))


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
