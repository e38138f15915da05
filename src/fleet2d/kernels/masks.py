"""Masks of pixels: their connected parts, distances within them, and the rings around them.

Pixels outside an array count as not in the mask.
"""

from fleet2d._core import count_steps, label_parts, trace_rings

__all__ = ["count_steps", "label_parts", "trace_rings"]
