"""Headings as integers: 4096 to a turn, counter-clockwise from +x, with one table of sines.

No sine or arc tangent is computed at run time: they differ in the last bit between machines. The
table is rounded to 2**-30, where all math libraries agree (a test checks its digest).

Constants:
    TURN, HALF_TURN, QUARTER: Headings in a turn, half of one and a quarter.
    UNIT: Length of a direction vector.
    SINES: UNIT times the sines of a quarter turn at half-heading resolution, int64 (2049,): entry i
        is the angle i * 2 pi / 8192.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d._core import (
    HALF_TURN,
    QUARTER,
    SINES,
    TURN,
    UNIT,
    cosine,
    half_sine,
    heading_of,
    sine,
    turn_between,
)

__all__ = [
    "HALF_TURN",
    "QUARTER",
    "SINES",
    "TURN",
    "UNIT",
    "cosine",
    "half_sine",
    "heading_of",
    "in_radians",
    "sine",
    "turn_between",
]


def in_radians(heading: int | NDArray[np.int64]) -> Any:
    """Return headings in radians, 0 to 2 pi."""
    return heading * (2 * math.pi / TURN)
