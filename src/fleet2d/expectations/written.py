"""Expectations as a scenario writes them: as text, or as a mapping of what and when."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.errors import InputError
from fleet2d.expectations import vocabulary
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.text import parse_expectation
from fleet2d.expectations.verdict import check_judged
from fleet2d.problems import did_you_mean, problem, problem_at

WHEN = ("always", "never", "eventually", "at_end", "at_most")
KEYS = (*WHEN, "until", "after", "within", "holds_for", "during", "of", "per")


def read_written(value: Any) -> Expectation:
    """Read an expectation of a scenario: text, or a mapping of `KEYS` to parts of it.

    Raises:
        PydanticCustomError: It can't be read, or doesn't say when.

    Example:
        >>> print(read_written({"eventually": "seen(ana, by=astro)", "within": "2 min"}))
        eventually(seen("ana", by="astro"), within="2 min")
        >>> print(read_written({"never": "moving(astro)", "during": "22:00-07:00"}))
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
        f"found {value!r}; an expectation is wanted, like always(distance(ana, astro) > 0.5 m)"
    )


def _read_mapping(value: Mapping[str, Any]) -> Expectation:
    for key in value:
        if key not in KEYS:
            near = did_you_mean(key, KEYS)
            raise problem_at((key,), f"unknown key {key!r}{near} Allowed here: {', '.join(KEYS)}")
    when = [key for key in WHEN if key in value]
    if len(when) != 1:
        raise InputError(f"one of {', '.join(WHEN)} is wanted, found {', '.join(when) or 'none'}")
    if when == ["at_most"]:
        return _at_most(value)
    _refuse(value, when[0], "of", "per")
    if when == ["at_end"]:
        _refuse(value, when[0], "within", "until")
    if when == ["eventually"] and "after" in value:
        _refuse(value, when[0], "until")
        part = _narrowed(value, "eventually")
        return vocabulary.after(_part(value, "after"), part, within=value.get("within"))
    whole = _when(value, when[0])
    return vocabulary.after(_part(value, "after"), whole) if "after" in value else whole


def _when(value: Mapping[str, Any], word: str) -> Expectation:
    """Return what a word says of its part, for the time that the mapping gives."""
    part, within = _narrowed(value, word), value.get("within")
    if word == "at_end":
        return vocabulary.at_end(part)
    if "until" in value:
        if word != "always":
            raise problem_at(("until",), f"until goes with always, not with {word}")
        return vocabulary.until(part, _part(value, "until"), within=within)
    whole: Expectation = getattr(vocabulary, word)(part, within=within)
    return whole


def _narrowed(value: Mapping[str, Any], word: str) -> Expectation:
    """Return the part that a word is about, as long and at such hours as the mapping says."""
    part = _part(value, word)
    if "holds_for" in value:
        part = vocabulary.holds_for(part, value["holds_for"])
    if "during" not in value:
        return part
    hours = vocabulary.during(str(value["during"]))
    return (~hours | part) if word == "always" else (hours & part)


def _at_most(value: Mapping[str, Any]) -> Expectation:
    _refuse(value, "at_most", "until", "after", "within", "during")
    if "of" not in value:
        raise InputError("at_most: say of what, such as of: events(find_begins, astro)")
    part = _part(value, "of")
    if "holds_for" in value:
        part = vocabulary.holds_for(part, value["holds_for"])
    return vocabulary.at_most(value["at_most"], part, per=value.get("per"))


def _part(value: Mapping[str, Any], key: str) -> Expectation:
    text = value[key]
    if isinstance(text, Expectation):
        return text
    if not isinstance(text, str):
        raise problem_at((key,), f"found {text!r}; text is wanted, like moving(astro)")
    try:
        return parse_expectation(text)
    except InputError as error:
        raise problem_at((key,), str(error)) from None


def _refuse(value: Mapping[str, Any], word: str, *keys: str) -> None:
    for key in keys:
        if key in value:
            raise problem_at((key,), f"{key!r} doesn't go with {word}")


Written = Annotated[
    Any,
    BeforeValidator(read_written),
    PlainSerializer(str, return_type=str, when_used="json"),
    WithJsonSchema(
        {
            "description": "an expectation: text such as always(distance(ana, astro) > 0.5 m), or"
            " the same as a mapping",
            "anyOf": [
                {"type": "string"},
                {
                    "type": "object",
                    "properties": {key: {} for key in KEYS},
                    "additionalProperties": False,
                },
            ],
            "examples": ["always(distance(ana, astro) > 0.5 m)"],
        }
    ),
]
"""An expectation of a scenario; an `Expectation` in Python."""
