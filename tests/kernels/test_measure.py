"""Rooms of places, time in rooms and lengths of ways, against NumPy and plain loops."""

from math import hypot

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fleet2d.kernels.measure import count_rooms, rooms_at, sum_moves
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import Poses

ROWS, COLUMNS = 4, 6
ROOMS = np.random.default_rng(0).integers(-1, 5, (ROWS, COLUMNS)).astype(np.int16)
places = st.lists(st.tuples(st.integers(-200, 600), st.integers(-200, 400)), max_size=30)


@given(places)
def test_a_place_outside_of_the_map_has_the_room_at_its_nearest_border(at: list) -> None:
    x, y = np.array(at, np.int64).reshape(-1, 2).T.copy()
    row, column = np.clip(y // SUB, 0, ROWS - 1), np.clip(x // SUB, 0, COLUMNS - 1)
    assert np.array_equal(ROOMS[row, column], rooms_at(ROOMS, x, y))


@given(st.lists(st.tuples(*[st.integers(0, 4 * SUB - 1)] * 2, st.booleans()), max_size=30))
def test_time_in_rooms_and_the_way_are_those_of_plain_loops(steps: list) -> None:
    rows = np.array(steps, np.int64).reshape(-1, 3)
    x, y, away = rows[:, 0].copy(), rows[:, 1].copy(), rows[:, 2].astype(np.uint8)
    poses, counts = Poses(x, y, np.zeros_like(x), away), np.zeros(7, np.int64)
    inside = np.abs(ROOMS)
    count_rooms(poses, inside, counts)
    expected = [0] * 7
    for px, py, out in zip(x.tolist(), y.tolist(), away.tolist(), strict=True):
        expected[6 if out else int(inside[py // SUB, px // SUB])] += 1
    assert expected == counts.tolist()
    way = sum(hypot(x[i] - x[i - 1], y[i] - y[i - 1]) for i in range(1, len(x)))
    assert abs(way - sum_moves(poses)) <= 1e-9 * max(way, 1)
