"""Sources of floor plans: the base of their components, with what a scenario adds to each."""

from abc import abstractmethod
from collections.abc import Hashable, Sequence
from dataclasses import replace
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import shapely
from pydantic import AfterValidator, Field
from shapely import MultiPolygon, Polygon

from fleet2d.configuration.components import Component, Settings
from fleet2d.configuration.problems import check_known, problem, problem_at
from fleet2d.configuration.units import (
    AngleDeg,
    Length,
    PositiveDuration,
    PositiveLength,
)
from fleet2d.errors import FloorPlanError, InputError
from fleet2d.floorplan.costmap import CostmapSettings
from fleet2d.floorplan.furniture import FURNITURE, stand_furniture
from fleet2d.floorplan.layers import LayerSettings, check_layers
from fleet2d.floorplan.placed_objects import (
    MAX_HEIGHT_M,
    Blocks,
    PlacedObject,
    Portal,
    number_objects,
)
from fleet2d.floorplan.plan import HOME_FOLDER, Cache, FloorPlan, read_only
from fleet2d.floorplan.rooms.doorways import DoorLine, doorway_segments, name_doorways
from fleet2d.floorplan.rooms.room import (
    LabelledRegion,
    cells_in,
    make_rooms,
    snap_regions,
    usual_type,
)
from fleet2d.floorplan.slow_area import SlowArea
from fleet2d.floorplan.space import BODY_RADIUS, standing_cells, with_approaches
from fleet2d.inputs import sha256_of_file
from fleet2d.kernels import F64, I64, TURN, fill_from_neighbors


class RoomCorrection(Settings):
    """A room to name or retype, given by a place in it, or to redraw, given by its corners.

    Attributes:
        at: A place in the room [x, y] [m].
        polygon: Corners of a room that takes this space from others.
        name: Its name; left out: unchanged, or numbered by its type.
        type: Its type, such as bedroom; left out: unchanged, or room.

    Example:
        >>> RoomCorrection(at=(2, 1), type="Kitchen").type
        'Kitchen'
    """

    at: tuple[Length, Length] | None = Field(default=None, examples=[[2.5, 1.0]])
    polygon: tuple[tuple[Length, Length], ...] | None = Field(
        default=None, examples=[[[0, 0], [4, 0], [4, 3]]]
    )
    name: str | None = Field(default=None, min_length=1)
    type: str | None = Field(default=None, min_length=1)

    def model_post_init(self, _: object, /) -> None:
        """Require a place or an outline, and something to correct."""
        if (self.at is None) == (self.polygon is None):
            raise problem("a room needs either 'at' (a point in it) or 'polygon' (its corners)")
        if self.at is not None and self.name is None and self.type is None:
            raise problem("a room at a place needs a name or a type to give it")
        corners = self.polygon
        if corners is not None and (len(corners) < 3 or not Polygon(corners).is_valid):
            text = "polygon is not a valid outline: at least 3 corners, and no crossing sides"
            raise problem(text)


def correct_rooms(plan: FloorPlan, corrections: Sequence[RoomCorrection]) -> FloorPlan:
    """Return a plan with rooms renamed, retyped and redrawn.

    Each correction applies to the rooms that those before it left. A room that loses all its cells
    is dropped.

    Args:
        plan: The plan.
        corrections: In the order of the scenario.

    Raises:
        FloorPlanError: A place is in no room, a polygon holds no free cell, or two rooms would
            have one name.
    """
    if not corrections:
        return plan
    regions = [LabelledRegion(r.labels, Polygon(), r.name, r.type) for r in plan.rooms]
    painted = plan.room_of_cell.astype(np.int64)
    for number, correction in enumerate(corrections):
        where = f"floorplan.rooms[{number}]"
        if correction.polygon is not None:
            _draw(plan, painted, correction, len(regions), where)
            types = (usual_type(correction.type),) if correction.type else ()
            kind = None if types else "room"
            regions.append(LabelledRegion(types, Polygon(), correction.name, kind))
        else:
            index = _region_at(plan, painted, correction, where)
            regions[index] = _rename(regions[index], correction)
    room_of_cell, rooms = make_rooms(plan.lattice, painted, regions)
    doors = zip(_door_lines(plan), doorway_segments(plan.lattice, plan.doorways), strict=True)
    places = fill_from_neighbors(room_of_cell)
    names = [room.name for room in rooms]
    doorways = name_doorways(plan.lattice, places, names, list(doors))
    return replace(plan, room_of_cell=read_only(room_of_cell), rooms=rooms, doorways=doorways)


def _rename(region: LabelledRegion, correction: RoomCorrection) -> LabelledRegion:
    """Return a region with another name or type; a name of type and number follows the type."""
    if correction.type is None:
        return replace(region, name=correction.name)
    kind = usual_type(correction.type)
    is_numbered = region.name is not None and region.name.rpartition("_")[0] == region.main_type
    name = correction.name or (None if is_numbered and kind != region.main_type else region.name)
    return LabelledRegion((kind,), region.shape, name, kind)


def _region_at(plan: FloorPlan, painted: I64, correction: RoomCorrection, where: str) -> int:
    """Return the index of the region that holds the place of a correction."""
    x, y = correction.at or (0.0, 0.0)
    row, column = plan.lattice.cell_of(*plan.lattice.point_at((x, y)))
    if 0 <= row < plan.lattice.rows and 0 <= column < plan.lattice.columns:
        index = int(fill_from_neighbors(painted.astype(np.int16))[row, column])
        if index >= 0:
            return index
    near_x, near_y = plan.nearest_free(x, y)
    raise FloorPlanError(
        f"{where}: ({x:g}, {y:g}) m is in no room of {plan.name}: the nearest free place is"
        f" ({near_x:.2f}, {near_y:.2f}) m"
    )


def _draw(plan: FloorPlan, painted: I64, room: RoomCorrection, index: int, where: str) -> None:
    """Set the regions of the cells inside the polygon to `index`."""
    shape = Polygon(room.polygon)
    (region,) = snap_regions(plan.lattice, [LabelledRegion((), shape)])
    parts = shapely.get_parts(shapely.make_valid(region.shape))  # rounding may cross its sides
    polygons = [part for part in parts if part.geom_type == "Polygon"]
    patch = cells_in(plan.free, MultiPolygon(polygons))
    if patch.cells == 0:
        x0, y0, x1, y1 = shape.bounds
        raise FloorPlanError(
            f"{where}: no free cell of {plan.name} is inside the polygon from ({x0:g}, {y0:g}) to"
            f" ({x1:g}, {y1:g}) m"
        )
    painted[patch.window][patch.mask] = index


def _door_lines(plan: FloorPlan) -> list[DoorLine]:
    """Return the doorways as lines; those named after their rooms get new names later."""
    lines = []
    for doorway in plan.doorways:
        joined = "-".join(plan.rooms[room].name for room in doorway.rooms)
        own = None if doorway.name.startswith(joined) else doorway.name
        lines.append(DoorLine(doorway.start, doorway.end, own, doorway.leaf))
    return lines


class PortalSettings(Settings):
    """Stairs or a lift between two storeys.

    Attributes:
        ends: Its two ends [[x, y], [x, y]] [m], such as the foot and the head of stairs.
        takes: How long people take from one to the other.
        type: What it is.
    """

    ends: tuple[tuple[Length, Length], tuple[Length, Length]] = Field(
        examples=[[[1.0, 1.0], [11.0, 1.0]]]
    )
    takes: PositiveDuration = timedelta(seconds=12)
    type: Literal["stairs", "lift"] = "stairs"

    def to_portal(self) -> Portal:
        """Return the portal as a part of a plan."""
        return Portal(self.type, *self.ends, self.takes // timedelta(microseconds=1))


# How far a piece may reach into a wall [m]: tape measures and traced walls differ by as much.
WALL_TOLERANCE_M = 0.02


class Furnishing(Settings):
    """How a home is furnished by rule, see `fleet2d.floorplan.furnish.furnish`.

    Attributes:
        seed: The seed of the choice and the places of pieces.
        density: Factor of the probability of optional pieces; 0: none of them.
    """

    seed: int = Field(default=0, ge=0)
    density: float = Field(default=1.0, ge=0, le=10)


class FurniturePiece(Settings):
    """A piece of furniture at a place in the home.

    Attributes:
        type: The type of furniture, such as 'bed'.
        at: Its middle [x, y] [m].
        heading_deg: The direction of its front, counter-clockwise from +x.
        size: Its width and depth [m]; left out: the middle of what is usual.
        name: Its name; left out: its type and a number.
        blocks: What it blocks: nothing, bodies (`path`), or bodies and sight (`sight`); left out:
            what is usual for its type.
        height: How high it is [m], for `sight.heights`; 0: it hides nobody; left out: what is usual
            for its type.
    """

    type: str = Field(examples=["sofa"])
    at: tuple[Length, Length] = Field(examples=[[2.5, 1.0]])
    heading_deg: AngleDeg = 90.0
    size: tuple[PositiveLength, PositiveLength] | None = Field(default=None, examples=[[1.6, 2.0]])
    name: str | None = Field(default=None, min_length=1)
    blocks: Blocks | None = None
    height: Length | None = Field(default=None, ge=0, le=MAX_HEIGHT_M)

    def model_post_init(self, _: object, /) -> None:
        """Require a known type, and a height that it can have."""
        error = partial(problem_at, ("type",), value=self.type)
        check_known(self.type, "furniture of type", sorted(FURNITURE), error)
        if self.height is not None and (self.blocks or FURNITURE[self.type].blocks) == "sight":
            raise problem_at(
                ("height",), "what blocks sight reaches the ceiling: give blocks: path, too"
            )

    def stand(self) -> PlacedObject:
        """Return the piece as an object, with unchecked places to use it from."""
        heading = round(self.heading_deg / 360 * TURN) % TURN
        thing = stand_furniture(self.type, self.at, heading, self.size, name=self.name or "")
        return replace(thing, blocks=self.blocks or thing.blocks, height=self.height)


def place_furniture(
    plan: FloorPlan, pieces: tuple[FurniturePiece, ...], rules: Furnishing | None
) -> FloorPlan:
    """Return a plan with the pieces of a scenario, and more by `rules`, if any.

    Raises:
        FloorPlanError: A piece stands outside the home or in a wall, or two have the same name.
    """
    if pieces:
        things = [piece.stand() for piece in pieces]
        for number, thing in enumerate(things):
            _check_stands(plan, thing, f"floorplan.furniture[{number}]")
        everything = [*plan.objects, *things]
        standing = standing_cells(plan, BODY_RADIUS, everything)
        reachable = [with_approaches(plan, thing, standing, everything) for thing in things]
        plan = replace(plan, objects=number_objects([*plan.objects, *reachable]))
    if rules is None:
        return plan
    from fleet2d.floorplan.furnish import furnish  # few homes need the rules

    return furnish(plan, rules.seed, rules.density)


def _check_stands(plan: FloorPlan, thing: PlacedObject, where: str) -> None:
    """Raise FloorPlanError unless an object stands in free space."""
    middle = thing.footprint.centroid
    at = f"the {thing.type} at ({middle.x:g}, {middle.y:g}) m"
    x0, y0, x1, y1 = plan.bounds
    if not plan.free_space.intersects(middle):
        raise FloorPlanError(
            f"{where}: {at} is not inside {plan.name}, whose free space lies from"
            f" ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m"
        )
    lost = shapely.difference(thing.footprint.buffer(-WALL_TOLERANCE_M), plan.free_space).area
    if lost > 0:
        x0, y0, x1, y1 = thing.footprint.bounds
        raise FloorPlanError(
            f"{where}: {at} overlaps a wall of {plan.name}: its box is {x1 - x0:.2f} m x"
            f" {y1 - y0:.2f} m; move it, turn it (heading_deg), or give it another size"
        )


# Homes that a process caches, read and furnished.
CACHED_PLANS = 8

PLAN_CACHE = Cache(CACHED_PLANS)
"""Homes, read and furnished."""

# Largest `scale`: of a file in kilometres.
MAX_SCALE = 1000.0


class FloorPlanSource(Component):
    """A source of a floor plan.

    Attributes:
        cell: Side of a grid cell, 0.01 m to 1 m.
        scale: What lengths of the source are multiplied by, such as 0.001 for millimetres; left
            out: 1, or what the file says.
        rooms: Rooms to name, retype or draw, beyond what the source says.
        furniture: Pieces to place in the home.
        furnish: Furnish rooms without furniture by rule, by their types.
        layers: Named arrays with a value for each cell; explored, first_seen, last_seen and
            time_since_seen are maintained by the run, for each robot with a camera.
        costmap: Costs that routes of robots pay; null: they take the shortest.
        portals: Stairs and lifts between storeys, which lie side by side in the plan.
        slows: Areas that slow robots down: wet floors, carpets, edges at which they stop.
    """

    kind = "floorplan"

    # Keys, each with its value unless that is None; by one the content of a file is recognized. A
    # key below others is written with dots.
    marks: ClassVar[tuple[tuple[str, str | None], ...]] = ()

    # The endings, such as ".dxf", of the files that it reads, if they aren't JSON or YAML.
    suffixes: ClassVar[tuple[str, ...]] = ()

    cell: Length = 0.05
    scale: float | None = Field(default=None, gt=0, le=MAX_SCALE)
    rooms: tuple[RoomCorrection, ...] = Field(
        default=(), examples=[[{"at": [2.5, 1.0], "name": "den", "type": "office"}]]
    )
    furniture: tuple[FurniturePiece, ...] = Field(
        default=(), examples=[[{"type": "bed", "at": [2.0, 3.5]}]]
    )
    furnish: bool | Furnishing = False
    layers: Annotated[dict[str, LayerSettings], AfterValidator(check_layers)] = Field(
        default={}, examples=[{"explored": {"every": "1 d"}, "dust": {"unit": "g"}}]
    )
    costmap: CostmapSettings | None = None
    portals: tuple[PortalSettings, ...] = ()
    slows: tuple[SlowArea, ...] = Field(
        default=(),
        examples=[[{"area": [[1, 0.5], [2.5, 0.5], [2.5, 2]], "speed": "40 %", "stop": "2 s"}]],
    )

    @classmethod
    def of_file(cls, **settings: Any) -> "FloorPlanSource":
        """Return the source with settings beside a file; those that are None have their defaults.

        Raises:
            FloorPlanError: It needs another setting.
        """
        given = {key: value for key, value in settings.items() if value is not None}
        return cls.model_construct(**given)

    @classmethod
    def document(cls, plan: FloorPlan) -> dict[str, Any]:
        """Return the content of a JSON file that has a plan, if such files are written."""
        raise NotImplementedError

    @abstractmethod
    def load(self) -> FloorPlan:
        """Read the floor plan.

        Raises:
            FloorPlanError: The file can't be read, or is not a home.
        """

    def driven_ways(self) -> list[F64]:
        """Return the ways that a robot drove when it made the map, each float64 (n, 2) [m].

        Raises:
            FloorPlanError: The file can't be read.
        """
        return []

    def plan(self) -> FloorPlan:
        """Return the floor plan with the rooms and furniture that the scenario adds.

        A process reads a home only once, as long as its files and settings stay the same, and so
        do all the workers of a study together.

        Raises:
            FloorPlanError: The file can't be read, is not a home, or a piece doesn't fit into it.
        """
        key = self._cache_key()
        if key is None:
            return self._read()
        return PLAN_CACHE.get(key, lambda: HOME_FOLDER.get(key, self._read))

    def _cache_key(self) -> Hashable:
        """Return all that the plan depends on, or None if that is unknown, as for a plugin."""
        cls = type(self)
        if cls.__module__.partition(".")[0] != "fleet2d":
            return None
        try:
            files = [(path, sha256_of_file(path)) for path in self.files()]
        except (OSError, InputError):
            return None  # the reader raises it with its reason
        return cls, self.model_dump_json(exclude={"layers", "costmap", "slows"}), tuple(files)

    def _read(self) -> FloorPlan:
        rules = Furnishing() if self.furnish is True else self.furnish or None
        plan = correct_rooms(self.load(), self.rooms)
        plan = plan.with_portals([p.to_portal() for p in self.portals], "floorplan.portals")
        return place_furniture(plan, self.furniture, rules)

    def files(self) -> list[Path]:
        """Return the files that it reads; a run records their content, to be reproducible."""
        path = getattr(self, "path", None)
        return [] if path is None else [Path(path)]
