"""Periods in which a person is away from home, whatever the plan of the day is."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Annotated, Any

from pydantic import BeforeValidator, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.routines.planner import Doing
from fleet2d.routines.schema_forms import SchemaForms

SECOND = timedelta(seconds=1)
AWAY = "holiday"


def _moment(value: Any) -> Any:
    """Read a date as the midnight that begins it."""
    if isinstance(value, str) and len(value) == 10:
        return f"{value}T00:00"
    if hasattr(value, "year") and not isinstance(value, datetime):
        return datetime(value.year, value.month, value.day)
    return value


Moment = Annotated[datetime, BeforeValidator(_moment)]


class Period(Settings):
    """A period of time; short form: ``[2026-02-14, 2026-02-21T18:00]``.

    Attributes:
        begins: When it begins, local time.
        ends: When it is over.
    """

    begins: Moment
    ends: Moment

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        if isinstance(data, list | tuple) and len(data) == 2:
            return {"begins": data[0], "ends": data[1]}
        return data

    @model_validator(mode="after")
    def _goes_forward(self) -> "Period":
        if self.begins.tzinfo or self.ends.tzinfo:
            raise problem("times of a scenario are local: leave out the time zone")
        if self.ends <= self.begins:
            raise problem(
                f"it begins at {self.begins}, which is not before its end at {self.ends}: swap them"
            )
        return self

    def seconds_since(self, midnight: datetime) -> tuple[int, int]:
        """Return its beginning and end [s since a midnight]."""
        return (self.begins - midnight) // SECOND, (self.ends - midnight) // SECOND


AnyPeriod = Annotated[Period, SchemaForms("pair")]
"""A period, in any form."""


def with_absences(
    day: Sequence[Doing], midnight: datetime, away: Sequence[Period], visits: Sequence[Period]
) -> list[Doing]:
    """Return a day with a person's absences from home in place of what is planned then.

    Args:
        day: The doings of the day, without a gap.
        midnight: The midnight that begins the day's date.
        away: The periods in which the person is away.
        visits: If any, the only periods in which the person is at home.
    """
    begin, end = day[0].begin, day[-1].end
    absences = [period.seconds_since(midnight) for period in away]
    if visits:
        stays = sorted(period.seconds_since(midnight) for period in visits)
        lasts, firsts = [begin, *(b for _, b in stays)], [*(a for a, _ in stays), end]
        absences += [(a, b) for a, b in zip(lasts, firsts, strict=True) if a < b]
    for first, last in absences:
        day = _cut(day, max(first, begin), min(last, end))
    return list(day)


def _cut(day: Sequence[Doing], first: int, last: int) -> list[Doing]:
    """Return a day with an absence from `first` to `last` [s]."""
    if first >= last:
        return list(day)
    before = [doing._replace(end=min(doing.end, first)) for doing in day if doing.begin < first]
    after = [doing._replace(begin=max(doing.begin, last)) for doing in day if doing.end > last]
    return [*before, Doing(AWAY, first, last), *after]
