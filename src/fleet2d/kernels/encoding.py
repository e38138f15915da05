"""Arrays as bytes."""

from fleet2d._core import encode_arrays

__all__ = ["encode_arrays"]
