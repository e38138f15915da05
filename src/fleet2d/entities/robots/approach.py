"""Approaching people: how long a robot drives, where it stops, and how it keeps a distance."""

import math
from datetime import timedelta

import numpy as np

from fleet2d.entities.actor import Actor
from fleet2d.entities.behavior import Situation
from fleet2d.entities.nearby import points_at_distance
from fleet2d.entities.plan import Plan
from fleet2d.errors import ScenarioError
from fleet2d.kernels import I64
from fleet2d.kernels.numbers import TURN, heading_of, turn_between
from fleet2d.sums import sum_in_order

# Time after which a robot tries again to pass a shut door.
AT_A_DOOR = timedelta(seconds=10)
# Number of directions from a person in which points at a distance are tried.
DIRECTIONS = 32

LatticePoint = tuple[int, int]


def way_seconds(actor: Actor, start: LatticePoint, goal: LatticePoint) -> float | None:
    """Return how long a robot drives between two lattice points; None: no way.

    The usual drive, `differential`, leaves out its turns; others begin in the direction of the way.
    """
    route = actor.space.route(start, goal)
    if route is None or actor.drive is None:
        return None if route is None else sum_in_order(_legs(route)) / actor.speed
    rows = actor.breakpoints(route, 0, _first_heading(route))
    return float(rows[-1, 0]) / 1e6 if len(rows) else 0.0


def spot_near(now: Situation, x: float, y: float, distance: float) -> LatticePoint:
    """Return the lattice point on the way to a person at which the robot is near enough.

    Args:
        now: The situation.
        x: Where the person is [m].
        y: Likewise.
        distance: How near it comes, in a straight line [m].

    Returns:
        A point on the shortest way to the free place nearest to the person; the robot's position,
        if it is near enough already or there is no way.
    """
    actor, lattice = now.actor, now.home.plan.lattice
    position = (actor.state.x, actor.state.y)
    person = lattice.to_lattice((x, y))
    goal = lattice.point_at(now.nearest_free(x, y))
    route = actor.space.route(position, (goal[0], goal[1]))
    reach = distance * lattice.units_per_m
    if route is None or _distance(person, position) <= reach:
        return position
    for start, end, length in zip(route[:-1], route[1:], _legs(route), strict=True):
        steps = max(1, int(length / (lattice.units_per_m / 20)))
        for k in range(1, steps + 1):
            point = start + (end - start) * k // steps
            if _distance(person, point) <= reach and _is_free(actor, point):
                return int(point[0]), int(point[1])
    return int(goal[0]), int(goal[1])


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
    actor, home = now.actor, now.home
    lattice, position = home.plan.lattice, (actor.state.x, actor.state.y)
    person = lattice.point_at((x, y))
    reach = math.ceil(distance * lattice.units_per_m)
    if _distance(person, position) >= reach:
        return position
    spots = points_at_distance(actor, person, reach, DIRECTIONS)
    return min(spots, key=lambda spot: _distance(spot, position), default=position)


def approach(now: Situation, plan: Plan, x: float, y: float, distance: float) -> Plan:
    """Drive to `spot_near` a person at (x, y) [m], unless the robot is already there."""
    spot = spot_near(now, x, y, distance)
    if spot != (plan.x, plan.y):
        plan.go_to_point(*spot)
    return plan


def face(plan: Plan, x: int, y: int) -> Plan:
    """Turn towards a lattice point."""
    heading = int(heading_of(x - plan.x, y - plan.y))
    return plan.turn_by(turn_between(plan.heading, heading) / TURN)


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


def _is_free(actor: Actor, point: I64) -> bool:
    return actor.space.part_at(int(point[0]), int(point[1])) == actor.part


def _first_heading(route: I64) -> int:
    """Return the direction of the first leg of a route [1/4096 turn]."""
    (dx, dy), *_ = np.diff(route, axis=0).tolist() or [[0, 0]]
    return heading_of(dx, dy)


def _legs(route: I64) -> list[float]:
    """Return the lengths of the legs of a route [lattice]."""
    legs = np.diff(route, axis=0)
    return np.sqrt((legs * legs).sum(axis=1).astype(np.float64)).tolist()


def _distance(one: object, other: object) -> float:
    gap = np.asarray(one, np.int64) - np.asarray(other, np.int64)
    return float(np.sqrt(np.float64((gap * gap).sum())))
