"""Drives: the position and heading of a robot on its route over time."""

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fleet2d.configuration.components import Component
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64, I64, TURN, heading_of, turn_between

# A route takes at most ten days, so that its poses can be interpolated in 64 bits [s].
MAX_DURATION_S = 864_000
# A moment this near to a corner of the route counts as at the corner [m].
NEAR_M = 1e-6


class Leg(NamedTuple):
    """A straight piece of a route.

    Attributes:
        length: Its length, above 0 [m].
        direction: The heading along it [1/4096 turn].
    """

    length: float
    direction: int


class Route(NamedTuple):
    """A route to drive, and the robot that is to drive it.

    Attributes:
        legs: Its straight pieces, in order.
        heading: The heading of the robot at its beginning [1/4096 turn].
        speed: The speed of the robot [m/s].
        turn_rate: Rate of turning on the spot [1/4096 turn per second].
    """

    legs: tuple[Leg, ...]
    heading: int
    speed: float
    turn_rate: float


class Moment(NamedTuple):
    """The position of a robot on its route at a moment.

    Attributes:
        seconds: Time since the beginning of the route [s].
        metres: Distance along the route [m].
        heading: Heading of the robot [1/4096 turn].
    """

    seconds: float
    metres: float
    heading: int


class Drive(Component):
    """The motion of a robot along its routes.

    A route is a row of straight legs, along which the body touches nothing. A drive has neither
    chance nor memory: the same route takes the same time again, in every run.

    Example:
        >>> from fleet2d import Drive, Moment, Route
        >>> class Glide(Drive):
        ...     '''Drives at half its speed, and never turns.'''
        ...     def moments(self, route: Route) -> list[Moment]:
        ...         length = sum(leg.length for leg in route.legs)
        ...         return [Moment(length / (route.speed / 2), length, route.heading)]
    """

    kind = "drive"

    @abstractmethod
    def moments(self, route: Route) -> Iterable[Moment]:
        """Return the moments at which the speed or rate of turning changes, in order.

        Between two moments the robot drives, and turns the shorter way, at constant rates. It
        begins at 0 s, at the beginning of the route, and has to be at the end at the last moment.
        It never goes back along the route.
        """

    def seconds(self, metres: F64, speed: float) -> F64:
        """Return the robot's estimates of the time to many places, without turns [s].

        Args:
            metres: Lengths of the ways, inf where there is none.
            speed: The speed of the robot [m/s].

        Returns:
            float64, of the same shape.
        """
        return metres / speed


def breakpoints(
    drive: Drive, points: I64, heading: int, rates: tuple[float, float], units_per_m: float
) -> I64:
    """Return the breakpoints of a robot on a route, without the state at its beginning.

    Args:
        drive: The drive of the robot.
        points: The route, int64 (n, 2) [lattice].
        heading: The heading at its beginning [1/4096 turn].
        rates: Its speed [lattice units per second] and its turn rate [1/4096 turn per second].
        units_per_m: Lattice units to a metre.

    Returns:
        Time since the beginning [us], x, y [lattice], heading, away (0); int64 (m, 5).

    Raises:
        ComponentError: The moments of the drive are not in order, or don't lead to the end.
    """
    corners = points[:1].tolist()
    ends = [0.0]
    legs = []
    for (ax, ay), (bx, by) in pairwise(points.tolist()):
        dx = bx - ax
        dy = by - ay
        if dx or dy:
            length = math.sqrt(dx * dx + dy * dy) / units_per_m
            legs.append(Leg(length, heading_of(dx, dy)))
            corners.append([bx, by])
            ends.append(ends[-1] + length)

    def row(moment: Moment, leg: int) -> tuple[int, ...]:
        ax, ay = corners[leg]
        bx, by = corners[leg + 1]
        is_at_end = abs(moment.metres - ends[leg + 1]) <= NEAR_M
        share = 1.0 if is_at_end else (moment.metres - ends[leg]) / legs[leg].length
        x = ax + round((bx - ax) * share)
        y = ay + round((by - ay) * share)
        return round(moment.seconds * 1e6), x, y, moment.heading % TURN, 0

    rows = []
    leg = 0
    last = Moment(0.0, 0.0, heading)
    route = Route(tuple(legs), heading, rates[0] / units_per_m, rates[1])
    for moment in _checked(drive, route, ends[-1]) if legs else ():
        while moment.metres > ends[leg + 1] + NEAR_M:
            if last.metres < ends[leg + 1] - NEAR_M:  # the drive gave no moment at this corner
                rows.append(row(_between(last, moment, ends[leg + 1]), leg))
            leg += 1
        rows.append(row(moment, leg))
        last = moment
    return np.array(rows, np.int64).reshape(-1, 5)


def estimate(drive: Drive, metres: F64, speed: float) -> F64:
    """Return the times [s] that a drive estimates for ways of some lengths.

    Args:
        drive: The drive of the robot.
        metres: The lengths, inf where there is no way.
        speed: The speed of the robot [m/s].

    Raises:
        ComponentError: The estimates are not as many times of 0 or more.
    """
    seconds = np.asarray(drive.seconds(metres, speed), np.float64)
    if seconds.shape != metres.shape or not (seconds >= 0).all():
        raise ComponentError(
            f"the drive {drive.type_name} estimated {seconds} s for ways of {metres} m: expected"
            f" times of 0 or more, of shape {metres.shape}"
        )
    return seconds


def _checked(drive: Drive, route: Route, length: float) -> Iterator[Moment]:
    """Yield the moments of a drive on a route of a length [m].

    Raises:
        ComponentError: The moments are not in order, or don't lead to the end.
    """
    last = Moment(0.0, 0.0, route.heading)
    for seconds, metres, heading in drive.moments(route):
        moment = Moment(seconds, metres, heading)
        if not (
            last.seconds <= seconds <= MAX_DURATION_S
            and last.metres - NEAR_M <= metres <= length + NEAR_M
            and isinstance(heading, int | np.integer)
        ):
            raise ComponentError(
                f"the drive {drive.type_name} returned {moment} after {last}, on a route of"
                f" {length:.6g} m: neither seconds (10 days at most) nor metres may fall, no moment"
                " may be past the end, and headings are whole numbers"
            )
        last = moment
        yield moment
    if last.metres < length - NEAR_M:
        raise ComponentError(
            f"the drive {drive.type_name} ended after {last.metres:.6g} m of a route of"
            f" {length:.6g} m: its last moment has to be at the end of the route"
        )


def _between(last: Moment, moment: Moment, metres: float) -> Moment:
    """Return the moment at which a robot passes a corner, between two others."""
    share = (metres - last.metres) / (moment.metres - last.metres)
    turn = turn_between(last.heading % TURN, moment.heading % TURN)
    seconds = last.seconds + (moment.seconds - last.seconds) * share
    return Moment(seconds, metres, last.heading + round(turn * share))


class Differential(Drive):
    """Turns on the spot towards each leg of its route, then drives straight, at constant rates."""

    def moments(self, route: Route) -> Iterator[Moment]:
        """Yield the ends of turns and legs; the core computes the same, see `time_route` there."""
        seconds = 0.0
        metres = 0.0
        heading = route.heading
        for leg in route.legs:
            turn = abs(turn_between(heading, leg.direction))
            heading = leg.direction
            if turn:
                seconds += turn / route.turn_rate
                yield Moment(seconds, metres, heading)
            lasts = 0.0
            for lasts, driven in self.straight(leg.length, route.speed):
                yield Moment(seconds + lasts, metres + driven, heading)
            seconds = seconds + lasts
            metres = metres + leg.length

    def straight(self, length: float, speed: float) -> Iterable[tuple[float, float]]:
        """Return times [s] and distances [m] at which the speed changes on a leg, and its end."""
        return [(length / speed, length)]
