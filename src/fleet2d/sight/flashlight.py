"""Flashlight: the cells in view of a pose, kept by the poses that somebody takes."""

from collections import OrderedDict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import register
from fleet2d.kernels.headings import TURN
from fleet2d.kernels.mesh import SUB, Mesh
from fleet2d.sight.fov import I64, Bool, FieldOfView, Reach
from fleet2d.sight.visibility_polygon import filled_cells

if TYPE_CHECKING:
    from fleet2d.floorplan.home.home import Home

# What an entry takes besides its bits: keys, tuple and array.
ENTRY_BYTES = 450


class Spot(NamedTuple):
    """The cells in view of a pose, as bits of the smallest box round them."""

    row: int
    column: int
    rows: int
    columns: int
    bits: NDArray[np.uint8]


@register("sight", "flashlight")
class Flashlight(FieldOfView):
    """Keep the set of cells in view of each pose, and look points up by the cell that holds them.

    A point is in view if the centre of its cell is, so it is exact for the centres of cells, and
    elsewhere up to half a cell. A pose takes 1 to 2 kB with a range of 4.5 m and cells of 5 cm.
    """

    memory_mb: float = Field(
        default=64.0, gt=0, description="memory for poses; those not used for longest go first"
    )

    def start(self, home: "Home") -> None:
        """Begin with nothing."""
        self._face(home)

    def visible(self, home: "Home", x: int, y: int, points: I64) -> Bool:
        """Return which points lie in cells whose centre is visible from (x, y)."""
        everything = Reach(near_squared=0, far_squared=1 << 50, half_angle=TURN)
        return self.sees(home, x, y, 0, everything, points)

    def sees(self, home: "Home", x: int, y: int, heading: int, reach: Reach, points: I64) -> Bool:
        """Return which points lie in cells whose centre is in view."""
        spot = self._spot(home, x, y, heading, reach)
        row, column = points[:, 1] // SUB - spot.row, points[:, 0] // SUB - spot.column
        found = (row >= 0) & (row < spot.rows) & (column >= 0) & (column < spot.columns)
        at = row[found] * spot.columns + column[found]
        found[found] = spot.bits[at >> 3] >> (7 - (at & 7)).astype(np.uint8) & 1 == 1
        return found

    def cells(self, home: "Home", x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells are in view: bool (rows, columns)."""
        spot, lattice = self._spot(home, x, y, heading, reach), home.plan.lattice
        mask = np.zeros((lattice.rows, lattice.columns), np.bool_)
        box = np.unpackbits(spot.bits, count=spot.rows * spot.columns)
        here = slice(spot.row, spot.row + spot.rows), slice(spot.column, spot.column + spot.columns)
        mask[here] = box.reshape(spot.rows, spot.columns)
        return mask

    @property
    def kept(self) -> tuple[int, int]:
        """The number of poses kept, and the memory that they take [bytes]."""
        return len(self._spots), self._taken

    def _spot(self, home: "Home", x: int, y: int, heading: int, reach: Reach) -> Spot:
        if getattr(self, "_walls", None) is not home.walls:
            self._face(home)
        key = (x, y, heading, *reach)
        spot = self._spots.pop(key, None)
        if spot is None:
            spot = _spot_of(filled_cells(home, x, y, heading, reach))
            self._taken += ENTRY_BYTES + spot.bits.nbytes
        self._spots[key] = spot
        while self._taken > self.memory_mb * 1e6 and len(self._spots) > 1:
            _, oldest = self._spots.popitem(last=False)
            self._taken -= ENTRY_BYTES + oldest.bits.nbytes
        return spot

    def _face(self, home: "Home") -> None:
        """Begin anew, with the walls that the home has now."""
        self._walls: Mesh = home.walls
        self._spots: OrderedDict[tuple[int, ...], Spot] = OrderedDict()
        self._taken = 0


def _spot_of(mask: Bool) -> Spot:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return Spot(0, 0, 0, 0, np.zeros(0, np.uint8))
    box = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    height, width = box.shape
    return Spot(int(rows[0]), int(columns[0]), height, width, np.packbits(box))
