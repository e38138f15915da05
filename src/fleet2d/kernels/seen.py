"""The cells that a camera sees: those whose centre is in range, in its angle, and in sight."""

from typing import NamedTuple

from fleet2d._core import cells_in_view, mark_spans

__all__ = ["Reach", "cells_in_view", "mark_spans"]


class Reach(NamedTuple):
    """How far and how wide a camera sees."""

    near_squared: int  # lattice units squared, below 2**52
    far_squared: int
    half_angle: int  # 1/8192 of a turn; 4096 and more is all round
