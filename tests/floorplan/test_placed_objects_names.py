"""Names of rooms and objects: numbered, made distinct, looked up."""

from types import SimpleNamespace

import pytest

from fleet2d.errors import FloorPlanError, PlacementError
from fleet2d.floorplan.placed_objects import distinct_names, find_named, number_names

THINGS = [SimpleNamespace(name=name) for name in ("kitchen_1", "bedroom_1")]


def test_numbers_skip_own_names_and_count_by_type():
    names = number_names([None, "bed_2", "", None], ["bed", "sofa", "bed", "sofa"], "object")

    assert ["bed_1", "bed_2", "bed_3", "sofa_1"] == names


def test_two_of_one_name_are_refused():
    with pytest.raises(FloorPlanError, match="two rooms are named 'den': give each room its own"):
        number_names(["den", "den"], ["office", "office"], "room")


def test_repeated_names_get_the_next_free_number_with_a_note():
    notes = []

    names = distinct_names(["Bath", "Bath", "Bath 2", None, "Bath", None], "rooms", notes)

    assert ["Bath", "Bath 3", "Bath 2", None, "Bath 4", None] == names
    assert "several rooms are called Bath: one of them is Bath 3 here" == notes[0]


def test_thing_is_found_by_name_or_refused_with_the_nearest():
    assert THINGS[1] is find_named(THINGS, "bedroom_1", "flat", "room")
    with pytest.raises(PlacementError) as caught:
        find_named(THINGS, "kitchen", "flat", "room", PlacementError)

    assert str(caught.value) == (
        "flat has no room 'kitchen': did you mean 'kitchen_1'? Its rooms are: kitchen_1, bedroom_1"
    )
