"""Schedules: variants of tasks home go to tasks worker, and everybody is busy to the end."""

from fleet2d.studies.executors import TaskSchedule, WorkerTask


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
