"""How a camera errs: misses, mistaken identities, noise, and people that aren't there.

Probabilities are integers in units of 2**-31, read from tables that set-up has filled, so that
every draw is a comparison of integers: the same on every machine.
"""

from typing import NamedTuple

import numpy as np

from fleet2d._core import (
    AT_BEARING,
    AT_DISTANCE,
    AT_FACING,
    AT_LIGHT,
    AT_MISTAKEN,
    AT_POSTURE,
    AT_RIGHT,
    AT_SEEMS,
    AT_SHOWN,
    AT_STAY,
    BEARING_NOISE,
    BINS,
    DOUBLINGS,
    FORCED_IDENTITY,
    FORCED_MISS,
    HEADING_NOISE,
    KEEPS,
    MINUTES,
    MOST_GHOSTS,
    NOBODY,
    ONE,
    POSTURES,
    RANGE_NOISE,
    RANGE_SHARE,
    SHIFT,
    TABLE,
    About,
    GhostDraw,
    UserDraw,
    distance_bin,
    length,
    notice_chance,
    perceived_offset,
    perceived_posture,
    persistence_chance,
    pick,
    random_share,
    random_shares,
    steady_chance,
    turn_and_stretch,
)
from fleet2d.kernels import I64, U64

__all__ = [
    "AT_BEARING",
    "AT_DISTANCE",
    "AT_FACING",
    "AT_LIGHT",
    "AT_MISTAKEN",
    "AT_POSTURE",
    "AT_RIGHT",
    "AT_SEEMS",
    "AT_SHOWN",
    "AT_STAY",
    "BEARING_NOISE",
    "BINS",
    "DOUBLINGS",
    "FORCED_IDENTITY",
    "FORCED_MISS",
    "HEADING_NOISE",
    "KEEPS",
    "MINUTES",
    "MOST_GHOSTS",
    "NOBODY",
    "ONE",
    "POSTURES",
    "RANGE_NOISE",
    "RANGE_SHARE",
    "SHIFT",
    "TABLE",
    "About",
    "ErrorTables",
    "GhostDraw",
    "UserDraw",
    "distance_bin",
    "length",
    "notice_chance",
    "perceived_offset",
    "perceived_posture",
    "persistence_chance",
    "pick",
    "random_share",
    "random_shares",
    "steady_chance",
    "turn_and_stretch",
]


class ErrorTables(NamedTuple):
    """The errors of the cameras of one robot. The first axis of every array is the camera.

    "Cumulative" tables hold in entry i the probability of all outcomes up to i.
    """

    table: I64  # (cameras, TABLE): the parts AT_DISTANCE to HEADING_NOISE, one after the other
    confusion: I64  # (cameras, users, users): which user one is mistaken for, cumulative
    has_ghosts: I64  # (cameras,): 1 if there are false positives
    ghosts: I64  # (cameras, MOST_GHOSTS): number in one look, of all sources, cumulative
    source: I64  # (cameras, sources): the source of one, cumulative
    spot: I64  # (cameras, sources, 3): x, y, noise as RANGE_NOISE; source 0 is the whole view
    looks_like: I64  # (cameras, users + 1): identity of a false positive, nobody last, cumulative
    keys: U64  # (cameras, users, len(UserDraw)): streams
    ghost_keys: U64  # (cameras, len(GhostDraw)): streams
    injected: I64 = np.zeros((0, 5), np.int64)  # (n, 5): camera, identity, x, y, heading
