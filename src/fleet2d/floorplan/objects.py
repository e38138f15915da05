"""Objects in a home: furniture and devices, their footprints, and where to use them from."""

from dataclasses import dataclass
from typing import Literal

from shapely import Polygon

Blocks = Literal["nothing", "path", "sight"]
Posture = Literal["stand", "sit", "lie"]
POSTURES: tuple[Posture, ...] = ("stand", "sit", "lie")
Point = tuple[float, float]


@dataclass(frozen=True)
class UsePlace:
    """A place where a person is while using an object.

    Attributes:
        x: x of the middle of the body [m]; it may be on the object (a bed, a sofa).
        y: y of the middle of the body [m].
        heading: Direction that the person faces [rad], counter-clockwise from +x.
        posture: Whether the person stands, sits or lies.
        approach: Place off all objects from which the person steps there (x, y) [m]; the same
            place if it is off all objects. None if it is not computed yet.
    """

    x: float
    y: float
    heading: float
    posture: Posture = "stand"
    approach: Point | None = None


@dataclass(frozen=True)
class PlacedObject:
    """An object at a place in the home.

    Attributes:
        name: Unique in the plan, such as `bed_0`; empty to be numbered by type.
        type: Its type, such as `bed`.
        footprint: The floor that it covers [m].
        blocks: Whether it blocks nothing (a rug), bodies (`path`, a table), or bodies and sight
            (`sight`, a wardrobe).
        uses: Places to use it from.
        heading: Direction of its front [rad], counter-clockwise from +x: of a sofa into the room,
            of a bed from the pillows to the feet.
    """

    name: str
    type: str
    footprint: Polygon
    blocks: Blocks = "path"
    uses: tuple[UsePlace, ...] = ()
    heading: float = 0.0
