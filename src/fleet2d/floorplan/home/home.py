"""The home of a run: its floor plan, what stands in it now, and the space that bodies have."""

from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, Self, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d.errors import FloorPlanError, PlacementError
from fleet2d.floorplan.geometry.gates import Gates, Segment
from fleet2d.floorplan.geometry.mesh import build_mesh, snap_polygon
from fleet2d.floorplan.home.costmap import CostedSpace
from fleet2d.floorplan.home.layers import COSTMAP, Layers
from fleet2d.floorplan.home.space import Space
from fleet2d.floorplan.kept import Kept
from fleet2d.floorplan.objects import PlacedObject, UsePlace
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.floorplan.rooms.doorways import Doorway
from fleet2d.floorplan.rooms.vocabulary import room_type
from fleet2d.kernels.mesh import Mesh
from fleet2d.problems import did_you_mean

# Where one leaves a home whose plan names no entrance: the first of these that it has.
WAYS_OUT = ("entryway", "lobby", "hallway", "hall", "living_room", "kitchen")
# Arrangements of doors and furniture whose walls and spaces are kept for when they come again.
ARRANGEMENTS_KEPT = 128
# Homes whose walls and spaces a process keeps for its next run, and what else of each.
HOMES_KEPT = 8
VALUES_KEPT = 512

T = TypeVar("T")

NOTHING: frozenset[int] = frozenset()


class Home:
    """A floor plan as the entities of a run use it, and what of it changes during the run.

    Attributes:
        plan: The floor plan, which never changes.
        doors: The doorways that have a door, by the number of the door.
        rooms: The rooms by index, as they are used at present.
        objects: What stands in the home at present.
        shut: The doors that are shut.
        locked: The doors that nobody opens by hand.
        version: Counts the changes.
        layers: Named arrays with a value for each cell.

    Example:
        >>> import fleet2d
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> home.space(radius=0.2).parts
        1
    """

    def __init__(self, plan: FloorPlan, doors: Sequence[Doorway] = ()) -> None:
        self.plan = plan
        self.doors = tuple(doors)
        self.rooms: tuple[Room, ...] = plan.rooms
        self.objects: tuple[PlacedObject, ...] = plan.objects
        self.shut: frozenset[int] = NOTHING
        self.locked: frozenset[int] = NOTHING
        self.version = 0
        self.layers = Layers(plan)
        self._shapes = _shapes_of(plan, [self.door_line(door) for door in range(len(self.doors))])
        self._walls: tuple[int, Mesh] = (-1, plan.mesh)
        self._places: tuple[int, dict[tuple[int, int], tuple[int, int]]] = (-1, {})
        # The costs as they were when last asked for, how often they were others than before, and
        # the spaces of bodies that mind them.
        self._costs: NDArray[np.int32] = np.zeros((0, 0), np.int32)
        self._costs_version = 0
        self._costed: dict[Space, CostedSpace] = {}

    @property
    def constants(self) -> dict[str, object]:
        """What of it never changes during a run, by name."""
        return {"plan": self.plan, "walls": self.plan.mesh, "shapes": self._shapes}

    def draw(self, ax: Any = None) -> Any:
        """Draw the floor plan; see `FloorPlan.draw`."""
        return self.plan.draw(ax)

    def _repr_png_(self) -> bytes | None:
        """Show the floor plan in a notebook, where matplotlib is installed."""
        return self.plan._repr_png_()

    def kept(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what `make` returns, once for all runs in this home.

        Args:
            key: All that it depends on besides the floor plan: walls, spaces, objects, numbers.
            make: Makes it. Nobody may change it afterwards: arrays must be read-only.
        """
        return self._shapes.kept.get(key, make)

    @property
    def walls(self) -> Mesh:
        """What ends sight at present: the walls, shut doors and tall furniture [lattice]."""
        if self._walls[0] != self.version:
            self._walls = self.version, self._shapes.walls(self.shut, _tall(self.objects))
        return self._walls[1]

    def space(self, radius: float, *, opens_doors: bool = False) -> Space:
        """Return the space of bodies of a radius [m] at present, built when first asked for.

        Args:
            radius: Of the body [m].
            opens_doors: Whether shut doors that aren't locked are no hindrance.
        """
        shut = self.shut & self.locked if opens_doors else self.shut
        return self._shapes.space(radius, shut, self.objects)

    @property
    def costs_version(self) -> int:
        """Counts the changes of the layer `costmap`; 0 without one."""
        if COSTMAP in self.layers:
            values = self.layers[COSTMAP].values
            if not np.array_equal(self._costs, values):
                self._costs, self._costed = values.astype(np.int32), {}
                self._costs_version += 1
        return self._costs_version

    @property
    def hinders(self) -> bool:
        """Whether ways may be closed at present that are open at other times."""
        return bool(self.shut) or self.costs_version > 1

    def costed(self, space: Space) -> Space:
        """Return what a space is to a body that minds the costmap: itself without one.

        Raises:
            FloorPlanError: The costmap leaves no place to be.
        """
        if self.costs_version == 0:
            return space
        if space not in self._costed:
            self._costed[space] = CostedSpace(space, self._costs)
        return self._costed[space]

    def door_line(self, door: int) -> Segment:
        """Return where a door is when shut [lattice]."""
        doorway = self.doors[door]
        (x0, y0), (x1, y1) = self.plan.lattice.to_lattice((doorway.start, doorway.end)).tolist()
        return (x0, y0), (x1, y1)

    def set_door(self, door: int, *, is_open: bool) -> None:
        """Open or shut a door."""
        self.shut = self.shut - {door} if is_open else self.shut | {door}
        self.version += 1

    def set_lock(self, door: int, *, locked: bool) -> None:
        """Lock or unlock a door."""
        self.locked = self.locked | {door} if locked else self.locked - {door}
        self.version += 1

    def put(self, thing: PlacedObject) -> None:
        """Let an object stand as given, in place of the one of its name."""
        self.objects = tuple(thing if o.name == thing.name else o for o in self.objects)
        self.version += 1

    def use_room_as(self, room: Room, kind: str) -> None:
        """Change what a room is used for."""
        wanted = room_type(kind)
        changed = replace(room, type=wanted, labels=(wanted,))
        self.rooms = tuple(changed if r.index == room.index else r for r in self.rooms)
        self.version += 1

    def object(self, name: str) -> PlacedObject:
        """Return an object by its name.

        Raises:
            PlacementError: There is no such object.
        """
        names = [thing.name for thing in self.objects]
        if name in names:
            return self.objects[names.index(name)]
        raise PlacementError(
            f"{self.plan.name} has no object {name!r}{did_you_mean(name, names)}"
            f" Its objects are: {', '.join(names) or 'none'}"
        )

    def approach(self, use: UsePlace, space: Space, part: int) -> tuple[int, int]:
        """Return the lattice point from which a body steps to the place where an object is used.

        Raises:
            PlacementError: The space has no such part.
        """
        at = (use.x, use.y) if use.approach is None else use.approach
        x, y = self.plan.lattice.point_at(at)
        if space.part_at(x, y) == part:
            return x, y
        near = space.nearest(x, y, part)
        if near is None:
            raise PlacementError(f"a body of radius {space.radius:g} m fits nowhere here")
        return near

    def room_of(self, thing: PlacedObject) -> Room | None:
        """Return the room that holds the middle of an object, as the plan has it."""
        return self._shapes.room_of(thing)

    def approach_of(self, place: tuple[int, int]) -> tuple[int, int] | None:
        """Return where one steps from to a place on an object [lattice], if it is such a place."""
        if not self.objects:
            return None
        if self._places[0] != self.version:
            lattice = self.plan.lattice
            self._places = (
                self.version,
                {
                    lattice.point_at((use.x, use.y)): lattice.point_at(use.approach)
                    for thing in self.objects
                    for use in thing.uses
                    if use.approach is not None
                },
            )
        return self._places[1].get(place)

    def way_out(self, space: Space, part: int) -> tuple[int, int]:
        """Return the lattice point where a body in a part of the space leaves the home.

        Raises:
            PlacementError: The space has no such part.
        """
        found = space.nearest(*self._door(space, part), part)
        if found is None:
            raise PlacementError(
                f"a body of radius {space.radius:g} m fits nowhere in {self.plan.name}"
            )
        return found

    def _door(self, space: Space, part: int) -> tuple[int, int]:
        """Return the plan's entrance, or the middle of the room that one likely leaves from."""
        at = self.plan.entrance
        if at is None:
            rooms = [room for kind in WAYS_OUT for room in self.rooms if room.type == kind]
            rooms += sorted(self.rooms, key=lambda room: -room.cells)
            reachable = (room for room in rooms if len(space.cells(room.index, part)))
            at = next(reachable, self.rooms[0]).anchor_xy
        x, y = self.plan.lattice.point_at(at)
        return x, y


class _Shapes:
    """Walls and spaces of a home, by what is shut and what stands where; runs share them."""

    def __init__(self, plan: FloorPlan, door_lines: Sequence[Segment]) -> None:
        self.plan = plan
        self.kept = Kept(VALUES_KEPT)
        self.door_lines = door_lines
        self._room_of: dict[str, tuple[PlacedObject, Room | None]] = {}
        self.walls = lru_cache(ARRANGEMENTS_KEPT)(self._find_walls)
        self._gates = lru_cache(ARRANGEMENTS_KEPT)(self._find_gates)
        self.space_of = lru_cache(ARRANGEMENTS_KEPT)(self._find_space)

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return itself: branches of a run share it, too."""
        return self

    def room_of(self, thing: PlacedObject) -> Room | None:
        known = self._room_of.get(thing.name)
        if known is None or known[0] is not thing:
            middle = thing.footprint.centroid
            known = thing, self.plan.room_at(middle.x, middle.y)
            self._room_of[thing.name] = known
        return known[1]

    def space(
        self, radius: float, shut: Collection[int], objects: tuple[PlacedObject, ...]
    ) -> Space:
        return self.space_of(radius, frozenset(shut), _solid(objects))

    def _find_walls(self, shut: frozenset[int], tall: tuple[PlacedObject, ...]) -> Mesh:
        if not self.door_lines:
            return self._built(tall)
        return self._gates(tall).shut(shut)

    def _find_gates(self, tall: tuple[PlacedObject, ...]) -> Gates:
        return Gates(self._built(tall), self.door_lines)

    def _built(self, tall: tuple[PlacedObject, ...]) -> Mesh:
        plan = self.plan
        if not tall and not self.door_lines:
            return plan.mesh
        polygons = plan.polygons
        if tall:
            blocks = shapely.union_all([lattice_footprint(plan, thing) for thing in tall])
            rest = shapely.get_parts(shapely.difference(shapely.MultiPolygon(polygons), blocks))
            polygons = [part for shape in rest.tolist() for part in snap_polygon(shape).polygons]
        if not polygons:
            raise FloorPlanError(f"the objects of {plan.name} leave no free space")
        corners = [end for line in self.door_lines for end in line]
        return build_mesh(polygons, plan.lattice.columns, plan.lattice.rows, corners)

    def _find_space(
        self, radius: float, shut: frozenset[int], solid: tuple[PlacedObject, ...]
    ) -> Space:
        space = Space(
            self.plan,
            radius,
            walls=self.walls(shut, _tall(solid)),
            obstacles=[lattice_footprint(self.plan, thing) for thing in solid],
            shut=[self.door_lines[door] for door in sorted(shut)],
        )
        space.key = radius, shut, solid
        return space


_SHAPES = Kept(HOMES_KEPT)


def keep_homes(count: int) -> None:
    """Keep the walls and spaces of so many homes for later runs, about 10 MB each."""
    _SHAPES.keep(count)


def _shapes_of(plan: FloorPlan, door_lines: Sequence[Segment]) -> _Shapes:
    """Return the walls and spaces of a plan with doors, the same for all runs in it."""
    # The plan itself, not one like it: a state that is written to a file refers to it.
    return _SHAPES.get((id(plan), *door_lines), lambda: _Shapes(plan, door_lines))


def lattice_footprint(plan: FloorPlan, thing: PlacedObject) -> Polygon:
    """Return the floor that an object covers [lattice], on even units as walls are."""
    return Polygon(plan.lattice.to_walls(np.asarray(thing.footprint.exterior.coords)[:-1]))


def _tall(objects: tuple[PlacedObject, ...]) -> tuple[PlacedObject, ...]:
    return tuple(thing for thing in objects if thing.blocks == "sight")


def _solid(objects: tuple[PlacedObject, ...]) -> tuple[PlacedObject, ...]:
    return tuple(thing for thing in objects if thing.blocks != "nothing")
