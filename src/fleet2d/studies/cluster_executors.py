"""Executors of clusters: Ray and Slurm run the tasks of a study on other machines."""

import logging
import os
import secrets
import subprocess
import sys
import time
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from fleet2d.errors import InputError, errors_as, extra
from fleet2d.studies.executors import (
    MAX_ATTEMPTS,
    Broken,
    CrewExecutor,
    Died,
    Done,
    Event,
    FinishedTask,
    LostTask,
    Ready,
    TaskSchedule,
    Worker,
    WorkerJob,
    WorkerTask,
)

ASK_RAY_EVERY_S = 5.0  # for new and lost nodes


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
        for reference in self._ray.wait(list(awaited), timeout=ASK_RAY_EVERY_S)[0]:
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
    environment = {"env_vars": {"PYTHONPATH": paths}}
    try:
        ray.init(address, runtime_env=environment, log_to_driver=False, logging_level="ERROR")
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise InputError(
            f"the Ray cluster can't be joined: {error}; RAY_ADDRESS names it, and without it one"
            " is started here"
        ) from error


def _ray() -> Any:
    with extra("ray", "this needs Ray"):
        import ray
    return ray


FOLDER = Path("slurm")  # of the jobs' logs and results, on a disk that all nodes share
WORKERS = 16
CHUNKS_PER_WORKER = 4  # so that all end at about the same time
MAX_CHUNK = 100  # tasks of a job, whose results arrive together
ASK_SLURM_EVERY_S = 2.0
GRACE_S = 30.0  # until a job that has left the queue counts as lost: its files may arrive late


def run_chunk(job: WorkerJob, tasks: Sequence[WorkerTask]) -> list[Any]:
    """Run some tasks in one job of the cluster; return their results."""
    return [job(task) for task in tasks]


class SlurmExecutor:
    """Runs tasks as array jobs of Slurm, several tasks a job.

    The tasks of a job that fails, or whose node is lost, are submitted again, each as a job of its
    own. When the driver is interrupted, its jobs are cancelled.

    Attributes:
        workers: The largest number of jobs at a time.
    """

    def __init__(
        self,
        workers: int | None = None,
        parameters: Mapping[str, Any] | None = None,
        folder: str | Path = FOLDER,
        cluster: str = "slurm",
    ) -> None:
        """Prepare to submit jobs.

        Args:
            workers: The largest number of jobs at a time; None: 16.
            parameters: submitit's parameters of a job: timeout_min, mem_gb, slurm_partition, …
            folder: Where to put a new folder of logs and results, on a disk that all nodes share.
            cluster: `slurm`; or `local`, for processes on this machine, to try things out.

        Raises:
            InputError: submitit is missing, there is no Slurm, or it has no such parameter.
        """
        with extra("slurm", "this needs submitit"):
            import submitit
        logging.getLogger("submitit").setLevel(logging.ERROR)  # it warns at each look otherwise
        self.workers = workers or WORKERS
        self._cluster = cluster
        self._missing: dict[str, float] = {}
        self._attempts: dict[int, int] = {}
        wrong = (RuntimeError, NameError, TypeError, ValueError)
        with errors_as(InputError, "jobs of Slurm can't be submitted", of=wrong):
            # Results come as pickles: in a folder in which nobody can have put any before.
            jobs = Path(folder) / secrets.token_hex(8)
            self._executor = submitit.AutoExecutor(folder=jobs, cluster=cluster)
            self._executor.update_parameters(
                **{"name": "fleet2d", "slurm_array_parallelism": self.workers, **(parameters or {})}
            )

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        """Yield an event for each task as its job ends; closing the iterator cancels all jobs."""
        self._attempts = {}
        retries: list[list[WorkerTask]] = []
        running: dict[Any, list[WorkerTask]] = {}
        try:
            while chunks := [*retries, *self._chunks(tasks, len(running))] or running:
                if chunks is not running:
                    jobs = self._executor.map_array(partial(run_chunk, job), chunks)
                    running |= zip(jobs, chunks, strict=True)
                    retries = []
                for ended in self._ended(running):
                    chunk = running.pop(ended)
                    try:
                        if ended.job_id in self._missing and not _has_result(ended):
                            raise RuntimeError("it has left the queue without results")
                        payloads = ended.result()
                    except Exception as error:  # noqa: BLE001 - a job may fail in any way
                        yield from self._lost(chunk, error, retries)
                        continue
                    for task, payload in zip(chunk, payloads, strict=True):
                        yield FinishedTask(task, payload, self._attempts.get(task.number, 0) + 1)
                if running and not retries:
                    time.sleep(ASK_SLURM_EVERY_S)
        finally:
            for each in running:
                each.cancel()

    def _ended(self, running: Mapping[Any, Any]) -> list[Any]:
        """Return the jobs that have ended, with results or without."""
        ended = [job for job in running if job.done()]
        # submitit learns of failures by accounting, which not every cluster has.
        if ended or (queued := _queued_jobs(self._cluster)) is None:
            return ended
        now_s = time.monotonic()
        for job in running:
            if job.job_id in queued or _has_result(job):
                self._missing.pop(job.job_id, None)
            elif now_s - self._missing.setdefault(job.job_id, now_s) > GRACE_S:
                ended.append(job)
        return ended

    def _chunks(self, tasks: TaskSchedule, running: int) -> list[list[WorkerTask]]:
        """Take all tasks that are there, in chunks, unless enough jobs wait already."""
        if running >= self.workers * CHUNKS_PER_WORKER:
            return []
        size = min(max(len(tasks) // (self.workers * CHUNKS_PER_WORKER), 1), MAX_CHUNK)
        chunks: list[list[WorkerTask]] = []
        while tasks:
            chunk: list[WorkerTask] = []
            while len(chunk) < size and (task := tasks.take("slurm")) is not None:
                chunk.append(task)
            chunks.append(chunk)
        return chunks

    def _lost(
        self, chunk: list[WorkerTask], error: Exception, retries: list[list[WorkerTask]]
    ) -> Generator[LostTask]:
        """Let the tasks of a failed job be run again; yield those that failed too often."""
        reason = str(error).strip().splitlines()[-1:] or [type(error).__name__]
        for task in chunk:
            attempt = self._attempts.get(task.number, 0) + (len(chunk) == 1)
            self._attempts[task.number] = attempt
            if attempt == MAX_ATTEMPTS:
                text = f"its job failed in each of {MAX_ATTEMPTS} attempts: {reason[0]}"
                yield LostTask(task, text, MAX_ATTEMPTS)
            else:
                retries.append([task])


def _has_result(job: Any) -> bool:
    return bool(job.paths.result_pickle.exists())


def _queued_jobs(cluster: str) -> set[str] | None:
    """Return the numbers of jobs that wait or run; None if unknown.

    A job of an array is called 12_3, a job of its own 12, which squeue prints as 12_N/A.
    """
    if cluster != "slurm":
        return None
    command = ("squeue", "--me", "--noheader", "--array", "--format=%F_%K")
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    return None if done.returncode else set(done.stdout.replace("_N/A", "").split())
