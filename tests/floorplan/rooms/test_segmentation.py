"""Chambers that are too small to be rooms are joined to others."""

import numpy as np
import pytest
import shapely

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.segmentation import (
    Chambers,
    Link,
    segment_rooms,
)

CELL = 0.1


def chambers(*areas_m2, links):
    """Return chambers of these areas beside each other, each 1 m deep."""
    columns = [round(area / CELL) for area in areas_m2]
    row = np.append(np.repeat(np.arange(len(columns)), columns), -1).astype(np.int32)
    return Chambers(np.tile(row, (10, 1)), len(columns), links)


def areas(rooms):
    return (np.bincount(rooms[rooms >= 0]) * CELL**2).round(2).tolist()


def test_rooms_are_numbered_by_decreasing_size_and_walls_have_none():
    rooms = segment_rooms(chambers(2.0, 9.0, links=(Link(0, (0, 1)),)), [False], [0.8], CELL)
    assert [9.0, 2.0] == areas(rooms)
    assert -1 == rooms[0, -1]


def test_alcove_is_joined_but_a_toilet_is_not():
    alcove = chambers(9.0, 1.1, links=(Link(0, (0, 1)),))
    toilet = chambers(9.0, 1.3, links=(Link(0, (0, 1)),))
    assert [10.1] == areas(segment_rooms(alcove, [False], [0.8], CELL))
    assert [9.0, 1.3] == areas(segment_rooms(toilet, [False], [0.8], CELL))


def test_what_is_too_small_for_a_toilet_goes_across_an_opening_rather_than_a_doorway():
    links = (Link(0, (0, 1)), Link(1, (1, 2)))
    rooms = segment_rooms(chambers(9.0, 1.0, 6.0, links=links), [False, True], [0.8, 0.8], CELL)
    assert [9.0, 7.0] == areas(rooms)


@pytest.mark.parametrize(("width", "found"), [(0.8, [9.0, 6.0]), (0.98, [15.0])])
def test_corridor_goes_on_past_the_doors_on_either_side(width, found):
    """A line from a door frame to the opposite wall is as wide as the corridor, 1 m."""
    both = chambers(9.0, 6.0, links=(Link(0, (0, 1)),))

    assert found == areas(segment_rooms(both, [False], [width], CELL))


@pytest.mark.parametrize(
    ("leads_on", "found"), [(True, [18.0, 9.0, 8.0]), (False, [12.0, 9.0, 8.0, 6.0])]
)
def test_corridor_that_leads_on_stays_one_where_it_gets_wider(leads_on, found):
    """A dead end that is open all along its front is a room of its own."""
    of_cell = np.full((20, 300), -1, np.int32)
    of_cell[5:15, :90] = 0
    of_cell[5:15, 90:150] = 1
    of_cell[:, 150:210] = 2
    of_cell[5:15, 210:290] = 3
    door = Link(0, (0, 1) if leads_on else (0, 3))
    four = Chambers(of_cell, 4, (door, Link(1, (1, 2)), Link(2, (2, 3))))

    assert found == areas(segment_rooms(four, [False] * 3, [0.8, 0.95, 0.8], CELL))


def test_legs_of_chairs_make_no_room_seem_a_corridor():
    """Among them no disc is wider than the doorway, which would lie across a corridor."""
    both = chambers(9.0, 6.0, links=(Link(0, (0, 1)),))
    both.of_cell[5, 2::4] = -1

    assert [8.78, 5.85] == areas(segment_rooms(both, [False], [0.8], CELL))


def test_chamber_without_a_link_stays_a_room_however_small():
    assert [9.0, 0.5] == areas(segment_rooms(chambers(9.0, 0.5, links=()), [], [], CELL))


def test_corridor_past_a_column_is_one_room_and_a_hall_beyond_it_another():
    corridor = shapely.box(0, 0, 12, 2.2).difference(shapely.box(6, 0, 6.4, 0.3))
    hall = shapely.union_all(
        [shapely.box(0, 0, 5, 5), shapely.box(5, 1, 5.2, 3.2), shapely.box(5.2, 0, 10, 5)]
    )

    past_a_column = FloorPlan.build("corridor", corridor, doorways=None, regions_are="none")
    two_halls = FloorPlan.build("halls", hall, doorways=None, regions_are="none")

    assert 1 == len(past_a_column.rooms)
    assert 2 == len(two_halls.rooms)
