"""The free cells nearest to many points at once, found by a spatial index."""

from functools import cached_property

import numpy as np
import shapely

from fleet2d.entities.body import Body
from fleet2d.kernels import I64


class Nearest:
    """Centres [lattice] of the free cells that a body can get to, in one room or in all."""

    def __init__(self, body: Body, room: int | None = None) -> None:
        cells = body.space.cells(room, body.part)
        xs, ys = body.home.plan.lattice.centre_axes()
        self.centres: I64 = np.stack([xs[cells[:, 1]], ys[cells[:, 0]]], 1)

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([shapely.Point(x, y) for x, y in self.centres.tolist()])

    def of(self, points: I64) -> I64:
        """Return the centre nearest to each point, int64 (n, 2).

        Of several at the same distance, the one of the lowest row, then of the lowest column.
        """
        if not len(points) or not len(self.centres):
            return np.empty((0, 2), np.int64)
        of_point, centre = self._tree.query_nearest(shapely.points(points), all_matches=True)
        best = np.full(len(points), len(self.centres), np.int64)
        np.minimum.at(best, of_point, centre)
        return self.centres[best]
