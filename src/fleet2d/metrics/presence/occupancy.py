"""True occupancy of rooms, which presence is measured by."""

from datetime import timedelta

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.observations import NOWHERE
from fleet2d.algorithms.presence.belief import HOURS
from fleet2d.configuration.units import micros
from fleet2d.floorplan.cache import read_only
from fleet2d.floorplan.home.home import Home
from fleet2d.floorplan.home.space import Space
from fleet2d.kernels import F64, I64, Bool
from fleet2d.kernels.space import SUB
from fleet2d.runtime.clock import HOUR_US, midnight_of

# Clearance that a person needs to walk from room to room [m].
RADIUS = 0.2


def steps_in_places(history: History, state: Present) -> I64:
    """Return the number of steps that each user was in each place: int64 (users + 1, rooms + 1).

    The last column is away. The last row is for anyone: steps with somebody in the room, and last
    with nobody at home.
    """
    rooms, users = len(state.home.rooms), state.users
    counts = np.zeros((len(users) + 1, rooms + 1), np.int64)
    for row, user in enumerate(users):
        counts[row] = history.poses(user).time_in_rooms
    if not users:
        counts[-1, -1] = len(history)
    elif len(users) == 1:
        counts[-1] = counts[0]
    else:
        visits = [history.poses(user).visits for user in users]
        begin, end, room = (np.concatenate(column) for column in zip(*visits, strict=True))
        is_home = room != NOWHERE
        begin, end, room = begin[is_home], end[is_home], room[is_home].astype(np.int64)
        counts[-1, :-1] = _steps_in_any(begin, end, room, rooms)
        counts[-1, -1] = len(history) - _steps_in_any(begin, end, 0 * room, 1)[0]
    return counts


def _steps_in_any(begin: I64, end: I64, group: I64, groups: int) -> I64:
    """Return the number of steps in any stretch of each group, whose stretches may overlap."""
    span = int(end.max(initial=0)) + 1
    ends = np.concatenate([2 * (group * span + begin) + 1, 2 * (group * span + end)])
    ends.sort()  # odd: a beginning; each group has as many ends as beginnings
    is_in_any = np.cumsum(2 * (ends & 1) - 1)[:-1] > 0
    at = ends >> 1
    steps = np.zeros(groups, np.int64)
    np.add.at(steps, at[:-1] // span, np.where(is_in_any, np.diff(at), 0))
    return steps


def steps_by_hour(history: History, state: Present) -> I64:
    """Return the same by hour of the week: int64 (168, users + 1, rooms + 1)."""
    rooms, users = len(state.home.rooms), state.users
    counts = np.zeros((HOURS, len(users) + 1, rooms + 1), np.int64)
    hour = hours_of_week(history, state)
    for row, user in enumerate(users):
        room = history.poses(user).room.astype(np.int64)
        place = np.where(room == NOWHERE, rooms, room)
        steps = np.bincount(hour * (rooms + 1) + place, minlength=HOURS * (rooms + 1))
        counts[:, row] = steps.reshape(HOURS, rooms + 1)
    first = np.concatenate([[0], np.flatnonzero(np.diff(hour)) + 1])
    steps = np.add.reduceat(_anybody(history, state), first, axis=0, dtype=np.int64)
    np.add.at(counts[:, -1], hour[first], steps)
    return counts


def hours_of_week(history: History, state: Present) -> I64:
    """Return the hour of the week, from Monday 00:00, of each step of a history."""
    monday = midnight_of(state.start)
    monday -= timedelta(days=monday.weekday())
    start_us = micros(state.start - monday)
    steps = np.arange(history.first, history.end, dtype=np.int64)
    return (start_us + steps * round(history.step_s * 1e6)) // HOUR_US % HOURS


def _anybody(history: History, state: Present) -> Bool:
    """Return whether each room had somebody in it, last nobody at home: bool (steps, rooms + 1)."""
    change = np.zeros((len(history) + 1, len(state.home.rooms) + 1), np.int32)
    for user in state.users:
        begin, end, room = history.poses(user).visits
        np.add.at(change, (begin, room), 1)  # NOWHERE is -1: the last column
        np.add.at(change, (end, room), -1)
    is_occupied: Bool = np.cumsum(change[:-1], axis=0) > 0
    is_occupied[:, -1] = ~is_occupied[:, :-1].any(axis=1)
    return is_occupied


def shares(counts: I64, steps: float) -> tuple[F64, F64]:
    """Return counts as shares of rooms given at home, NaN without any time there, and of away."""
    rooms = counts[..., :-1].astype(np.float64)
    total = rooms.sum(axis=-1, keepdims=True)
    home = np.where(total > 0, rooms / np.where(total > 0, total, 1), np.nan)
    return home, counts[..., -1] / max(steps, 1)


def walking_distances(home: Home) -> F64:
    """Return the distance on foot between the middles of each two rooms [m].

    Without a route between them it is twice the longest distance.

    Returns:
        float64 (rooms, rooms), symmetric, read-only.
    """
    space = home.space(RADIUS)
    return home.cached(("walking distances", space), lambda: read_only(_distances(home, space)))


def _distances(home: Home, space: Space) -> F64:
    lattice = home.plan.lattice
    places = []
    for room in home.rooms:
        x, y = lattice.point_at(room.anchor_xy)
        places.append(space.nearest(x, y, None, room.index) or (x, y))
    columns, rows = np.array(places, np.int64).reshape(-1, 2).T // SUB
    metres = np.array([space.distance_field(np.array([place]))[rows, columns] for place in places])
    metres = np.minimum(metres, metres.T)
    is_reachable = np.isfinite(metres)
    longest = float(metres[is_reachable].max(initial=0.0)) or 1.0
    metres = np.where(is_reachable, metres, 2 * longest)
    np.fill_diagonal(metres, 0)
    return metres
