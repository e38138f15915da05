"""The free places nearest to many points: what a space answers for one, by an index."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

I64 = NDArray[np.int64]


class Nearest:
    """Centres of the free cells that a body can get to, in one room or in all."""

    def __init__(self, actor: "Actor", room: int | None = None) -> None:
        cells = actor.space.cells(room, actor.part)
        xs, ys = actor.home.plan.lattice.centre_axes()
        self.centres: I64 = np.stack([xs[cells[:, 1]], ys[cells[:, 0]]], 1)

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([shapely.Point(x, y) for x, y in self.centres.tolist()])

    def of(self, points: I64) -> I64:
        """Return the nearest centre to each point (n, 2); of equal ones lowest row, then column."""
        if not len(points) or not len(self.centres):
            return np.empty((0, 2), np.int64)
        asked, found = self._tree.query_nearest(shapely.points(points), all_matches=True)
        best = np.full(len(points), len(self.centres), np.int64)
        np.minimum.at(best, asked, found)
        return self.centres[best]
