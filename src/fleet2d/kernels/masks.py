"""Masks of pixels: their connected parts, how far one is from another, and the rings round them.

What lies outside an array counts as not in the mask.
"""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel

NOWHERE = -1
"""The part, and the number of steps, of a pixel that is not in the mask or not reached."""

EAST, NORTH, WEST, SOUTH = 0, 1, 2, 3


@kernel
def label_parts(mask: NDArray[np.bool_], diagonal: bool) -> NDArray[np.int32]:
    """Number the connected parts of a mask in the order of their first pixels, row by row.

    Args:
        mask: bool (rows, columns).
        diagonal: Whether pixels that share only a corner are connected.

    Returns:
        Each pixel's part, int32 (rows, columns); -1 outside the mask.
    """
    rows, columns = mask.shape
    part = np.full((rows, columns), NOWHERE, np.int32)
    stack = np.empty(rows * columns, np.int64)
    parts = 0
    for seed in range(rows * columns):
        if not mask[seed // columns, seed % columns] or part[seed // columns, seed % columns] >= 0:
            continue
        part[seed // columns, seed % columns] = parts
        stack[0] = seed
        height = 1
        while height > 0:
            height -= 1
            row, column = stack[height] // columns, stack[height] % columns
            for near in range(max(row - 1, 0), min(row + 2, rows)):
                for beside in range(max(column - 1, 0), min(column + 2, columns)):
                    if not diagonal and near != row and beside != column:
                        continue
                    if mask[near, beside] and part[near, beside] < 0:
                        part[near, beside] = parts
                        stack[height] = near * columns + beside
                        height += 1
        parts += 1
    return part


@kernel
def count_steps(start: NDArray[np.bool_], mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Count the steps from pixel to pixel across sides, inside a mask, from the nearest start.

    Args:
        start: Where to start, bool (rows, columns); pixels outside the mask don't count.
        mask: Where steps may lead, bool (rows, columns).

    Returns:
        Steps, int32 (rows, columns); 0 at the start, -1 where no way leads.
    """
    rows, columns = mask.shape
    steps = np.full((rows, columns), NOWHERE, np.int32)
    queue = np.empty(rows * columns, np.int64)
    end = 0
    for row in range(rows):
        for column in range(columns):
            if start[row, column] and mask[row, column]:
                steps[row, column] = 0
                queue[end] = row * columns + column
                end += 1
    first = 0
    while first < end:
        row, column = queue[first] // columns, queue[first] % columns
        first += 1
        for side in range(4):
            near, beside = row, column
            if side == EAST:
                beside += 1
            elif side == NORTH:
                near += 1
            elif side == WEST:
                beside -= 1
            else:
                near -= 1
            if near < 0 or near >= rows or beside < 0 or beside >= columns:
                continue
            if mask[near, beside] and steps[near, beside] < 0:
                steps[near, beside] = steps[row, column] + 1
                queue[end] = near * columns + beside
                end += 1
    return steps


@kernel
def _border_sides(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return for each grid point the border sides that start there, one bit per direction.

    Sides run with the mask on their left. uint8 (rows + 1, columns + 1); rows count upwards.
    """
    rows, columns = mask.shape
    sides = np.zeros((rows + 1, columns + 1), np.uint8)
    for row in range(rows):
        for column in range(columns):
            if not mask[row, column]:
                continue
            if row == 0 or not mask[row - 1, column]:
                sides[row, column] |= np.uint8(1 << EAST)
            if column == columns - 1 or not mask[row, column + 1]:
                sides[row, column + 1] |= np.uint8(1 << NORTH)
            if row == rows - 1 or not mask[row + 1, column]:
                sides[row + 1, column + 1] |= np.uint8(1 << WEST)
            if column == 0 or not mask[row, column - 1]:
                sides[row + 1, column] |= np.uint8(1 << SOUTH)
    return sides


@kernel
def trace_rings(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the rings between a mask and what is not in it, along the sides of the pixels.

    Rings have the mask on their left: outer ones run counter-clockwise, holes clockwise (x is the
    column, y is the row). Where two pixels of the mask share only a corner, a ring turns right, so
    each ring round one part (connected across sides) passes a point at most once.

    Args:
        mask: bool (rows, columns).

    Returns:
        The corners of all rings, int32 (n, 2) as (x, y), 0 to columns and 0 to rows; and where each
        ring starts among them, int64 (rings + 1,).
    """
    sides = _border_sides(mask)
    rows, columns = sides.shape
    corners = np.empty((64, 2), np.int32)
    starts = np.zeros(64, np.int64)
    count, rings = 0, 0
    for seed in range(rows * columns):
        # The first side of a ring that a scan by rows meets runs east, and starts at a corner.
        if sides[seed // columns, seed % columns] & np.uint8(1 << EAST):
            y, x = seed // columns, seed % columns
            heading, before = EAST, NOWHERE
            while before == NOWHERE or y * columns + x != seed or heading != EAST:
                if heading != before:
                    if count == corners.shape[0]:
                        corners = _longer(corners)
                    corners[count, 0], corners[count, 1] = x, y
                    count += 1
                if before != NOWHERE:  # the first side stays until the ring has come back to it
                    sides[y, x] ^= np.uint8(1 << heading)
                before = heading
                x += 1 if heading == EAST else (-1 if heading == WEST else 0)
                y += 1 if heading == NORTH else (-1 if heading == SOUTH else 0)
                heading = (before + 3) % 4  # right first, then straight on, then left
                while not sides[y, x] & np.uint8(1 << heading):
                    heading = (heading + 1) % 4
            sides[y, x] ^= np.uint8(1 << EAST)
            rings += 1
            if rings == starts.shape[0]:
                starts = np.concatenate((starts, np.zeros(rings, np.int64)))
            starts[rings] = count
    return corners[:count], starts[: rings + 1]


@kernel
def _longer(corners: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return a copy with twice as many rows."""
    longer = np.empty((2 * corners.shape[0], 2), np.int32)
    longer[: corners.shape[0]] = corners
    return longer
