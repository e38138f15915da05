"""The short form of users and robots: read like the long one, errors name the keys as written."""

from typing import Annotated

import pytest
from pydantic import TypeAdapter
from tests.test_component import errors, gadgets

from fleet2d.configuration.components import Component, OneOf, Settings, ShortForm, split_short_form
from fleet2d.configuration.units import Length

__all__ = ["gadgets"]  # a fixture


class Body(Settings):
    """What an entity looks like to the short form."""

    radius: Length = 0.2
    behaviors: tuple[Annotated[Component, OneOf("gadget")], ...] = ()


SHORT = Annotated[Body, ShortForm()]


@pytest.mark.parametrize(
    ("written", "split"),
    [
        ({"type": "lamp", "radius": 1, "watts": 2},
         {"radius": 1, "behaviors": [{"type": "lamp", "watts": 2}]}),
        ("lamp", {"behaviors": ["lamp"]}),
        ({"radius": 1}, {"radius": 1}),
        ({"behaviors": ["lamp"]}, {"behaviors": ["lamp"]}),
        (3, 3),
    ],
)  # fmt: skip
def test_split_short_form(written: object, split: object) -> None:
    assert split == split_short_form(written, ["radius"])


def test_short_form_equals_long_form() -> None:
    adapter: TypeAdapter[Body] = TypeAdapter(SHORT)

    assert adapter.validate_python(
        {"radius": 1, "behaviors": [{"type": "lamp", "watts": 2}]}
    ) == adapter.validate_python({"type": "lamp", "radius": 1, "watts": 2})


def test_short_form_errors_name_keys_as_written() -> None:
    assert errors(SHORT, {"type": "lamp", "radius": "x", "watts": 0, "radiu": 1}) == {
        "radius": "expected a length, got 'x': write a number in m, or like '0.2 m', '20 cm', '5 mm'",
        "watts": "Input should be greater than 0",
        "radiu": "unknown key 'radiu': did you mean 'radius'? "
        "Allowed here: cell, radius, warm_up, watts",
    }
    assert ["type"] == list(errors(SHORT, {"type": "lmap"}))


def test_short_form_beside_behaviors_is_refused() -> None:
    assert errors(SHORT, {"type": "lamp", "behaviors": []}) == {
        "behaviors": "give 'type' (one behavior) or 'behaviors', not both"
    }
