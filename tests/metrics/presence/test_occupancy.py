"""Steps in places, by unions of visits, against the same counted step by step."""

from datetime import datetime
from types import SimpleNamespace
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fleet2d.metrics.presence.occupancy import steps_by_hour, steps_in_places

ROOMS, STEPS = 3, 12


def poses(rooms: list[int]) -> Any:
    """Return the poses of a user who is in a room at each step, -1 for away."""
    room = np.array(rooms, np.int16)
    begin = np.flatnonzero(np.append(True, room[1:] != room[:-1]))
    visits = begin, np.append(begin[1:], STEPS), room[begin]
    time_in_rooms = np.bincount(room.astype(np.int64) % (ROOMS + 1), minlength=ROOMS + 1)
    return SimpleNamespace(room=room, visits=visits, time_in_rooms=time_in_rooms)


class History:
    """Steps of users, as metrics read them."""

    first, end, step_s = 0, STEPS, 600.0

    def __init__(self, users: list[list[int]]) -> None:
        self._poses = {str(i): poses(rooms) for i, rooms in enumerate(users)}

    def __len__(self) -> int:
        return STEPS

    def poses(self, user: str) -> Any:
        return self._poses[user]


rooms_of_user = st.lists(st.integers(-1, ROOMS - 1), min_size=STEPS, max_size=STEPS)


@given(st.lists(rooms_of_user, max_size=4))
def test_steps_in_places_are_those_of_all_hours(users: list[list[int]]) -> None:
    names = tuple(map(str, range(len(users))))
    home = SimpleNamespace(rooms=range(ROOMS))
    state: Any = SimpleNamespace(home=home, users=names, start=datetime(2026, 3, 2))
    history: Any = History(users)

    counts = steps_in_places(history, state)

    assert counts.tolist() == steps_by_hour(history, state).sum(axis=0).tolist()
