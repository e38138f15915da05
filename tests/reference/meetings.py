"""Meetings of bodies, by looking at a hundred moments of each step: slow and obvious.

A way returns x and y at a moment [steps].
"""

import numpy as np

MOMENTS = 100


def first_meeting(body, other, near, first, end):
    """Return the first step in which two bodies approach each other below a distance, or None."""
    for step in range(first, end):
        moments = step + np.arange(MOMENTS + 1) / MOMENTS
        apart = np.array([np.hypot(*np.subtract(body(t), other(t))) for t in moments.tolist()])
        if ((apart[1:] < near) & (apart[1:] < apart[:-1])).any():
            return step
    return None
