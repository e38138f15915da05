"""Recorded days: days of a log, and new days that switch between recorded ones.

A day is drawn by following a recorded one. When an activity ends at about the time of day at which
the same activity ended on another recorded day, the new day may continue with that one instead. So
durations and hours are those of the log, but new days differ from the recorded ones. (Local
resampling, as with k nearest neighbours by Lall and Sharma 1996, Water Resources Research 32:679.)
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.configuration.problems import problem
from fleet2d.routines.occupancy import ANY_ROOM, Occupancy
from fleet2d.routines.planner import DAY_S, SLEEP, Doing, Job
from fleet2d.runtime.determinism import Draws

# Probability of a switch to another day where one is possible [in 16ths], and the largest distance
# between the times of both days [s].
CROSSING, REACH_S = 6, 1200
# A doing that lasts at least this many times the shift ends at its recorded time.
TAKES_UP = 4
LEAST_S = 30  # the least duration of a doing
END = "end"


class RecordedDay(NamedTuple):
    """A recorded day; times in seconds since its midnight.

    Attributes:
        begins: The beginning of each activity, ascending.
        activities: The activities; the last one is sleep.
        end: The beginning of the next day.
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
        raise problem(f"expected a recorded day like '07:00 wash, …, 30:45 end', got {value!r}")
    times, names = [], []
    for entry in value.split(","):
        time, _, name = entry.strip().partition(" ")
        hours, colon, minutes = time.partition(":")
        if not (colon and hours.isdigit() and minutes.isdigit() and name):
            raise problem(
                f"expected a time and an activity like '07:00 wash', got {entry.strip()!r}"
            )
        times.append(int(hours) * 3600 + int(minutes) * 60)
        names.append(name.strip())
    for before, after in pairwise(times):
        if after <= before:
            hint = f"; write {_clock(after + DAY_S)} if it is on the next date"
            raise problem(
                f"times must ascend: {_clock(after)} follows {_clock(before)}"
                f"{hint if after < DAY_S else ''}"
            )
    if len(names) < 3 or names[-1] != END or names[-2] != SLEEP:
        raise problem("a recorded day ends asleep: its last entries are 'sleep' and 'end'")
    return RecordedDay(tuple(times[:-1]), tuple(names[:-1]), times[-1])


def write_day(day: RecordedDay) -> str:
    """Write a recorded day in the form that `parse_day` reads."""
    entries = [*zip(day.begins, day.activities, strict=True), (day.end, END)]
    return ", ".join(f"{_clock(at)} {name}" for at, name in entries)


def _clock(at: int) -> str:
    return f"{at // 3600:02}:{at // 60 % 60:02}"


AnyRecordedDay = Annotated[
    RecordedDay,
    BeforeValidator(parse_day),
    PlainSerializer(write_day),
    WithJsonSchema(
        {"type": "string", "examples": ["07:00 wash, 07:20 work, 23:00 sleep, 31:00 end"]}
    ),
]


class Recording(NamedTuple):
    """Recorded days, with an index of the ends of their activities.

    Attributes:
        days: The recorded days.
        endings: For each activity, the times at which it ended, ascending [s], and the numbers of
            the day and of the activity in the day for each of them.
    """

    days: tuple[RecordedDay, ...]
    endings: dict[str, tuple[list[int], list[tuple[int, int]]]]


def to_recording(days: Sequence[RecordedDay]) -> Recording:
    """Return recorded days with the index of their endings."""
    ends: dict[str, list[tuple[int, tuple[int, int]]]] = {}
    for d, day in enumerate(days):
        for i, name in enumerate(day.activities[:-1]):
            ends.setdefault(name, []).append((day.begins[i + 1], (d, i)))
    endings = {}
    for name, of_activity in ends.items():
        of_activity.sort()
        endings[name] = ([time for time, _ in of_activity], [at for _, at in of_activity])
    return Recording(tuple(days), endings)


def draw_source(recording: Recording, draws: Draws) -> int:
    """Draw the number of the recorded day with which a new day begins."""
    return draws.below(len(recording.days))


def draw_recorded(recording: Recording, first: int, draws: Draws, next_wake: int) -> list[Doing]:
    """Draw a day that begins like a recorded one.

    Args:
        recording: The recorded days.
        first: The number of the recorded day that it begins like.
        draws: The day's random draws.
        next_wake: When the next day begins [s].

    Returns:
        The doings until `next_wake`, without a gap; the last one is sleep.
    """
    d, i = first, 0
    day = recording.days[d]
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
            d, i = _draw_ending(recording, day.activities[i], now, draws) or (d, i)
            day = recording.days[d]
            shift = now - day.begins[i + 1]
        i += 1
    if now < next_wake:
        result.append(Doing(SLEEP, now, next_wake))
    elif result[-1].activity != SLEEP:
        result[-1] = result[-1]._replace(activity=SLEEP)
    return _merge_repeats(result)


def _draw_ending(
    recording: Recording, activity: str, now: int, draws: Draws
) -> tuple[int, int] | None:
    """Draw an ending of an activity at about a time: numbers of the day and of the activity."""
    times, positions = recording.endings[activity]
    low, high = bisect_left(times, now - REACH_S), bisect_right(times, now + REACH_S)
    return positions[low + draws.below(high - low)] if high > low else None


def _merge_repeats(day: Sequence[Doing]) -> list[Doing]:
    """Merge successive doings of the same activity."""
    result: list[Doing] = []
    for doing in day:
        if result and result[-1].activity == doing.activity:
            result[-1] = result[-1]._replace(end=doing.end)
        else:
            result.append(doing)
    return result


def in_free_rooms(
    day: Sequence[Doing], private: Iterable[str], occupancy: Occupancy | None
) -> list[Doing]:
    """Return a day without doings whose private rooms others use; the doing before lasts longer.

    Args:
        day: The doings of the day.
        private: The exclusive activities, which need a room that nobody else uses.
        occupancy: When others use such rooms; None: never.
    """
    if occupancy is None:
        return list(day)
    exclusive, result = {*private, *occupancy.rooms}, list[Doing]()
    begin = day[0].begin
    for doing in day:
        room = ANY_ROOM
        if doing.activity in exclusive:
            duration = doing.end - doing.begin
            slot = occupancy.free(doing.activity, doing.begin, doing.begin, duration, doing.end)
            if slot is None or slot.end < doing.end:
                continue  # the doing before lasts longer, or the next one begins earlier
            room = slot.room
        if result:
            result[-1] = result[-1]._replace(end=doing.begin)
        result.append(doing._replace(begin=doing.begin if result else begin, room=room))
    if result:
        result[-1] = result[-1]._replace(end=day[-1].end)
    return result or list(day)


def with_jobs(day: Sequence[Doing], jobs: Iterable[Job]) -> list[Doing]:
    """Return a day with joint jobs in place of what is planned then, unless the person sleeps."""
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
