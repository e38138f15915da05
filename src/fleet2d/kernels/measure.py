"""Measurements of poses: rooms, time spent together, and distances covered."""

from fleet2d._core import count_together, rooms_at, sum_moves

__all__ = ["count_together", "rooms_at", "sum_moves"]
