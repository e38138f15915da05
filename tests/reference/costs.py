"""Ways over cells of different cost, by Dijkstra's algorithm of SciPy."""

from itertools import product

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra


def steps_over(cost):
    """Return what each step from cell to cell costs, as a graph; none cuts a corner."""
    columns, steps = cost.shape[1], []
    for row, column in np.argwhere(cost >= 0).tolist():
        for r, c in product(range(max(row - 1, 0), row + 2), range(max(column - 1, 0), column + 2)):
            if r >= len(cost) or c >= columns or (r, c) == (row, column):
                continue
            if min(cost[r, c], cost[row, c], cost[r, column]) >= 0:
                length = 5 if r == row or c == column else 7
                step = length * (200 + cost[row, column] + cost[r, c])
                steps.append((row * columns + column, r * columns + c, step))
    start, end, step = np.array(steps, np.int64).reshape(-1, 3).T
    return csr_array((step, (start, end)), shape=[cost.size] * 2)


def cost_distance(cost, goals):
    """Return what the cheapest way from each cell to a goal costs, -1 where none leads."""
    goals = [row * cost.shape[1] + column for row, column in goals if cost[row, column] >= 0]
    if not goals:
        return np.full(cost.shape, -1)
    found = dijkstra(steps_over(cost), indices=goals, min_only=True)
    return np.where(np.isinf(found), -1, found).astype(np.int64).reshape(cost.shape)


def cheapest_cells(cost, start, goal):
    """Return the cells of a cheapest way; of equally cheap next cells the first, row by row."""
    left, steps = cost_distance(cost, [goal]).ravel(), steps_over(cost)
    here, end = (row * cost.shape[1] + column for row, column in (start, goal))
    if left[here] < 0:
        return []
    way = [here]
    while here != end:
        ways = slice(*steps.indptr[here : here + 2])
        is_cheapest = left[steps.indices[ways]] == left[here] - steps.data[ways]
        here = int(steps.indices[ways][is_cheapest].min())
        way.append(here)
    return [list(divmod(cell, cost.shape[1])) for cell in way]
