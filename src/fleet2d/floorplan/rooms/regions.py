"""Regions: the parts of a floor plan that a file labels, on the lattice and in cells."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.rooms.vocabulary import leading_type, room_type
from fleet2d.kernels import I64, Bool

NOT_FREE = -1
TO_CENTRE = UNITS_PER_CELL // 2 + 1


@dataclass(frozen=True)
class LabelledRegion:
    """A part of a floor plan that a file gives a name to.

    Attributes:
        labels: Its labels, as spelled in the file; none for a region of unknown use.
        shape: Its outline [m]; it may reach over walls and over other regions.
        name: Name of the room, or None to be numbered by type (`bedroom_0`).
        type: Type of the room, or None for the one of its labels that leads.
    """

    labels: tuple[str, ...]
    shape: Polygon | MultiPolygon
    name: str | None = None
    type: str | None = None

    @property
    def types(self) -> tuple[str, ...]:
        """The labels as room types, each once."""
        return tuple(dict.fromkeys(room_type(label) for label in self.labels))


@dataclass(frozen=True)
class Region:
    """A region on the lattice, with the regions of the same shape merged into it.

    Attributes:
        types: Its labels as room types, each once.
        shape: Its outline [lattice], even coordinates; empty for one that is only cells.
        name: Name of the room, or None to be numbered by type.
        own_type: Type of the room, or None for the one of its types that leads.
    """

    types: tuple[str, ...]
    shape: Polygon | MultiPolygon
    name: str | None = None
    own_type: str | None = None

    @property
    def type(self) -> str:
        """The type of the room."""
        return self.own_type or leading_type(self.types)


@dataclass(frozen=True)
class Patch:
    """Some cells of a plan.

    Attributes:
        window: The rows and columns that they are in.
        mask: Which cells of the window they are.
    """

    window: tuple[slice, slice]
    mask: Bool

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(np.count_nonzero(self.mask))

    @property
    def frame(self) -> I64:
        """The box around its cells: first row, first column, last row + 1, last column + 1."""
        rows, columns = (np.flatnonzero(self.mask.any(axis=axis)) for axis in (1, 0))
        first = np.array([self.window[0].start, self.window[1].start])
        if len(rows) == 0:
            return np.concatenate([first, first])
        low, high = np.array([rows[0], columns[0]]), np.array([rows[-1], columns[-1]]) + 1
        return np.concatenate([first + low, first + high])


def snap_regions(lattice: Lattice, regions: Sequence[LabelledRegion]) -> list[Region]:
    """Return the regions on the lattice; regions of equal shape become one, with all labels."""
    return _merge_equal([_snap(lattice, region) for region in regions])


def paint_regions(free: Bool, regions: list[Region]) -> I64:
    """Return the index of the region of each cell, int64 (rows, columns).

    The smallest region wins. Free cells outside all regions have `len(regions)`, others -1.
    """
    painted = np.where(free, len(regions), NOT_FREE).astype(np.int64)
    by_area = sorted(range(len(regions)), key=lambda k: (-regions[k].shape.area, -k))
    for k in by_area:
        _paint_one(painted, regions[k].shape, k)
    return painted


def _paint_one(painted: I64, shape: Polygon | MultiPolygon, value: int) -> None:
    """Give `value` to the free cells whose centre lies inside `shape`."""
    if not shape.is_empty:
        window = _window(painted.shape, shape)
        painted[window][_inside(painted[window] != NOT_FREE, window, shape)] = value


def _window(size: tuple[int, ...], shape: Polygon | MultiPolygon) -> tuple[slice, slice]:
    """Return the rows and columns of the cells whose centre lies in the box around a shape."""
    # Shapes have even coordinates and centres odd ones, so no centre is on the side of a box.
    x0, y0, x1, y1 = ((int(v) - TO_CENTRE) // UNITS_PER_CELL + 1 for v in shape.bounds)
    row, end_row = (min(max(y, 0), size[0]) for y in (y0, y1))
    column, end_column = (min(max(x, 0), size[1]) for x in (x0, x1))
    return slice(row, end_row), slice(column, end_column)


def _inside(free: Bool, window: tuple[slice, slice], shape: Polygon | MultiPolygon) -> Bool:
    """Return which free cells of a window have their centre inside a shape."""
    inside = free.copy()
    if not shape.equals(shapely.box(*shape.bounds)):
        y, x = np.nonzero(inside)
        centre_x = (x + window[1].start) * UNITS_PER_CELL + TO_CENTRE
        centre_y = (y + window[0].start) * UNITS_PER_CELL + TO_CENTRE
        shapely.prepare(shape)
        inside[y, x] = shapely.contains_xy(shape, centre_x, centre_y)
    return inside


def cells_in(free: Bool, shape: Polygon | MultiPolygon) -> Patch:
    """Return the free cells inside a shape."""
    if shape.is_empty:
        return Patch((slice(0, 0), slice(0, 0)), np.zeros((0, 0), np.bool_))
    window = _window(free.shape, shape)
    return Patch(window, _inside(free[window], window, shape))


def _snap(lattice: Lattice, region: LabelledRegion) -> Region:
    shape = shapely.transform(region.shape, lambda xy: lattice.to_walls(xy).astype(np.float64))
    return Region(region.types, shapely.normalize(shape), region.name, region.type)


def _merge_equal(regions: list[Region]) -> list[Region]:
    """Join regions of exactly the same shape, at the place of the first."""
    by_shape: dict[bytes, Region] = {}
    for region in regions:
        key = shapely.to_wkb(region.shape)
        first = by_shape.get(key)
        if first is None:
            by_shape[key] = region
            continue
        types = tuple(dict.fromkeys(first.types + region.types))
        by_shape[key] = Region(
            types, first.shape, first.name or region.name, first.own_type or region.own_type
        )
    return list(by_shape.values())
