"""The bounds of pastimes in a day; `tests/routines/test_planner.py` has the twin of the planner."""

import pytest

from fleet2d.kernels import DayPlanner, StepDraws


@pytest.mark.parametrize(
    ("first", "last", "begins"), [(0, 25_000, 1), (25_000, 25_000, 1), (0, 24_999, 0)]
)
def test_a_pastime_may_begin_at_the_bounds_of_its_window(first, last, begins):
    bed, takes = ([80_000], 80_000, 80_000, 0, 0), ([60, 600], 60, 600, 0, 1 << 24)
    planner = DayPlanner(bed, 3600, [], [(3, 1, takes, first, last)], 0, 1)

    rows = planner.plan(StepDraws(1, 2), 25_000, 110_000)

    assert begins == sum(activity == 3 for activity, *_ in rows)


BED = ([80_000], 80_000, 80_000, 0, 0)


def test_pastimes_that_may_take_no_time_leave_a_day():
    takes = ([0, 600], 0, 600, 0, 1 << 24)
    pastimes = [(activity, 1, takes, 0, 90_000) for activity in (3, 4)]

    rows = DayPlanner(BED, 3600, [], pastimes, 0, 1).plan(StepDraws(1, 2), 25_000, 110_000)

    assert {3, 4} < {activity for activity, *_ in rows}


def test_a_needed_job_that_fits_nowhere_leaves_no_day():
    takes = ([60, 600], 60, 600, 0, 1 << 24)
    late = (2, None, takes, 1000, [], 1_000_000, True, -1)
    pastimes = [(3, 1, takes, 0, 90_000)]

    assert [] == DayPlanner(BED, 3600, [late], pastimes, 0, 1).plan(
        StepDraws(1, 2), 25_000, 110_000
    )
