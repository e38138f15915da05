"""Robots that can drive in any direction, such as those with omnidirectional wheels."""

from collections.abc import Iterator

from fleet2d.configuration.components import register
from fleet2d.entities.drives.drive import Drive, Moment, Route
from fleet2d.kernels import turn_between


@register("drive", "holonomic")
class Holonomic(Drive):
    """Drives in any direction at constant speed, without stopping to turn.

    Attributes:
        turns: Whether it turns towards its way while it drives; else it keeps its heading.
    """

    turns: bool = True

    def moments(self, route: Route) -> Iterator[Moment]:
        """Yield the ends of legs, and of the turns on them."""
        seconds, metres, heading = 0.0, 0.0, route.heading
        for leg in route.legs:
            lasts = leg.length / route.speed
            turn = turn_between(heading, leg.direction) if self.turns else 0
            turning = abs(turn) / route.turn_rate
            if 0 < turning < lasts:
                heading = leg.direction
                yield Moment(seconds + turning, metres + turning * route.speed, heading)
            elif turning:  # the leg is too short to turn all the way
                heading += round(turn * (lasts / turning))
            seconds, metres = seconds + lasts, metres + leg.length
            yield Moment(seconds, metres, heading)
