"""Objects of a home, furniture and devices: how they are named, described and moved."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, Literal, Protocol, TypeVar

import numpy as np
import shapely
from shapely import Polygon

from fleet2d.configuration.problems import suggest
from fleet2d.errors import FloorPlanError, InputError
from fleet2d.floorplan.lattice import Lattice
from fleet2d.kernels import F64, TURN, UNIT, cosine, in_radians, sine

# No piece of furniture is higher [m].
MAX_HEIGHT_M = 8.0


class Named(Protocol):
    """Something with a name."""

    @property
    def name(self) -> str:
        """Its name."""


N = TypeVar("N", bound=Named)


def find_named(
    things: Sequence[N],
    name: object,
    owner: str,
    noun: str,
    error: type[InputError] = FloorPlanError,
) -> N:
    """Return the item with a name; `owner` and `noun` are for the message.

    Raises:
        InputError: None has that name; of the type `error`.
    """
    names = [thing.name for thing in things]
    if name in names:
        return things[names.index(str(name))]
    raise error(f"{owner} has no {noun} {name!r}{suggest(name, names, f'Its {noun}s are')}")


def number_names(names: Sequence[str | None], types: Sequence[str], noun: str) -> list[str]:
    """Return a name for each thing: its own if it isn't empty, or its type and a number.

    Raises:
        FloorPlanError: Two have the same name.

    Example:
        >>> number_names(["den", None, "room_1"], ["office", "room", "room"], "room")
        ['den', 'room_2', 'room_1']
    """
    own = Counter(name for name in names if name)
    twice = [name for name, uses in own.items() if uses > 1]
    if twice:
        raise FloorPlanError(f"two {noun}s are named {twice[0]!r}: give each {noun} its own name")
    numbers: defaultdict[str, count[int]] = defaultdict(lambda: count(1))

    def numbered(kind: str) -> str:
        return next(new for k in numbers[kind] if (new := f"{kind}_{k}") not in own)

    return [name or numbered(kind) for name, kind in zip(names, types, strict=True)]


def distinct_names(names: Sequence[str | None], plural: str, notes: list[str]) -> list[str | None]:
    """Return names with a number added to those that occur before, and add a note for each.

    Example:
        >>> distinct_names(["Bath", "Bath", None, "Bath 2"], "rooms", [])
        ['Bath', 'Bath 3', None, 'Bath 2']
    """
    numbers: defaultdict[str, count[int]] = defaultdict(lambda: count(2))
    used = set[str]()
    distinct: list[str | None] = []
    for name in names:
        unique = name
        if name is not None and name in used:
            candidates = (f"{name} {k}" for k in numbers[name])
            unique = next(new for new in candidates if new not in used and new not in names)
            notes.append(f"several {plural} are called {name}: one of them is {unique} here")
        used |= {unique} if unique is not None else set()
        distinct.append(unique)
    return distinct


Blocks = Literal["nothing", "path", "sight"]
Posture = Literal["stand", "sit", "lie"]
POSTURES: tuple[Posture, ...] = ("stand", "sit", "lie")
Point = tuple[float, float]


# How far from the end of a portal a body may have to stand [m].
PORTAL_REACH_M = 1.0


@dataclass(frozen=True)
class Portal:
    """Stairs or a lift, by which people get from one part of the free space to another.

    The storeys of a home lie side by side in its plane, as parts that nothing else joins. Robots
    don't use portals, and nobody sees through them.

    Attributes:
        type: `stairs` or `lift`.
        start: Its one end (x, y) [m], such as the foot of stairs.
        end: Its other end (x, y) [m].
        takes_us: How long people take from one to the other [us]: for half of it they are at the
            one end, then at the other.
    """

    type: str
    start: Point
    end: Point
    takes_us: int


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

    @property
    def at(self) -> Point:
        """Where the middle of the body is [m]."""
        return self.x, self.y


@dataclass(frozen=True)
class PlacedObject:
    """An object at a place in the home.

    Attributes:
        name: Unique in the plan, such as `bed_1`; empty to be numbered by type.
        type: Its type, such as `bed`.
        footprint: The floor that it covers [m].
        blocks: What it blocks: nothing (a rug), bodies (`path`, a table), or bodies and sight
            (`sight`, a wardrobe).
        uses: Places to use it from.
        heading: Direction of its front [rad], counter-clockwise from +x: of a sofa into the room,
            of a bed from the pillows to the feet.
        height: How high it is [m], 0 if it hides nobody; None for what is usual for its type.
    """

    name: str
    type: str
    footprint: Polygon
    blocks: Blocks = "path"
    uses: tuple[UsePlace, ...] = ()
    heading: float = 0.0
    height: float | None = None


def number_objects(objects: Sequence[PlacedObject]) -> tuple[PlacedObject, ...]:
    """Return the objects, those without a name numbered by type (`bed_1`).

    Raises:
        FloorPlanError: Two have the same name.
    """
    names = number_names([o.name for o in objects], [o.type for o in objects], "object")
    return tuple(replace(o, name=name) for o, name in zip(objects, names, strict=True))


def describe_object(thing: PlacedObject) -> list[Any]:
    """Return all that defines an object as plain JSON data, for the digest of a plan."""
    corners = shapely.get_coordinates(thing.footprint).tolist()
    uses = [[use.x, use.y, use.heading, use.posture, use.approach] for use in thing.uses]
    height = [] if thing.height is None else [thing.height]
    return [thing.name, thing.type, corners, thing.blocks, thing.heading, uses, *height]


def move_object(
    thing: PlacedObject, lattice: Lattice, to: Point, turn_deg: float = 0.0
) -> PlacedObject:
    """Return an object turned about the middle of its box and moved.

    Computed in whole lattice units and headings of 1/4096 turn, so that the result is the same on
    every machine.

    Args:
        thing: The object.
        lattice: The plan's lattice.
        to: New place of the middle (x, y) [m].
        turn_deg: Angle by which it is turned, counter-clockwise.
    """
    turn = round(turn_deg / 360 * TURN) % TURN
    x0, y0, x1, y1 = thing.footprint.bounds
    pivot = lattice.to_lattice(((x0 + x1) / 2, (y0 + y1) / 2))
    goal = lattice.to_lattice(to)

    def transform(xy: F64) -> F64:
        dx, dy = (lattice.to_lattice(xy) - pivot).T
        c = cosine(turn)
        s = sine(turn)
        turned = np.stack([c * dx - s * dy, s * dx + c * dy], -1)
        return lattice.to_metres(goal + (turned + UNIT // 2) // UNIT)

    uses = []
    for use in thing.uses:
        x, y = transform(np.array([[use.x, use.y]]))[0].tolist()
        facing = (use.heading + in_radians(turn)) % in_radians(TURN)
        uses.append(replace(use, x=x, y=y, heading=facing, approach=None))
    footprint = Polygon(transform(np.asarray(thing.footprint.exterior.coords)[:-1]))
    heading = (thing.heading + in_radians(turn)) % in_radians(TURN)
    return replace(thing, footprint=footprint, uses=tuple(uses), heading=heading)
