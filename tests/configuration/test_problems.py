"""Errors keep their type, place and words when they are rewrite."""

from datetime import date, datetime
from decimal import Decimal
from enum import Enum
from typing import Annotated, Literal

import pytest
from pydantic import AfterValidator, BaseModel, Field, ValidationError
from pydantic_core import PydanticCustomError

from fleet2d.configuration.problems import did_you_mean, problem_at, rewrite, suggest


class Side(Enum):
    """Two values."""

    LEFT = "left"
    RIGHT = "right"


def _refuse(_):
    raise ValueError("never good enough")


def _refuse_specially(_):
    raise PydanticCustomError("special", "{what} {{x}}", {"what": "it is {what}"})


class Everything(BaseModel):
    """One field per sort of error."""

    whole: int
    real: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    limited: Annotated[Decimal, Field(max_digits=3)]
    word: Annotated[str, Field(pattern="^a")]
    side: Side
    choice: Literal["a", "b"]
    day: date
    moment: datetime
    pair: tuple[int, int]
    several: Annotated[list[int], Field(min_length=2)]
    mapping: dict[str, int]
    nested: "Everything | None"
    judged: Annotated[int, AfterValidator(_refuse)]
    special: Annotated[int, AfterValidator(_refuse_specially)]


@pytest.mark.parametrize("value", ["x", -1, [1], None, {"a": "b"}, float("nan"), b"\xff", True])
def test_rewritten_error_says_the_same(value):
    with pytest.raises(ValidationError) as caught:
        Everything.model_validate(dict.fromkeys(Everything.model_fields, value))
    again = rewrite(caught.value, lambda line: line)

    assert [(e["type"], e["loc"], e["msg"]) for e in caught.value.errors()] == [
        (e["type"], e["loc"], e["msg"]) for e in again.errors()
    ]


def test_rewriting_moves_an_error():
    error = rewrite(problem_at(("a", "b"), "no {b}"), lambda line: {**line, "loc": ("c",)})

    assert [(("c",), "no {b}")] == [(e["loc"], e["msg"]) for e in error.errors()]


def test_nothing_near_is_not_guessed():
    assert "." == did_you_mean("xyz", ["speed"])


@pytest.mark.parametrize(
    ("name", "known", "text"),
    [
        ("sped", ["speed", "radius"], ": did you mean 'speed'? It has: speed, radius"),
        ("color", ["speed", "radius"], ". It has: speed, radius"),
        (7, [70, 80], ": did you mean '70'? It has: 70, 80"),
        ("speed", [], ". It has: none"),
    ],
)
def test_suggestion_ends_in_all_known_names(name, known, text):
    assert text == suggest(name, known, "It has")
