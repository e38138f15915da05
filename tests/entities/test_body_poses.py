"""Bodies of a run: where each is at which step, and when it decides."""

import pickle

import numpy as np
import pytest

from fleet2d.engine import state
from fleet2d.entities.body import NEVER, Bodies, Pose, Track
from fleet2d.kernels import Breakpoints

SECOND = 1_000_000


def planned(*ways, posture=0, postures=()):
    """Return a motion by breakpoints (time [s], x), and postures from times [s] on."""
    times = np.array([round(seconds * SECOND) for seconds, _ in ways], np.int64)
    x = np.array([x for _, x in ways], np.int64)
    zero = np.zeros_like(x)
    track = Track(Breakpoints(times, x, zero, zero, zero.astype(np.uint8)), SECOND)
    changes = np.array([round(seconds * SECOND) for seconds, _ in postures], np.int64)
    codes = np.array([posture, *(code for _, code in postures)], np.int8)
    return track, Pose(ways[0][1], 0, 0, 0), (changes, codes)


def bodies_at(*xs):
    """Return bodies that rest at x = …, one user and the rest robots."""
    bodies = Bodies(1, len(xs) - 1, SECOND)
    for row, x in enumerate(xs):
        bodies.hold(row, Pose(x, 0, 0, 0))
    return bodies


@pytest.mark.parametrize(
    ("actors", "capacity"),
    [(0, 1 << 16), (1, 1 << 16), (32, 1 << 16), (64, 1 << 15), (10**4, 1 << 12)],
)
def test_watchers_take_in_fewer_steps_the_more_bodies_there_are_but_never_few(actors, capacity):
    assert capacity == state.capacity_of(actors)
    assert state.MIN_STEPS <= capacity <= state.MAX_STEPS


def test_a_plan_holds_from_the_present_step_on():
    bodies = bodies_at(5, 7)
    bodies.step = 3
    assert [7] * 6 == bodies.block(0, 6).x[1].tolist()
    bodies.follow(1, *planned((0, 20), (10, 30)))
    assert [7, 7, 7, 23, 24, 25] == bodies.block(0, 6).x[1].tolist()
    bodies.hold(1, Pose(1, 2, 3, 1))
    assert [7, 7, 7, 1, 1, 1] == bodies.block(0, 6).x[1].tolist()
    assert Pose(1, 2, 3, 1) == bodies.pose_at(1, bodies.step)


def test_who_is_due_is_whose_step_has_come():
    bodies = bodies_at(5, 7, 9)
    assert [0, 1, 2] == bodies.due(0)
    bodies.ask_at[:] = 30, NEVER, 20
    assert 20 == bodies.next_decision()
    assert [] == bodies.due(19)
    assert [2] == bodies.due(29)
    assert [0, 2] == bodies.due(30)
    assert NEVER == Bodies(0, 0, SECOND).next_decision()


def test_bodies_are_written_without_what_follows_and_read_the_same():
    bodies = bodies_at(5, 7)
    bodies.follow(1, *planned((0, 7), (400, 5000)))
    small = len(pickle.dumps(bodies))
    before = [column.tolist() for column in bodies.block(0, 400)]
    assert small == len(pickle.dumps(bodies))
    again = pickle.loads(pickle.dumps(bodies))
    assert before == [column.tolist() for column in again.block(0, 400)]
    assert (bodies.step, bodies.users, bodies.ask_at.tolist()) == (
        again.step, again.users, again.ask_at.tolist()
    )  # fmt: skip


def test_what_is_forgotten_is_no_longer_told():
    bodies = bodies_at(5, 7)
    bodies.step = 4
    bodies.follow(1, *planned((4, 20)))
    bodies.forget(4)
    assert [20] == bodies.block(4, 5).x[1].tolist()
    with pytest.raises(ValueError, match="forgotten"):
        bodies.pose_at(1, 3)
