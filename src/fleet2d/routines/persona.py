"""Personas: who somebody is, as the template of their days."""

from collections.abc import Mapping
from datetime import date, timedelta
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    WrapSerializer,
    model_validator,
)

from fleet2d.component import Settings
from fleet2d.document import read_document
from fleet2d.errors import ScenarioError
from fleet2d.paths import folder_of
from fleet2d.problems import did_you_mean, problem, problem_at, shown
from fleet2d.routines.activity import Activity, AnyTakes, catalogue, find_activity
from fleet2d.routines.interruptions import Body, body_of
from fleet2d.routines.manners import Manners
from fleet2d.routines.needs import (
    AnyErrand,
    AnyNeed,
    activities_of,
    named_activities,
    usual_errands,
    usual_needs,
)
from fleet2d.routines.planner import REST, SLEEP, DayPlan
from fleet2d.routines.recorded import AnyRecordedDay
from fleet2d.routines.templates import check, day_plans
from fleet2d.routines.written import OrWritten
from fleet2d.units import Duration, Share, TimeOfDay, format_time_of_day
from fleet2d.weekdays import WEEKDAYS, OnDays, weekdays_of

BUNDLED = Path(__file__).parent / "personas"
DAY = timedelta(days=1)
Dates = tuple[date | tuple[date, date], ...]


class Timing(Settings):
    """When something begins: about a time of day, and never outside a window.

    A window that ends before it begins reaches over midnight.
    """

    at: TimeOfDay | None = Field(default=None, description="when it begins on average")
    spread: Duration = Field(
        default=timedelta(minutes=15), description="standard deviation of its beginning"
    )
    between: tuple[TimeOfDay, TimeOfDay] | None = Field(
        default=None,
        description="the earliest and latest beginning; left out: 2.5 standard deviations about"
        " `at`",
    )

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"at": data} if isinstance(data, str) else data

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.at is not None and self.between is not None:
            first, last = self.between
            at, last = self.at - first, last - first
            if at % DAY > last % DAY:
                raise problem(
                    f"'at' {format_time_of_day(self.at)} is not within 'between'"
                    f" {format_time_of_day(self.between[0])} to"
                    f" {format_time_of_day(self.between[1])}"
                )
        return self


class Wake(Timing):
    """When the day begins."""

    at: TimeOfDay = Field(default=timedelta(hours=7), description="when one wakes on average")


class Sleep(Timing):
    """When the day ends: one sleeps from then until waking."""

    at: TimeOfDay = Field(
        default=timedelta(hours=23), description="when one goes to bed on average"
    )
    at_least: Duration = Field(default=timedelta(hours=4), description="shortest sleep")


class Task(Timing):
    """Something to do in a day."""

    activity: str = Field(default="", description="what; left out: as the task is called")
    until: TimeOfDay | None = Field(default=None, description="it is over by then")
    takes: AnyTakes | None = Field(default=None, description="how long; left out: as the activity")
    after: tuple[str, ...] = Field(
        default=(),
        description="tasks that come before it; without 'at' and 'between' it follows at once, and"
        " only on days that have one of them",
    )
    on_waking: bool = Field(default=False, description="it is the first thing of the day")
    before_bed: bool = Field(default=False, description="it is done right before going to bed")
    probability: Share = Field(default=1.0, description="on how many of the days it is done")
    fixed: bool = Field(
        default=False, description="an appointment: it begins at `at` exactly, and isn't left out"
    )

    @model_validator(mode="after")
    def _has_one_time(self) -> Self:
        timed = self.at is not None or self.between is not None
        if timed + self.on_waking + self.before_bed > 1:
            raise problem("give a time ('at', 'between'), or on_waking, or before_bed: one of them")
        if self.fixed and self.at is None:
            raise problem("a fixed appointment needs 'at'")
        if self.fixed and self.between is not None:
            raise problem("a fixed appointment begins at 'at': leave out 'between'")
        return self


class Pastime(Settings):
    """What fills the time that nothing else wants."""

    weight: float = Field(default=1.0, gt=0, description="how often it is chosen, beside others")
    between: tuple[TimeOfDay, TimeOfDay] | None = Field(
        default=None, description="the times of day at which it may begin"
    )

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"weight": data} if isinstance(data, int | float) else data


AnyPastime = Annotated[Pastime, OrWritten("number")]


class DayTemplate(Settings):
    """The template of a kind of day."""

    on: OnDays | None = Field(
        default=None, description="its days of the week; left out: only its `dates`"
    )
    dates: Dates = Field(
        default=(), description="dates and [first, last] ranges on which it holds before all others"
    )
    wake: Annotated[Wake, OrWritten("text")] = Field(
        default=Wake(), description="when the day begins"
    )
    sleep: Annotated[Sleep, OrWritten("text")] = Field(default=Sleep(), description="when it ends")
    do: dict[str, Annotated[Task, OrWritten("text")]] = Field(
        default_factory=dict, description="what is done, by name"
    )
    leisure: dict[str, AnyPastime] | None = Field(
        default=None, description="what fills the rest; left out: as the persona's"
    )

    recorded: tuple[AnyRecordedDay, ...] = Field(
        default=(),
        description="days as they were lived, '07:00 wash, 07:20 work, …, 23:00 sleep, 31:00 end':"
        " new days are drawn from them, instead of from `do` and `leisure`",
    )

    @model_validator(mode="before")
    @classmethod
    def _drop_deleted(cls, data: Any) -> Any:
        return _without_nulls(data, ("do", "leisure"))

    @model_validator(mode="after")
    def _is_of_one_kind(self) -> Self:
        if self.recorded and (self.do or self.leisure):
            raise problem_at(("recorded",), "give recorded days, or do and leisure: not both")
        return self

    @model_validator(mode="after")
    def _order_is_possible(self) -> Self:
        for name, task in self.do.items():
            for other in task.after:
                if other not in self.do:
                    hint = did_you_mean(other, self.do)
                    raise problem_at(("do", name, "after"), f"there is no task {other!r}{hint}")
        done: set[str] = set()
        while len(done) < len(self.do):
            ready = [n for n, t in self.do.items() if n not in done and done.issuperset(t.after)]
            if not ready:
                left = ", ".join(n for n in self.do if n not in done)
                raise problem_at(("do",), f"these tasks wait for each other: {left}")
            done.update(ready)
        return self

    @property
    def weekdays(self) -> set[int]:
        """The days of the week it holds on, 0 = Monday."""
        return weekdays_of(self.on)


def holds_on(dates: Dates, day: date) -> bool:
    """Tell whether a day is one of some dates, or in one of their ranges."""
    spans = (d if isinstance(d, tuple) else (d, d) for d in dates)
    return any(first <= day <= last for first, last in spans)


class Persona(Settings):
    """Who somebody is: how they walk, what they do, and when."""

    about: str = Field(default="", description="who this is, for people to read")
    pace: float = Field(
        default=1.0, ge=0.1, le=3, description="walking speed, as a multiple of the body's"
    )
    manners: Manners = Field(
        default=Manners(),
        description="how it reacts to robots where it has the behavior `reactions`",
    )
    activities: dict[str, Activity] = Field(
        default_factory=dict, description="activities of its own, or changed ones"
    )
    leisure: dict[str, AnyPastime] = Field(
        default_factory=lambda: {"rest": Pastime()}, description="what fills the rest of a day"
    )
    needs: dict[str, AnyNeed] = Field(
        default_factory=lambda: dict(usual_needs()),
        description="what builds up and interrupts a day, by name; left out: an adult's;"
        " null: nothing",
    )
    errands: dict[str, AnyErrand] = Field(
        default_factory=lambda: dict(usual_errands()),
        description="short ways between activities, by name; left out: an adult's; null: none",
    )
    days: dict[str, DayTemplate] = Field(min_length=1, description="the kinds of days, by name")

    @model_validator(mode="before")
    @classmethod
    def _drop_deleted(cls, data: Any) -> Any:
        return _without_nulls(data, ("leisure", "days", "activities", "needs", "errands"))

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        for name, day in self.days.items():
            for task, fields in day.do.items():
                self._check_activity(fields.activity or task, ("days", name, "do", task))
            for recorded in day.recorded:
                for what in recorded.activities:
                    self._check_activity(what, ("days", name, "recorded"))
            for pastime in day.leisure or ():
                self._check_activity(pastime, ("days", name, "leisure", pastime))
        for pastime in self.leisure:
            self._check_activity(pastime, ("leisure", pastime))
        for where, name in named_activities(self.needs, self.errands):
            self._check_activity(name, where)
        covered = {weekday for day in self.days.values() for weekday in day.weekdays}
        if missing := [WEEKDAYS[i] for i in range(7) if i not in covered]:
            raise problem_at(
                ("days",), f"no day is described for {', '.join(missing)}: say so by 'on'"
            )
        check(self)
        return self

    @cached_property
    def plans(self) -> dict[str, DayPlan]:
        """What the planner uses of each kind of day."""
        return day_plans(self)

    @cached_property
    def body(self) -> Body:
        """What the planner uses of its needs and errands."""
        return body_of(self.needs, self.errands, {**catalogue(), **self.activities})

    def _check_activity(self, name: str, where: tuple[str, ...]) -> None:
        try:
            self.activity(name)
        except ValueError as error:
            raise problem_at(where, str(error)) from None

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> "Persona":
        """Return itself: nothing in it changes."""
        return self

    def activity(self, name: str) -> Activity:
        """Return an activity by name, its own first."""
        return find_activity(name, self.activities)

    @cached_property
    def used_activities(self) -> dict[str, Activity]:
        """The activities that its days may hold, by name."""
        names = {job.activity for plan in self.plans.values() for job in plan.jobs}
        names |= {fill.activity for plan in self.plans.values() for fill in plan.fills}
        names |= {n for day in self.days.values() for r in day.recorded for n in r.activities}
        names |= activities_of(self.needs, self.errands)
        return {name: self.activity(name) for name in sorted(names | {REST, SLEEP})}

    def day(self, day: date) -> str:
        """Return the name of the template of a date: the last of those that fit."""
        names = list(self.days)
        for name in reversed(names):
            if holds_on(self.days[name].dates, day):
                return name
        return next(n for n in reversed(names) if day.weekday() in self.days[n].weekdays)


def _without_nulls(data: Any, keys: tuple[str, ...]) -> Any:
    """Drop named entries that are null: how one removes what a persona below has."""
    if not isinstance(data, Mapping):
        return data
    result = dict(data)
    for key in ("needs", "errands"):
        if key in keys and key in result and result[key] is None:
            result[key] = {}
    for key in keys:
        if isinstance(result.get(key), Mapping):
            result[key] = {k: v for k, v in result[key].items() if v is not None}
    return result


def read_persona(value: object, chain: tuple[str, ...] = ()) -> Any:
    """Read a persona: a bundled name, the path of a YAML file, or a mapping that may `extend` one.

    Raises:
        PydanticCustomError: There is no such persona, or its file can't be read.
    """
    if isinstance(value, Persona) or (isinstance(value, Mapping) and "extends" not in value):
        return value
    if isinstance(value, str) and value in bundled() and not chain:
        return bundled_persona(str(value))
    if isinstance(value, Mapping):
        below = read_persona(value["extends"], (*chain, ""))
        return merged(below, {key: v for key, v in value.items() if key != "extends"})
    if not isinstance(value, str | Path) or not str(value):
        raise problem(
            f"found {shown(value)}; a persona is wanted: one of {', '.join(bundled())}, a YAML"
            " file, or a mapping like {extends: retired, pace: 0.8}"
        )
    bundled_file = BUNDLED / f"{value}.yaml"
    path = bundled_file if str(value) in bundled() else folder_of(value) / Path(value).expanduser()
    if not path.is_file():
        raise problem(
            f"there is no persona {str(value)!r}{did_you_mean(value, bundled())} There are:"
            f" {', '.join(bundled())}; your own is the path of a YAML file"
        )
    if str(path.resolve()) in chain:
        raise problem(f"the persona {path.name} extends itself")
    try:
        data = read_document(path).data
    except ScenarioError as error:
        raise problem(str(error)) from None
    return read_persona(data, (*chain, str(path.resolve())))


@cache
def bundled() -> list[str]:
    """Return the names of the personas that come with Fleet2D.

    >>> bundled()
    ['child', 'night_shift', 'retired', 'student', 'works_from_home', 'works_outside']
    """
    return sorted(path.stem for path in BUNDLED.glob("*.yaml"))


def merged(below: Any, above: Any) -> Any:
    """Return plain data changed by other plain data: mappings key by key, all else replaced."""
    if isinstance(below, Mapping) and isinstance(above, Mapping):
        keys = dict.fromkeys((*below, *above))
        return {
            key: merged(below[key], above[key])
            if key in below and key in above
            else (above if key in above else below)[key]
            for key in keys
        }
    return above


_READ: dict[str, Persona] = {}  # bundled personas that were asked for


def bundled_persona(name: str) -> Persona:
    """Return a persona that comes with Fleet2D: the same each time."""
    if name not in _READ:
        _READ[name] = Persona.model_validate(read_document(BUNDLED / f"{name}.yaml").data)
    return _READ[name]


def _dump(persona: Persona, dump: SerializerFunctionWrapHandler) -> Any:
    """Write the name of a bundled persona, any other whole: no stored run depends on its file."""
    return next((name for name, read in _READ.items() if read is persona), None) or dump(persona)


AnyPersona = Annotated[
    Persona, BeforeValidator(read_persona), WrapSerializer(_dump), OrWritten("text", "extension")
]
"""A persona in a scenario: a bundled name, a file, or a mapping that may extend either."""
