"""Masks of pixels: their connected parts, how far one is from another, and the rings round them.

What lies outside an array counts as not in the mask.
"""

from fleet2d._core import count_steps, label_parts, trace_rings

__all__ = ["count_steps", "label_parts", "trace_rings"]
