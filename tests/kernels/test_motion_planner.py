"""The planner of days: what is refused; `tests/routines/test_planner.py` has the twin."""

import pickle
from typing import Any

import pytest

from fleet2d.kernels.motion import DayPlanner
from fleet2d.kernels.numbers import StepDraws

LAW = ([60, 600], 60, 600, 0, 1 << 24)
NONE = ([0, 600], 0, 600, 0, 1 << 24)
JOB = (2, None, LAW, 80_000, [], 1_000_000, True, -1)
PASTIME = (3, 1, LAW, 0, 90_000)


def plan(**changes: Any) -> DayPlanner:
    """A plan with a job and a pastime."""
    parts = {"sleep": ([80_000], 80_000, 80_000, 0, 0), "least": 3600} | changes
    jobs, pastimes = parts.get("jobs", [JOB]), parts.get("pastimes", [PASTIME])
    return DayPlanner(parts["sleep"], parts["least"], jobs, pastimes, 0, 1)


def test_a_day_has_no_gap_and_ends_asleep() -> None:
    for planner in (plan(), pickle.loads(pickle.dumps(plan()))):
        rows = planner.plan(StepDraws(1, 2), 25_000, 110_000)
        assert [25_000, *(row[2] for row in rows)] == [*(row[1] for row in rows), 110_000]
        assert (1, -1) == rows[-1][::3]
        assert [0] == [job for _, _, _, job in rows if job >= 0]


@pytest.mark.parametrize(
    ("first", "last", "begins"), [(0, 25_000, 1), (25_000, 25_000, 1), (0, 24_999, 0)]
)
def test_a_pastime_may_begin_at_the_bounds_of_its_window(
    first: int, last: int, begins: int
) -> None:
    planner = plan(jobs=[], pastimes=[(3, 1, LAW, first, last)])
    rows = planner.plan(StepDraws(1, 2), 25_000, 110_000)

    assert begins == sum(activity == 3 for activity, *_ in rows)


def test_a_needed_job_that_fits_nowhere_leaves_no_day() -> None:
    late = (2, None, LAW, 1000, [], 1_000_000, True, -1)
    assert [] == plan(jobs=[late]).plan(StepDraws(1, 2), 25_000, 110_000)


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        ("sleep", ([], 0, 0, 0, 0), "quantiles must ascend"),
        ("sleep", ([9, 8], 0, 0, 0, 0), "quantiles must ascend"),
        ("sleep", ([9], 9, 2**36, 0, 0), "within 2"),
        ("sleep", ([8, 9], 8, 9, 0, (1 << 24) + 1), "positions must be among"),
        ("least", -1, "least_sleep must be 0"),
        ("jobs", [(*JOB[:4], [0], *JOB[5:])], "jobs must come after earlier ones"),
        ("jobs", [(*JOB[:3], 2**41, *JOB[4:])], "jobs must end within"),
        ("jobs", [(2, None, ([-1, 9], -1, 9, 0, 1), *JOB[3:])], "jobs must take 0 s or more"),
        ("pastimes", [(3, 0, LAW, 0, 9)], "weights must be 1"),
        ("pastimes", [(3, 2**30, LAW, 0, 9)] * 2, "the sum of all weights"),
        ("pastimes", [(3, 1, NONE, 0, 9)], "pastimes must take 1 s or more"),
    ],
)
def test_wrong_plans_are_refused(part: str, value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan(**{part: value})


def test_a_day_far_from_midnight_is_refused() -> None:
    with pytest.raises(ValueError, match="within 2"):
        plan().plan(StepDraws(1, 2), 25_000, 2**20)
