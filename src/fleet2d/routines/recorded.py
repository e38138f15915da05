"""Recorded days: days of a log as they were lived, and new ones that go from one to another.

A day is drawn by following a recorded one. Where what one does is over at about the time of day at
which the same was over on another recorded day, one may go on with that day instead. So durations
and hours are those of the log, and yet no two days need be alike. (Local resampling, as with k
nearest neighbours by Lall and Sharma 1996, Water Resources Research 32:679.)
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.problems import problem
from fleet2d.routines.busy import ANY_ROOM, Busy
from fleet2d.routines.planner import SLEEP, Doing, Job
from fleet2d.streams import Draws

# How likely one goes on with another day where one can, of 16, and how far apart both may be [s].
CROSSING, REACH_S = 6, 1200
# A doing takes up an earlier or later beginning if it lasts so many times as long.
TAKES_UP = 4
LEAST_S = 30
END = "end"


class RecordedDay(NamedTuple):
    """A day as it was lived: from when on which activity is done [s of its midnight].

    Attributes:
        begins: When each begins, rising.
        activities: What, of each; the last is sleep.
        end: When the next day begins.
    """

    begins: tuple[int, ...]
    activities: tuple[str, ...]
    end: int


def parse_day(value: Any) -> RecordedDay:
    """Read a recorded day: ``06:43 wash, 06:55 breakfast, 22:31 sleep, 30:45 end``.

    Hours from 24 on are those of the next date.

    >>> parse_day("07:00 wash, 23:00 sleep, 31:10 end").end
    112200
    """
    if isinstance(value, RecordedDay):
        return value
    if not isinstance(value, str):
        raise problem(f"found {value!r}; a recorded day is wanted, '07:00 wash, …, 30:45 end'")
    times, names = [], []
    for entry in value.split(","):
        time, _, name = entry.strip().partition(" ")
        hours, colon, minutes = time.partition(":")
        if not (colon and hours.isdigit() and minutes.isdigit() and name):
            raise problem(
                f"found {entry.strip()!r}; a time and an activity are wanted, '07:00 wash'"
            )
        times.append(int(hours) * 3600 + int(minutes) * 60)
        names.append(name.strip())
    if any(a >= b for a, b in pairwise(times)):
        raise problem("the times of a recorded day rise; write 25:10 for ten past one at night")
    if len(names) < 3 or names[-1] != END or names[-2] != SLEEP:
        raise problem("a recorded day ends asleep: its last entries are 'sleep' and 'end'")
    return RecordedDay(tuple(times[:-1]), tuple(names[:-1]), times[-1])


def write_day(day: RecordedDay) -> str:
    """Write a recorded day as it is read."""
    entries = [*zip(day.begins, day.activities, strict=True), (day.end, END)]
    return ", ".join(f"{at // 3600:02}:{at // 60 % 60:02} {name}" for at, name in entries)


AnyRecordedDay = Annotated[
    RecordedDay,
    BeforeValidator(parse_day),
    PlainSerializer(write_day),
    WithJsonSchema(
        {"type": "string", "examples": ["07:00 wash, 07:20 work, 23:00 sleep, 31:00 end"]}
    ),
]


class Recording(NamedTuple):
    """Recorded days, as days are drawn from them.

    Attributes:
        days: They.
        endings: For each activity, when it was over, rising [s], and of which day and which number.
    """

    days: tuple[RecordedDay, ...]
    endings: dict[str, tuple[list[int], list[tuple[int, int]]]]


def recording(days: Iterable[RecordedDay]) -> Recording:
    """Return recorded days as days are drawn from them."""
    kept = tuple(days)
    found: dict[str, list[tuple[int, tuple[int, int]]]] = {}
    for d, day in enumerate(kept):
        for i, name in enumerate(day.activities[:-1]):
            found.setdefault(name, []).append((day.begins[i + 1], (d, i)))
    endings = {name: sorted(ends) for name, ends in found.items()}
    return Recording(
        kept, {name: ([t for t, _ in e], [at for _, at in e]) for name, e in endings.items()}
    )


def source(kept: Recording, draws: Draws) -> int:
    """Draw the recorded day with which a day begins, by its number."""
    return draws.below(len(kept.days))


def draw_recorded(kept: Recording, first: int, draws: Draws, next_wake: int) -> list[Doing]:
    """Draw a day that begins as a recorded one.

    Args:
        kept: The recorded days.
        first: The number of the one that it begins as.
        draws: Its random draws.
        next_wake: When the next day begins [s].

    Returns:
        What is done until `next_wake`, without a gap; it ends asleep.
    """
    d, i = first, 0
    day = kept.days[d]
    now, shift = day.begins[0], 0
    result: list[Doing] = []
    while i < len(day.activities) - 1 and now < next_wake - LEAST_S:
        over = day.begins[i + 1]
        if shift and over - day.begins[i] >= TAKES_UP * abs(shift):
            shift = 0
        end = min(max(over + shift, now + LEAST_S), next_wake)
        result.append(Doing(day.activities[i], now, end))
        now = end
        if draws.below(16) < CROSSING:
            d, i = _elsewhere(kept, day.activities[i], now, draws) or (d, i)
            day = kept.days[d]
            shift = now - day.begins[i + 1]
        i += 1
    if now < next_wake:
        result.append(Doing(SLEEP, now, next_wake))
    elif result[-1].activity != SLEEP:
        result[-1] = result[-1]._replace(activity=SLEEP)
    return _joined(result)


def _elsewhere(kept: Recording, activity: str, now: int, draws: Draws) -> tuple[int, int] | None:
    """Draw where else an activity was over at about that time, if anywhere."""
    times, where = kept.endings[activity]
    low, high = bisect_left(times, now - REACH_S), bisect_right(times, now + REACH_S)
    return where[low + draws.below(high - low)] if high > low else None


def _joined(day: Sequence[Doing]) -> list[Doing]:
    """Return a day in which nothing follows on the same."""
    result: list[Doing] = []
    for doing in day:
        if result and result[-1].activity == doing.activity:
            result[-1] = result[-1]._replace(end=doing.end)
        else:
            result.append(doing)
    return result


def in_free_rooms(day: Sequence[Doing], alone: Iterable[str], busy: Busy | None) -> list[Doing]:
    """Return a day in which rooms that others use are left to them: one goes on with what one did.

    Args:
        day: What would be done.
        alone: Activities that want a room to themselves.
        busy: When others use such rooms; None: never.
    """
    if busy is None:
        return list(day)
    wanted, result = {*alone, *busy.rooms}, list[Doing]()
    begin = day[0].begin
    for doing in day:
        room = ANY_ROOM
        if doing.activity in wanted:
            long = doing.end - doing.begin
            free = busy.free(doing.activity, doing.begin, doing.begin, long, doing.end)
            if free is None or free.end < doing.end:
                continue  # what was before goes on, or what is next begins earlier
            room = free.room
        if result:
            result[-1] = result[-1]._replace(end=doing.begin)
        result.append(doing._replace(begin=doing.begin if result else begin, room=room))
    if result:
        result[-1] = result[-1]._replace(end=day[-1].end)
    return result or list(day)


def with_jobs(day: Sequence[Doing], jobs: Iterable[Job]) -> list[Doing]:
    """Return a day with what is done together in place of what would be, unless one sleeps."""
    for job in jobs:
        assert job.starts is not None
        begin = job.starts.shortest
        end = begin + job.takes.shortest
        asleep = any(d.activity == SLEEP and d.begin < end and begin < d.end for d in day)
        if asleep or begin < day[0].begin:
            continue
        before = [d._replace(end=min(d.end, begin)) for d in day if d.begin < begin]
        after = [d._replace(begin=max(d.begin, end)) for d in day if d.end > end]
        day = [*before, Doing(job.activity, begin, end, job.task), *after]
    return list(day)
