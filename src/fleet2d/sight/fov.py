"""Fields of view: the base of the methods that a scenario can choose by `sight.method`."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from fleet2d.configuration.components import Component
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels import I64, Bool
from fleet2d.kernels.sight import Reach, points_in_reach
from fleet2d.kernels.space import CELL_CENTRE, SUB

__all__ = ["Bool", "FieldOfView", "Reach"]


class FieldOfView(Component):
    """Base of the methods that decide what is in view; a subclass writes `visible`.

    Positions are lattice points, headings 1/4096 of a turn counter-clockwise from +x (see
    ``home.plan.lattice``), so that results can be exact. A method may cache results, but a result
    must depend only on its arguments and on the present walls, ``home.walls``.

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

    def start(self, home: Home) -> None:
        """Prepare for a run."""

    @abstractmethod
    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points are not hidden by walls, regardless of range and bearing.

        Args:
            home: The home, with its present walls.
            x: Position of the eye [lattice units].
            y: Position of the eye [lattice units].
            points: int64 (n, 2).

        Returns:
            bool (n,).
        """

    def sees(self, home: Home, x: int, y: int, heading: int, reach: Reach, points: I64) -> Bool:
        """Return which points are in view: in range, within the angle, and not hidden.

        Args:
            home: The home.
            x: Position of the camera [lattice units].
            y: Position of the camera [lattice units].
            heading: Where it looks [1/4096 turn].
            reach: Its range and angle.
            points: int64 (n, 2).

        Returns:
            bool (n,).
        """
        in_view = points_in_reach(x, y, heading, reach, points)
        if in_view.any():
            in_view[in_view] = self.visible(home, x, y, points[in_view])
        return in_view

    def cells(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells have their centre in view: bool (rows, columns)."""
        lattice = home.plan.lattice
        rows, columns = np.indices((lattice.rows, lattice.columns))
        centres = np.stack([columns.ravel(), rows.ravel()], axis=1) * SUB + CELL_CENTRE
        return self.sees(home, x, y, heading, reach, centres.astype(np.int64)).reshape(rows.shape)
