"""Messages about wrong scenarios: where the value is, what is expected, and what it is."""

import re
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from fleet2d.bounds import one_line
from fleet2d.configuration.components import components
from fleet2d.configuration.documents import Document
from fleet2d.configuration.problems import MOST_LINES, Location, did_you_mean, shown
from fleet2d.errors import ScenarioError
from fleet2d.scenario.compose import slot_kind

_EXPECTED = {
    "int": "a whole number",
    "float": "a number",
    "decimal": "a number",
    "finite_number": "a finite number",
    "bool": "true or false",
    "string_type": "text",
    "string_pattern_mismatch": "text that matches {pattern}",
    "list": "a list",
    "tuple": "a list",
    "set": "a list",
    "dict": "a mapping of keys",
    "model": "a mapping of keys",
    "mapping": "a mapping of keys",
    "datetime": "a date and time, like 2026-01-05 or 2026-01-05T08:00",
    "date": "a date, like 2026-01-05",
    "time_delta": "seconds, as the field is a timedelta; a field of type Duration reads 5 min, too",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "greater_than_equal": "{ge} or more",
    "greater_than": "more than {gt}",
    "less_than_equal": "{le} or less",
    "less_than": "less than {lt}",
    "too_short": "a list of length {min_length} or more",
    "too_long": "a list of length {max_length} or less",
}
"""The expected value, by the beginning of pydantic's name for the error; the first match counts."""


def explain(error: ValidationError, document: Document) -> ScenarioError:
    """Return an error with one line per key: where it is written, its path, and what is wrong.

    >>> from fleet2d.scenario.model import SimulationSettings
    >>> document = Document({"duration": "1 h", "seed": "x"}, {("seed",): "home.yaml:3"})
    >>> try:
    ...     SimulationSettings.model_validate(document.data)
    ... except ValidationError as error:
    ...     print(explain(error, document))
    home.yaml:3: seed: expected a whole number, got 'x'
    """
    problems: dict[tuple[str, str], list[ErrorDetails]] = {}
    groups: set[str] = set()
    lines = error.errors(include_url=False)
    for line in lines[:MOST_LINES]:
        # A list is also called too short when all of its entries are wrong.
        depth = len(line["loc"])
        if line["type"] == "too_short" and any(
            entry["loc"][:depth] == line["loc"] for entry in lines if entry is not line
        ):
            continue
        location = _location_in(line, document.data)
        group = line.get("ctx", {}).get("group")
        if group and group in groups:
            continue
        groups.add(group or "")
        line["msg"] += _type_with_key(line, location, document.data)
        key = (document.place(location), one_line(".".join(map(str, location)), 200))
        problems.setdefault(key, []).append(line)
    texts = [
        ": ".join(part for part in (place, key, describe(*details)) if part)
        for (place, key), details in problems.items()
    ]
    if len(lines) >= MOST_LINES:
        texts.append("... and more: these are the first")
    return ScenarioError("\n".join(texts))


def describe(*lines: ErrorDetails) -> str:
    """Return what is wrong with one value, from the errors of all types that it may have."""
    texts: list[str] = []
    expected: list[str] = []
    choices: list[str] = []
    for line in lines:
        kind, context = line["type"], line.get("ctx", {})
        text = next((text for name, text in _EXPECTED.items() if kind.startswith(name)), None)
        if text is not None:
            limits = {k: f"{v:g}" if isinstance(v, float) else v for k, v in context.items()}
            expected.append(text.format(**limits))
            value = line["input"]
            if kind == "literal_error" and isinstance(value, str):
                choices += re.findall(r"'([^']*)'", context["expected"])
        elif kind == "missing":
            texts.append("missing, and has no default")
        elif kind in ("value_error", "assertion_error"):
            texts.append(str(context["error"]))
        else:
            texts.append(line["msg"])
    if expected:
        *first, last = dict.fromkeys(expected)
        joint = ", or " if any("," in text for text in first) else " or "
        hint = did_you_mean(value, choices) if choices else ""
        hint = hint if hint.endswith("?") else ""
        alternatives = joint.join([*first, last])
        texts.insert(0, f"expected {alternatives}, got {_quote(value)}{hint}")
    return "; or ".join(dict.fromkeys(texts))


def _type_with_key(line: ErrorDetails, location: Location, data: Any) -> str:
    """Return which types have an unknown key of a component, and what to do; empty if none has."""
    *parents, key = map(str, location or ("",))
    kind = slot_kind(tuple(parents))
    if line["type"] != "unknown_key" or kind is None:
        return ""
    for parent in location[:-1]:
        data = data[parent]
    types = {name: cls for name, cls in components(kind).items() if key in cls.model_fields}
    path = ".".join(parents)
    behaviors = data.get("behaviors") if isinstance(data, Mapping) else None
    for number, behavior in enumerate(behaviors if isinstance(behaviors, list) else ()):
        if (behavior.get("type") if isinstance(behavior, Mapping) else behavior) in types:
            return f". {key!r} is a key of its behavior: {path}.behaviors.{number}.{key}"
    if not types or isinstance(behaviors, list):
        return ""
    return f". {key!r} is a key of {', '.join(types)}: give {path}.type, too"


def _quote(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        keys = ", ".join(map(str, list(value)[:20]))
        return f"a mapping of {one_line(keys, 100)}" if value else "an empty mapping"
    return shown(value)


def _location_in(line: ErrorDetails, data: Any) -> Location:
    """Return a location without what pydantic adds: the member of a union, and '[key]'."""
    location = line["loc"]
    for depth, key in enumerate(location):
        try:
            data = data[key]
        except (LookupError, TypeError):
            is_missing = line["type"] == "missing" and depth == len(location) - 1
            return location[: depth + is_missing]
    return location
