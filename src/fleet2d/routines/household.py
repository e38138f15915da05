"""Households: people whose days have something to do with each other.

Every member works out the days of all, from the same streams: they agree without a word, and
nothing depends on the order in which they are asked. In the order of the members, a day is drawn
for each, with what they do together as appointments, and round the times at which others use what
only one can use at a time: those before them, and all whose day before isn't over yet.
"""

from bisect import insort
from collections.abc import Mapping, Sequence
from datetime import date, datetime
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from fleet2d.component import Settings
from fleet2d.document import read_document
from fleet2d.errors import ScenarioError
from fleet2d.paths import folder_of
from fleet2d.problems import Location, did_you_mean, problem, problem_at, shown
from fleet2d.routines.activity import AnyTakes, find_activity
from fleet2d.routines.busy import ANY_ROOM, Busy
from fleet2d.routines.laws import uniform
from fleet2d.routines.life import Life
from fleet2d.routines.periods import AnyPeriod, without
from fleet2d.routines.persona import AnyPersona, Dates, Timing, holds_on
from fleet2d.routines.planner import (
    DAY_S,
    INTERRUPTS,
    MILLION,
    NEVER,
    NO_GAP_S,
    PLANNED,
    RESUMES,
    SLEEP,
    DayPlan,
    Doing,
    Job,
)
from fleet2d.routines.templates import starts
from fleet2d.routines.written import OrWritten
from fleet2d.streams import Draws, stream_key
from fleet2d.units import Share
from fleet2d.weekdays import OnDays, weekdays_of

MemberRooms = Mapping[str, Mapping[str, Sequence[int]]]
# So many days are remembered.
REMEMBERED = 8
# Somebody is welcomed after so long a time.
LONG_GONE_S = 1800
WELCOME = "welcome"
WELCOME_S = 90


class Together(Timing):
    """Something that members of a household do together.

    It takes the place of a member's own task of that name. Whose day has no room for it (at work,
    asleep) isn't there.
    """

    activity: str = Field(default="", description="what; left out: as it is called")
    who: tuple[str, ...] = Field(default=(), description="which members; left out: all")
    on: OnDays | None = Field(default=None, description="its days of the week")
    dates: Dates = Field(default=(), description="further dates, and [first, last] ranges")
    takes: AnyTakes | None = Field(default=None, description="how long; left out: as the activity")
    probability: Share = Field(default=1.0, description="on how many of those days it is done")

    @model_validator(mode="after")
    def _has_a_time(self) -> Self:
        if self.at is None and self.between is None:
            raise problem("what is done together needs 'at' or 'between'")
        if self.on is None and not self.dates:
            raise problem("what is done together needs its days: 'on' or 'dates'")
        return self


class Household(Settings):
    """Who lives together, and what they share."""

    name: str = Field(default="home", min_length=1, description="names its random streams")
    members: dict[str, AnyPersona] = Field(
        min_length=1, description="the persona of each member, by the user's name"
    )
    couples: tuple[tuple[str, str], ...] = Field(
        default=(), description="members who sleep in the same room and bed"
    )
    together: dict[str, Annotated[Together, OrWritten("text")]] = Field(
        default_factory=dict, description="what several of them do together, by name"
    )
    away: tuple[AnyPeriod, ...] = Field(default=(), description="when nobody is at home")
    trips: dict[str, tuple[AnyPeriod, ...]] = Field(
        default_factory=dict, description="when some members are away, by name"
    )
    visits: dict[str, tuple[AnyPeriod, ...]] = Field(
        default_factory=dict, description="members who are there in these periods only, by name"
    )
    welcome: Share = Field(
        default=0.0,
        description="how likely those at leisure come to the door when somebody comes home",
    )

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
                raise problem_at(where, f"{name!r} is no member of the household{hint}")
        for name, joint in self.together.items():
            try:
                find_activity(joint.activity or name, {})
            except ValueError as error:
                raise problem_at(("together", name), str(error)) from None
        return self

    def bedrooms(self) -> dict[str, int]:
        """Return which bedroom each member has, counted from 0: couples share one."""
        groups: dict[str, int] = {}
        for member in self.members:
            partners = [n for pair in self.couples if member in pair for n in pair if n in groups]
            groups[member] = groups[partners[0]] if partners else len(set(groups.values()))
        return groups

    def side_of_bed(self, member: str) -> tuple[int, int]:
        """Return which of how many sleepers of its bed a member is."""
        pair = next((pair for pair in self.couples if member in pair), (member,))
        return pair.index(member), len(pair)


def read_household(value: object) -> Any:
    """Read a household: a mapping, or the path of a YAML file."""
    if not isinstance(value, str | Path):
        return value
    path = folder_of(value) / Path(value).expanduser()
    if not str(value) or not path.is_file():
        raise problem(
            f"found {shown(value)}; a household is wanted: a mapping with 'members', or a YAML file"
        )
    try:
        return read_document(path).data
    except ScenarioError as error:
        raise problem(str(error)) from None


AnyHousehold = Annotated[Household, BeforeValidator(read_household), OrWritten("text")]
"""A household in a scenario: a mapping or a YAML file; dumped whole."""


class Lives:
    """The days of all members of a household, from the day before a run begins.

    A day depends on the one before: who is up all night is in the bathroom when others get up.
    """

    def __init__(
        self, household: Household, seed: int, first: int, rooms: MemberRooms | None = None
    ) -> None:
        """Prepare to draw days.

        Args:
            household: Whose.
            seed: Of the run.
            first: The ordinal of the first day.
            rooms: Where each member does what wants a room to itself: rooms by index, by activity,
                by member; None: one unknown room for all.
        """
        self.household = household
        self._seed = seed
        self._path = f"household.{household.name}"
        self._lives = {
            name: Life(persona, seed, f"{self._path}.{name}")
            for name, persona in household.members.items()
        }
        self._rooms = {
            name: self._in_order_of_preference(name, (rooms or {}).get(name, {}))
            for name in household.members
        }
        self._known: dict[int, Mapping[str, Sequence[Doing]]] = {}
        self._first = self._next = first

    def day(self, ordinal: int) -> Mapping[str, Sequence[Doing]]:
        """Return what each member does on the day of a date's ordinal.

        Raises:
            ValueError: It is before the first day.
        """
        if ordinal < self._first:
            raise ValueError(f"the days of a household are known from {self._first} on")
        if ordinal < self._next and ordinal not in self._known:  # forgotten: begin again
            self._known.clear()
            self._next = self._first
        while self._next <= ordinal:
            self._known.pop(self._next - REMEMBERED, None)
            self._known[self._next] = self._draw(self._next)
            self._next += 1
        return self._known[ordinal]

    def _in_order_of_preference(
        self, name: str, rooms: Mapping[str, Sequence[int]]
    ) -> dict[str, Sequence[int]]:
        """Return a member's rooms, its own one first."""
        own = Draws(stream_key(self._seed, f"{self._path}.{name}", "own room"), 0).below(1 << 20)
        return {
            activity: [*some[own % len(some) :], *some[: own % len(some)]]
            for activity, some in rooms.items()
            if some
        }

    def in_use(self, ordinal: int, member: str, room: int) -> list[tuple[int, int]]:
        """Return when others use a room that only one uses at a time, on a date [s]."""
        return [
            (doing.begin + shift, doing.end + shift)
            for day, shift in ((ordinal - 1, -DAY_S), (ordinal, 0), (ordinal + 1, DAY_S))
            if day >= self._first
            for name, doings in self.day(day).items()
            for doing in doings
            if name != member and doing.room in (ANY_ROOM, room) and self._is_exclusive(name, doing)
        ]

    def _is_exclusive(self, name: str, doing: Doing) -> bool:
        own = self.household.members[name].activities
        return doing.activity in self._rooms[name] or find_activity(doing.activity, own).exclusive

    def _is_out(self, name: str, doing: Doing) -> bool:
        return find_activity(doing.activity, self.household.members[name].activities).away

    def _draw(self, ordinal: int) -> Mapping[str, Sequence[Doing]]:
        joint = self._together(ordinal)
        before = self._known.get(ordinal - 1, {})
        busy: dict[int, list[tuple[int, int]]] = {}
        for name, doings in before.items():
            self._note_use(busy, name, doings, -DAY_S)
        days: dict[str, Sequence[Doing]] = {}
        for name, life in self._lives.items():
            plan = life.template(ordinal)
            for job, who in joint:
                if not who or name in who:
                    plan = _with(plan, job)
            day = life.draw_day(ordinal, plan, Busy(self._rooms[name], busy))
            days[name] = self._there(name, day, ordinal)
            self._note_use(busy, name, days[name])
        return self._welcomed(ordinal, days) if self.household.welcome else days

    def _note_use(
        self,
        busy: dict[int, list[tuple[int, int]]],
        name: str,
        doings: Sequence[Doing],
        shift: int = 0,
    ) -> None:
        """Add when a member uses rooms that only one uses at a time."""
        for doing in doings:
            if doing.end + shift > 0 and self._is_exclusive(name, doing):
                times = busy.setdefault(doing.room, [])
                insort(times, (doing.begin + shift, doing.end + shift))

    def _there(self, name: str, day: Sequence[Doing], ordinal: int) -> Sequence[Doing]:
        """Return a member's day, out of the home when it is on a trip or not on a visit."""
        household = self.household
        away = (*household.away, *household.trips.get(name, ()))
        visits = household.visits.get(name, ())
        if not away and not visits:
            return day
        return without(day, datetime.fromordinal(ordinal), away, visits)

    def _welcomed(
        self, ordinal: int, days: Mapping[str, Sequence[Doing]]
    ) -> Mapping[str, Sequence[Doing]]:
        """Let those who are at leisure come to the door when somebody comes home."""
        key = stream_key(self._seed, self._path, "welcome")
        draws = Draws(key, ordinal)
        result = dict(days)
        for comer, doings in days.items():
            for gone, back in pairwise(doings):
                comes_home = self._is_out(comer, gone) and not self._is_out(comer, back)
                if not comes_home or gone.end - gone.begin < LONG_GONE_S:
                    continue
                for name in result:
                    comes = draws.below(MILLION) < self.household.welcome * MILLION
                    if name == comer or comes:
                        result[name] = self._interrupted(name, result[name], back.begin)
        return result

    def _interrupted(self, name: str, day: Sequence[Doing], at: int) -> Sequence[Doing]:
        """Return a day in which a member comes to the door, if it is at home, at leisure."""
        for i, doing in enumerate(day):
            over = at + WELCOME_S
            if doing.begin <= at < doing.end:
                busy = doing.task or doing.activity == SLEEP or self._is_out(name, doing)
                busy = busy or self._is_exclusive(name, doing)
                if busy or doing.end - over < NO_GAP_S:
                    return day
                before = [doing._replace(end=at)] if doing.begin < at else []
                welcome = Doing(WELCOME, at, over, role=INTERRUPTS)
                role = RESUMES if doing.begin < at and doing.role == PLANNED else doing.role
                after = doing._replace(begin=over, role=role)
                return [*day[:i], *before, welcome, after, *day[i + 1 :]]
        return day

    def _together(self, ordinal: int) -> list[tuple[Job, tuple[str, ...]]]:
        """Draw what is done together on a day: a job, and whose."""
        day = date.fromordinal(ordinal)
        jobs = []
        for name, joint in self.household.together.items():
            if day.weekday() not in weekdays_of(joint.on) and not holds_on(joint.dates, day):
                continue
            draws = Draws(stream_key(self._seed, self._path, f"together {name}"), ordinal)
            if draws.below(MILLION) >= joint.probability * MILLION:
                continue
            what = joint.activity or name
            begin = starts(joint, 0).draw(draws)
            takes = (joint.takes or find_activity(what, {}).takes).table().draw(draws)
            at, long = uniform(begin, begin), uniform(takes, takes)
            jobs.append((Job(name, what, at, long, until=NEVER, needed=False), joint.who))
        return jobs


def _with(plan: DayPlan, job: Job) -> DayPlan:
    """Return a template with a job, in place of one of the same name if there is one."""
    jobs = list(plan.jobs)
    at = next((i for i, own in enumerate(jobs) if own.task == job.task), None)
    if at is None:
        jobs.append(job)
    else:
        jobs[at] = job._replace(after=jobs[at].after)
    return plan._replace(jobs=tuple(jobs))
