"""A home while furniture is put into it: places for pieces, and the routes that must stay open."""

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain

import numpy as np
import shapely
from shapely import Polygon

from fleet2d.floorplan.body_spaces import (
    RADII,
    BodySpace,
    body_spaces,
    cuts_nothing,
    exact_space,
    large_parts,
    solid_footprints,
    stays_whole,
)
from fleet2d.floorplan.furniture import stand_furniture
from fleet2d.floorplan.lattice import UNITS_PER_CELL
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan, Room, largest_part
from fleet2d.floorplan.space import (
    BODY_RADIUS,
    Space,
    Window,
    grown_cells,
    with_approaches,
)
from fleet2d.kernels import (
    I32,
    I64,
    QUARTER,
    TURN,
    Bool,
    GroupRule,
    RoomFloor,
    corner_sums,
    group_places,
    label_parts,
    squared_distance,
)
from fleet2d.runtime.determinism import Draws

# Largest distance of a wall behind a piece, to allow for the steps of jagged walls [m].
WALL_REACH = 0.15
# Minimum part of its back that must touch the wall, in tenths.
MIN_WALL_TENTHS = 8
# Number of places that are tried for a group before it is left out.
ATTEMPTS = 10
# A place may have this many points less than the best, for variety.
VARIETY = 8
# A smaller part of the floor may be cut off from the rest.
POCKET_M2 = 0.06
# Distance from a door beyond which more distance earns no points [m].
FAR_M = 3.0

Score = Callable[[I64, tuple[int, int]], I64]


@dataclass(frozen=True)
class Piece:
    """A piece of furniture in a group, whose back is at the bottom.

    Attributes:
        type: Its type in the catalogue.
        left: Distance of its footprint from the group's left corner [m].
        ahead: Distance of its footprint from the group's back [m].
        width: Extent of the footprint along the back [m].
        depth: Extent of the footprint away from the back [m].
        turn: Direction of its front, quarter turns counter-clockwise from that of the group.
    """

    type: str
    left: float
    ahead: float
    width: float
    depth: float
    turn: int = 0


@dataclass(frozen=True)
class FurnitureGroup:
    """Pieces that are placed together, in a rectangle of floor that they have for themselves.

    Attributes:
        width: Extent along the back [m].
        depth: Extent away from the back [m].
        pieces: Its pieces.
        wall: Whether its back must be against a wall.
        front: Depth of the floor before it that stays empty [m].
        corner: Points for a place in a corner.
        away: Points for a place far from doors.
    """

    width: float
    depth: float
    pieces: tuple[Piece, ...]
    wall: bool = True
    front: float = 0.0
    corner: int = 40
    away: int = 20


class RoomView:
    """A room and its surroundings in a window of cells, which is turned to have each wall as base.

    Turned by `turn` quarters, rows count away from the wall and columns along it. Sizes are in
    cells.
    """

    def __init__(
        self, plan: FloorPlan, room: Room, whole: Bool, doors: Bool, before_walls: I32
    ) -> None:
        lattice = plan.lattice
        self.room = room
        self.lattice = lattice
        margin = 1 + count_cells(lattice.cell, 1.0)
        low, high = lattice.to_lattice(np.reshape(room.bounds, (2, 2))) // UNITS_PER_CELL
        x0, y0 = np.maximum(low - margin, 0).tolist()
        x1, y1 = np.minimum(high + margin, (lattice.columns, lattice.rows)).tolist()
        self.window = (slice(y0, y1), slice(x0, x1))
        self.inside = largest_part(plan.room_of_cell[self.window] == room.index)
        self.pocket = int(POCKET_M2 / lattice.cell**2)
        whole = np.ascontiguousarray(whole[self.window])
        doors = doors[self.window]
        # Doors beyond the window don't count, and neither does its edge.
        apart = np.pad(~doors, 1, constant_values=True)
        self._floor = RoomFloor(
            holds=whole & self.inside & ~doors,
            whole=whole,
            before_walls=np.ascontiguousarray(before_walls[:, y0 : y1 + 1, x0 : x1 + 1]),
            from_doors=squared_distance(apart)[1:-1, 1:-1],
        )

    def places(
        self, group: FurnitureGroup, occupied: Bool, draws: Draws, score: Score | None = None
    ) -> Iterator[tuple[int, int, int]]:
        """Yield places for a group, good ones first: turn, first row, first column.

        Args:
            group: The group.
            occupied: Cells that other things occupy, bool (rows, columns) of the plan.
            draws: The stream that chooses among good places.
            score: Returns further points for turns, first rows and first columns, int64 (n, 3), of
                a group of a size; below 0 where the group must not be.
        """
        width, depth = self._size(group)
        rule = GroupRule(
            width,
            depth,
            front=count_cells(self.lattice.cell, group.front),
            backed=-(-MIN_WALL_TENTHS * width // 10) if group.wall else 0,
            corner=group.corner,
            away=group.away,
            far=count_cells(self.lattice.cell, FAR_M),
        )
        places = group_places(self._floor, occupied[self.window], rule)
        if score is not None:
            more = score(places[:, :3], (width, depth))
            places[:, 3] += more
            places = places[more >= 0]
        for _ in range(ATTEMPTS):
            if not len(places):
                return
            good = np.flatnonzero(places[:, 3] >= places[:, 3].max() - VARIETY)
            turn, row, column, _ = places[good[draws.below(len(good))]].tolist()
            yield turn, row, column
            # A group that doesn't fit at a place doesn't fit close by either.
            away = np.abs(places[:, 1:3] - (row, column)).max(axis=1)
            is_far = away > count_cells(self.lattice.cell, 0.2)
            places = places[is_far | (places[:, 0] != turn)]

    def _size(self, group: FurnitureGroup) -> tuple[int, int]:
        cell = self.lattice.cell
        return max(1, count_cells(cell, group.width)), max(1, count_cells(cell, group.depth))

    def rectangle(
        self, group: FurnitureGroup, turn: int, row: int, column: int
    ) -> tuple[slice, slice]:
        """Return the rows and columns of the plan that a group and the floor before it occupy."""
        width, depth = self._size(group)
        depth += count_cells(self.lattice.cell, group.front)
        x0, y0 = self._unturned(turn, column, row)
        x1, y1 = self._unturned(turn, column + width, row + depth)
        return slice(*sorted((y0, y1))), slice(*sorted((x0, x1)))

    def pieces(self, group: FurnitureGroup, turn: int, row: int, column: int) -> list[PlacedObject]:
        """Return the furniture of a group whose first cell is at a row and column.

        The list is empty if the cells are too large for it.
        """
        cell = self.lattice.cell
        objects = []
        for piece in group.pieces:
            # Edges are rounded, not sizes: what is side by side stays so.
            u0 = count_cells(cell, piece.left)
            v0 = count_cells(cell, piece.ahead)
            u1 = count_cells(cell, piece.left + piece.width)
            v1 = count_cells(cell, piece.ahead + piece.depth)
            if u1 == u0 or v1 == v0:
                return []  # the cells are larger than the piece
            ends = ((column + u0, row + v0), (column + u1, row + v1))
            # The back is at the bottom: away from it is +y before turning.
            heading = (QUARTER * (turn + piece.turn + 1)) % TURN
            (ax, ay), (bx, by) = (self._corner_m(turn, *end) for end in ends)
            size = (abs(bx - ax), abs(by - ay))
            if heading % (2 * QUARTER) == 0:
                size = size[::-1]
            middle = ((ax + bx) / 2, (ay + by) / 2)
            objects.append(stand_furniture(piece.type, middle, heading, size))
        return objects

    def _corner_m(self, turn: int, u: int, v: int) -> tuple[float, float]:
        """Return a corner of a cell of the turned window in the plan [m]."""
        x, y = self._unturned(turn, u, v)
        return self.lattice.xy_of(x * UNITS_PER_CELL, y * UNITS_PER_CELL)

    def _unturned(self, turn: int, u: int, v: int) -> tuple[int, int]:
        """Return a corner of a cell (x, y) of the turned window as one of the plan."""
        height, width = self.inside.shape
        x, y = ((u, v), (width - v, u), (width - u, height - v), (v, height - u))[turn]
        return self.window[1].start + x, self.window[0].start + y

    def turn_place(self, turn: int, x: float, y: float) -> tuple[float, float]:
        """Return a place (x, y) [m] as column and row of the turned window."""
        height, width = self.inside.shape
        low = self.lattice.to_lattice((x, y)) / UNITS_PER_CELL
        x = float(low[0]) - self.window[1].start
        y = float(low[1]) - self.window[0].start
        return ((x, y), (y, width - x), (width - x, height - y), (height - y, x))[turn]


def count_cells(cell: float, metres: float) -> int:
    """Return how many cells of a side [m] come nearest to a length [m]."""
    # Slightly more than a half is added, so that sums of equal value are rounded alike.
    return math.floor(metres / cell + 0.5 + 1e-6)


def cells_after(mask: Bool, reach: int, axis: int) -> Bool:
    """Return the cells that follow a cell of the mask within `reach`, or precede it if negative."""
    out = np.zeros_like(mask)
    after = np.moveaxis(out, axis, 0)
    before = np.moveaxis(mask, axis, 0)
    if reach < 0:
        after, before = after[::-1], before[::-1]
    for step in range(1, abs(reach) + 1):
        after[step:] |= before[:-step]
    return out


def cells_before_walls(whole: Bool, cell: float) -> I32:
    """Return how many cells are before walls, as `RoomFloor` has them, of a whole plan.

    In the direction of the rows of each turn: the wall on the left of a turn is behind the next.

    Args:
        whole: The free cells that no wall cuts, bool (rows, columns).
        cell: Their side [m].
    """
    reach = max(1, count_cells(cell, WALL_REACH))
    ahead = ((reach, 0), (-reach, 1), (-reach, 0), (reach, 1))
    walls = ~whole
    return np.stack([corner_sums(cells_after(walls, *way)) for way in ahead])


DOOR_CLEARANCE = 0.9
"""Depth of the floor before a doorway that stays empty, on either side [m]."""


class Interior:
    """A home while furniture is put into it.

    Attributes:
        plan: The home.
        objects: The objects in it, those of the plan first.
        groups: The furniture that was put into it, group by group.
        standing: Cells where the middle of a body can be, bool (rows, columns).
    """

    def __init__(self, plan: FloorPlan) -> None:
        self.plan = plan
        self.objects: list[PlacedObject] = []
        self.groups: list[list[PlacedObject]] = []
        space = Space(plan, BODY_RADIUS)
        self.standing: Bool = space.part_of_cell >= 0
        self.whole = whole_cells(plan)
        self.doors = door_cells(plan, self.standing)
        self.occupied = np.zeros_like(self.whole)
        self._before_walls = cells_before_walls(self.whole, plan.lattice.cell)
        self._views: dict[int, RoomView] = {}
        self._main: dict[int, Bool] = {}
        self._approached = np.zeros_like(self.whole)
        self._empty = self._spaces = body_spaces(plan, space.polygons)
        for thing in plan.objects:
            window, covered = grown_cells(plan.lattice, thing.footprint, 0.0)
            self.occupied[window] |= covered
            if thing.blocks != "nothing":
                self._stand_off(thing)
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
                self.occupied[view.rectangle(group, turn, row, column)] = True
                return True
        return False

    def view(self, room: Room) -> RoomView:
        """Return the view of a room."""
        if room.index not in self._views:
            self._views[room.index] = RoomView(
                self.plan, room, self.whole, self.doors, self._before_walls
            )
        return self._views[room.index]

    def remove_obstructions(self) -> None:
        """Remove the groups that cut a space in two, by the geometry in which bodies move.

        While groups are placed, spaces are cut out of each other, rounded against bodies: two small
        pieces of floor may in fact be connected, and too large to be cut off together.
        """
        plan = self.plan
        fixed = solid_footprints(plan, plan.objects)
        solid = [solid_footprints(plan, group) for group in self.groups]

        @cache
        def before(radius: float) -> list[Polygon]:
            known = (space.parts for space in self._empty if space.radius == radius)
            return next(known, None) or exact_space(plan, fixed, radius)

        def is_open(count: int) -> bool:
            added = list(chain.from_iterable(solid[:count]))
            boxes = shapely.bounds(added).astype(np.int64).reshape(-1, 4)
            cut = [radius for radius in RADII if not cuts_nothing(plan, fixed, boxes, radius)]
            standing = [*fixed, *added]
            if not cut or stays_whole(plan, standing, cut):
                return True
            for radius in cut:
                large = large_parts(plan, exact_space(plan, standing, radius))
                if len(large) > 1:
                    inside = shapely.point_on_surface(large)
                    if any(shapely.contains(part, inside).sum() > 1 for part in before(radius)):
                        return False
            return True

        while not is_open(len(self.groups)):
            # The more furniture, the less is connected: find the first group too many.
            first = bisect_left(range(1, len(self.groups) + 1), True, key=lambda n: not is_open(n))
            del self.groups[first], solid[first]
        self.objects = [*self.objects[: len(plan.objects)], *chain.from_iterable(self.groups)]

    def _add(self, view: RoomView, things: list[PlacedObject]) -> bool:
        """Add objects if they stand in free space, are usable and cut no route; return whether."""
        if not shapely.covers(self.plan.free_space, [thing.footprint for thing in things]).all():
            return False
        before = self.standing[view.window].copy()
        grown = [self._stand_off(thing) for thing in things if thing.blocks != "nothing"]
        usable = spaces = None
        if self._ways_stay_open(view, before, grown):
            usable = self._usable(view, things)
        if usable is not None:
            spaces = self._spaces_with(usable)
        if usable is None or spaces is None:
            self.standing[view.window] = before
            return False
        self._spaces = spaces
        self.groups.append(usable)
        for thing in usable:
            self._record(thing)
        return True

    def _stand_off(self, thing: PlacedObject) -> Window:
        """Take the floor that an object leaves no body to stand on, and return its window."""
        window, covered = grown_cells(self.plan.lattice, thing.footprint, BODY_RADIUS)
        self.standing[window] &= ~covered
        return window

    def _ways_stay_open(self, view: RoomView, before: Bool, grown: list[Window]) -> bool:
        """Return whether connected cells stay connected, and the room can be entered.

        Args:
            view: The room.
            before: Cells of its window where a body could stand, before the objects were added.
            grown: The windows in which that has changed.
        """
        after = self.standing[view.window]
        is_barred = (before & view.inside).any() and not (after & view.inside).any()
        if is_barred or (self._approached[view.window] & ~after).any():
            return False
        if not grown:
            return True
        # Cells that stay connected near by stay so; otherwise a route may lead farther around.
        rows, columns = zip(*grown, strict=True)
        top, left = view.window
        near = (_hull(rows, top.start), _hull(columns, left.start))
        return not _split(before[near], after[near], 0) or not _split(before, after, view.pocket)

    def _usable(self, view: RoomView, things: list[PlacedObject]) -> list[PlacedObject] | None:
        """Return the objects with reachable places to use them, or None if one has none."""
        usable = []
        everything = [*self.objects, *things]
        reached = self._reached(view)
        for thing in things:
            reachable = with_approaches(self.plan, thing, reached, everything)
            if thing.uses and not reachable.uses:
                return None
            usable.append(reachable)
        return usable

    def _spaces_with(self, things: list[PlacedObject]) -> list[BodySpace] | None:
        """Return the spaces of bodies among further objects, or None if these cut a space in two.

        Cells alone can't tell: between slanted walls, or for a thin body, there may be a way where
        no two neighboring cells are free.
        """
        bounds = [thing.footprint.bounds for thing in things if thing.blocks != "nothing"]
        if not bounds:
            return self._spaces
        lattice = self.plan.lattice
        boxes = lattice.to_walls(np.reshape(bounds, (-1, 2))).reshape(-1, 4)
        uses = [use for thing in (*self.objects, *things) for use in thing.uses]
        approaches = [use.approach for use in uses if use.approach is not None]
        kept = lattice.to_lattice(np.reshape(approaches, (-1, 2)))
        spaces = []
        for space in self._spaces:
            must_keep = kept if space.radius == BODY_RADIUS else kept[:0]
            rest = space.without(boxes, must_keep)
            if rest is None:
                return None
            spaces.append(rest)
        return spaces

    def _reached(self, view: RoomView) -> Bool:
        """Return the largest connected part of the standing cells in and around a room."""
        index = view.room.index
        if index not in self._main:
            main = self._main[index] = np.zeros_like(self.standing)
            main[view.window] = largest_part(self.standing[view.window], view.inside)
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


def _hull(slices: Sequence[slice], start: int) -> slice:
    """Return the slice, relative to a start, that holds others and one more cell on either side."""
    first = min(s.start for s in slices) - 1
    last = max(s.stop for s in slices) + 1
    return slice(max(first - start, 0), last - start)


def _split(before: Bool, after: Bool, pocket: int) -> bool:
    """Return whether a part of a mask was split, or one larger than a pocket was lost."""
    old, new = (label_parts(np.ascontiguousarray(mask), False) for mask in (before, after))
    parts = int(old.max()) + 1
    old_part = old[after]
    new_part = new[after]
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
    for ring in shapely.get_rings(plan.polygons):
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
    reach = count_cells(cell, DOOR_CLEARANCE)
    beside = count_cells(cell, 2 * BODY_RADIUS)
    cells = np.zeros_like(plan.free)
    doorways = [_doorway_cells(plan, upright=upright) for upright in (False, True)]
    for turn in range(4):
        rooms = np.ascontiguousarray(np.rot90(plan.room_of_cell, turn))
        can_stand = np.ascontiguousarray(np.rot90(standing, turn))
        free = np.ascontiguousarray(np.rot90(plan.free, turn))
        border = np.zeros_like(free)
        border[1:] = free[1:] & free[:-1] & (rooms[1:] != rooms[:-1])
        crossed = border.copy()
        crossed[1:] &= can_stand[1:] & can_stand[:-1]
        seeds = np.array(np.rot90(doorways[turn % 2], turn))
        rows = np.flatnonzero(crossed.any(axis=1))
        across = crossed[rows]
        near = across | cells_after(across, beside, 1) | cells_after(across, -beside, 1)
        seeds[rows] |= border[rows] & near
        # Each column is on its own, and few have seeds.
        columns = np.flatnonzero(seeds.any(axis=0))
        before, open_before = (np.ascontiguousarray(mask[:, columns]) for mask in (seeds, free))
        reached = before.copy()
        for _ in range(reach - 1):
            before[1:] = before[:-1] & open_before[1:]
            before[0] = False
            reached |= before
        zone = np.zeros_like(free)
        zone[:, columns] = reached
        cells |= np.rot90(zone, -turn)
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
