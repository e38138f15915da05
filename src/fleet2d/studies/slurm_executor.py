"""Workers on a Slurm cluster: array jobs, submitted by submitit."""

import logging
import subprocess
import time
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet2d.errors import InputError, extra
from fleet2d.studies.executors import (
    MAX_ATTEMPTS,
    Event,
    FinishedTask,
    LostTask,
    TaskSchedule,
    WorkerJob,
    WorkerTask,
)

FOLDER = Path("slurm")  # of the jobs' logs and results, on a disk that all nodes share
WORKERS = 16
CHUNKS_PER_WORKER = 4  # so that all end at about the same time
MAX_CHUNK = 100  # tasks of a job, whose results arrive together
LOOK_EVERY_S = 2.0
GRACE_S = 30.0  # until a job that has left the queue counts as lost: its files may arrive late


@dataclass
class ChunkJob:
    """Runs some tasks in one job of the cluster."""

    job: WorkerJob

    def __call__(self, tasks: Sequence[WorkerTask]) -> list[Any]:
        """Return the results of the tasks."""
        return [self.job(task) for task in tasks]


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
            folder: The folder of logs and results, on a disk that all nodes share.
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
        try:
            self._executor = submitit.AutoExecutor(folder=str(folder), cluster=cluster)
            self._executor.update_parameters(
                **{"name": "fleet2d", "slurm_array_parallelism": self.workers, **(parameters or {})}
            )
        except (RuntimeError, NameError, TypeError, ValueError) as error:
            raise InputError(f"jobs of Slurm can't be submitted: {error}") from error

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        """Yield an event for each task as its job ends; closing the iterator cancels all jobs."""
        attempts: dict[int, int] = {}
        retries: list[list[WorkerTask]] = []
        running: dict[Any, list[WorkerTask]] = {}
        try:
            while chunks := [*retries, *self._chunks(tasks, len(running))] or running:
                if chunks is not running:
                    jobs = self._executor.map_array(ChunkJob(job), chunks)
                    running |= zip(jobs, chunks, strict=True)
                    retries = []
                for ended in self._ended(running):
                    chunk = running.pop(ended)
                    try:
                        if ended.job_id in self._missing:
                            raise RuntimeError("it has left the queue without results")
                        payloads = ended.result()
                    except Exception as error:  # noqa: BLE001 - a job may fail in any way
                        yield from self._lost(chunk, error, attempts, retries)
                        continue
                    for task, payload in zip(chunk, payloads, strict=True):
                        attempt = attempts.get(task.number, 0) + 1
                        yield FinishedTask(task, payload, attempt)
                if running and not retries:
                    time.sleep(LOOK_EVERY_S)
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
            if job.job_id in queued or job.paths.result_pickle.exists():
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
        self,
        chunk: list[WorkerTask],
        error: Exception,
        attempts: dict[int, int],
        retries: list[list[WorkerTask]],
    ) -> Generator[LostTask]:
        """Let the tasks of a failed job be run again; yield those that failed too often."""
        reason = str(error).strip().splitlines()[-1:] or [type(error).__name__]
        for task in chunk:
            attempts[task.number] = attempts.get(task.number, 0) + (len(chunk) == 1)
            if attempts[task.number] == MAX_ATTEMPTS:
                text = f"its job failed in each of {MAX_ATTEMPTS} attempts: {reason[0]}"
                yield LostTask(task, text, MAX_ATTEMPTS)
            else:
                retries.append([task])


def _queued_jobs(cluster: str) -> set[str] | None:
    """Return the numbers of jobs that wait or run; None if unknown."""
    if cluster != "slurm":
        return None
    command = ("squeue", "--me", "--noheader", "--array", "--format=%F_%K")
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    return None if done.returncode else set(done.stdout.split())
