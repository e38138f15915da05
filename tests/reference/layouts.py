"""Slow, obvious twins of the kernels that lay out the rooms of synthetic homes."""

from itertools import pairwise
from math import fsum

import numpy as np

Box = tuple[int, int, int, int, int]
WALL = 2
MOUTH_PENALTY = 3.0
MIN_SLOT_WIDTH = 35.0
DEEPEST = 240
REACH = 25


def table(boxes):
    return np.array(boxes, np.int64).reshape(-1, 5)


def squarest_rooms(trees, areas, sides, mouths):
    """Cut the rectangle by each tree, and keep the squarest rooms."""
    made = [_sliced(_tree(trees.nodes, int(start)), areas, *sides) for start in trees.starts]

    def penalty(boxes):
        blocked = sum(not any(_holds(box, mouth) for box in boxes) for mouth in mouths.tolist())
        return slenderness(boxes) + MOUTH_PENALTY * blocked

    return table(min(made, key=penalty) if made else [])


def _holds(box, mouth):
    _, x0, y0, x1, y1 = box
    return x0 <= mouth[0] and mouth[2] <= x1 and y0 <= mouth[1] and mouth[3] <= y1


def _tree(nodes, start):
    """Return a node with its parts: (kind, number, parts)."""
    kind, number = nodes[start].tolist()
    parts = []
    at = start + 1
    for _ in range(number if kind < 0 else 0):
        parts.append(_tree(nodes, at))
        at += _size(parts[-1])
    return kind, number, parts


def _size(tree):
    return 1 + sum(_size(part) for part in tree[2])


def _area(tree, areas):
    kind, number, parts = tree
    if kind >= 0:
        return areas[kind] * number / 100
    return fsum(_area(part, areas) for part in parts)


def _sliced(tree, areas, x0, y0, x1, y1):
    kind, _, parts = tree
    if kind >= 0:
        return [(kind, x0, y0, x1, y1)]
    boxes = []
    low, high = (x0, x1) if kind == -2 else (y0, y1)
    spans = divide_span([_area(part, areas) for part in parts], low, high)
    for part, (start, end) in zip(parts, spans, strict=True):
        frame = (start, y0, end, y1) if kind == -2 else (x0, start, x1, end)
        boxes += _sliced(part, areas, *frame)
    return boxes


def divide_span(sizes, low, high):
    """Divide [low, high] in proportion to sizes."""
    total = fsum(sizes)
    ends = [low]
    reached = 0.0
    for size in sizes:
        reached += size
        ends.append(low + int((high - low) * reached / total + 0.5))
    return list(pairwise(ends))


def slenderness(boxes):
    """Add how much longer than 1.2 times the other side the sides of rooms are, squared."""
    total = 0.0
    for _, x0, y0, x1, y1 in boxes:
        width, height = x1 - x0 - WALL, y1 - y0 - WALL
        if width > height:
            ratio = width / height if height > 0 else 99.0
        else:
            ratio = height / max(width, 1)
        if ratio > 1.2:
            total += (ratio - 1.2) * (ratio - 1.2)
    return total


def is_promising(boxes, limits):
    """Compare the sides of every room with its limits."""
    for room, x0, y0, x1, y1 in boxes.tolist():
        short, long = sorted((x1 - x0 - WALL, y1 - y0 - WALL))
        if short < limits[room, 0] or long > limits[room, 1] * short:
            return False
    return True


def _widths(slots, areas, depth):
    sizes = [areas[a] if b < 0 else areas[a] + areas[b] for a, b, _ in slots.tolist()]
    return [
        max(size / (depth + bay), MIN_SLOT_WIDTH)
        for size, bay in zip(sizes, slots[:, 2].tolist(), strict=True)
    ]


def _depth(slots, areas, length):
    """Return the depth at which slots have a length, 0 for none."""
    low = max(20, 20 - int(slots[:, 2].min()))
    if not slots[:, 2].any():
        depth = fsum(areas[room] for slot in slots[:, :2] for room in slot if room >= 0) / length
        return int(depth + 0.5) if low <= depth <= DEEPEST else 0
    if fsum(_widths(slots, areas, low)) < length:
        return 0
    # The first depth, above the least, at which they are short enough.
    for depth in range(low + 1, DEEPEST):
        if fsum(_widths(slots, areas, depth)) <= length:
            return depth
    return DEEPEST


def _strip(slots, areas, length, depth):
    boxes = []
    spans = divide_span(_widths(slots, areas, depth), 0, length)
    for (first, second, bay), (x0, x1) in zip(slots.tolist(), spans, strict=True):
        back = depth + bay
        if second < 0:
            boxes.append((first, x0, 0, x1, back))
            continue
        middle = int(back * areas[first] / (areas[first] + areas[second]) + 0.5)
        boxes += [(first, x0, 0, x1, middle), (second, x0, middle, x1, back)]
    return boxes


def _deepened(slots, corridor):
    deeper = slots.copy()
    deeper[-1, 2] += corridor.width if corridor.suite else 0
    return deeper


def _beside(corridor, strip, areas):
    """Return the corridor with its closet, and the strip above it, or None."""
    width = corridor.width
    length = strip[-1][3]
    end = strip[-1][1] if corridor.suite else length
    above = [
        (room, x0, y0 + width, x1, y1 + width)
        if not corridor.suite or x0 < end
        else (room, x0, y0, x1, y1)
        for room, x0, y0, x1, y1 in strip
    ]
    hallway = []
    if corridor.closet >= 0:
        end -= min(max(int(areas[corridor.closet] / width + 0.5), 24), 52)
        hallway = [(corridor.closet, end, 0, length, width)]
    return None if end < 24 else ([*hallway, (corridor.hall, 0, 0, end, width)], above)


def strip_rooms(slots, areas, length, least, most):
    """Find the depth, and place the rooms one by one."""
    depth = _depth(slots, areas, length)
    return table(_strip(slots, areas, length, depth) if least <= depth <= most else [])


def row_rooms(slots, areas, corridor, length, least, most):
    """Place the strip, and the corridor beside it."""
    deep = _deepened(slots, corridor)
    depth = _depth(deep, areas, length)
    if not least <= depth <= most:
        return table([])
    made = _beside(corridor, _strip(deep, areas, length, depth), areas)
    return table([] if made is None else made[1] + made[0])


def wing_rooms(
    front,
    back,
    areas,
    corridor,
    back_depth,
    least,
    most,
):
    """Place the strip above, then the strip below it that is as long, then the corridor."""
    deep = _deepened(back, corridor)
    length = int(fsum(_widths(deep, areas, back_depth)) + 0.5)
    depth = _depth(front, areas, length)
    if not least <= depth <= most:
        return table([]), 0
    before = [(r, x0, -y1, x1, -y0) for r, x0, y0, x1, y1 in _strip(front, areas, length, depth)]
    strip = _strip(deep, areas, length, back_depth)
    if corridor.suite and before[-1][1] > strip[-1][1] - REACH:
        plain = corridor._replace(suite=False)
        return wing_rooms(front, back, areas, plain, back_depth, least, most)
    made = _beside(corridor, strip, areas)
    return (table([]), 0) if made is None else (table([*before, *made[0], *made[1]]), depth)


def squarest_depth(
    front,
    back,
    areas,
    corridor,
    depths,
    least,
    most,
    limits,
):
    """Place the wing at each depth, and compare those that are promising."""
    scores = []
    for number, depth in enumerate(depths.tolist()):
        boxes, _ = wing_rooms(front, back, areas, corridor, depth, least, most)
        if len(boxes) and is_promising(boxes, limits):
            scores.append((slenderness(boxes.tolist()), number))
    return min(scores)[1] if scores else -1
