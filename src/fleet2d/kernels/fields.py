"""Fields over the cells of a grid: distances to walls and to places."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel

# Buckets of the queue of `cost_distance`: a power of two above its longest step, 7 * 2200.
COST_BUCKETS = 1 << 14
MOST_COST = 1000


@kernel
def squared_distance(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return each cell's exact squared distance to the nearest cell that is not in `mask`.

    The two-pass algorithm of Meijster, Roerdink and Hesselink, "A general algorithm for computing
    distance transforms in linear time" (2000), in integers. What lies outside the array counts for
    nothing: surround the mask by one line of False where the border is a wall.

    Args:
        mask: Cells to measure, bool (rows, columns).

    Returns:
        Squared distances in cells, int64 (rows, columns); 0 outside the mask, and
        (rows + columns)² everywhere in a mask that has no outside.
    """
    rows, columns = mask.shape
    endless = rows + columns
    column_gap = _column_gaps(mask, endless)
    out = np.empty((rows, columns), np.int64)
    apex = np.empty(columns, np.int64)  # columns whose parabolas form the lower envelope
    start = np.empty(columns, np.int64)  # first column at which each of them is the lowest
    for row in range(rows):
        gap = column_gap[row]
        top = 0
        apex[0] = 0
        start[0] = 0
        for u in range(1, columns):
            height = gap[u] * gap[u]
            while top >= 0:
                at, i = start[top], apex[top]
                if (at - i) * (at - i) + gap[i] * gap[i] <= (at - u) * (at - u) + height:
                    break
                top -= 1
            if top < 0:
                top = 0
                apex[0] = u
                start[0] = 0
                continue
            i = apex[top]
            crossing = 1 + (u * u - i * i + height - gap[i] * gap[i]) // (2 * (u - i))
            if crossing < columns:
                top += 1
                apex[top] = u
                start[top] = crossing
        for u in range(columns - 1, -1, -1):
            i = apex[top]
            out[row, u] = min((u - i) * (u - i) + gap[i] * gap[i], endless * endless)
            if u == start[top]:
                top -= 1
    return out


@kernel
def _column_gaps(mask: NDArray[np.bool_], endless: int) -> NDArray[np.int64]:
    """Return each cell's distance to the nearest False cell of its column, `endless` for none."""
    rows, columns = mask.shape
    gap = np.empty((rows, columns), np.int64)
    for column in range(columns):
        gap[0, column] = endless if mask[0, column] else 0
    for row in range(1, rows):
        for column in range(columns):
            above = gap[row - 1, column]
            gap[row, column] = min(above + 1, endless) if mask[row, column] else 0
    for row in range(rows - 2, -1, -1):
        for column in range(columns):
            below = gap[row + 1, column]
            if below + 1 < gap[row, column]:
                gap[row, column] = below + 1
    return gap


@kernel
def walking_distance(mask: NDArray[np.bool_], goals: NDArray[np.int64]) -> NDArray[np.int32]:
    """Return how far each cell is from the nearest goal, walking from cell to cell.

    A step to a side costs 5 and one across a corner 7, which is open only if both cells beside it
    are. Cells are settled in order of distance, so cells that steps of one length lead to come in
    that order, too: one queue for each length does instead of a heap (Dial, Communications of the
    ACM 12, 1969, has one for each distance).

    Args:
        mask: Cells that can be walked, bool (rows, columns).
        goals: Goal cells (n, 2) as (row, column); those outside the mask count for nothing.

    Returns:
        int32 (rows, columns), fifths of a cell's side; -1 where no goal can be reached.
    """
    rows, columns = mask.shape
    wide = columns + 2  # with a wall all round, so that no step leads out
    free = np.zeros((rows + 2) * wide, np.uint8)  # 1 free, 2 settled
    for row in range(rows):
        for column in range(columns):
            free[(row + 1) * wide + column + 1] = mask[row, column]
    far = np.int32(2**31 - 1)
    distance = np.full((rows + 2) * wide, far, np.int32)
    straight = np.empty((rows * columns) + goals.shape[0], np.int32)
    across = np.empty(rows * columns, np.int32)
    first_s = last_s = first_a = last_a = 0
    for g in range(goals.shape[0]):
        row, column = goals[g, 0], goals[g, 1]
        cell = (row + 1) * wide + column + 1
        inside = 0 <= row < rows and 0 <= column < columns
        if inside and mask[row, column] and distance[cell] > 0:
            distance[cell] = 0
            straight[last_s] = cell
            last_s += 1
    while True:
        while first_s < last_s and free[straight[first_s]] == 2:
            first_s += 1
        while first_a < last_a and free[across[first_a]] == 2:
            first_a += 1
        if first_s == last_s and first_a == last_a:
            break
        if first_a == last_a or (
            first_s < last_s and distance[straight[first_s]] <= distance[across[first_a]]
        ):
            cell = np.int64(straight[first_s])
            first_s += 1
        else:
            cell = np.int64(across[first_a])
            first_a += 1
        free[cell] = 2
        there = distance[cell] + np.int32(5)
        for beside in (cell - 1, cell + 1, cell - wide, cell + wide):
            if free[beside] == 1 and there < distance[beside]:
                distance[beside] = there
                straight[last_s] = beside
                last_s += 1
        there += np.int32(2)
        for up in (-wide, wide):
            if free[cell + up] == 0:
                continue
            for side in (-1, 1):
                corner = cell + up + side
                if free[corner] == 1 and there < distance[corner] and free[cell + side] > 0:
                    distance[corner] = there
                    across[last_a] = corner
                    last_a += 1
    found = np.empty((rows, columns), np.int32)
    for row in range(rows):
        for column in range(columns):
            steps = distance[(row + 1) * wide + column + 1]
            found[row, column] = steps if steps < far else -1
    return found


@kernel
def cost_distance(
    cost: NDArray[np.int32], goal: tuple[int, int], start: tuple[int, int]
) -> NDArray[np.int64]:
    """Return what the cheapest way from each cell to a goal costs, walking from cell to cell.

    A step to a side is 5 long and one across a corner 7, which is open only if both cells beside it
    are; half of it counts by the cost of the cell that it leaves, half by that of the one it enters
    (Dial, Communications of the ACM 12, 1969; all in integers).

    Args:
        cost: int32 (rows, columns), in percent of what a way costs besides: 100 counts double; from
            0 to 1000, or -1 where no way leads.
        goal: The goal's cell (row, column).
        start: The cell to come from: what is farther away than it is not worked out.

    Returns:
        int64 (rows, columns), in 1/1000 of a cell's side at no cost; -1 where no way is known.
    """
    rows, columns = cost.shape
    distance = np.full((rows, columns), -1, np.int64)
    head = np.full(COST_BUCKETS, -1, np.int64)
    capacity = 8 * rows * columns + 1
    cell, following = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    if cost[goal[0], goal[1]] < 0:
        return distance
    distance[goal[0], goal[1]] = 0
    cell[0], following[0] = goal[0] * columns + goal[1], -1
    head[0] = 0
    entries = waiting = 1
    now = 0
    while waiting > 0:
        here = now & (COST_BUCKETS - 1)
        while head[here] >= 0:
            entry = head[here]
            head[here] = following[entry]
            waiting -= 1
            row, column = cell[entry] // columns, cell[entry] % columns
            if distance[row, column] != now:
                continue  # a cheaper way was found since
            if row == start[0] and column == start[1]:
                return distance
            for step in range(9):
                r, c = row + step // 3 - 1, column + step % 3 - 1
                if step == 4 or not (0 <= r < rows and 0 <= c < columns):
                    continue
                if cost[r, c] < 0 or cost[row, c] < 0 or cost[r, column] < 0:
                    continue
                there = now + step_cost(cost, row, column, r, c)
                if distance[r, c] < 0 or there < distance[r, c]:
                    distance[r, c] = there
                    bucket = there & (COST_BUCKETS - 1)
                    cell[entries], following[entries] = r * columns + c, head[bucket]
                    head[bucket] = entries
                    entries += 1
                    waiting += 1
        now += 1
    return distance


@kernel
def step_cost(cost: NDArray[np.int32], row: int, column: int, r: int, c: int) -> int:
    """Return what a step between two neighboring cells costs, [1/1000 of a cell's side]."""
    length = 5 if row == r or column == c else 7
    return int(length * (200 + np.int64(cost[row, column]) + np.int64(cost[r, c])))


@kernel
def descend(
    cost: NDArray[np.int32], distance: NDArray[np.int64], start: tuple[int, int]
) -> NDArray[np.int64]:
    """Return the cells (n, 2) of a cheapest way from a cell to the goal; ties: the first neighbor.

    `distance` is from :func:`cost_distance` and knows the start; else there is no cell.
    """
    rows, columns = distance.shape
    row, column = start
    if distance[row, column] < 0:
        return np.empty((0, 2), np.int64)
    out = np.empty((64, 2), np.int64)
    count = 0
    while True:
        if count == out.shape[0]:
            longer = np.empty((2 * count, 2), np.int64)
            longer[:count] = out
            out = longer
        out[count, 0], out[count, 1] = row, column
        count += 1
        if distance[row, column] == 0:
            return out[:count].copy()
        for step in range(9):
            r, c = row + step // 3 - 1, column + step % 3 - 1
            if step == 4 or not (0 <= r < rows and 0 <= c < columns) or distance[r, c] < 0:
                continue
            if cost[r, c] < 0 or cost[row, c] < 0 or cost[r, column] < 0:
                continue
            if distance[r, c] + step_cost(cost, row, column, r, c) == distance[row, column]:
                row, column = r, c
                break
