"""The cheapest way to move one distribution onto another."""

from fleet2d._core import earth_mover

__all__ = ["earth_mover"]
