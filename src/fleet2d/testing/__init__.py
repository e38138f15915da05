"""Tests of robots and of algorithms: trials over many seeds, and checks of one's own components."""

from fleet2d.testing.algorithms import check_algorithm as check_algorithm

__all__ = ["check_algorithm"]
