"""Passages: where free space narrows, and opens out again."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, affinity
from tests.thorough import examples

from fleet2d.floorplan.mesh import build_mesh
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms import segmentation
from fleet2d.floorplan.rooms.segmentation import (
    MAX_DOOR_M,
    MIN_DOOR_M,
    WallDirections,
    find_passages,
)

UNITS = 1280.0


def on_lattice(free):
    """Return free space in metres, with corners on multiples of 5 cm, on the lattice."""
    polygon = shapely.orient_polygons(shapely.transform(free, lambda xy: np.rint(xy * 20) * 64))
    assert isinstance(polygon, Polygon)
    return polygon, build_mesh([polygon], 400, 400)


def passages(free, *, gaps_only=True):
    """Search free space in metres, with corners on multiples of 5 cm and all above zero."""
    polygon, mesh = on_lattice(free)
    directions = None if gaps_only else WallDirections.of([polygon], UNITS)
    return find_passages(mesh, [polygon], UNITS, directions)


def ends(passage):
    return {(x / UNITS, y / UNITS) for x, y in passage}


def width(passage):
    """The distance between the ends in metres."""
    (x0, y0), (x1, y1) = passage
    return math.hypot(x1 - x0, y1 - y0) / UNITS


def rooms(*boxes):
    free = shapely.union_all([shapely.box(*box) for box in boxes])
    assert isinstance(free, Polygon)
    return free


LEFT, RIGHT = (1.0, 1.0, 4.0, 4.0), (4.1, 1.0, 7.0, 4.0)


def test_gap_beside_a_wall_ends_at_the_foot_on_that_wall():
    """The outer wall runs on: there is no corner for the second jamb."""
    stub = shapely.box(4.0, 1.9, 4.1, 4.0)

    (passage,) = passages(shapely.difference(shapely.box(1, 1, 7, 4), stub))

    assert ends(passage) in ({(4.0, 1.9), (4.0, 1.0)}, {(4.1, 1.9), (4.1, 1.0)})


@pytest.mark.parametrize(
    "free",
    [
        shapely.box(1, 1, 6, 4),
        rooms((1, 1, 2, 6), (1, 1, 6, 2)),
        rooms((1, 1, 9, 2)),
        rooms((1, 1, 6, 3), (1, 1, 3, 6)),
        rooms(LEFT, (4.0, 1.0, 8.0, 4.0), (4.0, 1.0, 5.0, 4.1)),
    ],
    ids=["room", "bent corridor", "corridor", "bent room", "niche of 10 cm"],
)
def test_space_that_narrows_nowhere_has_no_passage(free):
    assert [] == passages(free)


@pytest.mark.parametrize("gap", [0.4, 0.5, 1.4, 1.5])
def test_width_tells_doorways_from_openings_and_cracks(gap):
    free = rooms(LEFT, RIGHT, (4.0, 2.0, 4.1, 2.0 + gap))

    lines = passages(free)
    plan = FloorPlan.build("two rooms", free, doorways=None, regions_are="none")

    assert ([] if gap < MIN_DOOR_M else [pytest.approx(gap)]) == [width(line) for line in lines]
    assert (MIN_DOOR_M <= gap <= MAX_DOOR_M) == bool(plan.doorways)


def test_thick_wall_has_one_doorway():
    assert 1 == len(passages(rooms((1, 1, 4, 4), (4.4, 1, 7, 4), (4.0, 2.0, 4.4, 2.9))))


STUBS = shapely.union_all([shapely.box(0, 4, 4, 4.1), shapely.box(5.5, 0, 5.6, 3)])


def test_opening_in_line_with_no_wall_is_no_gap_in_one():
    """The way from the end of one wall to that of another is in line with neither."""
    assert [] == passages(shapely.difference(shapely.box(1, 1, 10, 7), STUBS))


def test_slanted_opening_between_straight_walls_is_none():
    """The way from the end of one wall to that of another runs in no direction of the walls."""
    lines = passages(shapely.difference(shapely.box(1, 1, 10, 7), STUBS), gaps_only=False)

    wide = [line for line in lines if width(line) > MAX_DOOR_M]
    assert all(x0 == x1 or y0 == y1 for (x0, y0), (x1, y1) in wide)


@pytest.mark.parametrize("degrees", [0, 17, 45])
def test_main_directions_are_those_of_most_walls_however_they_are_turned(degrees):
    home = affinity.rotate(rooms(LEFT, RIGHT, (4.0, 2.0, 4.1, 2.9)), degrees, origin=(5, 5))
    directions = WallDirections.of([shapely.transform(home, lambda xy: xy * UNITS)], UNITS)
    at = np.radians([degrees, degrees + 90, degrees + 30])
    lines = np.zeros((3, 4), np.int64)
    lines[:, 2:] = np.rint(1000 * np.stack([np.cos(at), np.sin(at)], axis=1))

    assert directions.straight
    assert [True, True, False] == directions.are_main(lines).tolist()


def test_walls_with_teeth_are_ragged_but_a_round_wall_is_straight():
    """A circle runs in all directions alike, so any passage is in line with it."""
    teeth = [(k / 2, 10 + 0.3 * (k % 2)) for k in range(20, -1, -1)]
    toothed = Polygon([(0, 0), (10, 0), *((y, x) for x, y in teeth[::-1]), *teeth])

    straight = [
        WallDirections.of([shapely.transform(shape, lambda xy: xy * UNITS)], UNITS).straight
        for shape in (toothed, shapely.Point(5, 5).buffer(4))
    ]

    assert [False, True] == straight


@pytest.mark.parametrize("batch", [1, 3, 10**6])
def test_passages_do_not_depend_on_how_many_corners_are_looked_at_together(batch, monkeypatch):
    """A comb of 4,000 teeth took 1.7 GB: all pairs of its corners at once."""
    teeth = [(1 + k / 10, 3.5, 1.05 + k / 10, 4.5 + (k % 7) / 20) for k in range(30)]
    free = rooms(LEFT, RIGHT, (3.9, 2, 4.2, 2.9), *teeth)
    whole = passages(free, gaps_only=False)
    monkeypatch.setattr(segmentation, "BATCH", batch)
    assert whole == passages(free, gaps_only=False)
    assert whole


@st.composite
def grids(draw):
    """Draw rooms in a grid with doors in some of the walls between them; all hang together."""
    columns, rows = draw(st.integers(1, 4)), draw(st.integers(1, 3))
    steps = st.integers(60, 90)  # of 5 cm
    x = np.cumsum([20, *draw(st.lists(steps, min_size=columns, max_size=columns))]) / 20
    y = np.cumsum([20, *draw(st.lists(steps, min_size=rows, max_size=rows))]) / 20
    boxes = {
        (i, j): shapely.box(x[i], y[j], x[i + 1] - 0.1, y[j + 1] - 0.1)
        for i in range(columns)
        for j in range(rows)
    }
    doors = []
    for i, j in boxes:
        # Along each row, and up the first column: a tree; further doors as drawn.
        for beside, needed in (((i + 1, j), True), ((i, j + 1), i == 0)):
            if beside in boxes and (needed or draw(st.booleans())):
                width, away = draw(st.integers(12, 24)) / 20, draw(st.integers(4, 12)) / 20
                if beside[0] > i:
                    box = (x[i + 1] - 0.1, y[j] + away, x[i + 1], y[j] + away + width)
                else:
                    box = (x[i] + away, y[j + 1] - 0.1, x[i] + away + width, y[j + 1])
                doors.append(shapely.box(*box))
    free = rooms(*(box.bounds for box in [*boxes.values(), *doors]))
    return free, doors, len(boxes)


@settings(max_examples=examples(60))
@given(grids())
def test_random_grids_of_rooms_have_exactly_their_rooms_and_doors(grid):
    free, doors, count = grid

    plan = FloorPlan.build("grid", free, doorways=None, regions_are="none")

    assert count == len(plan.rooms)
    assert len(doors) == len(plan.doorways)
    lines = [shapely.LineString([doorway.start, doorway.end]) for doorway in plan.doorways]
    for door in doors:
        assert 1 == sum(door.buffer(1e-6).contains(line) for line in lines)
    assert {frozenset(link.rooms) for link in plan.room_graph} == {
        frozenset(doorway.rooms) for doorway in plan.doorways
    }


def test_crossing_of_corridors_has_no_opening_from_corner_to_corner():
    """The hall makes diagonals a main direction, but no wall is in line with one there."""
    hall = Polygon([(9, 3), (13, 7), (9, 11), (5, 7)])
    crossing = rooms((1.0, 6.0, 6.0, 7.9), (2.5, 1.0, 4.4, 13.0))

    found = passages(shapely.union_all([hall, crossing]), gaps_only=False)

    assert [] == [passage for passage in found if width(passage) > MAX_DOOR_M]
