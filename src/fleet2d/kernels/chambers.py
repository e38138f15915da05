"""What the search for rooms asks often: which places see each other, which label is nearest."""

from fleet2d._core import fill_beside, label_frames, see_each, spread_labels

__all__ = ["fill_beside", "label_frames", "see_each", "spread_labels"]
