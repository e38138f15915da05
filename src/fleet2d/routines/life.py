"""Lives: the days of a person or a household, and what changes them in the course of a year."""

from bisect import bisect_left
from calendar import monthrange
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date, datetime, timedelta
from itertools import pairwise

import numpy as np

from fleet2d.configuration.units import weekdays_of
from fleet2d.kernels import ANY_ROOM, NO_GAP_S, RoomUse
from fleet2d.routines import planner
from fleet2d.routines.activity import find_activity, seconds
from fleet2d.routines.distributions import exponential, uniform
from fleet2d.routines.household import Household, Period, RandomVisits, with_absences
from fleet2d.routines.interruptions import interrupt
from fleet2d.routines.persona import Persona, YearEvent, holds_on
from fleet2d.routines.planner import PLANNED, SLEEP, DayPlan, Episode, Job, PrivateRooms
from fleet2d.routines.templates import starts
from fleet2d.runtime.clock import DAY_S, SECOND
from fleet2d.runtime.determinism import Draws, stream_key

Days = tuple[int, int]
"""The ordinals of the first and the last day."""

FOREVER = date.max.toordinal()
# When those who are away leave on the first day, and are back on the last.
LEAVES = timedelta(hours=10)
RETURNS = timedelta(hours=18)


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
        name = usual
        event = self._becomes(ordinal)
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
        spans = (map(datetime.fromordinal, span) for span in sorted(found))
        return [Period(begins=first + LEAVES, ends=last + RETURNS) for first, last in spans]

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
        begins = set[int]()
        for each in (year - 1, year):
            first, last = _part_of_year(event.season, each)
            begins.update(range(first, last + 1))
        return [span for span in found if span[0] in begins]
    if event.holidays is not None:
        return [(day.toordinal(), day.toordinal()) for day in event.dates if day.year == year]
    if event.season is not None:
        return [_part_of_year(event.season, year)]
    if event.once is not None:
        ends = event.once if isinstance(event.once, tuple) else (event.once, event.once)
        first = ends[0].toordinal()
        last = ends[1].toordinal()
    else:
        assert event.yearly is not None
        first, last = _part_of_year(event.yearly, year)
    begin = first + draws.below(last - first + 1)
    return [(begin, FOREVER if event.lasts is None else begin + _length(event, draws) - 1)]


def _by_chance(every: timedelta, event: YearEvent, draws: Draws, year: int) -> list[Days]:
    gap = exponential(seconds(every))
    now_s = 0
    found = list[Days]()
    first = date(year, 1, 1).toordinal()
    last = date(year, 12, 31).toordinal()
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


# The number of days that are kept after they were drawn, of a person and of a household.
CACHED_DAYS = 3
CACHED_HOUSEHOLD_DAYS = 8
# The shortest absence after which a member is welcomed [s].
LONG_GONE_S = 1800
WELCOME = "welcome"
WELCOME_S = 90

MemberRooms = Mapping[str, Mapping[str, Sequence[int]]]


class Life:
    """The days of a persona.

    A day is identified by the ordinal of its date, and drawn from it: no day depends on when a run
    begins, or on which days were drawn before.

    Example:
        >>> from fleet2d.routines.persona import bundled_persona
        >>> life = Life(bundled_persona("retired"), seed=4, path="users.ana")
        >>> day = life.day(date(2026, 1, 5).toordinal())
        >>> [episode.activity for episode in day[:3]], day[-1].activity
        (['toilet', 'wash_hands', 'wash'], 'sleep')
    """

    def __init__(self, persona: Persona, seed: int, path: str, shared: Year | None = None) -> None:
        """Prepare to draw days.

        Args:
            persona: The persona.
            seed: The seed of the run.
            path: The path of the person, which names its random streams.
            shared: The year of its household, which precedes its own.
        """
        self.persona = persona
        own = Year(persona.year, seed, path) if persona.year else None
        self._years = [year for year in (own, shared) if year is not None]
        self._wake = stream_key(seed, path, "wake")
        self._day = stream_key(seed, path, "day")
        self._needs = stream_key(seed, path, "needs")
        self._cache: dict[int, Sequence[Episode]] = {}
        self._templates: dict[int, DayPlan] = {}

    def __getstate__(self) -> dict[str, object]:
        """Leave out the days: they are redrawn, and make up most of the state."""
        return {**self.__dict__, "_cache": {}, "_templates": {}}

    def template(self, ordinal: int) -> DayPlan:
        """Return the plan of the template that a day is drawn from."""
        if ordinal not in self._templates:
            if len(self._templates) >= CACHED_DAYS:
                del self._templates[next(iter(self._templates))]
            name = self.persona.day(date.fromordinal(ordinal))
            for year in self._years:
                name = year.template(self.persona, ordinal, name)
            self._templates[ordinal] = self.persona.plans[name]
        return self._templates[ordinal]

    def wake(self, ordinal: int) -> int:
        """Return when a day begins [s since its midnight]."""
        plan = self.template(ordinal)
        draws = Draws(self._wake, ordinal)
        if plan.recorded is not None:
            return plan.recorded.days[planner.draw_source(plan.recorded, draws)].begins[0]
        return plan.wake.draw(draws)

    def draws(self, ordinal: int) -> Draws:
        """Return the random draws of a day."""
        return Draws(self._day, ordinal)

    def day(self, ordinal: int) -> Sequence[Episode]:
        """Return the episodes of a day, from waking to the next waking [s since its midnight]."""
        if ordinal not in self._cache:
            if len(self._cache) >= CACHED_DAYS:
                del self._cache[next(iter(self._cache))]
            self._cache[ordinal] = self.draw_day(ordinal, self.template(ordinal))
        return self._cache[ordinal]

    def draw_day(
        self, ordinal: int, plan: DayPlan, private: PrivateRooms | None = None
    ) -> Sequence[Episode]:
        """Draw a day from a plan, which may differ from its template's, with interruptions."""
        day = self.draw_uninterrupted(ordinal, plan, private)
        persona = self.persona
        for year in self._years:
            persona = year.persona(persona, ordinal)
        if persona.needs or persona.errands:
            day = interrupt(persona.interruptions, Draws(self._needs, ordinal), day, private)
        away = [period for year in self._years for period in year.absences(ordinal)]
        return with_absences(day, datetime.fromordinal(ordinal), away, None) if away else day

    def draw_uninterrupted(
        self, ordinal: int, plan: DayPlan, private: PrivateRooms | None = None
    ) -> Sequence[Episode]:
        """Draw a day from a plan, without interruptions."""
        next_wake = self.wake(ordinal + 1) + DAY_S
        if plan.recorded is not None:
            first = planner.draw_source(plan.recorded, Draws(self._wake, ordinal))
            day = planner.draw_recorded(plan.recorded, first, self.draws(ordinal), next_wake)
            exclusive = self.persona.interruptions.exclusive
            return planner.in_free_rooms(planner.with_jobs(day, plan.jobs), exclusive, private)
        return planner.plan_day(plan, self.draws(ordinal), self.wake(ordinal), next_wake, private)


class Lives:
    """The days of all members of a household, from the day before a run begins.

    Days are drawn in the order of the members, with joint activities as appointments. A member
    keeps out of private rooms while they are used by earlier members, and by all members whose
    previous day isn't over yet: a day depends on the one before.

    Attributes:
        household: The household.
        first: The ordinal of the first day.
    """

    def __init__(
        self, household: Household, seed: int, first: int, rooms: MemberRooms | None = None
    ) -> None:
        """Prepare to draw days.

        Args:
            household: The household.
            seed: The seed of the run.
            first: The ordinal of the first day.
            rooms: The rooms of each member's exclusive activities: indices by activity, by member;
                None: one unknown room for all.
        """
        self.household = household
        self._seed = seed
        self._path = f"household.{household.name}"
        shared = Year(household.year, seed, self._path) if household.year else None
        self._lives = {
            name: Life(persona, seed, f"{self._path}.{name}", shared)
            for name, persona in household.members.items()
        }
        self._rooms = {
            name: self._by_preference(name, (rooms or {}).get(name, {}))
            for name in household.members
        }
        self._cache: dict[int, Mapping[str, Sequence[Episode]]] = {}
        self._uses: dict[int, tuple[list[tuple[int, int, str, int]], int]] = {}
        self.first = self._next = first

    def day(self, ordinal: int) -> Mapping[str, Sequence[Episode]]:
        """Return the episodes of each member on the day of a date's ordinal.

        Raises:
            ValueError: It is before the first day.
        """
        if ordinal < self.first:
            raise ValueError(
                f"day {ordinal} is before the first day of the household, {self.first}"
            )
        if ordinal < self._next and ordinal not in self._cache:  # draw all days again
            self._cache.clear()
            self._next = self.first
        while self._next <= ordinal:
            self._cache.pop(self._next - CACHED_HOUSEHOLD_DAYS, None)
            self._uses.pop(self._next - CACHED_HOUSEHOLD_DAYS, None)
            self._cache[self._next] = self._draw(self._next)
            self._next += 1
        return self._cache[ordinal]

    def _by_preference(
        self, name: str, rooms: Mapping[str, Sequence[int]]
    ) -> dict[str, Sequence[int]]:
        """Order the rooms of each activity, beginning at one randomly chosen for this member."""
        draws = Draws(stream_key(self._seed, f"{self._path}.{name}", "own room"), 0)
        shift = draws.below(1 << 20)
        return {
            activity: [*indices[shift % len(indices) :], *indices[: shift % len(indices)]]
            for activity, indices in rooms.items()
            if indices
        }

    def in_use(self, ordinal: int, member: str, room: int, first: int, last: int) -> bool:
        """Return whether others use a private room between two times [s since a midnight].

        Args:
            ordinal: The ordinal of the date that the midnight begins.
            member: The member who would use it.
            room: The room.
            first: The first time.
            last: The last time.
        """
        for day, shift in ((ordinal - 1, -DAY_S), (ordinal, 0), (ordinal + 1, DAY_S)):
            uses, longest = self._private_uses(day) if day >= self.first else ([], 0)
            begin = bisect_left(uses, (first - shift - longest,))
            for _, use_end, name, of in uses[begin : bisect_left(uses, (last - shift,))]:
                if use_end + shift > first and name != member and of in (ANY_ROOM, room):
                    return True
        return False

    def _private_uses(self, ordinal: int) -> tuple[list[tuple[int, int, str, int]], int]:
        """Return the uses of private rooms on a day, in order, and how long the longest is [s].

        Of each use: its begin and end [s since midnight], the member, and the room.
        """
        days = self.day(ordinal)
        if ordinal not in self._uses:
            uses = sorted(
                (episode.begin, episode.end, name, episode.room)
                for name, episodes in days.items()
                for episode in episodes
                if self._is_exclusive(name, episode)
            )
            longest = max((end - begin for begin, end, *_ in uses), default=0)
            self._uses[ordinal] = uses, longest
        return self._uses[ordinal]

    def _is_exclusive(self, name: str, episode: Episode) -> bool:
        activity = self.household.members[name].activity(episode.activity)
        return episode.activity in self._rooms[name] or activity.exclusive

    def is_out(self, name: str, episode: Episode) -> bool:
        """Return whether a member is out of the home for an episode."""
        return self.household.members[name].activity(episode.activity).away

    def _draw(self, ordinal: int) -> Mapping[str, Sequence[Episode]]:
        """Draw the days of all members for a date."""
        joint_jobs = self._joint_jobs(ordinal)
        yesterday = self._cache.get(ordinal - 1, {})
        use = RoomUse()
        for name, episodes in yesterday.items():
            self._add_use(use, name, episodes, -DAY_S)
        days: dict[str, Sequence[Episode]] = {}
        for name, life in self._lives.items():
            plan = life.template(ordinal)
            for job, members in joint_jobs:
                if not members or name in members:
                    plan = _with_job(plan, job)
            day = life.draw_day(ordinal, plan, PrivateRooms(self._rooms[name], use))
            days[name] = self._with_absences(name, day, ordinal)
            self._add_use(use, name, days[name])
        return self._with_welcomes(ordinal, days) if self.household.welcome else days

    def _add_use(
        self, use: RoomUse, name: str, episodes: Sequence[Episode], shift: int = 0
    ) -> None:
        """Add the times at which a member uses private rooms, shifted by some seconds."""
        for episode in episodes:
            if episode.end + shift > 0 and self._is_exclusive(name, episode):
                use.add(episode.room, episode.begin + shift, episode.end + shift)

    def _with_absences(self, name: str, day: Sequence[Episode], ordinal: int) -> Sequence[Episode]:
        """Return a member's day, away from home on trips and, for visitors, between visits."""
        household = self.household
        away = (*household.away, *household.trips.get(name, ()))
        visits = self._visits(name, ordinal)
        if not away and visits is None:
            return day
        return with_absences(day, datetime.fromordinal(ordinal), away, visits)

    def _visits(self, name: str, ordinal: int) -> Sequence[Period] | None:
        """Return a member's visits on a day and the days beside it; None: the member lives here."""
        visits = self.household.visits.get(name)
        if not isinstance(visits, RandomVisits):
            return visits or None
        key = stream_key(self._seed, self._path, f"visits {name}")
        found = []
        begins = starts(visits, 0)
        takes = visits.takes.table()
        for day in (ordinal - 1, ordinal, ordinal + 1):
            draws = Draws(key, day)
            if draws.below(visits.every // SECOND) < DAY_S:
                begin = datetime.fromordinal(day) + begins.draw(draws) * SECOND
                found.append(Period(begins=begin, ends=begin + takes.draw(draws) * SECOND))
        return found

    def _with_welcomes(
        self, ordinal: int, days: Mapping[str, Sequence[Episode]]
    ) -> Mapping[str, Sequence[Episode]]:
        """Return days in which members at leisure come to the door when one comes home."""
        key = stream_key(self._seed, self._path, "welcome")
        draws = Draws(key, ordinal)
        result = dict(days)
        for member, episodes in days.items():
            for absence, return_home in pairwise(episodes):
                comes_home = self.is_out(member, absence) and not self.is_out(member, return_home)
                if not comes_home or absence.end - absence.begin < LONG_GONE_S:
                    continue
                for name in result:
                    comes = draws.below(planner.MILLION) < self.household.welcome * planner.MILLION
                    if name == member or comes:
                        result[name] = self._with_welcome(name, result[name], return_home.begin)
        return result

    def _with_welcome(self, name: str, day: Sequence[Episode], at: int) -> Sequence[Episode]:
        """Return a day in which a member comes to the door, if they are free at that time."""
        for i, episode in enumerate(day):
            end = at + WELCOME_S
            if episode.begin <= at < episode.end:
                is_busy = episode.task or episode.activity == SLEEP or self.is_out(name, episode)
                is_busy = is_busy or self._is_exclusive(name, episode)
                if is_busy or episode.end - end < NO_GAP_S:
                    return day
                before = [episode._replace(end=at)] if episode.begin < at else []
                welcome = Episode(WELCOME, at, end, role=planner.INTERRUPTS)
                is_begun = episode.begin < at and episode.role == PLANNED
                role = planner.RESUMES if is_begun else episode.role
                after = episode._replace(begin=end, role=role)
                return [*day[:i], *before, welcome, after, *day[i + 1 :]]
        return day

    def _joint_jobs(self, ordinal: int) -> list[tuple[Job, tuple[str, ...]]]:
        """Draw the joint activities of a day: each a job and its members, () for all."""
        day = date.fromordinal(ordinal)
        jobs = []
        for name, joint in self.household.together.items():
            if day.weekday() not in weekdays_of(joint.on) and not holds_on(joint.dates, day):
                continue
            draws = Draws(stream_key(self._seed, self._path, f"together {name}"), ordinal)
            if draws.below(planner.MILLION) >= joint.probability * planner.MILLION:
                continue
            activity = joint.activity or name
            begin = starts(joint, 0).draw(draws)
            takes = (joint.takes or find_activity(activity, {}).takes).table().draw(draws)
            at = uniform(begin, begin)
            duration = uniform(takes, takes)
            job = Job(name, activity, at, duration, until=planner.NEVER, needed=False)
            jobs.append((job, joint.who))
        return jobs


def _with_job(plan: DayPlan, job: Job) -> DayPlan:
    """Return a plan with a job, which replaces one of the same task."""
    jobs = {own.task: own for own in plan.jobs}
    jobs[job.task] = job._replace(after=jobs[job.task].after) if job.task in jobs else job
    return replace(plan, jobs=tuple(jobs.values()))
