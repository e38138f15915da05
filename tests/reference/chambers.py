"""Slow, obvious twins of `fleet2d.kernels`."""

import numpy as np


def nearest_labels(labels, mask):
    """Grow all labels by one step across sides at a time; the lowest wins."""
    out = np.where(mask, labels, -1).astype(np.int32)
    rows, columns = labels.shape
    while True:
        grown = out.copy()
        for row in range(rows):
            for column in range(columns):
                if not mask[row, column] or out[row, column] >= 0:
                    continue
                around = [
                    int(out[row + dr, column + dc])
                    for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0))
                    if 0 <= row + dr < rows and 0 <= column + dc < columns
                ]
                grown[row, column] = min([label for label in around if label >= 0], default=-1)
        if np.array_equal(grown, out):
            return out
        out = grown
