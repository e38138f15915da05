"""Rooms of places, time together and lengths of ways, against NumPy and plain loops."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tests.reference import signals as slow

from fleet2d.kernels import SUB, Poses, count_together, rooms_at, sum_moves

ROWS, COLUMNS = 4, 6
ROOMS = np.random.default_rng(0).integers(-1, 5, (ROWS, COLUMNS)).astype(np.int16)
places = st.lists(st.tuples(st.integers(-200, 600), st.integers(-200, 400)), max_size=30)


@given(places)
def test_a_place_outside_of_the_map_has_the_room_at_its_nearest_border(at):
    x, y = np.array(at, np.int64).reshape(-1, 2).T.copy()
    row, column = np.clip(y // SUB, 0, ROWS - 1), np.clip(x // SUB, 0, COLUMNS - 1)
    assert np.array_equal(ROOMS[row, column], rooms_at(ROOMS, x, y))


coordinate = st.integers(-200, 600)
portals = st.lists(st.tuples(*[coordinate] * 4, st.integers(0, 90)), max_size=2)


@given(places, portals)
def test_path_length_equals_a_plain_loop(at, links):
    x, y = np.array(at, np.int64).reshape(-1, 2).T.copy()
    poses = Poses(x, y, np.zeros_like(x), np.zeros(len(x), np.uint8))
    way = sum(slow.move_length((*a, False), (*b, False), links) for a, b in pairwise(at))
    rows = np.array(links, np.int64).reshape(-1, 5)
    assert abs(way - sum_moves(poses, rows)) <= 1e-9 * max(way, 1)


rooms_by_step = st.integers(1, 40).flatmap(
    lambda n: st.tuples(*[st.lists(st.integers(-1, 2), min_size=n, max_size=n)] * 2)
)


def visits(rooms):
    """Where the room changes, and the room from there on."""
    begin = [i for i, room in enumerate(rooms) if i == 0 or room != rooms[i - 1]]
    return np.array(begin, np.int64), np.array([rooms[i] for i in begin], np.int16)


@given(rooms_by_step)
def test_steps_together_equal_a_loop_over_all_steps(rooms):
    one, other = rooms
    expected = sum(a == b >= 0 for a, b in zip(one, other, strict=True))
    assert expected == count_together(*visits(one), *visits(other), len(one))
