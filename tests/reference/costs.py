"""The slow, obvious twin of ways over cells of different cost: no queue, all steps until none helps."""

import numpy as np

from fleet2d.kernels import I32, I64

FAR = 10**12


def cost_distance(cost: I32, goal: tuple[int, int]) -> I64:
    """Return what the cheapest way from each cell to the goal costs, -1 where none leads."""
    rows, columns = cost.shape
    found = np.full(cost.shape, FAR)
    if cost[goal] >= 0:
        found[goal] = 0
    changed = True
    while changed:
        changed = False
        for row, column in np.argwhere(cost >= 0):
            for r in range(max(0, row - 1), min(rows, row + 2)):
                for c in range(max(0, column - 1), min(columns, column + 2)):
                    if cost[r, c] < 0 or cost[row, c] < 0 or cost[r, column] < 0:
                        continue
                    length = 0 if (r, c) == (row, column) else 5 if r == row or c == column else 7
                    way = found[r, c] + length * (200 + int(cost[row, column]) + int(cost[r, c]))
                    if way < found[row, column]:
                        found[row, column], changed = way, True
    return np.where(found >= FAR, -1, found)
