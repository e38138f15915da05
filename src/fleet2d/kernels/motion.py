"""Poses over time: tracks between breakpoints, and the random walk of a meandering body.

A *track* is five arrays over its breakpoints i: time [us], x, y [lattice], heading [1/4096 turn],
and away (1 = not at home). Between two breakpoints the pose moves in a straight line and turns the
shorter way, both at constant rate; before the first and after the last one it stays.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import TURN, cosine, heading_of, sine, turn_between
from fleet2d.kernels.mesh import Mesh, inside_triangle, locate, strictly_inside
from fleet2d.kernels.random import random_bell, random_below
from fleet2d.kernels.sight import line_of_sight, walk_line_of_sight

I64 = NDArray[np.int64]

# Draws for blocked steps are this far along the stream, where no step's own draw ever comes.
BLOCKED = 1 << 62


class Breakpoints(NamedTuple):
    """The arrays of a track, all of one length."""

    time: I64
    x: I64
    y: I64
    heading: I64
    away: NDArray[np.uint8]


class Poses(NamedTuple):
    """Poses of one body over consecutive steps, all arrays of one length."""

    x: I64
    y: I64
    heading: I64
    away: NDArray[np.uint8]


def empty_poses(count: int) -> Poses:
    """Return poses to be filled."""
    x, y, heading = (np.empty(count, np.int64) for _ in range(3))
    return Poses(x, y, heading, np.empty(count, np.uint8))


def paste_poses(out: Poses, begin: int, part: Poses, taken: slice) -> None:
    """Write the taken poses of `part` to `out`, from `begin` on."""
    count = len(part.x[taken])
    for name in Poses._fields:
        getattr(out, name)[begin : begin + count] = getattr(part, name)[taken]


@kernel
def interpolate(start: int, change: int, elapsed: int, whole: int) -> int:
    """Return start + change * elapsed / whole, rounded to nearest (halves up)."""
    return start + (2 * change * elapsed + whole) // (2 * whole)


@kernel
def last_breakpoint(time: I64, moment: int) -> int:
    """Return the last index i with time[i] <= moment (0 if there is none)."""
    low, high = 0, time.shape[0]
    while high - low > 1:
        middle = (low + high) >> 1
        if time[middle] <= moment:
            low = middle
        else:
            high = middle
    return low


@kernel
def trace_track(track: Breakpoints, begin: int, step: int, count: int, out: Poses) -> None:
    """Write the poses at times begin, begin + step, … [us] to out[0:count]."""
    # Taking an array out of a tuple costs a counted reference, so it is done once, not per step.
    xs, ys, headings, aways = out.x, out.y, out.heading, out.away
    time = track.time
    last = time.shape[0] - 1
    i = last_breakpoint(time, begin)
    j = 0
    while j < count:
        moment = begin + j * step
        while i < last and time[i + 1] <= moment:
            i += 1
        x, y, heading, away = track.x[i], track.y[i], track.heading[i], track.away[i]
        stop = count
        dx = dy = turn = whole = 0
        if time[i] > moment:  # not begun: it stands where it will start
            stop = min(count, j + (time[i] - moment + step - 1) // step)
        elif i < last:
            whole = int(time[i + 1] - time[i])
            stop = min(count, j + (time[i + 1] - moment + step - 1) // step)
            dx, dy = int(track.x[i + 1] - x), int(track.y[i + 1] - y)
            turn = turn_between(heading, track.heading[i + 1])
        if dx == 0 and dy == 0 and turn == 0:  # standing still: most of a life
            for s in range(j, stop):
                xs[s], ys[s], headings[s], aways[s] = x, y, heading, away
        else:
            for s in range(j, stop):
                elapsed = begin + s * step - time[i]
                xs[s] = interpolate(x, dx, elapsed, whole)
                ys[s] = interpolate(y, dy, elapsed, whole)
                headings[s] = interpolate(heading, turn, elapsed, whole) & (TURN - 1)
                aways[s] = away
        j = stop


@kernel
def time_route(
    route: I64, begin: int, heading: int, speed: float, turn_rate: float, out: I64
) -> int:
    """Turn a polyline into breakpoints: turn on the spot towards each leg, then walk it.

    `route` is (n, 2) lattice points, `begin` [us] and `heading` the state at route[0], `speed`
    [units/s], `turn_rate` [headings/s]. Writes (time, x, y, heading) rows to `out`
    (at least 2 n rows) and returns their number; the first row is the start.
    """
    now = begin
    out[0, 0], out[0, 1], out[0, 2], out[0, 3] = now, route[0, 0], route[0, 1], heading
    rows = 1
    for i in range(1, route.shape[0]):
        dx, dy = route[i, 0] - route[i - 1, 0], route[i, 1] - route[i - 1, 1]
        if dx == 0 and dy == 0:
            continue
        towards = heading_of(dx, dy)
        turn = abs(turn_between(heading, towards))
        if turn > 0:
            now += int(np.ceil(turn * 1e6 / turn_rate))
            heading = towards
            out[rows, 0], out[rows, 1], out[rows, 2] = now, route[i - 1, 0], route[i - 1, 1]
            out[rows, 3] = heading
            rows += 1
        now += int(np.ceil(np.sqrt(np.float64(dx * dx + dy * dy)) * 1e6 / speed))
        out[rows, 0], out[rows, 1], out[rows, 2] = now, route[i, 0], route[i, 1]
        out[rows, 3] = heading
        rows += 1
    return rows


class WalkRule(NamedTuple):
    """How a meandering body moves in one step."""

    key: np.uint64  # of its random stream
    stride: int  # 1/256 lattice units forward
    sway: int  # standard deviation of the turn, in 2**-16 headings per unit of random_bell
    turn_limit: int  # headings, half a turn at most


@kernel
def trace_meander(
    walls: Mesh, space: Mesh, rule: WalkRule, first: int, start: I64, out: Poses
) -> None:
    """Walk at random from `start` (x, y, heading at step `first`) for len(out.x) steps.

    In each step the body turns by a bell-shaped random angle and goes one stride forward. If that
    would leave `space`, the places its centre may be, it stays and turns by any angle within its
    limit instead, all equally likely, so that it comes away from the wall. out[j] is the pose at
    step first + j.
    """
    x, y, heading = start[0], start[1], start[2]
    # Taking an array out of a tuple costs a counted reference, so it is done once, not per step.
    xs, ys, headings, aways = out.x, out.y, out.heading, out.away
    vertices, triangles, neighbors = space.vertices, space.triangles, space.neighbors
    triangle = locate(space, x, y)
    # A walked path may end on the very border of the space; from there any way in is allowed.
    inside = triangle >= 0 and strictly_inside(space, x, y)
    for j in range(xs.shape[0]):
        xs[j], ys[j], headings[j], aways[j] = x, y, heading, 0
        before = heading
        turn = (random_bell(rule.key, first + j) * rule.sway + 32768) >> 16
        turn = min(max(turn, -rule.turn_limit), rule.turn_limit)
        heading = (heading + turn) & (TURN - 1)
        nx = x + ((rule.stride * cosine(heading) + (1 << 37)) >> 38)
        ny = y + ((rule.stride * sine(heading) + (1 << 37)) >> 38)
        if inside:
            if inside_triangle(vertices, triangles, triangle, nx, ny):  # most steps are small
                x, y = nx, ny
                continue
            if walk_line_of_sight(vertices, triangles, neighbors, x, y, triangle, nx, ny):
                x, y = nx, ny
                triangle = locate(space, x, y)
                continue
        elif strictly_inside(space, nx, ny):
            if line_of_sight(walls, x, y, locate(walls, x, y), nx, ny):
                x, y, inside = nx, ny, True
                triangle = locate(space, x, y)
                continue
        choices = 2 * rule.turn_limit + 1
        turn = random_below(rule.key, BLOCKED + first + j, choices) - rule.turn_limit
        heading = (before + turn) & (TURN - 1)
