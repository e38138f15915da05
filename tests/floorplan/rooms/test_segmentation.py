"""Chambers that are too small to be rooms are joined to others."""

import numpy as np
import pytest
import shapely
from shapely import affinity

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.segmentation import Chambers, Link, segment_rooms
from fleet2d.kernels import I64

CELL = 0.05


def chambers(*areas_m2, links):
    """Return chambers of these areas beside each other, each 1 m deep."""
    columns = [round(area / CELL) for area in areas_m2]
    row = np.append(np.repeat(np.arange(len(columns)), columns), -1).astype(np.int32)
    return Chambers(np.tile(row, (round(1 / CELL), 1)), len(columns), links)


def joined(chambers: Chambers, is_opening: list[bool], widths_m: list[float]) -> I64:
    """Return the rooms of chambers with a line in the middle of each border."""
    segments = []
    for link, width in zip(chambers.links, widths_m, strict=True):
        x = 64 * int(np.argwhere((chambers.of_cell == link.chambers[1]).any(axis=0)).min())
        y, half = 32 * len(chambers.of_cell), round(32 * width / CELL)
        segments.append(((x, y - half), (x, y + half)))
    return segment_rooms(chambers, segments, is_opening, widths_m, CELL)


def areas(rooms):
    return (np.bincount(rooms[rooms >= 0]) * CELL**2).round(2).tolist()


def test_rooms_are_numbered_by_decreasing_size_and_walls_have_none():
    rooms = joined(chambers(2.0, 9.0, links=(Link(0, (0, 1)),)), [False], [0.8])
    assert [9.0, 2.0] == areas(rooms)
    assert -1 == rooms[0, -1]


def test_alcove_is_joined_but_a_toilet_is_not():
    alcove = chambers(9.0, 1.1, links=(Link(0, (0, 1)),))
    toilet = chambers(9.0, 1.3, links=(Link(0, (0, 1)),))
    assert [10.1] == areas(joined(alcove, [False], [0.8]))
    assert [9.0, 1.3] == areas(joined(toilet, [False], [0.8]))


def test_what_is_too_small_for_a_toilet_goes_across_an_opening_rather_than_a_doorway():
    links = (Link(0, (0, 1)), Link(1, (1, 2)))
    rooms = joined(chambers(9.0, 1.0, 6.0, links=links), [False, True], [0.8, 0.8])
    assert [9.0, 7.0] == areas(rooms)


@pytest.mark.parametrize(("width", "found"), [(0.8, [9.0, 6.0]), (0.98, [15.0])])
def test_corridor_goes_on_past_the_doors_on_either_side(width, found):
    """A line from a door frame to the opposite wall is as wide as the corridor, 1 m."""
    both = chambers(9.0, 6.0, links=(Link(0, (0, 1)),))

    assert found == areas(joined(both, [False], [width]))


@pytest.mark.parametrize(
    ("leads_on", "found"), [(True, [18.0, 9.0, 8.0]), (False, [12.0, 9.0, 8.0, 6.0])]
)
def test_corridor_that_leads_on_stays_one_where_it_gets_wider(leads_on, found):
    """A dead end that is open all along its front is a room of its own."""
    of_cell = np.full((40, 600), -1, np.int32)
    of_cell[10:30, :180] = 0
    of_cell[10:30, 180:300] = 1
    of_cell[:, 300:420] = 2
    of_cell[10:30, 420:580] = 3
    door = Link(0, (0, 1) if leads_on else (0, 3))
    four = Chambers(of_cell, 4, (door, Link(1, (1, 2)), Link(2, (2, 3))))

    assert found == areas(joined(four, [False] * 3, [0.8, 0.95, 0.8]))


def test_legs_of_chairs_make_no_room_seem_a_corridor():
    """Among them no disc is wider than the doorway, which would lie across a corridor."""
    both = chambers(9.0, 6.0, links=(Link(0, (0, 1)),))
    both.of_cell[9:11, 4::8] = -1

    assert [8.89, 5.93] == areas(joined(both, [False], [0.8]))


def test_chamber_without_a_link_stays_a_room_however_small():
    assert [9.0, 0.5] == areas(joined(chambers(9.0, 0.5, links=()), [], []))


def test_corridor_past_a_column_is_one_room_and_a_hall_beyond_it_another():
    corridor = shapely.box(0, 0, 12, 2.2).difference(shapely.box(6, 0, 6.4, 0.3))
    hall = shapely.union_all(
        [shapely.box(0, 0, 5, 5), shapely.box(5, 1, 5.2, 3.2), shapely.box(5.2, 0, 10, 5)]
    )

    past_a_column = FloorPlan.build("corridor", corridor, doorways=None, regions_are="none")
    two_halls = FloorPlan.build("halls", hall, doorways=None, regions_are="none")

    assert 1 == len(past_a_column.rooms)
    assert 2 == len(two_halls.rooms)


@pytest.mark.parametrize("turn", [0, 30])
def test_corridor_around_a_block_is_one_room_past_opposite_doors(turn):
    """A bend of it is wider than a line across it from door to door, which is wide enough there."""
    side = 12.0
    ring = shapely.box(0, 0, side, side) - shapely.box(2, 2, side - 2, side - 2)
    office = shapely.union_all(
        [shapely.box(x, -4, x + 3.8, -0.2) for x in (0, 4, 8)]
        + [shapely.box(x + 0.3, -0.3, x + 1.2, 0.1) for x in (0, 4, 8)]
    )
    around = [affinity.rotate(office, 90 * k, origin=(side / 2, side / 2)) for k in range(4)]
    block = shapely.box(2.2, 2.2, side - 2.2, side - 2.2)
    doors = [shapely.box(x, y, x + 0.9, y + 0.3) for x in (4, 7) for y in (1.95, side - 2.25)]
    home = shapely.union_all([ring, *around, block, *doors])

    plan = FloorPlan.build("ring", affinity.rotate(home, turn), doorways=None, regions_are="none")

    sizes = sorted(room.area_m2 for room in plan.rooms)
    assert [14.4] * 12 == pytest.approx(sizes[:12], abs=0.5)
    assert [block.area, ring.area] == pytest.approx(sizes[12:], abs=2)
