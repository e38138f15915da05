"""Shared parts of behaviors toward people: likely rooms, viewpoints, and approaches."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import points_at_distance
from fleet2d.entities.plan import Plan
from fleet2d.errors import ComponentError, ScenarioError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.plan import Room, cells_of
from fleet2d.kernels import CELL_CENTRE, F64, I64, SUB, Bool, heading_of, pairs_in_sight
from fleet2d.runtime.determinism import sum_in_order

ANYONE = "anyone"


class RoomBelief(NamedTuple):
    """Probabilities of where a person is.

    Attributes:
        share: Probability of each room, given that the person is at home, float64 (rooms,).
        away: Probability that the person is out of the home.
    """

    share: F64
    away: float

    @property
    def joint(self) -> F64:
        """Probability of each room, float64 (rooms,); sums to 1 - away."""
        return self.share * (1 - self.away)


class BeliefBehavior(Behavior):
    """Base of behaviors that depend on where a person is believed to be.

    Attributes:
        user: The user to look for or to be near, or anyone.
        source: The algorithm with probabilities of where people are; left out: the probability of a
            room is proportional to its area.
    """

    user: str = Field(default=ANYONE, min_length=1)
    source: str | None = None

    def about(self) -> tuple[str, ...]:
        """Return the user that the behavior depends on, if given by name."""
        return () if self.user == ANYONE else (self.user,)

    def reads(self) -> tuple[str, ...]:
        """Return the algorithm to read."""
        return () if self.source is None else (self.source,)

    def output(self, now: Situation) -> Any:
        """Return the output of the source, evaluated at the present time; None before the first."""
        output: Any = now.outputs.get(self.source) if self.source else None
        varies = callable(getattr(output, "at", None))
        return output.at(now.time) if varies else output

    def belief(self, now: Situation, user: str) -> RoomBelief:
        """Return the probabilities of where a user, or ANYONE, is now.

        The output of a presence algorithm is evaluated at the present time, for the user; any other
        output with a `share` per room holds for everybody. Without a source, and before its first
        output, the probability of a room is proportional to its area.

        Raises:
            ComponentError: The output has no probabilities of rooms.
        """
        output = self.output(now)
        if output is None:
            cells = np.array([room.cells for room in now.home.rooms], np.float64)
            return RoomBelief(cells / cells.sum(), 0.0)
        share: Any = getattr(output, "share", None)
        away: Any = getattr(output, "away", 0.0)
        if callable(share):
            share = share(user)
            away = away(user) if callable(away) else away
        rooms = len(now.home.rooms)
        if share is None or np.shape(share) != (rooms,):
            raise ComponentError(
                f"the output of {self.source!r} has no room probabilities: name a presence"
                f" algorithm, or one whose output is a RoomDistribution over the {rooms} rooms"
            )
        return RoomBelief(np.asarray(share, np.float64), float(away))


# At most this many cells of a room are tried as viewpoints, and as targets to be seen.
MAX_VIEWPOINT_CELLS = 48
MAX_TARGET_CELLS = 400


class Viewpoints(NamedTuple):
    """Points to look round from in a room.

    Attributes:
        points: Lattice points, first the one with the largest view.
        share: The part of the room in view from all of them together.
    """

    points: tuple[LatticePoint, ...]
    share: float


def sight_range(actor: Actor) -> float:
    """Return the range of the cameras of a body [lattice]; 0 without a camera."""
    ranges = [camera.range[1] for camera in actor.entity.eyes.values()]
    return max(ranges, default=0.0) * actor.home.lattice.units_per_m


def viewpoints_of(actor: Actor, room: Room, enough: float, most: int) -> Viewpoints:
    """Return the viewpoints of a room, chosen greedily: each adds as much to the view as possible.

    Walls and tall furniture count as they are at present.

    Args:
        actor: The robot.
        room: A room that it can enter.
        enough: The part of the room after which no more points are added.
        most: The maximum number of points.
    """
    home = actor.home
    body = actor.space, actor.part, sight_range(actor)
    key = "views", home.walls, *body, room.index, enough, most
    return home.cached(key, lambda: _choose_viewpoints(actor, room, enough, most))


def _choose_viewpoints(actor: Actor, room: Room, enough: float, most: int) -> Viewpoints:
    views = _cover(actor, room, floor_of(actor, room), enough, most)
    return views if views.points else Viewpoints((actor.middle(room),), 0.0)


def _cover(actor: Actor, room: Room, goals: I64, enough: float, most: int) -> Viewpoints:
    """Choose points in a room, greedily, from which goals (n, 2) are seen, and their share."""
    places = np.concatenate([[actor.middle(room)], stands_in(actor, room)])
    visible = visible_from(actor, places, goals)
    points: list[LatticePoint] = []
    unseen = np.ones(len(goals), np.bool_)
    while len(points) < most and unseen.sum() > (1 - enough) * len(goals):
        gains = (visible & unseen).sum(axis=1)
        best = int(np.argmax(gains))
        if not gains[best]:
            break
        x, y = places[best].tolist()
        points.append((x, y))
        unseen &= ~visible[best]
    share = 1 - float(unseen.sum()) / len(goals)
    return Viewpoints(tuple(points), share)


# The part of a room without furniture to be seen, and the maximum number of stops in a room.
FLOOR_TO_SEE = 0.95
MOST_STOPS = 4


def places_to_see(actor: Actor, room: Room) -> tuple[list[str], I64]:
    """Return the usual places of people in a room: at its furniture, else anywhere.

    Returns:
        The names of the furniture, of each point; and the points [lattice], int64 (n, 2). In a
        room without furniture that is used there are no names, and points all over the floor.
    """
    plan = actor.home.plan
    names = []
    places = []
    for thing in actor.home.objects:
        for use in thing.uses:
            if thing.type != "charger" and plan.room_at(*use.at) == plan.rooms[room.index]:
                names.append(thing.name)
                places.append(use.at)
    return names, plan.lattice.to_lattice(places) if names else floor_of(actor, room)


def stops_with_view(actor: Actor, room: Room) -> tuple[LatticePoint, ...]:
    """Return the stops in a room from which its places are seen: the middle first, if that helps.

    Walls and tall furniture count as they are at present.
    """
    names, goals = places_to_see(actor, room)
    enough = 1.0 if names else FLOOR_TO_SEE
    home = actor.home
    body = actor.space, actor.part, sight_range(actor)
    key = "stops", home.walls, home.objects, *body, room.index
    views = home.cached(key, lambda: _cover(actor, room, goals, enough, MOST_STOPS))
    return views.points or (actor.middle(room),)


def unwatched(actor: Actor, stops: Sequence[LatticePoint]) -> list[str]:
    """Describe the places that are never in view from some stops, by room.

    A line has the room, and its furniture that is out of view; or, of a room without furniture,
    the share of the floor, if it is more than half.
    """
    lines = []
    places = np.array(stops, np.int64).reshape(-1, 2)
    for room in actor.home.rooms:
        names, goals = places_to_see(actor, room)
        is_hidden = ~visible_from(actor, places, goals).any(axis=0)
        share = np.mean(is_hidden)
        if names and share > 0:
            things = dict.fromkeys(names[i] for i in np.flatnonzero(is_hidden))
            lines.append(f"{room.name} ({share:.0%} of its places: {', '.join(things)})")
        elif not names and share > 1 / 2:
            lines.append(f"{room.name} ({share:.0%} of its floor)")
    return lines


def visible_from(actor: Actor, places: I64, goals: I64) -> Bool:
    """Return which goals are in range and in sight of places, at any heading.

    Args:
        actor: The body with the cameras.
        places: Lattice points (n, 2).
        goals: Lattice points (m, 2).

    Returns:
        bool (n, m).
    """
    dx = places[:, :1] - goals[:, 0]
    dy = places[:, 1:] - goals[:, 1]
    visible = dx * dx + dy * dy <= sight_range(actor) ** 2
    place, goal = cells_of(visible).T
    visible[visible] = pairs_in_sight(actor.home.walls, places[place], goals[goal])
    return visible


def spread(cells: I64, most: int) -> I64:
    """Return the cells (row, column) on the finest square grid that has no more than `most`.

    The cells must be listed row by row, and are listed so again.
    """
    if len(cells) <= most:
        return cells
    rows, columns = cells.T
    pitch = 1
    is_cell = np.zeros((rows[-1] + 1, columns.max() + 1), np.bool_)
    is_cell[rows, columns] = True
    grid = is_cell
    while np.count_nonzero(grid) > most:
        pitch += 1
        grid = is_cell[pitch // 2 :: pitch, pitch // 2 :: pitch]
    on_grid = cells_of(grid) * pitch + pitch // 2
    return on_grid if len(on_grid) else cells[:: max(1, len(cells) // most)]


def stands_in(actor: Actor, room: Room) -> I64:
    """Return points of a room [lattice] where a body can stand, evenly spread, int64 (n, 2)."""
    cells = actor.space.cells(room.index, actor.part)
    return centres(spread(cells, MAX_VIEWPOINT_CELLS))


def floor_of(actor: Actor, room: Room) -> I64:
    """Return points of the floor of a room [lattice], evenly spread, int64 (n, 2)."""
    cells = cells_of(actor.home.plan.room_of_cell == room.index)
    return centres(spread(cells, MAX_TARGET_CELLS))


def centres(cells: I64) -> I64:
    """Return the centres [lattice] of cells (row, column), int64 (n, 2)."""
    return np.ascontiguousarray(cells[:, ::-1] * SUB + CELL_CENTRE)


# Number of directions from a person in which points at a distance are tried.
DIRECTIONS = 32


def way_seconds(actor: Actor, start: LatticePoint, goal: LatticePoint) -> float | None:
    """Return the driving time of a robot between two lattice points [s]; None: no way.

    The usual drive, `differential`, leaves out its turns; others begin in the direction of the way.
    """
    route = actor.space.route(start, goal)
    if route is None:
        return None
    if actor.drive is None:
        return sum_in_order(_legs(route)) / actor.speed
    (dx, dy), *_ = np.diff(route, axis=0).tolist() or [[0, 0]]
    rows = actor.breakpoints(route, 0, heading_of(dx, dy))
    return float(rows[-1, 0]) / 1e6 if len(rows) else 0.0


def spot_near(now: Situation, x: float, y: float, distance: float) -> LatticePoint:
    """Return the lattice point on the way to a person at which the robot is near enough.

    Args:
        now: The situation.
        x: Where the person is [m].
        y: Likewise.
        distance: Distance to keep, in a straight line [m].

    Returns:
        A point on the shortest way to the free place nearest to the person; the robot's position,
        if it is near enough already or there is no way.
    """
    actor = now.actor
    lattice = now.home.lattice
    position = actor.state.position
    person = lattice.point_at((x, y))
    goal = lattice.point_at(now.nearest_free(x, y))
    route = actor.space.route(position, goal)
    reach = distance * lattice.units_per_m
    if route is None or _distance(person, position) <= reach:
        return position
    for start, end in pairwise(route.tolist()):
        length = _distance(start, end)
        if _distance(person, start) - length > reach + 2:  # rounded points lie a little off the leg
            continue
        steps = max(1, int(length / (lattice.units_per_m / 20)))
        leg = np.subtract(end, start)
        points = start + leg * np.arange(1, steps + 1)[:, None] // steps
        gaps = points - person
        is_near = np.sqrt((gaps * gaps).sum(axis=1).astype(np.float64)) <= reach
        for x_at, y_at in points[is_near].tolist():
            if actor.space.part_at(x_at, y_at) == actor.part:
                return x_at, y_at
    return goal


def spot_back(now: Situation, x: float, y: float, distance: float) -> LatticePoint:
    """Return the nearest lattice point at a distance from a person.

    Args:
        now: The situation.
        x: Where the person is [m].
        y: Likewise.
        distance: The distance, in a straight line [m].

    Returns:
        A free point of the person's room at that distance; the robot's position, if it is at least
        as far away already or there is no such point.
    """
    actor = now.actor
    home = now.home
    lattice = home.lattice
    position = actor.state.position
    person = lattice.point_at((x, y))
    reach = math.ceil(distance * lattice.units_per_m)
    if _distance(person, position) >= reach:
        return position
    spots = points_at_distance(actor, person, reach, DIRECTIONS)
    return min(spots, key=lambda spot: _distance(spot, position), default=position)


def approach(now: Situation, plan: Plan, x: float, y: float, distance: float) -> Plan:
    """Drive to `spot_near` a person at (x, y) [m], unless the robot is already there."""
    spot = spot_near(now, x, y, distance)
    if spot != plan.position:
        plan.go_to_point(*spot)
    return plan


def is_in_rooms(now: Situation, x: float, y: float, rooms: frozenset[int]) -> bool:
    """Return whether a point [m] is in one of some rooms."""
    room = now.home.plan.room_at(x, y) if rooms else None
    return room is not None and room.index in rooms


def check_has_camera(actor: Actor, behavior: str) -> None:
    """Refuse a behavior that needs a camera, for a body without one.

    Raises:
        ScenarioError: The body has no camera.
    """
    if not actor.entity.eyes:
        raise ScenarioError(
            f"{actor.path}: {behavior} depends on what the robot sees, but it has no camera: give"
            " it one, like camera: {range: [0.3, 4.5], angle_deg: 108}, or leave the behavior out"
        )


def _legs(route: I64) -> list[float]:
    """Return the lengths of the legs of a route [lattice]."""
    # A route has few legs, for which numbers of Python are faster than arrays.
    return [_distance(start, end) for start, end in pairwise(route.tolist())]


def _distance(one: Sequence[int], other: Sequence[int]) -> float:
    dx = other[0] - one[0]
    dy = other[1] - one[1]
    return math.sqrt(dx * dx + dy * dy)
