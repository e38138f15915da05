"""Validation errors in plain words."""

from typing import Any, Literal

import pytest
from pydantic import Field, ValidationError, model_validator

from fleet2d.component import Settings
from fleet2d.scenario.document import Document
from fleet2d.scenario.explain import describe, explain


class Inner(Settings):
    """A nested model."""

    size: int = Field(default=1, ge=1, le=9)


class Outer(Settings):
    """A model with the fields that scenarios have."""

    inner: Inner = Inner()
    mode: Literal["off", "on"] = "off"
    flag: bool = False
    name: str = ""
    either: int | list[int] = 0
    days: Literal["daily", "weekend"] | tuple[Literal["daily", "weekend"], ...] = "daily"
    span: tuple[float, float] = (0.0, 4.5)
    filled: tuple[int, ...] = Field(default=(1,), min_length=1)
    entries: dict[str, int] = Field(default={})

    @model_validator(mode="after")
    def _judge(self) -> "Outer":
        if self.name == "bad":
            raise ValueError("a bad name")
        return self


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"inner": {"size": "x"}}, "a.yaml:2: inner.size: found 'x'; a whole number is wanted"),
        ({"inner": {"size": 0}}, "a.yaml:2: inner.size: found 0; 1 or more is wanted"),
        ({"inner": {"size": 10}}, "a.yaml:2: inner.size: found 10; 9 or less is wanted"),
        ({"inner": 3}, "a.yaml:2: inner: found 3; a mapping of keys is wanted"),
        ({"inner": None}, "a.yaml:2: inner: found nothing; a mapping of keys is wanted"),
        ({"mode": "of"}, "a.yaml:1: mode: found 'of': did you mean 'off'? 'off' or 'on' is wanted"),
        ({"flag": "maybe"}, "a.yaml:1: flag: found 'maybe'; true or false is wanted"),
        ({"name": {"a": 1}}, "a.yaml:1: name: found a mapping of a; text is wanted"),
        ({"name": ["x" * 90]}, f"a.yaml:1: name: found ['{'x' * 55}...; text is wanted"),
        ({"name": "bad"}, "a.yaml:1: a bad name"),
        ({"either": "x"}, "a.yaml:1: either: found 'x'; a whole number or a list is wanted"),
        ({"days": "week-end"}, "a.yaml:1: days: found 'week-end': did you mean 'weekend'? 'daily' "
                               "or 'weekend' or a list is wanted"),
        ({"filled": ["x"]}, "a.yaml:1: filled.0: found 'x'; a whole number is wanted"),
        ({"filled": []}, "a.yaml:1: filled: found []; a list of at least 1 is wanted"),
        ({"days": 3}, "a.yaml:1: days: found 3; 'daily' or 'weekend' or a list is wanted"),
        ({"span": 4.5}, "a.yaml:1: span: found 4.5; a list is wanted, like [0, 4.5]"),
        ({"span": [1, 2, 3]}, "a.yaml:1: span: found [1, 2, 3]; a list is wanted, like [0, 4.5]"),
        ({"span": [1]}, "a.yaml:1: span: found [1]; a list is wanted, like [0, 4.5]"),
        ({"span": [1, "x"]}, "a.yaml:1: span.1: found 'x'; a number is wanted"),
        ({"entries": {"a": "x"}}, "a.yaml:1: entries.a: found 'x'; a whole number is wanted"),
        ({"inner": {"sise": 1}}, "a.yaml:2: inner.sise: unknown key 'sise': did you mean 'size'? "
                                 "Allowed here: size"),
    ],
)  # fmt: skip
def test_error_says_where_and_what(data: dict[str, Any], said: str) -> None:
    document = Document(data, {(): "a.yaml:1", ("inner",): "a.yaml:2"})

    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(data)
    assert said == str(explain(caught.value, document))


def test_unlisted_error_is_told_in_pydantics_words() -> None:
    assert "Odd" == describe({"type": "odd", "loc": (), "msg": "Odd", "input": 3})
