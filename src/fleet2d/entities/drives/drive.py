"""The base of drives: when a robot is where on its route, and which way it faces."""

from abc import abstractmethod
from collections.abc import Iterable
from typing import ClassVar, NamedTuple

from fleet2d.component import Component
from fleet2d.kernels import F64


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
        turn_rate: How fast the robot turns on the spot [1/4096 turn per second].
    """

    legs: tuple[Leg, ...]
    heading: int
    speed: float
    turn_rate: float


class Moment(NamedTuple):
    """Where on its route a robot is at a moment.

    Attributes:
        seconds: Time since the beginning of the route [s].
        metres: How far along the route it is [m].
        heading: Its heading [1/4096 turn].
    """

    seconds: float
    metres: float
    heading: int


class Drive(Component):
    """How a robot moves along its routes.

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

    kind: ClassVar[str] = "drive"

    @abstractmethod
    def moments(self, route: Route) -> Iterable[Moment]:
        """Return where the robot is whenever its speed or its turning changes, in order of time.

        Between two moments it drives, and turns the shorter way, at constant rates. It begins at
        0 s, at the beginning of the route, and has to be at its end at the last moment. Of two
        moments, the later one is as far along the route or farther.
        """

    def seconds(self, metres: F64, speed: float) -> F64:
        """Return what the robot thinks that ways to many places take, without turns [s].

        Args:
            metres: Lengths of the ways, inf where there is none.
            speed: The speed of the robot [m/s].

        Returns:
            float64, of the same shape.
        """
        return metres / speed
