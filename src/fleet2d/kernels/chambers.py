"""Functions for the segmentation of rooms: which places see each other, the nearest label."""

from fleet2d._core import fill_from_neighbors, label_frames, pairs_in_sight, spread_labels

__all__ = ["fill_from_neighbors", "label_frames", "pairs_in_sight", "spread_labels"]
