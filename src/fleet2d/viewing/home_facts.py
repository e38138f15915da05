"""The home on the page: its rooms and pieces, and its walls and doors as they change in a run."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from fleet2d.artifacts.manifest import FILE_NAME
from fleet2d.configuration.problems import validating
from fleet2d.entities.home_object import Door
from fleet2d.errors import ArtifactError, Fleet2DError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.placed_objects import PlacedObject, move_object
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.kernels import F64, I16, Mesh
from fleet2d.palette import deep_color, room_color
from fleet2d.runs.run import Run
from fleet2d.runtime.events import EventKind
from fleet2d.viewing.contract import (
    DoorFacts,
    DoorwayFacts,
    HomeFacts,
    ObjectFacts,
    Point,
    RoomFacts,
    UseFacts,
    WallsChange,
    WallsFacts,
)
from fleet2d.viewing.look import symbol_of

DIGITS = 4  # tenths of a millimetre
BOX_SHARE = 0.97
"""A piece that fills less of the box around it than this is no box."""


def home_facts(plan: FloorPlan, doors: Sequence[DoorFacts] = ()) -> HomeFacts:
    """Return the facts of a floor plan.

    Args:
        plan: The floor plan.
        doors: The doors in its doorways.
    """
    lattice = plan.lattice
    symbols: dict[tuple[str, float, float], int] = {}
    origin_cell = np.rint(np.asarray(lattice.origin) / lattice.cell).astype(int)
    left, bottom = (origin_cell * UNITS_PER_CELL).tolist()
    return HomeFacts(
        name=plan.name,
        cell=lattice.cell,
        origin_units=(left, bottom),
        units_per_m=lattice.units_per_m,
        columns=lattice.columns,
        rows=lattice.rows,
        bounds=plan.bounds,
        area_m2=plan.area_m2,
        free=[_outlines(part, lattice) for part in plan.polygons],
        rooms=list(_rooms_facts(plan.rooms)),
        room_cells=runs_of(plan.room_of_cell),
        place_cells=runs_of(plan.room_of_place),
        doorways=[DoorwayFacts(start=d.start, end=d.end, leaf=d.leaf) for d in plan.doorways],
        doors=list(doors),
        objects=[object_facts(item, symbols) for item in (*plan.objects, *_panes(plan))],
        symbols=[symbol_of(*key) for key in symbols],
        no_go=[points(_corners(area.exterior)) for area in plan.no_go],
        entrance=plan.entrance,
    )


def _outlines(part: shapely.Polygon, lattice: Lattice) -> list[list[Point]]:
    """Return the outlines of a part of the free space and of its holes [m]."""
    return [points(lattice.to_metres(_corners(ring))) for ring in shapely.get_rings(part)]


def _corners(ring: shapely.LinearRing) -> F64:
    """Return the corners of a ring, each once: float64 (n, 2)."""
    return shapely.get_coordinates(ring)[:-1]


def _panes(plan: FloorPlan) -> list[PlacedObject]:
    """Return glass as objects, for which the page draws outlines and names."""
    inside = [shapely.transform(pane, plan.lattice.to_metres) for pane in plan.glass]
    return [PlacedObject(f"glass_{k}", "glass", pane) for k, pane in enumerate(inside)]


def object_facts(item: PlacedObject, symbols: dict[tuple[str, float, float], int]) -> ObjectFacts:
    """Return the facts of a piece of furniture.

    Args:
        item: The piece.
        symbols: The numbers of symbols by type and size [m], which grow.
    """
    place = placed_symbol(item)
    symbol = -1
    if place.is_box:
        key = (item.type, round(place.wide, 3), round(place.deep, 3))
        symbol = symbols.setdefault(key, len(symbols))
    return ObjectFacts(
        name=item.name,
        type=item.type,
        outline=points(_corners(item.footprint.exterior)),
        middle=place.middle,
        symbol=symbol,
        blocks=item.blocks,
        front=front_of(item),
        uses=[UseFacts(x=u.x, y=u.y, heading=u.heading, posture=u.posture) for u in item.uses],
    )


class SymbolPlace(NamedTuple):
    """The place of the symbol of a piece of furniture [m].

    Attributes:
        middle: The middle of the piece.
        wide: Its extent from left to right.
        deep: Its extent from back to front.
        is_box: Whether the piece is a box aligned with its front, which the symbol fills.
        right: The direction to its right, float64 (2,).
        forward: The direction of its front, float64 (2,).
    """

    middle: Point
    wide: float
    deep: float
    is_box: bool
    right: F64
    forward: F64


def placed_symbol(item: PlacedObject) -> SymbolPlace:
    """Return the place of the symbol of a piece of furniture."""
    front = front_of(item)
    forward = np.array([math.cos(front), math.sin(front)])
    right = np.array([forward[1], -forward[0]])
    corners = shapely.get_coordinates(item.footprint)
    along = corners @ forward
    across = corners @ right
    wide = float(np.ptp(across))
    deep = float(np.ptp(along))
    middle_across = across.min() + wide / 2
    middle_along = along.min() + deep / 2
    middle = middle_across * right + middle_along * forward
    is_box = item.footprint.area > BOX_SHARE * wide * deep
    x, y = np.round(middle, DIGITS).tolist()
    return SymbolPlace((x, y), wide, deep, is_box, right, forward)


def front_of(item: PlacedObject) -> float:
    """Return the direction of the front of a piece of furniture [rad].

    If it isn't given, people who sit or lie on the piece face its front, and people who stand at it
    face the piece.
    """
    if item.heading or not item.uses:
        return item.heading
    rests = [use.heading for use in item.uses if use.posture != "stand"]
    return rests[0] if rests else item.uses[0].heading + math.pi


def walls_facts(mesh: Mesh) -> WallsFacts:
    """Return the walls that block sight."""
    return WallsFacts(
        vertices=mesh.vertices.ravel().tolist(),
        triangles=mesh.triangles.ravel().tolist(),
        neighbors=mesh.neighbors.ravel().tolist(),
    )


def runs_of(cells: I16) -> list[int]:
    """Return cells as pairs (value, number of cells), row by row.

    >>> runs_of(np.array([[1, 1], [1, 2]], np.int16))
    [1, 3, 2, 1]
    """
    flat = cells.ravel()
    ends = np.append(np.flatnonzero(np.diff(flat)) + 1, len(flat))
    values = flat[ends - 1].astype(np.int64)
    counts = np.diff(ends, prepend=0)
    return np.stack([values, counts], axis=1).ravel().tolist()


def points(coordinates: NDArray[Any]) -> list[Point]:
    """Return points, float64 (n, 2) [m], as pairs rounded to 0.1 mm."""
    return [(x, y) for x, y in np.round(coordinates, DIGITS).tolist()]


def _rooms_facts(rooms: Sequence[Room]) -> Iterator[RoomFacts]:
    """Yield the facts of rooms; those of one type have different shades."""
    counts: Counter[str] = Counter()
    for room in rooms:
        yield RoomFacts(
            name=room.name,
            type=room.type,
            color=room_color(room.type, counts[room.type]),
            deep_color=deep_color(room.type, counts[room.type]),
            anchor=room.anchor_xy,
            area_m2=room.area_m2,
        )
        counts[room.type] += 1


_MOVE = re.compile(r"(.+) to \((\S+), (\S+)\)")
MAX_ARRANGEMENTS = 500


def door_facts(name: str, door: Door, plan: FloorPlan) -> DoorFacts:
    """Return a door as it is when the run starts."""
    doorway = door.find(plan)
    return DoorFacts(
        name=name, start=doorway.start, end=doorway.end, open=door.open, locked=door.locked
    )


def _doors_of(run: Run) -> dict[str, Door]:
    """Return the doors of a run's scenario by name, in its order."""
    doors = {}
    for name, settings in run.manifest["scenario"].get("objects", {}).items():
        if settings.get("type") == "door":
            with validating(f"{FILE_NAME}: scenario.objects.{name}"):
                doors[name] = Door(**{k: value for k, value in settings.items() if k != "type"})
    return doors


class WallsHistory:
    """The walls of a run over time, each arrangement of doors and furniture once.

    Attributes:
        doors: The doors as they are when the run starts, in the order of its scenario.
        changes: The steps at which the walls change, with the id of the new set of walls, in order.
        meshes: The sets of walls, by id.
    """

    def __init__(self, run: Run) -> None:
        """Replay the events of a run that change its home.

        Raises:
            ScenarioError: The manifest describes a door wrongly.
        """
        doors = _doors_of(run)
        self.doors = [door_facts(name, door, run.plan) for name, door in doors.items()]
        self._names = list(doors)
        self._home = Home(run.plan, [door.find(run.plan) for door in doors.values()])
        self.meshes: list[Mesh] = []
        self._numbers: dict[tuple[object, ...], int] = {}
        for number, door in enumerate(doors.values()):
            if not door.open:
                self._home.set_door(number, is_open=False)
        self.changes = [WallsChange(step=0, walls=self._number())]
        if doors or run.manifest["scenario"].get("script"):
            for step, entity, event, detail in _home_events(run):
                self._replay(step, entity, event, detail)

    def mesh(self, number: int) -> Mesh:
        """Return a set of walls by its id.

        Raises:
            ArtifactError: There is no such set of walls.
        """
        if not 0 <= number < len(self.meshes):
            raise ArtifactError(f"there is no set of walls with id {number}")
        return self.meshes[number]

    def _replay(self, step: int, entity: str, event: str, detail: str) -> None:
        if event in (EventKind.OPENED, EventKind.SHUT) and entity in self._names:
            self._home.set_door(self._names.index(entity), is_open=event == EventKind.OPENED)
        elif event == EventKind.MOVED and (place := _MOVE.fullmatch(detail)):
            item = self._home.object(place[1])
            to = (float(place[2]), float(place[3]))
            try:
                self._home.put(move_object(item, self._home.plan.lattice, to, 0.0))
            except Fleet2DError:
                return
        else:
            return
        if len(self.meshes) >= MAX_ARRANGEMENTS:
            return
        walls = self._number()
        if walls != self.changes[-1]["walls"]:
            if self.changes[-1]["step"] == step:
                self.changes.pop()
            self.changes.append(WallsChange(step=step, walls=walls))

    def _number(self) -> int:
        """Return the id of the present set of walls."""
        home = self._home
        tall = [(item.name, item.footprint.wkb) for item in home.objects if item.blocks == "sight"]
        key = (home.shut, *tall)
        if key not in self._numbers:
            self._numbers[key] = len(self.meshes)
            self.meshes.append(home.walls)
        return self._numbers[key]


def _home_events(run: Run) -> list[tuple[int, str, str, str]]:
    """Return step, entity, event and detail of the events that change the home, in order."""
    if "events" not in run.tables:
        return []
    from pyarrow import compute

    from fleet2d.artifacts.arrow import string_array

    try:
        table = run.tables["events"]
    except ArtifactError:  # the run's notes say that it is damaged
        return []
    events = compute.cast(table["event"], "string")
    kinds = string_array([EventKind.OPENED, EventKind.SHUT, EventKind.MOVED])
    rows = table.filter(compute.is_in(events, kinds))
    columns = ("step", "entity", "event", "detail")
    return [tuple(row.values()) for row in rows.select(columns).to_pylist()]
