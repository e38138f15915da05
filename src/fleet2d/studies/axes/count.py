"""Counts in a study file: how many values an axis has, and how many replicates there are."""

from typing import Annotated, TypeVar

from pydantic import AfterValidator

from fleet2d.bounds import VARIANTS
from fleet2d.problems import problem

Number = TypeVar("Number", int, float)


def check_count(count: Number) -> Number:
    """Return a count, unless so many values are too many for one study.

    Raises:
        PydanticCustomError: They are.
    """
    if count > VARIANTS.most:
        raise problem(
            f"more than {VARIANTS.most:,} values are too many for one study; to allow more, set"
            f" {VARIANTS.variable} in the environment"
        )
    return count


Count = Annotated[int, AfterValidator(check_count)]
"""A number of values that fits into one study."""
