"""Poses over time: tracks between breakpoints, and the random walk of a meandering body.

A *track* is five arrays over its breakpoints i: time [us], x, y [lattice], heading [1/4096 turn], and
away (1 = not at home). Between two breakpoints the pose moves in a straight line and turns the
shorter way, both at constant rate; after the last one it stays.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import TURN, cosine, heading_of, sine, turn_between
from fleet2d.kernels.mesh import Mesh, locate, strictly_inside
from fleet2d.kernels.random import random_bell
from fleet2d.kernels.sight import line_of_sight

I64 = NDArray[np.int64]


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
    last = track.time.shape[0] - 1
    i = last_breakpoint(track.time, begin)
    j = 0
    while j < count:
        moment = begin + j * step
        while i < last and track.time[i + 1] <= moment:
            i += 1
        x, y, heading = track.x[i], track.y[i], track.heading[i]
        stop = count
        dx = dy = turn = whole = np.int64(0)
        if i < last:
            whole = track.time[i + 1] - track.time[i]
            stop = min(count, j + (track.time[i + 1] - moment + step - 1) // step)
            dx, dy = track.x[i + 1] - x, track.y[i + 1] - y
            turn = turn_between(heading, track.heading[i + 1])
        away = track.away[i]
        if dx == 0 and dy == 0 and turn == 0:  # standing still: most of a life
            for s in range(j, stop):
                out.x[s], out.y[s], out.heading[s], out.away[s] = x, y, heading, away
        else:
            for s in range(j, stop):
                elapsed = begin + s * step - track.time[i]
                out.x[s] = interpolate(x, dx, elapsed, whole)
                out.y[s] = interpolate(y, dy, elapsed, whole)
                out.heading[s] = interpolate(heading, turn, elapsed, whole) & (TURN - 1)
                out.away[s] = away
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
            now += np.int64(np.ceil(turn * 1e6 / turn_rate))
            heading = towards
            out[rows, 0], out[rows, 1], out[rows, 2] = now, route[i - 1, 0], route[i - 1, 1]
            out[rows, 3] = heading
            rows += 1
        now += np.int64(np.ceil(np.sqrt(np.float64(dx * dx + dy * dy)) * 1e6 / speed))
        out[rows, 0], out[rows, 1], out[rows, 2] = now, route[i, 0], route[i, 1]
        out[rows, 3] = heading
        rows += 1
    return rows


class WalkRule(NamedTuple):
    """How a meandering body moves in one step."""

    key: np.uint64  # of its random stream
    stride: int  # 1/256 lattice units forward
    sway: int  # standard deviation of the turn, in 2**-16 headings per unit of random_bell
    turn_limit: int  # headings


@kernel
def trace_meander(
    walls: Mesh, space: Mesh, rule: WalkRule, first: int, start: I64, out: Poses
) -> None:
    """Walk at random from `start` (x, y, heading at step `first`) for len(out.x) steps.

    In each step the body turns by a bell-shaped random angle and goes one stride forward, unless
    that would leave `space`, the places its centre may be; then it only turns. out[j] is the pose at
    step first + j.
    """
    x, y, heading = start[0], start[1], start[2]
    triangle = locate(space, x, y)
    # A walked path may end on the very border of the space; from there any way in is allowed.
    inside = triangle >= 0 and strictly_inside(space, x, y)
    for j in range(out.x.shape[0]):
        out.x[j], out.y[j], out.heading[j], out.away[j] = x, y, heading, 0
        turn = (random_bell(rule.key, first + j) * rule.sway + 32768) >> 16
        turn = min(max(turn, -rule.turn_limit), rule.turn_limit)
        heading = (heading + turn) & (TURN - 1)
        nx = x + ((rule.stride * cosine(heading) + (1 << 37)) >> 38)
        ny = y + ((rule.stride * sine(heading) + (1 << 37)) >> 38)
        if inside:
            if line_of_sight(space, x, y, triangle, nx, ny):
                x, y = nx, ny
                triangle = locate(space, x, y)
        else:
            start = locate(walls, x, y)
            if strictly_inside(space, nx, ny) and line_of_sight(walls, x, y, start, nx, ny):
                x, y, inside = nx, ny, True
                triangle = locate(space, x, y)
