"""The format of scenarios: a JSON Schema for editors, a list of components for people."""

import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue, models_json_schema
from pydantic_core import PydanticSerializationError, SchemaError, SchemaSerializer, core_schema

from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.components import Component, Settings, aliases, components
from fleet2d.interventions.intervention import verbs
from fleet2d.scenario.compose import ENTRIES
from fleet2d.scenario.model import Scenario


class _SchemaGenerator(GenerateJsonSchema):
    """Generates schemas with defaults as scenarios write them: '1 min', not pydantic's 'PT1M'."""

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Return the schema of a field with its default dumped as the field's type does."""
        result = super().default_schema(schema)
        if "default" in result:
            # A default that can't be dumped stays as it is, such as one that is yet to be parsed.
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
    """A registered component and its configuration."""

    kind: str
    type: str
    aliases: tuple[str, ...]
    summary: str
    fields: tuple[FieldDescription, ...]


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a scenario file."""
    # Interrupts are named by behaviors, not by the scenario.
    registry = {kind: components(kind) for kind in COMPONENTS if kind != "interrupt"}
    classes = [cls for types in registry.values() for cls in types.values()]
    models: list[type[BaseModel]] = [Scenario, *classes]
    references, definitions = models_json_schema(
        [(model, "validation") for model in models], schema_generator=_SchemaGenerator
    )
    definitions = definitions["$defs"]
    kinds = {
        kind: {
            name: definitions[_key(references[cls, "validation"])] for name, cls in classes.items()
        }
        for kind, classes in registry.items()
    }
    acts = kinds.pop("intervention")
    for cls in verbs().values():
        definitions.pop(_key(references[cls, "validation"]))
    definitions["Entry"] = {
        "anyOf": [
            _by_verb(definitions["Entry"], verb, cls.subject, acts[verb])
            for verb, cls in verbs().items()
        ]
    }
    for kind, types in kinds.items():
        for name, definition in types.items():
            properties = definition.get("properties", {})
            names = [name, *aliases(kind, name)]
            type_schema = {"enum": names} if names[1:] else {"const": name}
            definition.update(title=name, properties={"type": type_schema, **properties})
        own = registry[kind].values()
        forms = [{**references[cls, "validation"], "required": ["type"]} for cls in own]
        definitions[kind] = {"anyOf": [*forms, *_forms_without_fields(kind, registry[kind])]}
    definitions = {
        key: _without_required(_expand(value, kinds)) for key, value in definitions.items()
    }
    result = definitions.pop(_key(references[Scenario, "validation"]))
    _allow_composition(result["properties"])
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, **result, "$defs": definitions}


def _by_verb(
    entry: Mapping[str, Any], verb: str, subject: str, act: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the schema of an entry of a script: its verb, the time, and the other keys."""
    times = {key: value for key, value in entry["properties"].items() if key != "act"}
    details = {key: value for key, value in act["properties"].items() if key != subject}
    required = [key for key in act.get("required", ()) if key != subject]
    return {
        "title": verb,
        "description": act.get("description", ""),
        "type": "object",
        "properties": {verb: act["properties"][subject], **times, **details},
        "required": [verb, *required],
        "additionalProperties": False,
    }


def _key(reference: Mapping[str, Any]) -> str:
    return str(reference["$ref"]).rpartition("/")[2]


def _forms_without_fields(kind: str, names: Iterable[str]) -> list[dict[str, Any]]:
    """Return the ways to write a component whose fields the schema doesn't describe."""
    own_class = {"type": "string", "pattern": ":", "description": f"your own {kind}: module:Class"}
    return [
        {"type": "string", "enum": [n for name in names for n in (name, *aliases(kind, name))]},
        {"type": "object", "properties": {"type": own_class}, "required": ["type"]},
        own_class,
    ]


def _expand(value: Any, kinds: Mapping[str, Mapping[str, Any]]) -> Any:
    """Return a schema with the marks of `OneOf` and `ShortForm` replaced by types."""
    if isinstance(value, list):
        return [_expand(item, kinds) for item in value]
    if not isinstance(value, dict):
        return value
    result = {k: _expand(v, kinds) for k, v in value.items() if k != "x-short-form"}
    if (kind := result.pop("x-kind", None)) is not None:
        result["$ref"] = f"#/$defs/{kind}"
    if (mark := value.get("x-short-form")) is not None:
        for definition in kinds[mark["kind"]].values():
            properties = definition["properties"] | mark["body"]
            result["anyOf"].append({**definition, "properties": properties, "required": ["type"]})
        result["anyOf"] += _forms_without_fields(mark["kind"], kinds[mark["kind"]])
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
    registered type, and the groups of keys in their fields (kind `part`).
    """
    types = {(kind, name): cls for kind in COMPONENTS for name, cls in components(kind).items()}
    sections = _parts_of(Scenario)
    parts = [part for cls in types.values() for part in _parts_of(cls) if part not in sections]
    return [
        *(_describe("scenario", cls.__name__, cls) for cls in sections),
        *(_describe(kind, name, cls) for (kind, name), cls in types.items()),
        *(_describe("part", cls.__name__, cls) for cls in dict.fromkeys(parts)),
    ]


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


def _describe(kind: str, name: str, cls: type[Settings]) -> ComponentDescription:
    schema = cls.model_json_schema(schema_generator=_SchemaGenerator)
    if "$ref" in schema:  # it is nested in itself
        schema = schema["$defs"][schema["$ref"].rpartition("/")[2]]
    properties = schema.get("properties", {})
    required = schema.get("required", ())
    return ComponentDescription(
        kind,
        name,
        aliases(kind, name) if issubclass(cls, Component) else (),
        (cls.__doc__ or "").strip().partition("\n")[0],
        tuple(
            FieldDescription(
                key,
                _type_of(value),
                None if key in required else _default_text(value.get("default")),
                value.get("description", ""),
            )
            for key, value in properties.items()
        ),
    )


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
    result = {k: _without_required(v) for k, v in value.items() if k != "required"}
    if "type" in value.get("required", ()):
        result["required"] = ["type"]
    return result
