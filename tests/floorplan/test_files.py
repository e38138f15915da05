"""Fields of floor plan files: each error names its place, the value and what is expected."""

from typing import Literal

import pytest
from pydantic import BaseModel, TypeAdapter

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.files import (
    MAX_COORDINATE_M,
    Coordinate,
    FileModel,
    Listed,
    Point,
    Ring,
    Text,
    validate,
)


class Shelf(FileModel):
    name: Text
    level: Literal["low", "high"] = "low"
    wide: bool = False
    at: Point | None = None
    heading: Coordinate = 0.0
    corners: Listed[Ring] | None = None


SHELF = TypeAdapter(Shelf)
SQUARE = [[0, 0], [1, 0], [1, 1]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": ""}, 'name is "": a text is expected'),
        ({"nme": 1}, "the plan has an unknown key 'nme': did you mean 'name'? Known: name, level,"),
        ({"level": "top"}, 'level is "top": one of low, high is expected'),
        ({"wide": 1}, "wide is 1: true or false is expected"),
        ({"at": [1]}, "at is [1]: a list of 2 numbers [m] is expected"),
        ({"at": [1, True]}, "at is [1, true]: true is not a number"),
        ({"at": [1, float("nan")]}, "at is [1, NaN]: coordinates must be finite numbers"),
        ({"at": [1, 2 * MAX_COORDINATE_M]}, "too far out for coordinates in metres"),
        ({"heading": None}, "heading is [null]: null is not a number"),
        ({"corners": {}}, "corners is {}: a list is expected"),
        ({"corners": [7]}, "corners[0] is 7: a list of points [x, y] is expected"),
        ({"corners": [SQUARE, [[0, 0], "x"]]}, 'corners[1][1] is "x": a list of 2 numbers'),
        ({"corners": [[*SQUARE[:2], *SQUARE[:2]]]}, "corners[0] has 2 different points"),
    ],
)
def test_wrong_value_is_refused_with_its_place(change, message):
    with pytest.raises(FloorPlanError) as caught:
        validate(SHELF, {"name": "shelf", **change})

    assert message in str(caught.value)


def test_missing_key_and_what_is_no_object_are_refused():
    with pytest.raises(FloorPlanError, match=r"^shelves\[2\] has no key 'name'$"):
        validate(SHELF, {}, "shelves[2]")
    with pytest.raises(FloorPlanError, match="is not an object with the keys name, level"):
        validate(SHELF, [])


class House(BaseModel):
    """An object that may have other keys, too."""

    walls: dict[str, Shelf]
    name: Text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"walls": {}, "other": 1}, "the plan has no key 'name'"),
        ({"walls": {"east": {}}, "name": "home"}, "walls.east has no key 'name'"),
        ([], "the plan is []: an object is expected"),
    ],
)
def test_missing_key_is_refused_beside_unknown_ones(content, message):
    with pytest.raises(FloorPlanError) as caught:
        validate(TypeAdapter(House), content)

    assert message == str(caught.value)


def test_only_the_first_wrong_item_of_a_long_list_is_an_error():
    with pytest.raises(FloorPlanError, match=r"^path\[1\] is \[0\]"):
        validate(TypeAdapter(Listed[Point]), [[0, 0], *[[0]] * 100_000], "path")


def test_ring_has_no_repeated_corners_and_no_tiny_coordinates():
    ring = [[0, 1e-300], [0, 0], [1, 0], [1, 0], [1, 1], [0, 0]]

    assert [(0, 0), (1, 0), (1, 1)] == validate(TypeAdapter(Ring), ring)
