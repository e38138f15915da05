"""Turn a configuration of the published Fleet2D into a scenario, and say what changes by it."""

from fleet2d.published.convert import convert_file

__all__ = ["convert_file"]
