"""The base of interventions, and how they are written: `{put: ana, to: kitchen}`."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Annotated, Any, ClassVar

from pydantic import (
    GetJsonSchemaHandler,
    SerializationInfo,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
)
from pydantic_core import CoreSchema, InitErrorDetails

from fleet2d.configuration.components import Codec, Component, components
from fleet2d.configuration.problems import (
    did_you_mean,
    problem,
    problem_at,
    refusal,
    rewrite,
    suggest,
)
from fleet2d.configuration.units import PositiveDuration
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import ScenarioError
from fleet2d.interventions.world import World


class Intervention(Component):
    """A change of a run from outside: by a script, a test or a person.

    It is data: the same in a scenario's `script`, as a method of a simulation and in a manifest.
    Interventions are the first phase of a step, so their effects hold for all of it. The random
    draws of all other bodies stay the same.
    """

    kind: ClassVar[str] = "intervention"
    # The field whose value follows the verb in the short form: `put: ana`.
    subject: ClassVar[str] = "entity"

    @property
    def lasts(self) -> timedelta | None:
        """The time after which `end` is called; None: never."""
        return None

    def check(self, world: World) -> None:
        """Refuse an impossible intervention; called before the run, or when it is requested.

        Raises:
            ScenarioError: It names something unknown.
            PlacementError: There is no such place, or it can't be reached.
        """

    def begin(self, world: World) -> None:
        """Apply it at the present step."""
        raise NotImplementedError

    def end(self, world: World) -> None:
        """Undo it when its time is over."""


class Lasting(Intervention):
    """Base of interventions with a duration; `begin` and `end` apply all that are active then.

    Attributes:
        duration: How long it lasts; left out: until it is undone by `restore`.
    """

    duration: PositiveDuration | None = None

    @property
    def lasts(self) -> timedelta | None:
        """Its duration."""
        return self.duration


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

    The long form, ``{do: put, entity: ana, to: kitchen}``, is what it is dumped to.
    """

    def validate(self, value: Any, info: ValidationInfo) -> Intervention:
        """Return the intervention that a mapping describes."""
        if isinstance(value, Intervention):
            return value
        if not isinstance(value, Mapping):
            raise problem(f"expected a mapping like {{put: ana, to: kitchen}}, got {value!r}")
        fields = dict(value)
        if "do" in fields:
            return _of_name(fields.pop("do")).model_validate(fields, context=info.context)
        classes = verbs()
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


def _of_name(name: object) -> type[Intervention]:
    classes = verbs()
    if not isinstance(name, str) or name not in classes:
        raise problem_at(
            ("do",), f"there is no intervention {name!r}{suggest(name, classes)}", name
        )
    return classes[name]


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
    try:
        return _ADAPTER.validate_python(content)
    except ValidationError as error:
        raise refusal("", error) from None


def dump_intervention(act: Intervention) -> dict[str, Any]:
    """Return an intervention as `parse_intervention` reads it, without fields at their defaults.

    Example:
        >>> dump_intervention(parse_intervention({"put": "ana", "to": "kitchen"}))
        {'do': 'put', 'entity': 'ana', 'to': 'kitchen'}
    """
    return _ADAPTER.dump_python(act, mode="json", exclude_defaults=True)
