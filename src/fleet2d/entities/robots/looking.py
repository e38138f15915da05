"""Where in a room to look round from, so that little of it stays out of view."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels.mesh import CELL_CENTRE, SUB
from fleet2d.kernels.points import points_in_sight

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.plan import Room

# Of a room so many cells are tried as places to look from, and as places to be seen, evenly spread.
STANDS_TRIED = 48
TARGETS_TRIED = 400

I64 = NDArray[np.int64]


class Views(NamedTuple):
    """Places to look round from in a room.

    Attributes:
        points: Lattice points, the one that shows most first.
        share: What part of the room they show together.
    """

    points: tuple[tuple[int, int], ...]
    share: float


def sight_range(actor: "Actor") -> float:
    """Return how far the cameras of a body see [lattice units]; 0 without a camera."""
    ranges = [camera.range[1] for camera in actor.entity.eyes.values()]
    return max(ranges, default=0.0) * actor.home.plan.lattice.units_per_m


def views_of(actor: "Actor", room: "Room", enough: float, most: int) -> Views:
    """Return where to look round in a room; greedily, the most that is new to see first.

    Walls and tall furniture count as they are at present.

    Args:
        actor: Who looks.
        room: A room that it can enter.
        enough: The part of the room to be shown before no more places are added.
        most: How many places at most.
    """
    home, space = actor.home, actor.space
    key = "views", home.walls, space, actor.part, sight_range(actor), room.index, enough, most
    return home.kept(key, lambda: _find_views(actor, room, enough, most))


def _find_views(actor: "Actor", room: "Room", enough: float, most: int) -> Views:
    plan = actor.home.plan
    stands = spread(actor.space.cells(room.index, actor.part), STANDS_TRIED)
    targets = spread(np.argwhere(plan.room_of_cell == room.index), TARGETS_TRIED)
    places = np.concatenate([[actor.middle(room)], centres(stands)])
    goals = centres(targets)
    seen = np.array([seen_from(actor, place, goals) for place in places])
    points: list[tuple[int, int]] = []
    left = np.ones(len(goals), np.bool_)
    while len(points) < most and left.sum() > (1 - enough) * len(goals):
        gains = (seen & left).sum(axis=1)
        best = int(np.argmax(gains))
        if not gains[best]:
            break
        points.append((int(places[best, 0]), int(places[best, 1])))
        left &= ~seen[best]
    if not points:
        return Views((actor.middle(room),), 0.0)
    return Views(tuple(points), 1 - float(left.sum()) / len(goals))


def seen_from(actor: "Actor", place: I64, goals: I64) -> NDArray[np.bool_]:
    """Return which goals (n, 2) are in range and in sight of a place, whatever the heading."""
    near = ((goals - place) ** 2).sum(axis=1) <= sight_range(actor) ** 2
    shown = np.zeros(len(goals), np.bool_)
    x, y = int(place[0]), int(place[1])
    shown[near] = points_in_sight(actor.home.walls, x, y, goals[near])
    return shown


def spread(cells: I64, most: int) -> I64:
    """Return cells (n, 2) of a grid, the finest one that leaves no more than `most`."""
    pitch = 1
    kept = cells
    while len(kept) > most:
        pitch += 1
        kept = cells[(cells[:, 0] % pitch == pitch // 2) & (cells[:, 1] % pitch == pitch // 2)]
    return kept if len(kept) else cells[:: max(1, len(cells) // most)]


def centres(cells: I64) -> I64:
    """Return the centres [lattice] of cells (row, column): int64 (n, 2)."""
    return np.ascontiguousarray(cells[:, ::-1] * SUB + CELL_CENTRE)
