"""Personas: people described by their activities, manners, and the templates of their days."""

from collections.abc import Mapping
from datetime import date, timedelta
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    WrapSerializer,
    WrapValidator,
    model_validator,
)

from fleet2d.bounds import EXTENDED_FILES, PERSONA_VALUES
from fleet2d.configuration import units
from fleet2d.configuration.components import Settings, count, once
from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import check_known, problem, problem_at, shown, suggest
from fleet2d.configuration.schema_forms import SchemaForms
from fleet2d.configuration.units import Duration, Length, OnDays, PositiveDuration, Share, TimeOfDay
from fleet2d.errors import errors_as, extra
from fleet2d.routines.activity import (
    Activity,
    AnyDurationDistribution,
    DurationDistribution,
    bundled,
    catalogue,
    find_activity,
)
from fleet2d.routines.interruptions import (
    AnyErrand,
    AnyNeed,
    InterruptionRules,
    activities_of,
    interruption_rules,
    named_activities,
    usual_errands,
    usual_needs,
)
from fleet2d.routines.planner import REST, SLEEP, AnyRecordedDay, DayPlan
from fleet2d.routines.templates import check, day_plans, in_order
from fleet2d.runtime.clock import DAY


class Manners(Settings):
    """How a person reacts to robots; distances are between the middles of the bodies.

    A person who lies, is out of the home, or has no line of sight to a robot doesn't notice it.

    Attributes:
        notices: Distance at which a robot is noticed [m].
        turns: Probability of turning to it then.
        looks: How long the person looks at it.
        in_the_way: Distance at which a robot that drives up is in the way [m].
        steps_aside: Probability of stepping aside then, if the person stands.
        too_close: Distance below which a robot is too close [m].
        patience: How long a robot may stand too close.
        leaves: Probability of leaving for another room after that.
        hears: Distance at which its call is heard [m].
        comes: Probability of coming when it calls.
        comes_for: How long the person stays with it.
        stops: Probability that a person who left or came doesn't resume the activity.
    """

    notices: Length = Field(default=2.5, gt=0)
    turns: Share = 0.5
    looks: AnyDurationDistribution = DurationDistribution(
        law="uniform", at_least=timedelta(seconds=4), at_most=timedelta(seconds=12)
    )
    in_the_way: Length = Field(default=0.9, gt=0)
    steps_aside: Share = 0.8
    too_close: Length = Field(default=0.7, gt=0)
    patience: Duration = timedelta(seconds=30)
    leaves: Share = 0.3
    hears: Length = Field(default=10.0, gt=0)
    comes: Share = 0.7
    comes_for: AnyDurationDistribution = DurationDistribution(mean=timedelta(seconds=40))
    stops: Share = 0.1


FOLDER = Path(__file__).parent
BUNDLED = FOLDER / "personas"
Dates = tuple[date | tuple[date, date], ...]


def _day_of_year(value: object) -> str:
    try:
        month, day = map(int, str(value).split("-"))
        return f"{date(2000, month, day):%m-%d}"
    except ValueError:
        raise problem(f"expected a month and a day like 07-15, got {shown(value)}") from None


DayOfYear = Annotated[
    str,
    BeforeValidator(_day_of_year),
    WithJsonSchema({"type": "string", "description": "a month and a day", "examples": ["07-15"]}),
]
"""A day of each year, 'MM-DD'."""


class Timing(Settings):
    """When something begins: at about a time of day, always within a window.

    A window that ends before it begins lasts past midnight.

    Attributes:
        at: When it begins on average.
        spread: Standard deviation of its beginning.
        between: The earliest and latest begin; left out: 2.5 standard deviations around `at`.
    """

    short_form = ("at", (str,))

    at: TimeOfDay | None = None
    spread: Duration = timedelta(minutes=15)
    between: tuple[TimeOfDay, TimeOfDay] | None = None

    def model_post_init(self, _: object, /) -> None:
        """Refuse a mean outside of its limits."""
        if self.at is not None and self.between is not None:
            first, last = self.between
            at = self.at - first
            last = last - first
            if at % DAY > last % DAY:
                raise problem(
                    f"'at' {units.format_time_of_day(self.at)} is not within 'between'"
                    f" {units.format_time_of_day(self.between[0])} to"
                    f" {units.format_time_of_day(self.between[1])}"
                )


class Wake(Timing):
    """When the day begins.

    Attributes:
        at: Mean time of waking.
    """

    at: TimeOfDay = timedelta(hours=7)


class Sleep(Timing):
    """When the day ends: the person sleeps from then until waking.

    Attributes:
        at: Mean time of going to bed.
        at_least: Shortest sleep.
    """

    at: TimeOfDay = timedelta(hours=23)
    at_least: Duration = timedelta(hours=4)


class Task(Timing):
    """Something to do in a day.

    Attributes:
        activity: The activity; left out: the name of the task.
        until: Its latest end.
        takes: Its duration; left out: that of the activity.
        after: Tasks that come before it; without 'at' and 'between' it follows them at once, and
            only on days that have one of them.
        on_waking: Whether it is the first thing of the day.
        before_bed: Whether it is done right before going to bed.
        probability: Its probability on each of the days.
        fixed: An appointment: it begins at `at` exactly, and isn't left out.
    """

    activity: str = ""
    until: TimeOfDay | None = None
    takes: AnyDurationDistribution | None = None
    after: tuple[str, ...] = ()
    on_waking: bool = False
    before_bed: bool = False
    probability: Share = 1.0
    fixed: bool = False

    def model_post_init(self, context: object, /) -> None:
        """Require one time, and that of a fixed appointment."""
        super().model_post_init(context)
        timed = self.at is not None or self.between is not None
        if timed + self.on_waking + self.before_bed > 1:
            raise problem(
                "give exactly one of a time ('at' or 'between'), 'on_waking' and 'before_bed'"
            )
        if self.fixed and self.at is None:
            raise problem("a fixed appointment needs 'at'")
        if self.fixed and self.between is not None:
            raise problem("a fixed appointment begins at 'at': leave out 'between'")


class Pastime(Settings):
    """An activity for the time between tasks.

    Attributes:
        weight: How often it is chosen, relative to others.
        between: The times of day at which it may begin.
    """

    short_form = ("weight", (int, float))

    weight: float = Field(default=1.0, gt=0)
    between: tuple[TimeOfDay, TimeOfDay] | None = None


AnyPastime = Annotated[Pastime, SchemaForms("number")]


class DayTemplate(Settings):
    """The template of a kind of day.

    Attributes:
        on: Its days of the week; left out: only its `dates`.
        dates: Dates and [first, last] ranges on which it precedes all others.
        wake: When the day begins.
        sleep: When it ends.
        do: The tasks, by name.
        leisure: The pastimes; left out: those of the persona.
        recorded: Recorded days, '07:00 wash, 07:20 work, …, 23:00 sleep, 31:00 end': new days are
            drawn from them, instead of from `do` and `leisure`.
    """

    on: OnDays | None = None
    dates: Dates = ()
    wake: Annotated[Wake, SchemaForms("text")] = Wake()
    sleep: Annotated[Sleep, SchemaForms("text")] = Sleep()
    do: dict[str, Annotated[Task, SchemaForms("text")]] = Field(default_factory=dict)
    leisure: dict[str, AnyPastime] | None = None
    recorded: tuple[AnyRecordedDay, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _drop_deleted(cls, data: Any) -> Any:
        return _without_nulls(data, ("do", "leisure"))

    def model_post_init(self, _: object, /) -> None:
        """Refuse recorded days beside drawn ones, and tasks that wait for each other."""
        if self.recorded and (self.do or self.leisure):
            raise problem_at(("recorded",), "give recorded days, or do and leisure: not both")
        for name, task in self.do.items():
            for other in task.after:
                check_known(other, "task", self.do, partial(problem_at, ("do", name, "after")))
        in_order(self.do)

    @property
    def weekdays(self) -> set[int]:
        """The days of the week it applies to, 0 = Monday."""
        return units.weekdays_of(self.on)


def holds_on(dates: Dates, day: date) -> bool:
    """Return whether a day is one of some dates, or in one of their ranges."""
    spans = (d if isinstance(d, tuple) else (d, d) for d in dates)
    return any(first <= day <= last for first, last in spans)


# whose public holidays are looked up
FIRST_YEAR = 2000
LAST_YEAR = 2050


class YearEvent(Settings):
    """Something that changes the days of a person in the course of a year.

    When: one of `every`, `yearly`, `once`, `season` and `holidays`; `every` may have a `season`.
    What then: one of `days`, `away` and `becomes`.

    Attributes:
        every: It comes by chance, with this mean time between its end and its next beginning.
        yearly: It begins on a random day of this part of each year: ("07-10", "08-20").
        once: It begins on this date, or on a random day of this range.
        season: It is this part of each year: ("11-01", "02-28"); with `every`, it comes by chance,
            and begins in this part only.
        holidays: It is on the public holidays of a country or a part of it: "DE", "DE-BY".
        dates: The dates of those holidays; looked up if left out.
        lasts: How long it lasts, rounded to days, at least one; left out: for good (`once`).
        days: The template of the days, of the persona or a bundled one: ill, bad_day, day_off, hot.
        away: Whether nobody is at home: from 10:00 on its first day to 18:00 on its last.
        becomes: The persona whose days are lived from then on.
    """

    every: PositiveDuration | None = None
    yearly: tuple[DayOfYear, DayOfYear] | None = None
    once: date | tuple[date, date] | None = None
    season: tuple[DayOfYear, DayOfYear] | None = None
    holidays: str | None = None
    dates: tuple[date, ...] = ()
    lasts: AnyDurationDistribution | None = None
    days: str | None = None
    away: bool = False
    becomes: "AnyPersona | None" = None

    @model_validator(mode="before")
    @classmethod
    def _look_up_holidays(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not data.get("holidays") or data.get("dates"):
            return data
        return {**data, "dates": public_holidays(str(data["holidays"]))}

    def model_post_init(self, _: object, /) -> None:
        """Require one time and one change."""
        times = ("every", "yearly", "once", "season", "holidays")
        times_given = [name for name in times if getattr(self, name) is not None]
        if len(times_given) != 1 and times_given != ["every", "season"]:
            raise problem(f"say when it is by exactly one of {', '.join(times)}")
        if (self.days is not None) + self.away + (self.becomes is not None) != 1:
            raise problem("say what it changes by exactly one of days, away and becomes")
        if self.lasts is None and (self.every or self.yearly):
            raise problem("say how long it lasts, like 'lasts: 5 d'")
        if self.lasts is not None and (self.season or self.holidays) and not self.every:
            raise problem("a season and a holiday have their own length: leave out 'lasts'")
        if isinstance(self.once, tuple) and self.once[0] > self.once[1]:
            raise problem_at(("once",), f"{self.once[0]} is after {self.once[1]}: swap them")


class Persona(Settings):
    """A person: walking speed, manners, activities, and the templates of the days.

    Attributes:
        about: A description for people to read.
        pace: Walking speed, as a multiple of the body's.
        manners: How the person reacts to robots, with the behavior `reactions`.
        activities: New activities, or changed ones of the catalogue.
        leisure: The pastimes between the tasks of a day.
        needs: Needs that interrupt a day, by name; left out: those of an adult; null: none.
        errands: Short tasks between activities, by name; left out: those of an adult; null: none.
        fetches: Whether it fetches things from other rooms during activities, as these say; left
            out: unless it has the need `pick_up`, which takes the place of that.
        days: The kinds of days, by name.
        year: What changes its days in the course of a year, by name; a later one precedes others.
    """

    about: str = ""
    pace: float = Field(default=1.0, ge=0.1, le=3)
    manners: Manners = Manners()
    activities: dict[str, Activity] = Field(default_factory=dict)
    leisure: dict[str, AnyPastime] = Field(default_factory=lambda: {"rest": Pastime()})
    needs: dict[str, AnyNeed] = Field(default_factory=lambda: dict(usual_needs()))
    errands: dict[str, AnyErrand] = Field(default_factory=lambda: dict(usual_errands()))
    fetches: bool = False
    days: dict[str, DayTemplate] = Field(min_length=1)
    year: dict[str, YearEvent] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _drop_deleted(cls, data: Any) -> Any:
        keys = ("leisure", "days", "activities", "needs", "errands", "year")
        result = _without_nulls(data, keys)
        if isinstance(result, Mapping) and isinstance(result.get("needs"), Mapping):
            return {"fetches": "pick_up" not in result["needs"], **result}
        return result

    def model_post_init(self, _: object, /) -> None:
        """Require that every activity, day and event that is named exists."""
        named: list[tuple[tuple[str, ...], str]] = []
        for name, day in self.days.items():
            of_day = ("days", name)
            recorded = [n for r in day.recorded for n in r.activities]
            named += [((*of_day, "do", key), task.activity or key) for key, task in day.do.items()]
            named += [((*of_day, "recorded"), activity) for activity in recorded]
            named += [((*of_day, "leisure", pastime), pastime) for pastime in day.leisure or ()]
        named += [(("leisure", pastime), pastime) for pastime in self.leisure]
        for key, name in (*named, *named_activities(self.needs, self.errands)):
            with errors_as(partial(problem_at, key), of=ValueError):
                self.activity(name)
        for name, event in self.year.items():
            if event.days is not None:
                wrong = partial(problem_at, ("year", name, "days"))
                check_known(event.days, "template", [*bundled_days(), *self.days], wrong)
        covered = {weekday for day in self.days.values() for weekday in day.weekdays}
        if missing := [units.WEEKDAYS[i] for i in range(7) if i not in covered]:
            raise problem_at(
                ("days",), f"no day is described for {', '.join(missing)}: add them to 'on'"
            )
        check(self)

    @cached_property
    def plans(self) -> dict[str, DayPlan]:
        """The plan of each template, for the planner, by the template's name."""
        templates = dict(self.days)
        for event in self.year.values():
            if event.days is not None and event.days not in templates:
                templates[event.days] = bundled_days()[event.days]
        plans = day_plans(self, templates)
        for name, event in self.year.items():
            if event.becomes is not None:
                plans |= {f"{name}.{day}": plan for day, plan in event.becomes.plans.items()}
        return plans

    @cached_property
    def interruptions(self) -> InterruptionRules:
        """The rules of its needs and errands."""
        return interruption_rules(self.needs, self.errands, {**catalogue(), **self.activities})

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> "Persona":
        """Return itself, as personas never change."""
        return self

    def activity(self, name: str) -> Activity:
        """Return an activity by name, its own first."""
        if name not in self._done_activities:
            activity = find_activity(name, self.known_activities)
            without = activity.model_copy(update={"fetches": None})
            self._done_activities[name] = activity if self.fetches else without
        return self._done_activities[name]

    @cached_property
    def _done_activities(self) -> dict[str, Activity]:
        """Activities that were asked for, as it does them."""
        return {}

    @cached_property
    def known_activities(self) -> dict[str, Activity]:
        """Its own activities, and those of the personas that it becomes, by name."""
        later = (event.becomes for event in self.year.values() if event.becomes is not None)
        known = {name: a for persona in later for name, a in persona.known_activities.items()}
        return {**known, **self.activities}

    @cached_property
    def used_activities(self) -> dict[str, Activity]:
        """The activities that its days may have, by name."""
        names = {job.activity for plan in self.plans.values() for job in plan.jobs}
        names |= {option.activity for plan in self.plans.values() for option in plan.pastimes}
        names |= {n for day in self.days.values() for r in day.recorded for n in r.activities}
        names |= activities_of(self.needs, self.errands)
        for event in self.year.values():
            names |= set() if event.becomes is None else set(event.becomes.used_activities)
        return {name: self.activity(name) for name in sorted(names | {REST, SLEEP})}

    def day(self, day: date) -> str:
        """Return the name of the template of a date: of several, the last one."""
        names = list(self.days)
        for name in reversed(names):
            if holds_on(self.days[name].dates, day):
                return name
        return next(n for n in reversed(names) if day.weekday() in self.days[n].weekdays)


@cache
def bundled_days() -> dict[str, DayTemplate]:
    """Return the templates of days that every persona has for its year, by name.

    >>> sorted(bundled_days())
    ['bad_day', 'day_off', 'hot', 'ill']
    """
    return bundled(DayTemplate, "days.yaml")


def public_holidays(place: str) -> list[date]:
    """Return the public holidays of a country ("DE") or a part of it ("DE-BY"), 2000 to 2050.

    Source: the package `holidays`.

    Raises:
        PydanticCustomError: It knows no such place.
        InputError: The package is not installed.
    """
    with extra("calendar", "public holidays need the package holidays"):
        import holidays
    country, _, part = place.partition("-")
    try:
        found = holidays.country_holidays(
            country, part or None, years=range(FIRST_YEAR, LAST_YEAR + 1)
        )
    except NotImplementedError:
        known = holidays.list_supported_countries()
        names = known if country not in known else [f"{country}-{p}" for p in known[country]]
        hint = suggest(place, names)
        raise problem_at(("holidays",), f"no holidays are known of {place!r}{hint}") from None
    return sorted(found)


def _without_nulls(data: Any, keys: tuple[str, ...]) -> Any:
    """Drop entries that are null: with null, a persona removes an entry of the one it extends."""
    if not isinstance(data, Mapping):
        return data
    result = dict(data)
    for key in keys:
        entries = result.get(key, ())
        if isinstance(entries, Mapping):
            result[key] = {k: v for k, v in entries.items() if v is not None}
        elif entries is None and key in ("needs", "errands"):
            result[key] = {}
    return result


def read_persona(value: object) -> Any:
    """Read a persona: a bundled name, the path of a YAML file, or a mapping that may `extend` some.

    Of a list, each changes those before it.

    Raises:
        PydanticCustomError: There is no such persona, or its file can't be read.
    """
    if isinstance(value, str) and value in bundled_names():
        return bundled_persona(value)
    if isinstance(value, Mapping) and not {"extends", "days"} & value.keys():
        raise problem(
            "a persona needs days, or the one that it changes, like {extends: retired, pace: 0.8}"
        )
    return _data_of(value, (), [])


def origins_of(value: object) -> set[str]:
    """Return the bundled personas that a valid persona is, or changes; itself if there are none.

    Example:
        >>> origins_of({"extends": "retired", "pace": 0.8})
        {'retired'}
    """
    if isinstance(value, str) and value in bundled_names():
        return {value}
    data: Any = value
    if isinstance(value, str | Path):
        data = read_document(_persona_file(value)).data
    below = data.get("extends", ()) if isinstance(data, Mapping) else ()
    names = below if isinstance(below, list | tuple) else [below]
    return {origin for name in names for origin in origins_of(name)} or {str(value)}


def _data_of(value: object, chain: tuple[str, ...], files: list[Path]) -> Any:
    """Return a persona as plain data, with all that it extends.

    Args:
        value: As of `read_persona`.
        chain: The files that extend it.
        files: All files that were read for the persona; those read now are added.
    """
    if isinstance(value, Persona) or (isinstance(value, Mapping) and "extends" not in value):
        return value
    if isinstance(value, Mapping):
        below = _extended(value["extends"], chain, files)
        return merge(below, {key: v for key, v in value.items() if key != "extends"})
    if not isinstance(value, str | Path) or not str(value):
        raise problem(
            f"expected a persona, got {shown(value)}: give one of {', '.join(bundled_names())}, a"
            " YAML file, or a mapping like {extends: retired, pace: 0.8}"
        )
    path = _persona_file(value)
    if str(path.resolve()) in chain:
        raise problem(f"the persona {path.name} extends itself")
    files.append(path)
    with errors_as(problem):
        EXTENDED_FILES.check(len(files), "the persona", prefix="at least ")
        data = _bundled_data(path) if path.parent == BUNDLED else read_document(path).data
    return _data_of(data, (*chain, str(path.resolve())), files)


@cache
def _bundled_data(path: Path) -> Any:
    return read_document(path).data


def _extended(names: Any, chain: tuple[str, ...], files: list[Path]) -> Any:
    """Return what personas, or a single one, are together, each changed by the next."""
    below: Any = {}
    for name in names if isinstance(names, list | tuple) else [names]:
        below = merge(below, _data_of(name, (*chain, ""), files))
    return below


def _persona_file(value: str | Path) -> Path:
    """Return the file of a persona.

    Raises:
        PydanticCustomError: There is none.
    """
    name = str(value)
    if name in bundled_names():
        return BUNDLED / f"{name}.yaml"
    path = units.named_path(value)
    if not path.is_file():
        hint = suggest(value, bundled_names())
        raise problem(f"there is no persona {name!r}{hint}; your own is the path of a YAML file")
    return path


def _validate_persona(
    value: object, validate: ValidatorFunctionWrapHandler, info: ValidationInfo
) -> Persona:
    """Read and validate a persona; a file is read once for all users that name it."""

    def read() -> Persona:
        data = read_persona(value)
        if data is not value and not isinstance(data, Persona):  # more than the scenario's file has
            count(info, PERSONA_VALUES, values_in(data))
        return validate(data)

    if isinstance(value, str | Path) and str(value) not in bundled_names():
        return once(info, (Persona, units.named_path(value)), read)
    return read()


def values_in(data: Any) -> int:
    """Return the number of values in plain data; a long text counts for each 64 characters."""
    if isinstance(data, Mapping):
        return 1 + sum(map(values_in, data.values()))
    if isinstance(data, list | tuple):
        return 1 + sum(map(values_in, data))
    return 1 + (len(data) // 64 if isinstance(data, str) else 0)


@cache
def bundled_names() -> list[str]:
    """Return the names of the personas that come with Fleet2D.

    >>> bundled_names()[:4]
    ['child', 'night_shift', 'retired', 'retired_active']
    """
    return sorted(path.stem for path in BUNDLED.glob("*.yaml"))


def merge(below: Any, above: Any) -> Any:
    """Return plain data changed by other plain data: mappings key by key, all else replaced."""
    if not (isinstance(below, Mapping) and isinstance(above, Mapping)):
        return above
    changed = {k: merge(below[k], value) if k in below else value for k, value in above.items()}
    return {**below, **changed}


_LOADED: dict[str, Persona] = {}  # bundled personas, by name


def bundled_persona(name: str) -> Persona:
    """Return a persona that comes with Fleet2D: the same each time."""
    if name not in _LOADED:
        _LOADED[name] = Persona.model_validate(_data_of(name, ("",), []))
    return _LOADED[name]


def _dump(persona: Persona, dump: SerializerFunctionWrapHandler) -> Any:
    """Write a bundled persona by its name, and others in full: no run depends on their files."""
    return next((n for n, loaded in _LOADED.items() if loaded is persona), None) or dump(persona)


AnyPersona = Annotated[
    Persona,
    WrapValidator(_validate_persona),
    WrapSerializer(_dump),
    SchemaForms("text", "extension"),
]
"""A persona in a scenario: a bundled name, a file, or a mapping that may extend either."""

YearEvent.model_rebuild()
Persona.model_rebuild()
