"""Hours of the week in which something holds: ``weekdays 08:00-18:00``."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Annotated, NamedTuple

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.clock import midnight_of
from fleet2d.problems import problem, shown
from fleet2d.units import format_time_of_day, parse_time_of_day
from fleet2d.weekdays import weekdays_of

DAY = timedelta(days=1)


class HoursSpan(NamedTuple):
    """Hours of some days of the week; those that end before they begin last past midnight.

    Attributes:
        days: The days on which the hours begin, 0 is Monday.
        begin: Their begin, since midnight.
        end: Their end, since the same midnight, up to a day after `begin`.
        text: The hours in a scenario.
    """

    days: tuple[int, ...]
    begin: timedelta
    end: timedelta
    text: str

    def holds_at(self, time: datetime) -> datetime | None:
        """Return the end of the hours that a moment lies in; None if it lies outside."""
        midnight = midnight_of(time)
        for day in (midnight - DAY, midnight):
            if day.weekday() in self.days and day + self.begin <= time < day + self.end:
                return day + self.end
        return None

    def next_begin(self, time: datetime) -> datetime:
        """Return when the hours begin next after a moment."""
        midnight = midnight_of(time)
        days = (midnight + i * DAY for i in range(8))
        begins = (day + self.begin for day in days if day.weekday() in self.days)
        return next(begin for begin in begins if begin > time)


def parse_span(value: object) -> HoursSpan:
    """Read hours: ``08:00-18:00``, ``weekdays 22:00-06:00`` or ``monday,friday 9:00-12:00``.

    Example:
        >>> span = parse_span("weekend 22:00-06:00")
        >>> span.holds_at(datetime(2026, 1, 12, 5)), span.holds_at(datetime(2026, 1, 10, 5))
        (datetime.datetime(2026, 1, 12, 6, 0), None)
    """
    if isinstance(value, HoursSpan):
        return value
    words = value.split() if isinstance(value, str) else []
    if not 1 <= len(words) <= 2 or words[-1].count("-") != 1:
        raise problem(
            f"expected hours, got {shown(value)}: write them like '08:00-22:00',"
            " 'weekdays 9:00-17:00' or 'monday,friday 22:00-06:00'"
        )
    begin, end = (parse_time_of_day(text) for text in words[-1].split("-"))
    if begin == end:
        raise problem(f"hours must begin and end at different times, got {shown(value)}")
    days = sorted(weekdays_of((words[0] if words[1:] else "daily").split(",")))
    names = "" if len(words) == 1 else f"{words[0]} "
    text = f"{names}{format_time_of_day(begin)}-{format_time_of_day(end)}"
    return HoursSpan(tuple(days), begin, end if end > begin else end + DAY, text)


def _parse_hours(value: object) -> tuple[HoursSpan, ...]:
    if isinstance(value, Sequence) and not isinstance(value, str | HoursSpan):
        return tuple(parse_span(item) for item in value)
    return (parse_span(value),)


Hours = Annotated[
    tuple[HoursSpan, ...],
    BeforeValidator(_parse_hours),
    PlainSerializer(lambda spans: [span.text for span in spans]),
    WithJsonSchema(
        {
            "description": "hours of the week, like '08:00-22:00' or 'weekdays 9:00-17:00', or a"
            " list of them",
            "x-quantity": "hours",
            "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
            "examples": ["08:00-22:00", ["weekdays 9:00-17:00", "weekend 10:00-20:00"]],
        }
    ),
]
"""Hours of the week, in one or several spans; what an empty list means is up to the field."""


def holds(hours: Sequence[HoursSpan], time: datetime) -> datetime | None:
    """Return the end of the hours that a moment lies in; None if it lies outside."""
    ends = [end for span in hours if (end := span.holds_at(time))]
    return max(ends, default=None)
