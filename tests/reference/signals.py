"""Distances, speeds and windows over time, step by step, in slow and obvious Python.

Poses are (x, y, away), edges (x, y, x, y). Portals have the x and y of their ends, and how far from them
bodies stand.
"""

from math import inf, sqrt


def distance(one, other):
    """Return how far two bodies are apart."""
    if one[2] or other[2]:
        return inf
    return sqrt((one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2)


def distance_to_shape(pose, edges):
    """Return how far a body is from a shape, 0 inside its rings."""
    x, y, away = pose
    if away:
        return inf
    crossings = 0
    for x0, y0, x1, y1 in edges:
        if (y0 > y) != (y1 > y):
            crossings += x0 + (y - y0) * (x1 - x0) / (y1 - y0) > x
    if crossings % 2:
        return 0.0
    return min((_to_edge(x, y, edge) for edge in edges), default=inf)


def _to_edge(x, y, edge):
    x0, y0, x1, y1 = edge
    squared = (x1 - x0) ** 2 + (y1 - y0) ** 2
    share = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / squared if squared else 0.0
    share = min(1.0, max(0.0, share))
    return sqrt((x - x0 - share * (x1 - x0)) ** 2 + (y - y0 - share * (y1 - y0)) ** 2)


def speed(poses, step, portals=()):
    """Return how far a body came in a step."""
    if not step or poses[step][2] or poses[step - 1][2]:
        return 0.0
    return move_length(poses[step - 1], poses[step], portals)


def move_length(begin, end, portals):
    """Return the length of a move, which may be through a portal from the one to the other end."""
    lengths = [distance(begin, end)]
    for x0, y0, x1, y1, reach in portals:
        for one, other in (((x0, y0, False), (x1, y1, False)), ((x1, y1, False), (x0, y0, False))):
            before, after = distance(begin, one), distance(end, other)
            if before < distance(begin, other) and after < distance(end, one):
                lengths.append(max(before - reach, 0) + max(after - reach, 0))
    return min(lengths)


def sliding_max(values, low, high, before, after):
    """Return the maximum from `low` to `high` steps after each step."""

    def at(step):
        return before if step < 0 else after if step >= len(values) else values[step]

    return [max(at(t) for t in range(step + low, step + high + 1)) for step in range(len(values))]


def until(hold, goal, after):
    """Return how well one holds until the other does: by all steps at which it may."""
    count = len(hold)
    best = []
    for begin in range(count):
        ways = [min([goal[t], *hold[begin:t]]) for t in range(begin, count)]
        best.append(max([*ways, min([after, *hold[begin:]])]))
    return best
