"""Forecasts of presence, sightings and resampled days: no logarithm, and one order of sums.

BLAS and einsum add in an order that depends on the machine. These loops don't, so what is learned,
and where a robot goes because of it, is the same everywhere.
"""

from fleet2d._core import advance, count_sightings, list_sightings, resampled

__all__ = ["advance", "count_sightings", "list_sightings", "resampled"]
