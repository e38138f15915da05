"""A floor plan: walls, the triangle mesh and the cells between them, and their rooms."""

import hashlib
import json
import os
import pickle
import zlib
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.bounds import CORNERS, POLYGONS, ROOM_CORNERS, ROOMS
from fleet2d.errors import FloorPlanError, PlacementError
from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice, unit_hint
from fleet2d.floorplan.mesh import (
    build_mesh,
    canonical_order,
    free_on_lattice,
    glazed,
    part_notes,
    snap_polygon,
)
from fleet2d.floorplan.placed_objects import (
    PORTAL_REACH_M,
    PlacedObject,
    Portal,
    UsePlace,
    describe_object,
    find_named,
    number_objects,
)
from fleet2d.floorplan.rooms.doorways import (
    DoorLine,
    Doorway,
    RoomLink,
    fit_lines,
    name_doorways,
    room_links,
)
from fleet2d.floorplan.rooms.room import NO_ROOM, LabelledRegion, Room, assign_rooms, room_type
from fleet2d.kernels import (
    I16,
    I64,
    Bool,
    Mesh,
    fill_from_neighbors,
    label_parts,
    rasterize_cells,
    strictly_inside,
)
from fleet2d.runtime.determinism import sum_in_order

if TYPE_CHECKING:
    from fleet2d.floorplan.rooms.division import Passages, RegionKind

T = TypeVar("T")


class Cache:
    """A cache of the most recently used values by key, each computed at its first use.

    Threads may share a cache: if two make the same value at a time, both get the first.

    Example:
        >>> cache = Cache(size=2)
        >>> [cache.get(key, lambda: [key]) for key in "aba"]
        [['a'], ['b'], ['a']]
        >>> cache.get("a", list) is cache.get("a", list), len(cache)
        (True, 2)
    """

    def __init__(self, size: int) -> None:
        """Make an empty cache that holds at most `size` values."""
        self._size = size
        self._values: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self._values)

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key; if `make` raises, nothing is stored."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        new = make()
        with self._lock:
            value = self._values.setdefault(key, new)
            while len(self._values) > self._size:
                self._values.popitem(last=False)
        return value

    def grow(self, size: int) -> None:
        """Raise the capacity to at least `size` values."""
        self._size = max(self._size, size)


class FolderCache:
    """A cache in a folder, which the worker processes of a command share.

    Values are pickled, so nobody else may write to the folder.

    Example:
        >>> import tempfile
        >>> cache = FolderCache()
        >>> with tempfile.TemporaryDirectory() as folder, cache.within(Path(folder)):
        ...     cache.get("a", lambda: 1), cache.get("a", lambda: 2)
        (1, 1)
        >>> cache.get("a", lambda: 2)
        2
    """

    def __init__(self) -> None:
        """Use no folder."""
        self._folder: Path | None = None

    @property
    def is_open(self) -> bool:
        """Whether it uses a folder."""
        return self._folder is not None

    @contextmanager
    def within(self, folder: Path | None) -> Iterator[None]:
        """Use a folder for the time of a block; None: no folder."""
        before = self._folder
        self._folder = folder
        try:
            yield
        finally:
            self._folder = before

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key, whose `repr` tells it from others, made by the first process.

        Where the folder can't be used, as on another machine, it is made again.
        """
        if self._folder is None:
            return make()
        file = self._folder / hashlib.sha256(repr(key).encode()).hexdigest()
        with suppress(OSError, EOFError, zlib.error, pickle.UnpicklingError):
            value: T = pickle.loads(zlib.decompress(file.read_bytes()))  # noqa: S301 - our own
            return value
        value = make()
        part = file.with_suffix(f".{os.getpid()}")
        with suppress(OSError):
            part.write_bytes(zlib.compress(pickle.dumps(value), 1))
            part.replace(file)
        return value


HOME_FOLDER = FolderCache()
"""Homes, read and furnished, and their spaces: for all processes of a command that runs many
scenarios."""

A = TypeVar("A", bound=NDArray[Any])


def read_only(array: A) -> A:
    """Return the same array, made read-only because several runs share it."""
    array.setflags(write=False)
    return array


def cells_of(mask: Bool) -> I64:
    """Return the cells (row, column) of a mask (rows, columns), int64 (n, 2), row by row.

    NumPy's `argwhere` does so, too, but takes several times as long for two dimensions.

    Example:
        >>> cells_of(np.array([[False, True], [True, False]])).tolist()
        [[0, 1], [1, 0]]
    """
    return np.stack(np.divmod(np.flatnonzero(mask), mask.shape[1]), axis=1)


def largest_part(mask: Bool, within: Bool | None = None) -> Bool:
    """Return the connected part of a mask with the most cells, counting only `within` if given."""
    part = label_parts(np.ascontiguousarray(mask), False)
    sizes = np.bincount(part[mask if within is None else mask & within], minlength=1)
    return mask & (part == int(np.argmax(sizes)))


def cell_polygons(mask: Bool) -> list[Polygon]:
    """Return the area of cells as polygons [lattice]: the union of their runs along the rows."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    corners = np.stack([first, row, end, row + 1]).astype(np.float64) * UNITS_PER_CELL
    return shapely.get_parts(shapely.union_all(shapely.box(*corners))).tolist()


# Fields of parts of a home that are lengths on the floor, or made of them.
_LENGTHS = ("shape", "start", "end", "footprint", "uses", "x", "y", "approach")


def _scaled(part: Any, scale: float) -> Any:
    """Return a part of a home, or a sequence of parts, with all lengths on the floor multiplied."""
    match part:
        case BaseGeometry():
            return shapely.transform(part, lambda xy: xy * scale)
        case LabelledRegion() | DoorLine() | PlacedObject() | UsePlace():
            own = {name: value for name, value in vars(part).items() if name in _LENGTHS}
            return replace(part, **{name: _scaled(value, scale) for name, value in own.items()})
        case float() | int():
            return part * scale
        case None:
            return None
    return tuple(_scaled(item, scale) for item in part)


__all__ = ["FloorPlan", "LabelledRegion", "Room"]


def _areas_without_floor(free: BaseGeometry, no_go: Sequence[Polygon]) -> Iterator[str]:
    """Yield a note on each area to keep out of that has no part of the free space [m]."""
    for number, area in enumerate(no_go):
        if not area.intersects(free):
            x0, y0, x1, y1 = area.bounds
            yield (
                f"no_go.{number}, from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m, has no part of the"
                " floor: robots keep out of nothing there"
            )


@dataclass(frozen=True, eq=False, repr=False)
class FloorPlan:
    """The inside of a home, immutable; plans of equal content are equal.

    Attributes:
        name: Its name.
        source: Its source, for readers; not part of the content.
        lattice: The cells that cover it.
        polygons: Free space [lattice], even integer coordinates, counter-clockwise outside.
        mesh: The same free space in triangles [lattice].
        free: Cells whose centre is strictly inside the free space, bool (rows, columns).
        room_of_cell: Index of each cell's room, -1 where not free, int16 (rows, columns).
        rooms: The rooms by index: disjoint, and together all free cells.
        entrance: A place just inside the front door (x, y) [m], where the file gives one.
        doorways: The passages between rooms by index, from the source or found in the walls.
        objects: Furniture and devices, in the order of the source.
        no_go: Areas that robots keep out of [m].
        portals: Stairs and lifts between parts of the free space.
        glass: Areas of glass in walls [lattice], even integer coordinates: people and robots see
            through them and can't walk through them.
        notes: Sentences on anomalies in the file and how it was read; not part of the content.
        regions: The labels as the file gives them; not part of the content.
        lost_doorways: Doorways of the file that stand in no passage; not part of the content.

    Example:
        >>> kitchen = LabelledRegion(("Kitchen",), shapely.box(0, 0, 2, 3))
        >>> plan = FloorPlan.build("flat", shapely.box(0, 0, 5, 3), [kitchen])
        >>> [(room.name, round(room.area_m2, 2)) for room in plan.rooms]
        [('kitchen_1', 6.0), ('unknown_1', 9.0)]
        >>> plan.room_at(1.0, 1.0).name, plan.room_at(6.0, 1.0)
        ('kitchen_1', None)
    """

    name: str
    source: str
    lattice: Lattice
    polygons: tuple[Polygon, ...]
    mesh: Mesh
    free: Bool
    room_of_cell: I16
    rooms: tuple[Room, ...]
    entrance: tuple[float, float] | None = None
    doorways: tuple[Doorway, ...] = ()
    objects: tuple[PlacedObject, ...] = ()
    no_go: tuple[Polygon, ...] = ()
    portals: tuple[Portal, ...] = ()
    glass: tuple[Polygon, ...] = ()
    notes: tuple[str, ...] = ()
    regions: tuple[LabelledRegion, ...] = ()
    lost_doorways: tuple[DoorLine, ...] = ()

    @classmethod
    def build(  # noqa: PLR0913 - the parts of a home, by name
        cls,
        name: str,
        free: Polygon | MultiPolygon,
        regions: Sequence[LabelledRegion] = (),
        cell: float = 0.05,
        *,
        source: str = "",
        entrance: tuple[float, float] | None = None,
        doorways: Sequence[DoorLine] | None = (),
        regions_are: "RegionKind" = "exact",
        objects: Sequence[PlacedObject] = (),
        no_go: Sequence[Polygon] = (),
        glass: Sequence[Polygon] = (),
        notes: Sequence[str] = (),
        scale: float | None = None,
    ) -> Self:
        """Make a floor plan of free space and labels, both in metres.

        Args:
            name: Its name.
            free: The free space between the walls [m].
            regions: The labels of rooms; their order numbers the rooms.
            cell: Side of a cell [m].
            source: The source of the plan, for readers.
            entrance: A place just inside the front door [m].
            doorways: Lines across passages [m]; one that stands in no passage is noted and left
                out. None to search the walls for doorways.
            regions_are: `exact`: the rooms themselves. `segments`: the same, with doorways where
                they meet at a narrow place. `boxes`: rough boxes that label what walls bound.
                `none`: there are none, and rooms are found from the walls. `vacuum`: the same, in
                the map of a vacuum.
            objects: Furniture and devices [m].
            no_go: Areas that robots keep out of [m].
            glass: Areas of glass in walls, which may reach into the free space on both sides [m].
            notes: Sentences on anomalies in the source.
            scale: What all lengths but the cell and heights are multiplied by; None for 1.

        Raises:
            FloorPlanError: There is no free space at this cell size, it would lose more area than
                rounding explains, it is too large, or the entrance is not in it.
        """
        if scale is not None and scale != 1:
            free, regions, objects, no_go, glass = (
                _scaled(part, scale) for part in (free, regions, objects, no_go, glass)
            )
            entrance = _scaled(entrance, scale)
            doorways = _scaled(doorways, scale)
        lines = list(doorways or ())
        POLYGONS.check(len(regions) + len(objects) + len(lines), "it", FloorPlanError)
        ROOMS.check(len(regions), "it", FloorPlanError)
        for bound, shapes in (
            (CORNERS, [free, *(thing.footprint for thing in objects)]),
            (ROOM_CORNERS, [region.shape for region in regions]),
        ):
            bound.check(int(shapely.get_num_coordinates(shapes).sum()), "it", FloorPlanError)
        lattice, polygons = free_on_lattice(name, free, cell)
        polygons, segments, door_notes = fit_lines(lattice, polygons, lines)
        passages: Passages | None = None
        if doorways is None or regions_are != "exact":
            from fleet2d.floorplan.rooms import division  # files that say where rooms are don't

            polygons, passages = division.search_passages(lattice, polygons, regions_are)
        polygons = canonical_order(polygons)
        mesh = build_mesh(polygons, lattice.columns, lattice.rows)
        cells: Bool = rasterize_cells(mesh, lattice.rows, lattice.columns) >= 0
        if not cells.any():
            raise FloorPlanError(
                f"the free space of {name} holds no cell of {cell:g} m: choose a smaller"
                f" floorplan.cell, and check that the file is in metres{unit_hint(lattice.size)}"
            )
        if passages is None:
            room_of_cell, rooms, room_notes = assign_rooms(lattice, cells, regions)
        else:
            room_of_cell, rooms, room_notes = division.divide(
                lattice, polygons, mesh, cells, regions, regions_are, passages
            )
        found = list(zip(lines, segments, strict=True))
        fitted = [(line, at) for line, at in found if at is not None]
        if doorways is None and passages is not None:
            fitted, polygons = division.select_doorways(
                lattice, polygons, room_of_cell, passages, regions_are
            )
            polygons = canonical_order(polygons)
        names = [room.name for room in rooms]
        panes, glass_notes = glazed(lattice, polygons, glass)
        plan = cls(
            name=name,
            source=source,
            lattice=lattice,
            polygons=tuple(polygons),
            mesh=mesh,
            free=read_only(cells),
            room_of_cell=read_only(room_of_cell),
            rooms=rooms,
            entrance=entrance,
            doorways=name_doorways(lattice, fill_from_neighbors(room_of_cell), names, fitted),
            objects=number_objects(objects),
            no_go=tuple(no_go),
            glass=panes,
            notes=(
                *notes,
                *part_notes(lattice, polygons),
                *room_notes,
                *door_notes,
                *glass_notes,
                *_areas_without_floor(free, no_go),
            ),
            regions=tuple(regions),
            lost_doorways=tuple(line for line, at in found if at is None),
        )
        if entrance is not None and not strictly_inside(mesh, *lattice.point_at(entrance)):
            free_x, free_y = plan.nearest_free(*entrance)
            raise FloorPlanError(
                f"the entrance of {name} at ({entrance[0]:g}, {entrance[1]:g}) m is not in free"
                f" space: the nearest free cell is at ({free_x:.2f}, {free_y:.2f}) m"
            )
        return plan

    def __eq__(self, other: object) -> bool:
        """Compare the content."""
        return isinstance(other, FloorPlan) and self.digest == other.digest

    def __hash__(self) -> int:
        """Hash the content."""
        return hash(self.digest)

    def __repr__(self) -> str:
        """Return a line with name, area, rooms and cells."""
        return (
            f"<FloorPlan {self.name}: {self.area_m2:.1f} m2, {len(self.rooms)} rooms,"
            f" {self.lattice.columns} x {self.lattice.rows} cells of {self.lattice.cell:g} m>"
        )

    def __copy__(self) -> Self:
        """Return itself, as nothing in it changes."""
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return itself, as nothing in it changes: branches of a run share it."""
        return self

    @cached_property
    def area_m2(self) -> float:
        """Area of the free space on the lattice [m²], exact and independent of cells."""
        units2 = sum_in_order(polygon.area for polygon in self.polygons)
        return float(units2) / self.lattice.units_per_m**2

    @cached_property
    def portal_ends(self) -> I64:
        """The ends of each portal, and how far from them bodies stand: int64 (n, 5) [lattice]."""
        reach = round(PORTAL_REACH_M * self.lattice.units_per_m)
        to_lattice = self.lattice.to_lattice
        rows = [[*to_lattice(p.start), *to_lattice(p.end), reach] for p in self.portals]
        return read_only(np.array(rows, np.int64).reshape(-1, 5))

    @cached_property
    def sight_polygons(self) -> Sequence[Polygon]:
        """The space through which one sees: the free space and glass [lattice]."""
        if not self.glass:
            return self.polygons
        joined = shapely.union_all([*self.polygons, *self.glass])
        return snap_polygon(joined).polygons

    @cached_property
    def sight_mesh(self) -> Mesh:
        """The triangulation of `sight_polygons` [lattice]."""
        if not self.glass:
            return self.mesh
        return build_mesh(self.sight_polygons, self.lattice.columns, self.lattice.rows)

    @cached_property
    def free_space(self) -> MultiPolygon:
        """The free space between the walls [m], in parts as `polygons`."""
        return shapely.transform(MultiPolygon(self.polygons), self.lattice.to_metres)

    @cached_property
    def room_of_place(self) -> I16:
        """Index of the room of a place in each cell, int16 (rows, columns), -1 inside walls.

        Like `room_of_cell`, but a cell that a wall cuts, so that its centre isn't free, has the
        room of a free cell beside it, since part of it may be free.
        """
        return read_only(fill_from_neighbors(self.room_of_cell))

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """The smallest box around the free space (x0, y0, x1, y1) [m]."""
        corners = np.reshape(shapely.total_bounds(self.polygons), (2, 2))
        (x0, y0), (x1, y1) = self.lattice.to_metres(corners).tolist()
        return x0, y0, x1, y1

    def check_inside(self, x: float, y: float) -> None:
        """Refuse a point [m] beyond the free space and all walls within it.

        Raises:
            PlacementError: It is outside `bounds`.
        """
        x0, y0, x1, y1 = self.bounds
        if not (x0 <= x <= x1 and y0 <= y <= y1):
            raise PlacementError(f"({x:g}, {y:g}) m is outside the home, {self._reach}")

    def check_area(self, corners: Sequence[tuple[float, float]]) -> None:
        """Refuse an area, by its corners [m], that has no part of the free space.

        Raises:
            PlacementError: It has none.
        """
        area = Polygon(corners)
        if not area.intersects(self.free_space):
            x0, y0, x1, y1 = area.bounds
            raise PlacementError(
                f"the area from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m has no part of the floor of"
                f" the home, {self._reach}"
            )

    @property
    def _reach(self) -> str:
        """From where to where it reaches, for messages."""
        x0, y0, x1, y1 = self.bounds
        return f"which reaches from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m"

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content, which is all but source and notes; the same on any machine."""
        lattice = self.lattice
        ring_sizes = [shapely.get_num_coordinates(shapely.get_rings(p)) for p in self.polygons]
        head: dict[str, Any] = {
            "name": self.name,
            "lattice": [lattice.cell, *lattice.origin, lattice.columns, lattice.rows],
            "rooms": [[room.name, room.type, *room.labels] for room in self.rooms],
            "entrance": self.entrance,
            "rings": [sizes.tolist() for sizes in ring_sizes],
        }
        # Parts that a plan doesn't have are left out, so that older digests stay valid.
        further = {
            "doorways": [[d.name, *d.start, *d.end, d.leaf] for d in self.doorways],
            "objects": [describe_object(thing) for thing in self.objects],
            "no_go": [shapely.get_coordinates(area).tolist() for area in self.no_go],
            "glass": [shapely.get_coordinates(pane).tolist() for pane in self.glass],
            "portals": [[p.type, *p.start, *p.end, p.takes_us] for p in self.portals],
        }
        head |= {key: part for key, part in further.items() if part}
        content = hashlib.sha256(json.dumps(head).encode())
        content.update(shapely.get_coordinates(self.polygons).astype("<i8").tobytes())
        content.update(self.room_of_cell.astype("<i2").tobytes())
        return content.hexdigest()

    def room_at(self, x: float, y: float) -> Room | None:
        """Return the room that holds a place [m], or None outside the home and inside a wall."""
        return self.room_of_point(*self.lattice.point_at((x, y)))

    def room_of_point(self, x: int, y: int) -> Room | None:
        """Return the room that holds a lattice point, or None in a wall and outside."""
        row, column = self.lattice.cell_of(x, y)
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
        return find_named(self.rooms, name, self.name, "room")

    def doorway(self, name: str | int) -> Doorway:
        """Return a doorway by its name or index.

        Raises:
            FloorPlanError: The plan has no such doorway.
        """
        if isinstance(name, int) and 0 <= name < len(self.doorways):
            return self.doorways[name]
        return find_named(self.doorways, name, self.name, "doorway")

    @cached_property
    def room_graph(self) -> tuple[RoomLink, ...]:
        """The links between rooms: doorways by index, then open borders."""
        return room_links(self.lattice, self.room_of_cell, self.doorways)

    def neighbors(self, room: str | int) -> tuple[Room, ...]:
        """Return the rooms that are linked to a room directly, by index."""
        index = self.room(room).index
        linked = {b for link in self.room_graph for b in link.rooms if index in link.rooms}
        return tuple(self.rooms[other] for other in sorted(linked - {index}))

    def rooms_of_type(self, kind: str) -> tuple[Room, ...]:
        """Return the rooms of a type, then rooms with it as a secondary type (in `labels`)."""
        normal = room_type(kind)
        first = [room for room in self.rooms if room.type == normal]
        return (*first, *(r for r in self.rooms if normal in r.labels and r.type != normal))

    def object(self, name: str) -> PlacedObject:
        """Return an object by its name.

        Raises:
            FloorPlanError: The plan has no such object.
        """
        return find_named(self.objects, name, self.name, "object")

    def objects_in(self, room: Room) -> tuple[PlacedObject, ...]:
        """Return the objects whose middle is in a room."""
        middles = [(thing, thing.footprint.centroid) for thing in self.objects]
        return tuple(thing for thing, at in middles if self.room_at(at.x, at.y) == room)

    def with_portals(self, portals: Sequence[Portal], where: str = "portals") -> Self:
        """Return the same plan with further portals.

        Args:
            portals: The portals.
            where: Their place in a file, for errors.

        Raises:
            FloorPlanError: An end is in no room, or a way leads from one to the other already.
        """
        for number, portal in enumerate(portals):
            ends = (portal.start, portal.end)
            points = [shapely.Point(self.lattice.point_at(at)) for at in ends]
            parts = [[polygon] for polygon in self.polygons]
            is_in: Bool = np.array(shapely.contains(parts, points))
            for k, at in enumerate(ends):
                if not is_in[:, k].any():
                    x, y = self.nearest_free(*at)
                    raise FloorPlanError(
                        f"{where}[{number}]: its end at ({at[0]:g}, {at[1]:g}) m is in no room of"
                        f" {self.name}: the nearest free place is ({x:.2f}, {y:.2f}) m"
                    )
            if is_in.all(axis=1).any():
                raise FloorPlanError(
                    f"{where}[{number}]: a way leads from its one end to the other already: each"
                    " should be on another storey, which is a part of the free space of its own"
                )
        if not portals:
            return self
        joined = (*self.portals, *portals)
        linked = "storeys are linked by stairs and lifts, which robots don't use: "
        unjoined = part_notes(self.lattice, self.polygons)
        notes = [n for n in self.notes if n not in unjoined and not n.startswith(linked)]
        return replace(self, portals=joined, notes=(*notes, f"{linked}{len(joined)}"))

    def named(self, name: str) -> Self:
        """Return the same plan under another name."""
        return replace(self, name=name)

    def nearest_free(self, x: float, y: float) -> tuple[float, float]:
        """Return the centre of the free cell nearest to a place [m]; ties: lowest row, column."""
        cells = cells_of(self.free)
        at = np.clip(self.lattice.to_lattice(np.clip((x, y), -1e6, 1e6)), -(2**24), 2**24)
        nearest = int(np.argmin(self.lattice.squared_distances(cells, at.tolist())))
        centre = self.lattice.cell_centre(*cells[nearest].tolist())
        near_x, near_y = self.lattice.to_metres(centre).tolist()
        return near_x, near_y
