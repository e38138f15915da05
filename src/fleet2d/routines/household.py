"""Households: people whose days depend on each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import Location, did_you_mean, problem, problem_at, shown
from fleet2d.configuration.units import OnDays, Share, folder_of, weekdays_of
from fleet2d.errors import ScenarioError
from fleet2d.kernels.motion import ANY_ROOM, NO_GAP_S, RoomUse
from fleet2d.routines.activity import AnyDurationDistribution, SchemaForms, find_activity
from fleet2d.routines.distributions import uniform
from fleet2d.routines.life import Life
from fleet2d.routines.persona import AnyPersona, Dates, Timing, holds_on
from fleet2d.routines.planner import (
    DAY_S,
    INTERRUPTS,
    MILLION,
    NEVER,
    PLANNED,
    RESUMES,
    SLEEP,
    DayPlan,
    Doing,
    Job,
    PrivateRooms,
)
from fleet2d.routines.templates import starts
from fleet2d.runtime.determinism import Draws, stream_key

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


MemberRooms = Mapping[str, Mapping[str, Sequence[int]]]
# The number of days that are kept after they were drawn.
CACHED_DAYS = 8
# The least absence after which a member is welcomed [s].
LONG_GONE_S = 1800
WELCOME = "welcome"
WELCOME_S = 90


class JointActivity(Timing):
    """Something that members of a household do together.

    It replaces a member's own task of that name. Members whose day has no room for it (at work,
    asleep) don't take part.

    Attributes:
        activity: The activity; left out: its own name.
        who: The members; left out: all.
        on: Its days of the week.
        dates: Further dates, and [first, last] ranges.
        takes: Its duration; left out: that of the activity.
        probability: Its probability on each of those days.
    """

    activity: str = ""
    who: tuple[str, ...] = ()
    on: OnDays | None = None
    dates: Dates = ()
    takes: AnyDurationDistribution | None = None
    probability: Share = 1.0

    @model_validator(mode="after")
    def _has_a_time(self) -> Self:
        if self.at is None and self.between is None:
            raise problem("a joint activity needs 'at' or 'between'")
        if self.on is None and not self.dates:
            raise problem("a joint activity needs its days: 'on' or 'dates'")
        return self


class Household(Settings):
    """The members of a household, and their joint activities.

    Attributes:
        name: The name of its random streams.
        members: The persona of each member, by the user's name.
        couples: Members who sleep in the same room and bed.
        together: Their joint activities, by name.
        away: Periods in which nobody is at home.
        trips: Periods in which some members are away, by name.
        visits: Members who are at home in these periods only, by name.
        welcome: Probability that members at leisure come to the door when one comes home.
    """

    name: str = Field(default="home", min_length=1)
    members: dict[str, AnyPersona] = Field(min_length=1)
    couples: tuple[tuple[str, str], ...] = ()
    together: dict[str, Annotated[JointActivity, SchemaForms("text")]] = Field(default_factory=dict)
    away: tuple[AnyPeriod, ...] = ()
    trips: dict[str, tuple[AnyPeriod, ...]] = Field(default_factory=dict)
    visits: dict[str, tuple[AnyPeriod, ...]] = Field(default_factory=dict)
    welcome: Share = 0.0

    @model_validator(mode="after")
    def _names_members(self) -> Self:
        named: list[tuple[Location, str]] = []
        named += [(("couples", i), n) for i, pair in enumerate(self.couples) for n in pair]
        named += [(("together", k, "who"), n) for k, t in self.together.items() for n in t.who]
        named += [(("trips", n), n) for n in self.trips]
        named += [(("visits", n), n) for n in self.visits]
        for where, name in named:
            if name not in self.members:
                hint = did_you_mean(name, self.members)
                raise problem_at(where, f"the household has no member {name!r}{hint}")
        for name, joint in self.together.items():
            try:
                find_activity(joint.activity or name, {})
            except ValueError as error:
                raise problem_at(("together", name), str(error)) from None
        return self

    def bedrooms(self) -> dict[str, int]:
        """Return the number of each member's bedroom, from 0; couples share one."""
        groups: dict[str, int] = {}
        for member in self.members:
            partners = [n for pair in self.couples if member in pair for n in pair if n in groups]
            groups[member] = groups[partners[0]] if partners else len(set(groups.values()))
        return groups

    def side_of_bed(self, member: str) -> tuple[int, int]:
        """Return the rank of a member among those who sleep in its bed, and their number."""
        pair = next((pair for pair in self.couples if member in pair), (member,))
        return pair.index(member), len(pair)


def read_household(value: object) -> Any:
    """Read a household: a mapping, or the path of a YAML file."""
    if not isinstance(value, str | Path):
        return value
    path = folder_of(value) / Path(value).expanduser()
    if not str(value) or not path.is_file():
        raise problem(
            f"expected a household (a mapping with 'members', or a YAML file), got {shown(value)}"
        )
    try:
        return read_document(path).data
    except ScenarioError as error:
        raise problem(str(error)) from None


AnyHousehold = Annotated[Household, BeforeValidator(read_household), SchemaForms("text")]
"""A household in a scenario: a mapping or a YAML file; dumped whole."""


class Lives:
    """The days of all members of a household, from the day before a run begins.

    A day depends on the one before: a member who is up all night may use the bathroom when others
    get up.

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
        self._lives = {
            name: Life(persona, seed, f"{self._path}.{name}")
            for name, persona in household.members.items()
        }
        self._rooms = {
            name: self._by_preference(name, (rooms or {}).get(name, {}))
            for name in household.members
        }
        self._cache: dict[int, Mapping[str, Sequence[Doing]]] = {}
        self.first = self._next = first

    def day(self, ordinal: int) -> Mapping[str, Sequence[Doing]]:
        """Return the doings of each member on the day of a date's ordinal.

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
            self._cache.pop(self._next - CACHED_DAYS, None)
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

    def in_use(self, ordinal: int, member: str, room: int) -> list[tuple[int, int]]:
        """Return when others use a private room [s since the midnight of a date]."""
        return [
            (doing.begin + shift, doing.end + shift)
            for day, shift in ((ordinal - 1, -DAY_S), (ordinal, 0), (ordinal + 1, DAY_S))
            if day >= self.first
            for name, doings in self.day(day).items()
            for doing in doings
            if name != member and doing.room in (ANY_ROOM, room) and self._is_exclusive(name, doing)
        ]

    def _is_exclusive(self, name: str, doing: Doing) -> bool:
        own = self.household.members[name].activities
        return doing.activity in self._rooms[name] or find_activity(doing.activity, own).exclusive

    def is_out(self, name: str, doing: Doing) -> bool:
        """Return whether a member is out of the home for a doing."""
        return find_activity(doing.activity, self.household.members[name].activities).away

    def _draw(self, ordinal: int) -> Mapping[str, Sequence[Doing]]:
        """Draw the days of all members for a date."""
        joint_jobs = self._joint_jobs(ordinal)
        yesterday = self._cache.get(ordinal - 1, {})
        use = RoomUse()
        for name, doings in yesterday.items():
            self._add_use(use, name, doings, -DAY_S)
        days: dict[str, Sequence[Doing]] = {}
        for name, life in self._lives.items():
            plan = life.template(ordinal)
            for job, members in joint_jobs:
                if not members or name in members:
                    plan = _with_job(plan, job)
            day = life.draw_day(ordinal, plan, PrivateRooms(self._rooms[name], use))
            days[name] = self._with_absences(name, day, ordinal)
            self._add_use(use, name, days[name])
        return self._with_welcomes(ordinal, days) if self.household.welcome else days

    def _add_use(self, use: RoomUse, name: str, doings: Sequence[Doing], shift: int = 0) -> None:
        """Add the times at which a member uses private rooms, shifted by some seconds."""
        for doing in doings:
            if doing.end + shift > 0 and self._is_exclusive(name, doing):
                use.add(doing.room, doing.begin + shift, doing.end + shift)

    def _with_absences(self, name: str, day: Sequence[Doing], ordinal: int) -> Sequence[Doing]:
        """Return a member's day, away from home on trips and, for visitors, between visits."""
        household = self.household
        away = (*household.away, *household.trips.get(name, ()))
        visits = household.visits.get(name, ())
        if not away and not visits:
            return day
        return with_absences(day, datetime.fromordinal(ordinal), away, visits)

    def _with_welcomes(
        self, ordinal: int, days: Mapping[str, Sequence[Doing]]
    ) -> Mapping[str, Sequence[Doing]]:
        """Return days in which members at leisure come to the door when one comes home."""
        key = stream_key(self._seed, self._path, "welcome")
        draws = Draws(key, ordinal)
        result = dict(days)
        for member, doings in days.items():
            for absence, return_home in pairwise(doings):
                comes_home = self.is_out(member, absence) and not self.is_out(member, return_home)
                if not comes_home or absence.end - absence.begin < LONG_GONE_S:
                    continue
                for name in result:
                    comes = draws.below(MILLION) < self.household.welcome * MILLION
                    if name == member or comes:
                        result[name] = self._with_welcome(name, result[name], return_home.begin)
        return result

    def _with_welcome(self, name: str, day: Sequence[Doing], at: int) -> Sequence[Doing]:
        """Return a day in which a member comes to the door, if they are free at that time."""
        for i, doing in enumerate(day):
            end = at + WELCOME_S
            if doing.begin <= at < doing.end:
                is_busy = doing.task or doing.activity == SLEEP or self.is_out(name, doing)
                is_busy = is_busy or self._is_exclusive(name, doing)
                if is_busy or doing.end - end < NO_GAP_S:
                    return day
                before = [doing._replace(end=at)] if doing.begin < at else []
                welcome = Doing(WELCOME, at, end, role=INTERRUPTS)
                role = RESUMES if doing.begin < at and doing.role == PLANNED else doing.role
                after = doing._replace(begin=end, role=role)
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
            if draws.below(MILLION) >= joint.probability * MILLION:
                continue
            activity = joint.activity or name
            begin = starts(joint, 0).draw(draws)
            takes = (joint.takes or find_activity(activity, {}).takes).table().draw(draws)
            at, duration = uniform(begin, begin), uniform(takes, takes)
            job = Job(name, activity, at, duration, until=NEVER, needed=False)
            jobs.append((job, joint.who))
        return jobs


def _with_job(plan: DayPlan, job: Job) -> DayPlan:
    """Return a plan with a job, which replaces one of the same task."""
    jobs = list(plan.jobs)
    index = next((i for i, own in enumerate(jobs) if own.task == job.task), None)
    if index is None:
        jobs.append(job)
    else:
        jobs[index] = job._replace(after=jobs[index].after)
    return replace(plan, jobs=tuple(jobs))
