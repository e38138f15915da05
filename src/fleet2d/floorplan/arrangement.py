"""What is done to the objects of a home: named, told apart, moved."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.objects import PlacedObject
from fleet2d.kernels.headings import TURN, UNIT, cosine, in_radians, sine

Point = tuple[float, float]


def number_objects(objects: Sequence[PlacedObject]) -> tuple[PlacedObject, ...]:
    """Return the objects, those without a name numbered by type (`bed_0`).

    Raises:
        FloorPlanError: Two have the same name.
    """
    own = Counter(thing.name for thing in objects if thing.name)
    twice = [name for name, uses in own.items() if uses > 1]
    if twice:
        raise FloorPlanError(f"two objects are named {twice[0]!r}: give each its own name")
    used: Counter[str] = Counter()
    numbered: list[PlacedObject] = []
    for thing in objects:
        name = thing.name
        while not name or (not thing.name and name in own):
            name = f"{thing.type}_{used[thing.type]}"
            used[thing.type] += 1
        numbered.append(replace(thing, name=name))
    return tuple(numbered)


def described(thing: PlacedObject) -> list[Any]:
    """Return what an object is, as plain JSON data."""
    corners = shapely.get_coordinates(thing.footprint).tolist()
    uses = [[use.x, use.y, use.heading, use.posture, use.approach] for use in thing.uses]
    return [thing.name, thing.type, corners, thing.blocks, thing.heading, uses]


def moved(thing: PlacedObject, lattice: Lattice, to: Point, turn_deg: float = 0.0) -> PlacedObject:
    """Return an object with the middle of its box at another place, turned about it.

    In whole lattice units and headings of 1/4096 turn, so that it is the same on every machine.

    Args:
        thing: What is moved.
        lattice: Of the plan.
        to: Where its middle comes to be [m].
        turn_deg: How far it is turned, counter-clockwise.
    """
    turn = round(turn_deg / 360 * TURN) % TURN
    x0, y0, x1, y1 = thing.footprint.bounds
    pivot = lattice.to_lattice(((x0 + x1) / 2, (y0 + y1) / 2))
    goal = lattice.to_lattice(to)

    def carried(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        dx, dy = (lattice.to_lattice(xy) - pivot).T
        c, s = cosine(turn), sine(turn)
        half = UNIT // 2
        turned = np.stack([(c * dx - s * dy + half) // UNIT, (s * dx + c * dy + half) // UNIT], -1)
        return lattice.to_metres(goal + turned)

    uses = tuple(
        replace(
            use,
            **dict(zip("xy", carried(np.array([[use.x, use.y]]))[0].tolist(), strict=True)),
            heading=(use.heading + in_radians(turn)) % in_radians(TURN),
            approach=None,
        )
        for use in thing.uses
    )
    footprint = Polygon(carried(np.asarray(thing.footprint.exterior.coords)[:-1]))
    heading = (thing.heading + in_radians(turn)) % in_radians(TURN)
    return replace(thing, footprint=footprint, uses=uses, heading=heading)
