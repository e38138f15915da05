"""How a body goes on when somebody is in its way, row by row and place by place: slow and obvious."""

from collections.abc import Callable, Iterable
from itertools import pairwise

import numpy as np

from fleet2d.kernels import CELL_CENTRE, I32, I64, SUB, walking_distance

Row = list[int]
"""Time, x, y, heading, away."""


def delayed(rest: list[Row], since: int, pose: Row, later: int) -> tuple[list[Row], int]:
    """Return rows later than they were planned, and when the rest begins that makes up for it."""
    rows = [[since, *pose], *rest]
    edge = rows[-1][0]
    for before, after in zip(rows, rest, strict=False):
        if before[1:] == after[1:] and after[0] - before[0] >= later:
            edge = before[0]
            break
    times = [t + later if t <= edge else max(t, edge + later) for t, *_ in rest]
    return [[time, *row[1:]] for time, row in zip(times, rest, strict=True)], edge


def next_stop(rows: list[Row], moment: int) -> int:
    """Return the row from which on a body stands after a moment, where it can stand anywhere."""
    for i, (here, after) in enumerate(pairwise(rows)):
        begun = [row for row in rows if row[0] <= moment]
        if here[1:3] == after[1:3] and after[0] > moment and i >= len(begun) - 1:
            return i
    return -1


def places_aside(
    part_of_cell: I32,
    part: int,
    start: tuple[int, int],
    search: tuple[int, int, int],
    ways: Iterable[tuple[I64, int]],
) -> list[tuple[int, int]]:
    """Return places that no way, int64 (n, 2), comes near to by its distance, the nearest first."""
    within, spacing, most = search
    row, column = start[1] // SUB, start[0] // SUB
    rows, columns = np.indices(part_of_cell.shape)
    near = (abs(rows - row) <= within) & (abs(columns - column) <= within)
    steps = walking_distance(near & (part_of_cell == part), np.array([[row, column]]))
    found = []
    for r in range(0, part_of_cell.shape[0], spacing):
        for c in range(0, part_of_cell.shape[1], spacing):
            at = np.array([c * SUB + CELL_CENTRE, r * SUB + CELL_CENTRE])
            clear = all(((at - way) ** 2).sum(axis=1).min() > reach**2 for way, reach in ways)
            if steps[r, c] > 0 and clear:
                found.append((int(steps[r, c]), r, c, tuple(at.tolist())))
    return [place for *_, place in sorted(found)[:most]]


def first_free(candidates: Iterable[list[Row]], is_free: Callable[[I64], bool]) -> list[Row] | None:
    """Return the first of some tracks that meets nobody."""
    return next((rows for rows in candidates if is_free(np.array(rows))), None)
