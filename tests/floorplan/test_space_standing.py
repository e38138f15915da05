"""Where a body can stand beside furniture, and how it gets onto it."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.strategies import quick

from fleet2d.floorplan.furniture import stand_furniture
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.placed_objects import UsePlace
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.space import (
    SLACK,
    grown_cells,
    nearest_standing,
    standing_cells,
    with_approaches,
)

BOX = shapely.box(0, 0, 6, 4)


@pytest.fixture(scope="module")
def plan():
    return FloorPlan.build("box", BOX)


corner = st.tuples(st.integers(10, 50), st.integers(10, 30))


@quick
@given(st.lists(corner, min_size=3, max_size=6), st.sampled_from([0.0, 0.2, 0.25]))
def test_grown_cells_are_those_nearer_than_the_radius(corners, radius):
    footprint = shapely.Polygon(np.array(corners) / 10)
    if not footprint.is_valid or footprint.area < 0.01:
        return
    plan = FloorPlan.build("box", BOX)
    window, covered = grown_cells(plan.lattice, footprint, radius)
    grown = np.zeros_like(plan.free)
    grown[window] = covered
    xs, ys = plan.lattice.centre_axes()
    x, y = np.meshgrid(xs, ys)
    centres = plan.lattice.to_metres(np.stack([x, y], -1))
    away = shapely.distance(shapely.points(centres), footprint)

    # An octagon round the body, and half a cell: at most so much more than the radius.
    most = (radius + 0.025 + SLACK / 1280) / math.cos(math.pi / 8) + 0.002
    assert grown[away < radius + 0.025].all()
    assert not grown[away > most].any()


@quick
@given(
    st.tuples(st.integers(-20, 130), st.integers(-20, 90)),
    st.tuples(st.integers(1, 60), st.integers(1, 60)),
    st.sampled_from([0.0, 0.2, 0.25]),
)
def test_cells_around_a_rectangle_are_those_around_the_same_outline_with_another_corner(
    low, size, radius
):
    """A fifth corner on a side keeps it from the quick way for rectangles."""
    lattice = FloorPlan.build("box", BOX).lattice
    x0, y0 = np.array(low) / 20
    x1, y1 = np.array([low, size]).sum(axis=0) / 20
    rectangle = shapely.box(x0, y0, x1, y1)
    same = shapely.Polygon([(x0, y0), ((x0 + x1) / 2, y0), (x1, y0), (x1, y1), (x0, y1)])

    quick_window, quickly = grown_cells(lattice, rectangle, radius)
    window, covered = grown_cells(lattice, same, radius)

    assert quick_window == window
    assert np.array_equal(quickly, covered)


def test_standing_cells_are_in_the_space_among_the_furniture(plan):
    things = [
        stand_furniture("table", (3.0, 2.0), 512, name="table"),
        stand_furniture("rug", (1.0, 1.0), name="rug"),
    ]
    full = FloorPlan.build("box", BOX, objects=things)
    cells = standing_cells(full, 0.25)

    assert not (cells & ~(Home(full).space(0.25).part_of_cell >= 0)).any()
    assert cells.sum() < standing_cells(full, 0.25, []).sum()
    assert (standing_cells(full, 0.25, things[1:]) == standing_cells(full, 0.25, [])).all()


def test_bed_at_a_wall_is_used_from_its_free_side(plan):
    bed = stand_furniture("bed", (1.0, 3.2), 0, (1.6, 2.0))
    reachable = with_approaches(plan, bed, standing_cells(plan, 0.25, [bed]))

    assert ["lie", "lie", "stand"] == [use.posture for use in reachable.uses]
    for use in reachable.uses:
        assert use.approach is not None
        x, y = use.approach
        assert (y < 2.2) or (x > 2.2)
    assert (reachable.uses[-1].x, reachable.uses[-1].y) == reachable.uses[-1].approach


def test_nobody_gets_on_a_sofa_through_a_wall():
    two = shapely.union_all([shapely.box(0, 0, 2, 1), shapely.box(0, 1.1, 4, 4)])
    plan = FloorPlan.build("two", two)
    sofa = stand_furniture("sofa", (1.0, 0.5), size=(1.9, 0.9))

    assert () == with_approaches(plan, sofa, standing_cells(plan, 0.25, [sofa])).uses


def test_place_inside_a_wall_has_no_approach(plan):
    use = UsePlace(-0.3, 1.0, 0.0, "sit")

    assert nearest_standing(plan, use, standing_cells(plan, 0.2), 1.0) is None
