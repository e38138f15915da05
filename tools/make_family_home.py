"""Draw the bundled family home: rooms are rectangles, doors are gaps in the walls between them.

Doors hang in the gaps as wide as one; furniture is put into the rooms by rule.

Run it from the root of the repository: python tools/make_family_home.py
"""

import json
import re
from pathlib import Path

import shapely

from fleet2d.floorplan.furnish import furnish
from fleet2d.floorplan.native import native_document, read_native

HOME = Path("src/fleet2d/floorplan/homes/family_home.json")
WALL = 0.15
DOOR = 0.9

# type, and the clear space (x0, y0, x1, y1) [m]; the front door looks south, to lower y
ROOMS = [
    ("entryway", (7.6, 2.4, 10.2, 5.5)),
    ("hallway", (1.95, 5.65, 10.9, 6.9)),
    ("living_room", (10.35, 0.0, 17.6, 5.5)),
    ("dining_room", (11.05, 5.65, 14.4, 10.6)),
    ("kitchen", (14.55, 5.65, 18.6, 10.0)),
    ("bedroom", (0.0, 7.05, 4.6, 11.8)),
    ("bedroom", (7.3, 7.05, 10.9, 11.2)),
    ("bedroom", (0.0, 1.2, 4.0, 5.5)),
    ("bathroom", (4.75, 9.2, 7.15, 11.8)),
    ("bathroom", (4.75, 7.05, 7.15, 9.05)),
    ("office", (4.15, 1.2, 7.45, 5.5)),
    ("laundry", (16.0, 10.15, 18.6, 12.4)),
    ("storage", (14.55, 10.15, 15.85, 12.4)),
    ("storage", (0.0, 5.65, 1.8, 6.9)),
]

# two rooms by their place above, where along their wall the middle of the gap is [m], its width [m]
DOORS = [
    (0, 1, 8.9, 1.8),  # entryway, open to the hallway
    (0, 2, 4.2, 1.8),  # and to the living room
    (1, 3, 6.25, DOOR),
    (2, 3, 12.9, 2.4),  # living room, open to the dining room
    (3, 4, 7.6, 2.0),  # and the dining room to the kitchen
    (1, 5, 3.6, DOOR),
    (1, 6, 8.1, DOOR),
    (1, 7, 3.2, DOOR),
    (5, 8, 10.6, 0.85),
    (1, 9, 6.2, 0.85),
    (1, 10, 5.0, DOOR),
    (4, 11, 17.6, 0.85),
    (4, 12, 15.2, 0.85),
    (1, 13, 6.25, 0.85),
]

ENTRANCE = (8.9, 2.95)
FURNITURE_SEED = 4


def gap(first: int, second: int, at: float, width: float) -> shapely.Polygon:
    """Return the gap in the wall between two rooms."""
    a, b = ROOMS[first][1], ROOMS[second][1]
    low, high = at - width / 2, at + width / 2
    if min(a[3], b[3]) <= max(a[1], b[1]):  # one lies above the other
        return shapely.box(low, min(a[3], b[3]), high, max(a[1], b[1]))
    return shapely.box(min(a[2], b[2]), low, max(a[0], b[0]), high)


def doorway(first: int, second: int, at: float, width: float) -> dict[str, object]:
    """Return the doorway in the middle of a gap; a door hangs in it unless it is wide."""
    x0, y0, x1, y1 = gap(first, second, at, width).bounds
    if x1 - x0 > y1 - y0:
        start, end = (x0, (y0 + y1) / 2), (x1, (y0 + y1) / 2)
    else:
        start, end = ((x0 + x1) / 2, y0), ((x0 + x1) / 2, y1)
    points = [[round(x, 3), round(y, 3)] for x, y in (start, end)]
    return {"start": points[0], "end": points[1], "leaf": width <= DOOR}


def corners(shape: shapely.LinearRing) -> list[list[float]]:
    """Return a ring's corners to the millimetre."""
    return [[round(x, 3), round(y, 3)] for x, y in shape.coords[:-1]]


def main() -> None:
    """Write the plan."""
    spaces = [shapely.box(*box) for _, box in ROOMS]
    free = shapely.union_all([*spaces, *(gap(*door) for door in DOORS)], grid_size=0.001)
    free = shapely.orient_polygons(shapely.normalize(free.simplify(0)))
    # A room ends in the middle of its walls, so that each door is half of either room.
    rooms = [
        {"type": kind, "polygon": corners(space.buffer(WALL / 2, join_style="mitre").exterior)}
        for (kind, _), space in zip(ROOMS, spaces, strict=True)
    ]
    part = {"outline": corners(free.exterior), "holes": [corners(hole) for hole in free.interiors]}
    home = {
        "format": "fleet2d-floorplan",
        "version": 1,
        "name": "family_home",
        "free": [part],
        "rooms": rooms,
        "doorways": [doorway(*door) for door in DOORS],
        "entrance": ENTRANCE,
    }
    write(home)
    furnished = furnish(read_native(HOME), FURNITURE_SEED)
    write({**home, "objects": native_document(furnished)["objects"]})


def write(home: dict[str, object]) -> None:
    """Write a plan's file."""
    # One point to a line: people read this file.
    text = re.sub(r"\[\s+([-\d.]+),\s+([-\d.]+)\s+\]", r"[\1, \2]", json.dumps(home, indent=1))
    HOME.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
