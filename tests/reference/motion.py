"""Slow, obvious twins of the motion kernels: fractions, and a look at every wall.

Tracks have rows (time [us], x, y, heading, away).
"""

import math
from fractions import Fraction

import numpy as np
from tests.reference.headings import cosine, sine
from tests.reference.line_of_sight import visible
from tests.reference.random import random_bell, random_below

Pose = tuple[int, int, int, int]
"""x, y, heading, away."""

TURN = 4096


def half_up(value):
    """Return the nearest integer; of two, the greater."""
    return math.floor(value + Fraction(1, 2))


def shorter_turn(start, end):
    """Return the signed turn of the least size; clockwise if both ways are half a turn."""
    return min((end - start + k * TURN for k in (-2, -1, 0, 1, 2)), key=lambda t: (abs(t), t))


def pose_at(track, moment):
    """Return the pose at a moment [us]; before its begin and after its end a track stands."""
    if moment < track[0][0]:
        return track[0][1:]
    i = max(i for i, row in enumerate(track) if row[0] <= moment)
    time, x, y, heading, away = track[i]
    if i == len(track) - 1:
        return x, y, heading, away
    later, x1, y1, heading1, _ = track[i + 1]
    share = Fraction(moment - time, later - time)
    turn = shorter_turn(heading, heading1)
    return (
        half_up(x + (x1 - x) * share),
        half_up(y + (y1 - y) * share),
        half_up(heading + turn * share) % TURN,
        away,
    )


def ceiling_of_root(squared):
    """Return the least integer whose square is at least `squared`."""
    root = math.isqrt(math.floor(squared))
    while root * root < squared:
        root += 1
    return root


def least_walk_us(squared, speed):
    """Return the least whole number of microseconds for a leg of length sqrt(squared)."""
    return ceiling_of_root(squared * (10**6 / speed) ** 2)


def walk(
    walls,
    space,
    key,
    stride,
    sway,
    limit,
    start,
    step=0,
):
    """Yield the poses of a random walk from a step on, by a look at every wall of the space.

    Both are int64 (w, 4) pieces of wall. `stride` is in 1/256 lattice units, `sway` in 2**-16
    headings per unit of the bell, `limit` in headings.
    """
    x, y, heading = start
    while True:
        yield x, y, heading
        before = heading
        turn = half_up(Fraction(random_bell(key, step) * sway, 2**16))
        heading = (heading + max(-limit, min(limit, turn))) % TURN
        here = np.array([x, y])
        ahead = (cosine(2 * heading), sine(2 * heading))
        there = here + np.array([half_up(Fraction(part) * stride / 256) for part in ahead])
        on_border = not _sees(space, here, here)
        may_go = _sees(walls, here, there) if on_border else _sees(space, here, there)
        if may_go and _sees(space, there, there):
            x, y = there.tolist()
        else:
            heading = (before + random_below(key, 2**62 + step, 2 * limit + 1) - limit) % TURN
        step += 1


def _sees(walls, here, there):
    return bool(visible(walls, here, there[None])[0])
