"""The scenario: everything that defines a run, validated."""

from collections.abc import Mapping
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, PrivateAttr, ValidationError, model_validator

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.artifacts.store import ArtifactSettings
from fleet2d.configuration.components import CheckNames, NameAsType, OneOf, Settings, ShortForm
from fleet2d.configuration.documents import Document
from fleet2d.configuration.problems import problem, problem_at, suggest
from fleet2d.configuration.trust import check_code
from fleet2d.configuration.units import Duration, PositiveDuration, format_duration, micros
from fleet2d.entities.entity import Robot, User
from fleet2d.entities.objects.home_object import HomeObject
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import HomeChange
from fleet2d.floorplan.load import advise_type
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.interventions.intervention import Entry
from fleet2d.metrics.metric import Metric
from fleet2d.scenario.compose import compose
from fleet2d.scenario.expectation_field import ExpectationField
from fleet2d.scenario.explain import explain
from fleet2d.sight.camera import SightSettings


def _parse_local_time(value: Any) -> Any:
    """Refuse what pydantic would read as seconds since 1970, and time zones."""
    if not isinstance(value, str | date):
        raise problem(f"expected a date and time like 2026-01-05T08:00, got {value}")
    try:
        moment = datetime.fromisoformat(value) if isinstance(value, str) else value
    except ValueError:
        raise problem(f"expected a date and time like 2026-01-05T08:00, got '{value}'") from None
    if isinstance(moment, datetime) and moment.tzinfo is not None:
        raise problem(
            "expected a local time without a time zone, since a simulated day has 24 hours, got"
            f" {moment.isoformat()}"
        )
    return moment


def _refuse_file_as_type(value: Any) -> Any:
    """Refuse the name of a file in place of a floor plan's type, with advice on how to read it."""
    name = value.get("type") if isinstance(value, Mapping) else value
    if isinstance(name, str) and (advice := advise_type(name)):
        raise problem_at(("type",), f"there is no floorplan {name!r}: {advice}", name)
    return value


class SimulationSettings(Settings):
    """When a run starts, how long it lasts, and how fast it goes.

    Attributes:
        start: The home's local time at step 0.
        duration: Simulated time. A run stops at its last full step within it.
        step: The length of a step.
        seed: The seed of all random draws; null: one is drawn and stored.
        max_span: The most steps that are computed at once. It changes no result.
        people_block: How long a person or robot waits for another body in its way before going
            round it; null: bodies don't block each other.
        speedup: Run at this many times real time; null: as fast as possible.
    """

    start: Annotated[datetime, BeforeValidator(_parse_local_time)] = datetime(2026, 1, 5)
    duration: Duration
    step: PositiveDuration = timedelta(seconds=1)
    seed: int | None = Field(default=None, ge=0, lt=2**63)
    max_span: int | None = Field(default=None, ge=1)
    people_block: PositiveDuration | None = Field(default=None, examples=["3 s"])
    speedup: float | None = Field(default=None, ge=0.001)

    @model_validator(mode="after")
    def _fits_the_calendar(self) -> Self:
        # Agendas look a week back and a day ahead.
        if not 1900 <= self.start.year <= 7900:
            raise problem_at(("start",), f"expected a year from 1900 to 7900, got {self.start}")
        return self

    @model_validator(mode="after")
    def _lasts_a_step(self) -> Self:
        if self.duration < self.step:
            raise problem_at(
                ("duration",),
                f"{format_duration(self.duration)} is shorter than one step, "
                f"{format_duration(self.step)}",
            )
        return self

    @property
    def steps(self) -> int:
        """The number of full steps in the duration."""
        return self.duration // self.step

    @property
    def step_us(self) -> int:
        """The length of a step [µs]."""
        return micros(self.step)


class Scenario(Settings):
    """Everything that defines a run.

    Attributes:
        name: The name of this scenario in reports.
        floorplan: The home's walls.
        users: The people, by name.
        robots: The robots, by name.
        objects: Doors and sensors, by name.
        changes: Changes of the home during the run, and when they happen.
        script: Interventions on people, robots and the home, and when they happen.
        sight: The method that computes what is in view.
        algorithms: The algorithms that run during the simulation, by name.
        metrics: The metrics that are recorded, by name.
        expect: The expectations that must hold over the run, by name.
        artifacts: The tables and files that a run stores.
    """

    name: str | None = None
    simulation: SimulationSettings
    floorplan: Annotated[FloorPlanSource, OneOf("floorplan"), BeforeValidator(_refuse_file_as_type)]
    users: Annotated[dict[str, Annotated[User, ShortForm()]], CheckNames] = Field(default={})
    robots: Annotated[dict[str, Annotated[Robot, ShortForm()]], CheckNames] = Field(default={})
    objects: Annotated[dict[str, Annotated[HomeObject, OneOf("object")]], CheckNames] = Field(
        default={}
    )
    changes: tuple[HomeChange, ...] = ()
    script: tuple[Entry, ...] = ()
    sight: SightSettings = SightSettings()
    algorithms: Annotated[
        dict[str, Annotated[Algorithm, OneOf("algorithm")]], CheckNames, NameAsType
    ] = Field(default={})
    metrics: Annotated[dict[str, Annotated[Metric, OneOf("metric")]], CheckNames, NameAsType] = (
        Field(default={})
    )
    expect: Annotated[dict[str, ExpectationField], CheckNames] = Field(default={})
    artifacts: ArtifactSettings = ArtifactSettings()
    _folder: Path = PrivateAttr(default_factory=Path.cwd)
    _document: Document = PrivateAttr(default_factory=Document)

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        nouns: dict[str, str] = {}
        for section, noun in (("users", "a user"), ("robots", "a robot"), ("objects", "an object")):
            for name in getattr(self, section):
                if name in nouns:
                    raise problem_at(
                        (section, name), f"there is {nouns[name]} named {name!r} already"
                    )
                nouns[name] = noun
        return self

    @model_validator(mode="after")
    def _behaviors_name_users(self) -> Self:
        for robot, entity in self.robots.items():
            for i, behavior in enumerate(entity.behaviors):
                for user in behavior.about():
                    if user not in self.users:
                        raise problem_at(
                            ("robots", robot, "behaviors", i),
                            f"there is no user {user!r}{suggest(user, self.users)}",
                        )
        return self

    @property
    def folder(self) -> Path:
        """The folder of the file that the scenario was read from."""
        return self._folder

    def where(self, path: str) -> str:
        """Return where a key is written, or the nearest key around it: 'home.yaml:15', else ''.

        Args:
            path: the key's path as in messages, like 'users.ana.days.0.items.1.place'; for a short
                form with or without 'behaviors.0'.

        Example:
            >>> load_scenario("users.ana.speed=0.9").where("users.ana.speed")
            "override 'users.ana.speed=0.9'"
        """
        keys = tuple(path.split("."))
        entry = keys[:2]
        if keys[2:4] == ("behaviors", "0") and (*entry, "behaviors") not in self._document.places:
            keys = (*entry, *keys[4:])
        return self._document.place(keys)

    def resolved(self) -> dict[str, Any]:
        """Return the whole scenario as plain JSON data that :func:`load_scenario` reads back."""
        return self.model_dump(mode="json")


def load_scenario(
    source: str | Path | Mapping[str, Any] | Scenario | None = None,
    /,
    *overrides: str,
    **settings: Any,
) -> Scenario:
    """Load a scenario, change it, and check all of it.

    Args:
        source: a YAML file, 'bundled:NAME', a mapping or a scenario; None, or an override in
            its place: the bundled base.
        overrides: texts like 'simulation.duration.days=60', the value in YAML.
        settings: keys of ``simulation`` (``seed=4``) or whole sections (``name="night"``).

    Raises:
        ScenarioError: the scenario is not valid; a line per problem says what is wrong, where it
            is written, and what is expected.
    """
    folder = Path.cwd()
    if isinstance(source, str) and "=" in source and not _is_path(source):
        overrides, source = (source, *overrides), None  # as on the command line
    if isinstance(source, Scenario):
        if not overrides and not settings:
            return source
        folder, source = source.folder, source.resolved()
    elif isinstance(source, str | Path) and not str(source).startswith("bundled:"):
        folder = Path(source).absolute().parent
    document = compose(source, overrides, {_key(name): v for name, v in settings.items()})
    return scenario_of(document, folder)


def scenario_of(document: Document, folder: Path) -> Scenario:
    """Check a composed scenario as a whole, and return it.

    Args:
        document: What `compose` returns.
        folder: The folder of the file that it was read from.

    Raises:
        ScenarioError: as `load_scenario`.
    """
    check_code("the scenario", document.data)
    try:
        scenario = Scenario.model_validate(document.data)
    except ValidationError as error:
        raise explain(error, document) from None
    scenario._folder, scenario._document = folder, document
    return scenario


def _is_path(text: str) -> bool:
    """Whether there is a file of that name; an override may be too long for a file name."""
    try:
        return Path(text).exists()
    except (OSError, ValueError):
        return False


def _key(name: str) -> tuple[str, ...]:
    if name in SimulationSettings.model_fields:
        return ("simulation", name)
    if name not in Scenario.model_fields:
        known = [*SimulationSettings.model_fields, *Scenario.model_fields]
        raise ScenarioError(f"unknown argument {name!r}{suggest(name, known)}")
    return (name,)
