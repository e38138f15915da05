"""Passages of doors through walls, and the borders along which rooms touch, in drawn homes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiLineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.floorplan.placed_objects import Point
from fleet2d.kernels import F64

TOUCH_M = 0.02
"""Outlines no further apart than this touch, as coordinates are rounded (degrees to 1 cm)."""
BORDER_M = 0.032
"""Sides of two rooms no further apart, and that overlap no more, touch: so inexact are drawings."""
MAX_WALL_M = 0.6
"""Largest thickness of a wall."""
NEAR_M = 0.25
"""Largest distance of a door from the wall that it is in."""

# Places along a door's width, as shares of it, at which the wall is measured; the first decides.
_ALONG = (0.5, 0.1, 0.9)
_PANE_OVER = 0.01  # how far glass reaches into the space on either side, to be joined to it [m]
_OVER = 1e-3  # how far an opening reaches into the space on either side, to be joined to it [m]


@dataclass(frozen=True)
class Passage:
    """A door's passage through a wall.

    Attributes:
        start: One end of the door as drawn (x, y) [m].
        end: The other end [m].
        low: Offset of the wall's near face from the door, to the left [m]; negative: to the right.
        high: Offset of its far face [m].
        through: Whether both sides have free space; else only the side beyond `low` has or, if
            that is minus infinity, the side beyond `high`.
    """

    start: Point
    end: Point
    low: float
    high: float
    through: bool

    @property
    def line(self) -> tuple[Point, Point]:
        """The door, moved into the middle of the wall."""
        return self._beside((self.low + self.high) / 2)

    @property
    def opening(self) -> Polygon:
        """The part of the wall that is opened."""
        return self._between(self.low - _OVER, self.high + _OVER)

    @property
    def thresholds(self) -> MultiLineString:
        """The lines just before and behind the wall; both are free where nothing is in the way."""
        a, b, c, d, _ = self.opening.exterior.coords
        return MultiLineString([(a, b), (c, d)])

    @property
    def pane(self) -> Polygon:
        """The part of the wall that glass fills, and a centimetre of the space on either side."""
        return self._between(self.low - _PANE_OVER, self.high + _PANE_OVER)

    @property
    def halves(self) -> tuple[Polygon, ...]:
        """The opened part of the wall, split along its middle in two; none without a wall."""
        middle = (self.low + self.high) / 2
        if self.high - self.low < _OVER:
            return ()
        return self._between(self.low, middle), self._between(middle, self.high)

    def inside(self, depth: float) -> Point:
        """Return the place at a depth [m] inside a door that leads outside (x, y) [m]."""
        at = self.high + depth if self.low == -np.inf else self.low - depth
        (x0, y0), (x1, y1) = self._beside(at)
        return (x0 + x1) / 2, (y0 + y1) / 2

    def _between(self, low: float, high: float) -> Polygon:
        a, b = self._beside(low)
        d, c = self._beside(high)
        return Polygon([a, b, c, d])

    def _beside(self, offset: float) -> tuple[Point, Point]:
        start = np.array(self.start)
        end = np.array(self.end)
        shift = offset * _normal(start, end)
        x0, y0 = (start + shift).tolist()
        x1, y1 = (end + shift).tolist()
        return (x0, y0), (x1, y1)


def door_axes(shape: BaseGeometry) -> Iterator[list[tuple[Point, Point]]]:
    """Yield the possible lines of each door in a shape: of an area its axes, the longer first."""
    for part in shapely.get_parts(shape).tolist():
        corners = shapely.get_coordinates(part)
        if part.geom_type == "LineString":
            yield [_ends(corners[0], corners[-1])]
        elif part.geom_type == "Polygon":
            sides = np.diff(corners, axis=0)
            along = sides[np.argmax((sides**2).sum(axis=1))]
            along = along / np.sqrt(along @ along)
            yield _middle_lines(corners, along)


def find_passage(free: MultiPolygon, start: Point, end: Point) -> Passage | None:
    """Return the passage of a door through the nearest wall, or None without a way through.

    Where no wall is near, in open space, the passage has no depth.
    """
    first = np.array(start)
    last = np.array(end)
    if not ((last - first) ** 2).sum() > 0:
        return None
    normal = _normal(first, last)
    # Only what is near matters, and a home may have a hundred rooms.
    low_xy = np.minimum(first, last) - 2 * MAX_WALL_M
    high_xy = np.maximum(first, last) + 2 * MAX_WALL_M
    near_free = shapely.clip_by_rect(free, *low_xy, *high_xy)
    spans: list[tuple[float, float]] = []
    for share in _ALONG:
        walls = _walls_across(near_free, first + share * (last - first), normal)
        near = [wall for wall in walls if max(wall[0], -wall[1]) <= NEAR_M]
        inner = [wall for wall in near if np.isfinite(wall).all()]
        if share == _ALONG[0]:
            one_sided = [wall for wall in near if np.isfinite(wall).any()]
            if not near:
                return Passage(start, end, 0.0, 0.0, True)
            if not inner:
                return Passage(start, end, *one_sided[0], False) if one_sided else None
        if inner:
            spans.append(min(inner, key=lambda wall: max(wall[0], -wall[1])))
    low = min(low for low, _ in spans)
    high = max(high for _, high in spans)
    return Passage(start, end, low, high, True)


def spans_free_space(free: MultiPolygon, start: Point, end: Point) -> bool:
    """Return whether a door stands in free space from wall to wall."""
    middle = LineString([start, end]).centroid
    jambs = shapely.points([start, end])
    walls = free.boundary
    at_walls = bool((shapely.distance(walls, jambs) <= TOUCH_M).all())
    return at_walls and bool(free.contains(middle)) and walls.distance(middle) > TOUCH_M


def shared_borders(rooms: Sequence[MultiPolygon]) -> list[LineString]:
    """Return the lines along which rooms touch one another, side by side, but for noise."""
    borders: list[BaseGeometry] = []
    tree = shapely.STRtree(rooms)
    pairs = tree.query(rooms, predicate="dwithin", distance=BORDER_M)
    for one, other in sorted((int(i), int(k)) for i, k in pairs.T if i < k):
        near = (
            rooms[other]
            .buffer(BORDER_M, join_style="mitre")
            .difference(rooms[other].buffer(-BORDER_M, join_style="mitre"))
        )
        sides = _sides(rooms[one])
        pieces = shapely.intersection(sides, near)
        lengths = shapely.length(pieces)
        most = 2 * BORDER_M
        # The first centimetres of a side that leads away from the border are near it, too.
        along = (lengths > most) | ((lengths > 0) & (lengths >= shapely.length(sides) / 2))
        parts = shapely.get_parts(pieces[along])
        lines = parts[shapely.get_type_id(parts) == shapely.GeometryType.LINESTRING]
        borders += shapely.get_parts(shapely.line_merge(shapely.multilinestrings(lines))).tolist()
    return [line for line in borders if isinstance(line, LineString) and line.length > 0]


def _sides(area: MultiPolygon) -> NDArray[np.object_]:
    """Return the sides of an area, each a line."""
    rings = shapely.get_parts(shapely.boundary(area)).tolist()
    outlines = [shapely.get_coordinates(ring) for ring in rings]
    starts = np.concatenate([outline[:-1] for outline in outlines])
    ends = np.concatenate([outline[1:] for outline in outlines])
    return np.asarray(shapely.linestrings(np.stack([starts, ends], axis=1)))


def _walls_across(free: BaseGeometry, at: F64, normal: F64) -> list[tuple[float, float]]:
    """Return the walls on a line across a door, from and to [m]; infinite at the line's ends."""
    across = LineString([at - MAX_WALL_M * normal, at + MAX_WALL_M * normal])
    walls = []
    for part in shapely.get_parts(across.difference(free)).tolist():
        if part.is_empty:
            continue
        offsets = (shapely.get_coordinates(part) - at) @ normal
        low = float(offsets.min())
        high = float(offsets.max())
        low = -np.inf if low < _OVER - MAX_WALL_M else low
        high = np.inf if high > MAX_WALL_M - _OVER else high
        if high > low:
            walls.append((low, high))
    return walls


def _middle_lines(corners: F64, along: F64) -> list[tuple[Point, Point]]:
    """Return the middle lines of an area along a direction and across it, the longer first."""
    middle_lines = []
    axes = (along, np.array([-along[1], along[0]]))
    spans = [(float((corners @ axis).min()), float((corners @ axis).max())) for axis in axes]
    for number, axis in enumerate(axes):
        low, high = spans[number]
        left, right = spans[1 - number]
        aside = (left + right) / 2 * axes[1 - number]
        middle_lines.append((high - low, _ends(low * axis + aside, high * axis + aside)))
    return [line for _, line in sorted(middle_lines, key=lambda pair: -pair[0])]


def _normal(start: F64, end: F64) -> F64:
    along = end - start
    return np.array([-along[1], along[0]]) / np.sqrt(along @ along)


def _ends(start: F64, end: F64) -> tuple[Point, Point]:
    x0, y0 = start.tolist()
    x1, y1 = end.tolist()
    return (x0, y0), (x1, y1)
