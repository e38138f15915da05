"""Headings as integers: 4096 to a turn, counter-clockwise from +x, with one table of sines.

Angles never meet a sine or an arc tangent at run time: those differ in the last bit between
machines. The table is rounded to 2**-30, where no libm disagrees (a test pins its digest).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel

TURN = 4096  # headings per turn
HALF_TURN = TURN // 2
QUARTER = TURN // 4
UNIT = 1 << 30  # length of a direction vector
# Sines of a quarter turn at half-heading resolution: entry i is the angle i * 2 pi / 8192.
SINES = np.array(
    [round(math.sin(2 * math.pi * i / (2 * TURN)) * UNIT) for i in range(2 * QUARTER + 1)],
    dtype=np.int64,
)


@kernel
def half_sine(half: int) -> int:
    """Return UNIT * sine of `half` / 8192 of a turn."""
    h = half & (2 * TURN - 1)
    if h < TURN:
        return int(SINES[h] if h <= 2 * QUARTER else SINES[TURN - h])
    h -= TURN
    return -int(SINES[h] if h <= 2 * QUARTER else SINES[TURN - h])


@kernel
def sine(heading: int) -> int:
    """Return UNIT * sine of a heading (any integer)."""
    return half_sine(2 * heading)


@kernel
def cosine(heading: int) -> int:
    """Return UNIT * cosine of a heading (any integer)."""
    return half_sine(2 * (heading + QUARTER))


@kernel
def heading_of(dx: int, dy: int) -> int:
    """Return the heading nearest to the vector (dx, dy) [lattice units]; 0 for a null vector."""
    turned = 0
    while not (dx > 0 and dy >= 0):  # into the first quadrant, half open
        if dx == 0 and dy == 0:
            return 0
        dx, dy = dy, -dx
        turned += QUARTER
    low, high = 0, QUARTER  # the answer is `low` once no half-way direction lies between
    while low < high:
        middle = (low + high) >> 1
        half_way = 2 * middle + 1
        if half_sine(half_way + 2 * QUARTER) * dy - half_sine(half_way) * dx >= 0:
            low = middle + 1
        else:
            high = middle
    return (turned + low) & (TURN - 1)


@kernel
def turn_between(start: int, end: int) -> int:
    """Return the shorter signed turn from `start` to `end`, in [-2048, 2047]."""
    return ((end - start + HALF_TURN) & (TURN - 1)) - HALF_TURN


def in_radians(heading: int | NDArray[np.int64]) -> Any:
    """Return headings in radians, 0 to 2 pi."""
    return heading * (2 * math.pi / TURN)
