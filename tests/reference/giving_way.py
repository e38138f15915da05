"""How a body goes on when somebody is in its way, row by row and place by place: slow and obvious.

Rows are [time, x, y, heading, away]. A delay tells after which moment it counts, since when the body is
late, by how much, and up to when.
"""

import math
from itertools import pairwise

import numpy as np

from fleet2d.kernels import CELL_CENTRE, SUB, TURN, UNIT, cosine, sine, walking_distance

Row = list[int]
"""Time, x, y, heading, away."""
ENDLESS = 2**63 - 1


def delayed(rest, since, pose, later):
    """Return rows later than they were planned, and when the rest begins that makes up for it."""
    rows = [[since, *pose], *rest]
    edge = rows[-1][0]
    for before, after in zip(rows, rest, strict=False):
        if before[1:] == after[1:] and after[0] - before[0] >= later:
            edge = before[0]
            break
    times = [t + later if t <= edge else max(t, edge + later) for t, *_ in rest]
    return [[time, *row[1:]] for time, row in zip(times, rest, strict=True)], edge


def next_stop(rows, moment):
    """Return the row from which on a body stands after a moment, where it can stand anywhere."""
    for i, (here, after) in enumerate(pairwise(rows)):
        begun = [row for row in rows if row[0] <= moment]
        if here[1:3] == after[1:3] and after[0] > moment and i >= len(begun) - 1:
            return i
    return -1


def rested(way, until, beat):
    """Return a way that stays until a moment; if it is late, until the next beat."""
    leaves = max(until, -(-way[-1][0] // beat) * beat)
    return [*way, [leaves, *way[-1][1:]]] if leaves > way[-1][0] else way


def going_on(way, rows, after, since, first):
    """Return a way with the rows of a track from number `first` on, delayed, and the delay."""
    later = way[-1][0] - since
    rest, edge = delayed(rows[first:], since, way[-1][1:], later)
    return [*way, *rest], (after, since, later, edge)


def stopping_beside(way, rows, stop, walk, beat):
    """Return a way that ends beside a stop of a track, with the rest of the track from there on."""
    begin = way[0][0]
    since = max(rows[stop][0], begin)
    place = way[-1][1:3]
    leaves = [i for i in range(stop, len(rows)) if rows[i][1:3] != rows[stop][1:3]]
    here = [[time, *place, *pose] for time, _, _, *pose in rows[: leaves[0] if leaves else None]]
    if not leaves:
        way, delay = going_on(way, here, begin, since, stop + 1)
        return way, [delay]
    after = next_stop(rows, rows[leaves[0]][0] - 1)
    if after < 0 or any(row[4] for row in rows[stop:]):
        return None
    later = way[-1][0] - since
    way = way + [[max(time, since) + later, *pose] for time, *pose in here[stop + 1 :]]
    there = walk(way[-1], rows[after][1:3])
    if there is None:
        return None
    way = rested([*way, *there], rows[after][0], beat)
    way, delay = going_on(way, rows, rows[leaves[0] - 1][0], rows[after][0], after + 1)
    return way, [(begin, since, later, ENDLESS), delay]


def way_round(
    now,
    rows,
    met,
    discs,
    beside,
    walk,
    beat,
):
    """Return the way round discs to the next stop of a track after a moment, or beside it."""
    stop = next_stop(rows, met)
    if stop < 0:
        return None
    goal = rows[stop][1:3]
    is_taken = any(math.dist(goal, at) <= reach for *at, reach in discs)
    place = beside if is_taken else goal
    there = None if place is None else walk(now, place)
    if there is None:
        return None
    since = max(rows[stop][0], now[0])
    way = rested([now, *there], since, beat)
    if is_taken:
        return stopping_beside(way, rows, stop, walk, beat)
    way, delay = going_on(way, rows, now[0], since, stop + 1)
    return way, [delay]


def way_from_here(now, rows, met, walk, beat):
    """Return the way on from where a body is, in place of the next stop after a moment."""
    stop = next_stop(rows, met)
    is_last = stop < 0
    stop = len(rows) - 1 if is_last else stop
    since = max(rows[stop][0], now[0])
    return stopping_beside(rested([now], since, 1 if is_last else beat), rows, stop, walk, beat)


def places_aside(
    part_of_cell,
    part,
    start,
    search,
    ways,
):
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


def points_around(middle, distance):
    """Return the points at a distance from a point, in eight directions from +x on."""
    headings = [i * TURN // 8 for i in range(8)]
    return [
        (middle[0] + distance * cosine(h) // UNIT, middle[1] + distance * sine(h) // UNIT)
        for h in headings
    ]


def room_of(room_of_place, x, y):
    """Return the room of a point, -1 outside of all cells."""
    rows, columns = room_of_place.shape
    is_inside = 0 <= y // SUB < rows and 0 <= x // SUB < columns
    return int(room_of_place[y // SUB, x // SUB]) if is_inside else -1


def first_free(candidates, is_free):
    """Return the first of some tracks that meets nobody."""
    return next((rows for rows in candidates if is_free(np.array(rows))), None)
