"""Objects numbered, described and moved."""

import math
from dataclasses import replace

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.placed_objects import (
    PlacedObject,
    UsePlace,
    describe_object,
    move_object,
    number_objects,
)

LATTICE = Lattice(0.05, (0.0, 0.0), 200, 200)
SOFA = PlacedObject(
    "sofa", "sofa", shapely.box(2, 2, 4, 3), uses=(UsePlace(3, 2.5, math.pi / 2, "sit"),)
)


def thing(name):
    return PlacedObject(name, "chair", shapely.box(0, 0, 0.5, 0.5))


def test_two_objects_of_one_name_are_refused():
    with pytest.raises(FloorPlanError, match="two objects are named 'a'"):
        number_objects([thing("a"), thing("a")])


@given(st.floats(-360, 360), st.floats(1, 9), st.floats(1, 9))
def test_moved_object_keeps_its_size_to_the_lattice(turn, x, y):
    sofa = move_object(SOFA, LATTICE, (x, y), turn)
    assert sofa.footprint.area == pytest.approx(2, abs=0.01)
    assert sofa.footprint.centroid.x == pytest.approx(x, abs=0.002)


def test_descriptions_of_different_objects_differ():
    (use,) = SOFA.uses
    others = [
        move_object(SOFA, LATTICE, (5, 5)),
        replace(SOFA, heading=1.5),
        replace(SOFA, blocks="sight"),
        replace(SOFA, uses=()),
        replace(SOFA, uses=(replace(use, approach=(3.0, 1.5)),)),
    ]
    assert all(describe_object(SOFA) != describe_object(other) for other in others)
