"""Axes of a study: lists, ranges, grids, samples, homes and people."""
