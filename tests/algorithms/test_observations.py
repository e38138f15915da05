"""What users do and what it is taken for, against a count row by row."""

import numpy as np
from tests.sight.watching import agree

from fleet2d.algorithms.observations import ROBOT, Activities, ActivitySense
from fleet2d.kernels import SightingColumn as Column

KEYS = np.array([3, 4], np.uint64)
CONFUSION = {"cook": {"bake": 0.5, "read": 0.2}, "sleep": {"rest": 1.0}}


def rows(steps, user=0, robot=0, camera=0):
    observations = np.zeros((len(steps), ROBOT + 1), np.int64)
    (
        observations[:, Column.STEP],
        observations[:, Column.USER],
        observations[:, ROBOT],
        observations[:, Column.CAMERA],
    ) = steps, user, robot, camera
    return observations


def activities(latency=0):
    """Two users, and a robot of which the second camera doesn't tell activities."""
    senses = {
        (0, 0): ActivitySense(latency, KEYS, CONFUSION),
        (0, 1): ActivitySense(0, KEYS, None),
    }
    result = Activities(2, senses)
    result.begin(0, 10, "cook")
    result.begin(0, 20, "sleep")
    result.begin(0, 20, "read")  # at once: the last counts
    result.begin(1, 5, "sleep")
    return result


def test_the_true_activity_is_the_last_that_began_before_the_look():
    true = activities().true(rows([9, 10, 19, 20, 99]))
    assert [None, "cook", "cook", "read", "read"] == true.tolist()
    late = activities(latency=3).true(rows([12, 13, 22, 23]))
    assert [None, "cook", "cook", "read"] == late.tolist()


def test_activities_are_confused_at_the_configured_rates():
    one_user = Activities(1, {(0, 0): ActivitySense(0, KEYS, CONFUSION)})
    one_user.begin(0, 0, "cook")
    perceived = one_user.perceived(rows(list(range(20_000))))
    for name, share in (("bake", 0.5), ("read", 0.2), ("cook", 0.3), ("rest", 0.0)):
        assert agree(perceived == name, share)


def test_perceived_activities_do_not_depend_on_other_queries():
    every = list(range(5, 60))
    whole = activities().perceived(rows(every)).tolist()
    assert whole == [activities().perceived(rows([step])).tolist()[0] for step in every]


def test_each_user_has_an_activity_and_nobody_has_none():
    two_users = activities()
    assert ["rest"] == two_users.perceived(rows([10], user=1)).tolist()
    assert [None] == two_users.perceived(rows([10], user=-1)).tolist()
    assert [None] == two_users.true(rows([10], user=-1)).tolist()


def test_a_camera_that_does_not_tell_activities_has_only_the_truth():
    there = rows([10], camera=1)
    assert [None] == activities().perceived(there).tolist()
    assert ["cook"] == activities().true(there).tolist()


def test_activities_that_no_camera_perceives_are_not_computed():
    one_user = Activities(1, {(0, 0): ActivitySense(0, KEYS, None)})
    one_user.begin(0, 0, "cook")
    assert not one_user.are_perceived
    assert [None] == one_user.true(rows([5])).tolist()
    assert 0 == len(activities().perceived(rows([])))
