import numpy as np
import pytest
import shapely
from hypothesis import given
from tests.strategies import quick, rectilinear_homes

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.rooms.room import (
    TO_CENTRE,
    LabelledRegion,
    _inside_upright,
    _is_met_more_along_x,
    assign_rooms,
    cells_in,
)

LATTICE = Lattice(0.1, (0.0, 0.0), columns=40, rows=30)
FREE = np.zeros((30, 40), np.bool_)
FREE[2:28, 2:38] = True


def region(label, x0, y0, x1, y1):
    return LabelledRegion((label,), shapely.box(x0, y0, x1, y1))


def assign(*regions):
    room_of_cell, rooms, notes = assign_rooms(LATTICE, FREE, regions)
    assert list(range(len(rooms))) == [room.index for room in rooms]
    assert np.array_equal(FREE, room_of_cell >= 0)
    counts = np.bincount(room_of_cell[FREE], minlength=len(rooms)).tolist()
    assert counts == [room.cells for room in rooms]
    assert 0 not in counts
    assert len(rooms) == len({room.name for room in rooms})
    return room_of_cell, {room.name: room for room in rooms}, notes


HALL = region("Hall", 0, 0, 4, 3)
TOILET = region("Toilet", 1, 1, 2, 2)


@pytest.mark.parametrize(
    ("regions", "cells", "note_count"),
    [
        # Known failure 6: a plan without labels crashed.
        pytest.param([], {"unknown_1": 26 * 36}, 0, id="no labels: one unknown room"),
        pytest.param(
            [region("Bedroom", 0, 0, 2, 3)], {"bedroom_1": 468, "unknown_1": 468}, 0, id="half"
        ),
        pytest.param([HALL, TOILET], {"hall_1": 836, "toilet_1": 100}, 0, id="the smaller wins"),
        pytest.param([TOILET, HALL], {"toilet_1": 100, "hall_1": 836}, 0, id="in either order"),
        pytest.param(
            [region("Hall", 0, 0, 2, 3), region("Office", 1, 0, 3, 3)],
            {"hall_1": 468, "office_1": 260, "unknown_1": 208}, 0, id="the first of equal size wins",
        ),
        pytest.param(
            [HALL, region("Kitchen", 0, 0, 2, 3), region("Gym", 2, 0, 4, 3)],
            {"kitchen_1": 468, "gym_1": 468}, 1, id="one under smaller ones is a note",
        ),
        pytest.param(
            [region("Aeration", 1.0, 0, 1.01, 3), region("Hall", 1, 1, 1, 1)],
            {"unknown_1": 936}, 2, id="one thinner than a cell is a note",
        ),
        pytest.param(
            [region("Kitchen", 0, 0, 1, 3), region("Hall", 1.5, 0, 3.7, 3)],
            {"kitchen_1": 208, "hall_1": 572, "unknown_1": 156}, 0, id="large gaps are no notes",
        ),
    ],
)  # fmt: skip
def test_regions_share_the_free_cells(regions, cells, note_count):
    _, rooms, notes = assign(*regions)

    assert cells == {name: room.cells for name, room in rooms.items()}
    assert note_count == len(notes)


def test_gaps_between_regions_are_noted():
    """A builder whose rooms end at the walls left all doorways to a room of type unknown."""
    kitchen, hall = region("Kitchen", 0, 0, 1, 3), region("Hall", 1.2, 0, 2, 3)

    _, rooms, notes = assign(kitchen, hall, region("Gym", 2.1, 0, 4, 3))

    assert 3 * 26 == rooms["unknown_1"].cells
    assert [
        "small gaps between rooms that no region covers, such as doorways: 2, the first at (1.05,"
        " 1.45) m; they make a room of type unknown, so let the regions meet there"
    ] == notes


def test_the_same_box_under_two_labels_is_one_room_with_both():
    """Known failure 6: a kitchen with the same box as the dining room got no cells."""
    _, rooms, notes = assign(
        region("Dining_Room", 0, 0, 2, 3),
        region("Toilet", 2, 0, 4, 3),
        region("Kitchen", 0, 0, 2.0004, 3),
    )

    assert ["kitchen_1", "toilet_1"] == list(rooms)
    assert ("dining_room", "kitchen") == rooms["kitchen_1"].labels
    assert 18 * 26 == rooms["kitchen_1"].cells
    assert [] == notes


def test_a_box_that_misses_the_free_space_is_a_note_and_no_room():
    """Known failure 6: a room whose box missed the floor got the whole background."""
    _, rooms, notes = assign(
        region("Garage", 7, 7, 9, 9), region("Garage", -5, -5, -1, -1), region("Garage", 0, 0, 4, 2)
    )

    assert ["garage_1", "unknown_1"] == list(rooms)
    assert 2 == len(notes)
    assert notes[0].startswith("the region garage from (7.00, 7.00) to (9.00, 9.00) m has no free")


@quick
@given(rectilinear_homes())
def test_upright_shapes_have_the_cells_inside_them(polygons):
    shape = shapely.MultiPolygon(polygons)
    window = slice(1, 9), slice(2, 14)
    y, x = np.mgrid[window]

    for part in (shape, polygons[0]) if polygons else ():
        expected = shapely.contains_xy(part, x * 64 + 33, y * 64 + 33)
        assert np.array_equal(expected, _inside_upright(expected.shape, window, part))
    triangle = shapely.Polygon([(0, 0), (300, 0), (0, 300)])
    assert _inside_upright((8, 12), window, triangle) is None


def test_own_names_stay_and_numbering_skips_them():
    _, rooms, _ = assign(
        region("Bedroom", 0, 0, 1, 3),
        LabelledRegion(("Bedroom",), shapely.box(1, 0, 2, 3), name="bedroom_1"),
        LabelledRegion(("Bedroom",), shapely.box(2, 0, 3, 3), name="Anna's", type="child_room"),
    )

    assert ["bedroom_2", "bedroom_1", "Anna's", "unknown_1"] == list(rooms)
    assert ("child_room", ("bedroom",)) == (rooms["Anna's"].type, rooms["Anna's"].labels)


def test_one_name_for_two_rooms_is_refused():
    den = [LabelledRegion(("Room",), shapely.box(x, 0, x + 1, 3), name="den") for x in (0, 1)]

    with pytest.raises(FloorPlanError, match="two rooms are named 'den'"):
        assign_rooms(LATTICE, FREE, den)


@pytest.mark.parametrize("turned", [False, True])
def test_cells_between_thin_teeth_are_those_of_the_plain_comparison(turned):
    """Which way the teeth lie decides along which axis edges are met: the cells are the same."""
    xs = np.linspace(6400, 0, 1201)[1:-1].astype(int) // 2 * 2
    tips = [(x, 3200 if k % 2 else 1600) for k, x in enumerate(xs.tolist())]
    corners = np.array([(0, 0), (6400, 0), *tips, (0, 3200)])
    comb = shapely.Polygon(corners[:, ::-1] if turned else corners)
    free = np.ones((110, 110), np.bool_)

    cells = cells_in(free, comb)

    rows, columns = np.indices((110, 110)) * UNITS_PER_CELL + TO_CENTRE
    expected = shapely.contains_xy(comb, columns, rows)
    assert _is_met_more_along_x(comb) != turned
    assert expected[cells.window].sum() == expected.sum()
    assert (expected[cells.window] == cells.mask).all()
