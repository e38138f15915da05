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
    """Where a person is while using an object.

    Attributes:
        x: Where the middle of the body is [m]; it may lie on the object (a bed, a sofa).
        y: [m]
        heading: Where the person faces [rad], counter-clockwise from +x.
        posture: Whether one stands, sits or lies there.
        approach: Where one walks to before the last step onto it (x, y) [m], off every object;
            the place itself where one can stand there. None where nobody has worked it out yet.
    """

    x: float
    y: float
    heading: float
    posture: Posture = "stand"
    approach: Point | None = None


@dataclass(frozen=True)
class PlacedObject:
    """A thing that stands somewhere in the home.

    Attributes:
        name: Unique in the plan, such as `bed_0`; empty to be numbered by type.
        type: What it is, such as `bed`.
        footprint: The floor that it covers [m].
        blocks: Whom it stops: nobody (a rug), bodies (a table), or bodies and sight (a
            wardrobe).
        uses: Places to use it from.
        heading: Where its front faces [rad], counter-clockwise from +x: a sofa's towards the room,
            a bed's from the pillows to the feet.
    """

    name: str
    type: str
    footprint: Polygon
    blocks: Blocks = "path"
    uses: tuple[UsePlace, ...] = ()
    heading: float = 0.0
