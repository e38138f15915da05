"""Rooms end where the space narrows."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.reference.shape import parts_by_shape

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.shape import (
    IN_RAGGED_WALLS,
    IN_STRAIGHT_WALLS,
    OF_VACUUMS,
    Limits,
    divide_by_shape,
    without_furniture,
)
from fleet2d.kernels import label_parts

CELL = 0.1


def divided(seed):
    """Return two rooms without a wall between them, and walls and obstacles."""
    rng = np.random.default_rng(seed)
    rooms = np.zeros((12, 20), np.int64)
    rooms[:, rng.integers(8, 30) :] = 1
    for row, column, height, width in rng.integers(
        (0, 0, 1, 1), (12, 20, 5, 5), (rng.integers(9), 4)
    ):
        rooms[row : row + height, column : column + width] = -1
    rooms[0, 0] = 0
    return rooms


SEEDS = st.integers(0, 2**32 - 1)


@given(
    SEEDS,
    st.sampled_from([0.1, 0.2, 0.5, 1.0]),
    st.sampled_from([0.5, 0.65, 0.8, 1.0]),
    st.sampled_from([0.0, 0.3, 0.5]),
    st.integers(0, 12),
)
def test_rooms_are_divided_as_walking_up_and_joining_pair_by_pair_does(
    seed, cell, neck, mouth, least_cells
):
    rooms = divided(seed)
    limits = Limits(neck, mouth, least_cells * cell**2)

    found = divide_by_shape(rooms, cell, limits)

    parts = {
        frozenset(map(tuple, np.argwhere(found == part).tolist()))
        for part in range(found.max() + 1)
    }
    assert parts_by_shape(rooms, cell, limits) == parts


@given(SEEDS)
def test_parts_are_in_one_piece_within_a_room_and_numbered_by_size(seed):
    rooms = divided(seed)

    found = divide_by_shape(rooms, 0.2, Limits(0.65, 0.3, 0.0))

    assert np.array_equal(rooms < 0, found < 0)
    sizes = np.bincount(found[found >= 0]).tolist()
    assert sorted(sizes, reverse=True) == sizes
    for part in range(len(sizes)):
        assert 1 == len(set(rooms[found == part].tolist()))
        assert 0 == label_parts(found == part, False).max()


def space(*boxes):
    """Return free space of boxes [m]: 0 where free, -1 elsewhere."""
    free = np.zeros((60, 120), np.bool_)
    for x0, y0, x1, y1 in boxes:
        free[round(y0 / CELL) : round(y1 / CELL), round(x0 / CELL) : round(x1 / CELL)] = True
    return np.where(free, 0, -1)


def areas(rooms):
    return (np.bincount(rooms[rooms >= 0]) * CELL**2).round(1).tolist()


@pytest.mark.parametrize(("width", "count"), [(1.0, 2), (2.4, 2), (3.4, 1), (4.0, 1)])
def test_space_is_divided_where_it_is_less_than_two_thirds_as_wide(width, count):
    two = space((1, 1, 5, 5), (5, 1, 6, 1 + width), (6, 1, 11, 5))

    assert count == len(areas(divide_by_shape(two, CELL, IN_RAGGED_WALLS)))


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize(("width", "count"), [(1.4, 2), (3.0, 1)])
def test_a_corridor_ends_where_it_opens_into_a_hall(width, count, turns):
    """It is nowhere narrower there than along its length."""
    rooms = np.rot90(space((0, 2, 6, 2 + width), (6, 0, 12, 6)), turns)

    found = divide_by_shape(np.ascontiguousarray(rooms), CELL, IN_STRAIGHT_WALLS)

    assert count == len(areas(found))


@pytest.mark.parametrize(("limits", "count"), [(IN_RAGGED_WALLS, 1), (OF_VACUUMS, 2)])
def test_small_room_counts_in_the_map_of_a_vacuum(limits, count):
    """Elsewhere, it would be a gap among furniture."""
    hall_and_toilet = space((0, 0, 5, 5), (5, 2, 5.3, 2.7), (5.3, 1.5, 6.8, 3.2))

    assert count == len(areas(divide_by_shape(hall_and_toilet, CELL, limits)))


@pytest.mark.parametrize(("side", "count"), [(0.5, 1), (1.6, 2)])
def test_chair_narrows_nothing_but_a_cupboard_does(side, count):
    room = space((0, 0, 8, 3))
    at = slice(round((1.5 - side / 2) / CELL), round((1.5 + side / 2) / CELL))
    room[at, 38:42] = -1

    assert count == len(areas(divide_by_shape(room, CELL, IN_RAGGED_WALLS)))


@pytest.mark.parametrize(("length", "stays"), [(1.2, False), (1.4, True)])
def test_free_standing_wall_is_no_furniture_however_thin_it_is(length, stays):
    """Vacuums draw walls as lines of one cell, of a smaller area than that of a table."""
    rooms = np.zeros((20, 20), np.int32)
    rooms[2 : 2 + round(length / CELL), 10] = -1

    assert stays == (without_furniture(rooms, CELL) < 0).any()


def test_obstacle_at_the_edge_of_the_map_is_no_furniture():
    rooms = np.zeros((5, 5), np.int32)
    rooms[0, 2] = rooms[2, 2] = -1

    assert [[0, 2]] == np.argwhere(without_furniture(rooms, CELL) < 0).tolist()


def test_cluttered_map_is_divided_where_it_narrows_and_has_a_doorway_there():
    """Its walls have teeth, and no corner of the one faces a corner of the other."""
    rng = np.random.default_rng(1)
    walls = [shapely.box(4, 0, 4.3, 2), shapely.box(4, 3, 4.3, 5)]
    dents = [
        shapely.Point(x, y).buffer(r, quad_segs=2)
        for x, y, r in zip(
            rng.uniform(0, 9, 60),
            rng.choice([0.0, 5.0], 60),
            rng.uniform(0.1, 0.4, 60),
            strict=True,
        )
    ]
    free = shapely.box(0, 0, 9, 5) - shapely.union_all([*walls, *dents])

    plan = FloorPlan.build("map", free, doorways=None, regions_are="none")

    assert (2, 1) == (len(plan.rooms), len(plan.doorways))
    assert 1.0 == pytest.approx(plan.doorways[0].width_m, abs=0.15)
