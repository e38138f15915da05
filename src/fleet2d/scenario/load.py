"""Loading of scenarios: composition, validation of the whole, and messages about errors."""

import re
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from fleet2d.bounds import one_line
from fleet2d.configuration.components import components, kind_at
from fleet2d.configuration.documents import Document
from fleet2d.configuration.problems import (
    MAX_LINES,
    Location,
    did_you_mean,
    shown,
    suggest,
)
from fleet2d.errors import ScenarioError
from fleet2d.scenario.compose import compose
from fleet2d.scenario.model import Scenario, SimulationSettings


def load_scenario(
    source: str | Path | Mapping[str, Any] | Scenario | None = None,
    /,
    *overrides: str,
    **settings: Any,
) -> Scenario:
    """Load a scenario, change it, and check all of it.

    Args:
        source: a YAML file, 'bundled:NAME', a mapping or a scenario; if it is None or an override,
            the bundled family.
        overrides: texts like 'simulation.duration.days=60', the value in YAML.
        settings: keys of ``simulation`` (``seed=4``) or whole sections (``name="night"``).

    Raises:
        ScenarioError: the scenario is not valid; a line per problem says what is wrong, where it
            is written, and what is expected.
    """
    folder = Path.cwd()
    if isinstance(source, str) and "=" in source and not _is_path(source):
        # An override may stand in place of the scenario, as on the command line.
        overrides = (source, *overrides)
        source = None
    if isinstance(source, Scenario):
        if not overrides and not settings:
            return source
        folder = source.folder
        source = source.resolved()
    elif isinstance(source, str | Path) and not str(source).startswith("bundled:"):
        folder = Path(source).absolute().parent
    changes = {_key(name): value for name, value in settings.items()}
    document = compose(source, overrides, changes)
    return scenario_of(document, folder)


def scenario_of(document: Document, folder: Path) -> Scenario:
    """Check a composed scenario as a whole, and return it.

    Args:
        document: The result of `compose`.
        folder: The folder of the file that it was read from.

    Raises:
        ScenarioError: as `load_scenario`.
    """
    try:
        scenario = Scenario.model_validate(document.data, context={})
    except ValidationError as error:
        raise explain(error, document) from None
    scenario.set_origin(folder, document)
    return scenario


def _is_path(text: str) -> bool:
    """Return whether a text names a file; an override may be too long for a file name."""
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
    for line in lines[:MAX_LINES]:
        # A list is also called too short when all of its entries are wrong.
        depth = len(line["loc"])
        others = (other for other in lines if other is not line)
        has_entries = any(other["loc"][:depth] == line["loc"] for other in others)
        if line["type"] == "too_short" and has_entries:
            continue
        location = _location_in(line, document.data)
        group = line.get("ctx", {}).get("group")
        if group and group in groups:
            continue
        groups.add(group or "")
        line["msg"] += _type_with_key(line, location, document.data)
        path = ".".join(map(str, location))
        key = (document.place(location), one_line(path, 200))
        problems.setdefault(key, []).append(line)
    texts = []
    for written_at, details in problems.items():
        parts = (*written_at, describe(*details))
        texts.append(": ".join(filter(None, parts)))
    if len(lines) >= MAX_LINES:
        texts.append("... and more: these are the first")
    return ScenarioError("\n".join(texts))


def describe(*lines: ErrorDetails) -> str:
    """Return one message about a value from the errors of all types that it may have."""
    texts: list[str] = []
    expected: list[str] = []
    choices: list[str] = []
    for line in lines:
        kind = line["type"]
        context = line.get("ctx", {})
        text = next((text for name, text in _EXPECTED.items() if kind.startswith(name)), None)
        if text is not None:
            limits = context.items()
            short = {k: f"{v:g}" if isinstance(v, float) else v for k, v in limits}
            expected.append(text.format(**short))
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
        hint = hint if hint.endswith("?") else _right_form(value, expected)
        alternatives = joint.join([*first, last])
        texts.insert(0, f"expected {alternatives}, got {_quote(value)}{hint}")
    return "; or ".join(dict.fromkeys(texts))


def _right_form(value: Any, expected: Sequence[str]) -> str:
    """Return advice on the right form of a value; empty if there is none."""
    if "text" in expected and isinstance(value, int | float | date):
        return ": put it in quotes, as it is written"
    if expected == ["a list"] and isinstance(value, str):
        return f": write [{value}]"
    is_names = isinstance(value, list) and value and all(isinstance(v, str) for v in value)
    if expected == ["a mapping of keys"] and is_names:
        return f": write {{{value[0]}: …}}"
    return ""


def _type_with_key(line: ErrorDetails, location: Location, data: Any) -> str:
    """Return which types have an unknown key of a component, with advice; empty if none has."""
    *parents, key = map(str, location or ("",))
    if line["type"] == "unknown_key" and not parents:
        entries = {name: data.get(name) for name in data if isinstance(data[name], Mapping)}
        sections = {**entries, "simulation": SimulationSettings.model_fields}
        fitting = (name for name, keys in sections.items() if key in keys and name != key)
        section = next(fitting, "")
        return f". Write {section}.{key}" if section else ""
    kind = kind_at(Scenario, parents)
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
    """Return a location without pydantic's additions: the member of a union, and '[key]'."""
    location = line["loc"]
    for depth, key in enumerate(location):
        try:
            data = data[key]
        except (LookupError, TypeError):
            is_missing = line["type"] == "missing" and depth == len(location) - 1
            return location[: depth + is_missing]
    return location
