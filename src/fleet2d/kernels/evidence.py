"""Evidence in bins: how much was in view, and sums of presence, in one order of summation."""

from fleet2d._core import gather_views, sum_places

__all__ = ["gather_views", "sum_places"]
