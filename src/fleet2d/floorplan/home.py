"""The home of a run: its floor plan, what stands in it now, and changes of it as data."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from functools import lru_cache, partial
from typing import Any, Literal, Self, TypeVar

import numpy as np
import shapely
from pydantic import Field
from shapely import Polygon

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import format_duration, parse_duration
from fleet2d.errors import FloorPlanError, PlacementError
from fleet2d.floorplan.costmap import CostedSpace
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.layers import COSTMAP, Layers
from fleet2d.floorplan.mesh import Gates, Segment, build_mesh, snap_polygon
from fleet2d.floorplan.placed_objects import PlacedObject, Point, UsePlace, find_named
from fleet2d.floorplan.plan import HOME_FOLDER, Cache, FloorPlan, Room, cell_polygons
from fleet2d.floorplan.rooms.doorways import Doorway, doorway_segments
from fleet2d.floorplan.rooms.room import room_type
from fleet2d.floorplan.slow_area import SlowRegion
from fleet2d.floorplan.space import LinkedSpace, Space, SpaceShape, shape_space
from fleet2d.kernels import I32, Mesh

# Types of rooms through which people leave a home without an entrance, the likeliest first.
EXIT_ROOMS = ("entryway", "lobby", "hallway", "hall", "living_room", "kitchen")
# Arrangements of doors and furniture whose walls and spaces are cached, for each home.
CACHED_ARRANGEMENTS = 128
# Homes whose walls and spaces a process caches for its next run, and further values of each.
CACHED_HOMES = 8
CACHED_VALUES = 512

T = TypeVar("T")

NO_DOORS: frozenset[int] = frozenset()

VERBS = ("open", "shut", "lock", "unlock", "move", "room", "lights")
ALL_ROOMS = "all"
"""What names the lights of all rooms."""


class Home:
    """The home of a run: its floor plan, and how it changes during the run.

    Attributes:
        plan: The floor plan, which never changes.
        lattice: The lattice of the plan.
        doors: The doorways that have a door, by the number of the door.
        rooms: The rooms by index, with their present types.
        objects: The objects at their present places.
        shut: Numbers of the doors that are shut.
        locked: Numbers of the doors that nobody can open by hand.
        version: Number of changes so far.
        layers: Named arrays with a value for each cell.

    Example:
        >>> import fleet2d
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> home.space(radius=0.2).parts
        1
    """

    def __init__(self, plan: FloorPlan, doors: Sequence[Doorway] = ()) -> None:
        self.plan = plan
        self.lattice = plan.lattice
        self.doors = tuple(doors)
        self.rooms: tuple[Room, ...] = plan.rooms
        self.objects: tuple[PlacedObject, ...] = plan.objects
        self.shut: frozenset[int] = NO_DOORS
        self.locked: frozenset[int] = NO_DOORS
        self.unlit: frozenset[int] = frozenset()
        self.slows: tuple[SlowRegion, ...] = ()
        self.version = 0
        self.layers = Layers(plan)
        self._shapes = _shapes_of(plan, doorway_segments(plan.lattice, self.doors))
        self._walls: tuple[int, Mesh] = (-1, plan.sight_mesh)
        self._places: tuple[int, dict[LatticePoint, LatticePoint]] = (-1, {})
        # The layer `costmap` at its last use, the number of its changes, and the spaces of bodies
        # that pay its costs.
        self._costs: I32 = np.zeros((0, 0), np.int32)
        self._costs_version = 0
        self._costed: dict[Space, CostedSpace] = {}

    @property
    def constants(self) -> dict[str, object]:
        """The parts of it that never change during a run, by name."""
        plan = self.plan
        shapes = self._shapes
        return {"plan": plan, "lattice": self.lattice, "walls": plan.sight_mesh, "shapes": shapes}

    def cached(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key, which all runs in this home share.

        Args:
            key: All that the value depends on besides the floor plan: walls, spaces, objects,
                numbers.
            make: Makes the value at its first use. It must not change afterwards: arrays must be
                read-only.
        """
        return self._shapes.values.get(key, make)

    @property
    def walls(self) -> Mesh:
        """What blocks sight at present: walls, shut doors and tall furniture [lattice]."""
        if self._walls[0] != self.version:
            self._walls = self.version, self._shapes.walls(self.shut, _tall(self.objects))
        return self._walls[1]

    @property
    def barriers(self) -> Mesh:
        """What blocks bodies and sight at present: as `walls`, but glass is wall [lattice]."""
        if not self.plan.glass:
            return self.walls
        return self._shapes.walls(self.shut, _tall(self.objects), glass=False)

    def space(
        self,
        radius: float,
        *,
        opens_doors: bool = False,
        uses_portals: bool = False,
        without: frozenset[int] = NO_DOORS,
    ) -> Space:
        """Return the present space of bodies of a radius, built at its first use.

        Args:
            radius: The radius of the body [m].
            opens_doors: Whether the body passes shut doors that aren't locked.
            uses_portals: Whether the body climbs stairs and takes lifts.
            without: Indices of the rooms that the body keeps out of, and numbers of areas.
        """
        shut = self.shut & self.locked if opens_doors else self.shut
        space = self._shapes.space_of(radius, shut, _solid(self.objects), without)
        return self._shapes.linked(space) if uses_portals and self.plan.portals else space

    def area(self, corners: Sequence[tuple[float, float]]) -> int:
        """Return the number of an area with some corners [m], for `without`: below 0."""
        return self._shapes.area(tuple(corners))

    def is_in_area(self, point: LatticePoint, area: int) -> bool:
        """Return whether a lattice point lies in an area, by its number, or on its border."""
        return bool(shapely.intersects_xy(self._shapes.areas[-1 - area], *point))

    @property
    def costs_version(self) -> int:
        """Number of changes of the layer `costmap`; 0 without one."""
        if COSTMAP in self.layers:
            values = self.layers[COSTMAP].values
            if not np.array_equal(self._costs, values):
                self._costs = values.astype(np.int32)
                self._costed = {}
                self._costs_version += 1
        return self._costs_version

    @property
    def may_block_routes(self) -> bool:
        """Whether routes may be closed at present that are open at other times."""
        return bool(self.shut) or (COSTMAP in self.layers and self.costs_version > 1)

    def costed(self, space: Space) -> Space:
        """Return the space of a body that pays the costs of the costmap; the same without one.

        Raises:
            FloorPlanError: The costmap leaves no place for the body.
        """
        if self.costs_version == 0:
            return space
        if space not in self._costed:
            self._costed[space] = CostedSpace(space, self._costs)
        return self._costed[space]

    def door_line(self, door: int) -> Segment:
        """Return the segment at which a shut door stands [lattice]."""
        return doorway_segments(self.plan.lattice, [self.doors[door]])[0]

    def set_door(self, door: int, *, is_open: bool) -> None:
        """Open or shut a door."""
        self.shut = self.shut - {door} if is_open else self.shut | {door}
        self.version += 1

    def set_lock(self, door: int, *, locked: bool) -> None:
        """Lock or unlock a door."""
        self.locked = self.locked | {door} if locked else self.locked - {door}
        self.version += 1

    def set_lights(self, rooms: Iterable[int], *, is_on: bool) -> None:
        """Switch the lights of rooms on or off, by their indices."""
        self.unlit = self.unlit.difference(rooms) if is_on else self.unlit.union(rooms)

    def put(self, thing: PlacedObject) -> None:
        """Replace the object of the same name."""
        self.objects = tuple(thing if o.name == thing.name else o for o in self.objects)
        self.version += 1

    def use_room_as(self, room: Room, kind: str) -> None:
        """Change what a room is used for."""
        new_type = room_type(kind)
        changed = replace(room, type=new_type, labels=(new_type,))
        self.rooms = (*self.rooms[: room.index], changed, *self.rooms[room.index + 1 :])
        self.version += 1

    def object(self, name: str) -> PlacedObject:
        """Return an object by its name.

        Raises:
            PlacementError: There is no such object.
        """
        return find_named(self.objects, name, self.plan.name, "object", PlacementError)

    def approach(self, use: UsePlace, space: Space, part: int) -> LatticePoint:
        """Return the lattice point from which a body steps to a place where an object is used.

        Raises:
            PlacementError: The space has no such part.
        """
        at = use.approach or use.at
        x, y = self.plan.lattice.point_at(at)
        if space.part_at(x, y) == part:
            return x, y
        return self._nearest(space, x, y, part)

    def room_of(self, thing: PlacedObject) -> Room | None:
        """Return the room of the plan that holds the middle of an object."""
        return self._shapes.room_of(thing)

    @property
    def approaches(self) -> Mapping[LatticePoint, LatticePoint]:
        """The point from which a body steps to each place of use at present, by place [lattice]."""
        if self._places[0] != self.version:
            point_at = self.plan.lattice.point_at
            uses = (use for thing in self.objects for use in thing.uses)
            ways = {point_at(use.at): point_at(use.approach) for use in uses if use.approach}
            self._places = self.version, ways
        return self._places[1]

    def approach_of(self, place: LatticePoint) -> LatticePoint | None:
        """Return the point from which a body steps to a place of use [lattice]; None for others."""
        version, approaches = self._places
        return (approaches if version == self.version else self.approaches).get(place)

    def way_out(self, space: Space, part: int) -> LatticePoint:
        """Return the lattice point where a body in a part of the space leaves the home.

        Raises:
            PlacementError: The space has no such part.
        """
        return self._nearest(space, *self._door(space, part), part)

    def _nearest(self, space: Space, x: int, y: int, part: int) -> LatticePoint:
        point = space.nearest(x, y, part)
        if point is None:
            body = f"a body of radius {space.radius:g} m"
            raise PlacementError(f"{body} fits nowhere in {self.plan.name}")
        return point

    def _door(self, space: Space, part: int) -> LatticePoint:
        """Return the plan's entrance, or the middle of the likeliest room with an exit."""
        at = self.plan.entrance
        if at is None:
            rooms = [room for kind in EXIT_ROOMS for room in self.rooms if room.type == kind]
            rooms += sorted(self.rooms, key=lambda room: -room.cells)
            reachable = (room for room in rooms if len(space.cells(room.index, part)))
            at = next(reachable, self.rooms[0]).anchor_xy
        x, y = self.plan.lattice.point_at(at)
        return x, y


class _Shapes:
    """Walls and spaces of a home, by shut doors and objects; all runs in the home share them."""

    def __init__(self, plan: FloorPlan, door_lines: Sequence[Segment]) -> None:
        self.plan = plan
        self.values = Cache(CACHED_VALUES)
        self.door_lines = door_lines
        self.areas: list[shapely.Polygon] = []  # out of which bodies keep [lattice]
        self._room_of: dict[str, tuple[PlacedObject, Room | None]] = {}
        self.walls = lru_cache(CACHED_ARRANGEMENTS)(self._make_walls)
        self._gates = lru_cache(CACHED_ARRANGEMENTS)(
            lambda tall, glass: Gates(self._build_mesh(tall, glass), door_lines)
        )
        self.space_of = lru_cache(CACHED_ARRANGEMENTS)(self._make_space)
        self.linked = lru_cache(CACHED_ARRANGEMENTS)(partial(LinkedSpace, portals=plan.portals))

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return itself, as branches of a run share it, too."""
        return self

    def area(self, corners: tuple[tuple[float, float], ...]) -> int:
        shape = shapely.Polygon(self.plan.lattice.to_lattice(np.array(corners)))
        if shape not in self.areas:
            self.areas.append(shape)
        return -1 - self.areas.index(shape)

    def room_of(self, thing: PlacedObject) -> Room | None:
        entry = self._room_of.get(thing.name)
        if entry is None or entry[0] is not thing:
            middle = thing.footprint.centroid
            entry = thing, self.plan.room_at(middle.x, middle.y)
            self._room_of[thing.name] = entry
        return entry[1]

    def _make_walls(
        self, shut: frozenset[int], tall: tuple[PlacedObject, ...], glass: bool = True
    ) -> Mesh:
        if not self.door_lines:
            return self._build_mesh(tall, glass)
        return self._gates(tall, glass).shut(shut)

    def _build_mesh(self, tall: tuple[PlacedObject, ...], glass: bool) -> Mesh:
        plan = self.plan
        if not tall and not self.door_lines:
            return plan.sight_mesh if glass else plan.mesh
        if tall == _tall(plan.objects):
            return self._shared(("walls", glass), lambda: self._cut_out(tall, glass))
        return self._cut_out(tall, glass)

    def _cut_out(self, tall: tuple[PlacedObject, ...], glass: bool) -> Mesh:
        """Return the mesh between the walls and tall objects."""
        plan = self.plan
        polygons = plan.sight_polygons if glass else plan.polygons
        if tall:
            blocks = shapely.union_all(lattice_footprints(plan, tall))
            rest = shapely.get_parts(shapely.difference(shapely.MultiPolygon(polygons), blocks))
            polygons = [part for shape in rest.tolist() for part in snap_polygon(shape).polygons]
        if not polygons:
            raise FloorPlanError(f"the objects of {plan.name} leave no free space")
        corners = [end for line in self.door_lines for end in line]
        return build_mesh(polygons, plan.lattice.columns, plan.lattice.rows, corners)

    def _shared(self, part: Hashable, make: Callable[[], T]) -> T:
        """Return a part of the home as its plan has it, made by the first process that needs it."""
        if not HOME_FOLDER.is_open:
            return make()
        return HOME_FOLDER.get((self.plan.digest, *self.door_lines, part), make)

    def _make_space(
        self,
        radius: float,
        shut: frozenset[int],
        solid: tuple[PlacedObject, ...],
        without: frozenset[int],
    ) -> Space:
        def shape() -> SpaceShape:
            rooms = [self.plan.room_of_cell == room for room in sorted(without) if room >= 0]
            obstacles = [
                *lattice_footprints(self.plan, solid),
                *(shape for room in rooms for shape in cell_polygons(room)),
                *(self.areas[-1 - area] for area in without if area < 0),
            ]
            doors = [self.door_lines[door] for door in sorted(shut)]
            return shape_space(self.plan, radius, obstacles, doors)

        is_as_planned = not shut and not without and solid == _solid(self.plan.objects)
        walls = self.walls(shut, _tall(solid), glass=not self.plan.glass)
        known = self._shared(("space", radius), shape) if is_as_planned else shape()
        space = Space(self.plan, radius, walls=walls, shape=known)
        space.key = radius, shut, solid, without
        return space


HOME_CACHE = Cache(CACHED_HOMES)
"""The walls and spaces of homes, about 10 MB each."""


def _shapes_of(plan: FloorPlan, door_lines: Sequence[Segment]) -> _Shapes:
    """Return the walls and spaces of a plan with doors, which all runs in it share."""
    # By identity, since a state that is saved to a file refers to the plan itself.
    return HOME_CACHE.get((id(plan), *door_lines), lambda: _Shapes(plan, door_lines))


def lattice_footprint(plan: FloorPlan, thing: PlacedObject) -> Polygon:
    """Return the floor that an object covers [lattice], on even units as walls are."""
    return lattice_footprints(plan, [thing])[0]


def lattice_footprints(plan: FloorPlan, things: Sequence[PlacedObject]) -> list[Polygon]:
    """Return the floors that objects cover, as `lattice_footprint` does."""
    shapes = np.array([thing.footprint for thing in things], np.object_)
    return shapely.transform(shapes, lambda xy: plan.lattice.to_walls(xy).astype(float)).tolist()


def _tall(objects: tuple[PlacedObject, ...]) -> tuple[PlacedObject, ...]:
    return tuple(thing for thing in objects if thing.blocks == "sight")


def _solid(objects: tuple[PlacedObject, ...]) -> tuple[PlacedObject, ...]:
    return tuple(thing for thing in objects if thing.blocks != "nothing")


def parse_moment(value: Any) -> datetime | timedelta:
    """Parse a local time, which may have an offset in a time zone, or the time since the start."""
    try:
        moment = datetime.fromisoformat(value) if isinstance(value, str) else value
    except ValueError:
        moment = None
    if isinstance(moment, date) and not isinstance(moment, datetime):
        moment = datetime(moment.year, moment.month, moment.day)
    if not isinstance(moment, datetime):
        return parse_duration(value)
    return moment


def format_moment(moment: datetime | timedelta) -> str:
    """Format a moment as `parse_moment` reads it."""
    return moment.isoformat() if isinstance(moment, datetime) else format_duration(moment)


class HomeChange(Settings):
    """One change of the home: exactly one of open, shut, lock, unlock, move, room, lights.

    Attributes:
        open: The door that is opened.
        shut: The door that is shut.
        lock: The door that is locked.
        unlock: The door that is unlocked.
        move: The piece of furniture that is moved.
        to: New place of its middle, [x, y] in metres.
        turn_deg: Angle by which it is turned, counter-clockwise.
        room: The room whose use changes.
        type: The type of the room from then on.
        lights: The room whose light is switched, a kind of rooms, or `all`.
        turn: How it is switched: `on` or `off`.

    Example:
        >>> HomeChange(shut="bath_door").verb
        'shut'
        >>> HomeChange(room="office_1", type="bedroom").target
        'office_1'
    """

    open: str | None = None
    shut: str | None = None
    lock: str | None = None
    unlock: str | None = None
    move: str | None = None
    to: Point | None = None
    turn_deg: float = Field(default=0.0, ge=-3600, le=3600)
    room: str | None = None
    type: str | None = None
    lights: str | None = None
    turn: Literal["on", "off"] | None = None

    def model_post_init(self, _: object, /) -> None:
        """Require exactly one change, with the key that belongs to it."""
        verbs = [verb for verb in VERBS if getattr(self, verb) is not None]
        if len(verbs) != 1:
            listed = " and ".join(verbs) or "nothing"
            raise problem(f"give exactly one of {', '.join(VERBS)}, got {listed}")
        for verb, further in (("move", "to"), ("room", "type"), ("lights", "turn")):
            if (verbs[0] == verb) != (getattr(self, further) is not None):
                raise problem(f"'{verb}' and '{further}' go together")

    @property
    def verb(self) -> str:
        """The verb of the change, such as `shut`."""
        return next(verb for verb in VERBS if getattr(self, verb) is not None)

    @property
    def target(self) -> str:
        """The name of the door, object or room that changes."""
        return str(getattr(self, self.verb))


@dataclass(frozen=True)
class HomeChanges:
    """Changes of the home that an algorithm requests from the next step on.

    Example:
        >>> output = HomeChanges([HomeChange(shut="bath_door")])
        >>> output.to_columns()["target"].tolist()
        ['bath_door']
    """

    changes: tuple[HomeChange, ...]

    def __init__(self, changes: Iterable[HomeChange]) -> None:
        object.__setattr__(self, "changes", tuple(changes))

    def to_columns(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the changes as columns of a table."""
        return {
            "change": np.array([change.verb for change in self.changes], object),
            "target": np.array([change.target for change in self.changes], object),
        }
