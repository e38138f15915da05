"""Components: the parts of a scenario, and how they are declared and looked up.

A component is one class whose typed fields are its configuration. Its kind (floorplan, behavior,
algorithm, metric) is declared by the base class of all components of that kind::

    class Algorithm(Component):
        kind: ClassVar[str] = "algorithm"

    class Likelihood(Algorithm):
        period: Duration = timedelta(hours=1)

Its name is in the table of `fleet2d.configuration.built_in`; installed packages register theirs as
entry points of the group `fleet2d.KIND`.
"""

import importlib.util
import inspect
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Self,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    SerializationInfo,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, InitErrorDetails, core_schema

from fleet2d.bounds import ENTRIES, ITEMS, Bound, one_line
from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.importing import BrokenModule, class_path, import_class
from fleet2d.configuration.problems import (
    Location,
    did_you_mean,
    problem,
    problem_at,
    rewrite,
    shown,
    unknown_key,
)
from fleet2d.errors import (
    Fleet2DError,
    ScenarioError,
    errors_as,
    may_be_ctrl_c,
    text_of,
)
from fleet2d.storage.names import problem_of

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints


T = TypeVar("T")

_SECTION = re.compile(r"^(?:Attributes|Examples?|Raises):$", re.MULTILINE)
_ENTRY = re.compile(r"^    (\w[\w, ]*): (.*(?:\n {5,}.*)*)", re.MULTILINE)


def descriptions(cls: type) -> dict[str, str]:
    """Return the descriptions in the `Attributes` section of a class and its bases, by name.

    >>> class Lamp:
    ...     '''A lamp.
    ...
    ...     Attributes:
    ...         power, most: Its power [W],
    ...             and the most that it can have.
    ...     '''
    >>> descriptions(Lamp)["most"]
    'Its power [W], and the most that it can have.'
    """
    texts: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if base is BaseModel:
            continue
        docstring = inspect.cleandoc(vars(base).get("__doc__") or "")
        _, _, section = docstring.partition("Attributes:\n")
        for names, text in _ENTRY.findall(section.partition("\n\n")[0]):
            texts |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return texts


def summary(cls: type) -> str:
    """Return the docstring of a class up to its first section."""
    return _SECTION.split(inspect.cleandoc(cls.__doc__ or ""))[0].rstrip()


class DescribedModel(BaseModel):
    """A model whose JSON Schema takes the descriptions of its fields from docstrings.

    A `description` of the field itself takes precedence.
    """

    # Building the first validator loads modules that a home without a scenario doesn't need.
    model_config = ConfigDict(defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the schema with descriptions."""
        result = handler(schema)
        definition = handler.resolve_ref_schema(result)
        definition["description"] = summary(cls)
        properties = definition.get("properties", {})
        texts = descriptions(cls)
        for name, field in cls.model_fields.items():
            key = field.alias or name
            if key in properties and name in texts and not field.description:
                properties[key]["description"] = texts[name]
        return result


# YAML doesn't read these as text, so such a name would need quotes wherever it is used.
_NO_TEXT = frozenset({"null", "true", "false"})


def _check_names(entries: Any) -> Any:
    """Refuse names that can't be part of a key path, a file name or a table name."""
    if isinstance(entries, Mapping):
        _check_count(ENTRIES, (), entries)
        for name in entries:
            if problem := problem_of(str(name)):
                raise problem_at((name,), f"the name {one_line(repr(name))} {problem}")
            if str(name).lower() in _NO_TEXT:
                raise problem_at((name,), f"{name} is not text in YAML: choose another name")
    return entries


def once(info: ValidationInfo, key: object, validate: Callable[[], T]) -> T:
    """Return the validated form of a file or the like that many entries name; validate it once.

    Args:
        info: Information on the entry's validation; its context, if any, keeps the result.
        key: Identifies the named thing.
        validate: The function that reads and validates it.

    Raises:
        ValueError: The thing is invalid, as the first entry found; or the counts, which each entry
            adds again, exceed a bound.
    """
    if info.context is None:
        return validate()
    if key not in info.context:
        before = Counter(info.context.get(Counter))
        try:
            result: T | ValueError = validate()
        except ValueError as error:  # the errors of pydantic are
            result = error
        info.context[key] = result, Counter(info.context.get(Counter)) - before
    else:
        for bound, amount in info.context[key][1].items():
            count(info, bound, amount)
    result = info.context[key][0]
    if isinstance(result, ValueError):
        raise result
    return result


def count(info: ValidationInfo, bound: Bound, amount: int) -> None:
    """Add an amount to the count of a bound, in the context of the validation, if there is any.

    Raises:
        PydanticCustomError: The count exceeds the bound; only the first such error is shown.
    """
    if info.context is None:
        return
    amounts = info.context.setdefault(Counter, Counter())  # amounts by bound
    amounts[bound] += amount
    with errors_as(partial(problem, group=bound.name)):
        bound.check(amounts[bound], "the scenario", prefix="at least ")


def _name_as_type(entries: Any) -> Any:
    """Let `ltp_error: {of: ltp}` stand for `ltp_error: {type: ltp_error, of: ltp}`."""
    if not isinstance(entries, Mapping):
        return entries
    return {
        name: {"type": name, **entry} if isinstance(entry, Mapping) else entry
        for name, entry in entries.items()
    }


CheckNames = BeforeValidator(_check_names)
"""Declares that the keys of a mapping are names of entries."""


class NameAsType:
    """Declares that an entry without a `type` is of the type of its name."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Add the types before ``source`` is validated."""
        return core_schema.no_info_before_validator_function(_name_as_type, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the schema of the mapping, whose entries may be untyped."""
        result = handler(schema)
        untyped = {"type": "object", "not": {"required": ["type"]}}
        return {
            **result,
            "additionalProperties": {"anyOf": [result["additionalProperties"], untyped]},
        }


def split_short_form(data: Any, body_fields: Iterable[str]) -> Any:
    """Move the fields of an entity's only behavior from beside its body's into ``behaviors``.

    >>> split_short_form({"type": "meander", "radius": 0.2, "pause": 3}, ["radius"])
    {'radius': 0.2, 'behaviors': [{'type': 'meander', 'pause': 3}]}
    """
    if isinstance(data, str):
        return {"behaviors": [data]}
    if not isinstance(data, Mapping) or "type" not in data:
        return data
    if "behaviors" in data:
        raise problem_at(("behaviors",), "give 'type' (one behavior) or 'behaviors', not both")
    body = {key: value for key, value in data.items() if key in set(body_fields)}
    behavior = {key: value for key, value in data.items() if key not in body}
    return {**body, "behaviors": [behavior]}


class ShortForm:
    """Lets an entity's only behavior be written beside its body: ``Annotated[User, ShortForm()]``.

    Errors in the behavior's fields name the keys as they are written.
    """

    def __get_pydantic_core_schema__(
        self, source: type[BaseModel], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate ``source`` from both forms."""
        body = source.model_fields.keys() - {"behaviors"}

        def move(line: InitErrorDetails) -> InitErrorDetails:
            if line["loc"][:2] == ("behaviors", 0):
                line["loc"] = line["loc"][2:]
                if "known" in line["ctx"] and len(line["loc"]) == 1:
                    line["type"] = unknown_key(line["loc"][0], {*line["ctx"]["known"], *body})
            return line

        def validate(data: Any, validate_long: Callable[[Any], Any]) -> Any:
            long = split_short_form(data, body)
            try:
                return validate_long(long)
            except ValidationError as error:
                raise error if long is data else rewrite(error, move) from None

        return core_schema.no_info_wrap_validator_function(validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return a mark for `fleet2d.scenario.schema` to add short forms."""
        long = handler(schema)
        behaviors = handler.resolve_ref_schema(long)["properties"]["behaviors"]
        return {"anyOf": [long], "x-short-form": behaviors["items"]["x-kind"]}


class Settings(DescribedModel):
    """A frozen group of configuration keys; the error about an unknown key lists the known ones."""

    # Validators are built when a class is first used: a scenario uses few of all classes.
    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_default=True, allow_inf_nan=False, defer_build=True
    )

    # The key that a value of some types stands for, in place of a mapping.
    short_form: ClassVar[tuple[str, tuple[type, ...]]] = ("", ())

    @model_validator(mode="wrap")
    @classmethod
    def _name_known_keys(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(data, cls.short_form[1]):
            data = {cls.short_form[0]: data}
        if isinstance(data, Mapping):
            _refuse_early(data, cls.model_fields)
        try:
            return handler(data)
        except ValidationError as error:
            raise rewrite(error, lambda line: cls._explain(line, data)) from None

    @classmethod
    def _explain(cls, line: InitErrorDetails, data: Any) -> InitErrorDetails:
        """Return an error with the list of known keys, or an example of the expected list."""
        kind = line["type"]
        key, *inner_keys = line["loc"] or ("",)
        if kind == "extra_forbidden" and not inner_keys:
            line["type"] = unknown_key(key, cls.model_fields)
        lacks_item = kind == "missing" and len(inner_keys) == 1 and isinstance(inner_keys[0], int)
        if lacks_item or (kind in ("tuple_type", "too_long") and not inner_keys):
            example = _example(cls, str(key))
            if example and isinstance(data, Mapping):
                line["type"] = problem(
                    f"expected a list like {example}, got {shown(data.get(key))}"
                )
                line["loc"] = (key,)
        return line

    def __eq__(self, other: object) -> bool:
        """Compare the configuration; run state doesn't count."""
        return type(self) is type(other) and all(
            getattr(self, name) == getattr(other, name) for name in type(self).model_fields
        )


_NUMBERS = (int, float, int | None, float | None)


def _refuse_early(data: Mapping[Any, Any], fields: Mapping[str, FieldInfo]) -> None:
    """Refuse data that Pydantic would accept, or would take very long to refuse.

    Raises:
        ValidationError: True or false stands for a number, or a list has too many entries.
    """
    for key, value in data.items():
        if isinstance(value, bool) and key in fields and fields[key].annotation in _NUMBERS:
            text = str(value).lower()
            raise problem_at((key,), f"expected a number, got {text}", value)
        if isinstance(value, list | tuple) and value and isinstance(value[0], str | Mapping):
            _check_count(ITEMS, (key,), value)


def _check_count(bound: Bound, location: Location, entries: Sized) -> None:
    with errors_as(partial(problem_at, location)):
        bound.check(len(entries), "it")


def _example(cls: type[Settings], key: str) -> str:
    """Return a key's example, else its default, if that is a list of numbers; else no text."""
    field = cls.model_fields.get(key)
    values = (field.examples or [field.default])[0] if field else None
    if not isinstance(values, tuple | list) or not values:
        return ""
    if not all(isinstance(value, int | float) for value in values):
        return ""
    return f"[{', '.join(f'{value:g}' for value in values)}]"


_NAMES: dict[str, str] = {}
for _types in COMPONENTS.values():
    for _name, _path in _types.items():
        _NAMES.setdefault(_path, _name)


class Component(Settings):
    """A part of a scenario that a ``type`` selects.

    Declared fields are configuration and frozen. All other attributes of an instance are run state:
    they are copied with it, and not dumped.

    >>> class Counter(Component):
    ...     limit: int = 3
    >>> counter = Counter()
    >>> counter.seen = 1
    >>> counter.model_dump()
    {'limit': 3}
    """

    kind: ClassVar[str] = ""
    type_name: ClassVar[str] = ""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Set the type name: the name in a table, else the path of the class."""
        super().__init_subclass__(**kwargs)
        path = class_path(cls)
        cls.type_name = _NAMES.get(path, path)

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Build a user's class at once, so that errors point to where the class is declared."""
        if not cls.__module__.startswith("fleet2d."):
            cls.model_rebuild(raise_errors=False)

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse to change configuration; store all other attributes as run state."""
        cls = type(self)
        fixed, private = _names_of(cls)
        if name in fixed:
            noun = "configuration" if name in cls.model_fields else "a ClassVar"
            raise AttributeError(
                f"{name} is {noun} of {cls.__name__} and can't be changed in a run; store what "
                "changes in another attribute"
            )
        if name in private:
            super().__setattr__(name, value)
        else:
            object.__setattr__(self, name, value)


@lru_cache(maxsize=1000)
def _names_of(cls: type[Component]) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names that a component can't set, and its private attributes; cached."""
    fixed = {*cls.model_fields, *cls.__class_vars__}
    return frozenset(fixed), frozenset(cls.__private_attributes__)


def lookup(kind: str, name: str) -> type[Component]:
    """Return a component class by its name in a table, or by its path 'package.module:Class'.

    Modules named in a scenario are searched in the scenario's own folder first, then among the
    installed ones. 'folder/package.module:Class' names the folder.

    Raises:
        ScenarioError: There is no such component, it can't be imported, or it is of another kind.
    """
    if ":" in name:
        return _check_class(kind, name, import_class(name))
    path = COMPONENTS.get(kind, {}).get(name)
    if path is not None:
        return _built_in(path)
    for entry in _plugins(kind).select(name=name):
        if _is_there(entry):
            cls = _check_class(kind, name, import_class(entry.value, is_plugin=True))
            cls.type_name = name
            return cls
    known = components(kind)
    near = did_you_mean(name, known)
    raise ScenarioError(
        f"there is no {kind.replace('_', ' ')} {name!r}{near} There are:"
        f" {', '.join(known) or 'none'}; your own is written 'package.module:Class'"
    )


def components(kind: str) -> dict[str, type[Component]]:
    """Return every component of a kind, built in or from an entry point, by name, sorted."""
    classes = map(_built_in, COMPONENTS.get(kind, {}).values())
    types = {cls.type_name: cls for cls in classes}
    entries = filter(_is_there, _plugins(kind))
    plugins = {entry.name: lookup(kind, entry.name) for entry in entries}
    return dict(sorted((plugins | types).items()))


@cache
def _built_in(path: str) -> type[Component]:
    module, _, name = path.partition(":")
    return getattr(importlib.import_module(module), name)


@cache
def _plugins(kind: str) -> "EntryPoints":
    """Return the components of a kind that installed packages declare."""
    from importlib.metadata import entry_points  # slow to import, and seldom used

    return entry_points(group=f"fleet2d.{kind}")


def _name_of(cls: type[Component]) -> str:
    """Return the name of a class in a table, else its path."""
    if ":" in cls.type_name and "/" not in cls.type_name:  # the class may have been unpickled
        for entry in _plugins(cls.kind):
            if entry.value == cls.type_name:
                cls.type_name = entry.name
    return cls.type_name


def _is_there(entry: "EntryPoint") -> bool:
    """Return whether the module of an entry point exists; a limb may have been removed."""
    try:
        return importlib.util.find_spec(entry.module) is not None
    except ModuleNotFoundError:
        return False


def base_of(cls: type[Component]) -> type[Component]:
    """Return the base class that declares the component's kind; its fields fit every type."""
    return next((base for base in reversed(cls.__mro__) if vars(base).get("kind")), Component)


def _check_class(kind: str, name: str, cls: object) -> type[Component]:
    if not (isinstance(cls, type) and issubclass(cls, Component) and cls.kind == kind):
        raise ScenarioError(
            f"{name!r} is not a {kind}: it must be a class derived from the "
            f"{kind} base class of fleet2d"
        )
    if not cls.__pydantic_complete__ and cls.model_rebuild(raise_errors=False) is not True:
        raise ScenarioError(
            f"{name!r} has a field whose type can't be found: import it in its module, not only "
            "for type checkers"
        )
    if methods := sorted(getattr(cls, "__abstractmethods__", ())):
        raise ScenarioError(f"{name!r} is an incomplete {kind}: it lacks {', '.join(methods)}")
    return cls


class Codec:
    """Declares how a field is read from a mapping and dumped to one."""

    def validate(self, value: Any, info: ValidationInfo) -> Any:
        """Return the value that a mapping describes."""
        raise NotImplementedError

    def dump(self, value: Any, info: SerializationInfo) -> dict[str, Any]:
        """Return a mapping that validates to an equal value."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return a schema that validates and dumps by the methods of this class."""
        return core_schema.with_info_plain_validator_function(
            self.validate,
            serialization=core_schema.plain_serializer_function_ser_schema(
                self.dump, info_arg=True, return_schema=core_schema.dict_schema()
            ),
        )


@dataclass(frozen=True)
class _Typed(Codec):
    """Declares a field for any component of a kind, which its ``type`` selects."""

    kind: str

    def validate(self, value: Any, info: ValidationInfo) -> Component:
        """Return the component that a mapping describes."""
        if isinstance(value, Component):
            if value.kind != self.kind:
                raise problem(f"expected a {self.kind}, got a {type(value).__name__}")
            return value
        if isinstance(value, str):
            value = {"type": value}
        if not isinstance(value, Mapping):
            raise problem(f"expected a mapping with 'type', or the name of a type, got {value!r}")
        fields = dict(value)
        name = fields.pop("type", None)
        try:
            if not isinstance(name, str):
                known = ", ".join(components(self.kind))
                raise ScenarioError(f"'type' is needed to tell which {self.kind} this is: {known}")
            cls = lookup(self.kind, name)
        except ScenarioError as error:
            group = error.cause if isinstance(error, BrokenModule) else ""
            raise problem_at(("type",), str(error), name, group) from error
        try:
            return cls.model_validate(fields, context=info.context)
        except (ValueError, AssertionError, Fleet2DError):
            raise
        except BaseException as error:  # a validator of the user's own may raise anything
            if may_be_ctrl_c(error):
                raise
            reason = f"{type(error).__name__}: {text_of(error)}"
            raise problem(f"{name} failed while its keys were checked: {reason}") from error

    def dump(self, value: Component, info: SerializationInfo) -> dict[str, Any]:
        """Return a mapping that validates to an equal component."""
        fields = value.model_dump(
            mode=info.mode,
            context=info.context,
            exclude_defaults=info.exclude_defaults,
            exclude_unset=info.exclude_unset,
        )
        return {"type": _name_of(type(value)), **fields}

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return a mark that `fleet2d.scenario.schema` replaces by all types of the kind."""
        return {"x-kind": self.kind}


if TYPE_CHECKING:
    OneOf = Annotated[T, _Typed("")]
else:

    class OneOf:
        """A field for any component of the kind of a class: ``OneOf[Metric]``.

        Its input is a mapping with ``type``, the bare name of a type, or an instance; it dumps to
        the mapping.
        """

        def __class_getitem__(cls, base: type[Component]) -> Any:
            """Return the annotation of a field."""
            return Annotated[base, _Typed(base.kind)]


def kind_at(form: Any, keys: Sequence[str], marks: Sequence[object] = ()) -> str | None:
    """Return the kind of component that is configured at a path, None if there is none.

    Args:
        form: The settings or the annotation of a field in which the path begins.
        keys: The path. It doesn't enter components, whose keys depend on their types.
        marks: The metadata of the field.
    """
    if get_origin(form) is Annotated:
        inner, *more = get_args(form)
        return kind_at(inner, keys, more)
    for mark in marks:
        if isinstance(mark, _Typed):
            return None if keys else mark.kind
        if isinstance(mark, ShortForm) and not keys:
            return kind_at(form, ("behaviors", "0"))
    if isinstance(form, type) and issubclass(form, Settings):
        field = form.model_fields.get(keys[0]) if keys else None
        return field and kind_at(field.annotation, keys[1:], field.metadata)
    forms = get_args(form)
    if get_origin(form) in (Union, UnionType):
        return next(filter(None, (kind_at(option, keys) for option in forms)), None)
    if get_origin(form) is tuple and keys:
        return kind_at(forms[0], keys[1:])
    return kind_at(forms[1], keys[1:]) if get_origin(form) is dict and keys else None
