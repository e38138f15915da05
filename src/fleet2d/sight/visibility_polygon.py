"""Visibility polygons: the regions visible from places, in a cache."""

import hashlib
import os
from collections import OrderedDict
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import problem_at
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import Home
from fleet2d.kernels import (
    I32,
    I64,
    SUB,
    Bool,
    Mesh,
    cells_in_view,
    mark_spans,
    rasterize_cells,
    region_contains_points,
    regions_of_cells,
    visible_region,
)
from fleet2d.sight.fov import FieldOfView, Reach

Pieces = tuple[I32, I32]

FORMAT = 1


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


@register("sight", "visibility_polygon")
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

    @model_validator(mode="after")
    def _path_goes_with_file(self) -> Self:
        if (self.path is not None) != (self.precompute == "file"):
            raise problem_at(("path",), "give 'path' with precompute: file, and only with it")
        return self

    def start(self, home: Home) -> None:
        """Compute the regions of all cells, if configured."""
        self._reset(home)

    def visible(self, home: Home, x: int, y: int, points: I64) -> Bool:
        """Return which points are in the region of (x, y)."""
        right, wall = self._region(home, x, y)
        return region_contains_points(home.walls, x, y, right, wall, points)

    def cells(self, home: Home, x: int, y: int, heading: int, reach: Reach) -> Bool:
        """Return which cells have their centre in the region, cut by range and angle."""
        return filled_cells(home, x, y, heading, reach)

    def _region(self, home: Home, x: int, y: int) -> Pieces:
        if getattr(self, "_walls", None) is not home.walls:
            self._reset(home)
        row, column = y // SUB, x // SUB
        if self._regions is not None and (x, y) == home.plan.lattice.cell_centre(row, column):
            number, start, right, wall = self._regions
            if 0 <= row < number.shape[0] and 0 <= column < number.shape[1]:
                cell = number[row, column]
                if cell >= 0:
                    pieces = slice(start[cell], start[cell + 1])
                    return np.array(right[pieces]), np.array(wall[pieces])  # of a file: read only
        region = self._visited.pop((x, y), None) or visible_region(home.walls, x, y)
        self._visited[x, y] = region
        if len(self._visited) > self.keep:
            self._visited.popitem(last=False)
        return region

    def _reset(self, home: Home) -> None:
        """Empty the cache, for the present walls of the home."""
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
    mark_spans(cells_in_view(home.walls, x, y, heading, reach, *grid), mask)
    return mask


def _regions_of(home: Home) -> Regions:
    lattice = home.plan.lattice
    triangles = rasterize_cells(home.walls, lattice.rows, lattice.columns)
    cells = np.ascontiguousarray(np.argwhere(triangles >= 0))
    start, right, wall = regions_of_cells(home.walls, cells, triangles)
    return Regions(_numbers(triangles), start.astype(np.int32), right, wall)


def _numbers(triangles: I32) -> I32:
    free = triangles >= 0
    return np.where(free, np.cumsum(free.ravel()).reshape(free.shape) - 1, -1).astype(np.int32)


def _shared_regions(home: Home, folder: Path) -> Regions:
    """Return the regions of all cells from the file for these walls; create it if missing."""
    lattice, walls = home.plan.lattice, home.walls
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
    triangles = rasterize_cells(walls, lattice.rows, lattice.columns)
    cells = int((triangles >= 0).sum())
    pieces = int(numbers[cells]) if numbers.ndim == 1 and len(numbers) > cells else -1
    if numbers.dtype != np.dtype("<i4") or len(numbers) != cells + 1 + 2 * pieces:
        raise ScenarioError(
            f"sight.method.path: {file} is damaged: remove it, and it is created again"
        )
    start, rest = numbers[: cells + 1], numbers[cells + 1 :]
    return Regions(_numbers(triangles), start, rest[:pieces], rest[pieces:])


def _write(file: Path, regions: Regions) -> None:
    """Write regions so that other processes see the whole file, or none."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f".{file.name}.{os.getpid()}")
    with partial.open("wb") as out:
        np.save(out, np.concatenate([regions.start, regions.right, regions.wall]).astype("<i4"))
    partial.replace(file)
