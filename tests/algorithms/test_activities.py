"""What users do and what it is taken for, against a count row by row."""

import numpy as np
from tests.sight.watching import agree

from fleet2d.algorithms.activities import ROBOT, Activities, ActivitySense
from fleet2d.kernels.look import CAMERA, STEP, USER

KEYS = np.array([3, 4], np.uint64)
CONFUSION = {"cook": {"bake": 0.5, "read": 0.2}, "sleep": {"rest": 1.0}}


def rows(steps: list[int], user: int = 0, robot: int = 0, camera: int = 0) -> np.ndarray:
    found = np.zeros((len(steps), ROBOT + 1), np.int64)
    found[:, STEP], found[:, USER], found[:, ROBOT], found[:, CAMERA] = steps, user, robot, camera
    return found


def activities(latency: int = 0) -> Activities:
    """Two users, and a robot of which the second camera doesn't tell activities."""
    senses = {
        (0, 0): ActivitySense(latency, KEYS, CONFUSION),
        (0, 1): ActivitySense(0, KEYS, None),
    }
    made = Activities(2, senses)
    made.begin(0, 10, "cook")
    made.begin(0, 20, "sleep")
    made.begin(0, 20, "read")  # at once: the last counts
    made.begin(1, 5, "sleep")
    return made


def test_what_is_done_is_what_began_last_at_the_look() -> None:
    found = activities().true(rows([9, 10, 19, 20, 99]))
    assert [None, "cook", "cook", "read", "read"] == found.tolist()
    late = activities(latency=3).true(rows([12, 13, 22, 23]))
    assert [None, "cook", "cook", "read"] == late.tolist()


def test_each_activity_is_taken_for_others_as_often_as_told() -> None:
    made = Activities(1, {(0, 0): ActivitySense(0, KEYS, CONFUSION)})
    made.begin(0, 0, "cook")
    found = made.perceived(rows(list(range(20_000))))
    for name, share in (("bake", 0.5), ("read", 0.2), ("cook", 0.3), ("rest", 0.0)):
        assert agree(found == name, share)


def test_what_is_perceived_at_a_step_does_not_depend_on_what_else_is_asked() -> None:
    every = list(range(5, 60))
    whole = activities().perceived(rows(every)).tolist()
    assert whole == [activities().perceived(rows([step])).tolist()[0] for step in every]


def test_users_are_told_apart_and_nobody_does_nothing() -> None:
    made = activities()
    assert ["rest"] == made.perceived(rows([10], user=1)).tolist()
    assert [None] == made.perceived(rows([10], user=-1)).tolist()
    assert [None] == made.true(rows([10], user=-1)).tolist()


def test_a_camera_that_does_not_tell_activities_has_only_the_truth() -> None:
    there = rows([10], camera=1)
    assert [None] == activities().perceived(there).tolist()
    assert ["cook"] == activities().true(there).tolist()


def test_where_no_camera_tells_them_nothing_is_worked_out() -> None:
    made = Activities(1, {(0, 0): ActivitySense(0, KEYS, None)})
    made.begin(0, 0, "cook")
    assert not made.are_perceived
    assert [None] == made.true(rows([5])).tolist()
    assert 0 == len(activities().perceived(rows([])))
