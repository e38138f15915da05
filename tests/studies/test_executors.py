"""Executors: a home has one worker, all are busy to the end, and dead ones are replaced."""

import os
import signal
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

from fleet2d.errors import InputError
from fleet2d.studies.executors import FinishedTask, LocalExecutor, TaskSchedule, WorkerTask


def schedule(homes: str) -> TaskSchedule:
    return TaskSchedule(WorkerTask(i, i, "", home) for i, home in enumerate(homes))


def homes_of(tasks: TaskSchedule, *workers: str) -> list[str]:
    homes = []
    for worker in workers:
        task = tasks.take(worker)
        homes.append("-" if task is None else task.home)
    return homes


def test_a_worker_stays_with_a_home() -> None:
    assert ["a", "b", "a", "b", "a"] == homes_of(schedule("ababab"), "x", "y", "x", "y", "x")


def test_a_worker_without_a_home_helps_with_the_largest() -> None:
    assert ["a", "a", "a", "-"] == homes_of(schedule("aaa"), "x", "y", "x", "y")


def test_what_a_dead_worker_held_is_next() -> None:
    tasks = schedule("ab")
    task = tasks.take("x")
    assert task is not None
    tasks.leave("x")
    tasks.put_back(task)
    assert 2 == len(tasks)
    assert ["a", "b", "-"] == homes_of(tasks, "y", "y", "y")


def test_an_empty_schedule_is_false() -> None:
    tasks = schedule("a")
    assert tasks
    homes_of(tasks, "x")
    assert not tasks


# --- Worker processes ------------------------------------------------------------------------------


class DiesWhileSending:
    """A job whose first call ends its process in the middle of its results."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __call__(self, task: WorkerTask) -> bytes:
        if not self.mark.exists():
            self.mark.touch()
            Connection._send = _send_some_and_die  # type: ignore[attr-defined]
        return bytes(1_000_000)


def _send_some_and_die(connection: Any, content: bytes, write: Any = None) -> None:
    os.write(connection.fileno(), content[:1000])
    os.kill(os.getpid(), signal.SIGKILL)


class CannotBeLoaded:
    """A job that raises an error where it is loaded."""

    def __reduce__(self) -> tuple[Any, ...]:
        return int, ("no job",)


@pytest.mark.slow
def test_a_worker_killed_while_it_sends_its_results_is_replaced(tmp_path: Path) -> None:
    """A `concurrent.futures.ProcessPoolExecutor` waits for ever for such a worker."""
    job = DiesWhileSending(tmp_path / "mark")
    events = list(LocalExecutor(1).run(job, schedule("aa")))
    assert [2, 1] == [event.attempts for event in events]
    assert all(isinstance(event, FinishedTask) for event in events)


def test_a_job_that_no_worker_can_load_is_an_error_with_its_traceback() -> None:
    job: Any = CannotBeLoaded()
    with pytest.raises(InputError, match=r"can't be set up(.|\n)*'no job'"):
        list(LocalExecutor(1).run(job, schedule("a")))


@pytest.mark.slow
def test_a_worker_with_much_memory_is_replaced_between_two_tasks() -> None:
    events = list(LocalExecutor(1, memory_mb=1.0).run(pid_of, schedule("aaa")))
    pids = [event.payload for event in events if isinstance(event, FinishedTask)]
    assert 3 > len(set(pids)) > 1  # each had two tasks at once
    assert 3 == len(pids)


def pid_of(task: WorkerTask) -> int:
    return os.getpid()
