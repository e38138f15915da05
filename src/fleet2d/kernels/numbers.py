"""Numbers that are the same on every machine: random bits, headings, and arrays as bytes.

Random bits are a pure function of (key, counter), so no draw depends on another. The generator is
SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", OOPSLA 2014)
addressed by counter instead of by state. Keys come from :mod:`fleet2d.runtime.determinism`.

Headings are integers: 4096 to a turn, counter-clockwise from +x, with one table of sines. No sine
or arc tangent is computed at run time: they differ in the last bit between machines. The table is
rounded to 2**-30, where all math libraries agree (a test checks its digest).

Constants:
    TURN, HALF_TURN, QUARTER: Headings in a turn, half of one and a quarter.
    UNIT: Length of a direction vector.
    SINES: UNIT times the sines of a quarter turn at half-heading resolution, int64 (2049,): entry i
        is the angle i * 2 pi / 8192.
"""

import math
from functools import cache
from typing import Any

import numpy as np

# Names that are imported as themselves are part of this module.
# isort: off
from fleet2d._core import (
    BELL_STD as BELL_STD,
    cosine as cosine,
    encode_arrays as encode_arrays,
    half_sine as half_sine,
    HALF_TURN as HALF_TURN,
    heading_of as heading_of,
    QUARTER as QUARTER,
    random_bell as random_bell,
    random_bells as random_bells,
    random_below as random_below,
    random_uniform as random_uniform,
    sine as sine,
    StepDraws as StepDraws,
    TURN as TURN,
    turn_between as turn_between,
    UNIT as UNIT,
)
# isort: on

from fleet2d._core import SINES
from fleet2d.kernels import I64


def in_radians(heading: int | I64) -> Any:
    """Return headings in radians, 0 to 2 pi."""
    return heading * (2 * math.pi / TURN)


def turned(x: I64, y: I64, angle: I64) -> tuple[I64, I64]:
    """Return points turned about the origin, rounded: x and y.

    Args:
        x: int64 (n,), at most 2**31.
        y: int64 (n,), at most 2**31.
        angle: Any integers, 1/8192 of a turn, which is half a heading, int64 (n,).

    Example:
        >>> turned(np.array([10, 10]), np.array([0, 5]), np.array([2048, -2048]))
        (array([0, 5]), array([ 10, -10]))
    """
    sines, half = half_sines(), UNIT // 2
    along, up = sines[(angle + 2 * QUARTER) % (2 * TURN)], sines[angle % (2 * TURN)]
    return (x * along - y * up + half) // UNIT, (x * up + y * along + half) // UNIT


@cache
def half_sines() -> I64:
    """Return UNIT times the sines of a whole turn: entry i is the angle i * 2 pi / 8192."""
    rising = SINES[:-1]
    falling = SINES[:0:-1]
    return np.concatenate([rising, falling, -rising, -falling])
