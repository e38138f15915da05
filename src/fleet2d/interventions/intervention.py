"""The base of interventions, and how they are written: `{put: ana, to: kitchen}`."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Annotated, Any, ClassVar

from pydantic import (
    Field,
    GetJsonSchemaHandler,
    SerializationInfo,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
)
from pydantic_core import CoreSchema, InitErrorDetails

from fleet2d.component import Codec, Component, components
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import ScenarioError
from fleet2d.interventions.world import World
from fleet2d.problems import did_you_mean, problem, problem_at, rewrite
from fleet2d.units import PositiveDuration


class Intervention(Component):
    """Something done to a run from outside: by a script, a test or a person.

    It is data: the same in a scenario's `script`, as a method of a simulation and in a manifest.
    What is done at a step holds for everything in that step: interventions come before the floor
    plan. Nobody else's random draws change by one.
    """

    kind: ClassVar[str] = "intervention"
    # The field that stands behind the verb where it is written short: `put: ana`.
    subject: ClassVar[str] = "entity"

    @property
    def lasts(self) -> timedelta | None:
        """After which time `end` is called; None: never."""
        return None

    def check(self, world: World) -> None:
        """Refuse what can't be: called before the run, or when a script asks for it.

        Raises:
            ScenarioError: There is nothing of that name.
            PlacementError: There is no such place, or nobody gets there.
        """

    def begin(self, world: World) -> None:
        """Do it at the present step."""
        raise NotImplementedError

    def end(self, world: World) -> None:
        """Undo it, when its time is over."""


class Lasting(Intervention):
    """Base of what holds for a while: `begin` and `end` go by all that is under way then."""

    duration: PositiveDuration | None = Field(
        default=None, description="for how long; left out: until it is undone by `restore`"
    )

    @property
    def lasts(self) -> timedelta | None:
        """Its duration."""
        return self.duration


def body(world: World, name: str) -> DecidingActor:
    """Return somebody in the run.

    Raises:
        ScenarioError: There is nobody of that name.
    """
    return _named(name, "nobody named", {**world.users, **world.robots})


def user(world: World, name: str) -> DecidingActor:
    """Return a person in the run.

    Raises:
        ScenarioError: There is no such person.
    """
    return _named(name, "no user", world.users)


def robot(world: World, name: str) -> DecidingActor:
    """Return a robot in the run.

    Raises:
        ScenarioError: There is no such robot.
    """
    return _named(name, "no robot", world.robots)


def _named(name: str, nobody: str, actors: Mapping[str, DecidingActor]) -> DecidingActor:
    if name not in actors:
        raise ScenarioError(
            f"there is {nobody} {name!r}{did_you_mean(name, actors)}"
            f" There are: {', '.join(actors) or 'none'}"
        )
    return actors[name]


class Verb(Codec):
    """Declares a field for an intervention, written by its verb: ``{put: ana, to: kitchen}``.

    The long form, ``{do: put, entity: ana, to: kitchen}``, is what it is dumped to.
    """

    def validate(self, value: Any, info: ValidationInfo) -> Intervention:
        """Build the intervention that a mapping describes."""
        if isinstance(value, Intervention):
            return value
        if not isinstance(value, Mapping):
            raise problem(f"found {value!r}; a mapping like {{put: ana, to: kitchen}} is wanted")
        fields = dict(value)
        if "do" in fields:
            return _of_name(fields.pop("do")).model_validate(fields, context=info.context)
        known = verbs()
        said = [key for key in fields if key in known]
        if len(said) != 1:
            raise _not_one_verb(said, fields, known)
        return _short(said[0], known[said[0]], fields, info)

    def dump(self, value: Intervention, info: SerializationInfo) -> dict[str, Any]:
        """Write the intervention in the long form."""
        fields = value.model_dump(
            mode=info.mode, context=info.context, exclude_defaults=info.exclude_defaults
        )
        return {"do": value.type_name, **fields}

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Leave it to `fleet2d.scenario.schema`, which knows all verbs."""
        return {"type": "object", "x-quantity": "intervention"}


def verbs() -> dict[str, type[Intervention]]:
    """Return all interventions by their verbs."""
    return components("intervention")  # type: ignore[return-value]


def _of_name(name: object) -> type[Intervention]:
    known = verbs()
    if not isinstance(name, str) or name not in known:
        text = f"there is no intervention {name!r}{did_you_mean(name, known)}"
        raise problem_at(("do",), f"{text} There are: {', '.join(known)}", name)
    return known[str(name)]


def _short(verb: str, cls: Any, fields: dict[str, Any], info: ValidationInfo) -> Intervention:
    """Build an intervention whose subject stands behind its verb; errors name the verb."""
    if cls.subject in fields and cls.subject != verb:
        raise problem(f"'{verb}' says which {cls.subject} it is: leave out '{cls.subject}'")

    def move(line: InitErrorDetails) -> InitErrorDetails:
        if line["loc"][:1] == (cls.subject,):
            line["loc"] = (verb, *line["loc"][1:])
        return line

    try:
        written = {cls.subject: fields.pop(verb), **fields}
        return cls.model_validate(written, context=info.context)  # type: ignore[no-any-return]
    except ValidationError as error:
        raise rewrite(error, move) from None


def _not_one_verb(
    said: list[str], fields: Mapping[str, Any], known: Mapping[str, type[Component]]
) -> Exception:
    if said:
        return problem(f"{' and '.join(said)} are given: one in each entry is wanted")
    near = [did_you_mean(key, known) for key in fields]
    hint = next((text for text in near if text.endswith("?")), ".")
    return problem(f"it doesn't say what is done{hint} There are: {', '.join(known)}")


_ADAPTER: TypeAdapter[Intervention] = TypeAdapter(Annotated[Intervention, Verb()])


def parse_intervention(content: Mapping[str, Any]) -> Intervention:
    """Return the intervention that a mapping describes, by its verb or in the long form.

    Raises:
        ScenarioError: It describes none; says what is wrong.

    Example:
        >>> parse_intervention({"put": "ana", "to": "kitchen"}).to
        ('kitchen',)
    """
    try:
        return _ADAPTER.validate_python(content)
    except ValidationError as error:
        raise refused("", error) from None


def dump_intervention(act: Intervention) -> dict[str, Any]:
    """Return an intervention as `parse_intervention` reads it: what differs from the defaults.

    Example:
        >>> dump_intervention(parse_intervention({"put": "ana", "to": "kitchen"}))
        {'do': 'put', 'entity': 'ana', 'to': 'kitchen'}
    """
    content: dict[str, Any] = _ADAPTER.dump_python(act, mode="json", exclude_defaults=True)
    return content


def refused(what: str, error: ValidationError) -> ScenarioError:
    """Say in a line what is wrong with an intervention.

    Args:
        what: How it was asked for, to begin the message; or empty.
        error: What the validation found.
    """
    first = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in first["loc"])
    why = first.get("ctx", {}).get("error", first["msg"])
    return ScenarioError(": ".join(filter(None, [what, key, str(why)])))
