"""The planner of days: what is refused; `tests/routines/test_planner.py` has the twin."""

import pickle

import pytest

from fleet2d.kernels import DayPlanner, RoomUse, StepDraws

LAW = ([60, 600], 60, 600, 0, 1 << 24)
NONE = ([0, 1], 0, 1, 0, 1 << 24)
JOB = (2, None, LAW, 80_000, [], 1_000_000, True, -1)
PASTIME = (3, 1, LAW, 0, 90_000)


def plan(**changes):
    """A plan with a job and a pastime."""
    parts = {"sleep": ([80_000], 80_000, 80_000, 0, 0), "least": 3600} | changes
    jobs, pastimes = parts.get("jobs", [JOB]), parts.get("pastimes", [PASTIME])
    return DayPlanner(parts["sleep"], parts["least"], jobs, pastimes, 0, 1)


def test_a_day_has_no_gap_and_ends_asleep():
    for planner in (plan(), pickle.loads(pickle.dumps(plan()))):
        rows = planner.plan(StepDraws(1, 2), 25_000, 110_000)
        assert [25_000, *(row[2] for row in rows)] == [*(row[1] for row in rows), 110_000]
        assert (1, -1, -1) == (rows[-1][0], *rows[-1][3:])
        assert [0] == [job for _, _, _, job, _ in rows if job >= 0]


@pytest.mark.parametrize(
    ("first", "last", "begins"), [(0, 25_000, 1), (25_000, 25_000, 1), (0, 24_999, 0)]
)
def test_a_pastime_may_begin_at_the_bounds_of_its_window(first, last, begins):
    planner = plan(jobs=[], pastimes=[(3, 1, LAW, first, last)])
    rows = planner.plan(StepDraws(1, 2), 25_000, 110_000)

    assert begins == sum(activity == 3 for activity, *_ in rows)


def test_a_needed_job_that_fits_nowhere_leaves_no_day():
    late = (2, None, LAW, 1000, [], 1_000_000, True, -1)
    assert [] == plan(jobs=[late]).plan(StepDraws(1, 2), 25_000, 110_000)


def test_a_pastime_that_may_take_no_time_leaves_a_day():
    short = ([0, 600], 0, 600, 0, 1 << 24)
    rows = plan(pastimes=[(3, 1, short, 0, 90_000), (4, 1, short, 0, 90_000)]).plan(
        StepDraws(1, 2), 25_000, 110_000
    )
    assert {3, 4} < {row[0] for row in rows}


def test_a_room_is_free_between_two_uses():
    """The slot lasts until the next use; of two rooms, the one that is free first."""
    use = RoomUse()
    use.add(7, 100, 200)
    use.add(7, 260, 300)
    use.add(9, 0, 150)

    assert (200, 260, 7) == use.free([7], 90, 250, 30, 400)
    assert (150, 400, 9) == use.free([7, 9], 90, 250, 30, 400)
    assert (90, 400, 8) == use.free([7, 8], 90, 250, 30, 400)
    assert use.free([7], 90, 199, 30, 400) is None
