"""The spaces of bodies in a home, and whether furniture that is put into it cuts them in two."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.floorplan.home import lattice_footprint
from fleet2d.floorplan.lattice import UNITS_PER_CELL
from fleet2d.floorplan.mesh import GRID
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.space import BODY_RADIUS, Window, grow_boxes, grow_polygons, shrink
from fleet2d.kernels import I64

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

    Most furniture cuts nothing, which the surroundings of its room show. So shapes are taken out of
    the whole space only when that is needed: then all at once.

    Attributes:
        radius: The body's radius [m].
    """

    def __init__(
        self,
        plan: FloorPlan,
        radius: float,
        parts: Sequence[Polygon],
        removed: tuple[BaseGeometry, ...] = (),
        near: "_NearSpace | None" = None,
    ) -> None:
        """Remember a space.

        Args:
            plan: The plan.
            radius: The body's radius [m].
            parts: Its outlines [lattice].
            removed: Shapes that are not in it, none of which cuts a part in two [lattice].
            near: The part of it around the room that was last furnished, if known.
        """
        self.radius = radius
        self._plan = plan
        self._parts = list(parts)
        self._removed = removed
        self._near = near

    @property
    def parts(self) -> list[Polygon]:
        """Its outlines [lattice]."""
        if self._removed:
            self._parts = _largest_pieces(self._parts, shapely.union_all(self._removed))
            self._removed = ()
        return self._parts

    def without(self, boxes: I64, window: Window, kept: I64) -> "BodySpace | None":
        """Return the space among further pieces of furniture, or None if these cut a part in two.

        Args:
            boxes: The pieces, int64 (n, 4): least and greatest x and y [lattice].
            window: Rows and columns around the room that they are in.
            kept: Points that the space must not lose, int64 (n, 2) [lattice].
        """
        # Further by the rounding of a space, so that what is connected here is connected there.
        reach = self.radius * self._plan.lattice.units_per_m + GRID
        grown = grow_boxes(boxes, reach)
        blocked = grown[0] if len(grown) == 1 else shapely.union_all(grown)
        x, y = kept.T
        if self._near is None or self._near.window != window:
            self._near = self._clipped(window)
        pieces = [_pieces(polygon, blocked) for polygon in self._near.polygons]
        leads_round = all(len(polygons) == 1 for polygons in pieces)
        if leads_round and not shapely.intersects_xy(blocked, x, y).any():
            near = _NearSpace(window, [polygon for (polygon,) in pieces])
            removed = (*self._removed, blocked)
            return BodySpace(self._plan, self.radius, self._parts, removed, near)
        for part in self.parts:
            if len(large_parts(self._plan, _pieces(part, blocked))) > 1:
                return None
        left = _largest_pieces(self.parts, blocked)
        before, after = (
            shapely.contains_xy(MultiPolygon(parts), x, y) for parts in (self.parts, left)
        )
        return None if (before & ~after).any() else BodySpace(self._plan, self.radius, left)

    def _clipped(self, window: Window) -> "_NearSpace":
        """Return the part of the space within some rows and columns."""
        rows, columns = window
        ends = (columns.start, rows.start, columns.stop, rows.stop)
        frame = [end * UNITS_PER_CELL for end in ends]
        inside = shapely.clip_by_rect(self._parts, *frame)
        removed = np.array(self._removed, np.object_)
        removed = removed[shapely.intersects(removed, shapely.box(*frame))]
        if len(removed):
            inside = shapely.difference(inside, shapely.union_all(removed))
        parts = shapely.get_parts(inside).tolist()
        return _NearSpace(window, [part for part in parts if part.geom_type == "Polygon"])


class _NearSpace(NamedTuple):
    """The part of a space around a room.

    Attributes:
        window: Rows and columns.
        polygons: The outlines of the space within them [lattice].
    """

    window: Window
    polygons: list[Polygon]


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
    return [BodySpace(plan, radius, outlines) for radius, outlines in parts.items()]


def solid_footprints(plan: FloorPlan, things: Iterable[PlacedObject]) -> list[Polygon]:
    """Return the footprints of the objects that bodies can't pass [lattice]."""
    return [lattice_footprint(plan, thing) for thing in things if thing.blocks != "nothing"]


def exact_space(plan: FloorPlan, solid: Sequence[Polygon], radius: float) -> list[Polygon]:
    """Return the space of a body among footprints, exactly as `Space` computes it [lattice]."""
    reach = radius * plan.lattice.units_per_m
    return shrink(plan.polygons, reach, grow_polygons(solid, reach))


def stays_whole(plan: FloorPlan, solid: Sequence[Polygon]) -> bool:
    """Return whether no body has a space besides its largest one that furniture may not cut off.

    A fast check of homes whose walls and furniture are parallel to the axes: there a mitred buffer
    whose corners are cut is the space of an octagonal body, but for rounding. It is taken a little
    wider than that, so a passage counts only if it certainly is one.

    Args:
        plan: The home.
        solid: The footprints of the objects that bodies can't pass [lattice].

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
    for radius in RADII:
        space = free.buffer(-radius * unit - ROUNDED, join_style="mitre", mitre_limit=1.0)
        areas = shapely.area(shapely.get_parts(space))
        if not len(areas) or areas.sum() - areas.max() > CERTAIN * CUT_OFF_M2 * unit**2:
            return False
    return True


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
