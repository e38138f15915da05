"""Flashlight: a cache of the cells in view, by pose of the camera."""

from collections import OrderedDict
from typing import NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64, SUB, TURN, U8, Bool, Mesh
from fleet2d.sight.fov import FieldOfView, Reach
from fleet2d.sight.visibility_polygon import filled_cells

# Memory of an entry besides its bits: keys, tuple and array.
ENTRY_BYTES = 450


class CellBits(NamedTuple):
    """The cells in view of a pose, as bits of the smallest box round them."""

    row: int
    column: int
    rows: int
    columns: int
    bits: U8


@register("sight", "flashlight")
class Flashlight(FieldOfView):
    """Cache the set of cells in view of each pose, and look points up by their cell.

    A point is in view if the centre of its cell is, so it is exact for the centres of cells, and
    up to half a cell elsewhere. A pose takes 1 to 2 kB with a range of 4.5 m and cells of 5 cm.

    Attributes:
        memory_mb: Memory for poses; the least recently used go first.
    """

    memory_mb: float = Field(default=64.0, gt=0)

    def start(self, home: Home) -> None:
        """Begin with an empty cache."""
        self._reset(home)

    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points lie in cells whose centre is visible from (x, y)."""
        everything = Reach(near_squared=0, far_squared=1 << 50, half_angle=TURN)
        return self.sees(home, x, y, 0, everything, points)

    def sees(self, home: Home, x: int, y: int, heading: int, reach: Reach, points: I64) -> Bool:
        """Return which points lie in cells whose centre is in view."""
        cells = self._lookup(home, x, y, heading, reach)
        row, column = points[:, 1] // SUB - cells.row, points[:, 0] // SUB - cells.column
        in_view = (row >= 0) & (row < cells.rows) & (column >= 0) & (column < cells.columns)
        bit = row[in_view] * cells.columns + column[in_view]
        in_view[in_view] = cells.bits[bit >> 3] >> (7 - (bit & 7)).astype(np.uint8) & 1 == 1
        return in_view

    def cells(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells are in view: bool (rows, columns)."""
        cells, lattice = self._lookup(home, x, y, heading, reach), home.plan.lattice
        mask = np.zeros((lattice.rows, lattice.columns), np.bool_)
        box = np.unpackbits(cells.bits, count=cells.rows * cells.columns)
        part = mask[cells.row : cells.row + cells.rows, cells.column : cells.column + cells.columns]
        part[:] = box.reshape(cells.rows, cells.columns)
        return mask

    @property
    def cache_size(self) -> tuple[int, int]:
        """The number of cached poses, and their memory [bytes]."""
        return len(self._cache), self._bytes

    def _lookup(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> CellBits:
        if getattr(self, "_walls", None) is not home.walls:
            self._reset(home)
        key = (x, y, heading, *reach)
        cells = self._cache.pop(key, None)
        if cells is None:
            cells = _pack(filled_cells(home, x, y, heading, reach))
            self._bytes += ENTRY_BYTES + cells.bits.nbytes
        self._cache[key] = cells
        while self._bytes > self.memory_mb * 1e6 and len(self._cache) > 1:
            _, oldest = self._cache.popitem(last=False)
            self._bytes -= ENTRY_BYTES + oldest.bits.nbytes
        return cells

    def _reset(self, home: Home) -> None:
        """Empty the cache, for the present walls of the home."""
        self._walls: Mesh = home.walls
        self._cache: OrderedDict[tuple[int, ...], CellBits] = OrderedDict()
        self._bytes = 0


def _pack(mask: Bool) -> CellBits:
    """Return the cells of a mask (rows, columns) as bits."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return CellBits(0, 0, 0, 0, np.zeros(0, np.uint8))
    box = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    height, width = box.shape
    return CellBits(int(rows[0]), int(columns[0]), height, width, np.packbits(box))
