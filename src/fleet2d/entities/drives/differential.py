"""The usual drive of robots: two wheels, which turn the robot on the spot."""

from collections.abc import Iterable, Iterator

from fleet2d.configuration.components import register
from fleet2d.entities.drives.drive import Drive, Moment, Route
from fleet2d.kernels import turn_between


@register("drive", "differential")
class Differential(Drive):
    """Turns on the spot towards each leg of its route, then drives straight, at constant rates."""

    def moments(self, route: Route) -> Iterator[Moment]:
        """Yield the ends of turns and legs; the core computes the same, see `time_route` there."""
        seconds, metres, heading = 0.0, 0.0, route.heading
        for leg in route.legs:
            turn = abs(turn_between(heading, leg.direction))
            heading = leg.direction
            if turn:
                seconds += turn / route.turn_rate
                yield Moment(seconds, metres, heading)
            lasts = 0.0
            for lasts, driven in self.straight(leg.length, route.speed):
                yield Moment(seconds + lasts, metres + driven, heading)
            seconds, metres = seconds + lasts, metres + leg.length

    def straight(self, length: float, speed: float) -> Iterable[tuple[float, float]]:
        """Return times [s] and distances [m] at which the speed changes on a leg, and its end."""
        return [(length / speed, length)]
