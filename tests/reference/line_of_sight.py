"""Slow, obvious twins of the sight kernels: every wall is looked at, and no mesh is needed.

Walls are int64 (w, 4): ax, ay, bx, by. Nothing here may import the package under test.
"""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np

CELL, CELL_CENTRE = 64, 33


def cross(ax, ay, bx, by):
    """Return the cross product of two vectors."""
    return ax * by - ay * bx


def segments_touch(p, q, a, b):
    """Return whether the closed segments pq and ab share a point; plain Python integers."""
    (px, py), (qx, qy), (ax, ay), (bx, by) = p, q, a, b
    sides = [cross(qx - px, qy - py, x - px, y - py) for x, y in (a, b)]
    others = [cross(bx - ax, by - ay, x - ax, y - ay) for x, y in (p, q)]
    if sides[0] * sides[1] > 0 or others[0] * others[1] > 0:
        return False
    return all(
        max(min(c, d), min(e, f)) <= min(max(c, d), max(e, f))
        for c, d, e, f in ((px, qx, ax, bx), (py, qy, ay, by))
    )


def is_inside(walls, points):
    """Return for each point whether a ray to the right crosses an odd number of walls."""
    x, y = points[:, None, 0], points[:, None, 1]
    ax, ay, bx, by = walls.T
    spans = (ay > y) != (by > y)
    turn = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    left_of_rising = np.where(by > ay, turn > 0, turn < 0)
    return (spans & left_of_rising).sum(axis=1) % 2 == 1


def touches_any_wall(walls, eye, points):
    """Return for each point whether the closed segment from `eye` to it touches a wall."""
    (qx, qy), (px, py) = eye, points.T[:, :, None]
    ax, ay, bx, by = walls.T
    dx, dy = px - qx, py - qy
    side_a = np.sign(dx * (ay - qy) - dy * (ax - qx))
    side_b = np.sign(dx * (by - qy) - dy * (bx - qx))
    side_q = np.sign((bx - ax) * (qy - ay) - (by - ay) * (qx - ax))
    side_p = np.sign((bx - ax) * (py - ay) - (by - ay) * (px - ax))
    boxes_meet = (
        np.maximum(np.minimum(qx, px), np.minimum(ax, bx))
        <= np.minimum(np.maximum(qx, px), np.maximum(ax, bx))
    ) & (
        np.maximum(np.minimum(qy, py), np.minimum(ay, by))
        <= np.minimum(np.maximum(qy, py), np.maximum(ay, by))
    )
    touches = (side_a * side_b <= 0) & (side_q * side_p <= 0) & boxes_meet
    return touches.any(axis=1)


def visible(walls, eye, points):
    """Return for each point whether it is visible from `eye` by the strict rule."""
    if not is_inside(walls, eye[None])[0]:
        return np.zeros(len(points), bool)
    return is_inside(walls, points) & ~touches_any_wall(walls, eye, points)


def on_any_wall(walls, points):
    """Return for each point whether it lies on a wall, ends included."""
    return np.array([touches_any_wall(walls, point, point[None])[0] for point in points], bool)


def blocks(p, q, a, b):
    """Return whether the wall ab keeps a straight way from leading from p to q.

    It may touch the way at p and q; a wall along the way blocks only if it ends in between.
    """
    if not segments_touch(p, q, a, b):
        return False
    if all(cross(q[0] - p[0], q[1] - p[1], c[0] - p[0], c[1] - p[1]) == 0 for c in (a, b)):
        return any(_is_between(p, q, c) for c in (a, b))
    touch_at_end = any(
        cross(b[0] - a[0], b[1] - a[1], end[0] - a[0], end[1] - a[1]) == 0 for end in (p, q)
    )
    return not touch_at_end


def _is_between(p, q, c):
    """Return whether c, in line with p and q, lies strictly between them."""
    along = (c[0] - p[0]) * (q[0] - p[0]) + (c[1] - p[1]) * (q[1] - p[1])
    return 0 < along < (q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2


def vertices_seen(walls, start):
    """Return the ends of walls that a straight way leads to, from a point that isn't outside.

    Between its ends the way meets no wall, unless it runs along one from end to end or to one end.
    """
    ends = {(int(x), int(y)) for x, y in walls.reshape(-1, 2)} - {start}
    sides = [((a, b), (c, d)) for a, b, c, d in walls.tolist()]
    seen = set()
    for end in ends:
        if any(blocks(start, end, a, b) for a, b in sides):
            continue
        along_wall = any(_covers(a, b, start) and _covers(a, b, end) for a, b in sides)
        doubled_middle = np.array([[start[0] + end[0], start[1] + end[1]]])
        if along_wall or is_inside(2 * walls, doubled_middle)[0]:
            seen.add(end)
    return seen


def _covers(a, b, point):
    """Return whether the point lies on the closed segment ab."""
    return segments_touch(a, b, point, point)


def visible_area(walls, eye):
    """Return the exact area visible from a point strictly inside.

    Between two neighboring directions in which a wall ends, one wall is the nearest all the way.
    """
    moved = walls - np.tile(eye, 2)
    ends = moved.reshape(-1, 2)
    directions = np.unique(ends // np.gcd.reduce(ends, axis=1)[:, None], axis=0).tolist()
    directions.sort(key=lambda d: math.atan2(d[1], d[0]))
    area = Fraction(0)
    for right, left in pairwise([*directions, directions[0]]):
        reached = []
        for a, b in moved.reshape(-1, 2, 2).tolist():
            reaches = [_reach(ray, a, b) for ray in (right, left)]
            spans = cross(*a, *right) >= 0 <= cross(*right, *b) and cross(*left, *b) >= 0
            if spans and cross(*a, *left) >= 0 and None not in reaches and cross(*a, *b) > 0:
                reached.append(reaches)
        near = min(reached, key=sum)
        area += cross(*right, *left) * near[0] * near[1] / 2
    return area


def _reach(ray, a, b):
    """Return how many times its length the ray from (0, 0) reaches to the line through a and b."""
    edge = (b[0] - a[0], b[1] - a[1])
    down = cross(*ray, *edge)
    return Fraction(cross(*a, *edge), down) if down else None


def nearest_cells_in_sight(walls, cells, eye, reach, most, wanted):
    """Sort all cells of the mask by their distance, and look at those that are near enough."""
    near = np.argwhere(cells)
    places = CELL * near[:, ::-1] + CELL_CENTRE
    away = ((places - eye) ** 2).sum(axis=1)
    order = np.argsort(away, kind="stable")
    order = order[away[order] <= reach**2][:most]
    seen = visible(walls, np.array(eye), places[order])
    return near[order][seen][:wanted].tolist()
