"""The sightings of a camera: what errors read of them, draw for them and change."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from tests.sight.sightings import sightings

import fleet2d
from fleet2d.kernels import random_bell
from fleet2d.runtime.determinism import stream_key
from fleet2d.runtime.local_time import zone_of
from fleet2d.sight.perception_error import PerceptionError

AT = np.linspace(0, 5, 7)


def test_only_what_is_replaced_changes():
    seen = sightings(AT, AT)
    other = seen.replace(heading=1, noticed=np.arange(7) % 2 == 0)
    assert [1.0] * 7 == other.heading.tolist()
    assert [True, False] * 3 + [True] == other.noticed.tolist()
    assert seen.x is other.x
    assert seen.noticed.all()
    assert len(seen) == len(other) == 7


def test_arrays_are_read_only():
    seen = sightings(AT, AT).replace(heading=AT)
    for array in (seen.x, seen.heading, seen.true_user, seen.camera_x):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_what_is_given_stays_writable_and_is_not_shared():
    mine = np.zeros(7)
    seen = sightings(AT, AT).replace(heading=mine)
    mine[0] = 5
    assert 0 == seen.heading[0]


def test_moving_turns_stretches_and_shifts():
    seen = sightings([2.0, 1.0], [0.0, 1.0], camera=(1.0, 0.0))
    moved = seen.moved(turn_deg=[90, -90], scale=2, offset=[0, 1])
    np.testing.assert_allclose([1.0, 4.0], moved.x, atol=1e-9)
    np.testing.assert_allclose([2.0, 0.0], moved.y, atol=1e-9)
    np.testing.assert_allclose([2.0, 3.0], moved.distance)


def test_who_is_at_the_camera_stays_there():
    moved = sightings([1.0], [1.0], camera=(1.0, 1.0)).moved(turn_deg=30, offset=1)
    assert (1.0, 1.0) == (moved.x[0], moved.y[0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"x": np.inf},
            "x is inf for the look at step 0: expected a number from -10,000 to 10,000 m",
        ),
        ({"y": [0, 0, 1e5, 0, 0, 0, 0]}, "y is 100000 for the look at step 2"),
        (
            {"x": np.zeros((7, 2))},
            r"x has the shape \(7, 2\): expected \(7,\), an element for each",
        ),
        ({"x": 1j}, "x holds complex128: expected numbers"),
        ({"heading": True}, "heading holds bool: expected numbers"),
        ({"user": 0.0}, "user holds float64: expected integers"),
        ({"user": -2}, "user is -2 for the look at step 0: expected -1 to 2"),
        (
            {"posture": [0, 1, 2, 3, 0, 0, 0]},
            "posture is 3 for the look at step 3: expected 0 to 2",
        ),
        ({"noticed": 1}, "noticed holds int64: expected true and false"),
    ],
)
def test_wrong_values_are_refused(change, message):
    with pytest.raises(fleet2d.ComponentError, match=message):
        sightings(AT, AT).replace(**change)


def test_draws_are_addressed_by_purpose_person_step_and_error():
    people = np.array([0, 1, 0, 1, 0, 1, 0])
    seen, twin = (sightings(AT, AT, true_user=people) for _ in range(2))
    first = seen.uniform("a")
    np.testing.assert_array_equal(first, seen.uniform("a"))
    np.testing.assert_array_equal(first, twin.uniform("a"))
    others = [
        seen.uniform("b"),
        sightings(AT, AT, true_user=people, name="camera: errors.f").uniform("a"),
        sightings(AT, AT, true_user=people, seed=2).uniform("a"),
        sightings(AT, AT, true_user=people, step=np.arange(7) + 7).uniform("a"),
    ]
    for other in others:
        assert not np.isin(first, other).any()
    part = sightings(AT[3:], AT[3:], true_user=people[3:], step=np.arange(3, 7))
    np.testing.assert_array_equal(first[3:], part.uniform("a"))
    assert ((first >= 0) & (first < 1)).all()


def test_draws_may_last_and_may_be_shared():
    seen = sightings(AT, AT, true_user=[0, 1, 0, 1, 0, 1, 0], step=[0, 0, 1, 1, 2, 2, 3])
    lasting = seen.uniform("a", at=seen.step // 2)
    assert lasting[0] == lasting[2] != lasting[4] == lasting[6]
    assert lasting[0] != lasting[1]
    shared = seen.uniform("a", shared=True)
    assert shared[0] == shared[1] != shared[2]
    assert 1 == len(set(seen.bell("b", at=0, shared=True).tolist()))
    np.testing.assert_array_equal(lasting, seen.uniform("a", at=seen.step * 0.5))


def test_false_positives_of_one_look_have_draws_of_their_own():
    seen = sightings(AT, AT, true_user=[-1, -1, -1, 0, -1, -1, 0], step=[0, 0, 0, 0, 1, 1, 1])
    assert 7 == len(set(seen.uniform("a").tolist()))
    part = sightings(AT[4:], AT[4:], true_user=[-1, -1, 0], step=[1, 1, 1])
    np.testing.assert_array_equal(seen.uniform("a")[4:], part.uniform("a"))


def test_bell_shaped_draws_are_those_of_the_core():
    seen = sightings(np.zeros(5000), np.zeros(5000))
    draws = seen.bell("a")
    key = stream_key(1, "robots.r", "camera: errors.e: a: ana")
    expected = [random_bell(key, step) / 209.0215299915 for step in range(20)]
    np.testing.assert_array_equal(expected, draws[:20])
    assert abs(draws.mean()) < 4.5 / np.sqrt(5000)
    assert abs(draws.std() - 1) < 4.5 / np.sqrt(10_000)


def test_a_class_without_distort_is_refused():
    with pytest.raises(TypeError, match="distort"):
        PerceptionError()


def test_hour_is_the_time_of_day_also_after_midnight():
    late = sightings([1.0, 1.0, 1.0], [0.0, 0.0, 0.0], step=[0, 1800, 2 * 3600])

    assert [23.0, 23.5, 1.0] == late.hour.tolist()


def test_hour_is_what_the_clock_reads_also_where_it_is_changed():
    zone = zone_of("Europe/Berlin", datetime(2026, 10, 24), datetime(2026, 10, 26))
    late = sightings([1.0, 1.0, 1.0], [0.0, 0.0, 0.0], step=[0, 3 * 3600, 4 * 3600])

    at = replace(late, start=zone.at(datetime(2026, 10, 25)))
    assert [0.0, 2.0, 3.0] == at.hour.tolist()
