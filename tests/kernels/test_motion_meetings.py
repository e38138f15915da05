"""When bodies come too near to each other, against looking at many moments of each step."""

import copy

import numpy as np
from tests.kernels.scenes import STANDING, breakpoints, following
from tests.reference.meetings import first_meeting
from tests.thorough import examples

from fleet2d.kernels import Distances

SECOND = 10**6
STEPS = 30
NEAR = 400


def random_track(random, size):
    """A track of a few legs and rests between whole steps, and where it is at a moment."""
    times = np.sort(random.choice(STEPS, 6, replace=False)).astype(np.int64)
    points = random.integers(0, size, (6, 2))
    points[2] = points[1]
    rows = np.column_stack([times * SECOND, points, np.zeros((6, 2), np.int64)])
    return breakpoints(rows), lambda t: tuple(
        float(np.interp(t, times, points[:, k])) for k in (0, 1)
    )


def distances(rows, lead=0, counts=0):
    whole = np.ones((rows, 2), np.int64)
    return Distances(whole * lead, whole * NEAR, whole * 0, np.full((rows, 2), counts, np.uint8))


def test_meetings_are_those_seen_at_many_moments():
    random = np.random.default_rng(7)
    met = 0
    cases = examples(150)
    for case in range(cases):
        (one, way), (other, others_way) = (random_track(random, 3000) for _ in range(2))
        timelines = following([one, other])
        first = case % 5
        expected = first_meeting(way, others_way, NEAR, first, STEPS)
        found = timelines.meetings(np.array([0, 1]), distances(2), first, STEPS)
        alone = timelines.meeting_on(0, one, distances(1), first, STEPS)
        met += expected is not None
        if expected is None:
            assert [] == found, case
            assert (-1, -1) == alone
        else:
            # What lasts shorter than a hundredth of a step may be found a moment earlier.
            assert [(0, 1), (1, 0)] == [(row, met_row) for row, _, _, met_row in found]
            assert {alone[0]} == {step for _, _, step, _ in found}, case
            assert expected - 1 <= alone[0] <= expected, case
    assert cases / 5 < met < cases * 14 / 15


def test_a_lead_lets_a_body_react_before_and_not_before_the_first_step():
    still = breakpoints([(0, 5000, 0, 0, 0)])
    comes = breakpoints([(0, 0, 0, 0, 0), (10 * SECOND, 10_000, 0, 0, 0)])
    timelines = following([still, comes])
    for lead, due in [(0, 4), (3, 1), (9, 0)]:
        found = timelines.meetings(np.array([0, 1]), distances(2, lead), 0, 30)
        assert [(0, due, 4, 1), (1, due, 4, 0)] == found
    assert [(1, 4, 4, 0)] == timelines.meetings(np.array([0, 1]), distances(2, counts=1), 0, 30)
    assert [(0, 4, 4, 1)] == timelines.meetings(np.array([0, 1]), distances(2, counts=2), 0, 30)
    assert [] == timelines.meetings(np.array([0, 1]), distances(2, lead=-1), 0, 30)


def test_a_meeting_is_the_same_from_wherever_it_is_looked_for():
    """Else a run would depend on its spans."""
    random = np.random.default_rng(3)
    for _ in range(60):
        one, other = (random_track(random, 2000)[0] for _ in range(2))
        timelines = following([one, other])
        steps = [timelines.meeting_on(0, one, distances(1), first, STEPS)[0] for first in range(STEPS)]  # fmt: skip
        for first, step in enumerate(steps):
            assert step == -1 or step >= first
            if first and steps[first - 1] >= first:
                assert steps[first - 1] == step


def test_what_was_found_before_is_not_said_of_other_ways_times_or_distances():
    """Timelines remember what they found; a copy of them has found nothing yet."""
    random = np.random.default_rng(11)
    rows = np.arange(3)
    met = 0
    for _ in range(30):
        timelines = following([random_track(random, 2500)[0] for _ in range(3)])
        kept = distances_of_three(random)
        first = 0
        for _ in range(20):
            if random.random() < 0.3:
                track = random_track(random, 2500)[0]
                timelines.follow(int(random.integers(0, 3)), first, track, *STANDING)
            if random.random() < 0.2:
                kept = distances_of_three(random)
            end = first + int(random.integers(0, STEPS))
            fresh = copy.copy(timelines)
            found = timelines.meetings(rows, kept, first, end)
            met += len(found)
            assert found == fresh.meetings(rows, kept, first, end)
            own = Distances(*(part[:1] for part in kept._replace(lead=kept.lead * 0)))
            assert timelines.meeting_at_rest(0, own, first, end) == fresh.meeting_at_rest(0, own, first, end)  # fmt: skip
            first = max(0, first + int(random.integers(-1, 3)))
    assert met > 100


def distances_of_three(random):
    lead, near, hard = (random.integers(0, most, (3, 3)) for most in (6, 600, 500))
    return Distances(lead - 1, near, hard, random.integers(0, 3, (3, 3)).astype(np.uint8))
