"""Viewpoints: where in a room to look round from, so that little of it stays out of view."""

from typing import NamedTuple

import numpy as np

from fleet2d.entities.actor import Actor
from fleet2d.floorplan.plan import Room
from fleet2d.kernels import I64, Bool
from fleet2d.kernels.sight import points_in_sight
from fleet2d.kernels.space import CELL_CENTRE, SUB

# The most cells of a room that are tried as viewpoints, and as targets to be seen, evenly spread.
STANDS_TRIED = 48
TARGETS_TRIED = 400


class Viewpoints(NamedTuple):
    """Points to look round from in a room.

    Attributes:
        points: Lattice points, the one that shows most first.
        share: The part of the room that they show together.
    """

    points: tuple[tuple[int, int], ...]
    share: float


def sight_range(actor: Actor) -> float:
    """Return how far the cameras of a body see [lattice]; 0 without a camera."""
    ranges = [camera.range[1] for camera in actor.entity.eyes.values()]
    return max(ranges, default=0.0) * actor.home.plan.lattice.units_per_m


def viewpoints_of(actor: Actor, room: Room, enough: float, most: int) -> Viewpoints:
    """Return the viewpoints of a room, chosen greedily: each adds as much to the view as possible.

    Walls and tall furniture count as they are at present.

    Args:
        actor: The robot.
        room: A room that it can enter.
        enough: The part of the room after which no more points are added.
        most: The most points.
    """
    home, space = actor.home, actor.space
    key = "views", home.walls, space, actor.part, sight_range(actor), room.index, enough, most
    return home.cached(key, lambda: _choose_viewpoints(actor, room, enough, most))


def _choose_viewpoints(actor: Actor, room: Room, enough: float, most: int) -> Viewpoints:
    plan = actor.home.plan
    stands = spread(actor.space.cells(room.index, actor.part), STANDS_TRIED)
    targets = spread(np.argwhere(plan.room_of_cell == room.index), TARGETS_TRIED)
    places = np.concatenate([[actor.middle(room)], centres(stands)])
    goals = centres(targets)
    visible = np.array([visible_from(actor, place, goals) for place in places])
    points: list[tuple[int, int]] = []
    unseen = np.ones(len(goals), np.bool_)
    while len(points) < most and unseen.sum() > (1 - enough) * len(goals):
        gains = (visible & unseen).sum(axis=1)
        best = int(np.argmax(gains))
        if not gains[best]:
            break
        points.append((int(places[best, 0]), int(places[best, 1])))
        unseen &= ~visible[best]
    if not points:
        return Viewpoints((actor.middle(room),), 0.0)
    return Viewpoints(tuple(points), 1 - float(unseen.sum()) / len(goals))


def visible_from(actor: Actor, place: I64, goals: I64) -> Bool:
    """Return which goals (n, 2) are in range and in sight of a place, at any heading, bool (n,)."""
    near = ((goals - place) ** 2).sum(axis=1) <= sight_range(actor) ** 2
    visible = np.zeros(len(goals), np.bool_)
    x, y = int(place[0]), int(place[1])
    visible[near] = points_in_sight(actor.home.walls, x, y, goals[near])
    return visible


def spread(cells: I64, most: int) -> I64:
    """Return the cells (row, column) on the finest square grid that has no more than `most`."""
    pitch = 1
    on_grid = cells
    while len(on_grid) > most:
        pitch += 1
        on_grid = cells[(cells[:, 0] % pitch == pitch // 2) & (cells[:, 1] % pitch == pitch // 2)]
    return on_grid if len(on_grid) else cells[:: max(1, len(cells) // most)]


def centres(cells: I64) -> I64:
    """Return the centres [lattice] of cells (row, column), int64 (n, 2)."""
    return np.ascontiguousarray(cells[:, ::-1] * SUB + CELL_CENTRE)
