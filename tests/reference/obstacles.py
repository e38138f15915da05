"""Slow, obvious twin of the kernel that finds where furniture cuts the space of a body.

Extents are the least x, y, x + y and x - y, and the greatest ones.
"""

from itertools import combinations, pairwise

import numpy as np
import shapely
from shapely import Polygon


def grown(points, reach, half):
    """Go round each point, and round all of that along the axes and diagonals."""
    octagon = [(a * x, b * y) for x, y in ((reach, half), (half, reach)) for a, b in SIGNS]
    corners = [(x + dx, y + dy) for x, y in points for dx, dy in octagon]
    values = [(x, y, x + y, x - y) for x, y in corners]
    return [min(v) for v in zip(*values, strict=True)] + [max(v) for v in zip(*values, strict=True)]


SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


def shape_of(extents):
    x0, y0, s0, d0, x1, y1, s1, d1 = extents
    turned = [((s + d) / 2, (s - d) / 2) for s, d in ((s0, d0), (s0, d1), (s1, d1), (s1, d0))]
    return shapely.intersection(shapely.box(x0, y0, x1, y1), Polygon(turned))


def walls_of(corners, ring_of):
    ends = zip(pairwise(corners.tolist()), pairwise(ring_of.tolist()), strict=True)
    return [[tuple(a), tuple(b)] for (a, b), (first, second) in ends if first == second]


def is_slanted(wall):
    (ax, ay), (bx, by) = wall
    return ax != bx and ay != by


def groups_of(shapes):
    """Let each shape take the lowest number of those that it touches until nothing changes."""
    number = list(range(len(shapes)))
    touching = [(i, j) for i, j in combinations(number, 2) if shapes[i].intersects(shapes[j])]
    for _ in shapes:
        for i, j in touching:
            number[i] = number[j] = min(number[i], number[j])
    return number


def cuts_by(shapes, slanted, further):
    """Count the places where a further shape touches each group of connected shapes, but one."""
    groups = groups_of(shapes)
    near = [i for i, shape in enumerate(shapes) if shape.intersects(further)]
    common = [shapely.intersection(shapes[i], further) for i in near]
    straight = [shape for i, shape in zip(near, common, strict=True) if not slanted[i]]
    places = len(set(groups_of(straight))) + sum(slanted[i] for i in near)
    return places - len({groups[i] for i in near})


def table_of(extents, slanted):
    return extents, groups_of([shape_of(each) for each in extents]), slanted


def table_read(table):
    """Return a table of the kernel as `table_of` has it, its groups by their first obstacle."""
    first = {}
    groups = [first.setdefault(part, i) for i, part in enumerate(table[:, 8].tolist())]
    return table[:, :8].tolist(), groups, np.equal(table[:, 9], 1).tolist()
