"""Draws of days from the plan of a template, as numbers."""

from fleet2d._core import DayPlanner

__all__ = ["DayPlanner"]
