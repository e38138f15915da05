"""Array jobs, run by submitit in processes of this machine: results, failures, and who is cancelled."""

import itertools
import os
import shutil
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from tests.studies.scenes import digests, optional, run, small

from fleet2d.errors import InputError
from fleet2d.studies import cluster_executors
from fleet2d.studies.cluster_executors import SlurmExecutor
from fleet2d.studies.command import slurm_parameters
from fleet2d.studies.executors import Crew, TaskEnd, TaskQueue, WorkerTask, by_home, run_tasks

optional("submitit")
pytestmark = [
    pytest.mark.skipif(
        os.environ.get("FLEET2D_REQUIRE_CLUSTER") != "1",
        reason="every job starts a process: see .ci/cluster",
    ),
    pytest.mark.filterwarnings("ignore"),  # submitit's own
]


@pytest.fixture
def executor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SlurmExecutor:
    monkeypatch.setattr(cluster_executors, "ASK_SLURM_EVERY_S", 0.05)
    return SlurmExecutor(2, folder=tmp_path / "jobs", cluster="local")


def ends_of(executor: SlurmExecutor, job: Any, count: int, workers: int = 2) -> list[TaskEnd]:
    queue = TaskQueue(by_home(WorkerTask(number, number, "") for number in range(count)))
    return list(itertools.chain.from_iterable(run_tasks(Crew(executor, workers), job, queue)))


@dataclass
class Square:
    """Squares the number of a task; ends the process at some, the first time or always."""

    folder: Path
    dies_once: int = -1
    dies_always: int = -1

    def __call__(self, task: WorkerTask) -> int:
        mark = self.folder / "died"
        if task.number == self.dies_always or (task.number == self.dies_once and not mark.exists()):
            mark.touch()
            os._exit(1)
        return task.number**2


def test_a_study_of_array_jobs_has_the_results_of_one_here(
    executor: SlurmExecutor, tmp_path: Path
) -> None:
    counts, study = run(small(replicates=1), tmp_path / "jobs_study", executor)
    _, here = run(small(replicates=1), tmp_path / "here")
    assert 2 == counts.complete
    assert digests(here) == digests(study)


def test_tasks_of_a_job_that_dies_are_run_again(executor: SlurmExecutor, tmp_path: Path) -> None:
    ends = ends_of(executor, Square(tmp_path, dies_once=2), 8, workers=1)
    assert {i: i**2 for i in range(8)} == {end.task.number: end.payload for end in ends}


def test_a_task_whose_job_always_dies_is_lost_and_the_others_are_not(
    executor: SlurmExecutor, tmp_path: Path
) -> None:
    ends = ends_of(executor, Square(tmp_path, dies_always=1), 3)
    (lost,) = (end for end in ends if end.loss is not None)
    assert (1, 3) == (lost.task.number, lost.attempts)
    assert "in each of 3 attempts" in lost.loss
    assert {0: 0, 1: None, 2: 4} == {end.task.number: end.payload for end in ends}


def test_results_are_read_from_a_folder_that_nobody_knew_before(tmp_path: Path) -> None:
    """They are pickles: in a folder that somebody sent, some could wait for the number of a job."""
    one, other = (SlurmExecutor(1, folder=tmp_path, cluster="local") for _ in range(2))
    folders = {Path(each._submitit.folder) for each in (one, other)}
    assert 2 == len(folders)
    assert {tmp_path} == {folder.parent for folder in folders}
    assert not any(path for folder in folders for path in folder.glob("*"))


def test_closing_cancels_what_runs(executor: SlurmExecutor, tmp_path: Path) -> None:
    future = executor.submit(time.sleep, 60)
    while not executor._jobs:
        time.sleep(0.01)
    (job,) = executor._jobs
    executor.shutdown()
    with pytest.raises(Exception, match=r"."):
        future.result(timeout=30)
    assert job.done()


def test_parameters_are_read_and_wrong_ones_refused(tmp_path: Path) -> None:
    assert {"timeout_min": 5, "slurm_partition": "x"} == slurm_parameters(
        ["timeout_min=5", "slurm_partition=x"]
    )
    with pytest.raises(InputError, match="KEY=VALUE"):
        slurm_parameters(["timeout_min"])
    with pytest.raises(InputError, match="can't be submitted"):
        SlurmExecutor(1, {"timeuot": 5}, tmp_path, "local")


@pytest.mark.skipif(shutil.which("srun") is not None, reason="there is Slurm")
def test_without_slurm_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="can't be submitted"):
        SlurmExecutor(1, folder=tmp_path, cluster="slurm")


def test_a_job_that_left_the_queue_without_results_is_lost(
    executor: SlurmExecutor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without accounting, submitit would wait for it for ever."""
    monkeypatch.setattr(cluster_executors, "_is_queued", lambda *_: False)
    monkeypatch.setattr(cluster_executors, "GRACE_S", 0.0)
    (end,) = ends_of(executor, Square(tmp_path), 1)
    assert end.loss is not None
    assert "left the queue without results" in end.loss


def test_a_job_with_results_counts_whatever_the_queue_says(
    executor: SlurmExecutor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_executors, "_is_queued", lambda *_: False)
    (end,) = ends_of(executor, Square(tmp_path), 1)
    assert end.loss is None


def test_jobs_are_found_in_the_queue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    squeue = tmp_path / "squeue"
    squeue.write_text("#!/bin/sh\nprintf '12\\n13\\n'\n")
    squeue.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    assert {"12", "13"} == cluster_executors._queued_jobs(-1)


@dataclass
class SlowSquare:
    """Squares the number of a task in some seconds, and writes down which process does it, where."""

    folder: Path

    def __call__(self, task: WorkerTask) -> int:
        (self.folder / f"process-{task.number}").write_text(
            f"{os.getpid()} {os.environ['SLURMD_NODENAME']}"
        )
        time.sleep(3)
        return task.number**2


def processes(folder: Path) -> list[tuple[int, str]]:
    """The processes and nodes of all tasks that have begun."""
    texts = [file.read_text().split() for file in sorted(folder.glob("process-*"))]
    return [(int(text[0]), text[1]) for text in texts if len(text) == 2]


def kill_a_job(folder: Path) -> None:
    os.kill(processes(folder)[0][0], signal.SIGKILL)


def kill_a_node(folder: Path) -> None:
    node = processes(folder)[0][1]
    daemon = Path(os.environ["SLURM_CONF"]).parent / f"slurmd.{node}.pid"
    os.kill(int(daemon.read_text()), signal.SIGKILL)
    for process, its_node in processes(folder):
        if its_node == node and Path(f"/proc/{process}").exists():
            os.kill(process, signal.SIGKILL)


@pytest.mark.skipif("SLURM_CONF" not in os.environ, reason="needs two nodes: see .ci/cluster")
@pytest.mark.parametrize("kill", [kill_a_job, kill_a_node])
def test_tasks_of_a_killed_job_or_node_of_slurm_are_run_again(
    kill: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a controller and two nodes on this machine; without accounting, as many clusters are."""
    monkeypatch.setattr(cluster_executors, "GRACE_S", 5.0)
    executor = SlurmExecutor(2, {"timeout_min": 5, "slurm_mem": "500M"}, tmp_path / "jobs")

    def wait_and_kill() -> None:
        while not processes(tmp_path):
            time.sleep(0.1)
        kill(tmp_path)

    killer = threading.Thread(target=wait_and_kill, daemon=True)
    killer.start()
    ends = ends_of(executor, SlowSquare(tmp_path), 6)
    killer.join()
    assert {i: i**2 for i in range(6)} == {end.task.number: end.payload for end in ends}
    assert 2 == max(end.attempts for end in ends)
