"""Households: people whose days have something to do with each other.

Every member works out the days of all, from the same streams: they agree without a word, and
nothing depends on the order in which they are asked. In the order of the members, a day is drawn
for each, with what they do together as appointments, and round the times at which those before them
use what only one can use at a time.
"""

from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from fleet2d.component import Settings
from fleet2d.errors import ScenarioError
from fleet2d.paths import folder_of
from fleet2d.problems import Location, did_you_mean, problem, problem_at, shown
from fleet2d.routines.activity import AnyTakes, find_activity
from fleet2d.routines.laws import uniform
from fleet2d.routines.life import Life
from fleet2d.routines.periods import AnyPeriod
from fleet2d.routines.persona import AnyPersona, Dates, OnDays, Timing, holds_on, weekdays_of
from fleet2d.routines.planner import MILLION, NEVER, DayPlan, Doing, Job
from fleet2d.routines.templates import starts
from fleet2d.routines.written import OrWritten
from fleet2d.scenario.document import read_document
from fleet2d.streams import Draws, stream_key
from fleet2d.units import Share

# So many days are remembered, of those that were asked for.
REMEMBERED = 8


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

    @model_validator(mode="after")
    def _names_members(self) -> Self:
        named: list[tuple[Location, str]] = []
        named += [(("couples", i), n) for i, pair in enumerate(self.couples) for n in pair]
        named += [(("together", k, "who"), n) for k, t in self.together.items() for n in t.who]
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
    """The days of all members of a household."""

    def __init__(self, household: Household, seed: int) -> None:
        self.household = household
        self._seed = seed
        self._path = f"household.{household.name}"
        self._lives = {
            name: Life(persona, seed, f"{self._path}.{name}")
            for name, persona in household.members.items()
        }
        self._known: dict[int, Mapping[str, Sequence[Doing]]] = {}

    def day(self, ordinal: int) -> Mapping[str, Sequence[Doing]]:
        """Return what each member does on the day of a date's ordinal."""
        if ordinal not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            self._known[ordinal] = self._draw(ordinal)
        return self._known[ordinal]

    def _draw(self, ordinal: int) -> Mapping[str, Sequence[Doing]]:
        joint = self._together(ordinal)
        busy: list[tuple[int, int]] = []
        days: dict[str, Sequence[Doing]] = {}
        for name, life in self._lives.items():
            plan = life.template(ordinal)
            for job, who in joint:
                if not who or name in who:
                    plan = _with(plan, job)
            days[name] = life.draw_day(ordinal, plan, busy)
            persona = self.household.members[name]
            busy += [(d.begin, d.end) for d in days[name] if persona.activity(d.activity).exclusive]
            busy.sort()
        return days

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
