"""Validation errors in plain words."""

from datetime import timedelta
from pathlib import Path
from typing import Literal

import pytest
from pydantic import Field, ValidationError, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import Document
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.scenario.load import describe, explain


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
    plain: timedelta = timedelta(0)

    @model_validator(mode="after")
    def _judge(self):
        if self.name == "bad":
            raise ValueError("a bad name")
        return self


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"inner": {"size": "x"}}, "a.yaml:2: inner.size: expected a whole number, got 'x'"),
        ({"inner": {"size": 0}}, "a.yaml:2: inner.size: expected 1 or more, got 0"),
        ({"inner": {"size": 10}}, "a.yaml:2: inner.size: expected 9 or less, got 10"),
        ({"inner": 3}, "a.yaml:2: inner: expected a mapping of keys, got 3"),
        ({"inner": None}, "a.yaml:2: inner: expected a mapping of keys, got nothing"),
        ({"mode": "of"}, "a.yaml:1: mode: expected 'off' or 'on', got 'of': did you mean 'off'?"),
        ({"flag": "maybe"}, "a.yaml:1: flag: expected true or false, got 'maybe'"),
        ({"name": {"a": 1}}, "a.yaml:1: name: expected text, got a mapping of a"),
        ({"name": ["x" * 90]}, f"a.yaml:1: name: expected text, got ['{'x' * 55}..."),
        ({"name": "bad"}, "a.yaml:1: a bad name"),
        ({"either": "x"}, "a.yaml:1: either: expected a whole number or a list, got 'x'"),
        ({"days": "week-end"}, "a.yaml:1: days: expected 'daily' or 'weekend' or a list, "
                               "got 'week-end': did you mean 'weekend'?"),
        ({"filled": ["x"]}, "a.yaml:1: filled.0: expected a whole number, got 'x'"),
        ({"days": 3}, "a.yaml:1: days: expected 'daily' or 'weekend' or a list, got 3"),
        ({"filled": []}, "a.yaml:1: filled: expected a list of length 1 or more, got []"),
        ({"span": 4.5}, "a.yaml:1: span: expected a list like [0, 4.5], got 4.5"),
        ({"span": [1, 2, 3]}, "a.yaml:1: span: expected a list like [0, 4.5], got [1, 2, 3]"),
        ({"span": [1]}, "a.yaml:1: span: expected a list like [0, 4.5], got [1]"),
        ({"span": [1, "x"]}, "a.yaml:1: span.1: expected a number, got 'x'"),
        ({"plain": "1 h"}, "a.yaml:1: plain: expected seconds, as the field is a timedelta; a field "
                           "of type Duration reads 5 min, too, got '1 h'"),
        ({"entries": {"a": "x"}}, "a.yaml:1: entries.a: expected a whole number, got 'x'"),
        ({"inner": {"sise": 1}}, "a.yaml:2: inner.sise: unknown key 'sise': did you mean 'size'? "
                                 "Allowed here: size"),
    ],
)  # fmt: skip
def test_error_says_where_and_what(data, said):
    document = Document(data, {(): "a.yaml:1", ("inner",): "a.yaml:2"})

    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(data)
    assert said == str(explain(caught.value, document))


def test_unlisted_error_is_told_in_pydantics_words():
    assert "Odd" == describe({"type": "odd", "loc": (), "msg": "Odd", "input": 3})


@pytest.mark.parametrize(
    ("override", "said"),
    [
        (
            "robots.bo.type=scheduled",
            "low.yaml:4, changed by override 'robots.bo.type=scheduled': robots.bo.visits: missing",
        ),
        (
            "simulation.duration.dys=1",
            "low.yaml:1, changed by override 'simulation.duration.dys=1'",
        ),
        ("robots.bo.speed=fast", "override 'robots.bo.speed=fast': robots.bo.speed: expected a sp"),
        ("robots.bo.rooms=[attic]", "low.yaml:4, changed by override 'robots.bo.rooms=[attic]'"),
    ],
)
def test_what_an_override_broke_is_not_blamed_on_the_file_alone(
    override, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("low.yaml").write_text(
        "simulation: {duration: {days: 1}}\nfloorplan: bundled\n"
        "robots:\n  bo: {type: patrol, speed: 0.2}\n"
    )
    with pytest.raises(InputError) as caught:
        Simulation("low.yaml", override)
    assert str(caught.value).startswith(said)


def test_what_a_file_broke_in_the_one_that_it_extends_names_both(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("low.yaml").write_text(
        "simulation: {duration: {days: 1}}\nfloorplan: bundled\nalgorithms:\n"
        "  ltp: {type: long_term_presence}\n"
    )
    Path("high.yaml").write_text(
        "extends: low.yaml\nalgorithms:\n  ltp:\n    interval: 0.9\n    by: hour_of_week\n"
    )
    with pytest.raises(InputError) as caught:
        Simulation("high.yaml")
    assert str(caught.value).startswith("low.yaml:4, changed by high.yaml:4: algorithms.ltp:")
