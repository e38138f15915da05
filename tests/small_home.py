"""A home of three rooms that can be written in any format, in twenty variations and more."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

import numpy as np
import pytest
import shapely

from fleet2d.floorplan.plan import FloorPlan

Box = tuple[float, float, float, float]
Point = tuple[float, float]
Line = tuple[Point, Point]

INNER_M = 0.1
OUTER_M = 0.2
DOOR_M = 0.9
NAMES = (
    ("Kitchen", "Living room", "Bedroom"),
    ("Küche", "Wohnzimmer", "Schlafzimmer"),
    ("Cuisine", "Salon", "Chambre"),
    ("Cocina", "Sala de estar", "Dormitorio"),
    ("Cucina", "Soggiorno", "Camera da letto"),
    ("Keuken", "Woonkamer", "Slaapkamer"),
)
TYPES = ("kitchen", "living_room", "bedroom")
VARIATIONS = [pytest.param(k, marks=[pytest.mark.slow] if k >= 4 else []) for k in range(20)]
"""The numbers of the variations."""


@dataclass(frozen=True)
class SmallHome:
    """A kitchen, a living room above it and a bedroom on the right of both; lengths in metres.

    Attributes:
        rooms: Their boxes.
        names: Their names, in some language.
        doors: The door between kitchen and living room, and between kitchen and bedroom.
        front: The front door, in the left wall of the living room.
        turn: By what `place` turns it [rad].
    """

    rooms: tuple[Box, Box, Box]
    names: tuple[str, str, str]
    doors: tuple[Line, Line]
    front: Line
    turn: float

    @property
    def walls(self) -> list[Box]:
        """The walls, with gaps at the doors."""
        (_, _, x, y), (_, y1, _, top), (x1, _, right, _) = self.rooms
        (left, _), (left_end, _) = self.doors[0]
        (_, low), (_, high) = self.doors[1]
        (_, front), (_, front_end) = self.front
        t = OUTER_M
        return [
            (-t, -t, right + t, 0),
            (-t, top, right + t, top + t),
            (right, 0, right + t, top),
            (-t, 0, 0, front),
            (-t, front_end, 0, top),
            (0, y, left, y1),
            (left_end, y, x, y1),
            (x, 0, x1, low),
            (x, high, x1, top),
        ]

    def place(self, point: Point) -> Point:
        """Return a place, turned."""
        x, y = point
        c, s = math.cos(self.turn), math.sin(self.turn)
        return c * x - s * y, s * x + c * y

    def corners(self, box: Box) -> list[Point]:
        """Return the corners of a box, turned."""
        x0, y0, x1, y1 = box
        return [self.place(p) for p in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]

    def line(self, line: Line) -> Line:
        """Return a line, turned."""
        return self.place(line[0]), self.place(line[1])


def small_home(k: int, turns: tuple[float, ...] = (0.0,)) -> SmallHome:
    """Return the variation of a number."""
    random = Random(k)
    x, y = random.uniform(3.2, 4.8), random.uniform(2.6, 3.6)
    right, top = x + random.uniform(3, 5), y + random.uniform(3, 4.5)
    x, y, right, top = (round(v, 2) for v in (x, y, right, top))
    x1, y1 = round(x + INNER_M, 2), round(y + INNER_M, 2)
    at, low, front = (
        round(random.uniform(*v), 2)
        for v in ((0.5, x - 1.4), (0.5, y - 1.4), (y1 + 0.5, top - 1.6))
    )
    return SmallHome(
        ((0, 0, x, y), (0, y1, x, top), (x1, 0, right, top)),
        NAMES[k % len(NAMES)],
        (
            ((at, y + INNER_M / 2), (at + DOOR_M, y + INNER_M / 2)),
            ((x + INNER_M / 2, low), (x + INNER_M / 2, low + DOOR_M)),
        ),
        ((-OUTER_M / 2, front), (-OUTER_M / 2, front + 1.0)),
        math.radians(turns[k % len(turns)]),
    )


def check(
    plan: FloorPlan,
    home: SmallHome,
    *,
    types: tuple[str, ...] = TYPES,
    doors: int = 2,
    front: bool = True,
    slack: float = 0.015,
    storeys: int = 1,
) -> None:
    """Check area, rooms, doors and entrance; on each of some equal storeys, joined by stairs."""
    areas = [shapely.box(*room).area for room in home.rooms]
    assert plan.area_m2 == pytest.approx(storeys * sum(areas), rel=slack)
    assert len(plan.polygons) == storeys
    assert len(plan.portals) == storeys - 1
    assert sorted(types * storeys) == sorted(room.type for room in plan.rooms)
    of_size = sorted(room.area_m2 for room in plan.rooms)
    assert of_size == pytest.approx(sorted(areas * storeys), rel=2 * slack, abs=0.2)
    assert len(plan.doorways) == doors * storeys
    assert all(abs(door.width_m - DOOR_M) < 0.06 for door in plan.doorways)
    if front:
        assert plan.entrance is not None
        living = max(plan.rooms, key=lambda room: plan.room_at(*plan.entrance) == room)
        assert living.area_m2 == pytest.approx(areas[1], rel=2 * slack, abs=0.2)


def noisy(k: int, by: float) -> Callable[[Point], Point]:
    """Return a function that moves each place by up to a length along both axes."""
    random = Random(1000 + k)

    def move(point: Point) -> Point:
        return point[0] + random.uniform(-by, by), point[1] + random.uniform(-by, by)

    return move


def arc(line: Line, inward: float) -> list[Point]:
    """Return an arc of a quarter turn round the first end of a door, as drawings have it."""
    (x0, y0), (x1, y1) = line
    angles = np.linspace(0, inward * math.pi / 2, 9)
    dx, dy = x1 - x0, y1 - y0
    return [
        (x0 + math.cos(a) * dx - math.sin(a) * dy, y0 + math.sin(a) * dx + math.cos(a) * dy)
        for a in angles
    ]
