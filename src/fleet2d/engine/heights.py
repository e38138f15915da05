"""Heights of cameras, bodies and furniture: a person behind a sofa is seen by the head."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle, islice
from typing import Any

import numpy as np
import shapely

from fleet2d.entities.behavior import Actor
from fleet2d.floorplan.furniture import FURNITURE
from fleet2d.floorplan.home import Home, lattice_footprint
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.kernels import I64, TURN, UNIT, Heights, cosine, in_radians, rounded, sine
from fleet2d.sight.camera import Camera

# The height of the head, the eyes and a robot's camera, as a share of a body's height; and those of
# the other points of a body, in turn.
HEAD = 15 / 16
AROUND = (3 / 4, 1 / 2, 1 / 4)
# The height of a seat [m], and of a sitting person above it, as a share of the body's height.
SEAT_M = 0.45
SITTING = 0.52
# The height of a lying person above the furniture [m].
LYING_M = 0.25
# Furniture with a seat in front of a back of full height, and the depth of the back [m].
WITH_BACK = {"sofa", "armchair"}
BACK_M = 0.25


class BodyHeights:
    """The heights of all bodies of a run, and of the furniture of its home.

    Attributes:
        tops: Heights of the bodies, each standing, sitting and lying: int64 (bodies, 3) [mm].
    """

    def __init__(self, actors: Sequence[Actor]) -> None:
        """Compute the heights of the bodies of a run."""
        tall = np.array([actor.entity.tall for actor in actors])
        postures = [tall, SEAT_M + SITTING * tall, np.minimum(LYING_M, tall)]
        self.tops = _millimetres(np.stack(postures, axis=1))
        self._furniture: tuple[object, Any] = (None, ())

    def levels(
        self, row: int, cameras: Iterable[Camera], others: slice, points: int
    ) -> tuple[I64, I64, I64]:
        """Return the heights of the cameras of a body, of the points that they look at, and `tops`.

        Args:
            row: The row of the body.
            cameras: Its cameras.
            others: The rows of the bodies that the cameras look at.
            points: Points of each body that are looked at, at most.
        """
        own = self.tops[row]
        mounted = [HEAD * own[0] if c.height is None else 1000 * c.height for c in cameras]
        around = islice(cycle(AROUND), points - 1)
        shares = np.array([HEAD, *around])
        looked_at = rounded(self.tops[others, :, None] * shares)
        eyes = rounded(np.outer(mounted, own / own[0]))
        by_camera = np.repeat(looked_at[None], len(mounted), axis=0)
        return eyes, by_camera, self.tops

    def with_furniture(self, levels: tuple[I64, I64, I64], home: Home) -> Heights:
        """Return the heights of `levels` with those of the present furniture."""
        if self._furniture[0] is not home.objects:
            self._furniture = home.objects, _stacked(home)
        return Heights(*levels, *self._furniture[1])


def _stacked(home: Home) -> tuple[I64, I64, I64, I64]:
    """Return corners, start, boxes and top of all furniture; see `fleet2d.kernels.Heights`."""
    prisms = [prism for thing in home.objects for prism in prisms_of(home, thing)]
    outlines = [outline for outline, _ in prisms]
    corners = np.concatenate([np.zeros((0, 2), np.int64), *outlines])
    starts = np.cumsum([0, *map(len, outlines)], dtype=np.int64)
    bounds = [(outline.min(axis=0), outline.max(axis=0)) for outline in outlines]
    heights = np.array([height for _, height in prisms])
    return corners, starts, np.array(bounds, np.int64).reshape(-1, 4), _millimetres(heights)


def prisms_of(home: Home, thing: PlacedObject) -> Iterator[tuple[I64, float]]:
    """Yield the parts of a piece of furniture that hide low things: outline and height [m].

    Outlines are int64 (corners, 2) [lattice units]. Furniture on legs hides nobody, and furniture
    that blocks sight is a wall already.
    """
    model = FURNITURE.get(thing.type)
    usual = model.height if model else 0.0
    height = usual if thing.height is None else thing.height
    if thing.blocks == "sight" or height == 0:
        return
    footprint = lattice_footprint(home.plan, thing)
    corners = _corners(footprint)
    if thing.type not in WITH_BACK or height <= SEAT_M:
        yield corners, height
        return
    yield corners, SEAT_M
    turn = round(thing.heading / float(in_radians(TURN)) * TURN) % TURN
    ahead = np.array([cosine(turn), sine(turn)])
    left = np.array([-sine(turn), cosine(turn)])
    forward = corners @ ahead // UNIT
    across = corners @ left // UNIT
    back = forward.min()
    depths = back - 1, back + round(BACK_M * home.lattice.units_per_m)
    sides = across.min() - 1, across.max() + 1
    box = [(depth * ahead + side * left) // UNIT for depth in depths for side in sides]
    behind = shapely.MultiPoint(box).convex_hull
    for part in shapely.get_parts(shapely.intersection(footprint, behind)):
        if isinstance(part, shapely.Polygon) and part.area > 0:
            yield _corners(part), height


def _corners(polygon: shapely.Polygon) -> I64:
    return rounded(polygon.exterior.coords[:-1])


def _millimetres(metres: np.ndarray) -> I64:
    return rounded(1000 * metres)
