"""A home while furniture is put into it: its free cells, and the routes that must stay open."""

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.floorplan.furniture.room_view import (
    FurnitureGroup,
    RoomView,
    Score,
    cells_after,
    count_cells,
    largest_part,
)
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL
from fleet2d.floorplan.geometry.mesh import GRID
from fleet2d.floorplan.home.home import lattice_footprint
from fleet2d.floorplan.home.space import Space, grow_shape, shrink
from fleet2d.floorplan.home.standing import BODY_RADIUS, Window, grown_cells, with_approaches
from fleet2d.floorplan.objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan, Room, rings
from fleet2d.kernels import Bool
from fleet2d.kernels.space import label_parts
from fleet2d.runtime.determinism import Draws

DOOR_CLEARANCE = 0.9
"""Depth of the floor before a doorway that stays empty, on either side [m]."""

THIN_RADIUS = 0.1
"""The radius of the thinnest body whose routes furniture leaves open [m]."""
NARROW_RADII = (0.225, 0.2, 0.175, 0.15, 0.125)
"""Radii between those two, which matter in homes with passages that not every body fits through."""
CUT_OFF_M2 = 0.25
"""Furniture may cut off less than this of a body's space, such as a corner behind a bed [m²]."""

# The outlines of the space of a body [lattice], by its radius [m].
BodySpaces = dict[float, list[Polygon]]


class Interior:
    """A home while furniture is put into it.

    Attributes:
        plan: The home.
        objects: The objects in it, those of the plan first.
        standing: Cells where the middle of a body can be, bool (rows, columns).
    """

    def __init__(self, plan: FloorPlan) -> None:
        self.plan = plan
        self.objects: list[PlacedObject] = []
        space = Space(plan, BODY_RADIUS)
        self.standing: Bool = space.part_of_cell >= 0
        self.whole = whole_cells(plan)
        self.doors = door_cells(plan, self.standing)
        self.occupied = np.zeros_like(self.whole)
        self._views: dict[int, RoomView] = {}
        self._main: dict[int, Bool] = {}
        self._approached = np.zeros_like(self.whole)
        self._spaces = _body_spaces(plan, space)
        for thing in plan.objects:
            window, covered = grown_cells(plan.lattice, thing.footprint, 0.0)
            self.occupied[window] |= covered
            if thing.blocks != "nothing":
                window, covered = grown_cells(plan.lattice, thing.footprint, BODY_RADIUS)
                self.standing[window] &= ~covered
        for thing in plan.objects:
            self._record(thing)
        shapely.prepare(plan.free_space)

    def place(
        self, room: Room, group: FurnitureGroup, draws: Draws, score: Score | None = None
    ) -> bool:
        """Put a group into a room; return whether there was a place for it.

        Args:
            room: The room.
            group: The group.
            draws: The stream that chooses among good places.
            score: Further points for places, see `RoomView.places`.
        """
        view = self.view(room)
        for turn, row, column in view.places(group, self.occupied, draws, score):
            things = view.pieces(group, turn, row, column)
            if things and self._add(view, things):
                window = view.rectangle(group, turn, row, column)
                self.occupied[window] = True
                return True
        return False

    def view(self, room: Room) -> RoomView:
        """Return the view of a room."""
        if room.index not in self._views:
            self._views[room.index] = RoomView(self.plan, room, self.whole, self.doors)
        return self._views[room.index]

    def _add(self, view: RoomView, things: list[PlacedObject]) -> bool:
        """Add objects if they stand in free space, are usable and cut no route; return whether."""
        for thing in things:
            if not shapely.covers(self.plan.free_space, thing.footprint):
                return False
        before = self.standing[view.window].copy()
        grown = []
        for thing in things:
            if thing.blocks != "nothing":
                window, covered = grown_cells(self.plan.lattice, thing.footprint, BODY_RADIUS)
                self.standing[window] &= ~covered
                grown.append(window)
        usable = spaces = None
        if self._ways_stay_open(view, before, grown):
            usable = self._usable(view, things)
        if usable is not None:
            spaces = self._spaces_with(usable)
        if usable is None or spaces is None:
            self.standing[view.window] = before
            return False
        self._spaces = spaces
        for thing in usable:
            self._record(thing)
        return True

    def _ways_stay_open(self, view: RoomView, before: Bool, grown: list[Window]) -> bool:
        """Return whether connected cells still are, and the room can still be entered.

        Args:
            view: The room.
            before: Cells of its window where a body could stand, before the objects were added.
            grown: The windows in which that has changed.
        """
        after = self.standing[view.window]
        if bool((self._approached[view.window] & ~after).any()):
            return False
        if bool((before & view.inside).any()) and not bool((after & view.inside).any()):
            return False
        if not grown:
            return True
        # Cells that stay connected near by stay so; otherwise a route may lead farther around.
        near = tuple(_hull([w[k] for w in grown], view.window[k].start) for k in (0, 1))
        return not _split(before[near], after[near], 0) or not _split(before, after, view.pocket)

    def _usable(self, view: RoomView, things: list[PlacedObject]) -> list[PlacedObject] | None:
        """Return the objects with reachable places to use them, or None if one has none."""
        usable, everything = [], [*self.objects, *things]
        for thing in things:
            reachable = with_approaches(self.plan, thing, self._reached(view), everything)
            if thing.uses and not reachable.uses:
                return None
            usable.append(reachable)
        return usable

    def _spaces_with(self, things: list[PlacedObject]) -> BodySpaces | None:
        """Return the spaces of bodies among further objects, or None if these cut a space in two.

        Cells alone can't tell: between slanted walls, or for a thin body, there may be a way where
        no two neighboring cells are free.
        """
        spaces: BodySpaces = {}
        for radius, parts in self._spaces.items():
            blocked = _blocked(self.plan, things, radius)
            spaces[radius] = []
            for part in parts:
                pieces = _pieces(part, blocked)
                if len(_large(self.plan, pieces)) > 1:
                    return None
                spaces[radius] += pieces[:1]
        uses = [use for thing in (*self.objects, *things) for use in thing.uses]
        approaches = [use.approach for use in uses if use.approach is not None]
        if approaches:
            x, y = self.plan.lattice.to_lattice(approaches).T
            before, after = (
                shapely.contains_xy(MultiPolygon(by_radius[BODY_RADIUS]), x, y)
                for by_radius in (self._spaces, spaces)
            )
            if (before & ~after).any():
                return None
        return spaces

    def _reached(self, view: RoomView) -> Bool:
        """Return the largest connected part of the standing cells in and around a room."""
        index = view.room.index
        if index not in self._main:
            self._main[index] = np.zeros_like(self.standing)
            main = largest_part(self.standing[view.window], view.inside)
            self._main[index][view.window] = main
        # It is never split, so the rest of it is still connected.
        return self._main[index] & self.standing

    def _record(self, thing: PlacedObject) -> None:
        """Record an object, and the cells from which it is used, which must stay free."""
        lattice = self.plan.lattice
        self.objects.append(thing)
        for use in thing.uses:
            if use.approach is not None:
                row, column = lattice.cell_of(*lattice.point_at(use.approach))
                self._approached[row, column] = bool(self.standing[row, column])


def _body_spaces(plan: FloorPlan, space: Space) -> BodySpaces:
    """Return the spaces of bodies among the walls and objects of a plan.

    Args:
        plan: The plan.
        space: The space of a body of `BODY_RADIUS` between its walls.
    """

    def among_objects(radius: float) -> list[Polygon]:
        polygons = space.polygons
        if radius != BODY_RADIUS:
            polygons = shrink(plan.polygons, radius * plan.lattice.units_per_m)
        blocked = _blocked(plan, plan.objects, radius)
        return [piece for polygon in polygons for piece in _pieces(polygon, blocked)]

    spaces = {radius: among_objects(radius) for radius in (BODY_RADIUS, THIN_RADIUS)}
    if _has_narrow_places(plan, spaces):
        spaces |= {radius: among_objects(radius) for radius in NARROW_RADII}
    return spaces


def _has_narrow_places(plan: FloorPlan, spaces: BodySpaces) -> bool:
    """Return whether thin bodies get to places, or between places, where large ones don't."""
    wide, thin = _large(plan, spaces[BODY_RADIUS]), np.array(spaces[THIN_RADIUS], np.object_)
    inside = np.asarray(shapely.point_on_surface(wide))
    if (shapely.contains(thin[:, None], inside).sum(axis=1) > 1).any():
        return True
    # The octagon of a body reaches up to 8 % farther than its radius.
    reach = (1.09 * BODY_RADIUS - THIN_RADIUS) * plan.lattice.units_per_m
    near = MultiPolygon(wide).buffer(reach, join_style="mitre")
    return any(_large(plan, _pieces(part, near)) for part in thin)


def _blocked(plan: FloorPlan, things: Iterable[PlacedObject], radius: float) -> BaseGeometry:
    """Return where the middle of a body can't be because of objects [lattice]."""
    # Further by the rounding of a space, so that what is connected here is connected in the space.
    reach = radius * plan.lattice.units_per_m + GRID
    solid = [lattice_footprint(plan, thing) for thing in things if thing.blocks != "nothing"]
    return shapely.union_all([grow_shape(shapely.get_coordinates(s), reach) for s in solid])


def _pieces(polygon: Polygon, without: BaseGeometry) -> list[Polygon]:
    """Return the pieces of a polygon that lie outside of a shape, the largest first."""
    if not polygon.intersects(without):
        return [polygon]
    pieces = shapely.get_parts(shapely.difference(polygon, without)).tolist()
    polygons = [piece for piece in pieces if piece.geom_type == "Polygon"]
    return sorted(polygons, key=lambda piece: -piece.area)


def _large(plan: FloorPlan, polygons: Sequence[Polygon]) -> list[Polygon]:
    """Return the polygons [lattice] that furniture may not cut off."""
    least = CUT_OFF_M2 * plan.lattice.units_per_m**2
    return [polygon for polygon in polygons if polygon.area >= least]


def _hull(slices: list[slice], start: int) -> slice:
    """Return the slice, relative to a start, that holds others and one more cell on either side."""
    first, last = min(s.start for s in slices) - 1, max(s.stop for s in slices) + 1
    return slice(max(first - start, 0), last - start)


def _split(before: Bool, after: Bool, pocket: int) -> bool:
    """Return whether a part of a mask was split, or one larger than a pocket was lost."""
    old, new = (label_parts(np.ascontiguousarray(mask), False) for mask in (before, after))
    parts = int(old.max()) + 1
    old_part, new_part = old[after], new[after]
    becomes = np.full(parts, -1, np.int64)
    becomes[old_part] = new_part
    if bool((becomes[old_part] != new_part).any()):
        return True
    sizes = np.bincount(old[before], minlength=parts)
    return bool(((becomes < 0) & (sizes > pocket)).any())


def whole_cells(plan: FloorPlan) -> Bool:
    """Return the free cells that no wall cuts, bool (rows, columns).

    Walls are sampled in steps of a quarter of a cell, so a wall that only cuts the corner of a cell
    may be missed.
    """
    cells: Bool = plan.free.copy()
    for polygon in plan.polygons:
        for ring in rings(polygon):
            points = shapely.get_coordinates(ring)
            parts = np.abs(np.diff(points, axis=0)).max(axis=1) // (UNITS_PER_CELL // 4) + 1
            parts = parts.astype(np.int64)
            piece = np.repeat(np.arange(len(parts)), parts)
            step = np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)
            share = (step / parts[piece])[:, None]
            along = points[piece] * (1 - share) + points[piece + 1] * share
            # A wall along the side of a cell touches it without being in it.
            inner = along[(along % UNITS_PER_CELL != 0).all(axis=1)]
            column, row = (inner // UNITS_PER_CELL).astype(np.int64).T
            cells[row, column] = False
    return cells


def door_cells(plan: FloorPlan, standing: Bool) -> Bool:
    """Return the cells before doorways and before borders that rooms share, bool (rows, columns).

    A border counts where a body can walk across it (`standing` on either side, and two radii
    beside): it is the doorway of a plan without doorways.
    """
    cell = plan.lattice.cell
    reach, beside = count_cells(cell, DOOR_CLEARANCE), count_cells(cell, 2 * BODY_RADIUS)
    cells = np.zeros_like(plan.free)
    for turn in range(4):
        rooms, can_stand = np.rot90(plan.room_of_cell, turn), np.rot90(standing, turn)
        free, zone = np.rot90(plan.free, turn), np.rot90(cells, turn)
        border = np.zeros_like(free)
        border[1:] = free[1:] & free[:-1] & (rooms[1:] != rooms[:-1])
        crossed = border.copy()
        crossed[1:] &= can_stand[1:] & can_stand[:-1]
        seeds = border & (
            crossed | cells_after(crossed, beside, 1) | cells_after(crossed, -beside, 1)
        )
        seeds |= np.rot90(_doorway_cells(plan, upright=turn % 2 == 1), turn)
        for _ in range(reach):
            zone |= seeds
            seeds[1:] = seeds[:-1] & free[1:]
            seeds[0] = False
    if plan.entrance is not None:
        xs, ys = plan.lattice.centre_axes()
        x, y = plan.lattice.point_at(plan.entrance)
        units = int(DOOR_CLEARANCE * plan.lattice.units_per_m)
        cells |= (xs[None, :] - x) ** 2 + (ys[:, None] - y) ** 2 < units * units
    return cells


def _doorway_cells(plan: FloorPlan, *, upright: bool) -> Bool:
    """Return the free cells along the doorways that are passed along x (upright) or along y."""
    cells = np.zeros_like(plan.free)
    for door in plan.doorways:
        start, end = plan.lattice.to_lattice([door.start, door.end])
        along = np.abs(end - start)
        if 2 * along[1 if upright else 0] < along[0 if upright else 1]:
            continue
        steps = int(along.max()) // (UNITS_PER_CELL // 4) + 1
        share = np.arange(steps + 1)[:, None]
        at = (start * (steps - share) + end * share) // steps // UNITS_PER_CELL
        cells[at[:, 1], at[:, 0]] = True
    return cells & plan.free
