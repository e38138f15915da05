"""Lines of sight: every point is tested by itself, without a cache."""

from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64, Bool, points_in_sight
from fleet2d.sight.fov import FieldOfView


@register("sight", "line_of_sight")
class LineOfSight(FieldOfView):
    """Follow the line to each point through the home, without a cache.

    This is the default: robots look at a few people at a time from ever new places, and a line
    costs a twentieth of a microsecond, less than a lookup in a cache.
    """

    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points have a line of sight to (x, y)."""
        return points_in_sight(home.walls, x, y, points)
