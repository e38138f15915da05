"""Evidence in bins: how much was in view, and what presence adds up to, in one order of sums."""

from fleet2d._core import gather_views, sum_places

__all__ = ["gather_views", "sum_places"]
