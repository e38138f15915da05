"""Executors of clusters: Ray and Slurm call functions on other machines."""

import logging
import os
import secrets
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any

from fleet2d.errors import InputError, errors_as, extra


class RayExecutor(Executor):
    """Calls functions on a Ray cluster, each on one core.

    It joins the cluster at RAY_ADDRESS or on this machine; if there is none, it starts one here.
    """

    def __init__(self, address: str | None = None) -> None:
        """Join the cluster, or start one.

        Args:
            address: The address of the cluster; None: Ray looks for one.

        Raises:
            InputError: Ray is not installed, or the cluster can't be reached.
        """
        with extra("ray", "this needs Ray"):
            import ray
        self._ray = ray
        self._was_joined = ray.is_initialized()
        if not self._was_joined:
            _join(ray, address)
        # Ray retries nothing, as `run_tasks` does.
        self._remote = ray.remote(num_cpus=1, max_retries=0)(_call)

    @property
    def cores(self) -> int:
        """The number of cores that the cluster has now."""
        return int(self._ray.cluster_resources().get("CPU", 0))

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Call a function on the cluster."""
        future: Future[Any] = self._remote.remote(function, args, kwargs).future()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster, which ends all calls; one that was there before stays joined."""
        if not self._was_joined:
            self._ray.shutdown()


def _call(function: Callable[..., Any], args: Any, kwargs: Any) -> Any:
    return function(*args, **kwargs)


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


FOLDER = Path("slurm")  # of the jobs' logs and results, on a disk that all nodes share
ASK_SLURM_EVERY_S = 2.0
GRACE_S = 30.0  # until a job that has left the queue counts as lost: its files may arrive late


class SlurmExecutor(ThreadPoolExecutor):
    """Calls functions as jobs of Slurm, by submitit; a thread waits for each."""

    def __init__(
        self,
        workers: int,
        parameters: Mapping[str, Any] | None = None,
        folder: str | Path = FOLDER,
        cluster: str = "slurm",
    ) -> None:
        """Prepare to submit jobs.

        Args:
            workers: The largest number of jobs at a time.
            parameters: submitit's parameters of a job: timeout_min, mem_gb, slurm_partition, …
            folder: Where to put a new folder of logs and results, on a disk that all nodes share.
            cluster: `slurm`; or `local`, for processes on this machine, to try things out.

        Raises:
            InputError: submitit is missing, there is no Slurm, or it has no such parameter.
        """
        super().__init__(workers, "fleet2d-slurm")
        with extra("slurm", "this needs submitit"):
            import submitit
        logging.getLogger("submitit").setLevel(logging.ERROR)  # it warns at each look otherwise
        self._cluster = cluster
        self._jobs = list[Any]()
        wrong = (RuntimeError, NameError, TypeError, ValueError)
        with errors_as(InputError, "jobs of Slurm can't be submitted", of=wrong):
            # Results come as pickles: in a folder in which nobody can have put any before.
            jobs = Path(folder) / secrets.token_hex(8)
            self._submitit = submitit.AutoExecutor(folder=jobs, cluster=cluster)
            self._submitit.update_parameters(**{"name": "fleet2d", **(parameters or {})})

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Call a function in a job."""
        return super().submit(self._run, function, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Cancel all jobs."""
        for job in self._jobs:
            job.cancel()
        super().shutdown(wait=False, cancel_futures=True)

    def _run(self, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        job = self._submitit.submit(function, *args, **kwargs)
        self._jobs.append(job)
        try:
            seen_s = time.monotonic()
            while not job.done():
                # submitit learns of failures by accounting, which not every cluster has.
                if _is_queued(self._cluster, job.job_id) or _has_result(job):
                    seen_s = time.monotonic()
                if time.monotonic() - seen_s > GRACE_S:
                    raise RuntimeError("its job has left the queue without results")
                time.sleep(ASK_SLURM_EVERY_S)
            return job.result()
        finally:
            self._jobs.remove(job)


def _has_result(job: Any) -> bool:
    return bool(job.paths.result_pickle.exists())


def _is_queued(cluster: str, job: str) -> bool:
    """Return whether a job waits or runs, or may do so: if that is unknown."""
    if cluster != "slurm":
        return True
    queued = _queued_jobs(int(time.monotonic() / ASK_SLURM_EVERY_S))
    return queued is None or job in queued


@lru_cache(maxsize=1)
def _queued_jobs(_: int) -> set[str] | None:
    """Return the numbers of jobs that wait or run, of all threads at a time; None if unknown."""
    command = ("squeue", "--me", "--noheader", "--format=%A")
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    return None if done.returncode else set(done.stdout.split())
