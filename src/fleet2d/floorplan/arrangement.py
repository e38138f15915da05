"""Objects of a home: name them, describe them, move them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from shapely import Polygon

from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.names import number_names
from fleet2d.floorplan.objects import PlacedObject, Point
from fleet2d.kernels import F64
from fleet2d.kernels.numbers import TURN, UNIT, cosine, in_radians, sine


def number_objects(objects: Sequence[PlacedObject]) -> tuple[PlacedObject, ...]:
    """Return the objects, those without a name numbered by type (`bed_0`).

    Raises:
        FloorPlanError: Two have the same name.
    """
    names = number_names([o.name for o in objects], [o.type for o in objects], "object")
    return tuple(replace(o, name=name) for o, name in zip(objects, names, strict=True))


def describe_object(thing: PlacedObject) -> list[Any]:
    """Return all that defines an object as plain JSON data, for the digest of a plan."""
    corners = shapely.get_coordinates(thing.footprint).tolist()
    uses = [[use.x, use.y, use.heading, use.posture, use.approach] for use in thing.uses]
    return [thing.name, thing.type, corners, thing.blocks, thing.heading, uses]


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
        c, s = cosine(turn), sine(turn)
        half = UNIT // 2
        turned = np.stack([(c * dx - s * dy + half) // UNIT, (s * dx + c * dy + half) // UNIT], -1)
        return lattice.to_metres(goal + turned)

    uses = tuple(
        replace(
            use,
            **dict(zip("xy", transform(np.array([[use.x, use.y]]))[0].tolist(), strict=True)),
            heading=(use.heading + in_radians(turn)) % in_radians(TURN),
            approach=None,
        )
        for use in thing.uses
    )
    footprint = Polygon(transform(np.asarray(thing.footprint.exterior.coords)[:-1]))
    heading = (thing.heading + in_radians(turn)) % in_radians(TURN)
    return replace(thing, footprint=footprint, uses=uses, heading=heading)
