"""A floor plan: walls, the triangle mesh and the cells between them, and their rooms."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.mesh import GRID, Snapped, build_mesh, snap_polygon
from fleet2d.floorplan.rooms import NO_ROOM, LabelledRegion, Room, assign_rooms, beside_rooms
from fleet2d.floorplan.vocabulary import room_type
from fleet2d.kernels.mesh import Mesh, rasterize_cells, strictly_inside
from fleet2d.problems import did_you_mean

__all__ = ["FloorPlan", "LabelledRegion", "Room"]

# A free space with more parts than this gets no list of their sizes in its notes.
PARTS_LISTED = 5

# Lattice units within which a coordinate read from decimals counts as on the lattice.
ON_WALL = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class FloorPlan:
    """The inside of a home, immutable; plans of equal content are equal.

    Attributes:
        name: What it is called.
        source: Where it comes from, for people to read; not part of the content.
        lattice: The cells that cover it.
        polygons: Free space [lattice], even integer coordinates, counter-clockwise outside.
        mesh: The same free space in triangles [lattice].
        free: Cells whose centre is strictly inside the free space, bool (rows, columns).
        room_of_cell: Index of each cell's room, -1 where not free, int16 (rows, columns).
        rooms: The rooms by index: disjoint, and together all free cells.
        entrance: A place just inside the front door (x, y) [m], where the file gives one.
        notes: What was odd in the file and what was made of it; not part of the content.

    Example:
        >>> kitchen = LabelledRegion(("Kitchen",), shapely.box(0, 0, 2, 3))
        >>> plan = FloorPlan.build("flat", shapely.box(0, 0, 5, 3), [kitchen])
        >>> [(room.name, round(room.area_m2, 2)) for room in plan.rooms]
        [('kitchen_0', 6.0), ('unknown_0', 9.0)]
        >>> plan.room_at(1.0, 1.0).name, plan.room_at(6.0, 1.0)
        ('kitchen_0', None)
    """

    name: str
    source: str
    lattice: Lattice
    polygons: list[Polygon]
    mesh: Mesh
    free: NDArray[np.bool_]
    room_of_cell: NDArray[np.int16]
    rooms: tuple[Room, ...]
    entrance: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    @classmethod
    def build(
        cls,
        name: str,
        free: Polygon | MultiPolygon,
        regions: Sequence[LabelledRegion] = (),
        cell: float = 0.05,
        *,
        source: str = "",
        entrance: tuple[float, float] | None = None,
        notes: Sequence[str] = (),
    ) -> Self:
        """Make a floor plan of free space and labels, both in metres.

        Args:
            name: What to call it.
            free: The free space between the walls [m].
            regions: What the rooms are, in the order that numbers them.
            cell: Side of a cell [m].
            source: Where the plan comes from.
            entrance: A place just inside the front door [m].
            notes: What the caller found odd.

        Raises:
            FloorPlanError: There is no free space at this cell size, it would lose more of its area
                than rounding explains, it is too large, or the entrance is not in it.
        """
        lattice, polygons = _snapped(name, free, cell)
        mesh = build_mesh(polygons, lattice.columns, lattice.rows)
        cells: NDArray[np.bool_] = rasterize_cells(mesh, lattice.rows, lattice.columns) >= 0
        if not cells.any():
            raise FloorPlanError(
                f"the free space of {name} holds no cell of {cell:g} m: choose a smaller"
                " floorplan.cell, and check that the file is in metres"
            )
        room_of_cell, rooms, room_notes = assign_rooms(lattice, cells, regions)
        cells.setflags(write=False)
        room_of_cell.setflags(write=False)
        plan = cls(
            name=name,
            source=source,
            lattice=lattice,
            polygons=polygons,
            mesh=mesh,
            free=cells,
            room_of_cell=room_of_cell,
            rooms=rooms,
            entrance=entrance,
            notes=(*notes, *_part_notes(lattice, polygons), *room_notes),
        )
        plan._check_entrance()
        return plan

    def __eq__(self, other: object) -> bool:
        """Compare the content."""
        return isinstance(other, FloorPlan) and self.digest == other.digest

    def __hash__(self) -> int:
        """Hash the content."""
        return hash(self.digest)

    def __repr__(self) -> str:
        """Say which plan it is in a line."""
        return (
            f"<FloorPlan {self.name}: {self.area_m2:.1f} m2, {len(self.rooms)} rooms,"
            f" {self.lattice.columns} x {self.lattice.rows} cells of {self.lattice.cell:g} m>"
        )

    def __copy__(self) -> Self:
        """Return itself: nothing in it changes."""
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return itself: nothing in it changes, so that branches of a run share it."""
        return self

    @cached_property
    def area_m2(self) -> float:
        """Area of the free space as snapped [m²], exact, cells not involved."""
        units2 = sum(polygon.area for polygon in self.polygons)
        return float(units2) / self.lattice.units_per_m**2

    @cached_property
    def room_of_place(self) -> NDArray[np.int16]:
        """Index of the room of a place in each cell, int16 (rows, columns), -1 inside walls.

        As `room_of_cell`, but a cell that a wall cuts, so that its centre isn't free, has the room
        of a free cell beside it: somebody may stand in the part that is.
        """
        rooms = beside_rooms(self.room_of_cell)
        rooms.setflags(write=False)
        return rooms

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """The smallest box around the free space (x0, y0, x1, y1) [m]."""
        corners = np.reshape(shapely.total_bounds(self.polygons), (2, 2))
        (x0, y0), (x1, y1) = self.lattice.to_metres(corners).tolist()
        return x0, y0, x1, y1

    @cached_property
    def digest(self) -> str:
        """SHA-256 of name, walls, cells, rooms and entrance; the same on any machine."""
        lattice = self.lattice
        head = {
            "name": self.name,
            "lattice": [lattice.cell, *lattice.origin, lattice.columns, lattice.rows],
            "rooms": [[room.name, room.type, *room.labels] for room in self.rooms],
            "entrance": self.entrance,
            "rings": [[len(ring.coords) for ring in rings(p)] for p in self.polygons],
        }
        content = hashlib.sha256(json.dumps(head).encode())
        content.update(shapely.get_coordinates(self.polygons).astype("<i8").tobytes())
        content.update(self.room_of_cell.astype("<i2").tobytes())
        return content.hexdigest()

    def room_at(self, x: float, y: float) -> Room | None:
        """Return the room that holds a place [m], or None outside the home and inside a wall."""
        row, column = self.lattice.cell_of(*self.lattice.to_lattice((x, y)).tolist())
        if not (0 <= row < self.lattice.rows and 0 <= column < self.lattice.columns):
            return None
        index = int(self.room_of_place[row, column])
        return None if index == NO_ROOM else self.rooms[index]

    def room(self, name: str | int) -> Room:
        """Return a room by its name or index.

        Raises:
            FloorPlanError: The plan has no such room.
        """
        if isinstance(name, int):
            if 0 <= name < len(self.rooms):
                return self.rooms[name]
            raise FloorPlanError(
                f"{self.name} has no room {name}: its rooms are 0 to {len(self.rooms) - 1}"
            )
        names = [room.name for room in self.rooms]
        if name in names:
            return self.rooms[names.index(name)]
        raise FloorPlanError(
            f"{self.name} has no room {name!r}{did_you_mean(name, names)}"
            f" Its rooms are: {', '.join(names)}"
        )

    def rooms_of_type(self, kind: str) -> tuple[Room, ...]:
        """Return the rooms of a type, then those that only have it as a further label."""
        wanted = room_type(kind)
        first = [room for room in self.rooms if room.type == wanted]
        return (*first, *(r for r in self.rooms if wanted in r.labels and r.type != wanted))

    def named(self, name: str) -> Self:
        """Return the same plan under another name."""
        return replace(self, name=name)

    def nearest_free(self, x: float, y: float) -> tuple[float, float]:
        """Return the centre of the free cell nearest to a place [m]; ties: lowest row, column."""
        rows, columns = np.nonzero(self.free)
        axis_x, axis_y = self.lattice.centre_axes()
        at_x, at_y = np.clip(self.lattice.to_lattice(np.clip((x, y), -1e6, 1e6)), -(2**24), 2**24)
        away = (axis_x[columns] - at_x) ** 2 + (axis_y[rows] - at_y) ** 2
        nearest = int(np.argmin(away))
        centre = self.lattice.cell_centre(int(rows[nearest]), int(columns[nearest]))
        near_x, near_y = self.lattice.to_metres(centre).tolist()
        return near_x, near_y

    def to_native(self) -> dict[str, Any]:
        """Return the plan in Fleet2D's own file format; reading it back gives an equal plan."""
        from fleet2d.floorplan.native import native_document

        return native_document(self)

    def _check_entrance(self) -> None:
        if self.entrance is None:
            return
        x, y = self.entrance
        at = self.lattice.to_lattice(self.entrance).tolist()
        if not strictly_inside(self.mesh, *at):
            free_x, free_y = self.nearest_free(x, y)
            raise FloorPlanError(
                f"the entrance of {self.name} at ({x:g}, {y:g}) m is not in free space: the nearest"
                f" free cell is at ({free_x:.2f}, {free_y:.2f}) m"
            )


def rings(polygon: Polygon) -> list[shapely.LinearRing]:
    """Return the rings of a polygon, the outer one first."""
    return [polygon.exterior, *polygon.interiors]


def _snapped(name: str, free: Polygon | MultiPolygon, cell: float) -> tuple[Lattice, list[Polygon]]:
    """Put free space [m] on the lattice; in one order, so that the same walls are the same plan."""
    if free.is_empty or not free.area > 0:
        raise FloorPlanError(
            f"the outline of {name} encloses no area: check that its points go round the free space"
        )
    first = Lattice.around(free.bounds, cell)
    snapped = _on_walls(free, first.units_per_m)
    if not snapped.polygons:
        raise FloorPlanError(
            f"nothing is left of {name} ({free.area:.3g} m2) at cells of {cell:g} m: choose a"
            " smaller floorplan.cell, and check that the file is in metres"
        )
    if abs(snapped.area_change) > snapped.tolerance:
        change = snapped.area_change / first.units_per_m**2
        raise FloorPlanError(
            f"rounding the walls of {name} to cells of {cell:g} m would change its area by"
            f" {change:+.2f} of {free.area:.2f} m2: choose a smaller floorplan.cell, and check that"
            " the outline doesn't run over itself"
        )
    # The lattice of the snapped walls, so that a plan and its stored copy agree.
    corners = shapely.total_bounds(snapped.polygons) / first.units_per_m
    lattice = Lattice.around(tuple(corners.tolist()), cell)
    shift = lattice.to_lattice((0.0, 0.0))
    moved = [shapely.transform(polygon, lambda xy: xy + shift) for polygon in snapped.polygons]
    canonical = shapely.orient_polygons(shapely.normalize(moved))
    return lattice, sorted(canonical.tolist(), key=lambda p: shapely.get_coordinates(p).tolist())


def _on_walls(free: Polygon | MultiPolygon, units_per_m: float) -> Snapped:
    """Move free space [m] to where walls may stand; what stands there already is not touched.

    Snapping is not idempotent (a wall that moves may come near another corner), and a stored plan
    must come back as it was.
    """
    exact = shapely.transform(free, lambda xy: xy * units_per_m)
    even = shapely.transform(exact, lambda xy: 2 * np.rint(xy / 2))
    moved = np.abs(shapely.get_coordinates(even) - shapely.get_coordinates(exact)).max()
    if moved < ON_WALL and even.is_valid:
        parts = shapely.get_parts(even)
        return Snapped(parts.tolist(), even.area - exact.area, GRID * exact.length)
    return snap_polygon(exact)


def _part_notes(lattice: Lattice, polygons: list[Polygon]) -> list[str]:
    if len(polygons) == 1:
        return []
    areas = sorted((p.area / lattice.units_per_m**2 for p in polygons), reverse=True)
    sizes = ", ".join(f"{area:.2f}" for area in areas[:PARTS_LISTED])
    more = ", …" if len(areas) > PARTS_LISTED else ""
    return [f"the free space is in {len(areas)} parts that nothing joins: {sizes}{more} m2"]
