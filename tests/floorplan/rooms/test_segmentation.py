"""Chambers that are too small to be rooms are joined to others."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.segmentation import (
    Chambers,
    Link,
    WallDirections,
    segment_rooms,
)

CELL = 0.1


def chambers(*areas_m2: float, links: tuple[Link, ...]) -> Chambers:
    """Return chambers of these areas beside each other, each 1 m deep."""
    columns = [round(area / CELL) for area in areas_m2]
    row = np.append(np.repeat(np.arange(len(columns)), columns), -1).astype(np.int32)
    return Chambers(np.tile(row, (10, 1)), len(columns), links)


def areas(rooms: np.ndarray) -> list[float]:
    return (np.bincount(rooms[rooms >= 0]) * CELL**2).round(2).tolist()


def test_rooms_are_numbered_by_decreasing_size_and_walls_have_none() -> None:
    rooms = segment_rooms(chambers(2.0, 9.0, links=(Link(0, (0, 1)),)), [False], [0.9], CELL)
    assert [9.0, 2.0] == areas(rooms)
    assert -1 == rooms[0, -1]


def test_alcove_behind_an_opening_is_joined_but_a_small_room_behind_a_doorway_is_not() -> None:
    both = chambers(9.0, 3.0, links=(Link(0, (0, 1)),))
    assert [12.0] == areas(segment_rooms(both, [True], [0.9], CELL))
    assert [9.0, 3.0] == areas(segment_rooms(both, [False], [0.9], CELL))


def test_what_is_too_small_for_a_toilet_goes_across_an_opening_rather_than_a_doorway() -> None:
    links = (Link(0, (0, 1)), Link(1, (1, 2)))
    rooms = segment_rooms(chambers(9.0, 1.0, 6.0, links=links), [False, True], [0.9, 0.9], CELL)
    assert [9.0, 7.0] == areas(rooms)


def test_gap_among_furniture_is_no_room_though_it_is_as_large_as_a_toilet() -> None:
    both = chambers(9.0, 2.0, links=(Link(0, (0, 1)),))
    both.of_cell[:, -21:-1] = 0
    both.of_cell[:5, -41:-1] = 1  # 0.5 m deep

    assert [11.0] == areas(segment_rooms(both, [False], [0.9], CELL))


STRAIGHT = WallDirections.of([shapely.box(0, 0, 5000, 5000)], 640)


@pytest.mark.parametrize(
    ("width", "straight", "found"),
    [(0.8, True, [9.0, 6.0]), (0.98, True, [15.0]), (0.98, False, [9.0, 6.0])],
)
def test_corridor_with_straight_walls_goes_on_past_the_doors_on_either_side(
    width: float, straight: bool, found: list[float]
) -> None:
    """A line from a door frame to the opposite wall is as wide as the corridor, 1 m."""
    both = chambers(9.0, 6.0, links=(Link(0, (0, 1)),))
    directions = replace(STRAIGHT, straight=straight)
    across = [((0, 0), (0, 640))]

    assert found == areas(segment_rooms(both, [False], [width], CELL, directions, across))


def test_legs_of_chairs_make_no_room_seem_a_corridor() -> None:
    """Among them no disc is wider than the doorway, which would lie across a corridor."""
    both = chambers(9.0, 6.0, links=(Link(0, (0, 1)),))
    both.of_cell[5, 2::4] = -1
    across = [((0, 0), (0, 640))]

    assert [8.78, 5.85] == areas(segment_rooms(both, [False], [0.8], CELL, STRAIGHT, across))


@pytest.mark.parametrize(
    ("end", "straight", "found"),
    [
        ((0, 500), False, [9.0, 3.0]),
        ((500, 500), False, [12.0]),
        ((500, 500), True, [9.0, 3.0]),
    ],
)
def test_small_space_behind_a_slanted_gap_in_ragged_walls_lies_among_furniture(
    end: tuple[int, int], straight: bool, found: list[float]
) -> None:
    both = chambers(9.0, 3.0, links=(Link(0, (0, 1)),))
    directions, gap = replace(STRAIGHT, straight=straight), [((0, 0), end)]

    assert found == areas(segment_rooms(both, [False], [0.8], CELL, directions, gap))


def test_chamber_without_a_link_stays_a_room_however_small() -> None:
    assert [9.0, 0.5] == areas(segment_rooms(chambers(9.0, 0.5, links=()), [], [], CELL))


def test_corridor_past_a_column_is_one_room_and_a_hall_beyond_it_another() -> None:
    corridor = shapely.box(0, 0, 12, 2.2).difference(shapely.box(6, 0, 6.4, 0.3))
    hall = shapely.union_all(
        [shapely.box(0, 0, 5, 5), shapely.box(5, 1, 5.2, 3.2), shapely.box(5.2, 0, 10, 5)]
    )

    past_a_column = FloorPlan.build("corridor", corridor, doorways=None, regions_are="none")
    two_halls = FloorPlan.build("halls", hall, doorways=None, regions_are="none")

    assert 1 == len(past_a_column.rooms)
    assert 2 == len(two_halls.rooms)
