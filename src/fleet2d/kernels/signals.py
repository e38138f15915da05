"""Signals of a run as stretches of equal value: distances, speeds, and windows over time."""

from fleet2d._core import distances_between, distances_to_shape, sliding_max, speeds, until

__all__ = ["distances_between", "distances_to_shape", "sliding_max", "speeds", "until"]
