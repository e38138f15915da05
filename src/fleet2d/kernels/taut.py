"""Straighten a path over cells of different cost, as far as it doesn't become more expensive."""

from fleet2d._core import leg_cost, pull_taut

__all__ = ["leg_cost", "pull_taut"]
