"""Conversion of configurations of the published Fleet2D to scenarios, with remarks on changes."""

from fleet2d.published.convert import convert_file

__all__ = ["convert_file"]
