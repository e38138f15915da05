"""Straightening a way over cells of different cost, as far as that makes it no dearer."""

from fleet2d._core import leg_cost, pull_taut

__all__ = ["leg_cost", "pull_taut"]
