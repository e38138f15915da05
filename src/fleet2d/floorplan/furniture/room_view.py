"""Places for groups of furniture in a room, searched with each of its walls as the base."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from fleet2d.floorplan.furniture.catalogue import stand_furniture
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL
from fleet2d.floorplan.objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.kernels import I64, Bool
from fleet2d.kernels.numbers import QUARTER, TURN
from fleet2d.kernels.space import label_parts, squared_distance
from fleet2d.runtime.determinism import Draws

# Largest distance of a wall behind a piece, to allow for the steps of jagged walls [m].
WALL_REACH = 0.15
# Least part of its back that a piece against a wall has there, in tenths.
MIN_BACKED = 8
# Number of places that are tried for a group before it is left out.
ATTEMPTS = 10
# A place may have this many points less than the best, for variety.
VARIETY = 8
# A smaller part of the floor may be cut off from the rest.
POCKET_M2 = 0.06
# Distance from a door beyond which more distance earns no points [m].
FAR_M = 3.0

Score = Callable[[int, tuple[int, int], tuple[int, int]], I64 | None]


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

    def __init__(self, plan: FloorPlan, room: Room, whole: Bool, doors: Bool) -> None:
        lattice = plan.lattice
        self.room = room
        self.lattice = lattice
        margin = 1 + count_cells(lattice.cell, 1.0)
        rows, columns = _bounds(plan, room)
        rows = slice(max(rows.start - margin, 0), min(rows.stop + margin, lattice.rows))
        columns = slice(max(columns.start - margin, 0), min(columns.stop + margin, lattice.columns))
        self.window = (rows, columns)
        self.inside = largest_part(plan.room_of_cell[self.window] == room.index)
        self.pocket = int(POCKET_M2 / lattice.cell**2)
        self._whole, doors = whole[self.window], doors[self.window]
        self._may_hold = self._whole & self.inside & ~doors
        self._from_doors = squared_distance(np.pad(~doors, 1, constant_values=True))[1:-1, 1:-1]
        reach = max(1, count_cells(lattice.cell, WALL_REACH))
        solid = [np.rot90(~self._whole, turn) for turn in range(4)]
        self._behind = [_sums(cells_after(mask, reach, 0)) for mask in solid]
        self._right = [_sums(cells_after(mask, reach, 1)) for mask in solid]
        self._left = [_sums(cells_after(mask, -reach, 1)) for mask in solid]

    def places(
        self, group: FurnitureGroup, occupied: Bool, draws: Draws, score: Score | None = None
    ) -> Iterator[tuple[int, int, int]]:
        """Yield places for a group, good ones first: turn, first row, first column.

        Args:
            group: The group.
            occupied: Cells that other things occupy, bool (rows, columns) of the plan.
            draws: The stream that chooses among good places.
            score: Called with a turn, the shape of the turned window and the size of the group;
                returns points for each first cell, or None where no place has that turn.
        """
        empty = ~occupied[self.window]
        turns, rows, columns, points = [], [], [], []
        for turn in range(4):
            options = self._options(group, turn, empty, score)
            if options is not None:
                turns.append(np.full(len(options[0]), turn))
                rows.append(options[0])
                columns.append(options[1])
                points.append(options[2])
        if not turns:
            return
        places = np.stack([np.concatenate(turns), np.concatenate(rows), np.concatenate(columns)], 1)
        value = np.concatenate(points)
        for _ in range(ATTEMPTS):
            if not len(value):
                return
            good = np.flatnonzero(value >= value.max() - VARIETY)
            turn, row, column = places[good[draws.below(len(good))]].tolist()
            yield turn, row, column
            # A group that doesn't fit at a place doesn't fit close by either.
            near = np.abs(places[:, 1:] - (row, column)).max(axis=1) <= self._step
            rest = ~(near & (places[:, 0] == turn))
            places, value = places[rest], value[rest]

    @property
    def _step(self) -> int:
        return count_cells(self.lattice.cell, 0.2)

    def _options(
        self, group: FurnitureGroup, turn: int, empty: Bool, score: Score | None
    ) -> tuple[I64, I64, I64] | None:
        """Return the rows and columns of first cells where the group can be, and their points."""
        width, depth = self._size(group)
        front = count_cells(self.lattice.cell, group.front)
        free = np.rot90(self._may_hold & empty, turn)
        high, wide = free.shape
        if depth + front > high or width > wide:
            return None
        extra = None if score is None else score(turn, (high, wide), (width, depth))
        if score is not None and extra is None:
            return None
        possible = _count(free, depth, width) == depth * width
        if front:
            before = _count(np.rot90(self._whole & empty, turn), front, width) == front * width
            possible[: before.shape[0] - depth] &= before[depth:][: possible.shape[0]]
            possible[max(before.shape[0] - depth, 0) :] = False
        if not possible.any():
            return None
        rows, columns = np.nonzero(possible)
        if group.wall:
            touching = _in_box(self._behind[turn], rows, columns, 1, width)
            backed = 10 * touching >= MIN_BACKED * width
            rows, columns = rows[backed], columns[backed]
        points = self._points(group, turn, rows, columns)
        if extra is not None:
            more = extra[rows, columns]
            rows, columns, points = rows[more >= 0], columns[more >= 0], (points + more)[more >= 0]
        return rows, columns, points

    def _points(self, group: FurnitureGroup, turn: int, rows: I64, columns: I64) -> I64:
        """Return the points of first cells for corners and for the distance from doors."""
        width, depth = self._size(group)
        points = np.zeros(len(rows), np.int64)
        if group.corner:
            right = _in_box(self._right[turn], rows, columns, depth, 1)
            left = _in_box(self._left[turn], rows, columns + width - 1, depth, 1)
            points += group.corner * np.maximum(left, right) // depth
        if group.away:
            far = count_cells(self.lattice.cell, FAR_M)
            distance = np.rot90(self._from_doors, turn)[rows + depth // 2, columns + width // 2]
            points += np.minimum(distance, far * far) * group.away // (far * far)
        return points

    def _size(self, group: FurnitureGroup) -> tuple[int, int]:
        cell = self.lattice.cell
        return max(1, count_cells(cell, group.width)), max(1, count_cells(cell, group.depth))

    def rectangle(
        self, group: FurnitureGroup, turn: int, row: int, column: int
    ) -> tuple[slice, slice]:
        """Return the rows and columns of the plan that a group and the floor before it occupy."""
        width, depth = self._size(group)
        depth += count_cells(self.lattice.cell, group.front)
        (x0, y0), (x1, y1) = self._unturned(turn, [(column, row), (column + width, row + depth)])
        x0, x1, y0, y1 = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
        return slice(int(y0), int(y1)), slice(int(x0), int(x1))

    def pieces(self, group: FurnitureGroup, turn: int, row: int, column: int) -> list[PlacedObject]:
        """Return the furniture of a group whose first cell is at a row and column.

        The list is empty if the cells are too large for it.
        """
        cell = self.lattice.cell
        objects = []
        for piece in group.pieces:
            # Edges are rounded, not sizes: what is side by side stays so.
            u0, v0 = count_cells(cell, piece.left), count_cells(cell, piece.ahead)
            u1 = count_cells(cell, piece.left + piece.width)
            v1 = count_cells(cell, piece.ahead + piece.depth)
            if u1 == u0 or v1 == v0:
                return []  # the cells are larger than the piece
            u0, u1, v0, v1 = column + u0, column + u1, row + v0, row + v1
            (x0, y0), (x1, y1) = self._unturned(turn, [(u0, v0), (u1, v1)])
            # The back is at the bottom: away from it is +y before turning.
            heading = (QUARTER * (turn + piece.turn + 1)) % TURN
            corners = np.array([(x0, y0), (x1, y1)]) * UNITS_PER_CELL
            (ax, ay), (bx, by) = self.lattice.to_metres(corners).tolist()
            size = (abs(bx - ax), abs(by - ay))
            if heading % (2 * QUARTER) == 0:
                size = size[::-1]
            middle = ((ax + bx) / 2, (ay + by) / 2)
            objects.append(stand_furniture(piece.type, middle, heading, size))
        return objects

    def _unturned(self, turn: int, points: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return corners of cells (x, y) of the turned window as those of the plan."""
        height, width = self.inside.shape
        x0, y0 = self.window[1].start, self.window[0].start
        out = []
        for u, v in points:
            x, y = ((u, v), (width - v, u), (width - u, height - v), (v, height - u))[turn]
            out.append((x0 + x, y0 + y))
        return out

    def turn_place(self, turn: int, x: float, y: float) -> tuple[float, float]:
        """Return a place (x, y) [m] as column and row of the turned window."""
        height, width = self.inside.shape
        low = self.lattice.to_lattice((x, y)) / UNITS_PER_CELL
        x, y = float(low[0]) - self.window[1].start, float(low[1]) - self.window[0].start
        return ((x, y), (y, width - x), (width - x, height - y), (height - y, x))[turn]


def _bounds(plan: FloorPlan, room: Room) -> tuple[slice, slice]:
    lattice = plan.lattice
    low = lattice.to_lattice(room.bounds[:2]) // UNITS_PER_CELL
    high = lattice.to_lattice(room.bounds[2:]) // UNITS_PER_CELL
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def largest_part(mask: Bool, within: Bool | None = None) -> Bool:
    """Return the connected part of a mask with the most cells, of those `within` if given."""
    part = label_parts(np.ascontiguousarray(mask), False)
    sizes = np.bincount(part[mask if within is None else mask & within], minlength=1)
    return mask & (part == int(np.argmax(sizes)))


def count_cells(cell: float, metres: float) -> int:
    """Return how many cells of a side [m] come nearest to a length [m]."""
    # Slightly more than a half is added, so that sums of equal value are rounded alike.
    return math.floor(metres / cell + 0.5 + 1e-6)


def _sums(mask: Bool) -> I64:
    """Count the cells of a mask above and left of each corner, (rows + 1, columns + 1)."""
    sums = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), np.int32)
    np.cumsum(np.cumsum(mask, axis=0, dtype=np.int32), axis=1, out=sums[1:, 1:])
    return sums


def _in_box(sums: I64, rows: I64, columns: I64, high: int, wide: int) -> I64:
    """Return how many cells of a mask are in the boxes that begin at some cells."""
    right, top = columns + wide, rows + high
    return sums[top, right] - sums[rows, right] - sums[top, columns] + sums[rows, columns]


def _count(mask: Bool, high: int, wide: int) -> I64:
    """Return how many cells of the mask are in the rectangle that begins at each cell."""
    sums = _sums(mask)
    return sums[high:, wide:] - sums[:-high, wide:] - sums[high:, :-wide] + sums[:-high, :-wide]


def cells_after(mask: Bool, reach: int, axis: int) -> Bool:
    """Return the cells that follow a cell of the mask within `reach`, or precede it if negative."""
    out = np.zeros_like(mask)
    size = mask.shape[axis]
    for step in range(1, abs(reach) + 1):
        first, last = slice(0, size - step), slice(step, size)
        target, origin = (last, first) if reach > 0 else (first, last)
        if axis == 0:
            out[target] |= mask[origin]
        else:
            out[:, target] |= mask[:, origin]
    return out
