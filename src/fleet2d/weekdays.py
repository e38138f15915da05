"""Days of the week, and names for groups of them."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from fleet2d.problems import problem

WEEKDAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
GROUPS = {"daily": range(7), "weekdays": range(5), "weekend": range(5, 7)}
Days = Literal[
    "daily", "weekdays", "weekend",
    "monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday",
]  # fmt: skip
"""The name of a day or of a group of days of the week."""
OnDays = Days | Annotated[tuple[Days, ...], Field(min_length=1)]
"""One such name, or a list of them."""


def weekdays_of(names: str | Sequence[str] | None) -> set[int]:
    """Return days of the week by their names, 0 is Monday; None: no day.

    >>> sorted(weekdays_of(["weekend", "friday"])), weekdays_of(None)
    ([4, 5, 6], set())
    """
    if isinstance(names, str):
        names = (names,)
    return {day for name in names or () for day in _days_of(name)}


def _days_of(name: str) -> Sequence[int]:
    if name in GROUPS:
        return GROUPS[name]
    if name in WEEKDAYS:
        return (WEEKDAYS.index(name),)
    raise problem(
        f"unknown day {name!r}; there are: {', '.join((*GROUPS, *WEEKDAYS))}, or a list of those"
        " like 'monday,friday'"
    )
