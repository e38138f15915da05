"""How a home is drawn: floors by type of room, walls, symbols of furniture, kinds of activities.

The page and Python's pictures draw the same: the page receives symbols as shapes with the facts of
a home, and the tables here as constants that `tools.contract_types` writes.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal

from fleet2d.floorplan.rooms.room import Room
from fleet2d.viewing.contract import ShapeFacts

Material = Literal["planks", "carpet", "tiles", "plain"]

PLANK_M = 0.19
JOINT_M = 0.012
WOOD = ("#e8d3b3", "#e5cfae", "#ebd8ba", "#e2caa6")
CARPET = ("#dcdde8", "#e3dce0", "#dbe2e2")
UNKNOWN = "#f4f4f2"
"""The floor of rooms of which nobody knows what they are for."""

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
"""The tops of walls are so far above the floor, as if seen a little from the south."""

WALL_TOP = "#fcfbf8"
WALL_FACE = "#bdb4a6"
WALL_EDGE = "#a79e90"
WALL_SHADOW = "#3c2d196b"
DOOR = "#a9783f"
OUTLINE_FILL = "#d9d2c6"
OUTLINE_EDGE = "#8b857b"

NIGHT = ("#283e78", 0.55)
DUSK = ("#ffb070", 0.22)
"""Colour and opacity of the darkest and of the reddest light, over what it falls on."""

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
    """Return the tables that the page draws by, as JSON has them."""
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
        shapes: What was drawn, from the bottom to the top.
    """

    def __init__(self, wide: float, deep: float) -> None:
        """Begin a symbol of a size [m]."""
        self.wide = wide
        self.deep = deep
        self.shapes: list[ShapeFacts] = []

    def box(
        self,
        left: float,
        bottom: float,
        right: float,
        top: float,
        fill: str | None,
        radius: float = 0.04,
        edge: str | None = None,
    ) -> None:
        """Draw a box with round corners, and nothing where it has no extent."""
        if right > left and top > bottom:
            self._add("box", (left, bottom, right, top), fill, edge, radius)

    def whole(self, fill: str, radius: float = 0.04, edge: str | None = None) -> None:
        """Draw a box as large as the piece."""
        self.inset(0, fill, radius, edge)

    def inset(
        self, margin: float, fill: str | None, radius: float = 0.04, edge: str | None = None
    ) -> None:
        """Draw a box that leaves a margin of the piece."""
        x = self.wide / 2 - margin
        y = self.deep / 2 - margin
        self.box(-x, -y, x, y, fill, radius, edge)

    def ellipse(
        self, x: float, y: float, rx: float, ry: float, fill: str | None, edge: str | None = None
    ) -> None:
        """Draw an ellipse, and nothing where it has no extent."""
        if rx > 0 and ry > 0:
            self._add("ellipse", (x - rx, y - ry, x + rx, y + ry), fill, edge)

    def disc(
        self, x: float, y: float, radius: float, fill: str | None, edge: str | None = None
    ) -> None:
        """Draw a disc."""
        self.ellipse(x, y, radius, radius, fill, edge)

    def line(self, x0: float, y0: float, x1: float, y1: float, color: str) -> None:
        """Draw a line."""
        self._add("line", (x0, y0, x1, y1), None, color)

    def _add(
        self,
        kind: Literal["box", "ellipse", "line"],
        at: tuple[float, float, float, float],
        fill: str | None,
        edge: str | None,
        radius: float = 0.0,
    ) -> None:
        x0, y0, x1, y1 = (round(number, 4) for number in at)
        shape = ShapeFacts(kind=kind, at=(x0, y0, x1, y1), fill=fill, edge=edge, radius=radius)
        self.shapes.append(shape)


OAK = "#c99f6c"
DARK_OAK = "#b98c58"
PALE_OAK = "#d6bc93"
CLOTH = "#6f8791"
SEAT = "#97adb5"
WHITE = "#ffffff"
ENAMEL = "#c3c8cb"
DRAIN = "#8c959b"
TAP = "#949ca3"
STEEL = "#b6bcc1"
GLASS = "#9fb9c0"
BOOKS = ("#8c9fb3", "#c98f6b", "#7fa08c", "#d8c28a", "#a58aa8")
BOXES = ("#e4d9c4", "#bfc9cc", "#d9c7a8")


def _bed(s: Symbol) -> None:
    x, back, front = s.wide / 2, -s.deep / 2, s.deep / 2
    s.whole(DARK_OAK, 0.06)
    s.box(-x + 0.04, back + 0.1, x - 0.04, front - 0.02, "#f7f5f0", 0.08)
    pillows = 2 if s.wide > 1.2 else 1
    pitch = (s.wide - 0.2) / pillows
    for number in range(pillows):
        left = -x + 0.13 + number * pitch
        s.box(left, back + 0.16, left + pitch - 0.06, back + 0.52, WHITE, 0.1, "#cfcac0")
    s.box(-x + 0.04, back + 0.68, x - 0.04, front - 0.02, "#9fb0c9", 0.08)
    s.box(-x + 0.04, back + 0.68, x - 0.04, back + 0.9, "#c5d0e0", 0.05)


def _sofa(s: Symbol) -> None:
    x, back, front = s.wide / 2, -s.deep / 2, s.deep / 2
    s.whole(CLOTH, 0.12)
    seats = 3 if s.wide > 1.9 else 2
    pitch = (s.wide - 0.32) / seats
    for number in range(seats):
        left = -x + 0.18 + number * pitch
        s.box(left, back + 0.24, left + pitch - 0.04, front - 0.05, SEAT, 0.07)
    s.box(-x + 0.2, back + 0.14, -x + 0.52, back + 0.36, "#d8a66b", 0.07)


def _armchair(s: Symbol) -> None:
    s.whole(CLOTH, 0.12)
    x, y = s.wide / 2 - 0.14, s.deep / 2
    s.box(-x, -y + 0.2, x, y - 0.03, SEAT, 0.08)


def _chair(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.box(-x + 0.03, -y + 0.03, x - 0.03, y, "#d9b585", 0.08)
    s.box(-x + 0.02, -y, x - 0.02, -y + 0.09, DARK_OAK, 0.04)


def _table(s: Symbol) -> None:
    s.whole(OAK, 0.08)
    x, y = s.wide / 2 - 0.06, s.deep / 2
    for number in range(int((s.deep - 0.14) / 0.17) + 1):
        s.line(-x, -y + 0.14 + 0.17 * number, x, -y + 0.14 + 0.17 * number, "#ffffff3a")


def _coffee_table(s: Symbol) -> None:
    s.whole(OAK, 0.12)
    s.box(-0.2, -0.1, 0.08, 0.1, "#f2efe8", 0.02)


def _desk(s: Symbol) -> None:
    s.whole(OAK)
    back = -s.deep / 2
    s.box(-0.34, back + 0.08, 0.34, back + 0.14, "#2f363d", 0.02)
    s.box(-0.22, -0.02, 0.22, 0.14, "#edebe6", 0.02)


def _bench(s: Symbol) -> None:
    x, y = s.wide / 2 - 0.05, s.deep / 2
    s.whole(OAK, 0.06)
    s.box(-x, -y + 0.06, x, y - 0.04, "#c9bfae", 0.06)


def _wardrobe(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.whole("#cdb48f", 0.03)
    s.box(-x + 0.03, -y + 0.03, x - 0.03, y - 0.07, "#dcc7a6", 0.02)
    doors = max(2, round(s.wide / 0.55))
    for number in range(1, doors):
        at = -x + s.wide * number / doors
        s.line(at, -y + 0.03, at, y, DARK_OAK)


def _bookshelf(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.whole(DARK_OAK, 0.02)
    for number in range(int((s.wide - 0.14) / 0.07)):
        left = -x + 0.05 + number * 0.07
        top = y - 0.06 - number % 3 * 0.02
        s.box(left, -y + 0.05, left + 0.055, top, BOOKS[number % len(BOOKS)], 0.01)


def _shelf(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.whole("#cdbfa8", 0.02)
    for number in range(int((s.wide - 0.1) / 0.3)):
        left = -x + 0.06 + number * 0.3
        s.box(left, -y + 0.06, left + 0.24, y - 0.05, BOXES[number % len(BOXES)], 0.03)


def _dresser(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.whole(PALE_OAK, 0.03)
    s.line(0, y - 0.1, 0, y, DARK_OAK)
    s.line(-x, y - 0.1, x, y - 0.1, DARK_OAK)


def _nightstand(s: Symbol) -> None:
    s.whole(PALE_OAK)
    s.disc(0, 0, min(0.12, s.deep / 3), "#fff3d0", "#d9c48f")


def _tv(s: Symbol) -> None:
    x = s.wide / 2 - 0.1
    s.whole("#cdb48f")
    s.box(-x, -0.05, x, 0.05, "#20262c", 0.02)


def _fridge(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.whole("#e6e9eb", 0.05, STEEL)
    s.line(-x, y - 0.09, x, y - 0.09, STEEL)
    s.box(x - 0.14, y - 0.05, x - 0.05, y - 0.01, "#8c949b", 0.01)


def _counter(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.whole("#f1eee8", 0.01)
    s.box(-x, y - 0.07, x, y, "#cdb48f", 0)


def _stove(s: Symbol) -> None:
    x, y = s.wide / 2 - 0.05, s.deep / 2
    _counter(s)
    s.box(-x, -y + 0.05, x, y - 0.11, "#2c3238", 0.03)
    for across in (-s.wide / 4.4, s.wide / 4.4):
        for along in (-s.deep / 4.4, s.deep / 8):
            s.disc(across, along, 0.08, None, "#8f979e")


def _sink(s: Symbol) -> None:
    x, y = s.wide / 2 - 0.09, s.deep / 2
    _counter(s)
    s.box(-x, -y + 0.12, x, y - 0.12, "#c8cdd2", 0.07, "#a8afb5")
    s.disc(0, 0, 0.035, "#7d868d")
    s.box(-0.02, -y + 0.04, 0.02, -y + 0.24, TAP, 0.02)


def _washbasin(s: Symbol) -> None:
    x, y = s.wide / 2 - 0.08, s.deep / 2
    s.whole(WHITE, 0.1, ENAMEL)
    s.box(-x, -y + 0.12, x, y - 0.06, "#e3edef", 0.2)
    s.disc(0, 0.02, 0.03, DRAIN)
    s.box(-0.02, -y + 0.03, 0.02, -y + 0.18, TAP, 0.02)


def _toilet(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.box(-x, -y, x, -y + 0.2, WHITE, 0.04, ENAMEL)
    s.ellipse(0, 0.08, x - 0.02, y - 0.1, WHITE, ENAMEL)
    s.ellipse(0, 0.09, x - 0.09, y - 0.19, "#dde8ea")


def _bathtub(s: Symbol) -> None:
    x, y = s.wide / 2 - 0.08, s.deep / 2 - 0.09
    s.whole(WHITE, 0.08, ENAMEL)
    s.box(-x, -y, x, y, "#d5e7eb", 0.26)
    s.disc(s.wide / 2 - 0.24, 0, 0.035, DRAIN)


def _shower(s: Symbol) -> None:
    x, y = s.wide / 2, s.deep / 2
    s.whole("#cfe3e866", 0.02, GLASS)
    s.line(-x, -y, x, y, f"{GLASS}88")
    s.line(x, -y, -x, y, f"{GLASS}88")
    s.disc(0, 0, 0.06, "#a9bcc2")


def _washing_machine(s: Symbol) -> None:
    s.whole("#f4f5f5", 0.05, ENAMEL)
    s.disc(0, 0.02, 0.2, "#b9c7ce", "#9aa4aa")
    s.disc(0, 0.02, 0.12, "#8fa5b0")


def _rug(s: Symbol) -> None:
    s.whole("#b9a58c66", 0.05, "#9a876e66")


def _glass(s: Symbol) -> None:
    s.whole("#bcd9e377", 0, "#8fb4c1")


def _charger(s: Symbol) -> None:
    s.whole("#2c3338", 0.06)
    s.box(-0.07, -0.02, 0.07, 0.02, "#3fd0c9", 0.02)


def _treadmill(s: Symbol) -> None:
    s.whole("#454b52", 0.06)
    s.inset(0.1, "#23282d", 0.03)


def _other(s: Symbol) -> None:
    s.whole("#d9d8d4", 0.04, OUTLINE_EDGE)


SYMBOLS: Mapping[str, Callable[[Symbol], None]] = MappingProxyType(
    {
        "bed": _bed,
        "single_bed": _bed,
        "sofa": _sofa,
        "armchair": _armchair,
        "chair": _chair,
        "table": _table,
        "coffee_table": _coffee_table,
        "desk": _desk,
        "bench": _bench,
        "wardrobe": _wardrobe,
        "bookshelf": _bookshelf,
        "shelf": _shelf,
        "dresser": _dresser,
        "nightstand": _nightstand,
        "tv": _tv,
        "fridge": _fridge,
        "kitchen_counter": _counter,
        "stove": _stove,
        "sink": _sink,
        "washbasin": _washbasin,
        "toilet": _toilet,
        "bathtub": _bathtub,
        "shower": _shower,
        "washing_machine": _washing_machine,
        "rug": _rug,
        "glass": _glass,
        "charger": _charger,
        "treadmill": _treadmill,
    }
)


def symbol_of(kind: str, wide: float, deep: float) -> list[ShapeFacts]:
    """Return the symbol of a type of furniture at a size [m]; a plain box of an unknown one.

    >>> [shape["kind"] for shape in symbol_of("nightstand", 0.4, 0.4)]
    ['box', 'ellipse']
    """
    symbol = Symbol(wide, deep)
    SYMBOLS.get(kind, _other)(symbol)
    return symbol.shapes
