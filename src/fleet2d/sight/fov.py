"""Fields of view: the interface of the methods that a scenario chooses from by `sight.method`."""

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from fleet2d.component import Component
from fleet2d.kernels.mesh import CELL_CENTRE, SUB
from fleet2d.kernels.points import points_in_reach
from fleet2d.kernels.seen import Reach

if TYPE_CHECKING:
    from fleet2d.floorplan.home.home import Home

Bool = NDArray[np.bool_]
I64 = NDArray[np.int64]

__all__ = ["Bool", "FieldOfView", "Reach"]


class FieldOfView(Component):
    """Base of the ways to tell what is in view; a subclass writes `visible`.

    Positions are lattice points, headings 1/4096 of a turn counter-clockwise from +x (see
    ``home.plan.lattice``), so that answers can be exact. A method may keep what it has worked out,
    but an answer depends only on its arguments and on the walls, ``home.walls``, as they are.

    Example:
        >>> import fleet2d
        >>> from fleet2d.sight.line_of_sight import LineOfSight
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> x, y = home.plan.lattice.to_lattice(home.rooms[0].anchor_xy).tolist()
        >>> reach = Reach(near_squared=0, far_squared=5000**2, half_angle=1024)
        >>> LineOfSight().sees(home, x, y, 0, reach, np.array([[x + 9, y], [x - 9, y]])).tolist()
        [True, False]
    """

    kind: ClassVar[str] = "sight"

    def start(self, home: "Home") -> None:
        """Prepare for a run."""

    @abstractmethod
    def visible(self, home: "Home", x: int, y: int, points: I64) -> Bool:
        """Return which points no wall hides, whatever their range and bearing.

        Args:
            home: The home, with its walls as they are.
            x: Where the eye is.
            y: Where the eye is.
            points: int64 (n, 2).

        Returns:
            bool (n,).
        """

    def sees(self, home: "Home", x: int, y: int, heading: int, reach: Reach, points: I64) -> Bool:
        """Return which points are in view: in range, within the angle, and not hidden.

        Args:
            home: The home.
            x: Where the camera is.
            y: Where the camera is.
            heading: Where it looks.
            reach: How far and wide it sees.
            points: int64 (n, 2).

        Returns:
            bool (n,).
        """
        found = points_in_reach(x, y, heading, reach, points)
        if found.any():
            found[found] = self.visible(home, x, y, points[found])
        return found

    def cells(self, home: "Home", x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells are in view, each by its centre: bool (rows, columns)."""
        lattice = home.plan.lattice
        rows, columns = np.indices((lattice.rows, lattice.columns))
        centres = np.stack([columns.ravel(), rows.ravel()], axis=1) * SUB + CELL_CENTRE
        return self.sees(home, x, y, heading, reach, centres.astype(np.int64)).reshape(rows.shape)
