"""The slow, obvious twin of ways over cells of different cost: no queue, all steps until none helps."""

from itertools import product

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


def cheapest_cells(cost: I32, start: tuple[int, int], goal: tuple[int, int]) -> list[list[int]]:
    """Return the cells of a cheapest way; of equally cheap next cells the first, row by row."""
    left = cost_distance(cost, goal)
    if left[start] < 0:
        return []
    row, column = start
    way = [[row, column]]
    while (row, column) != goal:
        for r, c in product(range(row - 1, row + 2), range(column - 1, column + 2)):
            inside = 0 <= r < cost.shape[0] and 0 <= c < cost.shape[1]
            if not inside or min(cost[r, c], cost[row, c], cost[r, column]) < 0:
                continue
            length = 0 if (r, c) == (row, column) else 5 if r == row or c == column else 7
            step = length * (200 + int(cost[row, column]) + int(cost[r, c]))
            if length and left[r, c] == left[row, column] - step:
                break
        row, column = r, c
        way.append([row, column])
    return way
