"""The format of scenarios: a JSON Schema for editors, and a list of components for readers."""

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue, models_json_schema
from pydantic_core import PydanticSerializationError, SchemaError, SchemaSerializer, core_schema

from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.components import Component, Settings, components
from fleet2d.interventions.intervention import verbs
from fleet2d.scenario.compose import ENTRIES
from fleet2d.scenario.model import Scenario


class _SchemaGenerator(GenerateJsonSchema):
    """Generates schemas with defaults as scenarios write them: '1 min', not pydantic's 'PT1M'."""

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Return the schema of a field with its default dumped as the field's type does."""
        result = super().default_schema(schema)
        if "default" in result:
            # A default that can't be dumped, such as one not parsed yet, stays as it is.
            with suppress(SchemaError, PydanticSerializationError):
                default = self.get_default_value(schema)
                result["default"] = SchemaSerializer(schema).to_python(default, mode="json")
        return result


@dataclass(frozen=True)
class FieldDescription:
    """One configuration key of a component; ``default`` is None if the key is required."""

    name: str
    type: str
    default: str | None
    description: str


@dataclass(frozen=True)
class ComponentDescription:
    """A component and its configuration: its own keys, and who describes the inherited ones."""

    kind: str
    type: str
    summary: str
    fields: tuple[FieldDescription, ...]
    shares: tuple[str, ...]


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a scenario file."""
    classes = _classes()
    definitions = _definitions(classes)
    kinds: dict[str, dict[str, str]] = {kind: {} for kind in COMPONENTS}
    for cls, (kind, name) in classes.items():
        if kind in kinds:
            kinds[kind][name] = cls.__name__
    del kinds["interrupt"]  # behaviors name them, not the scenario
    acts = kinds.pop("intervention")
    times = definitions["Entry"]["properties"]
    del times["act"]
    forms = [
        _by_verb(verb, verbs()[verb].subject, name, definitions[name], times)
        for verb, name in acts.items()
    ]
    definitions["Entry"] = {"properties": times, "anyOf": forms}
    for kind, types in kinds.items():
        for name, cls_name in types.items():
            definition = definitions[cls_name]
            properties = {"type": {"const": name}, **definition.get("properties", {})}
            definition.update(title=name, properties=properties)
        forms = [{"$ref": f"#/$defs/{name}", "required": ["type"]} for name in types.values()]
        definitions[kind] = {"anyOf": [*forms, *_forms_without_fields(kind, types)]}
    expanded = {key: _expand(value, definitions, kinds) for key, value in definitions.items()}
    definitions = {key: _without_required(value) for key, value in expanded.items()}
    result = definitions.pop("Scenario")
    _allow_composition(result["properties"])
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, **result, "$defs": definitions}


def _classes() -> dict[type[Settings], tuple[str, str]]:
    """Return all settings with their kind and name: sections, types, and groups of their keys."""
    sections = {cls: ("scenario", cls.__name__) for cls in _parts_of(Scenario)}
    types: dict[type[Settings], tuple[str, str]] = {
        cls: (kind, name) for kind in COMPONENTS for name, cls in components(kind).items()
    }
    groups = dict.fromkeys(part for cls in types for part in _parts_of(cls))
    parts = {cls: ("part", cls.__name__) for cls in groups if cls not in sections}
    return {**sections, **types, **parts}


def _definitions(classes: Iterable[type[Settings]]) -> dict[str, Any]:
    """Return the schemas of settings and of a scenario by the names of their classes.

    Inherited keys are in the schema of the class that declares them; those of its heirs refer to
    it.
    """
    models: list[type[BaseModel]] = [Scenario, *classes]
    _, content = models_json_schema(
        [(model, "validation") for model in models], schema_generator=_SchemaGenerator
    )
    definitions: dict[str, Any] = content["$defs"]
    heirs: dict[tuple[str, str], list[str]] = {}
    for cls in classes:
        for key in cls.model_fields:
            heirs.setdefault((_declarer(cls, key), key), []).append(cls.__name__)
    for (owner, key), names in heirs.items():
        if len(names) > 1:
            _share(definitions, owner, key, names)
    return definitions


def _declarer(cls: type[Settings], key: str) -> str:
    """Return the name of the class that declares a key of a class."""
    return next(
        base.__name__ for base in cls.__mro__ if key in vars(base).get("__annotations__", {})
    )


def _share(definitions: dict[str, Any], owner: str, key: str, heirs: Sequence[str]) -> None:
    """Move a key to the schema of the class that declares it, but for heirs that change it."""
    first = definitions[heirs[0]]
    shared = definitions.setdefault(owner, {"properties": {}, "required": []})
    content = shared["properties"].setdefault(key, first["properties"][key])
    if key in first.get("required", ()) and key not in shared.get("required", ()):
        shared["required"].append(key)
    for name in heirs:
        properties = definitions[name]["properties"]
        if name != owner and properties[key] == content:
            properties |= _references(owner, [key])


def _references(owner: str, keys: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return keys whose schemas are those of a class."""
    return {key: {"$ref": f"#/$defs/{owner}/properties/{key}"} for key in keys}


def _by_verb(
    verb: str, subject: str, name: str, act: Mapping[str, Any], times: Iterable[str]
) -> dict[str, Any]:
    """Return the schema of an entry of a script: its verb, the time, and the other keys."""
    keys = _references(name, act["properties"])
    keys = {verb if key == subject else key: reference for key, reference in keys.items()}
    required = [key for key in act.get("required", ()) if key != subject]
    return {
        "title": verb,
        "description": act.get("description", ""),
        "type": "object",
        "properties": keys | _references("Entry", times),
        "required": [verb, *required],
        "additionalProperties": False,
    }


def _forms_without_fields(kind: str, names: Iterable[str]) -> list[dict[str, Any]]:
    """Return the ways to write a component whose fields the schema doesn't describe."""
    own_class = {"type": "string", "pattern": ":", "description": f"your own {kind}: module:Class"}
    return [
        {"type": "string", "enum": list(names)},
        {"type": "object", "properties": {"type": own_class}, "required": ["type"]},
        own_class,
    ]


def _expand(
    value: Any, definitions: Mapping[str, Any], kinds: Mapping[str, Mapping[str, str]]
) -> Any:
    """Return a schema with the marks of `OneOf` and `ShortForm` replaced by types."""
    if isinstance(value, list):
        return [_expand(item, definitions, kinds) for item in value]
    if not isinstance(value, dict):
        return value
    result = {key: _expand(item, definitions, kinds) for key, item in value.items()}
    if (kind := result.pop("x-kind", None)) is not None:
        result["$ref"] = f"#/$defs/{kind}"
    if (kind := result.pop("x-short-form", None)) is not None:
        body = str(result["anyOf"][0]["$ref"]).rpartition("/")[2]
        keys = definitions[body]["properties"].keys() - {"behaviors"}
        for title, name in kinds[kind].items():
            own = _references(name, definitions[name]["properties"])
            form = {
                "title": title,
                "type": "object",
                "additionalProperties": False,
                "properties": own | _references(body, sorted(keys)),
                "required": ["type"],
            }
            result["anyOf"].append(form)
        result["anyOf"] += _forms_without_fields(kind, kinds[kind])
    return result


def _allow_composition(properties: dict[str, Any]) -> None:
    """Add what only files may contain, not composed scenarios: 'extends', and deletion by null."""
    path = {"type": "string", "description": "a YAML file beside this one, or 'bundled:NAME'"}
    properties["extends"] = {
        "description": "The scenarios that this file extends.",
        "anyOf": [path, {"type": "array", "items": path}],
    }
    deletion = {"type": "null", "description": "null deletes an entry of the extended file"}
    for section in ENTRIES:
        entry = properties[section]["additionalProperties"]
        properties[section]["additionalProperties"] = {"anyOf": [entry, deletion]}


def describe_components() -> list[ComponentDescription]:
    """Return descriptions of all parts of a scenario: fields, their units and defaults.

    First the sections of every scenario (kind `scenario`, with their names in Python), then every
    type, the groups of keys in their fields (kind `part`), and the keys that several of all these
    share (kind `shared`).
    """
    classes = _classes()
    definitions = _definitions(classes)
    kinds = {cls.__name__: place for cls, place in classes.items()}
    for name, definition in definitions.items():
        if definition.get("properties") and name != "Scenario":
            kinds.setdefault(name, ("shared", name))
    return [_describe(*place, definitions[name], kinds) for name, place in kinds.items()]


def _parts_of(cls: type[Settings], above: tuple[type[Settings], ...] = ()) -> list[type[Settings]]:
    """Return the classes of settings nested in a class, outermost first, without components."""
    parts: list[type[Settings]] = []
    for field in cls.model_fields.values():
        for part in _settings_in(field.annotation):
            if part not in above:
                parts += [part, *_parts_of(part, (*above, part))]
    return list(dict.fromkeys(parts))


def _settings_in(annotation: Any) -> list[type[Settings]]:
    if isinstance(annotation, type) and issubclass(annotation, Settings):
        return [] if issubclass(annotation, Component) else [annotation]
    return [part for argument in get_args(annotation) for part in _settings_in(argument)]


def _describe(
    kind: str, name: str, definition: Mapping[str, Any], kinds: Mapping[str, tuple[str, str]]
) -> ComponentDescription:
    fields = []
    shares = []
    for key, value in definition.get("properties", {}).items():
        _, is_shared, place = value.get("$ref", "").partition("/$defs/")
        owner, is_key, _ = place.partition("/properties/")
        if is_shared and is_key:
            shares.append(kinds[owner][1])
            continue
        is_required = key in definition.get("required", ())
        default = None if is_required else _default_text(value.get("default"))
        text = value.get("description", "")
        fields.append(FieldDescription(key, _type_of(value), default, text))
    summary = definition.get("description", "").partition("\n")[0]
    shared = tuple(dict.fromkeys(shares))
    return ComponentDescription(kind, name, summary, tuple(fields), shared)


def _type_of(value: Mapping[str, Any]) -> str:
    """Return the type of a JSON Schema in words."""
    if mark := value.get("x-quantity", value.get("x-kind")):
        return str(mark)
    if "const" in value or "enum" in value:
        return " | ".join(map(str, value.get("enum", [value.get("const")])))
    if "$ref" in value:
        return str(value["$ref"]).rpartition("/")[2]
    options = value.get("anyOf", value.get("oneOf"))
    if options:
        types = [_type_of(option) for option in options if "not" not in option]
        return " | ".join(dict.fromkeys(types))
    if "prefixItems" in value:
        return f"[{', '.join(map(_type_of, value['prefixItems']))}]"
    if value.get("type") == "array":
        return f"list of {_type_of(value.get('items', {}))}"
    if value.get("type") == "object":
        inner = value.get("additionalProperties")
        return f"mapping to {_type_of(inner if isinstance(inner, Mapping) else {})}"
    words = {"integer": "whole number", "string": "text", "boolean": "true | false"}
    types = value.get("type", "any")
    kinds = types if isinstance(types, list) else [types]
    return " | ".join(words.get(kind, str(kind)) for kind in kinds)


def _default_text(default: Any) -> str:
    return json.dumps(default) if default is None or isinstance(default, bool) else str(default)


def _without_required(value: Any) -> Any:
    """Drop 'required' except for ``type``: an extended file may give the other keys."""
    if isinstance(value, list):
        return [_without_required(item) for item in value]
    if not isinstance(value, dict):
        return value
    result = {key: _without_required(inner) for key, inner in value.items() if key != "required"}
    if "type" in value.get("required", ()):
        result["required"] = ["type"]
    return result
