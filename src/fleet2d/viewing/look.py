"""How a home is drawn: floors by type of room, walls, symbols of furniture, kinds of activities.

The page and Python's pictures draw the same: the page receives symbols as shapes with the facts of
a home, and the tables here as constants that `tools.contract_types` writes.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from fleet2d.configuration.documents import read_document
from fleet2d.floorplan.rooms.room import Room
from fleet2d.viewing.contract import ShapeFacts

Material = Literal["planks", "carpet", "tiles", "plain"]

PLANK_M = 0.19
JOINT_M = 0.012
WOOD = ("#e8d3b3", "#e5cfae", "#ebd8ba", "#e2caa6")
CARPET = ("#dcdde8", "#e3dce0", "#dbe2e2")
UNKNOWN = "#f4f4f2"
"""The floor of rooms of an unknown type."""

CARPETED = ("bedroom", "child_room", "guest_room", "wardrobe")
WET = ("#dce9ea", 0.3)
STONE = ("#dfdbd3", 0.75)
OUTSIDE = ("#d5dccb", 0.5)
TILES: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "kitchen": ("#eeeae2", 0.6),
        "bathroom": WET,
        "toilet": WET,
        "laundry": WET,
        "entryway": STONE,
        "lobby": STONE,
        "storage": STONE,
        "boiler_room": STONE,
        "garage": ("#d6d7d6", 1.2),
        "balcony": OUTSIDE,
        "loggia": OUTSIDE,
        "terrace": OUTSIDE,
    }
)
"""Colour and pitch [m] of the tiles of each type of room that has some; others have planks."""

WALL_M = 0.15
"""Thickness of outer walls, which files don't contain."""

LIFT_M = 0.17
"""The offset of the tops of walls, as if seen a little from the south."""

WALL_TOP = "#fcfbf8"
WALL_FACE = "#bdb4a6"
WALL_EDGE = "#a79e90"
WALL_SHADOW = "#3c2d196b"
DOOR = "#a9783f"
OUTLINE_FILL = "#d9d2c6"
OUTLINE_EDGE = "#8b857b"

NIGHT = ("#283e78", 0.55)
DUSK = ("#ffb070", 0.22)
"""Colours and opacities of the darkest and of the reddest light, over the home."""

OUT = ("Out of home", "#e4e0d7")
OTHER = ("Other", "#9aa3ad")
ACTIVITIES: Mapping[str, tuple[str, tuple[str, ...]]] = MappingProxyType(
    {
        "Sleep": ("#4c5788", ("sleep", "nap")),
        "Care": (
            "#74aeb8",
            ("toilet", "wash_hands", "wash", "shower", "bath", "dress", "medication", "freshen_up"),
        ),
        "Meals": (
            "#cf8344",
            ("drink", "breakfast", "cook", "dinner", "supper", "lunch", "snack", "dishes", "eat"),
        ),
        "Work, school": ("#8a7ab5", ("work_at_home", "homework", "computer", "study")),
        "Leisure": (
            "#e8d38c",
            ("read", "tv", "phone_call", "play", "rest", "phone", "hobby", "games", "music"),
        ),
        "Chores": (
            "#b5957d",
            ("fetch", "pick_up", "put_away", "tidy", "check_door", "laundry", "clean", "iron"),
        ),
        "Sport": ("#2f6b55", ("sport", "exercise")),
    }
)
"""Kinds of activities: their colours, and the activities of each."""


def constants() -> dict[str, Any]:
    """Return the tables by which the page draws, as JSON data."""
    return {
        "planks": {"pitch": PLANK_M, "joint": JOINT_M, "colors": WOOD},
        "unknown": UNKNOWN,
        "carpet": {"rooms": CARPETED, "colors": CARPET},
        "tiles": {kind: {"color": color, "pitch": pitch} for kind, (color, pitch) in TILES.items()},
        "walls": {
            "thickness": WALL_M,
            "lift": LIFT_M,
            "top": WALL_TOP,
            "face": WALL_FACE,
            "edge": WALL_EDGE,
            "shadow": WALL_SHADOW,
        },
        "door": DOOR,
        "outline": {"fill": OUTLINE_FILL, "edge": OUTLINE_EDGE},
        "activities": [
            {"name": name, "color": color, "activities": activities}
            for name, (color, activities) in ACTIVITIES.items()
        ],
        "out": {"name": OUT[0], "color": OUT[1], "activities": ()},
        "other": {"name": OTHER[0], "color": OTHER[1], "activities": ()},
    }


def body_label(name: str) -> str:
    """Return a name as people write it: with a capital letter, and spaces for underscores.

    Example:
        >>> body_label("ana"), body_label("living_room")
        ('Ana', 'Living room')
    """
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]


def room_labels(rooms: Sequence[Room]) -> list[str]:
    """Return rooms as people write them: with their numbers where there are several of a type.

    Example:
        >>> import fleet2d
        >>> room_labels(fleet2d.load_floorplan("family_home").rooms)[3:7]
        ['Dining room', 'Kitchen', 'Bedroom 1', 'Bedroom 2']
    """
    counts = Counter(room.type for room in rooms)
    labels = []
    for room in rooms:
        number = room.name.removeprefix(f"{room.type}_")
        is_numbered = room.name != number and number.isdecimal()
        is_alone = is_numbered and counts[room.type] == 1
        labels.append(body_label(room.type if is_alone else room.name))
    return labels


def floor_of(kind: str, number: int = 0) -> tuple[Material, str, float]:
    """Return the material, the colour and the pitch [m] of the floor of a room by its type.

    Args:
        kind: The type of the room.
        number: Its number in the home: carpets differ.

    Example:
        >>> floor_of("kitchen"), floor_of("bedroom", 1), floor_of("office")
        (('tiles', '#eeeae2', 0.6), ('carpet', '#e3dce0', 0.0), ('planks', '#e8d3b3', 0.19))
    """
    if kind == "unknown":
        return "plain", UNKNOWN, 0.0
    if kind in TILES:
        return "tiles", *TILES[kind]
    if kind in CARPETED:
        return "carpet", CARPET[number % len(CARPET)], 0.0
    return "planks", WOOD[0], PLANK_M


class Symbol:
    """A symbol of a piece of furniture as shapes [m], its middle at (0, 0), its front at the top.

    Attributes:
        wide: Its extent from left to right.
        deep: Its extent from back to front.
        shapes: The shapes, from the bottom to the top.
    """

    def __init__(self, wide: float, deep: float) -> None:
        """Begin a symbol of a size [m]."""
        self.wide = wide
        self.deep = deep
        self.shapes: list[ShapeFacts] = []
        self._edges = {"left": -wide / 2, "right": wide / 2, "back": -deep / 2, "front": deep / 2}

    def add(
        self,
        kind: Literal["box", "ellipse", "line"],
        at: Iterable[float | str],
        fill: str | None = None,
        edge: str | None = None,
        radius: float = 0.0,
    ) -> None:
        """Add a shape between two corners, as in `symbols.yaml`, unless it has no extent."""
        x0, y0, x1, y1 = (round(self._place(place), 4) for place in at)
        if kind != "line" and (x1 <= x0 or y1 <= y0):
            return
        colors = _symbols()["colors"]
        fill = colors.get(fill, fill)
        edge = colors.get(edge, edge)
        shape = ShapeFacts(kind=kind, at=(x0, y0, x1, y1), fill=fill, edge=edge, radius=radius)
        self.shapes.append(shape)

    def _place(self, place: float | str) -> float:
        """Return a coordinate [m]: that of an edge such as `left`, or `left + 0.1`."""
        if not isinstance(place, str):
            return place
        edge, *offset = place.split()
        return self._edges[edge] + float("".join(offset) or 0)


BOOKS = ("#8c9fb3", "#c98f6b", "#7fa08c", "#d8c28a", "#a58aa8")
BOXES = ("#e4d9c4", "#bfc9cc", "#d9c7a8")


def _bed(s: Symbol) -> None:
    x = s.wide / 2
    back = -s.deep / 2
    front = s.deep / 2
    pillows = 2 if s.wide > 1.2 else 1
    pitch = (s.wide - 0.2) / pillows
    for number in range(pillows):
        left = -x + 0.13 + number * pitch
        pillow = (left, back + 0.16, left + pitch - 0.06, back + 0.52)
        s.add("box", pillow, "white", "#cfcac0", 0.1)
    s.add("box", (-x + 0.04, back + 0.68, x - 0.04, front - 0.02), "#9fb0c9", radius=0.08)
    s.add("box", (-x + 0.04, back + 0.68, x - 0.04, back + 0.9), "#c5d0e0", radius=0.05)


def _sofa(s: Symbol) -> None:
    x = s.wide / 2
    back = -s.deep / 2
    front = s.deep / 2
    seats = 3 if s.wide > 1.9 else 2
    pitch = (s.wide - 0.32) / seats
    for number in range(seats):
        left = -x + 0.18 + number * pitch
        seat = (left, back + 0.24, left + pitch - 0.04, front - 0.05)
        s.add("box", seat, "seat", radius=0.07)
    s.add("box", (-x + 0.2, back + 0.14, -x + 0.52, back + 0.36), "#d8a66b", radius=0.07)


def _table(s: Symbol) -> None:
    x = s.wide / 2 - 0.06
    y = s.deep / 2
    for number in range(int((s.deep - 0.14) / 0.17) + 1):
        along = -y + 0.14 + 0.17 * number
        s.add("line", (-x, along, x, along), edge="#ffffff3a")


def _wardrobe(s: Symbol) -> None:
    x = s.wide / 2
    y = s.deep / 2
    doors = max(2, round(s.wide / 0.55))
    for number in range(1, doors):
        at = -x + s.wide * number / doors
        s.add("line", (at, -y + 0.03, at, y), edge="dark oak")


def _bookshelf(s: Symbol) -> None:
    x = s.wide / 2
    y = s.deep / 2
    for number in range(int((s.wide - 0.14) / 0.07)):
        left = -x + 0.05 + number * 0.07
        top = y - 0.06 - number % 3 * 0.02
        book = (left, -y + 0.05, left + 0.055, top)
        s.add("box", book, BOOKS[number % len(BOOKS)], radius=0.01)


def _shelf(s: Symbol) -> None:
    x = s.wide / 2
    y = s.deep / 2
    for number in range(int((s.wide - 0.1) / 0.3)):
        left = -x + 0.06 + number * 0.3
        box = (left, -y + 0.06, left + 0.24, y - 0.05)
        s.add("box", box, BOXES[number % len(BOXES)], radius=0.03)


def _nightstand(s: Symbol) -> None:
    radius = min(0.12, s.deep / 3)
    s.add("ellipse", (-radius, -radius, radius, radius), "#fff3d0", "#d9c48f")


def _stove(s: Symbol) -> None:
    for x in (-s.wide / 4.4, s.wide / 4.4):
        for y in (-s.deep / 4.4, s.deep / 8):
            s.add("ellipse", (x - 0.08, y - 0.08, x + 0.08, y + 0.08), edge="#8f979e")


_UPON: Mapping[str, Callable[[Symbol], None]] = MappingProxyType(
    {
        "bed": _bed,
        "single_bed": _bed,
        "sofa": _sofa,
        "table": _table,
        "wardrobe": _wardrobe,
        "bookshelf": _bookshelf,
        "shelf": _shelf,
        "nightstand": _nightstand,
        "stove": _stove,
    }
)
"""Functions that draw further shapes, whose number or size depends on the piece."""


@cache
def _symbols() -> dict[str, Any]:
    """Return the colours and the symbols of the YAML file beside this one."""
    return read_document(Path(__file__).with_name("symbols.yaml")).data


def symbol_names() -> set[str]:
    """Return the types of furniture that have a symbol of their own."""
    return set(_symbols()["symbols"])


def symbol_of(kind: str, wide: float, deep: float) -> list[ShapeFacts]:
    """Return the symbol of a type of furniture at a size [m]; a plain box for an unknown type.

    >>> [shape["kind"] for shape in symbol_of("nightstand", 0.4, 0.4)]
    ['box', 'ellipse']
    """
    symbol = Symbol(wide, deep)
    listed = _symbols()
    for shape in listed["symbols"].get(kind, listed["other"]):
        symbol.add(**shape)
    if kind in _UPON:
        _UPON[kind](symbol)
    return symbol.shapes
