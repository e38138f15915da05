"""Methods of sight with a cache: regions as polygons, and the cells in view of each pose."""

from collections import OrderedDict
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d import kernels
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I32, I64, SUB, TURN, U8, Bool, Mesh, Reach
from fleet2d.sight.fov import FieldOfView, Pieces

# Memory for the poses of a flashlight [bytes]; the least recently used are dropped first.
MEMORY_BYTES = 64e6
# Memory of an entry besides its bits, for keys, tuple and array [bytes].
ENTRY_BYTES = 450


class Regions(NamedTuple):
    """The regions visible from the centres of all free cells.

    Attributes:
        number: int32 (rows, columns), the index of each free cell, -1 for others.
        start: int32 (cells + 1,), the first piece of each cell.
        right: int32, pieces as from `visible_region`.
        wall: int32.
    """

    number: I32
    start: I32
    right: I32
    wall: I32

    def of_cell(self, row: int, column: int) -> Pieces | None:
        """Return the region of a cell; None for one that isn't free or is outside of the grid."""
        rows, columns = self.number.shape
        if not (0 <= row < rows and 0 <= column < columns) or self.number[row, column] < 0:
            return None
        cell = self.number[row, column]
        pieces = slice(self.start[cell], self.start[cell + 1])
        return self.right[pieces], self.wall[pieces]


class VisibilityPolygon(FieldOfView):
    """Compute the region visible from a place once, then look points up in it.

    This pays off where many points are tested from few places. A region takes 8 bytes a piece,
    about 200 bytes in a smooth plan and 1 kB in one traced from a sensor.

    Attributes:
        precompute: The places whose regions are computed: `visited`, those that cameras look from;
            `all`, also the centres of all cells, before the run.
        keep: Number of visited places whose regions are cached.
    """

    precompute: Literal["visited", "all"] = "visited"
    keep: int = Field(default=4096, ge=1)

    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points are in the region of (x, y)."""
        right, wall = self._region(home, x, y)
        return kernels.region_contains_points(home.walls, x, y, right, wall, points)

    def cells(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells have their centre in the region, cut by range and angle."""
        return filled_cells(home, x, y, heading, reach)

    def _region(self, home: Home, x: int, y: int) -> Pieces:
        if getattr(self, "_walls", None) is not home.walls:
            self.start(home)
        row = y // SUB
        column = x // SUB
        if self._regions is not None and (x, y) == home.lattice.cell_centre(row, column):
            pieces = self._regions.of_cell(row, column)
            if pieces is not None:
                return pieces
        region = self._visited.pop((x, y), None) or kernels.visible_region(home.walls, x, y)
        self._visited[x, y] = region
        if len(self._visited) > self.keep:
            self._visited.popitem(last=False)
        return region

    def start(self, home: Home) -> None:
        """Empty the cache, for the present walls; compute all regions, if configured."""
        self._walls: Mesh = home.walls
        self._visited: OrderedDict[tuple[int, int], Pieces] = OrderedDict()
        self._regions: Regions | None = None
        if self.precompute == "all":
            self._regions = _regions_of(home)


def _regions_of(home: Home) -> Regions:
    lattice = home.lattice
    triangles = kernels.rasterize_cells(home.walls, lattice.rows, lattice.columns)
    cells = np.ascontiguousarray(np.argwhere(triangles >= 0))
    start, right, wall = kernels.regions_of_cells(home.walls, cells, triangles)
    return Regions(_numbers(triangles), start.astype(np.int32), right, wall)


def _numbers(triangles: I32) -> I32:
    free = triangles >= 0
    number = np.cumsum(free).reshape(free.shape) - 1
    return np.where(free, number, -1).astype(np.int32)


class CellBits(NamedTuple):
    """The cells in view of a pose, as bits of the smallest box round them."""

    row: int
    column: int
    rows: int
    columns: int
    bits: U8


class Flashlight(FieldOfView):
    """Cache the set of cells in view of each pose, and look points up by their cell.

    A point is in view if the centre of its cell is, so results are exact for the centres of cells,
    and to half a cell elsewhere. A pose takes 1 to 2 kB with a range of 4.5 m and cells of 5 cm.
    """

    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points lie in cells whose centre is visible from (x, y)."""
        everything = Reach(near_squared=0, far_squared=1 << 50, half_angle=TURN)
        return self.sees(home, x, y, 0, everything, points)

    def sees(self, home: Home, x: int, y: int, heading: int, reach: Reach, points: I64) -> Bool:
        """Return which points lie in cells whose centre is in view."""
        cells = self._lookup(home, x, y, heading, reach)
        row = points[:, 1] // SUB - cells.row
        column = points[:, 0] // SUB - cells.column
        in_view = (row >= 0) & (row < cells.rows) & (column >= 0) & (column < cells.columns)
        bit = row[in_view] * cells.columns + column[in_view]
        byte = cells.bits[bit >> 3]
        in_view[in_view] = byte >> (7 - (bit & 7)).astype(np.uint8) & 1 == 1
        return in_view

    def cells(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells are in view: bool (rows, columns)."""
        cells = self._lookup(home, x, y, heading, reach)
        lattice = home.lattice
        mask = np.zeros((lattice.rows, lattice.columns), np.bool_)
        box = np.unpackbits(cells.bits, count=cells.rows * cells.columns)
        rows = slice(cells.row, cells.row + cells.rows)
        columns = slice(cells.column, cells.column + cells.columns)
        mask[rows, columns] = box.reshape(cells.rows, cells.columns)
        return mask

    def _lookup(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> CellBits:
        if getattr(self, "_walls", None) is not home.walls:
            self.start(home)
        key = (x, y, heading, *reach)
        cells = self._cache.pop(key, None)
        if cells is None:
            cells = _pack(filled_cells(home, x, y, heading, reach))
            self._bytes += ENTRY_BYTES + cells.bits.nbytes
        self._cache[key] = cells
        while self._bytes > MEMORY_BYTES and len(self._cache) > 1:
            _, oldest = self._cache.popitem(last=False)
            self._bytes -= ENTRY_BYTES + oldest.bits.nbytes
        return cells

    def start(self, home: Home) -> None:
        """Empty the cache, for the present walls of the home."""
        self._walls: Mesh = home.walls
        self._cache: OrderedDict[tuple[int, ...], CellBits] = OrderedDict()
        self._bytes = 0


def _pack(mask: Bool) -> CellBits:
    """Return the cells of a mask (rows, columns) as bits."""
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return CellBits(0, 0, 0, 0, np.zeros(0, np.uint8))
    box = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    height, width = box.shape
    return CellBits(int(rows[0]), int(columns[0]), height, width, np.packbits(box))


def filled_cells(home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
    """Return the cells in view by filling the visible region: bool (rows, columns)."""
    lattice = home.lattice
    grid = (lattice.rows, lattice.columns)
    mask = np.zeros(grid, np.bool_)
    spans = kernels.cells_in_view(home.walls, x, y, heading, reach, *grid)
    kernels.mark_spans(spans, mask)
    return mask
