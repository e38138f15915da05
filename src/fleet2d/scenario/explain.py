"""Say in plain words what is wrong with a scenario: where, what was found, what is wanted."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from fleet2d.errors import ScenarioError
from fleet2d.problems import Location, shown
from fleet2d.scenario.document import Document

_WANTED = {
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
    "datetime": "a date and time, like 2026-01-05 or 2026-01-05T08:00,",
    "date": "a date, like 2026-01-05,",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "greater_than_equal": "{ge} or more",
    "greater_than": "more than {gt}",
    "less_than_equal": "{le} or less",
    "less_than": "less than {lt}",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
}
"""What is wanted, by the beginning of pydantic's name for the error; the first that fits."""


def explain(error: ValidationError, document: Document) -> ScenarioError:
    """Turn a validation error into one line per key: where it is written, its path, what is wrong.

    >>> from fleet2d.scenario.model import SimulationSettings
    >>> document = Document({"duration": "1 h", "seed": "x"}, {("seed",): "home.yaml:3"})
    >>> try:
    ...     SimulationSettings.model_validate(document.data)
    ... except ValidationError as error:
    ...     print(explain(error, document))
    home.yaml:3: seed: found 'x'; a whole number is wanted
    """
    problems: dict[tuple[str, str], list[str]] = {}
    for line in error.errors(include_url=False):
        location = _written_location(line, document.data)
        key = (document.place(location), ".".join(map(str, location)))
        text = describe(line)
        if text not in problems.setdefault(key, []):  # the arms of a union often agree
            problems[key].append(text)
    return ScenarioError(
        "\n".join(
            ": ".join(part for part in (*where, "; or ".join(texts)) if part)
            for where, texts in problems.items()
        )
    )


def describe(line: ErrorDetails) -> str:
    """Say what is wrong with one value."""
    kind, context = line["type"], line.get("ctx", {})
    if kind == "missing":
        return "missing, and has no default"
    if kind in ("value_error", "assertion_error"):
        return str(context["error"])
    wanted = next((text for name, text in _WANTED.items() if kind.startswith(name)), None)
    if wanted is None:
        return line["msg"]
    limits = {k: f"{v:g}" if isinstance(v, float) else v for k, v in context.items()}
    return f"found {_found(line['input'])}; {wanted.format(**limits)} is wanted"


def _found(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        return f"a mapping of {', '.join(map(str, value))}" if value else "an empty mapping"
    text = shown(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _written_location(line: ErrorDetails, data: Any) -> Location:
    """Cut a location to what is in the data: pydantic adds the arm of a union, and '[key]'."""
    location = line["loc"]
    for depth, key in enumerate(location):
        try:
            data = data[key]
        except (LookupError, TypeError):
            missing = line["type"] == "missing" and depth == len(location) - 1
            return location[: depth + missing]
    return location
