"""The furniture catalogue: the sizes of each type, what it blocks, and where to use it from."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

import shapely

from fleet2d.configuration.problems import check_known
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.placed_objects import (
    MAX_HEIGHT_M,
    Blocks,
    PlacedObject,
    Point,
    Posture,
    UsePlace,
)
from fleet2d.kernels import QUARTER, TURN, UNIT, cosine, in_radians, sine

Range = tuple[float, float]

LEFT = QUARTER
BACK = 2 * QUARTER
RIGHT = -QUARTER


@dataclass(frozen=True)
class Use:
    """A place to use a type of furniture from, relative to the piece.

    A piece faces `ahead`; `left` is a quarter turn counter-clockwise from there.

    Attributes:
        posture: Whether a person stands, sits or lies there.
        ahead: Share of the depth in front of the middle: -0.5 is the back, 0.5 the front.
        left: Share of the width to the left of the middle: 0.5 is the left side.
        ahead_m: Further distance ahead [m].
        left_m: Further distance to the left [m].
        facing: Direction of the person relative to the piece, headings (4096 to a turn).
    """

    posture: Posture
    ahead: float = 0.0
    left: float = 0.0
    ahead_m: float = 0.0
    left_m: float = 0.0
    facing: int = 0


@dataclass(frozen=True)
class Furniture:
    """A type of furniture.

    Attributes:
        type: Its name, as scenarios and files spell it.
        width: Least and largest extent from left to right [m].
        depth: Least and largest extent from back to front [m].
        blocks: What it blocks: nothing, bodies (`path`), or bodies and sight (`sight`).
        height: How high it is [m]; 0 if it stands on legs, or lies flat, and hides nobody.
        wall: Whether its back stands against a wall.
        front_m: Depth of the floor before it that stays empty [m].
        uses: The places to use it from.
    """

    type: str
    width: Range
    depth: Range
    blocks: Blocks
    height: float
    wall: bool
    front_m: float
    uses: tuple[Use, ...] = ()


# Someone who stands before a thing: a body's radius and a hand's breadth away, facing it.
_STAND = (Use("stand", ahead=0.5, ahead_m=0.35, facing=BACK),)
_WATCH = (Use("stand", ahead=0.5, ahead_m=1.0, facing=BACK),)
_INSIDE = (Use("stand"),)
_SIT = (Use("sit"),)
_AT_DESK = (Use("sit", ahead=0.5, ahead_m=0.25, facing=BACK),)
_BESIDE = (
    Use("stand", ahead=0.1, left=0.5, left_m=0.35, facing=RIGHT),
    Use("stand", ahead=0.1, left=-0.5, left_m=-0.35, facing=LEFT),
)
_AT_TABLE = (
    Use("sit", ahead=0.5, left=0.3, ahead_m=0.25, facing=BACK),
    Use("sit", ahead=0.5, left=-0.3, ahead_m=0.25, facing=BACK),
    Use("sit", ahead=-0.5, left=0.3, ahead_m=-0.25),
    Use("sit", ahead=-0.5, left=-0.3, ahead_m=-0.25),
)
_SEATS_3 = (Use("sit"), Use("sit", left=0.3), Use("sit", left=-0.3))
_SINGLE_BED = (Use("lie"), *_BESIDE)
_DOUBLE_BED = (Use("lie", left=0.25), Use("lie", left=-0.25), *_BESIDE)
_IN_TUB = (Use("lie", facing=LEFT),)

# fmt: off
_CATALOGUE = (
    #         type              width         depth         blocks   height wall front uses
    Furniture("bed",            (1.40, 1.80), (2.00, 2.10), "path",  0.55, True,  0.0, _DOUBLE_BED),
    Furniture("single_bed",     (0.80, 1.00), (1.90, 2.05), "path",  0.55, True,  0.0, _SINGLE_BED),
    Furniture("nightstand",     (0.40, 0.50), (0.35, 0.45), "path",  0.55, True,  0.0, _STAND),
    Furniture("wardrobe",       (1.00, 2.00), (0.60, 0.65), "sight", 2.00, True,  0.6, _STAND),
    Furniture("dresser",        (0.80, 1.40), (0.45, 0.50), "path",  0.85, True,  0.6, _STAND),
    Furniture("bookshelf",      (0.80, 1.20), (0.30, 0.40), "sight", 1.80, True,  0.6, _STAND),
    Furniture("shelf",          (0.80, 1.60), (0.40, 0.50), "sight", 1.80, True,  0.6, _STAND),
    Furniture("desk",           (1.20, 1.60), (0.60, 0.80), "path",  0.0,  True,  0.0, _AT_DESK),
    Furniture("chair",          (0.45, 0.50), (0.45, 0.50), "path",  0.0,  False, 0.0, _SIT),
    Furniture("table",          (1.20, 2.00), (0.80, 1.00), "path",  0.0,  False, 0.0, _AT_TABLE),
    Furniture("sofa",           (1.60, 2.40), (0.85, 0.95), "path",  0.85, True,  0.4, _SEATS_3),
    Furniture("armchair",       (0.80, 0.90), (0.80, 0.90), "path",  0.90, False, 0.3, _SIT),
    Furniture("coffee_table",   (0.80, 1.20), (0.50, 0.60), "path",  0.0,  False, 0.0),
    Furniture("tv",             (1.20, 1.60), (0.35, 0.45), "path",  1.10, True,  0.6, _WATCH),
    Furniture("stove",          (0.60, 0.60), (0.60, 0.60), "path",  0.90, True,  0.9, _STAND),
    Furniture("fridge",         (0.60, 0.70), (0.60, 0.65), "sight", 1.80, True,  0.9, _STAND),
    Furniture("sink",           (0.60, 0.80), (0.60, 0.60), "path",  0.90, True,  0.9, _STAND),
    Furniture("kitchen_counter",(0.40, 1.20), (0.60, 0.60), "path",  0.90, True,  0.9, _STAND),
    Furniture("toilet",         (0.40, 0.50), (0.60, 0.70), "path",  0.75, True,  0.5, _SIT),
    Furniture("washbasin",      (0.45, 0.60), (0.40, 0.50), "path",  0.85, True,  0.5, _STAND),
    Furniture("shower",         (0.80, 0.90), (0.80, 0.90), "nothing", 0.0, True,  0.4, _INSIDE),
    Furniture("bathtub",        (1.60, 1.70), (0.70, 0.75), "path",  0.55, True,  0.5, _IN_TUB),
    Furniture("washing_machine",(0.60, 0.60), (0.60, 0.60), "path",  0.85, True,  0.6, _STAND),
    Furniture("shoe_rack",      (0.60, 0.90), (0.25, 0.35), "path",  0.60, True,  0.5, _STAND),
    Furniture("bench",          (1.00, 1.40), (0.40, 0.50), "path",  0.45, True,  0.5, _SIT),
    Furniture("workbench",      (1.40, 2.00), (0.60, 0.70), "path",  0.0,  True,  0.8, _STAND),
    Furniture("treadmill",      (0.80, 0.90), (1.70, 1.90), "path",  0.20, False, 0.4, _STAND),
    Furniture("rug",            (1.20, 2.00), (1.20, 1.60), "nothing", 0.0, False, 0.0),
    Furniture("charger",        (0.25, 0.35), (0.20, 0.25), "nothing", 0.0, True,  0.6, _STAND),
)
# fmt: on

FURNITURE = MappingProxyType({furniture.type: furniture for furniture in _CATALOGUE})
"""The types of furniture by name."""


def furniture_type(name: str) -> Furniture:
    """Return a type of furniture by its name.

    Raises:
        FloorPlanError: There is no such type.

    Example:
        >>> furniture_type("sofa").blocks, furniture_type("fridge").blocks
        ('path', 'sight')
    """
    check_known(name, "furniture of type", sorted(FURNITURE), FloorPlanError)
    return FURNITURE[name]


def measured_height(kind: str, height_m: float) -> float | None:
    """Return the height of a piece of furniture for `sight.heights` by what a file measures.

    Args:
        kind: Its type, in the catalogue or not.
        height_m: How high it is [m].

    Returns:
        The height, rounded to millimetres; None for what its type says: it stands on legs, whatever
        its height, or the file says nothing.

    Example:
        >>> measured_height("sofa", 0.78), measured_height("desk", 0.74), measured_height("bed", 0)
        (0.78, None, None)
    """
    hides = kind not in FURNITURE or FURNITURE[kind].height > 0
    return min(round(height_m, 3), MAX_HEIGHT_M) if hides and height_m > 0 else None


def stand_furniture(
    kind: str,
    at: Point,
    heading: int = QUARTER,
    size: Sequence[float] | None = None,
    *,
    name: str = "",
) -> PlacedObject:
    """Return a piece of furniture at a place, with the places to use it from.

    Args:
        kind: Its type in the catalogue.
        at: The middle of its footprint (x, y) [m].
        heading: The direction of its front, headings (4096 to a turn) counter-clockwise from +x.
        size: Its width and depth [m]; None for the middle of its type's ranges.
        name: Its name; empty to be numbered by type.

    Raises:
        FloorPlanError: There is no such type.

    Example:
        >>> bed = stand_furniture("single_bed", (2.0, 3.0), size=(1.0, 2.0))
        >>> bed.footprint.bounds, [use.posture for use in bed.uses]
        ((1.5, 2.0, 2.5, 4.0), ['lie', 'stand', 'stand'])
    """
    model = furniture_type(kind)
    width, depth = size if size is not None else (sum(model.width) / 2, sum(model.depth) / 2)
    # The unit vectors come from a table, so that places are the same on every machine.
    x0, y0 = at
    dx = cosine(heading) / UNIT
    dy = sine(heading) / UNIT

    def place(ahead: float, left: float) -> Point:
        return x0 + ahead * dx - left * dy, y0 + ahead * dy + left * dx

    ahead = depth / 2
    left = width / 2
    corners = [place(-ahead, left), place(-ahead, -left), place(ahead, -left), place(ahead, left)]
    uses = []
    for use in model.uses:
        x, y = place(use.ahead * depth + use.ahead_m, use.left * width + use.left_m)
        facing = float(in_radians((heading + use.facing) % TURN))
        uses.append(UsePlace(x, y, facing, use.posture))
    facing = float(in_radians(heading % TURN))
    # Quicker than the constructor, which furnishing calls for each piece that it tries.
    footprint = shapely.polygons(corners)
    return PlacedObject(name, kind, footprint, model.blocks, tuple(uses), facing)
