"""Tasks on executors: those of a home go together, and those of dead workers are run again."""

import gc
import itertools
import os
import platform
import signal
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.studies.scenes import CountingExecutor

from fleet2d.errors import ComponentError, InputError
from fleet2d.runtime.memory import OBJECTS
from fleet2d.studies import executors
from fleet2d.studies.executors import (
    MAX_BATCH,
    Crew,
    LocalExecutor,
    SerialExecutor,
    TaskEnd,
    TaskQueue,
    WorkerTask,
    by_home,
    run_tasks,
)


def queue(homes) -> TaskQueue:
    return TaskQueue(by_home(WorkerTask(i, i, "", home) for i, home in enumerate(homes)))


def homes_of(tasks: TaskQueue, workers):
    calls = []
    while tasks:
        calls.append("".join(task.home for task in tasks.take(workers)))
    return calls


def ends_of(crew: Crew, job, homes) -> list[TaskEnd]:
    with crew.executor:
        return list(itertools.chain.from_iterable(run_tasks(crew, job, queue(homes))))


@pytest.mark.parametrize(
    ("homes", "calls"),
    [
        ("abcabcabc", ["aaa", "bbb", "cc", "c"]),  # those of the last home are shared
        ("aaaaaaaa", ["aaaa", "aa", "a", "a"]),
        ("abcdef", ["abc", "de", "f"]),
    ],
)
def test_a_worker_gets_the_tasks_of_a_home_together(homes, calls):
    assert calls == homes_of(queue(homes), workers=2)


def test_tasks_are_made_when_they_are_taken():
    made = []
    group = (made.append(i) or WorkerTask(i, i, "") for i in range(300))
    TaskQueue([(300, group)]).take(1)
    assert list(range(MAX_BATCH)) == made


def test_what_a_dead_worker_held_is_next():
    tasks = queue("ab")
    tasks.put_back(tasks.take(2))
    assert ["a", "b"] == homes_of(tasks, workers=2)


def test_results_come_after_a_while_and_the_rest_is_run_then():
    executor = CountingExecutor()
    ends = ends_of(Crew(executor, batch_s=0.0), str, "aab")
    assert ([0, 1, 2], 3) == (executor.ran, len(ends))
    together = CountingExecutor()
    ends_of(Crew(together, batch_s=60.0), str, "aab")
    assert [0] == together.ran  # the first of each call


def test_an_executor_of_ones_own_runs_tasks():
    with ThreadPoolExecutor(2) as threads:
        ends = run_tasks(Crew(threads, 2), number_of, queue("aab"))
        assert {0, 1, 2} == {end.payload for end in itertools.chain.from_iterable(ends)}
        assert 4 == threads.submit(pow, 2, 2).result()  # it stays open


def test_a_task_that_fails_each_time_is_lost_and_the_others_are_not():
    ends = ends_of(Crew(SerialAsElsewhere()), fails_at_1, "aaa")
    assert {0: 0, 1: None, 2: 2} == {end.task.number: end.payload for end in ends}
    (loss,) = (end for end in ends if end.loss is not None)
    assert (3, "number 1 in each of 3 attempts") == (loss.attempts, loss.loss)


def test_a_broken_executor_is_told():
    class Broken(SerialExecutor):
        def submit(self, *args, **kwargs):
            raise BrokenExecutor("a process died")

    with pytest.raises(ComponentError, match=r"broken: a process died; with a new one the same"):
        ends_of(Crew(Broken()), str, "a")


class SerialAsElsewhere(SerialExecutor):
    """Puts errors into futures, as other executors do."""

    def submit(self, function, /, *args, **kwargs) -> Future[Any]:
        try:
            return super().submit(function, *args, **kwargs)
        except ValueError as error:
            future = Future()
            future.set_exception(error)
            return future


def collects_after(task: WorkerTask):
    return gc.get_threshold()[0]


def new_pages_of_an_array(task: WorkerTask):
    import resource

    faults = [
        resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(2)
        if np.ones(2_500_000).all()
    ]
    return faults[1] - faults[0]


def test_garbage_is_collected_rarely_in_tasks():
    usual = gc.get_threshold()

    (end,) = ends_of(Crew(SerialExecutor()), collects_after, "a")

    assert end.payload == OBJECTS
    assert usual == gc.get_threshold()


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
def test_workers_keep_the_memory_of_freed_arrays_for_the_next_ones():
    with LocalExecutor(1) as executor:
        (end,) = ends_of(Crew(executor), new_pages_of_an_array, "a")

    assert end.payload < 500


def number_of(task: WorkerTask):
    return task.number


def fails_at_1(task: WorkerTask):
    if task.number == 1:
        raise ValueError("number 1")
    return task.number


# --- Worker processes ------------------------------------------------------------------------------


class DiesWhileSending:
    """A job whose first call ends its process in the middle of its results."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __call__(self, task: WorkerTask):
        if not self.mark.exists():
            self.mark.touch()
            Connection._send = _send_some_and_die
        return bytes(1_000_000)


def _send_some_and_die(connection, content, write=None):
    os.write(connection.fileno(), content[:1000])
    os.kill(os.getpid(), signal.SIGKILL)


class CannotBeLoaded:
    """A job that raises an error where it is loaded."""

    def __reduce__(self):
        return int, ("no job",)


@pytest.mark.slow
def test_a_worker_killed_while_it_sends_its_results_is_replaced(tmp_path):
    """A `concurrent.futures.ProcessPoolExecutor` waits for ever for such a worker."""
    job = DiesWhileSending(tmp_path / "mark")
    ends = ends_of(Crew(LocalExecutor(1)), job, "ab")
    assert [2, 2] == [end.attempts for end in ends]  # both were with the worker
    assert all(len(end.payload) == 1_000_000 for end in ends)


def test_a_job_that_no_worker_can_load_is_an_error_with_its_traceback():
    job = CannotBeLoaded()
    with pytest.raises(InputError, match=r"can't be set up(.|\n)*'no job'"):
        ends_of(Crew(LocalExecutor(1)), job, "a")


@pytest.mark.slow
def test_a_worker_with_much_memory_is_replaced_between_two_calls():
    ends = ends_of(Crew(LocalExecutor(1, memory_mb=1.0), batch_s=0.0), pid_of, "abc")
    assert 3 == len({end.payload for end in ends})


@pytest.mark.slow
def test_memory_is_shared_among_processes_that_there_are(monkeypatch):
    """With 99 workers for eight runs each process was replaced after each call."""
    monkeypatch.setattr(executors, "_memory_mb", lambda: 2_000.0)

    ends = ends_of(Crew(LocalExecutor(99), workers=1, batch_s=0.0), pid_of, "abc")

    assert 1 == len({end.payload for end in ends})


def pid_of(task: WorkerTask):
    return os.getpid()
