"""Slow, obvious twins of the detour kernels: all legs between all places that a way may bend at."""

import heapq
import math
from itertools import pairwise

import numpy as np
import shapely
from tests.reference.routes import length_of, straight_ways

from fleet2d.kernels import CELL_CENTRE, SUB


def is_clear(disc, a, b, *, may_leave):
    """Return whether a straight leg keeps clear of a disc, or leaves it if that is allowed."""
    x, y, reach = (int(value) for value in disc)
    if may_leave and math.dist(a, (x, y)) <= reach:
        parts = (b[0] - a[0]) * (a[0] - x) + (b[1] - a[1]) * (a[1] - y) >= 0
        return parts and math.dist(b, (x, y)) > reach
    return bool(shapely.distance(shapely.LineString([a, b]), shapely.Point(x, y)) > reach)


def octagon(disc):
    """Return the corners of an octagon around a disc."""
    x, y, reach = (int(value) for value in disc)
    far = reach * 10824 // 10000 + 3
    near = far * 7072 // 10000
    turned = [(far, 0), (near, near), (0, far), (-near, near)]
    return [(x + dx, y + dy) for dx, dy in turned] + [(x - dx, y - dy) for dx, dy in turned]


class SlowDetours:
    """The space, and the corners at which ways bend."""

    def __init__(self, region, vertices, corners):
        self._region = region
        self._corners = [tuple(vertices[v].tolist()) for v in corners.vertex]
        self._walls = dict(
            zip(self._corners, zip(corners.before, corners.after, corners.simple, strict=True), strict=True)
        )  # fmt: skip

    def length(self, start, goal, discs):
        """Return the length of the shortest way, met disc after met disc; infinity for none."""
        if any(math.dist(goal, disc[:2]) <= disc[2] for disc in discs):
            return math.inf
        met = np.zeros(len(discs), np.bool_)
        while True:
            way = self._shortest(start, goal, discs[met], discs)
            if way is None:
                return math.inf
            hit = [not self._passes(disc, way) for disc in discs]
            if not (hit & ~met).any():
                return length_of(np.array(way))
            met |= hit

    def _passes(self, disc, way):
        return all(is_clear(disc, a, b, may_leave=i == 0) for i, (a, b) in enumerate(pairwise(way)))

    def _shortest(self, start, goal, met, discs):
        beside = [at for disc in met for at in octagon(disc)]
        free = [at for at in beside if all(math.dist(at, disc[:2]) > disc[2] for disc in discs)]
        inside = shapely.contains_properly(self._region, shapely.points(np.array(free or [(0, 0)])))
        nodes = [
            start,
            goal,
            *self._corners,
            *(at for at, ok in zip(free, inside, strict=False) if ok),
        ]
        queue = [(0.0, [start])]
        done = set()
        while queue:
            travelled, way = heapq.heappop(queue)
            here = way[-1]
            if here == goal:
                return way
            if here in done:
                continue
            done.add(here)
            others = [at for at in nodes if at not in done]
            open_ways = straight_ways(
                self._region, np.array([here] * len(others)), np.array(others)
            )
            for at, is_open in zip(others, open_ways, strict=True):
                if is_open and self._is_leg(here, at, met, may_leave=here == start):
                    heapq.heappush(queue, (travelled + math.dist(here, at), [*way, at]))
        return None

    def _is_leg(self, a, b, discs, *, may_leave):
        """Return whether a way may use the straight leg between two places in free space."""
        is_taut = self._is_taut(a, b) and self._is_taut(b, a)
        return is_taut and all(is_clear(disc, a, b, may_leave=may_leave) for disc in discs)

    def _is_taut(self, corner, other):
        """Return whether a string from another place can bend round a corner."""
        before, after, simple = self._walls.get(corner, (None, None, False))
        if not simple:
            return True
        sides = [self._side(other, corner, wall) for wall in (before, after)]
        return not sides[0] * sides[1] < 0

    @staticmethod
    def _side(a, b, c):
        turn = (b[0] - a[0]) * (int(c[1]) - a[1]) - (b[1] - a[1]) * (int(c[0]) - a[0])
        return (turn > 0) - (turn < 0)


def place_beside(floor, place, start, slack, discs):
    """Return the clear cell nearest to a place; of those about as near, the nearest to `start`."""
    parts, part, rooms, room = floor
    is_floor = (parts == part) & ((rooms == room) | (room < 0))
    found = []
    for row, column in np.argwhere(is_floor).tolist():
        at = (column * SUB + CELL_CENTRE, row * SUB + CELL_CENTRE)
        if all((at[0] - x) ** 2 + (at[1] - y) ** 2 > reach**2 for x, y, reach in discs.tolist()):
            found.append((math.dist(start, at), math.dist(place, at), at[1], at[0]))
    nearest = min((away for _, away, *_ in found), default=0.0)
    near = [each for each in found if each[1] <= nearest + slack]
    return min(near)[:1:-1] if near else None
