"""Ways of a robot: how long they take, and where one to a person ends."""

import math
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fleet2d.entities.behavior import Situation
from fleet2d.errors import ScenarioError
from fleet2d.kernels.headings import TURN, UNIT, cosine, heading_of, sine, turn_between

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.plan import Plan

# Where a shut door is in the way, it tries again after so long.
AT_A_DOOR = timedelta(seconds=10)
# Places about a person that are tried to keep a distance.
DIRECTIONS = 32

Spot = tuple[int, int]


def way_seconds(actor: "Actor", start: Spot, goal: Spot) -> float | None:
    """Return how long a robot drives from a lattice point to another, turns apart; None: no way."""
    route = actor.space.route(start, goal)
    return None if route is None else sum(_legs(route)) / actor.speed


def spot_near(now: Situation, x: float, y: float, distance: float) -> Spot:
    """Return the lattice point on the way to a person at which the robot is near enough.

    Args:
        now: The situation.
        x: Where the person is [m].
        y: Where the person is [m].
        distance: How near it comes [m], as the crow flies.

    Returns:
        A point on the shortest way to the free place nearest to the person; where the robot is, if
        it is near enough already or there is no way.
    """
    actor, lattice = now.actor, now.home.plan.lattice
    here = (actor.state.x, actor.state.y)
    person = lattice.to_lattice((x, y))
    goal = lattice.point_at(now.nearest_free(x, y))
    route = actor.space.route(here, (goal[0], goal[1]))
    reach = distance * lattice.units_per_m
    if route is None or _distance(person, here) <= reach:
        return here
    for start, end, length in zip(route[:-1], route[1:], _legs(route), strict=True):
        steps = max(1, int(length / (lattice.units_per_m / 20)))
        for k in range(1, steps + 1):
            point = start + (end - start) * k // steps
            if _distance(person, point) <= reach and _is_free(actor, point):
                return int(point[0]), int(point[1])
    return int(goal[0]), int(goal[1])


def spot_back(now: Situation, x: float, y: float, distance: float) -> Spot:
    """Return the nearest lattice point from which a robot keeps a distance to a person.

    Args:
        now: The situation.
        x: Where the person is [m].
        y: Where the person is [m].
        distance: How far to keep [m], as the crow flies.

    Returns:
        A free point of the person's room at that distance; where the robot is, if it is no nearer
        or there is no such point.
    """
    actor, home = now.actor, now.home
    lattice, here = home.plan.lattice, (actor.state.x, actor.state.y)
    person = lattice.point_at((x, y))
    reach = math.ceil(distance * lattice.units_per_m)
    if _distance(person, here) >= reach:
        return here
    room, spots = home.plan.room_at(x, y), []
    for i in range(DIRECTIONS):
        heading = i * TURN // DIRECTIONS
        spot = (
            person[0] + reach * cosine(heading) // UNIT,
            person[1] + reach * sine(heading) // UNIT,
        )
        in_room = home.plan.room_at(*lattice.to_metres(spot).tolist()) == room
        if in_room and _is_free(actor, np.array(spot)):
            spots.append(spot)
    return min(spots, key=lambda spot: _distance(spot, here), default=here)


def approach(now: Situation, plan: "Plan", x: float, y: float, distance: float) -> "Plan":
    """Drive to near a person at (x, y) [m], as `spot_near` says, if it isn't there already."""
    spot = spot_near(now, x, y, distance)
    if spot != (plan.x, plan.y):  # where it was broken off it may touch the border of its space
        plan.go_to_point(*spot)
    return plan


def face(plan: "Plan", x: int, y: int) -> "Plan":
    """Turn towards a lattice point."""
    heading = int(heading_of(x - plan.x, y - plan.y))
    return plan.turn_by(turn_between(plan.heading, heading) / TURN)


def check_has_camera(actor: "Actor", behavior: str) -> None:
    """Refuse a behavior that goes by what is seen, for a body that sees nothing.

    Raises:
        ScenarioError: The body has no camera.
    """
    if not actor.entity.eyes:
        raise ScenarioError(
            f"{actor.path}: {behavior} goes by what the robot sees, but it has no camera: give it"
            " one, like camera: {range: [0.3, 4.5], angle_deg: 108}, or leave the behavior out"
        )


def _is_free(actor: "Actor", point: NDArray[np.int64]) -> bool:
    return actor.space.part_at(int(point[0]), int(point[1])) == actor.part


def _legs(route: NDArray[np.int64]) -> list[float]:
    legs = np.diff(route, axis=0)
    lengths: list[float] = np.sqrt((legs * legs).sum(axis=1).astype(np.float64)).tolist()
    return lengths


def _distance(one: object, other: object) -> float:
    gap = np.asarray(one, np.int64) - np.asarray(other, np.int64)
    return float(np.sqrt(np.float64((gap * gap).sum())))
