"""Conditions on lives: a value, one of a list, or a range like 3..15."""

import math
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator

from fleet2d.configuration.problems import problem

ENDS = ("-inf", "inf")


class Range(NamedTuple):
    """Numbers from `low` to `high`."""

    low: float
    high: float

    def __str__(self) -> str:
        """Return the range as conditions write it."""
        low, high = (f"{end:g}" if math.isfinite(end) else "" for end in self)
        return f"{low}..{high}"


def read_condition(value: Any) -> Any:
    """Read `3..15` as a range; numbers, texts and lists stay what they are."""
    if isinstance(value, list | tuple) and not isinstance(value, Range):
        return tuple(value)
    if not isinstance(value, str) or ".." not in value:
        return value
    try:
        low, high = (float(text or end) for text, end in zip(value.split(".."), ENDS, strict=True))
    except ValueError:
        raise problem(f"expected a range like 3..15, 3.. or ..15, got {value!r}") from None
    if not low <= high:
        raise problem(f"the range {value} is empty: the smaller number comes first")
    return Range(low, high)


Condition = Annotated[Any, BeforeValidator(read_condition)]
"""A value that a feature must have, one of a list, or a range like 3..15."""


def fulfils(value: Any, condition: Any) -> bool:
    """Return whether a value meets a condition.

    >>> fulfils(4, Range(3, 15)), fulfils("north", ("north", "west")), fulfils(None, 3)
    (True, True, False)
    """
    if isinstance(condition, Range):
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return is_number and condition.low <= value <= condition.high
    if isinstance(condition, tuple):
        return any(fulfils(value, each) for each in condition)
    return bool(value == condition)


def condition_words(condition: Any) -> str:
    """Return a condition in words."""
    if isinstance(condition, tuple) and not isinstance(condition, Range):
        return " or ".join(map(str, condition))
    return str(condition)
