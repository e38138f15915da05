"""Fields of view: what is visible from a place, by lines of sight, polygons, or cached views."""

import hashlib
import os
from abc import abstractmethod
from collections import OrderedDict
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray
from pydantic import Field

from fleet2d import kernels
from fleet2d.configuration.components import Component
from fleet2d.configuration.problems import problem_at
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import CELL_CENTRE, F64, I32, I64, SUB, TURN, U8, Bool, Mesh, Reach
from fleet2d.kernels import visible_region as visible_region_fast

__all__ = ["Bool", "FieldOfView", "Flashlight", "LineOfSight", "Reach", "VisibilityPolygon"]
Pieces = tuple[I32, I32]
FORMAT = 1
# Memory for the poses of a flashlight; the least recently used go first.
MEMORY_BYTES = 64e6
# Memory of an entry besides its bits: keys, tuple and array.
ENTRY_BYTES = 450


class WallPlan(Protocol):
    """Protocol of plans with walls, as lines of sight need them: such as a floor plan."""

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
            points: (…, 2) [m]; each counts as the nearest lattice point.

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
    ``home.plan.lattice``), so that results can be exact. A method may cache results, but a result
    must depend only on its arguments and on the present walls, ``home.walls``.

    Example:
        >>> import fleet2d
        >>> from fleet2d.sight.fov import LineOfSight
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> x, y = home.plan.lattice.to_lattice(home.rooms[0].anchor_xy).tolist()
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
            heading: Where it looks [1/4096 turn].
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
        lattice = home.plan.lattice
        rows, columns = np.indices((lattice.rows, lattice.columns))
        centres = np.stack([columns.ravel(), rows.ravel()], axis=1) * SUB + CELL_CENTRE
        return self.sees(home, x, y, heading, reach, centres.astype(np.int64)).reshape(rows.shape)


class LineOfSight(FieldOfView):
    """Follow the line to each point through the home, without a cache.

    This is the default: robots look at a few people at a time from ever new places, and a line
    costs a twentieth of a microsecond, less than a lookup in a cache.
    """

    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points have a line of sight to (x, y)."""
        return kernels.points_in_sight(home.walls, x, y, points)


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


class VisibilityPolygon(FieldOfView):
    """Compute the region visible from a place once, then look points up in it.

    It is worthwhile where many points are tested from few places. A region takes 8 bytes a piece,
    about 200 bytes in a smooth plan and 1 kB in one traced from a sensor.

    Attributes:
        precompute: The regions to compute: `visited`: of the places that cameras look from; `all`:
            also of the centres of all cells, before the run; `file`: the same, from a file that
            processes share.
        path: The folder of the files, with `precompute: file`; created if missing.
        keep: Number of visited places whose regions are cached.
    """

    precompute: Literal["visited", "all", "file"] = "visited"
    path: Path | None = None
    keep: int = Field(default=4096, ge=1)

    def model_post_init(self, _: object, /) -> None:
        """Require a path if the regions are in a file, and only then."""
        if (self.path is not None) != (self.precompute == "file"):
            raise problem_at(("path",), "give 'path' with precompute: file, and only with it")

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
        row, column = y // SUB, x // SUB
        if self._regions is not None and (x, y) == home.plan.lattice.cell_centre(row, column):
            number, start, right, wall = self._regions
            if 0 <= row < number.shape[0] and 0 <= column < number.shape[1]:
                cell = number[row, column]
                if cell >= 0:
                    pieces = slice(start[cell], start[cell + 1])
                    return np.array(right[pieces]), np.array(wall[pieces])  # of a file: read only
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
        elif self.path is not None:
            self._regions = _shared_regions(home, self.path)


def filled_cells(home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
    """Return the cells in view by filling the visible region: bool (rows, columns)."""
    lattice = home.plan.lattice
    grid = (lattice.rows, lattice.columns)
    mask = np.zeros(grid, np.bool_)
    kernels.mark_spans(kernels.cells_in_view(home.walls, x, y, heading, reach, *grid), mask)
    return mask


def _regions_of(home: Home) -> Regions:
    lattice = home.plan.lattice
    triangles = kernels.rasterize_cells(home.walls, lattice.rows, lattice.columns)
    cells = np.ascontiguousarray(np.argwhere(triangles >= 0))
    start, right, wall = kernels.regions_of_cells(home.walls, cells, triangles)
    return Regions(_numbers(triangles), start.astype(np.int32), right, wall)


def _numbers(triangles: I32) -> I32:
    free = triangles >= 0
    return np.where(free, np.cumsum(free.ravel()).reshape(free.shape) - 1, -1).astype(np.int32)


def _shared_regions(home: Home, folder: Path) -> Regions:
    """Return the regions of all cells from the file for these walls; create it if missing."""
    lattice = home.plan.lattice
    walls = home.walls
    digest = hashlib.sha256(f"{FORMAT} {lattice.rows} {lattice.columns}".encode())
    for array in (walls.vertices, walls.triangles, walls.neighbors):
        digest.update(np.ascontiguousarray(array).astype("<i8").tobytes())
    file = folder / f"regions-{digest.hexdigest()[:24]}.npy"
    try:
        if not file.exists():
            _write(file, _regions_of(home))
        numbers: NDArray[Any] = np.load(file, mmap_mode="r")
    except (OSError, ValueError, EOFError) as error:
        raise ScenarioError(
            f"sight.method.path: {file} can't be used: {error}; remove it, or name another folder"
        ) from None
    triangles = kernels.rasterize_cells(walls, lattice.rows, lattice.columns)
    cells = int((triangles >= 0).sum())
    pieces = int(numbers[cells]) if numbers.ndim == 1 and len(numbers) > cells else -1
    if numbers.dtype != np.dtype("<i4") or len(numbers) != cells + 1 + 2 * pieces:
        raise ScenarioError(
            f"sight.method.path: {file} is damaged: remove it, and it is created again"
        )
    start = numbers[: cells + 1]
    rest = numbers[cells + 1 :]
    return Regions(_numbers(triangles), start, rest[:pieces], rest[pieces:])


def _write(file: Path, regions: Regions) -> None:
    """Write regions so that other processes see the whole file, or none."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f".{file.name}.{os.getpid()}")
    with partial.open("wb") as out:
        np.save(out, np.concatenate([regions.start, regions.right, regions.wall]).astype("<i4"))
    partial.replace(file)


class CellBits(NamedTuple):
    """The cells in view of a pose, as bits of the smallest box round them."""

    row: int
    column: int
    rows: int
    columns: int
    bits: U8


class Flashlight(FieldOfView):
    """Cache the set of cells in view of each pose, and look points up by their cell.

    A point is in view if the centre of its cell is, so it is exact for the centres of cells, and
    up to half a cell elsewhere. A pose takes 1 to 2 kB with a range of 4.5 m and cells of 5 cm.
    """

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
        cells = self._lookup(home, x, y, heading, reach)
        lattice = home.plan.lattice
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
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return CellBits(0, 0, 0, 0, np.zeros(0, np.uint8))
    box = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    height, width = box.shape
    return CellBits(int(rows[0]), int(columns[0]), height, width, np.packbits(box))
