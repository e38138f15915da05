"""Plans of features: rooms, walls, doors and furniture as shapes, however a file draws them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
import shapely.geometry
from pydantic import TypeAdapter
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.files import validate
from fleet2d.floorplan.native import ObjectUse
from fleet2d.floorplan.placed_objects import PlacedObject, Point, distinct_names
from fleet2d.floorplan.plan import LabelledRegion
from fleet2d.floorplan.rooms.doorways import (
    TOUCH_M,
    DoorLine,
    Passage,
    door_axes,
    find_passage,
    shared_borders,
)
from fleet2d.floorplan.rooms.room import PRIORITY, UNKNOWN, room_type, usual_type
from fleet2d.homes.formats.parts import PlanParts
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import sum_in_order

SURFACES = ("Polygon", "MultiPolygon")
LINES = ("LineString", "MultiLineString")
GEOMETRIES = {
    **dict.fromkeys(("room", "free", "no_go"), SURFACES),
    "object": (*SURFACES, "Point"),
    **dict.fromkeys(("door", "opening", "window", "wall"), (*LINES, *SURFACES)),
    "entrance": ("Point", "LineString"),
}
"""The types of geometry that each kind of feature may have."""

Move = Callable[[F64], F64]


# Distance of the entrance from a door that leads outside, and how far an entrance may be moved.
INSIDE_M = 0.3
ENTRANCE_REACH_M = 1.0
# Widths of gaps in walls that are closed in turn to find what they enclose [m], and the share of
# the largest space that it must keep.
GAPS_M = (0.0, 0.05, 0.2, 0.5, 1.0)
KEPT_SHARE = 0.7
# Side of an object that is drawn as a point.
POINT_OBJECT_M = 0.1

_USES = ("category", "type", "usage", "use", "room", "room_type", "function")
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
        level: The floor that it is on, or None.
    """

    kind: str
    where: str
    shape: BaseGeometry
    properties: dict[str, Any]
    level: str | None = None

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
    """Converts features to the parts of a home; all in metres."""

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
        self.features = features
        self.notes = notes
        self.rooms = [_areas([room]) for room in self._of("room")]
        self.free = self._free(wall_m)
        self.doors: list[tuple[Feature, Passage]] = []
        self.ways_out: list[Passage] = []
        self._cut_doors()
        self.panes = list(self._glaze())

    def parts(self, name: str, cell: float, source: str) -> PlanParts:
        """Return the parts of the home."""
        areas = self._of("no_go")
        return PlanParts(
            name=name,
            free=self.free,
            regions=tuple(self._regions(cell)),
            cell=cell,
            source=source,
            entrance=self._entrance(),
            doorways=tuple(self._doorways()) if self._of("door", "opening") else None,
            regions_are="exact" if self.rooms else "none",
            objects=tuple(o for f in self._of("object") for o in _to_objects(f, self.move)),
            no_go=tuple(part for area in areas for part in _parts(area.shape)),
            glass=tuple(self.panes),
            notes=tuple(self.notes),
        )

    def _of(self, *kinds: str) -> list[Feature]:
        return [feature for feature in self.features if feature.kind in kinds]

    # --- Free space ----------------------------------------------------------------------------

    def _free(self, wall_m: float) -> MultiPolygon:
        """Return the free space between the walls, before doors open these."""
        open_space = _areas(self._of("free"))
        walls = self._walls(wall_m)
        if open_space.is_empty and not self.rooms and not walls.is_empty:
            doors = [door.shape for door in self._of("door", "opening")]
            open_space = enclosed_space(walls, doors, self.notes)
        if open_space.is_empty and not self.rooms:
            raise FloorPlanError(
                "it has no room and no free space: no feature of kind room or free, and no walls"
                " that enclose space"
            )
        free = self._room_space(walls, wall_m) if open_space.is_empty else open_space
        free = _multi(free.difference(walls))
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
        """Return the rooms, with walls where they touch unless the file draws these."""
        free = _areas(self._of("room"))
        borders = shared_borders(self.rooms)
        length = sum_in_order(line.length for line in borders)
        near = walls.buffer(TOUCH_M + wall_m / 2, join_style="mitre")
        drawn = sum_in_order(float(line.intersection(near).length) for line in borders)
        if borders and wall_m > 0 and drawn < length / 2:
            self.notes.append(
                f"rooms touch along {length:.1f} m: there are walls of {wall_m:g} m but for doors"
            )
            return _multi(free.difference(_thick(borders, wall_m)))
        # A gap within the precision of drawings is no wall.
        joints = [line.buffer(TOUCH_M, cap_style="flat") for line in borders]
        return _multi(shapely.union_all([free, *joints]))

    def _cut_doors(self) -> None:
        """Open the walls where doors are; a door that leads outside stays shut."""
        cuts: list[Polygon] = []
        for feature, passages in self._passages("door", "opening"):
            through = next((p for p in passages if p.through), None)
            name = feature.text("name") or feature.where
            if through:
                self.doors.append((feature, through))
                cuts += [through.opening] if through.halves else []
            elif passages:
                self.ways_out.append(passages[0])
                self.notes.append(f"the {feature.kind} {name} leads outside: it stays shut")
            else:
                self.notes.append(f"the {feature.kind} {name} is in no room's wall: ignored")
        self.free = _multi(shapely.union_all([self.free, *cuts]))

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
        """Return the rooms, each with its half of the passages through its walls."""
        halves: list[list[Polygon]] = [[] for _ in self.rooms]
        for _, passage in self.doors if self.rooms else ():
            for half in passage.halves:
                away = shapely.distance(self.rooms, half).tolist()
                overlap = shapely.area(shapely.intersection(self.rooms, half)).tolist()
                if max(overlap) < half.area / 2:
                    halves[away.index(min(away))].append(half)
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
            regions.append(LabelledRegion(labels, _multi(shape), name, kind))
        return regions

    def _entrance(self) -> tuple[float, float] | None:
        """Return the place just inside the front door, if the file has one."""
        shapes = [feature.shape for feature in self._of("entrance")]
        if shapes:
            if len(shapes) > 1:
                self.notes.append(f"it has {len(shapes)} entrances: the first is used")
            at = shapes[0].centroid
        elif len(self.ways_out) == 1:
            at = shapely.Point(self.ways_out[0].inside(INSIDE_M))
        else:
            return None
        roomy = self.free.buffer(-INSIDE_M / 3, join_style="mitre")
        if not roomy.contains(at) and not roomy.is_empty:
            near = shapely.get_point(shapely.shortest_line(roomy, at), 0)
            if near.distance(at) <= ENTRANCE_REACH_M:
                at = near
        return round(float(at.x), 6), round(float(at.y), 6)


def _use_of(room: Feature) -> tuple[tuple[str, ...], str]:
    """Return a room's labels and type: by its use in the file, else by its name."""
    use = room.text(*_USES) or UNKNOWN
    name = room.text("name")
    kind = _IMDF_TYPES.get(use.partition(".")[0], usual_type(use))
    if kind in ("room", UNKNOWN) and name is not None and usual_type(name) in PRIORITY:
        return (name,), usual_type(name)
    return () if kind == UNKNOWN else (use,), kind


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
    parts = _parts(shape)
    for number, part in enumerate(parts):
        own = f"{name} {number + 1}" if name and len(parts) > 1 else name
        own_uses = () if number else tuple(uses)
        further = (use_of.heading, use_of.height)
        yield PlacedObject(own, room_type(kind), part, use_of.blocks, own_uses, *further)


def _thick(lines: Iterable[BaseGeometry], wall_m: float) -> BaseGeometry:
    """Return walls along lines; square at the ends, so that corners are filled."""
    shapes = [line.buffer(wall_m / 2, cap_style="square", join_style="mitre") for line in lines]
    return shapely.union_all(shapes)


def _areas(features: Iterable[Feature]) -> MultiPolygon:
    return _multi(shapely.union_all([feature.shape for feature in features]))


def _multi(shape: BaseGeometry) -> MultiPolygon:
    return MultiPolygon(_parts(shape))


def _parts(shape: BaseGeometry) -> list[Polygon]:
    return [part for part in shapely.get_parts(shape).tolist() if part.geom_type == "Polygon"]


def enclosed_space(
    walls: BaseGeometry, doors: Iterable[BaseGeometry], notes: list[str]
) -> MultiPolygon:
    """Return the space within walls and doors, with gaps closed that would lose most of it.

    Args:
        walls: The walls [m]; what they cover isn't left out.
        doors: Doors, at which walls may have gaps [m].
        notes: A note is added if gaps are closed.
    """
    shut = [walls, *(door.buffer(GAPS_M[1]) for door in doors)]
    outlines = []
    for gap in GAPS_M:
        with np.errstate(invalid="ignore"):  # GEOS divides by zero at corners in line, without harm
            solid = _parts(shapely.union_all(shut).buffer(gap / 2, join_style="mitre"))
            shells = [Polygon(part.exterior) for part in solid if part.interiors]
            whole = shapely.union_all(shells).buffer(-gap / 2, join_style="mitre")
        inside = sum_in_order(Polygon(hole).area for part in solid for hole in part.interiors)
        outlines.append((inside, whole, gap))
    most = max(inside for inside, *_ in outlines)
    whole, gap = next((w, g) for inside, w, g in outlines if inside >= KEPT_SHARE * most)
    if gap > 0 and most > 0:
        notes.append(f"gaps in the walls are closed up to {gap:g} m to find the inside")
    return _multi(whole)


def choose_level(
    levels: Sequence[tuple[str, str, float]], level: str | None, notes: list[str]
) -> str | None:
    """Return the id of the storey to read, or None if there is only one.

    Args:
        levels: Id, name and elevation of each.
        level: The name or id of one; None for the lowest that is not below the ground.
        notes: A note is added if others are left out.

    Raises:
        FloorPlanError: There is no such storey, or several have that name.

    Example:
        >>> choose_level([("a", "Cellar", -2.5), ("c", "Up", 2.8), ("b", "Ground", 0)], None, [])
        'b'
    """
    called = [name for _, name, _ in levels]
    names = {k: n if called.count(n) == 1 else f"{n} (id {k}, at {z:g})" for k, n, z in levels}
    if level is not None:
        matches = [key for key, name, _ in levels if level in (key, name)]
        if len(matches) != 1 and level not in names:
            known = ", ".join(names.values()) or "none"
            problem = f"{len(matches)} levels are called" if matches else "there is no level"
            raise FloorPlanError(f"{problem} {level!r}; its levels are: {known}")
        return level if level in names else matches[0]
    if len(levels) < 2:
        return None
    chosen = min(levels, key=lambda entry: (entry[2] < 0, entry[2]))[0]
    others = ", ".join(name for key, name in names.items() if key != chosen)
    notes.append(f"of its levels, {names[chosen]} is used, not {others}")
    return chosen
