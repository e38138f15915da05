"""Slow, obvious twin of the kernel that moves the walls of an outline into the free space."""

import numpy as np


def move_walls(ring, reach, half):
    """Lengthen all walls at once, then move them."""
    none = np.zeros((0, 2), np.int64)
    ways = np.sign(np.roll(ring, -1, axis=0) - ring)
    is_corner = (ways != np.roll(ways, 1, axis=0)).any(axis=1)
    corners, ways = ring[is_corner], ways[is_corner]
    x, y = ways.T
    turn = np.roll(x, 1) * y - np.roll(y, 1) * x
    if not len(corners) or (ways == 0).all(axis=1).any() or (turn == 0).any() or (x * y != 0).any():
        return none
    # Where the outline turns right the octagon goes round, farther than the wall.
    at_start = np.where(turn > 0, -reach, half)
    at_end = np.roll(at_start, -1)
    ends = np.roll(corners, -1, axis=0)
    lengths = np.abs(ends - corners).sum(axis=1)
    # A step that is lower than the slanted side of the octagon is hidden behind that.
    hidden = lengths + at_start + at_end <= 0
    is_low = hidden & (turn != np.roll(turn, -1))
    rises = is_low & (turn > 0)
    falls = np.roll(is_low & (turn < 0), 1)
    at_end = np.where(np.roll(rises, -1), -half - np.roll(lengths, -1), at_end)
    at_start = np.where(falls, -half - np.roll(lengths, 1), at_start)
    left = lengths + at_start + at_end
    if (hidden & np.roll(hidden, 1)).any() or ((left <= 0) & ~is_low).any():
        return none
    inwards = reach * np.stack([-y, x], axis=1)
    first = corners + inwards - at_start[:, None] * ways
    last = ends + inwards + at_end[:, None] * ways
    # Where it turns left, a side begins where the one before it ends.
    kept = np.stack([(turn < 0) | falls, np.ones_like(is_low)], axis=1) & ~is_low[:, None]
    return np.stack([first, last], axis=1)[kept]
