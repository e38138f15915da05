"""Straightening a way over cells of different cost, as far as that makes it no dearer."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.mesh import SUB, Int64, Mesh, locate
from fleet2d.kernels.sight import line_of_sight

# What rounding may make a leg dearer than the two that it replaces.
SLACK = 1.0 + 1e-9


@kernel
def leg_cost(cost: NDArray[np.int32], ax: int, ay: int, bx: int, by: int) -> float:
    """Return what a straight leg costs, [percent times lattice units]; infinite where none leads.

    Each part of it counts by the cell that it runs through.

    Args:
        cost: int32 (rows, columns), -1 where no way leads.
        ax: Where it begins, lattice units.
        ay: Where it begins, lattice units.
        bx: Where it ends, lattice units.
        by: Where it ends, lattice units.
    """
    dx, dy = bx - ax, by - ay
    length = np.sqrt(np.float64(dx * dx + dy * dy))
    row, column = ay // SUB, ax // SUB
    total, done = 0.0, 0.0
    while True:
        if not (0 <= row < cost.shape[0] and 0 <= column < cost.shape[1]):
            return np.inf
        here = cost[row, column]
        if here < 0:
            return np.inf
        # How far along the leg it leaves the cell, by a side or by its end.
        next_x = next_y = 2.0
        if dx > 0:
            next_x = ((column + 1) * SUB - ax) / dx
        elif dx < 0:
            next_x = (column * SUB - ax) / dx
        if dy > 0:
            next_y = ((row + 1) * SUB - ay) / dy
        elif dy < 0:
            next_y = (row * SUB - ay) / dy
        leaves = min(next_x, next_y, 1.0)
        total += (leaves - done) * length * (100 + np.int64(here))
        if leaves >= 1.0:
            return float(total)
        done = leaves
        if next_x == leaves:
            column += 1 if dx > 0 else -1
        if next_y == leaves:
            row += 1 if dy > 0 else -1


@kernel
def pull_taut(mesh: Mesh, cost: NDArray[np.int32], way: Int64) -> Int64:
    """Return a way with fewer corners: legs are joined while the joint one is clear and no dearer.

    Args:
        mesh: The space that the way must stay in.
        cost: int32 (rows, columns), -1 where no way leads.
        way: int64 (n, 2), lattice points; each leg lies in the space.

    Returns:
        int64 (m, 2), some of the points, the first and the last among them.
    """
    count = way.shape[0]
    out = np.empty((count, 2), np.int64)
    out[0] = way[0]
    corners = 1
    at = 0
    while at < count - 1:
        x, y = way[at, 0], way[at, 1]
        triangle = locate(mesh, x, y)
        best = at + 1
        along = leg_cost(cost, x, y, way[best, 0], way[best, 1])
        while best + 1 < count:
            px, py = way[best + 1, 0], way[best + 1, 1]
            along += leg_cost(cost, way[best, 0], way[best, 1], px, py)
            joint = leg_cost(cost, x, y, px, py)
            if joint == np.inf or joint > along * SLACK:
                break
            if not line_of_sight(mesh, x, y, triangle, px, py):
                break
            best += 1
        out[corners] = way[best]
        corners += 1
        at = best
    return out[:corners].copy()
