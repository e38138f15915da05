"""When an entry of a script happens: at a time, or on an event."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, shown
from fleet2d.configuration.units import format_time_of_day, parse_time_of_day, weekdays_of
from fleet2d.floorplan.home import format_moment, parse_moment
from fleet2d.runtime.clock import Clock, midnight_of
from fleet2d.runtime.events import Event

DAY = timedelta(days=1)


class ClockTime(NamedTuple):
    """A time of day, on some days of the week.

    Attributes:
        days: The days of the week, 0 is Monday.
        time: The time since midnight.
        text: The text in the scenario.
    """

    days: tuple[int, ...]
    time: timedelta
    text: str

    def moments(self, clock: Clock) -> Iterator[datetime]:
        """Yield all such moments of a run, in order."""
        midnight = midnight_of(clock.start)
        end = clock.time(clock.steps)
        while midnight < end:
            moment = midnight + self.time
            if midnight.weekday() in self.days and clock.start <= moment < end:
                yield moment
            midnight += DAY


def parse_when(value: object) -> datetime | timedelta | ClockTime:
    """Read a time: ``19:00``, ``monday 07:30``, ``2026-01-07T14:00``, or ``2 h`` from the start.

    Example:
        >>> parse_when("weekend 9:00").text, parse_when("2 h")
        ('weekend 09:00', datetime.timedelta(seconds=7200))
    """
    if isinstance(value, ClockTime):
        return value
    words = value.split() if isinstance(value, str) else []
    if not 1 <= len(words) <= 2 or ":" not in words[-1] or "-" in words[-1]:
        if isinstance(value, str) and not value.strip()[:1].isdigit():
            raise problem(
                f"expected a time, got {shown(value)}: write it like '19:00', 'monday 07:30',"
                " '2026-01-07T14:00', or '2 h' from the start"
            )
        return parse_moment(value)
    if words[1:] and words[0][0].isdigit():  # 2026-01-07 14:00
        return parse_moment(value)
    time = parse_time_of_day(words[-1])
    days = weekdays_of((words[0] if words[1:] else "daily").split(","))
    name = f"{words[0]} " if words[1:] else ""
    return ClockTime(tuple(sorted(days)), time, f"{name}{format_time_of_day(time)}")


def _format_when(when: datetime | timedelta | ClockTime) -> str:
    return when.text if isinstance(when, ClockTime) else format_moment(when)


When = Annotated[
    datetime | timedelta | ClockTime,
    BeforeValidator(parse_when),
    PlainSerializer(_format_when),
    WithJsonSchema(
        {
            "description": "a time of day like 19:00, with days of the week before it like 'monday"
            " 07:30' or 'weekdays 08:00', a local time like 2026-01-07T14:00, or the time since the"
            " start like '2 h'",
            "x-quantity": "time",
            "type": ["string", "number", "object"],
            "examples": ["19:00", "monday 07:30", "2026-01-07T14:00", "2 h"],
        }
    ),
]


class Trigger(Settings):
    """An event that triggers an intervention: ``[user_seen, astro, ana]``, or its kind alone.

    Attributes:
        event: Its kind, as in the table of events.
        entity: The body, door or sensor that it happens to; left out: any.
        detail: Its detail: the user that is seen, the activity; left out: any.

    Example:
        >>> Trigger(event="user_seen", entity="astro").fits(Event(5, "astro", "user_seen", "ana"))
        True
    """

    event: str = Field(min_length=1)
    entity: str | None = None
    detail: str | None = None

    def fits(self, event: Event) -> bool:
        """Whether an event triggers the intervention."""
        return (
            event.event == self.event
            and self.entity in (None, event.entity)
            and self.detail in (None, event.detail)
        )


def _as_mapping(value: Any) -> Any:
    if isinstance(value, str):
        return {"event": value}
    if isinstance(value, Sequence) and 1 <= len(value) <= 3:
        return dict(zip(Trigger.model_fields, value, strict=False))
    if not isinstance(value, Mapping | Trigger):
        raise problem(
            f"expected an event, got {shown(value)}: give its kind, the entity that it happens"
            " to, and its detail, like [user_seen, astro, ana]"
        )
    return value


On = Annotated[
    Trigger,
    BeforeValidator(_as_mapping),
    PlainSerializer(lambda trigger: trigger.model_dump(exclude_none=True)),
    WithJsonSchema(
        {
            "description": "an event: its kind, who it happens to, and what else it says, like"
            " [user_seen, astro, ana]",
            "x-quantity": "event",
            "anyOf": [
                {"type": "string"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1, "maxItems": 3},
                {
                    "type": "object",
                    "properties": {key: {"type": "string"} for key in Trigger.model_fields},
                    "required": ["event"],
                    "additionalProperties": False,
                },
            ],
            "examples": ["docks", ["user_seen", "astro"], ["activity", "ana", "dinner"]],
        }
    ),
]
"""An event in a script: its kind alone, a list, or a mapping."""
