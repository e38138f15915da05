"""Forecasts of presence, counts of sightings, and resampled days, in one order of summation.

BLAS and einsum add in an order that depends on the machine. These loops don't, so learned models,
and the decisions of robots that follow from them, are the same everywhere.
"""

from fleet2d._core import advance, list_sightings, resampled

__all__ = ["advance", "list_sightings", "resampled"]
