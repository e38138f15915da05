"""Fields of view: what is visible from a place. Their base, and the default: lines of sight."""

from abc import abstractmethod
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fleet2d import kernels
from fleet2d.configuration.components import Component
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import CELL_CENTRE, F64, I32, I64, SUB, Bool, Mesh, Reach
from fleet2d.kernels import visible_region as visible_region_fast

__all__ = ["Bool", "FieldOfView", "LineOfSight", "Reach"]
Pieces = tuple[I32, I32]


class WallPlan(Protocol):
    """Protocol of anything with walls for lines of sight, such as a floor plan."""

    @property
    def sight_mesh(self) -> Mesh:
        """The space between walls that block sight."""

    @property
    def lattice(self) -> Lattice:
        """Converts metres to lattice units and back."""


class VisibleRegion:
    """The region visible from one place: star-shaped, exact in lattice units.

    A point is in the region if and only if the straight line from the eye to it touches no wall and
    no corner, so the outline isn't part of the region.

    Attributes:
        eye: The place (x, y) [lattice units].
        right: int32 (n,), for each piece of the region the mesh vertex on its right border.
        wall: int32 (n,), the wall edge of each piece, 3 * triangle + k.

    Example:
        >>> import shapely
        >>> from fleet2d.floorplan.plan import FloorPlan
        >>> corners = [(0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)]
        >>> hall = FloorPlan.build("L", shapely.Polygon(corners))
        >>> region = VisibleRegion(hall, x=1.0, y=3.0)
        >>> round(region.area_m2, 3), region.contains([(1.0, 1.0), (3.5, 1.5)]).tolist()
        (10.0, [True, False])
    """

    def __init__(self, plan: WallPlan, x: float, y: float) -> None:
        """Compute the region visible from (x, y).

        Args:
            plan: A floor plan.
            x: Position of the eye [m].
            y: Position of the eye [m].

        Raises:
            PlacementError: The eye is outside free space or on a wall.
        """
        self._mesh = plan.sight_mesh
        self._lattice = plan.lattice
        self.eye = self._lattice.point_at((x, y))
        self.right, self.wall = visible_region_fast(self._mesh, *self.eye)
        if len(self.right) == 0:
            raise PlacementError(
                f"({x:g}, {y:g}) m is in a wall or outside the home, so nothing is visible from "
                "there. Choose a place in free space."
            )

    @cached_property
    def _outline(self) -> tuple[F64, float]:
        return kernels.region_outline(self._mesh, *self.eye, self.right, self.wall)

    @property
    def area_m2(self) -> float:
        """The area of the region [m²]."""
        return self._outline[1] / self._lattice.units_per_m**2

    def polygon(self) -> F64:
        """Return the corners of the outline, counter-clockwise: float64 (n, 2) [m]."""
        outline, _ = self._outline
        differs = (outline != np.roll(outline, 1, axis=0)).any(axis=1)
        return self._lattice.to_metres(outline[differs])

    def contains(self, points: npt.ArrayLike) -> Bool:
        """Return which points are visible.

        Args:
            points: (…, 2) [m]; each is rounded to the nearest lattice point.

        Returns:
            bool (…).
        """
        lattice_points = self._lattice.to_lattice(points)
        flat = np.ascontiguousarray(lattice_points.reshape(-1, 2))
        is_inside = kernels.region_contains_points(
            self._mesh, *self.eye, self.right, self.wall, flat
        )
        return is_inside.reshape(lattice_points.shape[:-1])


class FieldOfView(Component):
    """Base of the methods that decide what is in view; a subclass writes `visible`.

    Positions are lattice points, headings 1/4096 of a turn counter-clockwise from +x (see
    ``home.lattice``), so that results can be exact. A method may cache results, but a result
    must depend only on its arguments and on the present walls, ``home.walls``.

    Example:
        >>> import fleet2d
        >>> from fleet2d.sight.fov import LineOfSight
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> x, y = home.lattice.to_lattice(home.rooms[0].anchor_xy).tolist()
        >>> reach = Reach(near_squared=0, far_squared=5000**2, half_angle=1024)
        >>> LineOfSight().sees(home, x, y, 0, reach, np.array([[x + 9, y], [x - 9, y]])).tolist()
        [True, False]
    """

    kind = "sight"

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
            heading: Heading of the camera [1/4096 turn].
            reach: Its range and angle.
            points: int64 (n, 2).

        Returns:
            bool (n,).
        """
        in_view = kernels.points_in_reach(x, y, heading, reach, points)
        if in_view.any():
            in_view[in_view] = self.visible(home, x, y, points[in_view])
        return in_view

    def cells(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells have their centre in view: bool (rows, columns)."""
        lattice = home.lattice
        rows, columns = np.indices((lattice.rows, lattice.columns))
        cells = np.stack([columns.ravel(), rows.ravel()], axis=1)
        centres = (cells * SUB + CELL_CENTRE).astype(np.int64)
        return self.sees(home, x, y, heading, reach, centres).reshape(rows.shape)


class LineOfSight(FieldOfView):
    """Follow the line to each point through the home, without a cache.

    This is the default: robots look at a few people at a time from ever new places, and a line
    costs a twentieth of a microsecond, less than a lookup in a cache.
    """

    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points have a line of sight to (x, y)."""
        return kernels.points_in_sight(home.walls, x, y, points)
