"""Storeys, which lie side by side in a plan, so that near places may be far apart."""

import numpy as np
import shapely

from fleet2d.expectations.expectation import INFINITE, Trace, combine, shortest
from fleet2d.expectations.signals import SignalBlock
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I64, distances_between


def storey_of(plan: FloorPlan, place: shapely.Geometry) -> int:
    """Return the number of the storey at which a place is [lattice]; see `_storey_of_part`."""
    part = shapely.distance(np.array(plan.polygons), place).argmin()
    return int(_storey_of_part(plan)[part])


def _storey_of_part(plan: FloorPlan) -> I64:
    """Return the storey of each part of the free space: the number of the nearest part with stairs.

    A separate part, such as a garage, lies beside the rest of its storey.
    """
    parts = np.array(plan.polygons)
    ends = shapely.points(plan.portal_ends[:, :4].reshape(-1, 2))
    with_stairs = np.unique(shapely.distance(parts[:, np.newaxis], ends).argmin(axis=0))
    nearest = shapely.distance(parts[:, np.newaxis], parts[with_stairs]).argmin(axis=1)
    return with_stairs[nearest].astype(np.int64)


def storeys(block: SignalBlock, row: int) -> Trace:
    """Return the number of the storey on which a body is."""
    window = block.bodies.window(block.first, block.end)
    x, y, *_ = window.dense(row, block.first, block.end)
    is_new = np.append(True, (np.diff(x) != 0) | (np.diff(y) != 0))
    start = np.flatnonzero(is_new)
    points = shapely.points(x[start], y[start])
    plan = block.home.plan
    part = shapely.distance(np.array(plan.polygons)[:, np.newaxis], points).argmin(axis=0)
    number = _storey_of_part(plan)[part]
    return shortest(start + block.first, number.astype(np.float64), block.end)


def only_on(storey: int, distance: Trace, block: SignalBlock, row: int) -> Trace:
    """Return the distance of a body from a place on a storey; infinite from other storeys."""

    def masked(metres: F64, number: F64) -> F64:
        return np.where(number == storey, metres, INFINITE)

    return combine(masked, distance, storeys(block, row))


def apart(block: SignalBlock, row: int, other: int) -> Trace:
    """Return the distance between two bodies [lattice]; infinite between storeys."""
    window = block.bodies.window(block.first, block.end)
    distance = Trace(*distances_between(window, row, other), block.end)
    if not block.home.plan.portals:
        return distance

    def masked(metres: F64, one: F64, two: F64) -> F64:
        return np.where(one == two, metres, INFINITE)

    return combine(masked, distance, storeys(block, row), storeys(block, other))
