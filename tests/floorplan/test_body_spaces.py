"""Spaces of bodies among furniture: what cuts one in two, and whether a home stays whole."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely import MultiPolygon
from tests.strategies import quick

from fleet2d.floorplan.body_spaces import (
    CUT_OFF_M2,
    RADII,
    THIN_RADIUS,
    BodySpace,
    cuts_nothing,
    exact_space,
    large_parts,
    obstacles_among,
    solid_footprints,
    stays_whole,
)
from fleet2d.floorplan.furniture import stand_furniture
from fleet2d.floorplan.home import lattice_footprint
from fleet2d.floorplan.mesh import GRID
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.space import BODY_RADIUS, grow_boxes, grow_polygons, shrink

box_of_floor = st.tuples(
    st.integers(0, 40), st.integers(0, 30), st.integers(2, 20), st.integers(2, 20)
)


def one_room(kind):
    box = shapely.box(0, 0, 5, 4)
    return FloorPlan.build("room", box, [LabelledRegion((kind,), box)])


def two_rooms():
    """Return two rooms with two passages, so that a way round may lead through the other room."""
    rooms = [shapely.box(0, 0, 2.4, 4), shapely.box(2.5, 0, 5, 4)]
    passages = [shapely.box(2.4, y, 2.5, y + 1) for y in (0.2, 2.7)]
    free = shapely.union_all([*rooms, *passages])
    return FloorPlan.build("rooms", free, [LabelledRegion(("bedroom",), room) for room in rooms])


def footprint(x, y, width, depth):
    """Return a rectangle [m] by its corner and size [0.1 m]."""
    return shapely.box(x / 10, y / 10, (x + width) / 10, (y + depth) / 10)


def boxes_of(footprints):
    return shapely.bounds(footprints).astype(np.int64).reshape(-1, 4)


def without(plan, parts, shape, kept):
    """Take a shape out of the whole space at once; empty if it cuts a part or a point off."""
    left = []
    for part in parts:
        pieces = shapely.get_parts(shapely.difference(part, shape)).tolist()
        if len(large_parts(plan, pieces)) > 1:
            return []
        left += sorted(pieces, key=shapely.area)[-1:]
    before, after = (shapely.contains_xy(MultiPolygon(each), *kept.T) for each in (parts, left))
    return [] if (before & ~after).any() else left


@quick
@given(st.lists(box_of_floor, max_size=8), st.sampled_from([BODY_RADIUS, THIN_RADIUS]))
def test_furniture_is_refused_where_it_cuts_the_whole_space(boxes, radius):
    plan = two_rooms()
    expected = exact_space(plan, [], radius)
    space = BodySpace(plan, radius, obstacles_among(plan, [], radius), expected)
    kept = plan.lattice.to_lattice([(1.2, 2.0), (4.0, 3.5)])
    for box in boxes:
        corners = plan.lattice.to_walls(np.reshape(footprint(*box).bounds, (2, 2)))
        (grown,) = grow_boxes(corners.reshape(1, 4), radius * plan.lattice.units_per_m + GRID)
        left = without(plan, expected, grown, kept)

        rest = space.without(corners.reshape(1, 4), kept)

        assert (rest is None) == (not left)
        expected = left or expected
        space = rest or space

    assert len(expected) == len(space.parts)
    differing = shapely.symmetric_difference(MultiPolygon(expected), MultiPolygon(space.parts))
    assert 1 > differing.area


@pytest.mark.parametrize("radius", RADII)
def test_boxes_grow_as_polygons_do(radius):
    boxes = np.array([[0, 0, 64, 640], [2, 4, 2, 4], [-640, 64, 1280, 66]])
    polygons = [shapely.box(*box) for box in boxes.tolist()]

    grown = grow_boxes(boxes, radius * 1280)

    solid = np.array(polygons, np.object_)[[0, 2]]
    assert shapely.equals(grown[[0, 2]], grow_polygons(solid.tolist(), radius * 1280)).all()
    assert 8 == len(set(grown[1].exterior.coords))


@quick
@given(st.lists(box_of_floor, max_size=6), st.sampled_from(RADII))
def test_furniture_that_cuts_nothing_leaves_every_part_of_a_space_whole(boxes, radius):
    plan = two_rooms()
    bed = stand_furniture("bed", (2.0, 2.0))
    things = [replace(bed, footprint=footprint(*box)) for box in boxes]
    solid = solid_footprints(plan, things)

    if cuts_nothing(plan, [], boxes_of(solid), radius):
        parts = exact_space(plan, solid, radius)
        inside = shapely.point_on_surface(parts)
        for before in exact_space(plan, [], radius):
            assert 1 >= shapely.contains(before, inside).sum()


@quick
@given(st.lists(box_of_floor, max_size=6))
def test_home_is_whole_only_if_no_body_has_a_second_large_space(boxes):
    plan = one_room("bedroom")
    unit = plan.lattice.units_per_m
    bed = stand_furniture("bed", (2.0, 2.0))
    things = [replace(bed, footprint=footprint(*box)) for box in boxes]
    solid = solid_footprints(plan, things)

    if stays_whole(plan, solid, RADII):
        for radius in RADII:
            blocked = grow_polygons(solid, radius * unit)
            spaces = shrink(plan.polygons, radius * unit, blocked)
            assert 1 >= sum(space.area > CUT_OFF_M2 * unit**2 for space in spaces)


def test_home_is_whole_unless_furniture_divides_it_or_a_wall_is_slanted():
    plan = one_room("bedroom")
    bed = replace(stand_furniture("bed", (2, 2)), footprint=shapely.box(2, 0, 2.5, 4))
    across = lattice_footprint(plan, bed)
    slanted = FloorPlan.build("tent", shapely.Polygon([(0, 0), (5, 0), (5, 4)]))

    for radius in RADII:
        assert cuts_nothing(plan, [], boxes_of([]), radius)
        assert not cuts_nothing(plan, [], boxes_of([across]), radius)
        assert cuts_nothing(plan, [across], boxes_of([across]), radius)
    assert stays_whole(plan, [], RADII)
    assert not stays_whole(plan, [across], RADII)
    assert not stays_whole(slanted, [], RADII)
