"""Plans of features: rooms, walls, doors and furniture as shapes, however a file draws them."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
import shapely.geometry
from pydantic import TypeAdapter
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.files import validate
from fleet2d.floorplan.native import ObjectUse
from fleet2d.floorplan.placed_objects import PlacedObject, Point, Portal, distinct_names
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import MIN_APART_M, DoorLine
from fleet2d.floorplan.rooms.room import PRIORITY, UNKNOWN, room_type, usual_type
from fleet2d.homes.formats.enclosure import (
    draws_walls,
    enclosed_space,
    multi,
    parts_of,
    unnamed_space,
    wall_gaps,
    within_walls,
)
from fleet2d.homes.formats.passages import (
    BORDER_M,
    NEAR_M,
    TOUCH_M,
    Passage,
    door_axes,
    find_passage,
    shared_borders,
    spans_free_space,
)
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import sum_in_order

SURFACES = ("Polygon", "MultiPolygon")
LINES = ("LineString", "MultiLineString")
GEOMETRIES = {
    **dict.fromkeys(("room", "free", "no_go"), SURFACES),
    "object": (*SURFACES, "Point"),
    **dict.fromkeys(("window", "wall"), (*LINES, *SURFACES)),
    **dict.fromkeys(("door", "opening"), (*LINES, *SURFACES, "Point")),
    "entrance": ("Point", "LineString"),
    "portal": LINES,
    **dict.fromkeys(("stairs", "lift"), SURFACES),
}
"""The types of geometry that each kind of feature may have."""

Move = Callable[[F64], F64]


# Distance of the entrance from a door that leads outside, and how far an entrance may be moved.
INSIDE_M = 0.3
ENTRANCE_REACH_M = 1.0
# Side of an object that is drawn as a point, and width of a door that is.
POINT_OBJECT_M = 0.1
# Space in no room that is smaller belongs to the nearest [m2].
SLIVER_M2 = 0.1
POINT_DOOR_M = 0.9
DOOR_WIDTHS_M = (0.4, 5.0)
# Steps in which a door that another wall covers is moved along its own.
SLIDE_M = 0.05
# Words in the names of front doors, in several languages, and what a door outside leads to, the
# likeliest first; last of all where people sit outside.
FRONT_DOORS = re.compile(
    "front|main|entr|haust|eingang|wohnungst|voordeur|ingresso|principal", re.IGNORECASE
)
FRONT_ROOMS = ("entryway", "lobby", "hallway", "hall", "living_room", "kitchen")
BACK_ROOMS = ("balcony", "loggia", "terrace", "garage")
# How far from the end of stairs people may stand, and how much room they need there [m].
STAIRS_REACH_M = 1.5
STANDING_M = 0.25
PORTAL_S = 12.0

_USES = ("category", "type", "usage", "use", "room", "room_type", "function")
# Tags of OpenStreetMap that tell the use of a room, with the type that they mean.
_OSM_USES = {
    ("amenity", "toilets"): "toilet",
    ("amenity", "kitchen"): "kitchen",
    ("indoor", "corridor"): "hallway",
    ("highway", "elevator"): "passenger_elevator",
    ("stairs", "yes"): "stairs",
}
# IMDF's categories of units that have another name in the vocabulary.
_IMDF_TYPES = {
    "restroom": "toilet",
    "shower": "bathroom",
    "lounge": "living_room",
    "privatelounge": "living_room",
    "walkway": "hallway",
    "fitnessroom": "gym",
    "foodservice": "dining_room",
    "parking": "garage",
    "elevator": "passenger_elevator",
    "unspecified": UNKNOWN,
    "nonpublic": UNKNOWN,
}


_OBJECT_USE = TypeAdapter(ObjectUse)


@dataclass(frozen=True)
class Feature:
    """A feature of the file.

    Attributes:
        kind: One of `GEOMETRIES`.
        where: Its place in the file, for messages.
        shape: Its geometry; in the units of the file until `in_metres`.
        properties: Its properties in the file.
        level: The storey that it is on, or None.
        shift: How far it was moved along x, to lie beside other storeys.
    """

    kind: str
    where: str
    shape: BaseGeometry
    properties: dict[str, Any]
    level: str | None = None
    shift: float = 0.0

    def text(self, *keys: str) -> str | None:
        """Return the first property with text, on one line; in English if possible."""
        for key in keys:
            value = self.properties.get(key)
            if isinstance(value, dict):  # in IMDF by language
                texts = [v for v in (value.get("en"), *value.values()) if isinstance(v, str)]
                value = texts[0] if texts else None
            if isinstance(value, str) and value.strip():
                return " ".join(value.split())
        return None


class Draft:
    """Converts features to a floor plan; all in metres."""

    def __init__(
        self,
        features: Sequence[Feature],
        wall_m: float,
        notes: list[str],
        *,
        move: Move = lambda xy: xy,
        scale: float | None = None,
    ) -> None:
        """Take the features apart, and open doors in the walls.

        Args:
            features: The features [m].
            wall_m: Thickness of walls that are drawn as lines, and between rooms that touch.
            notes: Sentences on anomalies are added.
            move: Converts further coordinates of the features' properties to metres.
            scale: What lengths are multiplied by before that; None for 1.
        """
        self.move = move
        if scale is not None:
            shapes = [shapely.transform(f.shape, lambda xy: xy * scale) for f in features]
            features = [replace(f, shape=s) for f, s in zip(features, shapes, strict=True)]
            self.move = lambda xy: move(xy) * scale
        self.scale = scale or 1.0
        self.features = list(features)
        self.notes = notes
        self.rooms = [areas_of([room]) for room in self._of("room")]
        self.free = self._free(wall_m)
        self._widen_doors()
        self.doors: list[tuple[Feature, Passage]] = []
        self.ways_out: list[tuple[Feature, Passage]] = []
        self._cut_doors()
        self.panes = list(self._glaze())

    def build(self, name: str, cell: float, source: str) -> FloorPlan:
        """Return the floor plan."""
        areas = self._of("no_go")
        plan = FloorPlan.build(
            name=name,
            free=self.free,
            regions=tuple(self._regions(cell)),
            cell=cell,
            source=source,
            entrance=self._entrance(),
            doorways=tuple(self._doorways()) if self._of("door", "opening") else None,
            regions_are="exact" if self.rooms else "none",
            objects=tuple(o for f in self._of("object") for o in self._objects(f)),
            no_go=tuple(part for area in areas for part in parts_of(area.shape)),
            glass=tuple(self.panes),
            notes=tuple(self.notes),
        )
        return self._with_portals(plan)

    def _of(self, *kinds: str) -> list[Feature]:
        return [feature for feature in self.features if feature.kind in kinds]

    # --- Free space ----------------------------------------------------------------------------

    def _free(self, wall_m: float) -> MultiPolygon:
        """Return the free space between the walls, before doors open these."""
        open_space = areas_of(self._of("free"))
        walls = self._walls(wall_m)
        if open_space.is_empty and not self.rooms and not walls.is_empty:
            doors = [door.shape for door in self._of("door", "opening")]
            open_space = enclosed_space(walls, doors, self.notes)
        if open_space.is_empty and not self.rooms:
            raise FloorPlanError("it has no room and no free space, and no walls that enclose any")
        free = self._room_space(walls, wall_m) if open_space.is_empty else open_space
        free = multi(free.difference(walls))
        if free.is_empty:
            raise FloorPlanError("no free space is left: all of it is wall")
        return free

    def _walls(self, wall_m: float) -> BaseGeometry:
        """Return the walls that the file draws."""
        shapes = [wall.shape for wall in self._of("wall")]
        lines = [shape for shape in shapes if not shape.geom_type.endswith("Polygon")]
        if lines and wall_m == 0:
            self.notes.append(f"walls drawn as lines: {len(lines)}, ignored as wall_m is 0")
        solid = [shape for shape in shapes if shape.geom_type.endswith("Polygon")]
        return shapely.union_all([*solid, _thick(lines, wall_m)])

    def _room_space(self, walls: BaseGeometry, wall_m: float) -> MultiPolygon:
        """Return the rooms, with walls where they touch unless the file draws its walls."""
        borders = shared_borders(self.rooms)
        # A gap within the precision of drawings is no wall.
        joints = [line.buffer(BORDER_M, cap_style="flat") for line in borders]
        if draws_walls(walls, self.rooms, borders, wall_m):
            self._fit_rooms(walls)
            return multi(shapely.union_all([*self.rooms, *joints]))
        free = areas_of(self._of("room"))
        if borders and wall_m > 0:
            length = sum_in_order(line.length for line in borders)
            self.notes.append(
                f"rooms touch along {length:.1f} m: there are walls of {wall_m:g} m but for doors"
            )
            return multi(free.difference(_thick(borders, wall_m)))
        return multi(shapely.union_all([free, *joints]))

    def _fit_rooms(self, walls: BaseGeometry) -> None:
        """Fit the rooms to the walls of the file, and mark the gaps in these as ways."""
        doors = self._of("door", "opening")
        whole = enclosed_space(walls, [door.shape for door in doors], [])
        self.rooms = [within_walls(room, walls, whole) for room in self.rooms]
        unnamed = unnamed_space(walls, self.rooms)
        for space in unnamed:
            contacts = [
                float(room.boundary.intersection(space.buffer(TOUCH_M)).length)
                for room in self.rooms
            ]
            most = max(contacts)
            if most >= MIN_APART_M:
                index = contacts.index(most)
                joint = space.buffer(TOUCH_M, join_style="mitre").difference(walls)
                self.rooms[index] = multi(shapely.union_all([self.rooms[index], joint]))
            elif any(door.shape.distance(space) <= TOUCH_M for door in doors):
                self.features.append(Feature("room", "space without a name", space, {}))
                self.rooms.append(multi(space))
            else:
                at = space.representative_point()
                self.notes.append(
                    f"space of {space.area:.1f} m2 at ({at.x:.2f}, {at.y:.2f}) m is in no room and"
                    " has no door: left out"
                )
        for line in wall_gaps(walls, self.rooms):
            if all(door.shape.distance(line) > NEAR_M for door in doors):
                x, y = line.centroid.x, line.centroid.y
                self.features.append(Feature("opening", f"gap at ({x:.2f}, {y:.2f}) m", line, {}))

    def _widen_doors(self) -> None:
        """Make each door that is a point a line along the nearest wall."""
        for number, feature in enumerate(self.features):
            if feature.kind in ("door", "opening") and isinstance(feature.shape, shapely.Point):
                line = _door_at(feature, self.rooms or [self.free])
                self.features[number] = replace(feature, shape=line)

    def _cut_doors(self) -> None:
        """Open the walls where doors are; a door that leads outside stays shut.

        A door across space that the file calls free is open, though only a sill may be behind it.
        """
        cuts: list[Polygon] = []
        for feature, passages in self._passages("door", "opening"):
            through = next((p for p in passages if p.through), None)
            name = feature.text("name") or feature.where
            if not passages and (through := self._uncovered(feature)):
                self.notes.append(
                    f"the {feature.kind} {name} stands in another wall, too: it is moved to where"
                    " it opens"
                )
            if through:
                self.doors.append((feature, through))
                cuts += [through.opening] if through.halves else []
            elif passages:
                way_out = passages[0]
                self.ways_out.append((feature, way_out))
                if self._of("free") and spans_free_space(self.free, way_out.start, way_out.end):
                    across = Passage(way_out.start, way_out.end, 0.0, 0.0, True)
                    self.doors.append((feature, across))
                else:
                    self.notes.append(f"the {feature.kind} {name} leads outside: it stays shut")
            else:
                self.notes.append(f"the {feature.kind} {name} is in no room's wall: ignored")
        self.free = multi(shapely.union_all([self.free, *cuts]))

    def _uncovered(self, door: Feature) -> Passage | None:
        """Return the nearest passage along its wall of a door that another wall covers, if any.

        It is at most the door's width away.
        """
        for axes in door_axes(door.shape):
            start, end = np.array(axes[0])
            steps = int(np.hypot(*(end - start)) / SLIDE_M)
            for step in range(1, steps + 1):
                for shift in (step, -step):
                    away = (end - start) * shift / steps
                    x0, y0 = (start + away).tolist()
                    x1, y1 = (end + away).tolist()
                    passage = find_passage(self.free, (x0, y0), (x1, y1))
                    if passage and passage.through and self.free.covers(passage.thresholds):
                        return passage
        return None

    def _passages(self, *kinds: str) -> Iterator[tuple[Feature, list[Passage]]]:
        """Yield each door or window of some kinds, with its possible passages through a wall."""
        for feature in self._of(*kinds):
            for axes in door_axes(feature.shape):
                passages = [find_passage(self.free, start, end) for start, end in axes]
                yield feature, [passage for passage in passages if passage]

    def _glaze(self) -> Iterator[Polygon]:
        """Yield the panes of windows between two rooms; nobody sees in or out through others."""
        outer = 0
        for _, passages in self._passages("window"):
            through = next((p for p in passages if p.through and p.halves), None)
            if through:
                yield through.pane
            outer += not through
        if outer:
            self.notes.append(f"windows in outer walls, through which nobody is seen: {outer}")

    def _doorways(self) -> list[DoorLine]:
        return [DoorLine(*p.line, f.text("name"), f.kind == "door") for f, p in self.doors]

    # --- Rooms and objects ---------------------------------------------------------------------

    def _regions(self, cell: float) -> list[LabelledRegion]:
        """Return the rooms, each with its half of the passages through its walls, and slivers."""
        halves: list[list[Polygon]] = [[] for _ in self.rooms]
        for _, passage in self.doors if self.rooms else ():
            for half in passage.halves:
                away = shapely.distance(self.rooms, half).tolist()
                overlap = shapely.area(shapely.intersection(self.rooms, half)).tolist()
                if max(overlap) < half.area / 2:
                    halves[away.index(min(away))].append(half)
        covered = shapely.union_all([*self.rooms, *(half for own in halves for half in own)])
        for sliver in parts_of(self.free.difference(covered)) if self.rooms else ():
            if 0 < sliver.area < SLIVER_M2:  # of inexact outlines
                away = shapely.distance(self.rooms, sliver).tolist()
                halves[away.index(min(away))].append(sliver)
        own_names = [room.text("name") for room in self._of("room")]
        names = distinct_names(own_names, "rooms", self.notes)
        regions = []
        for feature, area, half_parts, name in zip(
            self._of("room"), self.rooms, halves, names, strict=True
        ):
            # Slightly grown: walls move to the lattice, and every cell at them needs a room.
            shape = shapely.union_all([area, *half_parts]).buffer(cell / 16, join_style="mitre")
            labels, kind = _use_of(feature)
            own_labels = feature.properties.get("labels")
            if isinstance(own_labels, list) and all(isinstance(x, str) for x in own_labels):
                labels = tuple(own_labels)
            regions.append(LabelledRegion(labels, multi(shape), name, kind))
        return regions

    def _front_door(self) -> Passage:
        """Return the door outside through which people most likely leave the home."""
        levels = list(dict.fromkeys(feature.level for feature in self.features))

        def rank(way: tuple[Feature, Passage]) -> tuple[bool, int, int]:
            feature, passage = way
            x, y = passage.inside(INSIDE_M)
            inside = shapely.Point(x, y)
            rooms = zip(self._of("room"), self.rooms, strict=True)
            kind = next((_use_of(f)[1] for f, area in rooms if area.intersects(inside)), UNKNOWN)
            likely = FRONT_ROOMS.index(kind) if kind in FRONT_ROOMS else len(FRONT_ROOMS)
            likely += len(FRONT_ROOMS) * (kind in BACK_ROOMS)
            is_named = FRONT_DOORS.search(feature.text("name") or feature.where) is not None
            return not is_named, levels.index(feature.level), likely

        feature, passage = min(self.ways_out, key=rank)
        if len(self.ways_out) > 1:
            name = feature.text("name") or feature.where
            self.notes.append(f"of {len(self.ways_out)} doors outside, {name} is the entrance")
        return passage

    def _with_portals(self, plan: FloorPlan) -> FloorPlan:
        """Return the plan with the stairs and lifts of the file."""
        things = [o.footprint for o in plan.objects if o.blocks != "nothing"]
        standing = self.free.difference(shapely.union_all(things)).buffer(-STANDING_M)
        for feature in self._of("portal"):
            ways = [_standing_ends(standing, way) for way in shapely.get_parts(feature.shape)]
            away, start, end = min(ways, key=lambda way: way[0])
            takes = feature.properties.get("takes") or PORTAL_S
            kind = str(feature.properties.get("type") or "stairs")
            try:
                if away > STAIRS_REACH_M:
                    raise FloorPlanError("there is no floor at one of its ends")
                portal = Portal(kind, start, end, round(float(takes) * 1_000_000))
                plan = plan.with_portals([portal], feature.where)
            except FloorPlanError as error:
                plan = replace(
                    plan, notes=(*plan.notes, f"{feature.where} joins no storeys: {error}")
                )
        return plan

    def _objects(self, feature: Feature) -> Iterable[PlacedObject]:
        """Return the objects of a feature, with their places of use."""
        shift = np.array([feature.shift * self.scale, 0.0])

        def move(xy: F64) -> F64:
            moved: F64 = self.move(xy) + shift
            return moved

        return _to_objects(feature, move)

    def _entrance(self) -> tuple[float, float] | None:
        """Return the place just inside the front door, if the file has one."""
        shapes = [feature.shape for feature in self._of("entrance")]
        if shapes:
            if len(shapes) > 1:
                self.notes.append(f"it has {len(shapes)} entrances: the first is used")
            at = shapes[0].centroid
        elif self.ways_out:
            at = shapely.Point(self._front_door().inside(INSIDE_M))
        else:
            return None
        roomy = self.free.buffer(-INSIDE_M / 3, join_style="mitre")
        if not roomy.contains(at) and not roomy.is_empty:
            near = shapely.get_point(shapely.shortest_line(roomy, at), 0)
            if near.distance(at) <= ENTRANCE_REACH_M:
                at = near
        return round(float(at.x), 6), round(float(at.y), 6)


def _door_at(door: Feature, rooms: Sequence[MultiPolygon]) -> LineString:
    """Return the line of a door that the file has as a point: along the nearest side of a room."""
    at: Any = door.shape
    rings = [ring for room in rooms for ring in shapely.get_rings(shapely.get_parts(room))]
    ring = min(rings, key=at.distance)
    corners = shapely.get_coordinates(ring)
    sides = [LineString(pair) for pair in pairwise(corners)]
    side = min(sides, key=at.distance)
    half = min(_width_of(door), side.length) / 2
    middle = min(max(side.project(at), half), side.length - half)
    ends = [side.interpolate(middle - half), side.interpolate(middle + half)]
    return LineString(ends)


def _width_of(door: Feature) -> float:
    """Return the width of a door that is a point [m]: of its property, as OSM has it."""
    text = str(door.properties.get("width", "")).removesuffix("m").strip()
    try:
        width = float(text)
    except ValueError:
        return POINT_DOOR_M
    return width if DOOR_WIDTHS_M[0] <= width <= DOOR_WIDTHS_M[1] else POINT_DOOR_M


def _use_of(room: Feature) -> tuple[tuple[str, ...], str]:
    """Return a room's labels and type: by its use in the file, else by its name."""
    tags = ((key, room.properties.get(key)) for key, _ in _OSM_USES)
    tagged = (_OSM_USES[tag] for tag in tags if tag in _OSM_USES)
    use = room.text(*_USES) or next(tagged, UNKNOWN)
    name = room.text("name")
    kind = _IMDF_TYPES.get(use.partition(".")[0], usual_type(use))
    if kind in ("room", UNKNOWN) and name is not None and usual_type(name) in PRIORITY:
        return (name,), usual_type(name)
    return () if kind == UNKNOWN else (use,), kind


def _standing_ends(standing: BaseGeometry, way: LineString) -> tuple[float, Point, Point]:
    """Return how far people stand from the ends of stairs, the most [m], and where."""
    ends = shapely.get_coordinates(way)[[0, -1]]
    if standing.is_empty:
        return np.inf, (0.0, 0.0), (0.0, 0.0)
    lines = [shapely.shortest_line(standing, shapely.Point(end)) for end in ends]
    places = [shapely.get_coordinates(line)[0].round(6).tolist() for line in lines]
    (x0, y0), (x1, y1) = places
    return max(float(line.length) for line in lines), (x0, y0), (x1, y1)


def _to_plan(move: Move, at: Point) -> Point:
    """Return a place of the file in the frame of the plan [m]."""
    x, y = move(np.array([at]))[0].tolist()
    return x, y


def _to_objects(feature: Feature, move: Move) -> Iterable[PlacedObject]:
    shape = feature.shape
    if isinstance(shape, shapely.Point):
        half = POINT_OBJECT_M / 2
        shape = shapely.box(shape.x - half, shape.y - half, shape.x + half, shape.y + half)
    kind = feature.text("type", "category", "object") or "object"
    properties = {key: feature.properties.get(key) for key in ObjectUse.model_fields}
    present = {key: value for key, value in properties.items() if value is not None}
    use_of = validate(_OBJECT_USE, present, f"{feature.where}.properties")
    uses = []
    for use in use_of.use_places():
        x, y = _to_plan(move, (use.x, use.y))
        approach = use.approach and _to_plan(move, use.approach)
        uses.append(replace(use, x=x, y=y, approach=approach))
    name = feature.text("name") or ""
    parts = parts_of(shape)
    for number, part in enumerate(parts):
        own = f"{name} {number + 1}" if name and len(parts) > 1 else name
        own_uses = () if number else tuple(uses)
        further = (use_of.heading, use_of.height)
        yield PlacedObject(own, room_type(kind), part, use_of.blocks, own_uses, *further)


def _thick(lines: Iterable[BaseGeometry], wall_m: float) -> BaseGeometry:
    """Return walls along lines; square at the ends, so that corners are filled."""
    shapes = [line.buffer(wall_m / 2, cap_style="square", join_style="mitre") for line in lines]
    return shapely.union_all(shapes)


def areas_of(features: Iterable[Feature]) -> MultiPolygon:
    """Return the areas of some features as one."""
    return multi(shapely.union_all([feature.shape for feature in features]))
