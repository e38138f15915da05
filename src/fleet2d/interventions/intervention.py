"""Interventions as data, written as {put: ana, to: kitchen}, and the times of their entries."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, Protocol, Self

from pydantic import (
    BeforeValidator,
    Field,
    GetJsonSchemaHandler,
    PlainSerializer,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    model_serializer,
    model_validator,
)
from pydantic_core import CoreSchema, InitErrorDetails

from fleet2d.configuration.components import Codec, Component, Settings, components
from fleet2d.configuration.problems import (
    check_known,
    did_you_mean,
    problem,
    problem_at,
    rewrite,
    shown,
    suggest,
    validating,
)
from fleet2d.configuration.units import (
    Duration,
    PositiveDuration,
    format_time_of_day,
    parse_time_of_day,
    weekdays_of,
)
from fleet2d.entities.body import Pose
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.sensor import Sensor, SensorFault
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import Home, HomeChange, format_moment, parse_moment
from fleet2d.floorplan.slow_area import SlowArea
from fleet2d.runtime.clock import Clock, midnights
from fleet2d.runtime.events import Event, EventKind
from fleet2d.sight.camera import Disturbance, FalseSighting


class World(Protocol):
    """A run at the step of an intervention.

    Attributes:
        step: The present step.
        clock: The clock of the run, which converts between times and steps.
        home: The home, as it is at present.
        sensors: The sensors, by name.
        algorithms: The names of the algorithms.
    """

    step: int
    clock: Clock
    home: Home
    sensors: Mapping[str, Sensor]
    algorithms: Sequence[str]

    @property
    def users(self) -> Mapping[str, DecidingActor]:
        """The people, by name."""

    @property
    def robots(self) -> Mapping[str, DecidingActor]:
        """The robots, by name."""

    @property
    def lasting(self) -> Sequence[object]:
        """The active interventions with a duration, in order of beginning."""

    def undo(self, applies: Callable[[object], bool]) -> None:
        """End the active interventions to which a condition applies."""

    def keeps_truth(self, robot: str) -> bool:
        """Whether the run stores the truth beside what a robot perceives."""

    def disturb(self, robot: str, disturbances: Sequence[Disturbance]) -> None:
        """Set all disturbances of the cameras of a robot from the present step on."""

    def perceive(self, robot: str, sightings: Sequence[FalseSighting]) -> None:
        """Let a robot perceive people at the present step."""

    def stick(self, sensor: str, says: SensorFault | None) -> None:
        """Set the fault of a sensor from the present step on; None: it works."""

    def reset(self, algorithm: str, learned: Path | None) -> None:
        """Restart an algorithm with nothing learned, or with what a file holds."""

    def replace(self, algorithm: str, output: object) -> None:
        """Let all but metrics read another output of an algorithm; see `Learners.replace`."""

    def move(self, actor: DecidingActor, pose: Pose) -> None:
        """Put a body at a pose, where it replans."""

    def later(self, act: "Intervention", delay: timedelta) -> None:
        """Apply an intervention that follows from this one, after a time."""

    def switch_off(self, actor: DecidingActor) -> None:
        """Let a robot lose its power at the present step."""

    def switch_on(self, actor: DecidingActor) -> bool:
        """Let a robot begin anew at the present step; return whether it was carried elsewhere."""

    def drive(self, actor: DecidingActor) -> None:
        """Let a body follow plans from outside from now on, instead of its behaviors."""

    def check_change(self, change: HomeChange) -> None:
        """Refuse an impossible change of the home.

        Raises:
            ScenarioError: It names something unknown.
        """

    def change(self, change: HomeChange) -> None:
        """Change the home at the present step."""

    def slow(self, areas: Sequence[SlowArea]) -> None:
        """Set the areas that slow robots down, besides those of the floor plan."""

    def emit(self, entity: str, event: EventKind, detail: str) -> None:
        """Record an event at the present step."""


class Intervention(Component):
    """A change of a run from outside: by a script, a test or a person.

    An intervention is data: the same in a scenario's `script`, in `Simulation.do` and in a
    manifest. Interventions are the first phase of a step, so their effects hold for all of it. The
    random draws of all other bodies stay the same.
    """

    kind = "intervention"
    # The field whose value follows the verb in the short form: `put: ana`.
    subject: ClassVar[str] = "entity"

    def __init__(self, *values: Any, **keys: Any) -> None:
        """Describe an intervention: ``Put("ana", "kitchen")``.

        Args:
            values: The subject, then the other required fields in order.
            keys: All other fields.

        Raises:
            ScenarioError: A key is unknown, missing or given twice, or a value is wrong.
        """
        cls = type(self)
        needed = cls.needed()
        given = dict(zip(needed, values, strict=False))
        if len(values) > len(needed) or given.keys() & keys.keys():
            raise ScenarioError(
                f"{cls.__name__}(): give {' and '.join(needed)} once, and all others by keyword"
            )
        with validating(f"{cls.__name__}()"):
            super().__init__(**given, **keys)

    # Without this mark, pydantic passes no context through a custom constructor.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def needed(cls) -> list[str]:
        """Return the required fields, the subject first."""
        names = [name for name, field in cls.model_fields.items() if field.is_required()]
        return sorted(names, key=lambda name: name != cls.subject)

    def check(self, world: World) -> None:
        """Refuse an impossible intervention; called before the run, or when it is requested.

        Raises:
            ScenarioError: It names something unknown.
            PlacementError: There is no such place, or it can't be reached.
        """

    def begin(self, world: World) -> None:
        """Apply the intervention at the present step."""
        raise NotImplementedError

    def end(self, world: World) -> None:
        """Undo the intervention when its time is over."""


class Lasting(Intervention):
    """Base of interventions with a duration; `begin` and `end` apply all that are active then.

    By default, `end` calls `begin` of those that remain.

    Attributes:
        duration: Its duration; left out: until it is undone by `restore`.
    """

    duration: PositiveDuration | None = None

    def active(self, world: World) -> list[Self]:
        """Return the active interventions of this kind on the same subject, the latest last."""
        name = getattr(self, self.subject)
        same = (act for act in world.lasting if isinstance(act, type(self)))
        return [act for act in same if getattr(act, act.subject) == name]

    def end(self, world: World) -> None:
        """Apply the others that are still active."""
        self.begin(world)


def body(world: World, name: str) -> DecidingActor:
    """Return a person or robot in the run.

    Raises:
        ScenarioError: There is no such body.
    """
    return _actor_of(name, "nobody named", {**world.users, **world.robots})


def user(world: World, name: str) -> DecidingActor:
    """Return a person in the run.

    Raises:
        ScenarioError: There is no such person.
    """
    return _actor_of(name, "no user", world.users)


def robot(world: World, name: str) -> DecidingActor:
    """Return a robot in the run.

    Raises:
        ScenarioError: There is no such robot.
    """
    return _actor_of(name, "no robot", world.robots)


def _actor_of(name: str, noun: str, actors: Mapping[str, DecidingActor]) -> DecidingActor:
    if name not in actors:
        raise ScenarioError(f"there is {noun} {name!r}{suggest(name, actors)}")
    return actors[name]


class Verb(Codec):
    """Declares a field for an intervention, written by its verb: ``{put: ana, to: kitchen}``.

    It is dumped to the long form, ``{do: put, entity: ana, to: kitchen}``.
    """

    def validate(self, value: Any, info: ValidationInfo) -> Intervention:
        """Return the intervention that a mapping describes."""
        if isinstance(value, Intervention):
            return value
        if not isinstance(value, Mapping):
            raise problem(f"expected a mapping like {{put: ana, to: kitchen}}, got {value!r}")
        fields = dict(value)
        classes = verbs()
        if "do" in fields:
            name = fields.pop("do")
            check_known(name, "intervention", classes, partial(problem_at, ("do",), value=name))
            return classes[str(name)].model_validate(fields, context=info.context)
        keys = [key for key in fields if key in classes]
        if len(keys) != 1:
            raise _not_one_verb(keys, fields, classes)
        return _from_short_form(keys[0], classes[keys[0]], fields, info)

    def dump(self, value: Intervention, info: SerializationInfo) -> dict[str, Any]:
        """Return the intervention in the long form."""
        fields = value.model_dump(
            mode=info.mode, context=info.context, exclude_defaults=info.exclude_defaults
        )
        return {"do": value.type_name, **fields}

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return a mark that `fleet2d.scenario.schema` replaces by all verbs."""
        return {"type": "object", "x-quantity": "intervention"}


def verbs() -> dict[str, type[Intervention]]:
    """Return all interventions by their verbs."""
    return components("intervention")  # type: ignore[return-value]


def _from_short_form(
    verb: str, cls: Any, fields: dict[str, Any], info: ValidationInfo
) -> Intervention:
    """Return an intervention whose subject follows its verb; errors name the verb."""
    if cls.subject in fields and cls.subject != verb:
        raise problem(f"'{verb}' already names the {cls.subject}: leave out '{cls.subject}'")

    def move(line: InitErrorDetails) -> InitErrorDetails:
        if line["loc"][:1] == (cls.subject,):
            line["loc"] = (verb, *line["loc"][1:])
        return line

    try:
        long = {cls.subject: fields.pop(verb), **fields}
        return cls.model_validate(long, context=info.context)
    except ValidationError as error:
        raise rewrite(error, move) from None


def _not_one_verb(
    keys: list[str], fields: Mapping[str, Any], classes: Mapping[str, type[Component]]
) -> Exception:
    if keys:
        return problem(f"give exactly one of {' and '.join(keys)} in each entry")
    hints = [did_you_mean(key, classes) for key in fields]
    hint = next((text for text in hints if text.endswith("?")), ".")
    return problem(f"the key of the intervention is missing{hint} There are: {', '.join(classes)}")


_ADAPTER: TypeAdapter[Intervention] = TypeAdapter(Annotated[Intervention, Verb()])


def parse_intervention(content: Mapping[str, Any]) -> Intervention:
    """Return the intervention that a mapping describes, by its verb or in the long form.

    Raises:
        ScenarioError: It is not valid; the message says what is wrong.

    Example:
        >>> parse_intervention({"put": "ana", "to": "kitchen"}).to
        ('kitchen',)
    """
    with validating(""):
        return _ADAPTER.validate_python(content)


def dump_intervention(act: Intervention) -> dict[str, Any]:
    """Return an intervention as `parse_intervention` reads it, without fields at their defaults.

    Example:
        >>> dump_intervention(parse_intervention({"put": "ana", "to": "kitchen"}))
        {'do': 'put', 'entity': 'ana', 'to': 'kitchen'}
    """
    return _ADAPTER.dump_python(act, mode="json", exclude_defaults=True)


class ClockTime(NamedTuple):
    """A time of day, on some days of the week.

    Attributes:
        days: The days of the week, 0 is Monday.
        time: The time since midnight.
        text: The text in the scenario.
    """

    days: tuple[int, ...]
    time: timedelta
    text: str

    def moments(self, clock: Clock) -> Iterator[datetime]:
        """Yield all such moments of a run, in order."""
        end = clock.time(clock.steps)
        for midnight in midnights(clock.start, end):
            moment = midnight + self.time
            if midnight.weekday() in self.days and clock.start <= moment < end:
                yield moment


def parse_when(value: object) -> datetime | timedelta | ClockTime:
    """Read a time: ``19:00``, ``monday 07:30``, ``2026-01-07T14:00``, or ``2 h`` from the start.

    Example:
        >>> parse_when("weekend 9:00").text, parse_when("2 h")
        ('weekend 09:00', datetime.timedelta(seconds=7200))
    """
    if isinstance(value, ClockTime):
        return value
    words = value.split() if isinstance(value, str) else []
    if not 1 <= len(words) <= 2 or ":" not in words[-1] or "-" in words[-1]:
        if isinstance(value, str) and not value.strip()[:1].isdigit():
            raise problem(
                f"expected a time, got {shown(value)}: write it like '19:00', 'monday 07:30',"
                " '2026-01-07T14:00', or '2 h' from the start"
            )
        return parse_moment(value)
    if words[1:] and words[0][0].isdigit():  # 2026-01-07 14:00
        return parse_moment(value)
    *named, time_of_day = words
    time = parse_time_of_day(time_of_day)
    (names,) = named or ("daily",)
    days = sorted(weekdays_of(names.split(",")))
    text = " ".join([*named, format_time_of_day(time)])
    return ClockTime(tuple(days), time, text)


When = Annotated[
    datetime | timedelta | ClockTime,
    BeforeValidator(parse_when),
    PlainSerializer(lambda when: when.text if isinstance(when, ClockTime) else format_moment(when)),
    WithJsonSchema(
        {
            "description": "a time of day like 19:00, with days of the week before it like 'monday"
            " 07:30' or 'weekdays 08:00', a local time like 2026-01-07T14:00, or the time since the"
            " start like '2 h'",
            "x-quantity": "time",
            "type": ["string", "number", "object"],
            "examples": ["19:00", "monday 07:30", "2026-01-07T14:00", "2 h"],
        }
    ),
]


class Trigger(Settings):
    """An event that triggers an intervention: ``[user_seen, astro, ana]``, or its kind alone.

    Attributes:
        event: Its kind, as in the table of events.
        entity: The body, door or sensor that it happens to; left out: any.
        detail: Its detail: the user that is seen, the activity; left out: any.

    Example:
        >>> Trigger(event="user_seen", entity="astro").fits(Event(5, "astro", "user_seen", "ana"))
        True
    """

    event: str = Field(min_length=1)
    entity: str | None = None
    detail: str | None = None

    def fits(self, event: Event) -> bool:
        """Return whether an event triggers the intervention."""
        return (
            event.event == self.event
            and self.entity in (None, event.entity)
            and self.detail in (None, event.detail)
        )

    def __str__(self) -> str:
        """Return the event for a message: its kind, the entity and the detail."""
        return " ".join(filter(None, (self.event, self.entity, self.detail)))


def _as_mapping(value: Any) -> Any:
    if isinstance(value, str):
        return {"event": value}
    if isinstance(value, Sequence) and 1 <= len(value) <= 3:
        return dict(zip(Trigger.model_fields, value, strict=False))
    if not isinstance(value, Mapping | Trigger):
        raise problem(
            f"expected an event, got {shown(value)}: give its kind, the entity that it happens"
            " to, and its detail, like [user_seen, astro, ana]"
        )
    return value


On = Annotated[
    Trigger,
    BeforeValidator(_as_mapping),
    PlainSerializer(lambda trigger: trigger.model_dump(exclude_none=True)),
    WithJsonSchema(
        {
            "description": "an event: its kind, who it happens to, and what else it says, like"
            " [user_seen, astro, ana]",
            "x-quantity": "event",
            "anyOf": [
                {"type": "string"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1, "maxItems": 3},
                {
                    "type": "object",
                    "properties": {key: {"type": "string"} for key in Trigger.model_fields},
                    "required": ["event"],
                    "additionalProperties": False,
                },
            ],
            "examples": [
                EventKind.DOCKS,
                [EventKind.USER_SEEN, "astro"],
                [EventKind.ACTIVITY, "ana", "dinner"],
            ],
        }
    ),
]
"""An event in a script: its kind alone, a list, or a mapping."""


# The keys that stand beside those of an intervention.
ENTRY_KEYS = frozenset({"at", "on", "each", "delay"})


class Entry(Settings):
    """An intervention at a time or on an event: ``{at: "19:00", put: ana, to: kitchen}``.

    The intervention happens at the first step that isn't before its time, or at the step after its
    event, or later by a delay.

    Attributes:
        at: The time.
        on: The event instead of a time: [user_seen, astro, ana], or its kind alone.
        each: Whether it happens at every such time or event, not only at the first.
        delay: Time from the event to the intervention; at least a step.
        act: The intervention.

    Example:
        >>> entry = Entry(at="19:00", put="ana", to="kitchen")
        >>> entry.act.to
        ('kitchen',)
        >>> entry.model_dump(mode="json", exclude_defaults=True)
        {'at': '19:00', 'do': 'put', 'entity': 'ana', 'to': 'kitchen'}
    """

    at: When | None = None
    on: On | None = None
    each: bool = False
    delay: Duration = timedelta(0)
    act: Annotated[Intervention, Verb()]

    @model_validator(mode="before")
    @classmethod
    def _nest_act(cls, data: Any) -> Any:
        """Move the keys of the intervention, which are written beside its time, into `act`."""
        if not isinstance(data, dict) or "act" in data:
            return data
        times = {key: value for key, value in data.items() if key in ENTRY_KEYS}
        act = {key: value for key, value in data.items() if key not in ENTRY_KEYS}
        return {**times, "act": act}

    @classmethod
    def _explain(cls, line: InitErrorDetails, data: Any) -> InitErrorDetails:
        """Return an error that names the keys as they are written."""
        line = super()._explain(line, data)
        if line["loc"][:1] == ("act",):
            line["loc"] = line["loc"][1:]
        return line

    def model_post_init(self, _: object, /) -> None:
        """Require either a time or an event, and keys that fit it."""
        if (self.at is None) == (self.on is None):
            raise problem("give exactly one of 'at' (a time) and 'on' (an event)")
        if self.on is None and self.delay:
            raise problem("'delay' is the time after an event: it goes with 'on'")
        if self.each and self.on is None and not isinstance(self.at, ClockTime):
            raise problem(
                "'each' goes with an event, or a time that comes again, like '19:00' or 'monday"
                " 07:30'"
            )

    @model_serializer(mode="wrap")
    def _flatten_act(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the keys of the intervention beside its time."""
        content: dict[str, Any] = handler(self)
        act: dict[str, Any] = content.pop("act", {})
        return {key: value for key, value in content.items() if value is not None} | act


def parse_entry(content: Mapping[str, Any]) -> Entry:
    """Return the entry of a script that a mapping describes.

    Raises:
        ScenarioError: It is not valid; the message says what is wrong.
    """
    with validating(""):
        return Entry.model_validate(dict(content))


def causes_errors(act: Intervention, robot: str) -> bool:
    """Return whether an intervention makes a robot's perceptions wrong."""
    disturbance = getattr(act, "disturbance", None)
    if disturbance is None or getattr(act, "entity", None) != robot:
        return False
    return bool(disturbance.errs or disturbance.mistaken or disturbance.injected)
