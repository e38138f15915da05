"""The home on the page: its walls, from scenario and events, and the fronts of its furniture."""

import math

import pytest
import shapely
from tests.scenes import run, scenario

from fleet2d.errors import ScenarioError
from fleet2d.floorplan.placed_objects import PlacedObject, UsePlace
from fleet2d.viewing.home_facts import WallsHistory, front_of

SQUARE = shapely.box(0, 0, 1, 1)


def test_an_edited_door_of_a_manifest_is_refused():
    """`fleet2d view` ended in a traceback."""
    stored = run(scenario("1 min"))
    stored.manifest["scenario"]["objects"] = {"d": {"type": "door", "hinge": "left"}}
    with pytest.raises(ScenarioError, match=r"scenario\.objects\.d: "):
        WallsHistory(stored)


def test_given_front_is_the_front():
    desk = PlacedObject("desk", "desk", SQUARE, heading=1.0, uses=(UsePlace(0, 0, 2.0, "sit"),))

    assert 1.0 == front_of(desk)


def test_who_sits_on_a_piece_looks_to_its_front_and_who_stands_at_it_looks_at_it():
    stands = UsePlace(0, 0, 0.5)
    sofa = PlacedObject("sofa", "sofa", SQUARE, uses=(stands, UsePlace(0, 0, 2.0, "sit")))
    stove = PlacedObject("stove", "stove", SQUARE, uses=(stands,))

    assert 2.0 == front_of(sofa)
    assert 0.5 + math.pi == front_of(stove)


def test_piece_that_nobody_uses_has_its_front_along_the_x_axis():
    assert 0.0 == front_of(PlacedObject("rug", "rug", SQUARE))
