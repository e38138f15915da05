"""The year of a person: when illness, vacations, holidays, seasons and changes of routine are."""

from calendar import monthrange
from collections.abc import Mapping
from datetime import date, datetime, timedelta

import numpy as np

from fleet2d.routines.activity import seconds
from fleet2d.routines.distributions import exponential
from fleet2d.routines.household import Period
from fleet2d.routines.persona import Persona, YearEvent
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.determinism import Draws, stream_key

Days = tuple[int, int]
"""The ordinals of the first and the last day."""

FOREVER = date.max.toordinal()
# When those who are away leave on the first day, and are back on the last.
LEAVES, RETURNS = timedelta(hours=10), timedelta(hours=18)


class Year:
    """The events of the years of one person, or of all members of a household.

    The events of a calendar year are drawn from that year: they depend neither on when a run begins
    nor on which days were asked for before.
    """

    def __init__(self, events: Mapping[str, YearEvent], seed: int, path: str) -> None:
        self.events = events
        self._keys = {name: stream_key(seed, path, f"year {name}") for name in events}
        self._drawn: dict[int, dict[str, list[Days]]] = {}

    def __getstate__(self) -> dict[str, object]:
        """Leave out the years: they are redrawn."""
        return {**self.__dict__, "_drawn": {}}

    def on(self, ordinal: int) -> dict[str, Days]:
        """Return the first and last day of each event that covers a day, by the event's name."""
        year = date.fromordinal(ordinal).year
        found: dict[str, Days] = {}
        for name in self.events:
            for each in (year - 1, year):
                for first, last in self._of_year(each)[name]:
                    if first <= ordinal <= last:
                        found[name] = first, last
        return found

    def persona(self, base: Persona, ordinal: int) -> Persona:
        """Return whose days a person lives on a day: its own, or those of what it has become."""
        event = self._becomes(ordinal)
        return base if event is None else self.events[event].becomes or base

    def template(self, base: Persona, ordinal: int, usual: str) -> str:
        """Return the name of the plan of a day among `base.plans`, given the usual one."""
        name, event = usual, self._becomes(ordinal)
        if event is not None:
            name = f"{event}.{self.persona(base, ordinal).day(date.fromordinal(ordinal))}"
        for each in self.on(ordinal):
            days = self.events[each].days
            if days in base.plans:
                name = str(days)
        return name

    def _becomes(self, ordinal: int) -> str | None:
        """Return the last event that has made a person another."""
        changes = [name for name in self.on(ordinal) if self.events[name].becomes is not None]
        return changes[-1] if changes else None

    def absences(self, ordinal: int) -> list[Period]:
        """Return the periods in which nobody is at home that a day is in, or next to."""
        found = {
            span
            for day in (ordinal, ordinal + 1)
            for name, span in self.on(day).items()
            if self.events[name].away
        }
        return [
            Period(
                begins=datetime.fromordinal(first) + LEAVES,
                ends=datetime.fromordinal(last) + RETURNS,
            )
            for first, last in sorted(found)
        ]

    def _of_year(self, year: int) -> dict[str, list[Days]]:
        if year not in self._drawn:
            self._drawn[year] = {
                name: _draw(event, self._keys[name], year) for name, event in self.events.items()
            }
        return self._drawn[year]


def _draw(event: YearEvent, key: np.uint64, year: int) -> list[Days]:
    """Return when an event is that begins in a year; one that is once, for any year."""
    draws = Draws(key, 0 if event.once is not None else year)
    if event.every is not None:
        found = _by_chance(event.every, event, draws, year)
        if event.season is None:
            return found
        parts = [_part_of_year(event.season, each) for each in (year - 1, year)]
        return [span for span in found if any(a <= span[0] <= b for a, b in parts)]
    if event.holidays is not None:
        return [(day.toordinal(), day.toordinal()) for day in event.dates if day.year == year]
    if event.season is not None:
        return [_part_of_year(event.season, year)]
    if event.once is not None:
        ends = event.once if isinstance(event.once, tuple) else (event.once, event.once)
        first, last = ends[0].toordinal(), ends[1].toordinal()
    else:
        assert event.yearly is not None
        first, last = _part_of_year(event.yearly, year)
    begin = first + draws.below(last - first + 1)
    return [(begin, FOREVER if event.lasts is None else begin + _length(event, draws) - 1)]


def _by_chance(every: timedelta, event: YearEvent, draws: Draws, year: int) -> list[Days]:
    gap, now_s, found = exponential(seconds(every)), 0, list[Days]()
    first, last = date(year, 1, 1).toordinal(), date(year, 12, 31).toordinal()
    while True:
        now_s += gap.draw(draws)
        begin = first + now_s // DAY_S
        if begin > last:
            return found
        found.append((begin, begin + _length(event, draws) - 1))
        now_s = (found[-1][1] + 1 - first) * DAY_S


def _length(event: YearEvent, draws: Draws) -> int:
    """Draw how long an event lasts [days]: from 1 to 365, so that it ends in the next year."""
    assert event.lasts is not None
    return min(max(1, round(event.lasts.table().draw(draws) / DAY_S)), 365)


def _part_of_year(ends: tuple[str, str], year: int) -> Days:
    """Return a part of a year; one that ends before it begins ends in the next year."""
    first = _date(ends[0], year)
    return first, _date(ends[1], year + (ends[1] < ends[0]))


def _date(day: str, year: int) -> int:
    """Return the ordinal of a day of a year; the 29th of February may be the 28th."""
    month, of_month = map(int, day.split("-"))
    return date(year, month, min(of_month, monthrange(year, month)[1])).toordinal()
