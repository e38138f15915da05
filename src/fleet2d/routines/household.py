"""Households: people whose days depend on each other."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from fleet2d.bounds import MEMBERS, PERSONA_VALUES
from fleet2d.configuration.components import Settings, count, once
from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import did_you_mean, problem, problem_at, shown, suggest
from fleet2d.configuration.schema_forms import SchemaForms
from fleet2d.configuration.units import OnDays, PositiveDuration, Share, named_path
from fleet2d.errors import errors_as
from fleet2d.routines.activity import (
    AnyDurationDistribution,
    DurationDistribution,
    find_activity,
)
from fleet2d.routines.persona import AnyPersona, Dates, Timing, YearEvent, values_in
from fleet2d.routines.planner import Episode, with_episode
from fleet2d.runtime.clock import DAY, SECOND

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

    def model_post_init(self, _: object, /) -> None:
        """Require local times in order."""
        if self.begins.tzinfo or self.ends.tzinfo:
            raise problem("times of a scenario are local: leave out the time zone")
        if self.ends <= self.begins:
            raise problem(
                f"it begins at {self.begins}, which is not before its end at {self.ends}: swap them"
            )

    def seconds_since(self, midnight: datetime) -> tuple[int, int]:
        """Return its beginning and end [s since a midnight]."""
        return (self.begins - midnight) // SECOND, (self.ends - midnight) // SECOND


AnyPeriod = Annotated[Period, SchemaForms("pair")]
"""A period, in any form."""


def with_absences(
    day: Sequence[Episode],
    midnight: datetime,
    away: Sequence[Period],
    visits: Sequence[Period] | None,
) -> list[Episode]:
    """Return a day with a person's absences from home in place of what is planned then.

    Args:
        day: The episodes of the day, without a gap.
        midnight: The midnight that begins the day's date.
        away: The periods in which the person is away.
        visits: The only periods in which the person is at home; None: it lives there.
    """
    begin, end = day[0].begin, day[-1].end
    absences = [period.seconds_since(midnight) for period in away]
    if visits is not None:
        stays = sorted(period.seconds_since(midnight) for period in visits)
        lasts = [begin, *(b for _, b in stays)]
        firsts = [*(a for a, _ in stays), end]
        absences += [(a, b) for a, b in zip(lasts, firsts, strict=True) if a < b]
    for leaves, returns in absences:
        first = max(leaves, begin)
        last = min(returns, end)
        if first < last:
            day = with_episode(day, Episode(AWAY, first, last))
    return list(day)


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

    def model_post_init(self, context: object, /) -> None:
        """Require a time and days."""
        super().model_post_init(context)
        if self.at is None and self.between is None:
            raise problem("a joint activity needs 'at' or 'between'")
        if self.on is None and not self.dates:
            raise problem("a joint activity needs its days: 'on' or 'dates'")


class RandomVisits(Timing):
    """Visits by chance, at most one a day.

    Attributes:
        every: Mean time between two, at least a day.
        takes: How long one takes.
    """

    every: PositiveDuration
    takes: AnyDurationDistribution = DurationDistribution(mean=timedelta(hours=3))

    def model_post_init(self, context: object, /) -> None:
        """Require a time, and a day or more between two."""
        super().model_post_init(context)
        if self.at is None and self.between is None:
            raise problem("visits need 'at' or 'between'")
        if self.every < DAY:
            raise problem_at(("every",), "visits come once a day at most: give 1 d or more")


def _check_size(members: Any) -> Any:
    with errors_as(problem):
        MEMBERS.check(len(members) if isinstance(members, Mapping) else 0, "the household")
    return members


class Household(Settings):
    """The members of a household, and their joint activities.

    Attributes:
        name: The name of its random streams.
        members: The persona of each member, by the user's name.
        couples: Members who sleep in the same room and bed.
        together: Their joint activities, by name.
        away: Periods in which nobody is at home.
        trips: Periods in which some members are away, by name.
        visits: Members who are at home in these periods only, as far as their persona is, or who
            come by chance, by name.
        welcome: Probability that members at leisure come to the door when one comes home.
        year: What changes the days of all members in the course of a year, by name, as a vacation;
            templates (`days`) are those of the members who have them.
    """

    name: str = Field(default="home", min_length=1)
    members: Annotated[dict[str, AnyPersona], BeforeValidator(_check_size)] = Field(min_length=1)
    couples: tuple[tuple[str, str], ...] = ()
    together: dict[str, Annotated[JointActivity, SchemaForms("text")]] = Field(default_factory=dict)
    away: tuple[AnyPeriod, ...] = ()
    trips: dict[str, tuple[AnyPeriod, ...]] = Field(default_factory=dict)
    visits: dict[str, tuple[AnyPeriod, ...] | RandomVisits] = Field(default_factory=dict)
    welcome: Share = 0.0
    year: dict[str, YearEvent] = Field(default_factory=dict)

    def model_post_init(self, _: object, /) -> None:
        """Refuse names of people who are no members, and events of the year without effect."""
        named: list[tuple[tuple[str | int, ...], str]] = []
        named += [(("couples", i), n) for i, pair in enumerate(self.couples) for n in pair]
        named += [(("together", k, "who"), n) for k, t in self.together.items() for n in t.who]
        named += [(("trips", n), n) for n in self.trips]
        named += [(("visits", n), n) for n in self.visits]
        for where, name in named:
            if name not in self.members:
                hint = did_you_mean(name, self.members)
                raise problem_at(where, f"the household has no member {name!r}{hint}")
        for name, event in self.year.items():
            if event.becomes is not None:
                raise problem_at(("year", name, "becomes"), "only a member becomes another persona")
            if event.days and not any(event.days in p.plans for p in self.members.values()):
                known = {day for persona in self.members.values() for day in persona.plans}
                raise problem_at(
                    ("year", name, "days"),
                    f"no member has a template {event.days!r}{suggest(event.days, known)}",
                )
        for name, joint in self.together.items():
            with errors_as(partial(problem_at, ("together", name)), of=ValueError):
                find_activity(joint.activity or name, {})

    def bedrooms(self) -> dict[str, int]:
        """Return the number of each member's bedroom, from 0; couples share one."""
        partners: dict[str, list[str]] = {}
        for first, second in self.couples:
            partners.setdefault(first, []).append(second)
            partners.setdefault(second, []).append(first)
        groups: dict[str, int] = {}
        for member in self.members:
            known = (groups[name] for name in partners.get(member, ()) if name in groups)
            groups[member] = next(known, len(set(groups.values())))
        return groups

    def side_of_bed(self, member: str) -> tuple[int, int]:
        """Return the rank of a member among those who sleep in its bed, and their number."""
        pair = next((pair for pair in self.couples if member in pair), (member,))
        return pair.index(member), len(pair)


def _read_household(
    value: object, validate: ValidatorFunctionWrapHandler, info: ValidationInfo
) -> Household:
    """Read a household: a mapping, or the path of a YAML file, which is read for all members."""
    if not isinstance(value, str | Path):
        return validate(value)
    path = named_path(value)
    if not str(value) or not path.is_file():
        raise problem(
            f"expected a household (a mapping with 'members', or a YAML file), got {shown(value)}"
        )

    def read() -> Household:
        with errors_as(problem):
            data = read_document(path).data
        count(info, PERSONA_VALUES, values_in(data))
        return validate(data)

    return once(info, (Household, path), read)


AnyHousehold = Annotated[Household, WrapValidator(_read_household), SchemaForms("text")]
"""A household in a scenario: a mapping or a YAML file; dumped whole."""
