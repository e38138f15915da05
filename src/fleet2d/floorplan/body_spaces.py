"""The spaces of bodies in a home, and whether furniture that is put into it cuts them in two."""

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.floorplan.home import lattice_footprints
from fleet2d.floorplan.mesh import GRID
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.space import BODY_RADIUS, body_octagon, grow_boxes, grow_polygons, shrink
from fleet2d.kernels import I64, add_obstacles, wall_obstacles

THIN_RADIUS = 0.1
"""The radius of the thinnest body whose routes furniture leaves open [m]."""
NARROW_RADII = (0.225, 0.2, 0.175, 0.15, 0.125)
"""Radii between those two, which matter in homes with passages that not every body fits through."""
RADII = (BODY_RADIUS, *NARROW_RADII, THIN_RADIUS)
"""All of them: the bodies for which the finished home is checked [m]."""
CUT_OFF_M2 = 0.25
"""Furniture may cut off less than this of a body's space, such as a corner behind a bed [m²]."""


# By how much more than its radius a body's space is shrunk so that rounding can't make it smaller
# [lattice], and the part of `CUT_OFF_M2` that is less than it in any case.
ROUNDED = 8
CERTAIN = 0.75


class BodySpace:
    """The space of a body while a home is furnished room by room; it never changes.

    Most furniture cuts nothing, which shows in what it touches. So pieces are taken out of the
    space only when that is needed: then all at once.

    Attributes:
        radius: The body's radius [m].
    """

    def __init__(
        self,
        plan: FloorPlan,
        radius: float,
        obstacles: I64,
        parts: Sequence[Polygon],
        removed: tuple[I64, ...] = (),
    ) -> None:
        """Remember a space.

        Args:
            plan: The plan.
            radius: The body's radius [m].
            obstacles: What bars its ways, see `obstacles_among`.
            parts: Its outlines [lattice].
            removed: Pieces of furniture to be taken out of these, none of which cuts a part in two.
        """
        self.radius = radius
        self._plan = plan
        self._obstacles = obstacles
        self._parts = list(parts)
        self._removed = removed
        # Further by the rounding of a space, so that what is connected here is connected there.
        self._reach = radius * plan.lattice.units_per_m + GRID

    @property
    def parts(self) -> list[Polygon]:
        """Its outlines [lattice]."""
        if self._removed:
            grown = grow_boxes(np.concatenate(self._removed), self._reach)
            self._parts = _largest_pieces(self._parts, shapely.union_all(grown))
            self._removed = ()
        return self._parts

    def without(self, boxes: I64, kept: I64) -> "BodySpace | None":
        """Return the space among further pieces of furniture, or None if these cut a part in two.

        Args:
            boxes: The pieces, int64 (n, 4): least and greatest x and y [lattice].
            kept: Points that the space must not lose, int64 (n, 2) [lattice].
        """
        obstacles, cuts = add_obstacles(self._obstacles, boxes, *_octagon_sides(self._reach))
        x, y = kept.T
        if not cuts and not self._loses(boxes, x, y):
            removed = (*self._removed, boxes)
            return BodySpace(self._plan, self.radius, obstacles, self._parts, removed)
        blocked = shapely.union_all(grow_boxes(boxes, self._reach))
        for part in self.parts:
            if len(large_parts(self._plan, _pieces(part, blocked))) > 1:
                return None
        left = _largest_pieces(self.parts, blocked)
        before, after = (
            shapely.contains_xy(MultiPolygon(parts), x, y) for parts in (self.parts, left)
        )
        if (before & ~after).any():
            return None
        return BodySpace(self._plan, self.radius, obstacles, left)

    def _loses(self, boxes: I64, x: I64, y: I64) -> bool:
        """Return whether a body at one of some points would touch a piece of furniture."""
        if not len(x):
            return False
        grown = grow_boxes(boxes, self._reach)
        return bool(shapely.intersects_xy(grown[:, None], x, y).any())


def _largest_pieces(parts: Sequence[Polygon], without: BaseGeometry) -> list[Polygon]:
    """Return the largest piece of each polygon that lies outside of a shape, if there is one."""
    pieces = [_pieces(part, without) for part in parts]
    return [polygons[0] for polygons in pieces if polygons]


def body_spaces(plan: FloorPlan, widest: list[Polygon]) -> list[BodySpace]:
    """Return the spaces of bodies among the walls and objects of a plan, that of the widest first.

    Args:
        plan: The plan.
        widest: The space of a body of `BODY_RADIUS` between its walls.
    """
    solid = solid_footprints(plan, plan.objects)
    thin = exact_space(plan, solid, THIN_RADIUS)
    if solid:
        widest = exact_space(plan, solid, BODY_RADIUS)
    parts = {BODY_RADIUS: widest, THIN_RADIUS: thin}
    if _has_narrow_places(plan, widest, thin):
        parts |= {radius: exact_space(plan, solid, radius) for radius in NARROW_RADII}
    return [
        BodySpace(plan, radius, obstacles_among(plan, solid, radius), outlines)
        for radius, outlines in parts.items()
    ]


def solid_footprints(plan: FloorPlan, things: Iterable[PlacedObject]) -> list[Polygon]:
    """Return the footprints of the objects that bodies can't pass [lattice]."""
    return lattice_footprints(plan, [thing for thing in things if thing.blocks != "nothing"])


def exact_space(plan: FloorPlan, solid: Sequence[Polygon], radius: float) -> list[Polygon]:
    """Return the space of a body among footprints, exactly as `Space` computes it [lattice]."""
    reach = radius * plan.lattice.units_per_m
    return shrink(plan.polygons, reach, grow_polygons(solid, reach))


def stays_whole(plan: FloorPlan, solid: Sequence[Polygon], radii: Iterable[float]) -> bool:
    """Return whether no body has a space besides its largest one that furniture may not cut off.

    A fast check of homes whose walls and furniture are parallel to the axes: there a mitred buffer
    whose corners are cut is the space of an octagonal body, but for rounding. It is taken a little
    wider than that, so a passage counts only if it certainly is one.

    Args:
        plan: The home.
        solid: The footprints of the objects that bodies can't pass [lattice].
        radii: Those of the bodies [m].

    Returns:
        False also where this can't tell.
    """
    free = shapely.difference(MultiPolygon(plan.polygons), shapely.union_all(solid))
    rings = shapely.get_rings(shapely.get_parts(free))
    corners, ring_of = shapely.get_coordinates(rings, return_index=True)
    is_slanted = (corners[1:] != corners[:-1]).all(axis=1)
    if (is_slanted & (ring_of[1:] == ring_of[:-1])).any():
        return False
    unit = plan.lattice.units_per_m
    for radius in radii:
        space = free.buffer(-radius * unit - ROUNDED, join_style="mitre", mitre_limit=1.0)
        areas = shapely.area(shapely.get_parts(space))
        if not len(areas) or areas.sum() - areas.max() > CERTAIN * CUT_OFF_M2 * unit**2:
            return False
    return True


def cuts_nothing(plan: FloorPlan, solid: Sequence[Polygon], boxes: I64, radius: float) -> bool:
    """Return whether further furniture certainly cuts no part of a body's space in two.

    Args:
        plan: The plan.
        solid: The footprints in it [lattice].
        boxes: Further ones, int64 (n, 4): least and greatest x and y [lattice].
        radius: The body's radius [m].
    """
    sides = _octagon_sides(radius * plan.lattice.units_per_m)
    _, cuts = add_obstacles(obstacles_among(plan, solid, radius), boxes, *sides)
    return not cuts


def obstacles_among(plan: FloorPlan, solid: Sequence[Polygon], radius: float) -> I64:
    """Return what bars the ways of a body among walls and footprints, for `add_obstacles`."""
    rings = shapely.get_rings([*plan.polygons, *solid])
    corners, ring_of = shapely.get_coordinates(rings, return_index=True)
    sides = _octagon_sides(radius * plan.lattice.units_per_m)
    return wall_obstacles(corners.astype(np.int64), ring_of, *sides)


def _octagon_sides(reach: float) -> list[int]:
    """Return how far an octagon's straight sides are from its middle, and half their length."""
    sides: list[int] = body_octagon(reach)[0].tolist()
    return sides


def _has_narrow_places(plan: FloorPlan, widest: list[Polygon], thinnest: list[Polygon]) -> bool:
    """Return whether thin bodies get to places, or between places, where large ones don't."""
    wide = large_parts(plan, widest)
    thin = np.array(thinnest, np.object_)
    inside = np.asarray(shapely.point_on_surface(wide))
    if (shapely.contains(thin[:, None], inside).sum(axis=1) > 1).any():
        return True
    # The octagon of a body reaches up to 8 % farther than its radius.
    reach = (1.09 * BODY_RADIUS - THIN_RADIUS) * plan.lattice.units_per_m
    near = MultiPolygon(wide).buffer(reach, join_style="mitre")
    return any(large_parts(plan, _pieces(part, near)) for part in thin)


def _pieces(polygon: Polygon, without: BaseGeometry) -> list[Polygon]:
    """Return the pieces of a polygon that lie outside of a shape, the largest first."""
    if not polygon.intersects(without):
        return [polygon]
    pieces = shapely.get_parts(shapely.difference(polygon, without)).tolist()
    polygons = [piece for piece in pieces if piece.geom_type == "Polygon"]
    return sorted(polygons, key=lambda piece: -piece.area)


def large_parts(plan: FloorPlan, polygons: Sequence[Polygon]) -> list[Polygon]:
    """Return the polygons [lattice] that furniture may not cut off."""
    least = CUT_OFF_M2 * plan.lattice.units_per_m**2
    return [polygon for polygon in polygons if polygon.area >= least]
