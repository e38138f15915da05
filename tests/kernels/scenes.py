"""Tracks and timelines of bodies, written as rows."""

import numpy as np

from fleet2d.kernels import Breakpoints, Timelines

STANDING = np.zeros(0, np.int64), np.zeros(1, np.int8)
"""When a body takes another posture, and which ones it takes: it always stands."""


def breakpoints(rows):
    """Return a track of rows (time, x, y, heading, away)."""
    *columns, away = np.array(rows, np.int64).reshape(-1, 5).T
    return Breakpoints(*map(np.ascontiguousarray, columns), away.astype(np.uint8))


def following(tracks, step_us=10**6):
    """Return the timelines of bodies that follow tracks."""
    timelines = Timelines(len(tracks), step_us)
    for body, track in enumerate(tracks):
        timelines.follow(body, 0, track, *STANDING)
    return timelines
