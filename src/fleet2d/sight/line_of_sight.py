"""Lines of sight: every point is looked at by itself, and nothing is kept."""

from typing import TYPE_CHECKING

from fleet2d.component import register
from fleet2d.kernels.points import points_in_sight
from fleet2d.sight.fov import I64, Bool, FieldOfView

if TYPE_CHECKING:
    from fleet2d.floorplan.home.home import Home


@register("sight", "line_of_sight")
class LineOfSight(FieldOfView):
    """Follow the line to each point through the home; no cache.

    The default: robots look at a few people at a time from ever new places, and a line costs a
    twentieth of a microsecond, less than looking up what a cache would have to say.
    """

    def visible(self, home: "Home", x: int, y: int, points: I64) -> Bool:
        """Return which points a line of sight leads to."""
        return points_in_sight(home.walls, x, y, points)
