"""The fixed-point grid of all positions and walls, and its conversion from and to metres."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from fleet2d.errors import FloorPlanError
from fleet2d.kernels import CELL_CENTRE, F64, I64

LatticePoint = tuple[int, int]
"""x and y of a point [lattice]."""

UNITS_PER_CELL = 64
MARGIN_CELLS = 2
MIN_CELL_M = 0.01
MAX_CELL_M = 1.0

# Products of three coordinates must stay inside int64: the sight kernels rely on this bound.
COORDINATE_LIMIT = 2**20

# Most cells of a plan, whose rooms are found in a few seconds, with 30 bytes a cell.
MAX_CELLS = 10_000_000


# Units that a file may have instead of metres, and the length of each [m].
UNITS = {
    "millimetres": 0.001,
    "centimetres": 0.01,
    "inches": 0.0254,
    "pixels of 5 cm": 0.05,
    "decimetres": 0.1,
    "feet": 0.3048,
    "tens of metres": 10.0,
    "hundreds of metres": 100.0,
    "kilometres": 1000.0,
}
# Length of a home's longer side [m].
SIDE_M = (4.0, 80.0)


def unit_hint(size: tuple[float, float]) -> str:
    """Return the end of a sentence on a plan of an unlikely size: the units that would explain it.

    Args:
        size: Its width and height [m].

    Example:
        >>> unit_hint((11_400, 8_200))
        ': floorplan.scale=0.001 if it is in millimetres (11.4 m x 8.2 m)'
        >>> unit_hint((11.4, 8.2))
        ''
    """
    width, height = size
    if SIDE_M[0] <= max(size) <= SIDE_M[1]:
        return ""
    likely = [
        f"floorplan.scale={metres:g} if it is in {unit} ({width * metres:.1f} m x"
        f" {height * metres:.1f} m)"
        for unit, metres in UNITS.items()
        if SIDE_M[0] <= max(size) * metres <= SIDE_M[1]
    ]
    return f": {', '.join(likely)}" if likely else ""


@dataclass(frozen=True)
class Lattice:
    """A square grid of cells over a floor plan, 64 lattice units to the side of a cell.

    Cell (row r, column c) covers the lattice square from (64c, 64r) to (64c + 64, 64r + 64).

    Attributes:
        cell: Side of a cell [m].
        origin: Corner of cell (0, 0) [m], a multiple of the cell.
        columns: Cells along x.
        rows: Cells along y.

    Example:
        >>> lattice = Lattice.around((0.1, 0.1, 5.06, 5.06), cell=0.05)
        >>> lattice.origin, lattice.columns, lattice.rows
        ((0.0, 0.0), 104, 104)
        >>> lattice.to_lattice([0.1, 0.05])
        array([128,  64])
        >>> lattice.to_metres([128, 64])
        array([0.1 , 0.05])
    """

    cell: float
    origin: tuple[float, float]
    columns: int
    rows: int

    def __post_init__(self) -> None:
        check_cell(self.cell)
        width, height = self.size
        if UNITS_PER_CELL * max(self.columns, self.rows) >= COORDINATE_LIMIT:
            # The size, in whole centimetres, at which the longer side fits.
            cells = COORDINATE_LIMIT // UNITS_PER_CELL - 2 * MARGIN_CELLS - 2
            fits = math.ceil(100 * max(width, height) / cells) / 100
            raise FloorPlanError(
                f"the floor plan is {width:.0f} m x {height:.0f} m, too large for cells of"
                f" {self.cell:g} m (at most {COORDINATE_LIMIT // UNITS_PER_CELL - 1} cells a side):"
                f" set floorplan.cell to {fits:g} or more, and check that the file is in"
                f" metres{unit_hint(self.size)}"
            )
        if self.columns * self.rows > MAX_CELLS:
            fits = math.ceil(100 * math.sqrt(width * height / MAX_CELLS)) / 100
            millions = self.columns * self.rows / 1e6
            most = MAX_CELLS / 1e6
            raise FloorPlanError(
                f"the floor plan is {width:.0f} m x {height:.0f} m: {millions:.0f} million cells of"
                f" {self.cell:g} m, and at most {most:.0f} million are read:"
                f" set floorplan.cell to {fits:g} or more, and check that the file is in metres"
                f"{unit_hint(self.size)}"
            )

    @classmethod
    def around(cls, bounds: tuple[float, float, float, float], cell: float) -> Self:
        """Return the lattice that covers `bounds` (x0, y0, x1, y1) [m] and two cells more.

        Raises:
            FloorPlanError: The cell is not within 0.01–1.0 m, or the bounds are not finite or too
                large for it.
        """
        check_cell(cell)
        if not all(math.isfinite(value) for value in bounds):
            raise FloorPlanError(f"the floor plan's bounds are not finite numbers: {bounds}")
        # The bounds are snapped as walls are, so that a plan and its stored copy share a lattice.
        units = UNITS_PER_CELL / cell
        low_x, low_y, high_x, high_y = (2 * round(value * units / 2) for value in bounds)
        x0, y0 = (low // UNITS_PER_CELL - MARGIN_CELLS for low in (low_x, low_y))
        x1, y1 = (-(-high // UNITS_PER_CELL) + MARGIN_CELLS for high in (high_x, high_y))
        return cls(cell, origin=(x0 * cell, y0 * cell), columns=x1 - x0, rows=y1 - y0)

    @property
    def size(self) -> tuple[float, float]:
        """Its width and height [m]."""
        return self.columns * self.cell, self.rows * self.cell

    @cached_property
    def units_per_m(self) -> float:
        """Lattice units to a metre: 1280 for cells of 5 cm."""
        return UNITS_PER_CELL / self.cell

    @cached_property
    def _origin_units(self) -> I64:
        return np.rint(np.asarray(self.origin) / self.cell).astype(np.int64) * UNITS_PER_CELL

    def to_lattice(self, xy: ArrayLike) -> I64:
        """Return positions (…, 2) [m] as the nearest lattice points, int64 of the same shape."""
        units = np.rint(np.asarray(xy, dtype=np.float64) * self.units_per_m)
        return units.astype(np.int64) - self._origin_units

    @cached_property
    def _origin_point(self) -> LatticePoint:
        x, y = self._origin_units.tolist()
        return x, y

    def point_at(self, xy: Sequence[float]) -> LatticePoint:
        """Return one position (x, y) [m] as the nearest lattice point; quicker than `to_lattice`.

        Example:
            >>> Lattice.around((0.1, 0.1, 5.06, 5.06), cell=0.05).point_at((0.1, 0.05))
            (128, 64)
        """
        units = self.units_per_m
        x0, y0 = self._origin_point
        return round(xy[0] * units) - x0, round(xy[1] * units) - y0

    def xy_of(self, x: int, y: int) -> tuple[float, float]:
        """Return one lattice point in metres; quicker than `to_metres`.

        Example:
            >>> Lattice.around((0.1, 0.1, 5.06, 5.06), cell=0.05).xy_of(128, 64)
            (0.1, 0.05)
        """
        units = self.units_per_m
        x0, y0 = self._origin_point
        return (x + x0) / units, (y + y0) / units

    def to_walls(self, xy: ArrayLike) -> I64:
        """Return positions (…, 2) [m] as the nearest even lattice points, where walls may stand."""
        halves = np.rint(np.asarray(xy, dtype=np.float64) * self.units_per_m / 2)
        return 2 * halves.astype(np.int64) - self._origin_units

    def to_metres(self, xy: ArrayLike) -> F64:
        """Return lattice points (…, 2) in metres, float64 of the same shape."""
        return (np.asarray(xy) + self._origin_units) / self.units_per_m

    def cell_of(self, x: int, y: int) -> tuple[int, int]:
        """Return (row, column) of the cell that holds a lattice point."""
        return int(y) // UNITS_PER_CELL, int(x) // UNITS_PER_CELL

    def cell_centre(self, row: int, column: int) -> LatticePoint:
        """Return a cell's centre (x, y) [lattice]: the odd point next to its exact middle."""
        return UNITS_PER_CELL * column + CELL_CENTRE, UNITS_PER_CELL * row + CELL_CENTRE

    def centre_axes(self) -> tuple[I64, I64]:
        """Return the x (columns,) and the y (rows,) of the cell centres, lattice units."""
        columns, rows = (np.arange(n, dtype=np.int64) for n in (self.columns, self.rows))
        return columns * UNITS_PER_CELL + CELL_CENTRE, rows * UNITS_PER_CELL + CELL_CENTRE

    def squared_distances(self, cells: I64, point: Sequence[int]) -> I64:
        """Return the squared distances of the centres of cells (row, column) from a point.

        Args:
            cells: int64 (n, 2).
            point: (x, y) [lattice].
        """
        across = cells[:, 1] * UNITS_PER_CELL + (CELL_CENTRE - point[0])
        up = cells[:, 0] * UNITS_PER_CELL + (CELL_CENTRE - point[1])
        return across * across + up * up


def check_cell(cell: float) -> None:
    """Raise FloorPlanError unless `cell` is a valid cell size."""
    if not MIN_CELL_M <= cell <= MAX_CELL_M:
        raise FloorPlanError(
            f"floorplan.cell is {cell:g} m: choose a cell size from {MIN_CELL_M:g} m to"
            f" {MAX_CELL_M:g} m (0.05 m is usual)"
        )
