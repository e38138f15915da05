"""Stays of a person given all evidence, earlier and later; and what to learn from them."""

from fleet2d._core import smooth

__all__ = ["smooth"]
