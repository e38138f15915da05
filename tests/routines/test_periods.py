"""Periods: who is away in them, and visitors who are there in no others."""

from datetime import datetime

import pytest
from pydantic import ValidationError

from fleet2d.routines.household import Period, with_absences
from fleet2d.routines.planner import Doing

MIDNIGHT = datetime(2026, 1, 5)
HOUR = 3600
DAY = [Doing("read", 7 * HOUR, 12 * HOUR), Doing("cook", 12 * HOUR, 13 * HOUR, "lunch")]


def period(begins: str, ends: str) -> Period:
    return Period.model_validate([f"2026-01-05T{begins}", f"2026-01-05T{ends}"])


def hours(day: list[Doing]) -> list[tuple[str, float, float]]:
    return [(doing.activity, doing.begin / HOUR, doing.end / HOUR) for doing in day]


def test_a_day_without_periods_stays_as_it_is() -> None:
    assert DAY == with_absences(DAY, MIDNIGHT, [period("14:00", "15:00")], [])


def test_a_period_within_an_activity_cuts_it_in_two() -> None:
    times = hours(with_absences(DAY, MIDNIGHT, [period("09:00", "10:00")], []))
    assert [("read", 7, 9), ("holiday", 9, 10), ("read", 10, 12), ("cook", 12, 13)] == times


def test_a_period_over_several_swallows_what_it_covers() -> None:
    times = hours(with_absences(DAY, MIDNIGHT, [period("11:00", "23:00")], []))
    assert [("read", 7, 11), ("holiday", 11, 13)] == times


def test_a_visitor_is_away_before_and_after() -> None:
    times = hours(with_absences(DAY, MIDNIGHT, [], [period("08:00", "12:30")]))
    assert [("holiday", 7, 8), ("read", 8, 12), ("cook", 12, 12.5), ("holiday", 12.5, 13)] == times


def test_a_visitor_who_comes_on_another_day_is_away_all_day() -> None:
    visit = Period.model_validate(["2026-01-09", "2026-01-10"])
    assert [("holiday", 7, 13)] == hours(with_absences(DAY, MIDNIGHT, [], [visit]))


@pytest.mark.parametrize(
    "data", [["2026-01-06", "2026-01-05"], ["2026-01-06", "2026-01-06"], ["soon", "later"], [1]]
)
def test_what_is_no_period_is_refused(data: list[object]) -> None:
    with pytest.raises(ValidationError):
        Period.model_validate(data)
