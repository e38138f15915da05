"""Days of people: the episodes of a day, and how random ones are drawn that satisfy a template.

A day lasts from waking to the next waking. It is a chain of jobs in a drawn order. With windows for
their begins and bounds on their durations, it is a simple temporal network, which two passes solve:
forward for the earliest begins, backward for the latest. Begins and durations are then drawn in
order, within the bounds of the backward pass, so that no draw makes the rest impossible. (Similar
to Idrees, Singh, Xu and Glas: "A Framework for Realistic Simulation of Daily Human Activity", 2023,
arXiv 2311.15400, who propagate constraints both ways through a day.)

If the jobs of a day don't fit, another order is drawn, a few times; then one job is left out: of
those that aren't needed every day, the one that is done on the fewest days. The core draws the
days, see ``src/core/planner.hpp``.

A day of a template with recorded days follows one of them. When an activity ends at about the time
of day at which the same activity ended on another recorded day, the new day may continue with that
one instead. So durations and hours are those of the log, but new days differ from the recorded
ones. (Local resampling, as with k nearest neighbours by Lall and Sharma 1996, Water Resources
Research 32:679.)
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby, pairwise
from operator import attrgetter
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.configuration.problems import problem
from fleet2d.kernels import ANY_ROOM, DayPlanner, Role, RoomUse
from fleet2d.routines.distributions import Distribution
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.determinism import Draws

MILLION = 1_000_000
NEVER = 1 << 40  # later than any time [s]
PLANNED = Role.PLANNED.value
INTERRUPTS = Role.INTERRUPTS.value
RESUMES = Role.RESUMES.value
FINISHES = Role.FINISHES.value
REST = "rest"
SLEEP = "sleep"


class Episode(NamedTuple):
    """A part of a day in which one activity is done.

    Attributes:
        activity: The activity.
        begin: Its beginning [s since the midnight of the day's date].
        end: Its end, which is the beginning of the next episode.
        task: The template's task; empty for pastimes and sleep.
        room: The index of its room, if its household has chosen one; else ANY_ROOM.
        role: PLANNED, or of an interruption: it INTERRUPTS a planned episode, RESUMES it
            afterwards, or FINISHES it, so that it isn't resumed.
    """

    activity: str
    begin: int
    end: int
    task: str = ""
    room: int = ANY_ROOM
    role: int = PLANNED


# Makes an episode from a tuple of its fields without calling Python code, as days have many.
new_episode: Callable[[tuple[str, int, int, str, int, int]], Episode] = partial(
    tuple.__new__, Episode
)


class PrivateRooms(NamedTuple):
    """Rooms that only one member of a household uses at a time, as one member knows them.

    Attributes:
        rooms: For each activity that is done only in such rooms, their indices, the preferred one
            first.
        use: When others use them.
    """

    rooms: Mapping[str, Sequence[int]]
    use: RoomUse

    def of(self, activity: str) -> Sequence[int]:
        """Return the rooms of an exclusive activity, by index, the preferred one first."""
        return self.rooms.get(activity, (ANY_ROOM,))


class Job(NamedTuple):
    """A task in the form that the planner uses; times in seconds since the day's midnight.

    Attributes:
        task: The name of the task.
        activity: Its activity.
        starts: The distribution of its beginning; None: right after the job before it, on waking or
            before bed.
        takes: The distribution of its duration.
        until: Its latest end.
        after: The indices of the jobs before it, all lower than its own.
        chance: Its probability on a day [per million].
        needed: Whether it must not be left out if a day is too full.
        exclusive: Whether it needs a room that no other member of the household uses.
        place: -1 on waking, 1 before bed, else 0.
    """

    task: str
    activity: str
    starts: Distribution | None
    takes: Distribution
    until: int
    after: tuple[int, ...] = ()
    chance: int = MILLION
    needed: bool = True
    exclusive: bool = False
    place: int = 0


class PastimeOption(NamedTuple):
    """A pastime in the form that the planner uses; it may begin from `first` to `last` [s]."""

    activity: str
    weight: int
    takes: Distribution
    first: int
    last: int


@dataclass(frozen=True)
class DayPlan:
    """A template in the form that the planner uses; with `recorded` days, new ones resemble those.

    Attributes:
        name: The name of the template.
        wake: The distribution of waking [s].
        sleep: The distribution of going to bed [s].
        min_sleep: The minimum duration of sleep [s].
        jobs: The tasks.
        pastimes: What fills the time between them.
        recorded: The recorded days, if the template has some.
    """

    name: str
    wake: Distribution
    sleep: Distribution
    min_sleep: int
    jobs: tuple[Job, ...]
    pastimes: tuple[PastimeOption, ...]
    recorded: "Recording | None" = None

    @cached_property
    def activities(self) -> tuple[str, ...]:
        """The activities by their numbers in the core."""
        jobs = (job.activity for job in self.jobs)
        pastimes = (p.activity for p in self.pastimes)
        return tuple(dict.fromkeys((REST, SLEEP, *jobs, *pastimes)))

    @cached_property
    def core(self) -> DayPlanner:
        """The plan in the core."""
        number = {name: number for number, name in enumerate(self.activities)}
        jobs = [
            (number[activity], starts, takes, until, after, chance, needed, place)
            for _, activity, starts, takes, until, after, chance, needed, _, place in self.jobs
        ]
        pastimes = [
            (number[activity], weight, takes, first, last)
            for activity, weight, takes, first, last in self.pastimes
        ]
        return DayPlanner(self.sleep, self.min_sleep, jobs, pastimes, number[REST], number[SLEEP])


def plan_day(
    plan: DayPlan, draws: Draws, wake: int, next_wake: int, private: PrivateRooms | None = None
) -> list[Episode]:
    """Draw a day; a task whose private rooms are in use all the time is left out.

    Args:
        plan: The plan of the day's template.
        draws: The day's random draws.
        wake: When the day begins [s since its midnight].
        next_wake: When the next day begins [s since its midnight].
        private: The rooms that others may use; None: nobody does.

    Returns:
        The episodes from `wake` to `next_wake`, without a gap.

    Raises:
        RuntimeError: The tasks fit in no order.
    """
    use = None
    rooms = list[Sequence[int]]()
    if private is not None:
        use = private.use
        own = private.rooms
        rooms = [
            private.of(job.activity) if job.exclusive or job.activity in own else ()
            for job in plan.jobs
        ]
    rows = plan.core.plan(draws, wake, next_wake, use, rooms)
    if not rows:
        raise RuntimeError(
            f"the tasks of day {plan.name!r} fit in no order between waking and bedtime:"
            " shorten some, widen their times, or give some a probability below 1"
        )
    # the last is job -1
    names = plan.activities
    tasks = [*(job.task for job in plan.jobs), ""]
    return [
        new_episode((names[activity], begin, end, tasks[job], room, PLANNED))
        for activity, begin, end, job, room in rows
    ]


# Probability of a switch to another day where one is possible [in 16ths], and the largest distance
# between the times of both days [s].
CROSSING = 6
REACH_S = 1200
# An episode that lasts at least this many times the shift ends at its recorded time.
TAKES_UP = 4
MIN_EPISODE_S = 30  # minimum duration of an episode that was recorded with at least as much
END = "end"
# A recorded day that ends with no more sleep than this ends up, or out for the night [s].
NO_SLEEP_S = 60


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
    """Read a recorded day: ``06:43 wash, 06:55:20 breakfast, 22:31 sleep, 30:45 end``.

    Hours from 24 on are those of the next date; seconds are left out where they are 0.

    >>> parse_day("07:00 wash, 23:00 sleep, 31:10 end").end
    112200
    """
    if isinstance(value, RecordedDay):
        return value
    if not isinstance(value, str):
        raise problem(f"expected a recorded day like '07:00 wash, …, 30:45 end', got {value!r}")
    times = []
    names = []
    for entry in value.split(","):
        time, _, name = entry.strip().partition(" ")
        parts = time.split(":")
        if len(parts) not in (2, 3) or not (all(map(str.isdigit, parts)) and name):
            raise problem(
                f"expected a time and an activity like '07:00 wash', got {entry.strip()!r}"
            )
        times.append(
            sum(int(part) * unit for part, unit in zip(parts, (3600, 60, 1), strict=False))
        )
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
    return f"{at // 3600:02}:{at // 60 % 60:02}" + (f":{at % 60:02}" if at % 60 else "")


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
    """Return recorded days, indexed by when their activities end."""
    ends: dict[str, list[tuple[int, tuple[int, int]]]] = {}
    for d, day in enumerate(days):
        for i, name in enumerate(day.activities[:-1]):
            ends.setdefault(name, []).append((day.begins[i + 1], (d, i)))
    endings = {}
    for name, of_activity in ends.items():
        times, positions = zip(*sorted(of_activity), strict=True)
        endings[name] = list(times), list(positions)
    return Recording(tuple(days), endings)


def draw_source(recording: Recording, draws: Draws) -> int:
    """Draw the number of the recorded day with which a new day begins."""
    return draws.below(len(recording.days))


def draw_recorded(recording: Recording, first: int, draws: Draws, next_wake: int) -> list[Episode]:
    """Draw a day that begins like a recorded one.

    Args:
        recording: The recorded days.
        first: The number of the recorded day that it begins like.
        draws: The day's random draws.
        next_wake: When the next day begins [s].

    Returns:
        The episodes until `next_wake`, without a gap; the last one is sleep, or a night out.
    """
    d = first
    i = 0
    day = recording.days[d]
    now = day.begins[0]
    shift = 0
    result: list[Episode] = []
    while i < len(day.activities) - 1 and now < next_wake - MIN_EPISODE_S:
        over = day.begins[i + 1]
        if shift and over - day.begins[i] >= TAKES_UP * abs(shift):
            shift = 0
        shortest = min(MIN_EPISODE_S, over - day.begins[i])
        end = min(max(over + shift, now + shortest), next_wake)
        result.append(Episode(day.activities[i], now, end))
        now = end
        if draws.below(16) < CROSSING:
            d, i = _draw_ending(recording, day.activities[i], now, draws) or (d, i)
            day = recording.days[d]
            shift = now - day.begins[i + 1]
        i += 1
    if i == len(day.activities) - 1 and day.end - day.begins[-1] <= NO_SLEEP_S:
        result[-1] = result[-1]._replace(end=next_wake)
    elif now < next_wake:
        result.append(Episode(SLEEP, now, next_wake))
    elif result[-1].activity != SLEEP:
        result[-1] = result[-1]._replace(activity=SLEEP)
    return _merge_repeats(result)


def _draw_ending(
    recording: Recording, activity: str, now: int, draws: Draws
) -> tuple[int, int] | None:
    """Draw an ending of an activity at about a time: numbers of the day and of the activity."""
    times, positions = recording.endings[activity]
    low = bisect_left(times, now - REACH_S)
    high = bisect_right(times, now + REACH_S)
    return positions[low + draws.below(high - low)] if high > low else None


def _merge_repeats(day: Sequence[Episode]) -> list[Episode]:
    """Merge successive episodes of the same activity."""
    groups = (list(group) for _, group in groupby(day, key=attrgetter("activity")))
    return [group[0]._replace(end=group[-1].end) for group in groups]


def in_free_rooms(
    day: Sequence[Episode], exclusive: Iterable[str], private: PrivateRooms | None
) -> list[Episode]:
    """Return a day without episodes whose rooms others use; the episode before lasts longer.

    Args:
        day: The episodes of the day.
        exclusive: The activities that need a room which nobody else uses.
        private: The rooms that others may use; None: nobody does.
    """
    if private is None:
        return list(day)
    alone = {*exclusive, *private.rooms}
    result = list[Episode]()
    begin = day[0].begin
    for episode in day:
        room = ANY_ROOM
        if episode.activity in alone:
            rooms = private.of(episode.activity)
            duration = episode.end - episode.begin
            slot = private.use.free(rooms, episode.begin, episode.begin, duration, episode.end)
            if slot is None or slot[1] < episode.end:
                continue  # the episode before lasts longer, or the next one begins earlier
            room = slot[2]
        if result:
            result[-1] = result[-1]._replace(end=episode.begin)
        result.append(episode._replace(begin=episode.begin if result else begin, room=room))
    if result:
        result[-1] = result[-1]._replace(end=day[-1].end)
    return result or list(day)


def with_jobs(day: Sequence[Episode], jobs: Iterable[Job]) -> list[Episode]:
    """Return a day with joint jobs in place of what is planned then, unless the person sleeps."""
    for job in jobs:
        assert job.starts is not None
        begin = job.starts.shortest
        end = begin + job.takes.shortest
        asleep = any(d.activity == SLEEP and d.begin < end and begin < d.end for d in day)
        if not asleep and begin >= day[0].begin:
            day = with_episode(day, Episode(job.activity, begin, end, job.task))
    return list(day)


def with_episode(day: Sequence[Episode], episode: Episode) -> list[Episode]:
    """Return a day with an episode in place of what is planned then."""
    begin, end = episode.begin, episode.end
    before = [d._replace(end=min(d.end, begin)) for d in day if d.begin < begin]
    after = [d._replace(begin=max(d.begin, end)) for d in day if d.end > end]
    return [*before, episode, *after]
