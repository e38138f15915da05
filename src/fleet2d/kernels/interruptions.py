"""Interruptions of a person's day, as numbers."""

from fleet2d._core import Interruptions

__all__ = ["Interruptions"]
