"""The scenario: everything that defines a run."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import date, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    BeforeValidator,
    Field,
    PlainSerializer,
    PrivateAttr,
    model_validator,
)

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.artifacts.store import ArtifactSettings
from fleet2d.configuration.components import (
    CheckNames,
    NameAsType,
    OneOf,
    Settings,
    ShortForm,
)
from fleet2d.configuration.documents import Document
from fleet2d.configuration.problems import (
    check_known,
    did_you_mean,
    problem,
    problem_at,
)
from fleet2d.configuration.schema_forms import SchemaForms
from fleet2d.configuration.units import (
    Duration,
    PositiveDuration,
    TimeOfDay,
    format_duration,
    micros,
)
from fleet2d.entities.behavior import DARK
from fleet2d.entities.entity import Robot, User
from fleet2d.entities.home_object import HomeObject
from fleet2d.entities.right_of_way import Listed, RightOfWay
from fleet2d.errors import errors_as
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.interactions.interaction import Interaction
from fleet2d.interventions.intervention import Entry
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import Clock, Sun
from fleet2d.runtime.local_time import Zone, rules_of, span_us, zone_of
from fleet2d.sight.camera import SightSettings

# Expectations call people by these words, and `unknown` stands for somebody not recognized.
WORDS_FOR_PEOPLE = ("anyone", "everyone", "nobody", "unknown")


def _read_expected(value: Any) -> Any:
    from fleet2d.expectations.parse import read_expected

    return read_expected(value)


ExpectationField = Annotated[
    Any,
    BeforeValidator(_read_expected),
    PlainSerializer(lambda expected: expected.content(), when_used="json"),
    Field(
        json_schema_extra={
            "type": ["string", "object"],
            "properties": {
                "that": {"type": "string"},
                "covers": {"type": "array", "items": {"type": "string"}},
            },
            "required": ["that", "covers"],
            "additionalProperties": False,
            "examples": ["always(distance(ana, astro) > 0.5 m)"],
        }
    ),
]
"""Text in a file or an `Expectation` in Python, or a mapping of it and what it `covers`."""


def _parse_local_time(value: Any) -> Any:
    """Refuse what pydantic would read as seconds since 1970."""
    if not isinstance(value, str | date):
        raise problem(f"expected a date and time like 2026-01-05T08:00, got {value}")
    try:
        return datetime.fromisoformat(value) if isinstance(value, str) else value
    except ValueError:
        raise problem(f"expected a date and time like 2026-01-05T08:00, got '{value}'") from None


def _refuse_file_as_type(value: Any) -> Any:
    """Refuse the name of a file in place of a floor plan's type, with advice on how to read it."""
    name = value.get("type") if isinstance(value, Mapping) else value
    if not isinstance(name, str) or Path(name).suffix == "" or ":" in name:  # this is a type
        return value
    from fleet2d.floorplan.load import advise_type  # few scenarios need it

    if advice := advise_type(name):
        raise problem_at(("type",), f"there is no floorplan {name!r}: {advice}", name)
    return value


class Daylight(Settings):
    """The place of the home, for the times of sunrise and sunset.

    Attributes:
        latitude: Its latitude, north is positive [deg].
        noon: Solar noon by the clock, averaged over the year; 12:10 with summer time
            is 13:10. In a time zone, summer time is added to it.
    """

    latitude: float = Field(ge=-65, le=65, examples=[52.5])
    noon: TimeOfDay = timedelta(hours=12)


class TimeZone(Settings):
    """The time zone of a home; short form: its name, like Europe/Berlin.

    A stored run also has the offsets, which then replace this machine's rules.

    Attributes:
        name: Its name.
        standard_s: Its offset from UTC without summer time.
        offset_s: Its offset before the first change.
        changes: The times of changes of the offset, in order, with the offset from then on [s].
    """

    name: str = Field(min_length=1, examples=["Europe/Berlin"])
    standard_s: int | None = None
    offset_s: int | None = None
    changes: tuple[tuple[str, int], ...] | None = None

    @model_validator(mode="before")
    @classmethod
    def _read_short_form(cls, data: Any) -> Any:
        return {"name": data} if isinstance(data, str) else data

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        given = {self.standard_s is None, self.offset_s is None, self.changes is None}
        if len(given) > 1:
            raise problem("give standard_s, offset_s and changes, or none of them")
        if self.changes is not None:
            with errors_as(problem, of=(KeyError, TypeError, ValueError)):
                Zone.of_record(self.model_dump())
        return self

    def zone(self, begin: datetime, end: datetime) -> Zone:
        """Return the clock of the home from about `begin` to about `end`.

        Raises:
            KeyError: There is no such time zone.
        """
        if self.changes is not None:
            return Zone.of_record(self.model_dump(), span_us(begin, end))
        return zone_of(self.name, begin, end)


class SimulationSettings(Settings):
    """When a run starts, how long it lasts, and how fast it goes.

    Attributes:
        start: The home's local time at step 0; in a time zone it may have an offset.
        duration: Simulated time. A run stops at its last full step within it.
        step: The length of a step.
        seed: The seed of all random draws; null: one is drawn and stored.
        max_span: The maximum number of steps computed at once. It doesn't change results.
        ghosts: Bodies pass through each other; else robots yield to people and to each other.
        right_of_way: Which of two robots yields.
        people_block: Time for which a person waits for another body in the way before going round
            it; null: people walk on, and robots keep out of their way.
        speedup: Run at this many times real time; null: as fast as possible.
        daylight: The place of the home, if nights are to be longer in winter; null: lights and
            detection go by the time of day alone.
        time_zone: The time zone of the home, whose clocks may change; null: each day has 24 hours.
    """

    start: Annotated[datetime, BeforeValidator(_parse_local_time)] = datetime(2026, 1, 5)
    duration: Duration
    step: PositiveDuration = timedelta(seconds=1)
    seed: int | None = Field(default=None, ge=0, lt=2**63)
    max_span: int | None = Field(default=None, ge=1)
    ghosts: bool = False
    right_of_way: OneOf[RightOfWay] = Listed()
    people_block: PositiveDuration | None = Field(default=None, examples=["3 s"])
    speedup: float | None = Field(default=None, ge=0.001)
    daylight: Daylight | None = None
    time_zone: Annotated[TimeZone, SchemaForms("text")] | None = None

    def model_post_init(self, _: object, /) -> None:
        """Require a start that calendars know, and at least one step."""
        # Agendas look a week back and a day ahead.
        if not 1900 <= self.start.year <= 7900:
            raise problem_at(("start",), f"expected a year from 1900 to 7900, got {self.start}")
        if self.time_zone is not None:
            self._check_time_zone(self.time_zone)
        elif self.start.tzinfo is not None:
            raise problem_at(
                ("start",),
                "expected a local time without a time zone, since a simulated day has 24 hours, got"
                f" {self.start.isoformat()}; or say where the home is, by simulation.time_zone",
            )
        if self.duration < self.step:
            raise problem_at(
                ("duration",),
                f"{format_duration(self.duration)} is shorter than one step, "
                f"{format_duration(self.step)}",
            )

    def _check_time_zone(self, time_zone: TimeZone) -> None:
        """Refuse an unknown time zone, and a start that its clock never reads."""
        try:
            rules_of(time_zone.name)  # readers of the tables need them even if offsets are stored
            zone = time_zone.zone(self.start, self.start)
        except KeyError:
            from zoneinfo import available_timezones

            names = available_timezones()
            hint = did_you_mean(time_zone.name, names)
            hint = hint if names else ": this machine has no time zones: pip install tzdata"
            text = f"there is no time zone {time_zone.name!r}{hint}"
            raise problem_at(("time_zone",), text, time_zone.name) from None
        if zone.skips(self.start):
            raise problem_at(("start",), zone.oddity(self.start))

    @property
    def steps(self) -> int:
        """The number of full steps in the duration."""
        return self.duration // self.step

    @property
    def step_us(self) -> int:
        """The length of a step [µs]."""
        return micros(self.step)

    @property
    def clock(self) -> Clock:
        """The steps of the run, and the sun over the home."""
        start = self.start
        zone = None
        if self.time_zone is not None:
            zone = self.time_zone.zone(start, start + self.duration)
            start = zone.at(start)
        clock = Clock(start, self.step_us, self.steps)
        if self.daylight is None:
            return clock
        return replace(clock, sun=Sun(self.daylight.latitude, self.daylight.noon, zone))


class Scenario(Settings):
    """Everything that defines a run.

    Attributes:
        name: The name of this scenario in reports.
        floorplan: The home's walls.
        users: The people, by name.
        robots: The robots, by name.
        objects: Doors and sensors, by name.
        interactions: The requests of robots to people, by name.
        script: Interventions on people, robots and the home, and when they happen.
        sight: The method that computes what is in view.
        algorithms: The algorithms that run during the simulation, by name.
        metrics: The metrics that are recorded, by name.
        expect: The expectations that must hold over the run, by name.
        artifacts: The tables and files that a run stores.
    """

    name: str | None = None
    simulation: SimulationSettings
    floorplan: Annotated[OneOf[FloorPlanSource], BeforeValidator(_refuse_file_as_type)]
    users: Annotated[dict[str, Annotated[User, ShortForm()]], CheckNames] = Field(default={})
    robots: Annotated[dict[str, Annotated[Robot, ShortForm()]], CheckNames] = Field(default={})
    objects: Annotated[dict[str, OneOf[HomeObject]], CheckNames] = Field(default={})
    interactions: Annotated[dict[str, Interaction], CheckNames] = Field(default={})
    script: tuple[Entry, ...] = ()
    sight: SightSettings = SightSettings()
    algorithms: Annotated[dict[str, OneOf[Algorithm]], CheckNames, NameAsType()] = Field(default={})
    metrics: Annotated[dict[str, OneOf[Metric]], CheckNames, NameAsType()] = Field(default={})
    expect: Annotated[dict[str, ExpectationField], CheckNames] = Field(default={})
    artifacts: ArtifactSettings = ArtifactSettings()
    _folder: Path = PrivateAttr(default_factory=Path.cwd)
    _document: Document = PrivateAttr(default_factory=Document)

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        nouns = dict.fromkeys(WORDS_FOR_PEOPLE, "a word for people")
        for section, noun in (("users", "a user"), ("robots", "a robot"), ("objects", "an object")):
            for name in getattr(self, section):
                if name in nouns:
                    raise problem_at(
                        (section, name),
                        f"there is {nouns[name]} named {name!r} already: choose another name",
                    )
                nouns[name] = noun
        return self

    @model_validator(mode="after")
    def _nights_have_a_place(self) -> Self:
        for name, user in self.users.items():
            if user.lights == (DARK,) and self.simulation.daylight is None:
                raise problem_at(
                    ("users", name, "lights"),
                    "when it is dark depends on where the home is: add"
                    " simulation.daylight: {latitude: 52.5}",
                )
        return self

    @model_validator(mode="after")
    def _offsets_have_a_time_zone(self) -> Self:
        if self.simulation.time_zone is None:
            for where, moment in self.moments():
                if moment.tzinfo is not None:
                    raise problem_at(
                        (*where, "at"),
                        "expected a local time of the home, without a time zone, as there is no"
                        f" simulation.time_zone, got {moment.isoformat()}",
                    )
        return self

    @model_validator(mode="after")
    def _behaviors_name_users(self) -> Self:
        for robot, entity in self.robots.items():
            for i, behavior in enumerate(entity.behaviors):
                for user in behavior.about():
                    where = partial(problem_at, ("robots", robot, "behaviors", i))
                    check_known(user, "user", self.users, where)
        return self

    @model_validator(mode="after")
    def _interactions_name_bodies(self) -> Self:
        for name, interaction in self.interactions.items():
            if interaction.by is None and not self.robots:
                raise problem_at(("interactions", name), "there is no robot that could do it")
            if interaction.every is not None and interaction.every < self.simulation.step:
                raise problem_at(
                    ("interactions", name, "every"),
                    f"expected a step ({self.simulation.step.total_seconds():g} s) or more",
                )
            sections = {"to": "users", "fetch_from": "users", "by": "robots"}
            if interaction.do == "ask" and interaction.about:
                sections["about"] = "users"
            for key, section in sections.items():
                if (body := getattr(interaction, key)) is not None:
                    error = partial(problem_at, ("interactions", name, key))
                    check_known(body, section[:-1], getattr(self, section), error)
        first = next(iter(self.robots), None)
        wanting = {interaction.by or first for interaction in self.interactions.values()}
        for robot, entity in self.robots.items():
            for i, behavior in enumerate(entity.behaviors):
                if behavior.serves_requests and robot not in wanting:
                    raise problem_at(
                        ("robots", robot, "behaviors", i),
                        f"{robot} wants nothing of anybody: write a section `interactions`, and"
                        f" `by: {robot}` in its entries if there are several robots",
                    )
        return self

    def moments(self) -> Iterator[tuple[tuple[str, int], datetime]]:
        """Yield the dated moments of its script, and the entry of each."""
        for number, entry in enumerate(self.script):
            if isinstance(entry.at, datetime):
                yield ("script", number), entry.at

    def set_origin(self, folder: Path, document: Document) -> None:
        """Keep the folder of the scenario's file, and the places of its keys."""
        self._folder = folder
        self._document = document

    @property
    def folder(self) -> Path:
        """The folder of the file that the scenario was read from."""
        return self._folder

    def where(self, path: str) -> str:
        """Return the place of a key, or of the nearest key around it: 'home.yaml:15', else ''.

        Args:
            path: the key's path as in messages, like 'users.ana.days.0.items.1.place'; for a short
                form with or without 'behaviors.0'.

        Example:
            >>> from fleet2d import load_scenario
            >>> load_scenario("users.ana.speed=0.9").where("users.ana.speed")
            "override 'users.ana.speed=0.9'"
        """
        keys = tuple(path.split("."))
        entry = keys[:2]
        if keys[2:4] == ("behaviors", "0") and (*entry, "behaviors") not in self._document.places:
            keys = (*entry, *keys[4:])
        return self._document.place(keys)

    def resolved(self) -> dict[str, Any]:
        """Return the whole scenario as plain JSON data that `load_scenario` reads back."""
        return self.model_dump(mode="json")
