"""Schedules: variants of one home go to one worker, and everybody is busy to the end."""

from fleet2d.studies.record import Task
from fleet2d.studies.schedule import Schedule


def schedule(homes: str) -> Schedule:
    return Schedule(Task(i, i, "", home) for i, home in enumerate(homes))


def taken(one: Schedule, *workers: str) -> list[str]:
    found = []
    for worker in workers:
        task = one.take(worker)
        found.append("-" if task is None else task.home)
    return found


def test_a_worker_stays_with_a_home() -> None:
    assert ["a", "b", "a", "b", "a"] == taken(schedule("ababab"), "x", "y", "x", "y", "x")


def test_a_worker_without_a_home_helps_with_the_largest() -> None:
    assert ["a", "a", "a", "-"] == taken(schedule("aaa"), "x", "y", "x", "y")


def test_what_a_dead_worker_held_is_next() -> None:
    one = schedule("ab")
    task = one.take("x")
    assert task is not None
    one.leave("x")
    one.put_back(task)
    assert 2 == len(one)
    assert ["a", "b", "-"] == taken(one, "y", "y", "y")


def test_an_empty_schedule_is_false() -> None:
    one = schedule("a")
    assert one
    taken(one, "x")
    assert not one
