"""Fields of a scenario that hold expectations: text, or a mapping from operators to conditions."""

from collections.abc import Mapping
from typing import Any

from fleet2d.configuration.problems import did_you_mean, problem, problem_at
from fleet2d.errors import InputError
from fleet2d.expectations import vocabulary
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.parse import parse_expectation
from fleet2d.expectations.verdict import check_judged

OPERATORS = ("always", "never", "eventually", "at_end", "at_most")
KEYS = (*OPERATORS, "until", "after", "within", "holds_for", "during", "of", "per")


def read_expectation(value: Any) -> Expectation:
    """Read an expectation of a scenario: text, or a mapping of `KEYS` to its parts.

    Raises:
        PydanticCustomError: It can't be read, or doesn't say when it must hold.

    Example:
        >>> print(read_expectation({"eventually": "seen(ana, by=astro)", "within": "2 min"}))
        eventually(seen("ana", by="astro"), within="2 min")
        >>> print(read_expectation({"never": "moving(astro)", "during": "22:00-07:00"}))
        never(during("22:00-07:00") and moving("astro"))
    """
    if isinstance(value, Expectation):
        return value
    try:
        if isinstance(value, str):
            return check_judged(parse_expectation(value))
        if isinstance(value, Mapping) and value:
            return check_judged(_read_mapping(value))
    except InputError as error:
        raise problem(str(error)) from None
    raise problem(
        f"expected an expectation like always(distance(ana, astro) > 0.5 m), got {value!r}"
    )


def _read_mapping(value: Mapping[str, Any]) -> Expectation:
    for key in value:
        if key not in KEYS:
            near = did_you_mean(key, KEYS)
            raise problem_at((key,), f"unknown key {key!r}{near} Allowed here: {', '.join(KEYS)}")
    operators = [key for key in OPERATORS if key in value]
    if len(operators) != 1:
        raise InputError(
            f"expected exactly one of {', '.join(OPERATORS)}, got {', '.join(operators) or 'none'}"
        )
    operator = operators[0]
    if operator == "at_most":
        return _at_most(value)
    _refuse(value, operator, "of", "per")
    if operator == "at_end":
        _refuse(value, operator, "within", "until")
    if operator == "eventually" and "after" in value:
        _refuse(value, operator, "until")
        part = _condition(value, operator)
        return vocabulary.after(_part(value, "after"), part, within=value.get("within"))
    whole = _whole(value, operator)
    return vocabulary.after(_part(value, "after"), whole) if "after" in value else whole


def _whole(value: Mapping[str, Any], operator: str) -> Expectation:
    """Apply an operator to its condition, with the time limits of the mapping."""
    part, within = _condition(value, operator), value.get("within")
    if operator == "at_end":
        return vocabulary.at_end(part)
    if "until" in value:
        if operator != "always":
            raise problem_at(
                ("until",), f"'until' can only be combined with 'always', not with {operator!r}"
            )
        return vocabulary.until(part, _part(value, "until"), within=within)
    return getattr(vocabulary, operator)(part, within=within)


def _condition(value: Mapping[str, Any], operator: str) -> Expectation:
    """Return the condition of an operator, with `holds_for` and `during` applied."""
    part = _part(value, operator)
    if "holds_for" in value:
        part = vocabulary.holds_for(part, value["holds_for"])
    if "during" not in value:
        return part
    hours = vocabulary.during(str(value["during"]))
    return (~hours | part) if operator == "always" else (hours & part)


def _at_most(value: Mapping[str, Any]) -> Expectation:
    _refuse(value, "at_most", "until", "after", "within", "during")
    if "of" not in value:
        raise InputError("at_most needs the key 'of', such as of: events(find_begins, astro)")
    part = _part(value, "of")
    if "holds_for" in value:
        part = vocabulary.holds_for(part, value["holds_for"])
    return vocabulary.at_most(value["at_most"], part, per=value.get("per"))


def _part(value: Mapping[str, Any], key: str) -> Expectation:
    text = value[key]
    if isinstance(text, Expectation):
        return text
    if not isinstance(text, str):
        raise problem_at((key,), f"expected text like moving(astro), got {text!r}")
    try:
        return parse_expectation(text)
    except InputError as error:
        raise problem_at((key,), str(error)) from None


def _refuse(value: Mapping[str, Any], operator: str, *keys: str) -> None:
    for key in keys:
        if key in value:
            raise problem_at((key,), f"{key!r} can't be combined with {operator}")


JSON_SCHEMA: dict[str, Any] = {
    "description": "an expectation: text such as always(distance(ana, astro) > 0.5 m), or the same"
    " as a mapping",
    "anyOf": [
        {"type": "string"},
        {"type": "object", "properties": {key: {} for key in KEYS}, "additionalProperties": False},
    ],
    "examples": ["always(distance(ana, astro) > 0.5 m)"],
}
"""What `read_expectation` reads."""
