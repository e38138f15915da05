"""Fleet2D's own floor plan format: outlines, rooms, doors and objects, as JSON or YAML.

A plan that is written by `native_document` and read again at the same cell size is equal to it::

    {"format": "fleet2d-floorplan", "version": 1, "name": "flat",
     "free": [{"outline": [[0, 0], [5, 0], [5, 3], [0, 3]], "holes": []}],
     "rooms": [{"type": "kitchen", "polygon": [[0, 0], [2, 0], [2, 3], [0, 3]]}],
     "entrance": [4.5, 0.5]}

`PlanFile` has all keys. The bundled homes are files in this format.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import shapely
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    TypeAdapter,
    model_validator,
)
from pydantic_core import core_schema
from shapely import MultiPolygon, Polygon

from fleet2d.bounds import CROSSINGS
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.file_source import SMALL_BYTES, FileSource
from fleet2d.floorplan.files import (
    RING_SCHEMA,
    Coordinate,
    FileModel,
    Listed,
    Point,
    Ring,
    Text,
    in_file,
    parse_document,
    read_json,
    shown_value,
    validate,
)
from fleet2d.floorplan.placed_objects import (
    MAX_HEIGHT_M,
    Blocks,
    PlacedObject,
    Portal,
    Posture,
    UsePlace,
)
from fleet2d.floorplan.plan import FloorPlan, cell_polygons
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.floorplan.rooms.room import MAX_GAP_M2, UNKNOWN, LabelledRegion, usual_type
from fleet2d.floorplan.source import FloorPlanSource

FORMAT = "fleet2d-floorplan"
VERSION = 1


class AreaEntry(FileModel):
    """An area: an outline and its holes.

    Attributes:
        outline: Corners, the first not repeated at the end.
        holes: Outlines of its holes.
    """

    outline: Ring
    holes: Listed[Ring] = Field(default_factory=list)

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse an area that crosses itself, as only the traced outlines of others may."""
        if not self.polygon.is_valid:
            reason, _, at = shapely.is_valid_reason(self.polygon).partition("[")
            place = f" at ({at.rstrip(']').replace(' ', ', ')}) m" if at else ""
            raise problem(f"is not a valid outline: {reason.lower()}{place}")
        return self

    @cached_property
    def polygon(self) -> Polygon:
        """The area [m]."""
        # From arrays: Shapely reads corners in lists one by one.
        return Polygon(np.array(self.outline), [np.array(hole) for hole in self.holes])


class _CornersAlone:
    """Adds to the JSON Schema that an area without holes may be written as its corners alone."""

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [RING_SCHEMA, handler(schema)]}


Area = Annotated[
    AreaEntry,
    BeforeValidator(lambda value: value if isinstance(value, dict) else {"outline": value}),
    _CornersAlone(),
]


def space_of(parts: list[AreaEntry]) -> Polygon | MultiPolygon:
    """Return the union of parts [m], which may touch and overlap.

    Raises:
        FloorPlanError: Too many overlap.
    """
    shapes = [part.polygon for part in parts]
    tree = shapely.STRtree(shapes)
    meeting = 0
    for shape in shapes:
        meeting += len(tree.query(shape))
        CROSSINGS.check(meeting, "it", FloorPlanError, prefix="at least ")
    if are_apart(parts):
        return shapes[0] if len(shapes) == 1 else MultiPolygon(shapes)
    united = shapely.union_all(shapes)
    assert isinstance(united, Polygon | MultiPolygon)
    return united


def are_apart(parts: list[AreaEntry]) -> bool:
    """Return whether parts neither overlap nor share a side."""
    return len(parts) == 1 or MultiPolygon([part.polygon for part in parts]).is_valid


def _as_parts(value: object) -> object:
    """Return the corners of one outline as a list of areas."""
    if isinstance(value, list) and value and isinstance(value[0], list):
        first: list[object] = value[0]
        return [value] if all(isinstance(number, int | float) for number in first) else value
    return value


Space = Annotated[Listed[Area], BeforeValidator(_as_parts)]


class RoomEntry(FileModel):
    """A room: its type, and where it is, by either `polygon` or `region`.

    Attributes:
        type: Its type, such as bedroom.
        name: Its name; left out: its type and a number.
        labels: Every type that it has.
        polygon: Its outline.
        region: Its parts, if it has several or holes.
    """

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": ["polygon"]}, {"required": ["region"]}]}
    )

    type: Text
    name: Text | None = None
    labels: Listed[Text] | None = None
    polygon: Area | None = None
    region: Space | None = None

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        if (self.polygon is None) == (self.region is None):
            raise problem("needs either polygon (its corners) or region (outlines with holes)")
        return self

    def to_region(self) -> LabelledRegion:
        """Return the room as a region of the plan."""
        kind = usual_type(self.type)
        labels = self.labels
        if labels is None:
            labels = [self.type] if kind != UNKNOWN else []
        parts = [self.polygon] if self.polygon is not None else self.region or []
        return LabelledRegion(tuple(labels), space_of(parts), self.name, kind)


class DoorwayEntry(FileModel):
    """A passage between two rooms, as a line across it.

    Attributes:
        name: Its name; left out: those of its rooms.
        leaf: Whether a door hangs in it.
    """

    start: Point
    end: Point
    name: Text | None = None
    leaf: bool = True


# A heading beyond two turns is in degrees [rad].
MAX_HEADING = 4 * math.pi


def _heading(value: float) -> float:
    if abs(value) > MAX_HEADING:
        raise problem(
            f"is {value:g}, more than two turns: headings are in radians,"
            f" {math.radians(value):.6g} if it is in degrees"
        )
    return value


Heading = Annotated[Coordinate, AfterValidator(_heading)]
"""A direction [rad], counter-clockwise from +x."""


class UseEntry(FileModel):
    """A place to use an object from.

    Attributes:
        heading: Direction that the person faces.
        approach: Place from which a person steps to it.
    """

    x: Coordinate
    y: Coordinate
    heading: Heading
    posture: Posture = "stand"
    approach: Point | None = None


class ObjectUse(FileModel):
    """How an object is used.

    Attributes:
        blocks: What it blocks: nothing, bodies, or bodies and sight.
        heading: Direction of its front.
        uses: Places to use it from.
        height: How high it is [m]; 0: it hides nobody; left out: what is usual for its type.
    """

    blocks: Blocks = "path"
    heading: Heading = 0.0
    height: Annotated[float, Field(ge=0, le=MAX_HEIGHT_M)] | None = None
    uses: Listed[UseEntry] = Field(default_factory=list)

    def use_places(self) -> tuple[UsePlace, ...]:
        """Return the places to use it from."""
        return tuple(UsePlace(**dict(use)) for use in self.uses)


class ObjectEntry(ObjectUse):
    """A piece of furniture or a device, stored separately from the walls.

    Attributes:
        type: Its type, such as bed.
        name: Its name; left out: its type and a number.
    """

    type: Text
    footprint: Area
    name: Text | None = None

    def to_object(self) -> PlacedObject:
        """Return the object as one of the plan."""
        shape = self.footprint.polygon
        uses = self.use_places()
        name = self.name or ""
        return PlacedObject(name, self.type, shape, self.blocks, uses, self.heading, self.height)


class PortalEntry(FileModel):
    """Stairs or a lift between two storeys.

    Attributes:
        start: Its one end, such as the foot of stairs.
        end: Its other end.
        takes: How long people take from one to the other [s].
        type: What it is.
    """

    start: Point
    end: Point
    takes: Annotated[Coordinate, Field(gt=0)] = 12.0
    type: Literal["stairs", "lift"] = "stairs"

    def to_portal(self, scale: float) -> Portal:
        """Return the portal as a part of a plan, with its places multiplied by `scale`."""
        (x0, y0), (x1, y1) = self.start, self.end
        start = (x0 * scale, y0 * scale)
        end = (x1 * scale, y1 * scale)
        return Portal(self.type, start, end, round(self.takes * 1_000_000))


class PlanFile(FileModel):
    """A home. Lengths are in metres, angles in radians counter-clockwise from +x.

    Attributes:
        name: Name of the plan; left out: of its file.
        free: The parts of the free space between the walls, such as a rectangle for each room and
            each doorway; where they touch or overlap they are one.
        rooms: Its rooms; space of none is the room unknown_1.
        doorways: Passages between rooms; left out: the walls are searched.
        objects: Furniture and devices, which are separate from the walls.
        no_go: Areas that robots keep out of.
        glass: Areas of glass in walls, such as a rectangle for each inner window: seen through, not
            walked through.
        entrance: A place just inside the front door.
        portals: Stairs and lifts between storeys, which lie side by side.
    """

    model_config = ConfigDict(title="Fleet2D floor plan")

    format: Literal["fleet2d-floorplan"]
    version: Literal[1]
    name: Text | None = None
    free: Space = Field(json_schema_extra={"minItems": 1})
    rooms: Listed[RoomEntry] | None = None
    doorways: Listed[DoorwayEntry] | None = None
    objects: Listed[ObjectEntry] = Field(default_factory=list)
    no_go: Listed[Area] = Field(default_factory=list)
    glass: Listed[Area] = Field(default_factory=list)
    entrance: Point | None = None
    portals: Listed[PortalEntry] = Field(default_factory=list)


PLAN_FILE = TypeAdapter(PlanFile)


_LISTS: dict[str, type[FileModel]] = {
    "free": AreaEntry,
    "rooms": RoomEntry,
    "region": AreaEntry,
    "doorways": DoorwayEntry,
    "objects": ObjectEntry,
    "uses": UseEntry,
    "no_go": AreaEntry,
    "glass": AreaEntry,
    "portals": PortalEntry,
}
_AREAS = ("polygon", "footprint")
_POINTS = ("start", "end", "approach", "entrance")


def unchecked(model: type[FileModel], content: Any) -> Any:
    """Return the content of a file as a model, without checking it.

    To check takes most of the time of reading a home, and loads modules that nothing else needs.
    """
    fields: dict[str, Any] = {"outline": content} if isinstance(content, list) else dict(content)
    for key, value in fields.items():
        if key in _LISTS:
            fields[key] = [unchecked(_LISTS[key], item) for item in value]
        elif key in _AREAS:
            fields[key] = unchecked(AreaEntry, value)
        elif key in _POINTS:
            fields[key] = tuple(value)
    return model.model_construct(**fields)


def native_schema() -> dict[str, Any]:
    """Return the JSON Schema of a floor plan file.

    It describes what a file may contain. Whether outlines cross, doorways lie in passages and names
    differ is checked only when the plan is read.

    >>> sorted(native_schema()["required"])
    ['format', 'free', 'version']
    """
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return dialect | PlanFile.model_json_schema()


class Native(FileSource):
    """A plan in Fleet2D's own format.

    Attributes:
        path: The plan's JSON or YAML file.
    """

    marks = (("format", FORMAT),)
    small_bytes = SMALL_BYTES

    path: InputPath

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the plan.

        Raises:
            FloorPlanError: It can't be read, isn't in this format, or has no free space.
        """
        content = parse_document(files[self.path], self.path, unique=True)
        with in_file(self.path):
            if content.get("format") != FORMAT:
                hint = (
                    " (it looks like HouseExpo: use type houseexpo)" if "verts" in content else ""
                )
                raise FloorPlanError(f'no Fleet2D floor plan: "format" is not "{FORMAT}"{hint}')
            if content.get("version") != VERSION:
                version = shown_value(content.get("version"))
                raise FloorPlanError(
                    f"version {version} of the format is not known: this Fleet2D reads {VERSION}"
                )
            file = validate(PLAN_FILE, {**content, "version": VERSION})
            return plan_of(file, self.path, self.cell, self.scale)


def read_native(path: Path, cell: float = 0.05) -> FloorPlan:
    """Read a floor plan in Fleet2D's own format.

    Args:
        path: The file: YAML if its name ends in .yaml or .yml, else JSON.
        cell: Side of a grid cell [m].

    Raises:
        FloorPlanError: It can't be read, isn't in this format, or has no free space.
    """
    return Native.model_construct(path=path, cell=cell, scale=None).load()


def plan_of(file: PlanFile, path: Path, cell: float, scale: float | None = None) -> FloorPlan:
    """Return the floor plan of a file."""
    free = space_of(file.free)
    regions = [room.to_region() for room in file.rooms or ()]
    return FloorPlan.build(
        file.name or path.stem,
        free,
        regions if are_apart(file.free) else _with_passages(free, regions),
        cell,
        source=f"Fleet2D floor plan, {path.name}",
        entrance=file.entrance,
        doorways=None if file.doorways is None else [DoorLine(**dict(d)) for d in file.doorways],
        regions_are="none" if file.rooms is None else "exact",
        objects=[thing.to_object() for thing in file.objects],
        no_go=[area.polygon for area in file.no_go],
        glass=[area.polygon for area in file.glass],
        scale=scale,
    ).with_portals([portal.to_portal(scale or 1.0) for portal in file.portals])


def _with_passages(
    free: Polygon | MultiPolygon, regions: list[LabelledRegion]
) -> list[LabelledRegion]:
    """Return the rooms, each with those passages to others that no room covers.

    A passage is free space that is smaller than a room and lies between two rooms; it belongs to
    the first of these.
    """
    shapes = [region.shape for region in regions]
    uncovered = shapely.get_parts(shapely.difference(free, shapely.union_all(shapes)))
    grown: list[Any] = list(shapes)
    for part in uncovered.tolist():
        beside = [k for k, shape in enumerate(shapes) if part.distance(shape) == 0]
        if len(beside) > 1 and 0 < part.area < MAX_GAP_M2:
            grown[beside[0]] = shapely.union_all([grown[beside[0]], part])
    return [replace(r, shape=shape) for r, shape in zip(regions, grown, strict=True)]


def native_document(plan: FloorPlan) -> dict[str, Any]:
    """Return a plan as the mapping that `read_native` reads, of plain JSON data."""
    to_metres = plan.lattice.to_metres

    def parts(polygons: Sequence[Polygon]) -> list[dict[str, Any]]:
        return [_part_document(shapely.transform(polygon, to_metres)) for polygon in polygons]

    document: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": plan.name,
        "free": parts(plan.polygons),
        "rooms": [
            {
                "name": room.name,
                "type": room.type,
                "labels": list(room.labels),
                "region": parts(cell_polygons(plan.room_of_cell == room.index)),
            }
            for room in plan.rooms
        ],
        "doorways": [
            {"name": d.name, "start": list(d.start), "end": list(d.end), "leaf": d.leaf}
            for d in plan.doorways
        ],
    }
    panes = [shapely.transform(pane, to_metres) for pane in plan.glass]
    further: dict[str, list[Any]] = {
        "objects": [object_document(thing) for thing in plan.objects],
        "no_go": [_area_document(area) for area in plan.no_go],
        "glass": [_area_document(pane) for pane in panes],
        "portals": [
            {"type": p.type, "start": list(p.start), "end": list(p.end), "takes": p.takes_us / 1e6}
            for p in plan.portals
        ],
    }
    document |= {key: part for key, part in further.items() if part}
    if plan.entrance is not None:
        document["entrance"] = list(plan.entrance)
    return document


def object_document(thing: PlacedObject) -> dict[str, Any]:
    """Return an object as the mapping that `read_native` reads."""
    document: dict[str, Any] = {
        "name": thing.name,
        "type": thing.type,
        "footprint": _area_document(thing.footprint),
        "blocks": thing.blocks,
    }
    if thing.heading:
        document["heading"] = thing.heading
    if thing.height is not None:
        document["height"] = thing.height
    if thing.uses:
        document["uses"] = [_use_document(use) for use in thing.uses]
    return document


def _use_document(use: UsePlace) -> dict[str, Any]:
    document = {"x": use.x, "y": use.y, "heading": use.heading, "posture": use.posture}
    return document if use.approach is None else {**document, "approach": list(use.approach)}


def _area_document(polygon: Polygon) -> Any:
    area = _part_document(polygon)
    return area if "holes" in area else area["outline"]


def _part_document(polygon: Polygon) -> dict[str, Any]:
    corners = shapely.get_coordinates
    outline, *holes = (corners(ring)[:-1].tolist() for ring in shapely.get_rings(polygon))
    return {"outline": outline, "holes": holes} if holes else {"outline": outline}


HOMES = Path(__file__).with_name("homes")


class Bundled(FloorPlanSource):
    """A home that comes with Fleet2D.

    Attributes:
        name: The name of the home.
    """

    name: Literal["family_home"] = "family_home"

    def load(self) -> FloorPlan:
        """Read the plan."""
        return read_bundled(self.name, self.cell, self.scale)


def read_bundled(name: str, cell: float = 0.05, scale: float | None = None) -> FloorPlan:
    """Read a home that comes with Fleet2D, whose file the tests check.

    Args:
        name: The name of the home.
        cell: Side of a grid cell [m].
        scale: What its lengths are multiplied by; None for 1.

    Example:
        >>> len(read_bundled("family_home").rooms)
        14
    """
    path = HOMES / f"{name}.json"
    return plan_of(unchecked(PlanFile, read_json(path)), path, cell, scale)


def bundled_names() -> list[str]:
    """Return the names of the homes that come with Fleet2D."""
    return sorted(path.stem for path in HOMES.glob("*.json"))
