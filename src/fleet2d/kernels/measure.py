"""Poses and places measured: in which room, how long in each, and how far."""

from fleet2d._core import count_together, rooms_at, sum_moves

__all__ = ["count_together", "rooms_at", "sum_moves"]
